//! `diagnose -o` and `--experiment`: the folder, the page, and a profile file that other commands take.

use super::{code, json, run, stderr, stdout};

const COIL: &str = "examples/chamber-coil.toml";
const RECORD: &str = "examples/chamber-day-1.csv";

#[test]
#[ignore = "long: --include-ignored"]
fn a_diagnosis_leaves_its_ladder_its_page_the_extended_model_and_an_experiment_that_can_be_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (out, next) = (path("out"), path("next.toml"));
    let answer = json(&["diagnose", COIL, RECORD, "-o", &out, "--experiment", &next, "-q"]);
    assert_eq!((answer["schema_version"].as_u64(), answer["verdict"].as_str()), (Some(1), Some("missing")));
    let words = answer["ladder_in_words"].as_array().unwrap();
    assert_eq!(words.len(), answer["ladder"].as_array().unwrap().len());
    assert!(words[1].as_str().unwrap().starts_with("with finite_pack the error is "), "{words:?}");
    let read = |name: &str| std::fs::read_to_string(folder.path().join("out").join(name)).unwrap();
    assert!(read("ladder.svg").contains("finite_pack was missing: the error falls from"));
    // What is left of the record, row by row, is what the ladder says, though rows are four windows apart.
    let table = read("before-after-1.csv");
    assert_eq!(table.lines().count(), 512);
    let rms = |column: usize| {
        let left = table.lines().filter_map(|line| line.split(',').nth(column)?.parse::<f64>().ok());
        let (squares, rows) = left.fold((0.0, 0.0), |(sum, rows), v| (sum + v * v, rows + 1.0));
        (squares / rows).sqrt()
    };
    let ladder = answer["ladder"].as_array().unwrap();
    for (column, rung) in [(1, &ladder[0]), (2, &ladder[ladder.len() - 1])] {
        let said = rung["rmse_deg_per_h"].as_f64().unwrap();
        assert!((rms(column) / said - 1.0).abs() < 0.02, "{} is left, said {said}", rms(column));
    }
    assert_eq!(code(&run(&["compare", &path("out/extended.toml"), RECORD, "--strict", "-q"])), 0);

    let page = read("report.html");
    for needed in ["Diagnosis", "finite_pack was missing", "Next experiment", "SHA-256", "× noise"] {
        assert!(page.contains(needed), "{needed}");
    }
    assert_eq!(code(&run(&["report", &out])), 0);
    assert_eq!(page, read("report.html"));

    let experiment = &answer["experiment"];
    let apart = &experiment["separations"][0];
    let multiple = apart["rms_deg_per_h"].as_f64().unwrap() / answer["noise_floor_deg_per_h"].as_f64().unwrap();
    assert!((apart["multiple_of_noise"].as_f64().unwrap() / multiple - 1.0).abs() < 1e-9 && multiple > 10.0);
    assert!(experiment["statement"].as_str().unwrap().contains("°/h rms apart"));
    let number = |key: &str| apart[key].as_f64().unwrap();
    assert!(number("expected_chi_square_alone") > 100.0);
    assert!(number("expected_chi_square_with_records") > number("expected_chi_square_alone"));
    assert_eq!((apart["told_apart"].as_str(), apart["runs_needed"].as_u64()), (Some("yes"), Some(1)));
    // The declared model is a special case of the extended one: nothing could speak against the latter.
    let directions = apart["directions"].as_array().unwrap();
    assert_eq!(directions.len(), 1);
    assert_eq!(directions[0]["refused"].as_str(), Some("the declared model"));
    assert!(directions[0]["needed_chi_square_alone"].as_f64().unwrap() < number("expected_chi_square_alone"));
    let words = experiment["expectations"][0].as_str().unwrap();
    assert!(words.starts_with("the declared model and finite_pack would be told apart (a χ² of "), "{words}");
    assert!(page.contains(words) && std::fs::read_to_string(&next).unwrap().contains(words));
    let evaluated = json(&["evaluate", COIL, "--profiles", &next, "--pattern", "zyl", "-q"]);
    assert_eq!(evaluated["patterns"][0]["worst_profile"], experiment["profile"]);
    let layers = run(&["temperatures", COIL, "--profiles", &next, "--rows", "3", "-q"]);
    assert_eq!((code(&layers), stdout(&layers).lines().count()), (0, 4), "{}", stderr(&layers));
}

#[test]
fn profile_files_that_are_none_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.toml");
    for (text, expected) in [
        ("", "the file is empty"),
        ("x = 1\n", "unknown key x"),
        ("[profiles]\nmax_rate_c_per_h = 10.0\ncount = 0\n", "no profile is listed"),
        ("[profiles]\nmax_rate_c_per_h = -1.0\n", "max_rate_c_per_h"),
    ] {
        std::fs::write(&path, text).unwrap();
        let output = run(&["evaluate", COIL, "--profiles", &path.display().to_string()]);
        assert_eq!((code(&output), stdout(&output)), (2, ""), "{text}");
        assert!(stderr(&output).contains(expected), "{expected}: {}", stderr(&output));
    }
}
