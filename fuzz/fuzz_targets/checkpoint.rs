#![no_main]
//! Any text: a checkpoint or a fault that can be shown, never a panic.

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else { return };
    if let Err(faults) = coilwright::io::write::checkpoint::parse_checkpoint("checkpoint.json", text, "") {
        let _ = faults.to_string();
    }
});
