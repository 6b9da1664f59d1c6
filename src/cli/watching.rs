//! Watches a use case for the command line: notes and progress to stderr, the wish to stop, and the clock.

use std::sync::OnceLock;
use std::time::{Duration, Instant};

use super::progress::{StopFlag, TaskProgress};
use super::screen::Screen;
use crate::task::Observer;

/// Progress is shown in so many steps.
const STEPS: u64 = 1000;

/// Told how a use case of the command line goes.
pub(super) struct Watching<'a> {
    screen: &'a Screen,
    /// None where no progress is shown.
    task: Option<&'static str>,
    progress: OnceLock<TaskProgress>,
    stop: Option<&'a StopFlag>,
    until: Option<Instant>,
}

impl<'a> Watching<'a> {
    /// Shows progress under a task's name.
    pub(crate) fn new(screen: &'a Screen, task: &'static str) -> Self {
        Self { task: Some(task), ..Self::quiet(screen) }
    }

    /// Shows notes only.
    pub(crate) fn quiet(screen: &'a Screen) -> Self {
        Self { screen, task: None, progress: OnceLock::new(), stop: None, until: None }
    }

    pub(crate) fn stopped_by(mut self, stop: &'a StopFlag) -> Self {
        self.stop = Some(stop);
        self
    }

    /// Ends the work so long after its start.
    pub(crate) fn within(mut self, started: Instant, budget: Duration) -> Self {
        self.until = started.checked_add(budget);
        self
    }

    /// Takes the progress off the terminal.
    pub(crate) fn finish(&self) {
        if let Some(progress) = self.progress.get() {
            progress.finish();
        }
    }
}

impl Observer for Watching<'_> {
    fn note(&self, words: &str) {
        self.screen.note(words);
    }

    fn at(&self, share_done: f64, words: &str) {
        let Some(task) = self.task else { return };
        let progress = self.progress.get_or_init(|| self.screen.progress(task, Some(STEPS)));
        progress.at((share_done * STEPS as f64) as u64, words);
    }

    fn goes_on(&self) -> bool {
        !self.stop.is_some_and(StopFlag::is_set) && self.until.is_none_or(|until| Instant::now() < until)
    }
}
