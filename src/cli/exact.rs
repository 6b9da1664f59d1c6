//! `exact`: the best winding with a proof.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use super::budget::parse_duration;
use super::optimise::parse_objective;
use super::progress::StopFlag;
use super::screen::Screen;
use super::{CliError, Ending};
use crate::io::files::write_atomically;
use crate::io::json::{ExactJson, PatternJson, ProofJson};
use crate::io::model::NamedPattern;
use crate::io::read::model_file::read_model;
use crate::io::read::pattern_file::{print_pattern, resolve_pattern};
use crate::io::write::sample_table::print_samples;
use crate::pattern::Pattern;
use crate::pattern::classic::Classic;
use crate::pattern::windability::WindabilityClass;
use crate::rate::{RateError, RateModel};
use crate::search::cost::guaranteed::UnitStep;
use crate::search::cost::objective::Objective;
use crate::search::cost::worst_case::SolvedProfiles;
use crate::search::evaluator::JudgeError;
use crate::search::proof::{Goal, Progress, Status, Task, prove, starting_patterns};
use crate::text::sink::TomlComment;
use crate::units::deg_per_h_from_rad_per_s;

/// The best winding of a class with a proof, or a lower bound on what any winding can reach
#[derive(Debug, clap::Args)]
#[command(
    after_help = "The proof holds for the worst rate over all times of the model's profiles, or for another --objective. \"optimal\": no winding of the class is\n\
    better by more than one part in 10^9; \"gap\": none is better than the lower bound.\n\n\
    Examples:\n  coilwright exact examples/paper-200m.toml\n  \
    coilwright exact examples/paper-200m.toml --windability any --budget 5m -o best.toml"
)]
pub struct Arguments {
    /// The model file
    model: PathBuf,
    /// What can be wound: standard, captive:K or any; without it, the model's own
    #[arg(long, value_name = "CLASS", value_parser = parse_class)]
    windability: Option<WindabilityClass>,
    /// What is proved to be small: worst-rate, rms or guaranteed-rate; without it, worst-rate
    #[arg(long, value_name = "WHAT", value_parser = parse_objective)]
    objective: Option<Objective>,
    /// Gives up after this time, e.g. 30s or 5m, with the lower bound reached until then
    #[arg(long, value_name = "TIME", default_value = "60s", value_parser = parse_duration)]
    budget: Duration,
    /// A winding's name or a pattern file to begin with, besides the classics and what a short search finds; may be
    /// repeated
    #[arg(long, short, value_name = "PATTERN")]
    pattern: Vec<String>,
    /// Seed of the short search; without it, the model's own
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Writes the samples that the proof ran on as a table, for other solvers: constant and one coefficient a layer in
    /// °/h, so that the rate error is constant + Σ a_j (2 P(j) − 1 − N). Needs equal lengths and halves that respond alike
    #[arg(long, value_name = "FILE")]
    samples: Option<PathBuf>,
    /// Writes the best winding as a pattern file
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
}

fn parse_class(text: &str) -> Result<WindabilityClass, String> {
    WindabilityClass::parse(text)
        .ok_or_else(|| format!("expected standard, captive:K with a number K, or any, found \"{text}\""))
}

