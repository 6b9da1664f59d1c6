//! Names that break out of files elsewhere, in every place that a format accepts and through every command: each is
//! refused, or is the same text in every file that is written, and nothing else.
//!
//! Reference: other readers than the program's own ([`super::sinks`]) and, for what goes to the winding machine, `verify`. A command
//! without an entry in [`COMMANDS`] fails, and so does a kind of file that nobody reads again.

use std::collections::BTreeSet;

use coilwright::text::{is_unseen, name_fault};

use super::sinks::read_again;
use super::ways::{Bench, COMMANDS, Way, is_clean, model, pattern, quoted, record_as_it_stands};
use crate::{code, root, run, run_in, stderr, stdout};

const NAMES: &[&str] = &[
    "plain coil",
    "Spule Ä 24 × 50 µ",
    "'single' \"double\"",
    "back\\slash\\n\\u0041",
    "</script><script>alert(1)</script>",
    "<!--<script>",
    "--><img src=x onerror=alert(1)>",
    "]]>",
    "<![CDATA[",
    "&amp;&lt;&#49;",
    "\" onload=\"x()",
    "javascript:alert(1)",
    "*/ int broken; /*",
    "/* // */",
    "??/ ??= trigraph",
    "@rate@ @name@ @states@",
    "#define X \\",
    "%s %n %d",
    "% M30 %",
    "; M30",
    "(MSG, stop) M30",
    "=1+1",
    "=HYPERLINK(\"http://x\")",
    "+cmd|' /C calc'!A0",
    "-2+3",
    "@SUM(1)",
    "'=quoted already",
    "''-twice",
    "a,b;c\td\u{0}", /* refused */
    "comma, and \"quote\"",
    "semi;colon",
    "# comment",
    "[profiles]",
    "x = 1",
    "'''",
    "\"\"\"",
    "{\"json\": 1}",
    "${HOME} $(id) `id`",
    "../../etc/passwd",
    "C:\\con\\aux",
    "verify: no violations",
    "a\nverify: no violations",
    "a\r\nb",
    "a\rb",
    "\rb",
    "b\r",
    "\tb",
    "b\n",
    "\u{1b}[2J\u{1b}]0;title\u{7}",
    "\u{9b}31m",
    "del\u{7f}",
    "bidi \u{202e}txt.exe",
    "isolate \u{2066}x\u{2069}",
    "nel\u{85}ls\u{2028}ps\u{2029}",
    "bom\u{feff}",
    "non\u{fffe}character\u{ffff}",
    "zero\u{200b}width",
    " outer space ",
    "   ",
    "",
    "\u{ff1d}1+1",
    "\u{ff20}SUM(1)",
    "=DDE(\"cmd\";\"/C calc\";\"x\")",
    "|cmd",
    "ls only\u{2028}",
    "\u{2029}ps first",
    "n\u{85}el",
    "mark \u{200f}right to left",
    "mark \u{61c}arabic",
    "soft\u{ad}hyphen",
    "tag \u{e0041}",
    "joined e\u{301} \u{fe0f}",
    "\\ud83d\\ude00 \\ud800",
    "\\u0022, \\x22, \\\"",
    "x\" M30 \"y; T9",
    "sampled-1",
    "worst",
    "T",
    "true",
    "1e308",
    "nan",
    "खगोल 漢字 👩\u{200d}🔬",
];

/// Of each kind of file the ones that got furthest.
const WORST: &[&str] = &[
    "</script><!--<script>\" ; M30 */ =1+1",
    "=HYPERLINK(\"http://x\")",
    "@rate@, '''\"\"\" # [profiles]",
    "'=x, \\ /* ]]> -->",
];

