//! What people expect of a program at a terminal: manual pages, completions, colours, quiet, suggestions, progress.

use std::process::Command;

use super::help::commands;
use super::{code, root, run, run_in, stderr, stdout};

const COIL: &str = "examples/paper-200m.toml";
const SHORT: [&str; 6] = ["--rounds", "3", "--moves-per-restart", "300", "--restarts", "2"];

#[test]
fn every_command_has_a_manual_page_with_its_options_and_examples() {
    let folder = tempfile::tempdir().unwrap();
    let answer = run_in(folder.path(), &["man", "-o", "pages"]);
    assert_eq!(code(&answer), 0, "{}", stderr(&answer));
    let read = |name: &str| std::fs::read_to_string(folder.path().join("pages").join(name)).unwrap();
    assert!(read("coilwright.1").contains(".TH coilwright 1"));
    for name in commands() {
        let page = read(&format!("coilwright-{name}.1"));
        assert!(page.starts_with(".ie") && page.contains(".SH SYNOPSIS") && page.contains(".SH OPTIONS"), "{name}");
        assert!(page.contains("Example"), "{name}");
        // roff writes a hyphen as \-.
        assert!(page.contains("\\-\\-format"), "{name}");
    }
    let count = std::fs::read_dir(folder.path().join("pages")).unwrap().count();
    assert_eq!(count, commands().len() + 1);
}

#[test]
fn completions_of_every_shell_know_every_command_and_a_shell_that_is_here_reads_them() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = run(&["completions", shell]);
        assert_eq!((code(&script), stderr(&script)), (0, ""), "{shell}");
        for name in commands() {
            assert!(stdout(&script).contains(&name), "{shell} does not know {name}");
        }
        assert!(stdout(&script).contains("windability"), "{shell}");
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("script");
        std::fs::write(&file, stdout(&script)).unwrap();
        // -n reads without running.
        match Command::new(shell).arg("-n").arg(&file).output() {
            Ok(out) if ["bash", "zsh", "fish"].contains(&shell) => {
                assert!(out.status.success(), "{shell}: {}", String::from_utf8_lossy(&out.stderr));
            }
            _ => println!("{shell} is not installed: its script was not read by it"),
        }
    }
    let unknown = run(&["completions", "tcsh"]);
    assert_eq!(code(&unknown), 2);
}

#[test]
fn bash_completes_a_command_that_was_begun() {
    let script = run(&["completions", "bash"]);
    let ask =
        "COMP_WORDS=(coilwright ver); COMP_CWORD=1; _coilwright coilwright ver coilwright; echo \"${COMPREPLY[@]}\"";
    let out = Command::new("bash").arg("-c").arg(format!("{}\n{ask}", stdout(&script))).output().unwrap();
    assert_eq!(String::from_utf8_lossy(&out.stdout).trim(), "verify", "{}", String::from_utf8_lossy(&out.stderr));
}

#[test]
fn a_misspelt_command_or_option_is_answered_with_the_one_that_was_meant() {
    for (arguments, meant) in [
        (&["evalute", COIL][..], "'evaluate'"),
        (&["optimse", COIL], "'optimise'"),
        (&["shedule", COIL], "'schedule'"),
        (&["evaluate", COIL, "--patern", "qua"], "'--pattern'"),
        (&["evaluate", COIL, "--formt", "json"], "'--format'"),
        (&["evaluate", COIL, "--format", "jsn"], "'json'"),
    ] {
        let answer = run(arguments);
        assert_eq!((code(&answer), stdout(&answer)), (2, ""), "{arguments:?}");
        assert!(stderr(&answer).contains(meant), "{arguments:?}: {}", stderr(&answer));
    }
    // American spelling is understood.
    assert_eq!(code(&run(&["optimize", "--help"])), 0);
}

