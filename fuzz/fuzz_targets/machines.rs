//! See `quietpath_abuse::machines::messages`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| quietpath_abuse::machines::messages(bytes));