#[test]
fn every_command_is_in_the_list_of_those_that_names_go_through() {
    let help = run(&["--help"]);
    let listed: BTreeSet<&str> = stdout(&help)
        .lines()
        .skip_while(|line| !line.starts_with("Commands:"))
        .skip(1)
        .take_while(|line| line.starts_with("  "))
        .filter(|line| !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .collect();
    let known: BTreeSet<&str> = COMMANDS.iter().map(|(name, _)| *name).collect();
    assert!(
        listed.len() > 20 && listed.is_subset(&known),
        "without an entry: {:?}",
        listed.difference(&known).collect::<Vec<_>>()
    );
    for (name, way) in COMMANDS {
        let takes_a_file = ["<MODEL>", "<RECORD", "<CAMPAIGN>", "<FOLDER>", "<PATTERN>", "[RECORD]"];
        let help = run(&[name, "--help"]);
        let usage = stdout(&help).lines().find(|line| line.starts_with("Usage:")).unwrap_or_default();
        assert!(!matches!(way, Way::None) || !takes_a_file.iter().any(|word| usage.contains(word)), "{name}: {usage}");
    }
    assert!(NAMES.iter().filter(|name| name_fault(name).is_none()).count() >= 50);
}

#[test]
fn a_name_that_cannot_be_seen_as_it_is_is_refused_wherever_it_stands_and_the_answer_shows_it() {
    let long = "x".repeat(1_000_000);
    for name in NAMES.iter().copied().filter(|name| name_fault(name).is_some()).chain([long.as_str()]) {
        let bench = Bench::new("plain");
        let refused = |arguments: &[&str]| {
            let out = bench.run(arguments);
            assert_eq!(code(&out), 2, "{name:.40?}: {arguments:?} {}", stderr(&out));
            assert!(stderr(&out).len() < 20_000 && stdout(&out).len() < 20_000);
        };
        // The name, the ramp's, then what the shop floor is told, each alone.
        let places = model("plain").matches("\"plain\"").count();
        for place in 0..places {
            let mut parts: Vec<String> = model("plain").split("\"plain\"").map(str::to_owned).collect();
            let behind = parts.remove(place + 1);
            parts[place] += &(quoted(name) + &behind);
            bench.write("model.toml", &parts.join("\"plain\""));
            // Only what the shop floor is told may be left empty.
            if !(name.is_empty() && place > 1) {
                refused(&["check", "model.toml"]);
            }
        }
        bench.write("model.toml", &model("plain").replacen("\"plain\"", &quoted(name), 1));
        refused(&["evaluate", "model.toml", "--format", "json"]);
        bench.write("model.toml", &model("plain"));
        bench.write("pattern.toml", &pattern(name));
        refused(&["check", "model.toml"]);
        refused(&["schedule", "model.toml", "--pattern", "pattern.toml"]);
        bench.write("pattern.toml", &pattern("plain"));
        bench.write("campaign.toml", &format!("name = {}\nmodels = [\"model.toml\"]\n", quoted(name)));
        refused(&["campaign", "campaign.toml", "-o", "out"]);
        bench.write("profiles.toml", &format!("[profiles]\nmax_rate_c_per_h = 9.0\ncount = 0\n[[profiles.ramp]]\nname = {}\npieces = [{{ rate_c_per_h = 9.0, duration_s = 9.0 }}]\n", quoted(name)));
        refused(&["temperatures", "model.toml", "--profiles", "profiles.toml"]);
        bench.write("record.csv", &record_as_it_stands(name, 60));
        // A cell's outer white space that is seen is no part of a column's name.
        if name_fault(name.trim_matches(|c: char| c.is_whitespace() && !is_unseen(c))).is_some() {
            refused(&["metrics", "record.csv"]);
            refused(&["compare", "model.toml", "record.csv"]);
            refused(&["compensate", "model.toml", "record.csv"]);
            refused(&["diagnose", "model.toml", "record.csv", "--experiment", "next.toml"]);
            assert!(!bench.path.join("next.toml").exists());
        }
    }
}

fn through(names: &[&str], ways: impl Fn(&Way) -> Option<fn(&Bench)>) {
    for name in names {
        let bench = Bench::new(name);
        std::fs::create_dir(bench.path.join("out")).unwrap();
        COMMANDS.iter().filter_map(|(_, way)| ways(way)).for_each(|way| way(&bench));
        let files = read_again(&bench.path.join("out"));
        assert!(files >= 25, "{name}: {files}");
    }
}

fn shown_names() -> Vec<&'static str> {
    NAMES.iter().copied().filter(|name| name_fault(name).is_none()).collect()
}

