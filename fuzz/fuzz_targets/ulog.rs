#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| tumble_fuzz::ulog_file(data));
