#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lattice_fuzz::read::mesh(bytes));
