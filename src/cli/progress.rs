//! Progress of long work on stderr, and the wish to stop it.
//!
//! On a terminal a bar; as JSON lines on request; otherwise nothing, so that logs stay readable.

use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use serde::Serialize;

use crate::text::sink::{JsonText, Line};
use crate::units::{h_from_s, min_from_s};

/// How progress is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProgressMode {
    /// A bar if stderr is a terminal, else nothing
    Auto,
    /// One JSON object a line on stderr
    Json,
    /// Nothing
    None,
}

/// One line of `--progress json`.
#[derive(Debug, Serialize)]
struct ProgressLine<'a> {
    task: &'a str,
    done: u64,
    /// Null where the end is not known.
    total: Option<u64>,
    elapsed_s: f64,
    /// As long as the work is expected to take still; null where nothing is known of its end, or before it has a pace.
    to_go_s: Option<f64>,
    message: &'a str,
}

/// Shows how far a task is. Safe to call from several threads.
#[derive(Debug)]
pub(crate) struct TaskProgress {
    task: String,
    total: Option<u64>,
    shown: Shown,
    began: Instant,
    /// What was done already when the work first said so: it may have been taken up.
    first: OnceLock<(Instant, u64)>,
}

#[derive(Debug)]
enum Shown {
    Bar(ProgressBar),
    Json,
    Nothing,
}

impl TaskProgress {
    /// `total` counts whatever `at` will count; none where the end is not known.
    pub(crate) fn new(mode: ProgressMode, quiet: bool, task: &str, total: Option<u64>) -> Self {
        let shown = match mode {
            ProgressMode::Json => Shown::Json,
            ProgressMode::Auto if !quiet && std::io::stderr().is_terminal() => Shown::Bar(bar(task, total)),
            ProgressMode::Auto | ProgressMode::None => Shown::Nothing,
        };
        Self { task: task.to_owned(), total, shown, began: Instant::now(), first: OnceLock::new() }
    }

    /// So much is done; `message` says what has been found so far.
    pub(crate) fn at(&self, done: u64, message: &str) {
        self.at_until(done, self.total, None, message);
    }

    /// The same for work that is expected to end when so much is done, and in any case after so long.
    pub(crate) fn at_until(&self, done: u64, end: Option<u64>, latest: Option<Duration>, message: &str) {
        if matches!(self.shown, Shown::Nothing) {
            return;
        }
        let (begun, first) = *self.first.get_or_init(|| (Instant::now(), done));
        let by_pace = end.and_then(|end| to_go(begun.elapsed(), done.saturating_sub(first), end.saturating_sub(done)));
        let left = by_pace.into_iter().chain(latest).min();
        match &self.shown {
            Shown::Bar(bar) => {
                bar.set_position(done);
                let words =
                    [message.to_owned(), left.map_or_else(String::new, |left| time_left_in_words(left) + " to go")];
                let words: Vec<String> = words.into_iter().filter(|part| !part.is_empty()).collect();
                bar.set_message(Line::of(words.join(", ")).into_string());
            }
            Shown::Json => {
                let tenths = |time: Duration| (time.as_secs_f64() * 10.0).round() / 10.0;
                let line = ProgressLine {
                    task: &self.task,
                    done,
                    total: self.total,
                    elapsed_s: tenths(self.began.elapsed()),
                    to_go_s: left.map(tenths),
                    message,
                };
                if let Ok(json) = serde_json::to_string(&line).map(|json| JsonText::of(&json)) {
                    // Progress that nobody reads any more is no reason to stop the work.
                    let _ = writeln!(std::io::stderr().lock(), "{json}");
                }
            }
            Shown::Nothing => {}
        }
    }

    /// Takes the bar off the terminal.
    pub(crate) fn finish(&self) {
        if let Shown::Bar(bar) = &self.shown {
            bar.finish_and_clear();
        }
    }
}

impl Drop for TaskProgress {
    fn drop(&mut self) {
        self.finish();
    }
}

