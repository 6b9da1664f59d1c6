//! The pages in a real browser: no script error, no request to the network, nothing wider than a phone.
//!
//! Skips with a clear line where no Chromium is installed.

use std::path::{Path, PathBuf};
use std::process::Command;

use super::remote::Page;
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

fn in_folder(folder: &Path, arguments: &[&str]) {
    let out = Command::new(env!("CARGO_BIN_EXE_coilwright")).current_dir(folder).args(arguments).output().unwrap();
    assert!(out.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&out.stderr));
}

/// Every kind of page but the explorer's: those of a schedule, a search, a comparison, a diagnosis, of what to wind next, of measures, and
/// of the three kinds of campaign.
fn pages(folder: &Path) -> Vec<PathBuf> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let run = folder.join("run");
    coilwright(&["optimise", MODEL, "--rounds", "1", "--moves-per-restart", "500", "-q", "-o", run.to_str().unwrap()]);
    super::improve::prepare(folder);
    in_folder(folder, &["improve", "coil.toml", "monday.csv", "tuesday.csv", "-q", "-o", "next"]);
    in_folder(folder, &["metrics", "monday.csv", "-q", "-o", "measured"]);
    let paper = std::fs::read_to_string(here.join(MODEL)).unwrap().replace("count = 64", "count = 4");
    let spreads = "\n[tolerance]\nturns_per_layer_sd = 0.3\nsamples = 5\nlimit_deg_per_h = 1.0\n";
    let gyros = |kind: &str| {
        format!(
            "kind = \"{kind}\"\nname = \"two gyros\"\n[[gyro]]\nname = \"serial number 1\"\nrecords = [\"monday.csv\"]\n\
             [[gyro]]\nname = \"serial number 2\"\nrecords = [\"tuesday.csv\"]\n"
        )
    };
    for (name, text) in [
        ("paper.toml", paper + spreads),
        (
            "grid.toml",
            "name = \"grid\"\nmodels = [\"paper.toml\"]\nlayers = [4, 8]\nrounds = 1\nmoves_per_restart = 100\n"
                .to_owned(),
        ),
        ("built.toml", "kind = \"tolerance\"\nname = \"built\"\nmodels = [\"paper.toml\"]\nsamples = 100\n".to_owned()),
        ("fleet.toml", gyros("metrics")),
        (
            "diagnosed.toml",
            gyros("diagnose")
                .replace("name = \"two gyros\"\n", "name = \"two gyros\"\nmodel = \"coil.toml\"\nterms = [\"none\"]\n"),
        ),
    ] {
        std::fs::write(folder.join(name), text).unwrap();
    }
    for campaign in ["grid", "built", "fleet", "diagnosed"] {
        in_folder(folder, &["campaign", &format!("{campaign}.toml"), "-q", "-o", campaign]);
    }
    [
        "run/report.html",
        "next/index.html",
        "next/schedule/traveller.html",
        "next/before/report.html",
        "next/diagnosis/report.html",
        "measured/report.html",
        "grid/report.html",
        "built/report.html",
        "fleet/report.html",
        "diagnosed/report.html",
    ]
    .map(|name| folder.join(name))
    .to_vec()
}

