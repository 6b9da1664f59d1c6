//! `reproduce`: what it writes is what the repository ships.

use super::{code, json, root, run, stderr};

#[test]
fn the_shipped_reproduction_is_the_programs_own_byte_for_byte() {
    let folder = tempfile::tempdir().unwrap();
    // What the other publication left does not stay beside it.
    std::fs::write(folder.path().join("comparisons.csv"), "").unwrap();
    let output = run(&["reproduce", "yan1998", "-o", &folder.path().display().to_string()]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let names = |path: &std::path::Path| {
        let mut names: Vec<_> = std::fs::read_dir(path).unwrap().map(|e| e.unwrap().file_name()).collect();
        names.sort();
        names
    };
    let shipped = root().join("results/yan1998");
    assert_eq!(names(folder.path()), names(&shipped));
    for name in names(&shipped) {
        let read = |path: &std::path::Path| std::fs::read_to_string(path.join(&name)).unwrap();
        assert_eq!(read(folder.path()), read(&shipped), "{name:?}");
    }
}

#[test]
fn table_2_is_answered_with_what_was_published_beside_what_is_computed() {
    let folder = tempfile::tempdir().unwrap();
    let answer = json(&["reproduce", "yan1998", "-o", &folder.path().display().to_string()]);
    let rows = answer["table_2"].as_array().unwrap();
    let of = |winding: &str, length_m: f64| {
        rows.iter().find(|r| r["winding"] == winding && r["length_m"] == length_m).unwrap()
    };
    for (winding, published, computed, possible) in [
        ("zyl", 19.380, 5.2460, false),
        ("sym", 14.899, 2.6628, false),
        ("dip", 5.144, 2.2799, true),
        ("qua", 5.136, 2.2799, true),
    ] {
        let row = of(winding, 200.0);
        assert_eq!(row["published_deg_per_h"], published);
        assert!((row["computed_deg_per_h"].as_f64().unwrap() - computed).abs() < 5e-5);
        assert_eq!(row["published_is_possible"], possible);
    }
    assert!(answer["discrepancies"].as_array().unwrap().len() >= 10);
    assert_eq!(answer["errata"].as_array().unwrap().len(), 9);
}