/// How long the rest takes at the pace so far; none where there is no pace yet.
fn to_go(elapsed: Duration, done: u64, left: u64) -> Option<Duration> {
    let seconds = elapsed.as_secs_f64() * left as f64 / done as f64;
    Duration::try_from_secs_f64(seconds).ok()
}

/// One or two digits: it is a guess.
fn time_left_in_words(left: Duration) -> String {
    match left.as_secs_f64() {
        s if s < 90.0 => format!("{:.0} s", s.ceil()),
        s if s < 5400.0 => format!("{:.0} min", min_from_s(s)),
        s if s < 36_000.0 => format!("{:.1} h", h_from_s(s)),
        s => format!("{:.0} h", h_from_s(s)),
    }
}

const BOUNDED: &str = "{prefix} {bar:20} {percent:>3} % {elapsed} {msg}";
const UNBOUNDED: &str = "{prefix} {spinner} {elapsed} {rate} {msg}";

/// Three digits and a thousands' letter: nobody reads more of a rate that flickers.
fn rate_in_words(per_s: f64) -> String {
    let (value, letter) = match per_s {
        v if v >= 1e6 => (v / 1e6, " M"),
        v if v >= 1e3 => (v / 1e3, " k"),
        v => (v, ""),
    };
    let decimals = if value >= 100.0 {
        0
    } else if value >= 10.0 {
        1
    } else {
        2
    };
    format!("{value:.decimals$}{letter}/s")
}

fn bar(task: &str, total: Option<u64>) -> ProgressBar {
    let bar = match total {
        Some(total) => ProgressBar::new(total),
        None => ProgressBar::new_spinner(),
    };
    let template = if total.is_some() { BOUNDED } else { UNBOUNDED };
    bar.set_draw_target(ProgressDrawTarget::stderr_with_hz(8));
    // The templates are constants that a test parses.
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    bar.set_style(style.with_key("rate", |state: &ProgressState, out: &mut dyn std::fmt::Write| {
        // A bar that cannot be drawn is no reason to stop the work.
        let _ = out.write_str(&rate_in_words(state.per_sec()));
    }));
    bar.set_prefix(task.to_owned());
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}

/// Set by Ctrl-C or a termination signal; long work looks at it and ends in good order. A second signal ends the
/// program at once.
#[derive(Debug, Clone)]
pub(crate) struct StopFlag(Arc<AtomicBool>);

impl StopFlag {
    /// Begins to listen for signals. Without signals (an embedding that has taken them) the flag is simply never set.
    /// One flag a process: a command that carries out others ends with any of them.
    pub(crate) fn listen() -> Self {
        static FLAG: OnceLock<Arc<AtomicBool>> = OnceLock::new();
        let flag = FLAG.get_or_init(|| {
            let flag = Arc::new(AtomicBool::new(false));
            let seen = Arc::clone(&flag);
            let _ = ctrlc::set_handler(move || {
                if seen.swap(true, Ordering::Relaxed) {
                    std::process::exit(130);
                }
            });
            flag
        });
        Self(Arc::clone(flag))
    }

    pub(crate) fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_has_three_digits() {
        let said = [0.5, 12.34, 987.6, 12_345.0, 1.5e6].map(rate_in_words);
        assert_eq!(said, ["0.50/s", "12.3/s", "988/s", "12.3 k/s", "1.50 M/s"]);
    }

    #[test]
    fn what_is_left_is_foretold_by_the_pace_and_said_in_few_digits() {
        let seconds = Duration::from_secs;
        assert_eq!(to_go(seconds(10), 5, 20), Some(seconds(40)));
        assert_eq!(to_go(seconds(10), 5, 0), Some(seconds(0)));
        assert_eq!((to_go(seconds(10), 0, 20), to_go(seconds(0), 0, 0)), (None, None));
        let said = [0, 42, 150, 3 * 3600, 50 * 3600].map(|s| time_left_in_words(seconds(s)));
        assert_eq!(said, ["0 s", "42 s", "2 min", "3.0 h", "50 h"]);
    }

    #[test]
    fn both_templates_of_the_bar_are_understood() {
        for template in [BOUNDED, UNBOUNDED] {
            assert!(ProgressStyle::with_template(template).is_ok(), "{template}");
        }
    }
}
