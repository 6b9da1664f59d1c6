//! Progress of long work on stderr, and the wish to stop it.
//!
//! On a terminal a bar; as JSON lines on request; otherwise nothing, so that logs stay readable.

use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use serde::Serialize;

use crate::text::sink::{JsonText, Line};

/// How progress is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ProgressMode {
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
    message: &'a str,
}

/// Shows how far a task is. Safe to call from several threads.
#[derive(Debug)]
pub struct Progress {
    task: String,
    total: Option<u64>,
    shown: Shown,
}

#[derive(Debug)]
enum Shown {
    Bar(ProgressBar),
    Json,
    Nothing,
}

impl Progress {
    /// `total` counts whatever `at` will count; none where the end is not known.
    pub fn new(mode: ProgressMode, quiet: bool, task: &str, total: Option<u64>) -> Self {
        let shown = match mode {
            ProgressMode::Json => Shown::Json,
            ProgressMode::Auto if !quiet && std::io::stderr().is_terminal() => Shown::Bar(bar(task, total)),
            ProgressMode::Auto | ProgressMode::None => Shown::Nothing,
        };
        Self { task: task.to_owned(), total, shown }
    }

    /// So much is done; `message` says what has been found so far.
    pub fn at(&self, done: u64, message: &str) {
        match &self.shown {
            Shown::Bar(bar) => {
                bar.set_position(done);
                bar.set_message(Line::of(message).into_string());
            }
            Shown::Json => {
                let line = ProgressLine { task: &self.task, done, total: self.total, message };
                if let Ok(json) = serde_json::to_string(&line).map(|json| JsonText::of(&json)) {
                    // Progress that nobody reads any more is no reason to stop the work.
                    let _ = writeln!(std::io::stderr().lock(), "{json}");
                }
            }
            Shown::Nothing => {}
        }
    }

    /// Takes the bar off the terminal.
    pub fn finish(&self) {
        if let Shown::Bar(bar) = &self.shown {
            bar.finish_and_clear();
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.finish();
    }
}

const BOUNDED: &str = "{prefix} {bar:20} {percent:>3} % {elapsed}, {eta} to go {msg}";
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
pub struct StopFlag(Arc<AtomicBool>);

impl StopFlag {
    /// Begins to listen for signals. Without signals (an embedding that has taken them) the flag is simply never set.
    /// One flag a process: a command that carries out others ends with any of them.
    pub fn listen() -> Self {
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

    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    pub fn as_atomic(&self) -> &AtomicBool {
        &self.0
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
    fn both_templates_of_the_bar_are_understood() {
        for template in [BOUNDED, UNBOUNDED] {
            assert!(ProgressStyle::with_template(template).is_ok(), "{template}");
        }
    }
}