#[test]
fn nothing_that_is_piped_holds_colours_with_or_without_no_color() {
    for no_color in [None, Some("1")] {
        for arguments in
            [&["--help"][..], &["evalute"], &["evaluate", COIL, "--pattern", "qua"], &["check", "absent.toml"]]
        {
            let mut command = Command::new(env!("CARGO_BIN_EXE_coilwright"));
            command.current_dir(root()).args(arguments).env_remove("NO_COLOR");
            if let Some(value) = no_color {
                command.env("NO_COLOR", value);
            }
            let out = command.output().unwrap();
            assert!(!out.stdout.contains(&0x1b) && !out.stderr.contains(&0x1b), "{arguments:?}");
        }
    }
}

/// `script` gives the program a terminal; where it is not installed, the test says so.
#[test]
fn a_terminal_shows_colours_and_no_color_switches_them_off() {
    let program = env!("CARGO_BIN_EXE_coilwright");
    let seen = |no_color: bool| {
        let mut command = Command::new("script");
        command.args(["-qec", &format!("{program} evalute"), "/dev/null"]).env("TERM", "xterm-256color");
        command.env_remove("NO_COLOR").env_remove("CI").stdin(std::process::Stdio::null());
        if no_color {
            command.env("NO_COLOR", "1");
        }
        command.output().ok().map(|out| String::from_utf8_lossy(&out.stdout).into_owned())
    };
    let (Some(with), Some(without)) = (seen(false), seen(true)) else {
        println!("skipped: script is not installed");
        return;
    };
    if !with.contains("evaluate") {
        println!("skipped: script cannot run the program here");
        return;
    }
    assert!(with.contains("\u{1b}["), "{with:?}");
    assert!(without.contains("evaluate") && !without.contains("\u{1b}["), "{without:?}");
}

#[test]
fn a_table_in_a_narrow_terminal_is_a_list_and_its_heads_and_errors_are_coloured_unless_no_color_says_otherwise() {
    let program = env!("CARGO_BIN_EXE_coilwright");
    let seen = |columns: usize, request: &str, no_color: bool| {
        let words = format!("stty cols {columns}; {program} {request}");
        let mut command = Command::new("script");
        command.current_dir(root()).args(["-qec", &words, "/dev/null"]).env("TERM", "xterm-256color");
        command.env_remove("NO_COLOR").env_remove("CI").stdin(std::process::Stdio::null());
        if no_color {
            command.env("NO_COLOR", "1");
        }
        command.output().ok().map(|out| String::from_utf8_lossy(&out.stdout).replace('\r', ""))
    };
    let Some(wide) = seen(150, "patterns --layers 12 -q", true).filter(|text| text.contains("qua")) else {
        println!("skipped: script cannot run the program here");
        return;
    };
    let narrow = seen(30, "patterns --layers 12 -q", true).unwrap();
    assert_eq!(wide, stdout(&run(&["patterns", "--layers", "12"])));
    assert!(narrow.lines().count() > 3 * wide.lines().count() && narrow.lines().any(|line| line == "qua"), "{narrow}");
    assert!(!narrow.contains('\u{1b}'));
    assert!(seen(150, "patterns --layers 12 -q", false).unwrap().starts_with("\u{1b}[1m"));
    let error = seen(40, "evaluate examples/paper-200m.toml --pattern quo", false).unwrap();
    assert!(error.contains("\u{1b}[1;31merror\u{1b}[0m"), "{error:?}");
}

#[test]
fn completions_offer_the_values_of_patterns_objectives_and_effects() {
    for shell in ["bash", "zsh", "fish"] {
        let script = run(&["completions", shell]);
        for value in ["guaranteed-rate", "captive:1", "surface_film", "sym-text"] {
            assert!(stdout(&script).replace('\\', "").contains(value), "{shell} does not offer {value}");
        }
    }
    // What is offered is not all that may be said.
    assert!(!stdout(&run(&["evaluate", "--help"])).contains("possible values: zyl"));
}

