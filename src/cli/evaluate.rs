//! `evaluate`: what the rate error of given windings is at worst.

use std::path::PathBuf;

use super::screen::{Screen, table};
use super::{CliError, Ending};
use crate::effect::FILM;
use crate::io::files::write_atomically;
use crate::io::json::{EvaluateJson, PatternJson};
use crate::io::model::{Advice, ModelFile, NamedPattern};
use crate::io::read::model_file::read_model;
use crate::io::read::pattern_file::resolve_pattern;
use crate::io::read::profile_file::read_profile_file;
use crate::io::write::model_edit::with_ramps;
use crate::pattern::classic::Classic;
use crate::rate::RateModel;
use crate::search::cost::guaranteed::{GuaranteedError, UnitStep};
use crate::search::cost::worst_case::{SolvedProfiles, WorstCase};
use crate::units::deg_per_h_from_rad_per_s;

/// Worst rate error of windings over a model's profiles
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  coilwright evaluate examples/paper-200m.toml --pattern qua --pattern patterns/qua-12.toml"
)]
pub struct Arguments {
    /// The model file
    model: PathBuf,
    /// A winding's name (zyl, sym, sym-text, dip, qua, oct, hex) or a pattern file; may be repeated. Without it: the
    /// model's own and all classics that fit
    #[arg(long, short, value_name = "PATTERN")]
    pattern: Vec<String>,
    /// A file with a [profiles] table, used instead of the model's
    #[arg(long, value_name = "FILE")]
    profiles: Option<PathBuf>,
    /// Write a copy of the model file in which the profiles that attain the guaranteed worst cases are listed
    #[arg(long, value_name = "FILE")]
    bang_bang: Option<PathBuf>,
}

pub fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let mut file = read_model(&arguments.model)?;
    if let Some(path) = &arguments.profiles {
        file.profiles = read_profile_file(path)?;
    }
    for advice in &file.advice {
        screen.note(&format!("note: {advice}"));
    }
    let patterns = if arguments.pattern.is_empty() {
        own_and_classics(&file)
    } else {
        let layers = file.model.coil.layers();
        arguments.pattern.iter().map(|stated| resolve_pattern(stated, layers, None)).collect::<Result<_, _>>()?
    };
    let solved = SolvedProfiles::new(&file.model, &file.profiles.profiles())?;
    let step = UnitStep::new(&file.model, file.profiles.max_rate_k_per_s);
    if let Err(reason @ GuaranteedError::Effect { .. }) = &step {
        screen.note(&format!("note: {reason}"));
    }
    let after = SolvedProfiles::after_the_ends(&file.model, &file.profiles.profiles())?;
    let mut answers = Vec::with_capacity(patterns.len());
    let mut extremes = Vec::new();
    for NamedPattern { name, pattern } in &patterns {
        let worst = solved.worst_case(&file.model, pattern)?;
        if let Some(after) = &after {
            warn_of_growth(name, &worst, &after.worst_case(&file.model, pattern)?, screen);
        }
        let phase_rad = RateModel::new(&file.model, pattern, &[])?.phase_rad(worst.rate_rad_per_s);
        let bound = match &step {
            Ok(step) => Some(step.guaranteed(&file.model, pattern)?),
            Err(_) => None,
        };
        let bound_rad_per_s = bound.as_ref().map(|b| b.rate_rad_per_s);
        answers.push(PatternJson::new(name, pattern, &worst, phase_rad, bound_rad_per_s));
        extremes.extend(bound.map(|b| b.profile(&format!("bang-bang-{name}"))));
    }
    if let Some(path) = &arguments.bang_bang {
        step?;
        let listed = with_ramps(&arguments.model.display().to_string(), &file.source, &extremes)?;
        write_atomically(path, listed.as_bytes())?;
        screen.note(&format!("{} profiles listed in {}", extremes.len(), path.display()));
    }
    if file.model.prescribes_outermost_layer() && holds_a_tie(&answers) {
        screen.note(&format!("note: {}", Advice::PrescribedBoundary { film: FILM.spec.kind }));
    }
    let body = EvaluateJson { model: file.model.name.clone(), patterns: answers };
    screen.answer(body, |body| {
        let rows = body.patterns.iter().map(|p| {
            vec![
                p.name.clone(),
                format!("{:.4}", p.worst_rate_deg_per_h),
                p.guaranteed_worst_rate_deg_per_h.map_or("-".to_owned(), |g| format!("{g:.4}")),
                format!("{:.3e}", p.worst_phase_rad),
                p.worst_profile.clone(),
                format!("{:.2}", p.worst_time_s),
                p.windability.class.clone(),
                p.windability.reels.to_string(),
                p.windability.max_climb.to_string(),
            ]
        });
        table(
            &["pattern", "worst °/h", "guaranteed °/h", "phase rad", "profile", "at s", "class", "reels", "climb"],
            rows,
        )
    })?;
    Ok(Ending::Done)
}

/// Whether two different windings have the same guaranteed worst rate.
fn holds_a_tie(answers: &[PatternJson]) -> bool {
    const SAME: f64 = 1e-6;
    let bound = |p: &PatternJson| p.guaranteed_worst_rate_deg_per_h;
    answers.iter().enumerate().any(|(i, a)| {
        let ties = |b: &PatternJson| bound(a).zip(bound(b)).is_some_and(|(x, y)| (x - y).abs() <= SAME * x.abs());
        answers[..i].iter().any(|b| b.segments != a.segments && ties(b))
    })
}

/// Profiles end with their last piece; the error may still grow while the pack settles.
fn warn_of_growth(name: &str, within: &WorstCase, after: &WorstCase, screen: &Screen) {
    const GROWTH: f64 = 1e-3;
    if after.rate_rad_per_s.abs() > within.rate_rad_per_s.abs() * (1.0 + GROWTH) {
        screen.note(&format!(
            "note: with {name} the error still grows after the end of profile {}, to {:.4} °/h at {:.0} s if the drive stands \
             still: end the profile with a soak to have it counted",
            after.profile,
            deg_per_h_from_rad_per_s(after.rate_rad_per_s.abs()),
            after.time_s
        ));
    }
}

/// The model's own pattern first, unless it is a classic anyway.
pub(super) fn own_and_classics(file: &ModelFile) -> Vec<NamedPattern> {
    let layers = file.model.coil.layers();
    let classics = Classic::ALL.into_iter().filter_map(|classic| {
        let pattern = classic.pattern(layers).ok()?;
        Some(NamedPattern { name: classic.key().to_owned(), pattern })
    });
    let own = file.pattern.iter().filter(|named| Classic::from_key(&named.name).is_err()).cloned();
    own.chain(classics).collect()
}
