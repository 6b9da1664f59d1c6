//! The pages in a real browser: no script error, no request to the network, nothing wider than a phone.
//!
//! Skips with a clear line where no Chromium is installed.

use std::path::{Path, PathBuf};
use std::process::Command;

use super::ways::Bench;

const MODEL: &str = "examples/paper-200m.toml";
const BROWSERS: &[&str] = &["chromium", "chromium-browser", "google-chrome", "chrome"];

pub(super) fn browser() -> Option<&'static str> {
    let found = BROWSERS
        .iter()
        .copied()
        .find(|name| Command::new(name).arg("--version").output().is_ok_and(|out| out.status.success()));
    if found.is_none() {
        println!("skipped: none of {} is installed", BROWSERS.join(", "));
    }
    found
}

fn coilwright(arguments: &[&str]) {
    let out = Command::new(env!("CARGO_BIN_EXE_coilwright")).args(arguments).output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
}

/// Every kind of page.
fn pages(folder: &Path) -> Vec<PathBuf> {
    let (schedule, run) = (folder.join("schedule"), folder.join("run"));
    coilwright(&["schedule", MODEL, "--pattern", "qua", "-q", "-o", schedule.to_str().unwrap()]);
    coilwright(&["optimise", MODEL, "--rounds", "1", "--moves-per-restart", "500", "-q", "-o", run.to_str().unwrap()]);
    let (compared, measured) = (folder.join("compared"), folder.join("measured"));
    let [model, record] = ["coil.toml", "validation.csv"].map(|name| format!("tests/data/records/c-spool/{name}"));
    coilwright(&["compare", &model, &record, "-q", "-o", compared.to_str().unwrap()]);
    let (coil, day) = ("examples/chamber-coil.toml", "examples/chamber-day-1.csv");
    let diagnosed = folder.join("diagnosed");
    coilwright(&["diagnose", coil, day, "-q", "-o", diagnosed.to_str().unwrap()]);
    coilwright(&["metrics", &record, "-q", "-o", measured.to_str().unwrap()]);
    vec![
        schedule.join("traveller.html"),
        run.join("report.html"),
        compared.join("report.html"),
        measured.join("report.html"),
        diagnosed.join("report.html"),
    ]
}

fn run(browser: &str, profile: &Path, arguments: &[&str]) -> (String, String) {
    let out = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--enable-logging=stderr",
            "--allow-file-access-from-files",
        ])
        .args(["--host-resolver-rules=MAP * ~NOTFOUND", "--virtual-time-budget=3000"])
        .arg(format!("--user-data-dir={}", profile.display()))
        .args(arguments)
        .output()
        .unwrap();
    (String::from_utf8_lossy(&out.stdout).into_owned(), String::from_utf8_lossy(&out.stderr).into_owned())
}

#[test]
fn pages_hold_everything_themselves_and_open_without_a_script_error_on_desktop_phone_and_paper() {
    let folder = tempfile::tempdir().unwrap();
    let pages = pages(folder.path());
    for page in &pages {
        let text = std::fs::read_to_string(page).unwrap();
        for outside in ["src=\"http", "href=\"http", "url(http", "@import", "<img", "<link rel=\"stylesheet\""] {
            assert!(!text.contains(outside), "{} asks for {outside}", page.display());
        }
    }
    let Some(browser) = browser() else { return };
    for page in &pages {
        let address = format!("file://{}", page.display());
        let (dom, log) = run(browser, folder.path(), &["--dump-dom", &address]);
        assert!(dom.contains("</svg>") && dom.contains("<h1>"), "{log}");
        assert!(!log.contains("CONSOLE"), "{log}");
        // In a frame as wide as a phone's screen nothing may stick out but what scrolls by itself.
        let frame = folder.path().join("phone.html");
        let script = "onload=()=>{const d=document.querySelector('iframe').contentDocument.documentElement;\
                      document.title=d.clientWidth>300&&d.scrollWidth<=d.clientWidth?'fits':`${d.scrollWidth} of ${d.clientWidth}`}";
        let html = format!(
            "<iframe src=\"{address}\" style=\"width:390px;height:900px;border:0\"></iframe><script>{script}</script>"
        );
        std::fs::write(&frame, html).unwrap();
        let (dom, log) = run(browser, folder.path(), &["--dump-dom", &format!("file://{}", frame.display())]);
        assert!(dom.contains("<title>fits</title>"), "{dom}\n{log}");
        let pdf = folder.path().join("page.pdf");
        let (_, log) = run(
            browser,
            folder.path(),
            &["--no-pdf-header-footer", &format!("--print-to-pdf={}", pdf.display()), &address],
        );
        assert!(std::fs::metadata(&pdf).is_ok_and(|found| found.len() > 10_000), "{log}");
    }
}

/// A script that ran is seen by the page's title.
const HOSTILE: &[&str] = &[
    "</script><script>document.title='ran'</script><img src=x onerror=\"document.title='ran'\">",
    "--></title></style><svg onload=document.title='ran'><!--<script>'\" onload=\"document.title='ran'",
    "javascript:document.title='ran'//]]>`${document.title='ran'}`</svg><iframe srcdoc=\"<script>top.document.title='ran'</script>\">",
];

#[test]
fn pages_with_hostile_names_in_every_field_run_no_script_in_a_browser() {
    let Some(browser) = browser() else { return };
    let elements =
        |html: &str| html.matches("<script").count() + html.matches("<iframe").count() + html.matches("<img").count();
    for name in HOSTILE {
        let bench = Bench::new(name);
        // What would be seen of a script that runs.
        std::fs::write(bench.path.join("control.html"), format!("<title>quiet</title><h1>{name}</h1>")).unwrap();
        let address = |page: &Path| format!("file://{}", page.display());
        let profile = tempfile::tempdir().unwrap();
        let (dom, _) = run(browser, profile.path(), &["--dump-dom", &address(&bench.path.join("control.html"))]);
        assert!(
            dom.contains("<title>ran</title>") || name.starts_with("-->") || name.starts_with("javascript"),
            "{dom}"
        );
        let short = ["--rounds", "1", "--moves-per-restart", "50"];
        bench.done(&["schedule", "model.toml", "-o", "shop", "-q"]);
        bench.done(&[&["optimise", "model.toml", "--init", "pattern.toml", "-o", "run", "-q"][..], &short].concat());
        bench.done(&["compare", "model.toml", "record.csv", "-o", "compared", "-q"]);
        bench.done(&["metrics", "record.csv", "-o", "measured", "-q"]);
        bench.done(&["diagnose", "model.toml", "record.csv", "-o", "diagnosed", "-q"]);
        let pages = ["shop/traveller", "run/report", "compared/report", "measured/report", "diagnosed/report"];
        for page in pages.map(|page| bench.path.join(page).with_extension("html")) {
            let text = std::fs::read_to_string(&page).unwrap();
            let (dom, log) = run(browser, profile.path(), &["--dump-dom", &address(&page)]);
            assert!(dom.contains("<h1>") && !dom.contains("<title>ran</title>"), "{}: {log}", page.display());
            // Neither a script of its own nor one that the page's policy had to refuse.
            assert!(!log.contains("CONSOLE"), "{}: {log}", page.display());
            let without_data = |html: &str| html.replace("&lt;", "");
            assert_eq!(elements(&without_data(&dom)), elements(&text), "{}", page.display());
        }
    }
}