/// The largest that a page may be [bytes]; `docs/src/explore.md` states what they are.
const MOST_BYTES: u64 = 3_000_000;

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
#[ignore = "long: --include-ignored"]
fn pages_hold_everything_themselves_and_open_without_a_script_error_on_desktop_phone_and_paper() {
    let folder = tempfile::tempdir().unwrap();
    let pages = pages(folder.path());
    for page in &pages {
        let text = std::fs::read_to_string(page).unwrap();
        for outside in ["src=\"http", "href=\"http", "url(http", "@import", "<img", "<link rel=\"stylesheet\""] {
            assert!(!text.contains(outside), "{} asks for {outside}", page.display());
        }
    }
    for page in pages.iter().chain([&folder.path().join("run/explorer.html")]) {
        let bytes = std::fs::metadata(page).unwrap().len();
        assert!(bytes < MOST_BYTES, "{} has {bytes} bytes", page.display());
    }
    let Some(browser) = browser() else { return };
    for page in &pages {
        let address = format!("file://{}", page.display());
        let (dom, log) = run(browser, folder.path(), &["--dump-dom", &address]);
        // A batch in which nothing was found has nothing to draw.
        let is_drawn = std::fs::read_to_string(page).unwrap().contains("<svg");
        assert!(dom.contains("<h1>") && (dom.contains("</svg>") || !is_drawn), "{}: {log}", page.display());
        assert!(is_drawn || page.ends_with("diagnosed/report.html"), "{} shows no picture", page.display());
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
    let report = folder.path().join("run/report.html");
    let mut page = Page::open(browser, folder.path(), &report, folder.path());
    charts_can_be_touched(&mut page);
    let everything: Vec<PathBuf> = pages.into_iter().chain([folder.path().join("run/explorer.html")]).collect();
    nothing_is_cut(&mut page, &everything);
    nothing_shuts_out(&mut page, &everything);
    assert_eq!(page.complaints(), Vec::<String>::new());
    page.close();
}

/// Values, zoom, scale, differences and lines of the rate errors over time, and that the chart comes back as printed.
fn charts_can_be_touched(page: &mut Page) {
    page.value(
        "var all = [...document.querySelectorAll('figure')]; \
         var chart = all.find((f) => /Size of the rate error/.test(f.textContent)); \
         var tool = (words) => [...chart.querySelectorAll('.tools button')].find((b) => b.textContent === words); \
         var is = (what) => getComputedStyle(chart.querySelector('.plot')).display === what; 0",
    );
    assert_eq!(page.value("all.length > 5 && all.every((f) => f.querySelector('.tools'))"), true);
    assert_eq!(page.value("is('inline') && tool('log scale').getAttribute('aria-pressed')"), "true");
    let second = "all.filter((f) => /time .min./.test(f.textContent)).map((f) => f.querySelector('.read').textContent)";
    let key = |key: &str| {
        format!(
            "chart.querySelector('.zoom').dispatchEvent(new KeyboardEvent('keydown', {{ key: '{key}', bubbles: true }})); 0"
        )
    };
    page.value(&key("ArrowRight"));
    let shown = page.value(second);
    let shown = shown.as_array().unwrap();
    assert!(shown.len() > 1 && shown.iter().all(|said| said.as_str().unwrap().starts_with("time [min]")), "{shown:?}");
    assert_eq!(
        page.value("[...chart.querySelectorAll('output')].every((o) => /^−?[0-9.e−-]+$/.test(o.textContent))"),
        true
    );
    for touch in [
        "tool('log scale').click()",
        "{ const less = chart.querySelector('select'); less.value = 'qua'; less.onchange(); }",
        "chart.querySelector('.keys button').click()",
        "tool('zoom in').click()",
    ] {
        page.value(&format!("{touch}; 0"));
        let redrawn = "is('none') && chart.querySelectorAll('svg svg path').length > 0";
        assert_eq!(page.value(redrawn), true, "{touch}");
        page.value("tool('as printed').click(); 0");
        assert_eq!(page.value("is('inline') && !chart.querySelector('svg svg')"), true, "{touch}");
    }
}

/// A sheet of A4 without its margins, at 96 pixels an inch.
const PAPER_PX: u32 = 703;

/// Nothing is wider than a phone or a sheet of paper but what scrolls by itself, and on paper nothing does.
fn nothing_is_cut(page: &mut Page, files: &[PathBuf]) {
    for file in files {
        page.go(file);
        page.until(
            "!document.getElementById('layers') || (!document.body.dataset.busy && !!document.body.dataset.shown)",
        );
        for (width, medium) in [(390, "screen"), (PAPER_PX, "print")] {
            page.resize(width);
            page.look_as(medium, "light");
            let wide = page.value("document.documentElement.scrollWidth").as_u64();
            assert!(wide <= Some(u64::from(width)), "{}: {wide:?} of {width} px, {medium}", file.display());
        }
        page.look_as("screen", "light");
    }
}

/// Where the rules of accessibility are looked for: npm's `axe-core` (MPL 2.0), which `.ci/run` fetches and nothing commits.
const AXE: &str = "target/axe/package/axe.min.js";

/// Axe finds no serious fault in any kind of page, on a desk and on a phone, light and dark.
fn nothing_shuts_out(page: &mut Page, files: &[PathBuf]) {
    let Ok(axe) = std::fs::read_to_string(AXE) else {
        println!("skipped: no {AXE}: npm pack axe-core, unpacked there, brings it");
        return;
    };
    for file in files {
        page.go(file);
        page.until(
            "!document.getElementById('layers') || (!document.body.dataset.busy && !!document.body.dataset.shown)",
        );
        page.value(&format!("{axe}; 0"));
        for (width, scheme) in [(1280, "light"), (390, "dark")] {
            page.resize(width);
            page.look_as("screen", scheme);
            let found = page.value(
                "axe.run({ resultTypes: ['violations'] }).then((found) => found.violations \
                 .filter((fault) => ['serious', 'critical'].includes(fault.impact)) \
                 .map((fault) => `${fault.id}: ${fault.nodes.map((node) => node.html.slice(0, 200)).slice(0, 3).join(' ')}`))",
            );
            assert_eq!(found, serde_json::json!([]), "{} at {width} px, {scheme}", file.display());
        }
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
        let name = super::ways::quoted(name);
        let built = format!("kind = \"tolerance\"\nname = {name}\nmodels = [\"model.toml\"]\nsamples = 20\n");
        let gyro = format!("[[gyro]]\nname = {name}\nrecords = [\"record.csv\"]\n");
        let fleet = format!("kind = \"metrics\"\nname = {name}\n{gyro}");
        for (campaign, text) in [("built", built), ("fleet", fleet)] {
            std::fs::write(bench.path.join(campaign).with_extension("toml"), text).unwrap();
            bench.done(&["campaign", &format!("{campaign}.toml"), "-o", campaign, "-q"]);
        }
        let pages = [
            "shop/traveller",
            "run/report",
            "compared/report",
            "measured/report",
            "diagnosed/report",
            "built/report",
            "fleet/report",
        ];
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