#[test]
fn arguments_that_changed_places_and_words_that_are_no_effects_are_answered_with_what_to_do() {
    let record = "examples/chamber-day-1.csv";
    let swapped = run(&["compare", record, COIL]);
    assert!(
        code(&swapped) == 2 && stderr(&swapped).contains("is a table of rows, no model file"),
        "{}",
        stderr(&swapped)
    );
    let model = run(&["metrics", COIL]);
    assert!(code(&model) == 2 && stderr(&model).contains("is a model file, no record"), "{}", stderr(&model));
    let pattern = "patterns/qua-12.toml";
    for (arguments, expected) in [
        (&["evaluate", pattern][..], "is a pattern file, no model file: give it to --pattern"),
        (
            &["optimise", "examples/campaigns/layers.toml"],
            "is a campaign file, no model file: give it to `coilwright campaign`",
        ),
        (&["evaluate", COIL, "--pattern", COIL], "is a model file, no pattern file"),
        (&["campaign", COIL, "--list"], "is a model file, no campaign file"),
        (&["campaign", record, "--list"], "is a table of rows, no campaign file"),
        (&["effects", "xyz"], "there is no effect xyz: `coilwright effects` lists all"),
    ] {
        let said = run(arguments);
        assert!(code(&said) == 2 && stderr(&said).contains(expected), "{arguments:?}: {}", stderr(&said));
        assert_eq!(stderr(&said).trim_end().lines().count(), 1, "{}", stderr(&said));
    }
    let film = run(&["effects", "film"]);
    assert!(
        code(&film) == 2 && stderr(&film).contains("film is no effect: the effect surface_film"),
        "{}",
        stderr(&film)
    );
}

#[test]
fn a_run_that_is_taken_up_with_other_options_names_them() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run").display().to_string();
    let request = [&["optimise", COIL, "-q", "-o", &out][..], &SHORT].concat();
    assert_eq!(code(&run(&[&request[..], &["--fresh"]].concat())), 0);
    let other = run(&[&request[..], &["--resume", "--seed", "7"]].concat());
    assert!(code(&other) == 2 && stderr(&other).contains("seed was 1 and is 7"), "{}", stderr(&other));
}

#[test]
fn quiet_leaves_only_errors_on_stderr_and_verbose_adds_version_threads_and_time() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out").display().to_string();
    let request = ["schedule", COIL, "--pattern", "qua", "-o", &out];
    let plain = run(&request);
    assert!(stderr(&plain).lines().all(|l| l.starts_with("wrote ")) && stderr(&plain).lines().count() == 8);
    let quiet = run(&[&request[..], &["--quiet"]].concat());
    assert_eq!((code(&quiet), stderr(&quiet)), (0, ""));
    assert_eq!(stdout(&quiet), stdout(&plain));
    let failed = run(&["check", "absent.toml", "--quiet"]);
    assert!(code(&failed) == 2 && stderr(&failed).contains("absent.toml"));
    let verbose = run(&[&request[..], &["--verbose"]].concat());
    let last = stderr(&verbose).lines().last().unwrap();
    let version = concat!("coilwright ", env!("CARGO_PKG_VERSION"), ", ");
    assert!(last.starts_with(version) && last.contains(" threads, ") && last.ends_with(" s"), "{last}");
    assert_eq!(code(&run(&["patterns", "--quiet", "--verbose"])), 2);
}

