//! See `quietpath_abuse::problem::planned`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| quietpath_abuse::problem::planned(bytes));
