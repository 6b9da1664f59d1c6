#![no_main]
//! A mapping on the first line, a record behind it: as a whole and as a stream it is the same record, or none.

use coilwright::io::read::record_columns::RecordFormat;
use coilwright::io::read::record_file::parse_record_as;
use coilwright::io::read::record_rows::stream_rows;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let Some((mapping, record)) = text.split_once('\n') else { return };
    let mut format = RecordFormat::default();
    if format.map_all(mapping).is_err() {
        return;
    }
    let mut rows = 0;
    let streamed = stream_rows("record.csv", record.as_bytes(), &format, |chunk| rows += chunk.len());
    match parse_record_as("record.csv", record, &format) {
        Ok(read) => {
            assert_eq!(read.record.rows(), rows);
            assert_eq!(read.skipped_rows, streamed.expect("it was read as a whole").skipped_rows);
        }
        Err(faults) => {
            let _ = faults.to_string();
        }
    }
});
