//! See `quietpath_abuse::wire::bytes`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| quietpath_abuse::wire::bytes(bytes));
