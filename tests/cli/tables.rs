//! Records in the files of other programs: `tests/data/record-files` holds one record as CSV, and as scipy, h5py and pyarrow write it
//! (`benches/peers/record_files.py`). All of them must say the same.

use serde_json::Value;

use super::{code, root, run as coilwright, stderr, stdout};

fn path(name: &str) -> String {
    root().join(name).display().to_string()
}

fn file(name: &str) -> String {
    path(&format!("tests/data/record-files/{name}"))
}

/// What `metrics` says of a file but for its name and checksum.
#[cfg(any(feature = "mat", feature = "parquet"))]
fn measured(arguments: &[&str]) -> (Value, String) {
    let out = coilwright(&[&["metrics", "--format", "json"], arguments].concat());
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    let mut document: Value = serde_json::from_str(stdout(&out)).unwrap();
    document["records"][0]["file"] = Value::Null;
    document["inputs"] = Value::Null;
    (document, stderr(&out).to_owned())
}

/// The compensated rates: one command holds the record that is fitted and passes the rows of the other on.
#[cfg(any(feature = "mat", feature = "parquet"))]
fn fitted_and_passed_on(name: &str, columns: &str) -> Vec<String> {
    let (model, record) = (path("examples/chamber-coil.toml"), file(name));
    let out = coilwright(&["compensate", &model, &record, columns, "--fit", &record, "--method", "piecewise"]);
    assert_eq!(code(&out), 0, "{}", stderr(&out));
    // The compensated rate and the flags stand behind the file's own columns.
    stdout(&out).lines().map(|line| line.rsplitn(3, ',').take(2).collect::<Vec<_>>().join(";")).collect()
}

#[cfg(any(feature = "mat", feature = "parquet"))]
fn says_the_same_as_the_plain_file(name: &str, columns: &str) -> String {
    let (expected, _) = measured(&[&file("plain.csv")]);
    let (found, said) = measured(&[&file(name), columns]);
    assert_eq!(found, expected, "{name}");
    assert_eq!(fitted_and_passed_on(name, columns), fitted_and_passed_on("plain.csv", "--columns="), "{name}");
    said
}

#[test]
#[cfg(feature = "mat")]
fn mat_and_hdf5_files_say_the_same_as_the_plain_one() {
    for (name, remark) in [
        ("packed.mat", "left out: fs, gains, note, parts"),
        ("structure.mat", "left out: fs"),
        ("seven-three.mat", "left out: note"),
        ("compound.h5", ""),
    ] {
        let said = says_the_same_as_the_plain_file(name, "--columns=");
        assert!(said.contains(remark), "{name}: {said}");
    }
}

#[test]
#[cfg(feature = "parquet")]
fn parquet_files_say_the_same_as_the_plain_one() {
    says_the_same_as_the_plain_file("snappy.parquet", "--columns=");
    says_the_same_as_the_plain_file("stamps.parquet", "--columns=time=stamp");
}

#[test]
#[cfg(feature = "parquet")]
fn a_cell_without_a_value_is_told_by_its_row() {
    let gaps = file("gaps.parquet");
    for command in [vec!["metrics", &gaps], vec!["compare", &path("examples/chamber-coil.toml"), &gaps]] {
        let out = coilwright(&command);
        let said = stderr(&out);
        assert_eq!(code(&out), 2, "{said}");
        for row in [8, 61] {
            let fault = format!("row {row}, column temperature_c: expected a finite number, found nothing");
            assert!(said.contains(&fault), "{said}");
        }
    }
    let plain = std::fs::read_to_string(file("plain.csv")).unwrap();
    let kept =
        plain.lines().enumerate().filter(|(line, _)| ![8, 61].contains(line)).map(|(_, text)| format!("{text}\n"));
    let folder = tempfile::tempdir().unwrap();
    let skipped = folder.path().join("skipped.csv");
    std::fs::write(&skipped, kept.collect::<String>()).unwrap();
    let (expected, _) = measured(&[skipped.to_str().unwrap()]);
    let (found, said) = measured(&[&gaps, "--bad-rows", "skip"]);
    assert_eq!(found, expected);
    assert!(said.contains("2 rows skipped"), "{said}");
}

/// Shortened, or with bytes of it changed: an answer or a fault, never a panic.
#[test]
#[cfg(any(feature = "mat", feature = "parquet"))]
fn damaged_tables_are_refused_or_read_and_never_more() {
    let mut names = Vec::new();
    if cfg!(feature = "mat") {
        names.extend(["packed.mat", "structure.mat", "seven-three.mat", "compound.h5"]);
    }
    if cfg!(feature = "parquet") {
        names.extend(["snappy.parquet", "stamps.parquet"]);
    }
    let folder = tempfile::tempdir().unwrap();
    let damaged = folder.path().join("damaged");
    let mut refused = 0;
    for name in names {
        let whole = std::fs::read(file(name)).unwrap();
        for turn in 0..24 {
            let mut bytes = whole.clone();
            if turn < 8 {
                bytes.truncate(whole.len() * (turn + 4) / 13);
            } else {
                for place in 0..6 {
                    let at = (turn * 7919 + place * 104_729 + turn * turn * 31) % bytes.len();
                    bytes[at] ^= 1 << ((turn + place) % 8);
                }
            }
            std::fs::write(&damaged, &bytes).unwrap();
            let out = coilwright(&["metrics", damaged.to_str().unwrap()]);
            assert!([0, 1, 2].contains(&code(&out)), "{name}, {turn}: {}", stderr(&out));
            assert!(!stderr(&out).contains("panicked"), "{name}, {turn}: {}", stderr(&out));
            refused += usize::from(code(&out) == 2);
        }
    }
    assert!(refused > 10, "{refused}");
}

