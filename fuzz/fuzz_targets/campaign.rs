#![no_main]
//! Any text: a campaign or faults that can be drawn, never a panic.

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else { return };
    if let Err(faults) = coilwright::io::read::campaign_file::parse_campaign(std::path::Path::new("c.toml"), text) {
        let _ = faults.to_string();
    }
});
