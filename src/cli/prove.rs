//! `optimise --prove`: whether what was found is the best of its class.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use super::CliError;
use super::progress::StopFlag;
use super::screen::Screen;
use crate::io::json::ProofJson;
use crate::pattern::Pattern;
use crate::pattern::windability::WindabilityClass;
use crate::search::evaluator::{Evaluator, Judged};
use crate::search::proof::{Progress, Status, Task, prove};
use crate::units::{deg_per_h_from_rad_per_s, percent_from_fraction};

/// Steps of the bar, one a per cent.
const BAR_STEPS: u64 = 100;

/// Tries to prove that the best pattern found is the best of its class, for at most `time`; a better one that the proof
/// comes upon takes its place. Also says whether the time cut the proof short.
///
/// # Errors
/// More layers than a proof can take.
pub fn prove_best(
    evaluator: &Evaluator,
    class: WindabilityClass,
    best: Judged,
    others: &[Judged],
    time: Duration,
    stop: &StopFlag,
    screen: &Screen,
) -> Result<(Judged, ProofJson, bool), CliError> {
    let started = Instant::now();
    let starts: Vec<Pattern> = std::iter::once(&best).chain(others).map(|judged| judged.pattern.clone()).collect();
    let bar = screen.progress("prove", Some(BAR_STEPS));
    let watcher = |at: Progress| {
        bar.at(
            percent_from_fraction(at.share_done) as u64,
            &format!(
                "best {:.4} °/h, lower bound {:.4} °/h",
                deg_per_h_from_rad_per_s(at.best_rad_per_s),
                deg_per_h_from_rad_per_s(at.lower_bound_rad_per_s)
            ),
        );
        if stop.is_set() || started.elapsed() >= time { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let task = Task { model: evaluator.model, solved: evaluator.solved, class };
    let certificate = prove(&task, &starts, &watcher)?;
    let best = if certificate.best_rad_per_s < best.worst.rate_rad_per_s.abs() {
        evaluator.judge(&best.name, &certificate.pattern)?
    } else {
        best
    };
    Ok((best, ProofJson::of(&certificate), certificate.status != Status::Optimal))
}

/// What was proved, to be said after how good the best pattern is.
pub fn words(proof: &ProofJson) -> String {
    match (proof.status.as_str(), proof.lower_bound_deg_per_h) {
        ("optimal", _) => " Proved: no pattern of the class has a smaller worst rate error at any time.".to_owned(),
        (_, Some(bound)) => format!(" Proved: no pattern of the class has a worst rate error below {bound:.4} °/h."),
        _ => String::new(),
    }
}
