#![no_main]
//! Any bytes as a stream: every row comes out as one of a table with two more columns, or the header is refused.

use std::path::Path;
use std::sync::OnceLock;

use coilwright::compensate::{Compensator, Method};
use coilwright::io::read::model_file::parse_model;
use coilwright::io::read::record_columns::RecordFormat;
use coilwright::io::write::compensation_file::compensate_lines;
use coilwright::pattern::classic::Classic;

fn compensator() -> &'static Compensator {
    static MADE: OnceLock<Compensator> = OnceLock::new();
    MADE.get_or_init(|| {
        let file = parse_model(Path::new("model.toml"), include_str!("../corpus/model/paper-200m.toml")).expect("a model");
        let pattern = Classic::Qua.pattern(file.model.coil.layers()).expect("a pattern");
        Compensator::declared(Method::Physical, &file.model, &pattern).expect("a compensator")
    })
}

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let mut out = Vec::new();
    if compensate_lines(compensator(), &RecordFormat::default(), "record", data, &mut out).is_err() {
        return;
    }
    let text = String::from_utf8(out).expect("lines of text");
    let table: String = text.lines().filter(|line| !line.starts_with('#')).map(|line| line.to_owned() + "\n").collect();
    let division = coilwright::io::read::record_columns::Division::of_header(table.lines().next().unwrap_or_default());
    let mut reader = csv::ReaderBuilder::new().delimiter(division.separator).from_reader(table.as_bytes());
    assert!(reader.records().all(|row| row.is_ok()), "{table}");
    assert!(!text.to_lowercase().contains("nan"));
});
