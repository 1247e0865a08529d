//! See `quietpath_abuse::text::observations`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| quietpath_abuse::text::observations(bytes));
