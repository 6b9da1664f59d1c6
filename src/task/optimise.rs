//! The search for the winding with the smallest error, as a user asks for it: wishes and defaults become a [`search::Request`], and
//! its answer becomes a folder.

use crate::io::model::{ModelFile, NamedPattern};
use crate::pattern::Pattern;
use crate::pattern::windability::WindabilityClass;
use crate::search;
use crate::search::anneal::rounds::{DEFAULT_PATIENCE, DEFAULT_RESTARTS_PER_ROUND, Plan, Rules};
use crate::search::cost::objective::Objective;
use crate::search::end_turns::EndChoice;
use crate::units::rad_per_s_from_deg_per_h;

use super::TaskError;

/// Patience where a budget of time says that the search may take long.
const PATIENCE_WITH_BUDGET: u64 = 4 * DEFAULT_PATIENCE;

/// What is asked of a search; none stands for the model's own or the usual.
#[derive(Debug, Clone, Default)]
pub struct Wishes {
    /// Of the search; None for the model's own, as everywhere here.
    pub seed: Option<u64>,
    /// What the winding shop can wind.
    pub class: Option<WindabilityClass>,
    /// What is made small.
    pub objective: Option<Objective>,
    /// Whether a clock will end it.
    pub has_budget: bool,
    /// At most.
    pub rounds: Option<u64>,
    /// At most, counted at the end of a round.
    pub moves: Option<u64>,
    /// Rounds without a better pattern.
    pub patience: Option<u64>,
    /// A rate error that is good enough.
    pub target_deg_per_h: Option<f64>,
    /// Independent of each other.
    pub restarts_per_round: Option<usize>,
    /// Of each restart.
    pub moves_per_restart: Option<u64>,
    /// A pattern to begin with.
    pub start: Option<NamedPattern>,
    /// Whether worst admissible profiles join the searched ones.
    pub cutting_planes: bool,
    /// Turns at the ends of the fibre that may be chosen beside the order of whole layers.
    pub ends: EndChoice,
}

/// Models that are drawn from a diagnosis.
pub const DRAWN_MODELS: usize = 40;

impl Wishes {
    pub(crate) fn class(&self, file: &ModelFile) -> WindabilityClass {
        self.class.unwrap_or(file.search.windability)
    }

    pub(crate) fn objective(&self, file: &ModelFile) -> Objective {
        self.objective.unwrap_or(file.search.objective)
    }

    /// The plan of a search of a model.
    ///
    /// # Errors
    /// A pattern to begin with that is not of the class, a target below zero.
    pub(crate) fn plan(&self, file: &ModelFile) -> Result<Plan, TaskError> {
        let class = self.class(file);
        let starts = match &self.start {
            None => Vec::new(),
            Some(NamedPattern { name, pattern }) if !class.admits(pattern) => {
                let message = format!("the pattern {name} is not of the class {class}: choose a wider class");
                return Err(TaskError::Option { option: "--init", message });
            }
            Some(named) => vec![named.pattern.segments().to_vec()],
        };
        if let Some(target) = self.target_deg_per_h.filter(|t| !(*t >= 0.0 && t.is_finite())) {
            let message = format!("expected a rate error of zero or more in °/h, found {target}");
            return Err(TaskError::Option { option: "--target", message });
        }
        let patience = if self.has_budget { PATIENCE_WITH_BUDGET } else { DEFAULT_PATIENCE };
        let usual_moves = || self.objective(file).default_moves_per_restart(file.model.coil.layers());
        Ok(Plan {
            seed: self.seed.unwrap_or(file.search.seed),
            restarts_per_round: self.restarts_per_round.unwrap_or(DEFAULT_RESTARTS_PER_ROUND),
            moves_per_restart: self.moves_per_restart.unwrap_or_else(usual_moves),
            rules: Rules {
                rounds: self.rounds.unwrap_or(u64::MAX),
                patience: self.patience.unwrap_or(patience),
                moves: self.moves,
                target: self.target_deg_per_h.map(rad_per_s_from_deg_per_h),
            },
            starts,
        })
    }