#[test]
#[ignore = "long: --include-ignored"]
fn progress_comes_as_one_json_object_a_line_on_request_only_and_on_stderr_only() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run").display().to_string();
    let request = [&["optimise", COIL, "-o", &out, "--fresh"][..], &SHORT].concat();
    let with = run(&[&request[..], &["--progress", "json"]].concat());
    assert_eq!(code(&with), 0, "{}", stderr(&with));
    let lines: Vec<serde_json::Value> = stderr(&with)
        .lines()
        .filter(|l| l.starts_with('{'))
        .map(|l| serde_json::from_str(l).unwrap_or_else(|e| panic!("{l}: {e}")))
        .collect();
    assert!(!lines.is_empty(), "{}", stderr(&with));
    for line in &lines {
        assert!(line["task"].is_string() && line["done"].is_u64() && line["message"].is_string(), "{line}");
        assert!(line.get("total").is_some(), "{line}");
        assert!(line["elapsed_s"].as_f64() >= Some(0.0) && line.get("to_go_s").is_some(), "{line}");
    }
    // Without a rule that bounds the moves, too, an end is foretold once there is a pace.
    let unbounded = ["optimise", COIL, "-o", &out, "--fresh", "--moves-per-restart", "200", "--progress", "json"];
    let told = run(&unbounded);
    let lines = stderr(&told).lines().filter_map(|l| serde_json::from_str::<serde_json::Value>(l).ok());
    let searched: Vec<serde_json::Value> = lines.filter(|line| line["task"] == "optimise").collect();
    assert!(searched.iter().all(|line| line["total"].is_null()), "{searched:?}");
    let foretold = searched.iter().filter(|line| line["to_go_s"].as_f64() >= Some(0.0)).count();
    assert!(foretold + 1 >= searched.len() && foretold > 0, "{searched:?}");
    let without = run(&request);
    assert!(!stderr(&without).contains('{'), "{}", stderr(&without));
    assert_eq!(stdout(&with), stdout(&without));
}

#[test]
fn commands_that_write_files_or_scripts_answer_with_a_document_too() {
    let folder = tempfile::tempdir().unwrap();
    let inside = |name: &str| folder.path().join(name).display().to_string();
    let (pages, coil) = (inside("pages"), inside("coil.toml"));
    for (arguments, key) in [
        (&["man", "-o", &pages][..], "files"),
        (&["new", &coil], "files"),
        (&["completions", "zsh"], "script"),
        (&["schema", "pattern"], "schema"),
        (&["effects"], "effects"),
        (&["patterns", "--layers", "12"], "patterns"),
        (&["check", COIL], "faults"),
    ] {
        let answer = super::json(arguments);
        assert_eq!(answer["schema_version"], 1, "{arguments:?}");
        assert!(answer.get(key).is_some(), "{arguments:?}");
    }
}

#[test]
fn exit_codes_are_the_documented_ones() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out").display().to_string();
    assert_eq!(code(&run(&["schedule", COIL, "--pattern", "qua", "-q", "-o", &out])), 0);
    let schedule = folder.path().join("out/schedule.csv");
    let path = schedule.display().to_string();
    assert_eq!(code(&run(&["verify", COIL, &path])), 0);
    let text = std::fs::read_to_string(&schedule).unwrap().replacen("first-to-second", "second-to-first", 1);
    std::fs::write(&schedule, text).unwrap();
    let no = run(&["verify", COIL, &path]);
    assert_eq!(code(&no), 1, "{}", stderr(&no));
    assert!(stdout(&no).starts_with("row 1: direction must be first-to-second, found second-to-first"));
    assert_eq!(code(&run(&["verify", COIL, "absent.csv"])), 2);
    assert_eq!(code(&run(&["nonsense"])), 2);
    // cli/resume.rs interrupts a search: 130.
    let help = run(&["--help"]);
    assert!(
        stdout(&help).contains("Exit codes: 0 done; 1 the answer is no; 2 the request was wrong; 130 interrupted.")
    );
}

/// An interrupt ends a search in good order, with 130.
#[cfg(unix)]
#[test]
fn an_interrupt_ends_a_search_with_130_and_its_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let mut search = Command::new(env!("CARGO_BIN_EXE_coilwright"));
    search.current_dir(root()).args(["optimise", "examples/coil-998m.toml", "--windability", "any", "-q", "-o"]);
    search.arg(&out).args(["--rounds", "100000", "--moves-per-restart", "2000"]);
    let mut child = search.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::null()).spawn().unwrap();
    while !out.join("checkpoint.json").exists() {
        assert!(child.try_wait().unwrap().is_none(), "the search ended before it was interrupted");
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert!(out.join("best.toml").exists());
}
