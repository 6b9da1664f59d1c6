//! Watches a search: progress, checkpoints, the clock and the wish to stop.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use super::CliError;
use super::optimise::Arguments;
use super::progress::{StopFlag, TaskProgress};
use super::screen::Screen;
use crate::io::files::WriteError;
use crate::io::write::checkpoint::write_checkpoint;
use crate::io::write::run_directory::{Request, write_request};
use crate::search::Observer;
use crate::search::anneal::rounds::{Plan, Rounds, State};
use crate::search::proof;
use crate::search::run::Halt;
use crate::units::{deg_per_h_from_rad_per_s, percent_from_fraction};

/// Steps of the proof's bar, one a per cent.
const BAR_STEPS: u64 = 100;

/// Work besides the search's own slices may take this part of a budget: one in so many.
const SIDE_WORK: u32 = 4;

/// Where checkpoints go, and what they belong to.
struct Checkpoints<'a> {
    folder: &'a Path,
    request: &'a Request<'a>,
    fingerprint: String,
    every: Duration,
    last: Instant,
    is_taken_up: bool,
}

/// Told how a search of the command line goes.
pub(super) struct Watch<'a> {
    budget: Option<Duration>,
    proof_time: Option<Duration>,
    started: Instant,
    stop: &'a StopFlag,
    screen: &'a Screen,
    checkpoints: Option<Checkpoints<'a>>,
    progress: Option<TaskProgress>,
    proof_progress: OnceLock<(TaskProgress, Instant)>,
    best_cost: f64,
    /// Seconds until the best pattern was found.
    pub(crate) found_s: f64,
    /// A file that could not be written; the search ends with it.
    pub(crate) fault: Option<CliError>,
}

impl<'a> Watch<'a> {
    pub(crate) fn new(
        arguments: &'a Arguments,
        request: &'a Request,
        budget: Option<Duration>,
        started: Instant,
        stop: &'a StopFlag,
        screen: &'a Screen,
        is_taken_up: bool,
    ) -> Self {
        let checkpoints = arguments.output.as_deref().map(|folder| Checkpoints {
            folder,
            request,
            fingerprint: request.fingerprint(),
            every: arguments.checkpoint_every,
            last: started,
            is_taken_up,
        });
        Self {
            budget,
            proof_time: arguments.prove,
            started,
            stop,
            screen,
            checkpoints,
            progress: None,
            proof_progress: OnceLock::new(),
            best_cost: f64::INFINITY,
            found_s: 0.0,
            fault: None,
        }
    }

    fn keep(&mut self, written: Option<Result<(), WriteError>>) {
        if let Some(Err(error)) = written {
            self.fault.get_or_insert(error.into());
        }
    }
}

/// How many moves a search judges at most, where its rules say; it may end before.
fn expected_moves(plan: &Plan) -> Option<u64> {
    let of_a_round = plan.moves_per_restart.saturating_mul(plan.restarts_per_round as u64);
    let by_rounds = plan.rules.rounds.checked_mul(of_a_round);
    plan.rules.moves.into_iter().chain(by_rounds).min()
}

/// How many moves a search will have judged when it ends, if it finds nothing better until then.
fn moves_at_end(plan: &Plan, state: &State) -> Option<u64> {
    let of_a_round = plan.moves_per_restart.saturating_mul(plan.restarts_per_round as u64).max(1);
    let judged = state.work.moves;
    let rounds = [
        Some(plan.rules.rounds.saturating_sub(state.round)),
        Some(plan.rules.patience.saturating_sub(state.rounds_without_improvement)),
        plan.rules.moves.map(|moves| moves.saturating_sub(judged).div_ceil(of_a_round)),
    ];
    let rounds = rounds.into_iter().flatten().min()?;
    rounds.checked_mul(of_a_round).and_then(|more| judged.checked_add(more))
}

impl Observer for Watch<'_> {
    fn begun(&mut self, search: &dyn Rounds) {
        self.progress = Some(self.screen.progress("optimise", expected_moves(search.plan())));
        let written = self.checkpoints.as_ref().filter(|c| !c.is_taken_up).map(|c| {
            write_request(c.folder, c.request).and_then(|()| write_checkpoint(c.folder, &c.fingerprint, search.state()))
        });
        self.keep(written);
    }

    fn advanced(&mut self, search: &dyn Rounds) -> ControlFlow<Halt> {
        if let Some(best) = search.best().filter(|best| best.cost < self.best_cost) {
            (self.best_cost, self.found_s) = (best.cost, self.started.elapsed().as_secs_f64());
        }
        let written = self.checkpoints.as_mut().filter(|c| c.last.elapsed() >= c.every).map(|c| {
            c.last = Instant::now();
            write_checkpoint(c.folder, &c.fingerprint, search.state())
        });
        self.keep(written);
        let message = search.best().map_or_else(String::new, |best| {
            format!("round {}, best {:.4} °/h", search.state().round + 1, deg_per_h_from_rad_per_s(best.cost))
        });
        if let Some(progress) = &self.progress {
            let latest = self.budget.map(|budget| budget.saturating_sub(self.started.elapsed()));
            progress.at_until(search.evaluations(), moves_at_end(search.plan(), search.state()), latest, &message);
        }
        if self.stop.is_set() || self.fault.is_some() {
            return ControlFlow::Break(Halt::Signal);
        }
        if self.budget.is_some_and(|budget| self.started.elapsed() >= budget) {
            return ControlFlow::Break(Halt::Clock);
        }
        ControlFlow::Continue(())
    }

    fn ended(&mut self, search: &dyn Rounds) {
        let written = self.checkpoints.as_ref().map(|c| write_checkpoint(c.folder, &c.fingerprint, search.state()));
        self.keep(written);
        self.progress = None;
    }

    fn goes_on(&self) -> bool {
        !self.stop.is_set() && self.budget.is_none_or(|budget| self.started.elapsed() < budget / SIDE_WORK)
    }

    fn proving(&self, at: proof::Progress) -> ControlFlow<()> {
        let (bar, began) =
            self.proof_progress.get_or_init(|| (self.screen.progress("prove", Some(BAR_STEPS)), Instant::now()));
        let latest = self.proof_time.map(|time| time.saturating_sub(began.elapsed()));
        bar.at_until(
            percent_from_fraction(at.share_done) as u64,
            Some(BAR_STEPS),
            latest,
            &format!(
                "best {:.4} °/h, lower bound {:.4} °/h",
                deg_per_h_from_rad_per_s(at.best_rad_per_s),
                deg_per_h_from_rad_per_s(at.lower_bound_rad_per_s)
            ),
        );
        let is_over = self.stop.is_set() || self.proof_time.is_some_and(|time| began.elapsed() >= time);
        if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}