    /// The request to [`search::run()`]; `former` is a pattern to compare with.
    ///
    /// # Errors
    /// As [`Wishes::plan`]; a proof of what no proof is about.
    pub fn request<'a>(
        &self,
        file: &'a ModelFile,
        prove: bool,
        former: Option<NamedPattern>,
    ) -> Result<search::Request<'a>, TaskError> {
        let (class, objective) = (self.class(file), self.objective(file));
        if prove && objective == Objective::P95 {
            let message = format!(
                "proofs are of worst, guaranteed and rms rates and of the pointing error, not of {}",
                objective.key()
            );
            return Err(TaskError::Option { option: "--prove", message });
        }
        if self.cutting_planes && !matches!(objective, Objective::WorstRate | Objective::WorstPhase) {
            let message =
                format!("worst profiles join a search for the worst rate, not for {}: leave it out", objective.key());
            return Err(TaskError::Option { option: "--cutting-planes", message });
        }
        let former: Option<(String, Pattern)> = former.map(|former| (former.name, former.pattern));
        Ok(search::Request {
            model: &file.model,
            profiles: &file.profiles,
            tolerance: file.tolerance.as_ref(),
            objective,
            class,
            plan: self.plan(file)?,
            saved: None,
            former,
            prove,
            recommend: true,
            cuts: self.cutting_planes,
            uncertain: &[],
            ends: self.ends,
        })
    }
}

#[cfg(feature = "report")]
mod folder {
    use std::path::Path;

    use super::{ModelFile, NamedPattern, TaskError};
    use crate::io::files::write_atomically;
    use crate::io::json::search::OptimiseJson;
    use crate::io::read::pattern_file::print_pattern;
    use crate::io::write::model_edit::with_ramps;
    use crate::io::write::run_directory::write_results;
    use crate::search::Answer;
    use crate::task::page::{REPORT_FILE, write_report};
    use crate::task::schedule;
    use crate::text::sink::TomlComment;

    /// Writes what a search has found: the pattern, tables, the schedule and the page.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn write(folder: &Path, file: &ModelFile, document: &OptimiseJson, answer: &Answer) -> Result<(), TaskError> {
        let best = &answer.best;
        let named = NamedPattern { name: best.name.clone(), pattern: best.pattern.clone() };
        let schedule = schedule::run(&schedule::Request { model: file, pattern: Some(&named) })?;
        for (name, text) in schedule.tables()? {
            write_atomically(&folder.join(name), text.as_bytes())?;
        }
        if let Some(ends) = answer.ends.as_ref().filter(|ends| !ends.judged.pattern.end_turns().is_none()) {
            let named = NamedPattern { name: ends.judged.name.clone(), pattern: ends.judged.pattern.clone() };
            let comments = [format!("coil: {}", file.model.name), ends.statement.clone()];
            let text = print_pattern(&named, &comments.each_ref().map(TomlComment::of));
            write_atomically(&folder.join("ends.toml"), text.as_bytes())?;
            let schedule = schedule::run(&schedule::Request { model: file, pattern: Some(&named) })?;
            for (name, text) in schedule.tables()? {
                write_atomically(&folder.join(format!("ends-{name}")), text.as_bytes())?;
            }
        }
        if let Some(cuts) = answer.cuts.as_ref().filter(|cuts| !cuts.joined.is_empty()) {
            // The worst profile that is stated may be one that joined.
            let listed = with_ramps(&file.path.display().to_string(), &file.source, &cuts.joined)?;
            write_atomically(&folder.join("model.toml"), listed.as_bytes())?;
        }
        write_results(folder, document, best, &answer.state)?;
        write_report(folder, &folder.join(REPORT_FILE))?;
        Ok(())
    }
}
#[cfg(feature = "report")]
pub use folder::write;
