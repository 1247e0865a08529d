//! See `quietpath_abuse::text::plan`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| quietpath_abuse::text::plan(bytes));
