#![no_main]
//! See `rubor_fuzz::TARGETS`.

rubor_fuzz::libfuzzer_target!("own");
