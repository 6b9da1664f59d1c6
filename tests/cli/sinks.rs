//! Every kind of file that the program writes, read again by other readers than its own.
//!
//! A second TOML parser, the CSV, JSON and XML libraries, a C compiler with all warnings as errors, and a machine that takes G-code
//! as a controller does. A file whose last name has no entry in [`SINKS`] fails.

use std::path::Path;

use coilwright::text::is_unseen;
use coilwright::text::sink::Cell;
use serde_json::Value;

/// What reads a file that a command wrote.
type Reader = fn(&Path, &str);

/// By the file's last name.
const SINKS: &[(&str, Reader)] = &[
    ("toml", |_, text| drop(toml(text))),
    ("json", |_, text| json(text)),
    ("csv", |_, text| drop(table(text))),
    ("svg", |_, text| picture(text)),
    ("html", |_, text| page(text)),
    ("h", |path, _| compiles(path)),
    ("gcode", |_, text| machine(text)),
    // The files of an engine hold nothing from outside.
    ("", |_, text| assert_eq!(text, include_str!("../../src/io/write/workflow/Snakefile"))),
    ("yaml", |_, text| {
        let shipped = [
            include_str!("../../src/io/write/workflow/laptop.yaml"),
            include_str!("../../src/io/write/workflow/slurm.yaml"),
        ];
        assert!(shipped.contains(&text));
    }),
    ("sh", |_, text| script(text)),
    ("conf", |_, text| script(text)),
];

/// A second parser, which shares nothing with the program's own.
pub fn toml(text: &str) -> Value {
    assert!(!text.contains(|c| is_unseen(c) && c != '\n' && c != '\t'), "{text:?}");
    basic_toml::from_str(text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn json(text: &str) {
    drop(serde_json::from_str::<Value>(text).unwrap_or_else(|e| panic!("{e}\n{text:.2000}")));
    assert!(!text.contains(|c: char| c.is_control() && c != '\n'), "{text:.2000}");
}

/// Rectangular, and without a formula. What is no number is given as the program reads it.
pub fn table(text: &str) -> Vec<Vec<String>> {
    let mut reader = csv::ReaderBuilder::new().has_headers(false).comment(Some(b'#')).from_reader(text.as_bytes());
    let rows: Vec<Vec<String>> = reader.records().map(|r| r.unwrap().iter().map(str::to_owned).collect()).collect();
    for cell in rows.iter().flatten().filter(|cell| cell.parse::<f64>().is_err()) {
        let signs = ['=', '+', '-', '@', '\t', '\r', '\n', '＝', '＋', '－', '＠'];
        assert!(!cell.starts_with(signs), "{cell:?} is a formula");
        assert!(!cell.contains(|c| is_unseen(c) && c != '\n'), "{cell:?}");
    }
    rows.into_iter().map(|row| row.iter().map(|cell| Cell::read(cell).to_owned()).collect()).collect()
}

/// No script, nothing from elsewhere.
fn picture(text: &str) {
    let document = roxmltree::Document::parse(text).unwrap_or_else(|e| panic!("{e}\n{text:.2000}"));
    for node in document.descendants().filter(roxmltree::Node::is_element) {
        assert!(!["script", "foreignObject", "a", "use", "image"].contains(&node.tag_name().name()), "{node:?}");
        for attribute in node.attributes() {
            assert!(!attribute.name().starts_with("on") && attribute.name() != "href", "{attribute:?}");
        }
    }
}

/// One script that runs, no other element that could, and a policy.
fn page(text: &str) {
    let lower = text.to_lowercase();
    // What holds data does not run.
    let held = |kind: &str| lower.matches(&format!("<script type=\"{kind}\"")).count();
    let data = held("application/json") + held("text/plain");
    assert_eq!(lower.matches("<script").count(), lower.matches("</script>").count());
    assert!(lower.matches("<script").count() <= 1 + data);
    // What stands between angle brackets is markup; a name's own brackets are quoted.
    for tag in lower.split('<').skip(1).filter_map(|rest| rest.split('>').next()) {
        let name = tag.split([' ', '/']).next().unwrap_or_default();
        assert!(!["img", "iframe", "object", "embed", "base", "form"].contains(&name), "<{tag}>");
        assert!(![" onerror=", " onload=", " onclick="].iter().any(|attribute| tag.contains(attribute)), "<{tag}>");
    }
    assert!(lower.contains("http-equiv=\"content-security-policy\" content=\"default-src 'none'"));
    assert!(!text.contains(|c| is_unseen(c) && c != '\n'));
}

/// One assignment or command a line for bash, and nothing unseen.
fn script(text: &str) {
    assert!(!text.contains(|c| is_unseen(c) && c != '\n'));
    match std::process::Command::new("bash").args(["-n", "-c", text]).output() {
        Ok(out) => assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr)),
        Err(_) => println!("skipped: there is no bash"),
    }
}

fn compiles(header: &Path) {
    let source = header.with_extension("c");
    let include = format!("#include {:?}\n", header.file_name().unwrap().to_str().unwrap());
    std::fs::write(&source, include).unwrap();
    for standard in ["-std=c99", "-std=gnu2x"] {
        let mut compiler = std::process::Command::new("cc");
        compiler.args([standard, "-Wall", "-Wextra", "-Werror", "-fsyntax-only"]).arg(&source);
        match compiler.output() {
            Ok(out) => assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr)),
            Err(_) => println!("skipped: there is no C compiler"),
        }
    }
    std::fs::remove_file(source).unwrap();
}

/// A controller: a line without its comments is words, each a letter and a number; it ends at the first `M30` or `%`.
fn machine(text: &str) {
    assert!(text.is_ascii() && !text.contains(|c: char| c.is_control() && c != '\n'));
    let (mut winds, mut ended) = (0, false);
    for line in text.lines() {
        // Whoever takes brackets for comments, as many controllers do, finds none outside of one.
        let code = line.split_once(';').map_or(line, |(code, _)| code).trim();
        assert!(!code.contains(['(', ')', '%', '#', '/']), "{line}");
        for word in code.split_whitespace() {
            assert!(!ended, "{line}: behind the end");
            let (letter, number) = word.split_at(1);
            let number: f64 = number.parse().unwrap_or_else(|_| panic!("{line}"));
            let known = match letter {
                "G" => [0.0, 1.0, 21.0, 90.0, 92.0].contains(&number),
                "M" => [0.0, 6.0, 30.0].contains(&number),
                "T" => number >= 1.0,
                "X" | "C" | "F" => number.is_finite(),
                _ => false,
            };
            assert!(known, "{line}");
            winds += usize::from(word == "G1");
            ended |= word == "M30";
        }
    }
    let layers = text.lines().filter(|line| line.starts_with("; layer ")).count();
    assert!(ended && winds == layers && winds > 0, "{winds} windings, {layers} layers");
}

/// Reads every file below a folder again; how many there were.
pub fn read_again(folder: &Path) -> usize {
    let mut count = 0;
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let path = entry.path();
        if path.is_dir() {
            count += read_again(&path);
            continue;
        }
        let last = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        let (_, reader) = SINKS
            .iter()
            .find(|(extension, _)| *extension == last)
            .unwrap_or_else(|| panic!("{} is a sink without an entry", path.display()));
        reader(&path, &std::fs::read_to_string(&path).unwrap());
        count += 1;
    }
    count
}