#[test]
fn a_file_that_this_build_does_not_read_is_named_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let excel = folder.path().join("log.xlsx");
    std::fs::write(&excel, b"PK\x03\x04\x14\x00\x06\x00").unwrap();
    let mut cases = vec![(excel.to_str().unwrap().to_owned(), "save the sheet as CSV")];
    if cfg!(not(feature = "mat")) {
        cases.push((file("packed.mat"), "build the program with the feature mat"));
        cases.push((file("seven-three.mat"), "build the program with the feature mat"));
    }
    if cfg!(not(feature = "parquet")) {
        cases.push((file("snappy.parquet"), "build the program with the feature parquet"));
    }
    let model = path("examples/chamber-coil.toml");
    for (name, wanted) in &cases {
        for command in [vec!["metrics", name], vec!["compare", &model, name], vec!["compensate", &model, name]] {
            let out = coilwright(&command);
            assert!(code(&out) == 2 && stderr(&out).contains(wanted), "{command:?}: {}", stderr(&out));
        }
    }
}

/// The rows of the plain file as a logger writes them: behind notes of its own, with a row of units, with date and time of day apart.
fn as_loggers_write(date_from_s: f64) -> [(&'static str, String); 3] {
    let plain = std::fs::read_to_string(file("plain.csv")).unwrap();
    let rows: Vec<[&str; 4]> =
        plain.lines().skip(1).map(|l| l.split(',').collect::<Vec<_>>().try_into().unwrap()).collect();
    let joined = |row: &dyn Fn(&[&str; 4]) -> String| rows.iter().map(|r| row(r) + "\n").collect::<String>();
    let notes = format!("Chamber logger 7\r\n\r\nSerial number;4711\nstarted, by NN,,\n{plain}");
    let comma = |cells: &[&str]| cells.join(";").replace('.', ",");
    let units = "Anlage 3\n\nt;Status;T1;Omega;supply_mv\n[s];;°C;deg/h;mV\n".to_owned()
        + &joined(&|[t, c, rate, mv]| comma(&[t, "OK", c, rate, mv]));
    let stamped = "date,time,temperature_c,rate_deg_per_h,supply_mv\n".to_owned()
        + &joined(&|[t, c, rate, mv]| {
            let seconds = date_from_s + t.parse::<f64>().unwrap();
            let (day, of_day) = (1 + (seconds / 86_400.0) as u32, seconds % 86_400.0);
            let (hours, minutes) = ((of_day / 3600.0) as u32, (of_day % 3600.0 / 60.0) as u32);
            format!("{day:02}.03.2026,{hours:02}:{minutes:02}:{:04.1},{c},{rate},{mv}", of_day % 60.0)
        });
    [("--columns=", notes), ("--columns=time=t,temperature=T1,rate=Omega", units), ("--columns=", stamped)]
}

#[test]
fn what_loggers_write_around_and_beside_the_rows_changes_no_number() {
    let of = |arguments: &[&str]| {
        let out = coilwright(&[&["metrics", "--format", "json"], arguments].concat());
        assert_eq!(code(&out), 0, "{}", stderr(&out));
        let mut document: Value = serde_json::from_str(stdout(&out)).unwrap();
        document["records"][0]["file"] = Value::Null;
        document["inputs"] = Value::Null;
        (document, stderr(&out).to_owned())
    };
    let folder = tempfile::tempdir().unwrap();
    let (other, left, model) =
        (folder.path().join("log.csv"), folder.path().join("left.csv"), path("examples/chamber-coil.toml"));
    let (other, left) = (other.to_str().unwrap(), left.to_str().unwrap());
    let compensated = |record: &str, columns: &str| {
        let fit = ["--fit", record, "--method", "piecewise", "-o", left];
        let out = coilwright(&[&["compensate", &model, record, columns][..], &fit].concat());
        assert_eq!(code(&out), 0, "{}", stderr(&out));
        // What comes out is a record again, with everything that stood around its rows; its rate is the compensated one.
        of(&[left, &columns.replace(",rate=Omega", "")]).0
    };
    let (expected, _) = of(&[&file("plain.csv")]);
    let expected_left = compensated(&file("plain.csv"), "--columns=");
    // Over midnight.
    let remarks = ["the head is line 5; the 3 lines of text above it are notes", "line 4 states units", ""];
    for ((columns, text), remark) in as_loggers_write(86_000.0).into_iter().zip(remarks) {
        std::fs::write(other, &text).unwrap();
        let (found, said) = of(&[other, columns]);
        assert_eq!(found, expected, "{text:.300}");
        assert!(said.contains(remark), "{said}");
        assert_eq!(compensated(other, columns), expected_left, "{text:.300}");
    }
}
