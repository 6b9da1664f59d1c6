#![no_main]
//! Any text, also with the checksum that it should have: a checkpoint or a fault that can be shown, never a panic.

use coilwright::io::files::sha256_hex;
use coilwright::io::write::checkpoint::parse_checkpoint;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else { return };
    if let Err(faults) = parse_checkpoint("checkpoint.json", text, "") {
        let _ = faults.to_string();
    }
    // Nobody comes upon a checksum by chance.
    let Ok(serde_json::Value::Object(mut document)) = serde_json::from_str(text) else { return };
    let Some(checksum) = document.get_mut("checksum") else { return };
    *checksum = "".into();
    let blank = serde_json::Value::Object(document.clone()).to_string();
    document.insert("checksum".to_owned(), sha256_hex(&blank).into());
    let fingerprint = document.get("fingerprint").and_then(serde_json::Value::as_str).unwrap_or_default().to_owned();
    let whole = serde_json::Value::Object(document).to_string();
    if let Err(faults) = parse_checkpoint("checkpoint.json", &whole, &fingerprint) {
        let _ = faults.to_string();
    }
});