#[test]
#[ignore = "long: --include-ignored"]
fn every_other_name_is_the_same_in_every_file_that_the_quick_commands_write() {
    through(&shown_names(), |way| if let Way::Quick(way) = way { Some(*way) } else { None });
}

#[test]
#[ignore = "long: --include-ignored"]
fn searches_and_measurements_keep_names_as_they_are() {
    let names = if std::env::var_os("COILWRIGHT_ALL_NAMES").is_some() { shown_names() } else { WORST.to_vec() };
    through(&names, |way| match way {
        Way::Quick(way) | Way::Slow(way) => Some(*way),
        Way::None => None,
    });
    println!(
        "{} names through {} commands",
        names.len(),
        COMMANDS.iter().filter(|(_, w)| !matches!(w, Way::None)).count()
    );
}

#[test]
#[ignore = "long: --include-ignored"]
fn a_path_and_an_argument_are_shown_and_not_obeyed() {
    for name in NAMES.iter().copied().filter(|name| !name.contains('\0')) {
        for arguments in [
            &["check", name][..],
            &["evaluate", "examples/paper-200m.toml", "--pattern", name],
            &["evaluate", "examples/paper-200m.toml", name],
            &["verify", "examples/paper-200m.toml", name],
            &["metrics", name],
            &["compare", "examples/paper-200m.toml", name],
            &["compensate", "examples/paper-200m.toml", name],
            &["campaign", name, "-o", "x"],
            &["temperatures", "examples/paper-200m.toml", "--profile", name],
            &["metrics", "examples/chamber-day-1.csv", "--columns", name],
            &["report", name],
            &[name],
            &["optimise", "examples/paper-200m.toml", "--budget", name],
            &["extend", "examples/paper-200m.toml", "--effect", name, "-o", "x"],
        ] {
            let out = run_in(root(), arguments);
            is_clean(&out, &format!("{arguments:?}"));
            // No mapping at all is one, and a profile of that name there is.
            let is_one = (arguments[0] == "metrics" && name.trim().is_empty()) || name == "sampled-1";
            assert!(code(&out) != 0 || is_one, "{arguments:?}");
        }
    }
}

#[test]
fn a_file_of_another_kind_is_named_and_not_shown() {
    let secret = "root:x:0:0:secret\n";
    let bench = Bench::new("plain");
    std::fs::write(bench.path.join("passwd"), secret).unwrap();
    std::fs::write(bench.path.join("model.toml"), model("plain").replace("pattern.toml", "./passwd")).unwrap();
    std::fs::write(bench.path.join("campaign.toml"), "name = \"c\"\nmodels = [\"passwd\"]\n").unwrap();
    for text in [secret, "secret = 1\n[key]\nvalue = 2\n", "{\"secret\": [1, 2]}", "segments of a secret\n"] {
        bench.write("passwd", text);
        for arguments in [&["check", "model.toml"][..], &["campaign", "campaign.toml", "-o", "out"]] {
            let out = bench.run(arguments);
            assert_ne!(code(&out), 0);
            let said = format!("{}{}", stdout(&out), stderr(&out));
            assert!(said.contains("passwd") && !said.contains("secret"), "{said}");
        }
    }
    // Of one of ours that is only damaged it is said what is wrong.
    bench.write("passwd", "name = \"x\"\nlayers = 4\nsegments = [1, 2, 3\n");
    let out = bench.run(&["check", "model.toml"]);
    assert!(stderr(&out).contains("passwd") && stderr(&out).contains("unclosed array"), "{}", stderr(&out));
    let out = bench.run(&["extend", "pattern.toml", "--effect", "channel:", "-o", "x.toml"]);
    assert_eq!(code(&out), 2);
}