pub fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let started = Instant::now();
    let file = read_model(&arguments.model)?;
    for advice in &file.advice {
        screen.note(&format!("note: {advice}"));
    }
    let (model, layers) = (&file.model, file.model.coil.layers());
    let solved = SolvedProfiles::new(model, &file.profiles.profiles())?;
    let class = arguments.windability.unwrap_or(file.search.windability);
    let step = UnitStep::new(model, file.profiles.max_rate_k_per_s);
    let objective = arguments.objective.unwrap_or(Objective::WorstRate);
    let goal = match objective {
        Objective::WorstRate | Objective::WorstPhase => Goal::WorstRate,
        Objective::RootMeanSquare => Goal::RootMeanSquare,
        Objective::GuaranteedRate => Goal::Guaranteed(step.as_ref().map_err(|error| JudgeError::from(error.clone()))?),
        Objective::P95 => {
            let message = "proofs are of worst, guaranteed and rms rates, not of p95".to_owned();
            return Err(CliError::Option { option: "--objective", message });
        }
    };
    let task = Task { model, solved: &solved, class, goal };
    let own = file.pattern.iter().map(|named| named.pattern.clone());
    let stated = arguments.pattern.iter().map(|stated| Ok(resolve_pattern(stated, layers, None)?.pattern));
    let mut starts = own.map(Ok).chain(stated).collect::<Result<Vec<Pattern>, CliError>>()?;
    starts.extend(starting_patterns(&task, arguments.seed.unwrap_or(file.search.seed))?);

    let stop = StopFlag::listen();
    let progress = screen.progress("proof", Some(PROGRESS_STEPS));
    let shown = AtomicU64::new(u64::MAX);
    let watcher = |at: Progress| {
        let step = (at.share_done * PROGRESS_STEPS as f64) as u64;
        // Pieces of work report far more often than anything changes.
        let seen = ((at.pass * PROGRESS_STEPS as f64) as u64) << 32 | step;
        if shown.swap(seen, Ordering::Relaxed) != seen {
            progress.at(step, &words(&at));
        }
        let over = stop.is_set() || started.elapsed() > arguments.budget;
        if over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let certificate = prove(&task, &starts, &watcher)?;
    progress.finish();

    let pattern = &certificate.pattern;
    let worst = solved.worst_case(model, pattern)?;
    let phase_rad = RateModel::new(model, pattern, &[])?.phase_rad(worst.rate_rad_per_s);
    let bound = step.and_then(|s| s.guaranteed(model, pattern)).ok();
    let name = name_of(pattern);
    let body = ExactJson {
        model: model.name.clone(),
        windability: class.to_string(),
        objective: objective.key().to_owned(),
        best: PatternJson::new(&name, pattern, &worst, phase_rad, bound.map(|b| b.rate_rad_per_s)),
        best_objective_deg_per_h: deg_per_h_from_rad_per_s(certificate.best_rad_per_s),
        proof: ProofJson::of(&certificate),
        nodes: certificate.nodes,
        judged: certificate.judged,
        rows: certificate.rows.len(),
        seconds: started.elapsed().as_secs_f64(),
    };
    if let Some(path) = &arguments.output {
        let named = NamedPattern { name, pattern: pattern.clone() };
        let comments = [
            format!("coil: {}; class: {class}; over {} profiles", model.name, solved.profiles().len()),
            format!("worst rate {:.6} °/h; proof: {}", body.best.worst_rate_deg_per_h, body.proof.status),
        ];
        write_atomically(path, print_pattern(&named, &comments.map(TomlComment::of)).as_bytes())?;
        screen.note(&format!("wrote {}", path.display()));
    }
    if let Some(path) = &arguments.samples {
        let lengths_m = model.wound_coil().map_err(RateError::from)?.layer_lengths_m().to_vec();
        match print_samples(&certificate.rows, &lengths_m) {
            Some(table) => write_atomically(path, table.as_bytes())?,
            None => screen.note(&format!(
                "note: {} was not written: the samples are linear in the segments only with equal lengths and halves that \
                 respond alike",
                path.display()
            )),
        }
    }
    let interrupted = stop.is_set() && certificate.status != Status::Optimal;
    screen.answer(body, text)?;
    Ok(if interrupted { Ending::Interrupted } else { Ending::Done })
}

/// A pass is shown in so many steps.
const PROGRESS_STEPS: u64 = 1000;

fn words(at: &Progress) -> String {
    let shown = deg_per_h_from_rad_per_s;
    format!(
        "best {:.5} °/h, none below {:.5}, now up to {:.0} %",
        shown(at.best_rad_per_s),
        shown(at.lower_bound_rad_per_s),
        100.0 * at.pass
    )
}

/// A classic winding's own name.
fn name_of(pattern: &Pattern) -> String {
    let layers = pattern.layers();
    let classic = Classic::ALL.into_iter().find(|c| c.pattern(layers).is_ok_and(|p| p == *pattern));
    classic.map_or_else(|| format!("exact-{layers}"), |c| c.key().to_owned())
}

fn text(body: &ExactJson) -> String {
    let best = &body.best;
    let segments: Vec<String> = best.segments.iter().map(ToString::to_string).collect();
    let proof = match (body.proof.status.as_str(), body.proof.lower_bound_deg_per_h) {
        ("optimal", _) => format!("optimal: no winding of the class {} is better", body.windability),
        (_, Some(bound)) => format!(
            "gap: no winding of the class {} is below {bound:.6} °/h, {:.1} % under the best known",
            body.windability,
            100.0 * (1.0 - bound / body.best_objective_deg_per_h)
        ),
        _ => "none: nothing is proved; give a longer --budget".to_owned(),
    };
    let what = if body.objective == Objective::WorstRate.key() {
        String::new()
    } else {
        format!("proof is of the {}\n", body.objective)
    };
    format!(
        "{what}best     {}: {}\nworst    {:.6} °/h, under {} at {:.2} s\nproof    {proof}\n\
         effort   {} nodes, {} windings judged in full, {:.2} s\n",
        best.name,
        segments.join(" "),
        best.worst_rate_deg_per_h,
        best.worst_profile,
        best.worst_time_s,
        body.nodes,
        body.judged,
        body.seconds
    )
}
