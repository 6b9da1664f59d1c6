#![no_main]
//! Any text: profiles, as an experiment is written, or faults that can be drawn, never a panic.

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else { return };
    if let Err(faults) = coilwright::io::read::profile_file::parse_profiles("next.toml", text) {
        let _ = faults.to_string();
    }
});
