//! The final judgement: what was found and the classic windings, all by the reference, and what to say about it.

use thiserror::Error;

use crate::pattern::Pattern;
use crate::pattern::classic::Classic;
use crate::pattern::windability::WindabilityClass;
use crate::profile::{Profile, ProfileSpec};
use crate::rate::{CoilModel, RateModel};
use crate::search::anneal::rounds::FoundPattern;
use crate::search::aside::{Aside, GridCheck, GridChecked, GridFigure, PointingError};
use crate::search::cost::guaranteed::{GuaranteedError, UnitStep};
use crate::search::cost::objective::Objective;
use crate::search::cost::pointing::{POINTING_S, pointing_as_rate};
use crate::search::cost::tolerance::{Coils, ToleranceError, ToleranceSpec};
use crate::search::cost::worst_case::{SearchError, SolvedProfiles, WorstCase};
use crate::search::proof::compound::compounded;
use crate::search::proof::permutation_tree::MOST_LAYERS;
use crate::search::proof::stretches::rearranged;
use crate::search::proof::{Goal, Improvement, ProofEffort, Task, improve};
use crate::thermal::{Extent, Location};
use crate::units::percent_from_fraction;

/// Why patterns cannot be judged.
#[derive(Debug, Error, Clone, PartialEq)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum JudgeError {
    #[error(transparent)]
    Search(#[from] SearchError),
    #[error(transparent)]
    Guaranteed(#[from] GuaranteedError),
    #[error(transparent)]
    Tolerance(#[from] ToleranceError),
}

/// A pattern with its reference values.
#[derive(Debug, Clone, PartialEq)]
pub struct Judged {
    /// A classic's, the file's, or what the search calls it.
    pub name: String,
    /// Which segment lies on which layer.
    pub pattern: Pattern,
    /// Over the profiles, whatever was made small.
    pub worst: WorstCase,
    /// Δφ at the worst rate \[rad\].
    pub(crate) phase_rad: f64,
    /// None for models that have no guaranteed worst case.
    pub(crate) guaranteed_rad_per_s: Option<f64>,
    /// The 95 % quantile over built coils, where it is the objective.
    pub(crate) p95_rad_per_s: Option<f64>,
    /// The objective by the reference, in rad/s.
    pub objective_rad_per_s: f64,
    /// By how much the worst and the guaranteed rate may be off the continuum's; None before it was asked for.
    pub(crate) grid_margin_rad_per_s: Option<f64>,
    /// None before it was asked for.
    pub(crate) pointing: Option<PointingError>,
}

/// The best of what was found and a few others of it.
fn starts_with(best: &Judged, found: &[FoundPattern]) -> Vec<Pattern> {
    let others = found.iter().take(MOST_STARTS);
    let others = others.map(|f| Pattern::new(f.segments.clone()).expect("a walk visits permutations only"));
    std::iter::once(best.pattern.clone()).chain(others).collect()
}

impl Judged {
    /// By more than rounding.
    pub(super) fn is_better_than(&self, other: &Judged) -> bool {
        self.objective_rad_per_s < other.objective_rad_per_s * (1.0 - EQUALLY_GOOD)
    }

    pub(super) fn as_found(&self) -> FoundPattern {
        FoundPattern { cost: self.objective_rad_per_s, segments: self.pattern.segments().to_vec() }
    }
}

/// What a pattern is judged by.
#[derive(Debug, Clone, Copy)]
pub struct Evaluator<'a> {
    /// The coil.
    pub model: &'a CoilModel,
    /// Its temperatures under the profiles.
    pub solved: &'a SolvedProfiles,
    /// What is made small.
    pub objective: Objective,
    /// None for models that have no guaranteed worst case.
    pub unit_step: Option<&'a UnitStep>,
    /// What the profiles were made from.
    pub profiles: &'a ProfileSpec,
    /// Needed for the objective P95.
    pub tolerance: Option<&'a ToleranceSpec>,
}

/// Classics in the order in which one is named where several are equally good.
const PREFERENCE: [Classic; 7] =
    [Classic::Qua, Classic::Oct, Classic::Hex, Classic::Dip, Classic::SymText, Classic::Sym, Classic::Zyl];

/// Below this there is nothing to improve that the annealer would not find.
pub(super) const FEWEST_LAYERS: usize = 4;

/// Up to here, with equal layers, the best permutation is proved within [`PROVING_NODES`]: seconds.
const PROVABLE_LAYERS: usize = 16;
const PROVING_NODES: u64 = 1 << 24;

/// What is spent on a better pattern where no proof can be expected.
const IMPROVING_NODES: u64 = 1 << 18;

/// Nodes of a level that the last look for something better keeps: a second or a few.
const BEAM_WIDTH: usize = 1 << 14;

/// Of the moves that are tried many at once: the same for every search, so that what one comes upon no other misses.
const COMPOUND_SEED: u64 = 1;

/// Patterns that the improvement begins with, besides the best.
pub(super) const MOST_STARTS: usize = 6;

/// Relative difference below which two patterns count as equally good.
pub(crate) const EQUALLY_GOOD: f64 = 1e-9;

impl Evaluator<'_> {
    /// # Errors
    /// A pattern of another layer count; an objective that the model has not.
    pub fn judge(&self, name: &str, pattern: &Pattern) -> Result<Judged, JudgeError> {
        let mut judged = self.judge_all(&[(name.to_owned(), pattern.clone())])?;
        Ok(judged.remove(0))
    }

    /// Patterns by their names; built coils are drawn and solved once for all of them.
    ///
    /// # Errors
    /// As [`Evaluator::judge`].
    pub(crate) fn judge_all(&self, named: &[(String, Pattern)]) -> Result<Vec<Judged>, JudgeError> {
        let p95_rad_per_s = if self.objective == Objective::P95 {
            let patterns: Vec<Pattern> = named.iter().map(|(_, pattern)| pattern.clone()).collect();
            self.coils()?.p95_rad_per_s(&patterns)?.into_iter().map(Some).collect()
        } else {
            vec![None; named.len()]
        };
        named.iter().zip(p95_rad_per_s).map(|((name, pattern), p95)| Ok(self.judge_one(name, pattern, p95)?)).collect()
    }

    /// The coils that the objective P95 is about.
    ///
    /// # Errors
    /// No tolerances, or none that are above zero.
    pub(super) fn coils(&self) -> Result<Coils<'_>, ToleranceError> {
        let tolerance = self.tolerance.ok_or(ToleranceError::NoTolerance)?;
        Coils::new(self.model, self.profiles, tolerance)
    }

    fn judge_one(&self, name: &str, pattern: &Pattern, p95: Option<f64>) -> Result<Judged, SearchError> {
        let rate_model = RateModel::new(self.model, pattern, &[])?;
        let worst = self.solved.worst_case(self.model, pattern)?;
        let guaranteed_rad_per_s = match self.unit_step.map(|step| step.guaranteed(self.model, pattern)) {
            Some(Ok(found)) => Some(found.rate_rad_per_s),
            Some(Err(GuaranteedError::Search(error))) => return Err(error),
            Some(Err(GuaranteedError::Effect { .. })) | None => None,
        };
        // A search for what the model has not ends before.
        let or_none = |value: Option<f64>| value.unwrap_or(f64::INFINITY);
        let objective_rad_per_s = match self.objective {
            Objective::WorstRate | Objective::WorstPhase => worst.rate_rad_per_s.abs(),
            Objective::RootMeanSquare => crate::search::cost::objective::rms_rad_per_s(&rate_model, self.solved),
            Objective::GuaranteedRate => or_none(guaranteed_rad_per_s),
            Objective::P95 => or_none(p95),
            Objective::Pointing => pointing_as_rate(self.model, self.solved, pattern)?.rate_rad_per_s.abs(),
        };
        Ok(Judged {
            name: name.to_owned(),
            pattern: pattern.clone(),
            phase_rad: rate_model.phase_rad(worst.rate_rad_per_s),
            guaranteed_rad_per_s,
            p95_rad_per_s: p95,
            worst,
            objective_rad_per_s,
            grid_margin_rad_per_s: None,
            pointing: None,
        })
    }

    /// Every classic that fits the layer count.
    ///
    /// # Errors
    /// An objective that the model has not.
    pub fn baselines(&self) -> Result<Vec<Judged>, JudgeError> {
        let layers = self.model.coil.layers();
        let fitting: Vec<(String, Pattern)> = Classic::ALL
            .into_iter()
            .filter_map(|classic| Some((classic.key().to_owned(), classic.pattern(layers).ok()?)))
            .collect();
        self.judge_all(&fitting)
    }

    /// Judges the best pattern and QUA again on a grid twice as fine; `None` where there is no grid.
    ///
    /// # Errors
    /// None that a model which could be solved would cause.
    pub(crate) fn grid_check(&self, best: &Judged, baselines: &[Judged]) -> Result<Option<GridCheck>, SearchError> {
        let path = self.model.heat_path()?;
        if path.extent == Extent::HalfSpace {
            return Ok(None);
        }
        let finer_cells_per_layer = 2 * path.cells_per_layer;
        let finer = CoilModel { cells_per_layer: finer_cells_per_layer, ..self.model.clone() };
        let qua = baselines.iter().find(|b| b.name == Classic::Qua.key() && b.pattern != best.pattern);
        let step = (self.objective == Objective::GuaranteedRate)
            .then(|| UnitStep::new(&finer, self.profiles.max_rate_k_per_s).ok())
            .flatten();
        let of = match self.objective {
            Objective::Pointing => GridFigure::Pointing,
            _ if step.is_some() => GridFigure::GuaranteedRate,
            _ => GridFigure::WorstRate,
        };
        let checked = |judged: &Judged, rate_rad_per_s: f64, finer_rad_per_s: f64| GridChecked {
            name: judged.name.clone(),
            rate_rad_per_s,
            finer_rad_per_s,
        };
        let asked = std::iter::once(best).chain(qua);
        let patterns = if let Some(step) = &step {
            asked
                .map(|judged| match step.guaranteed(&finer, &judged.pattern) {
                    Ok(found) => Ok(checked(judged, judged.objective_rad_per_s, found.rate_rad_per_s)),
                    Err(GuaranteedError::Search(error)) => Err(error),
                    Err(GuaranteedError::Effect { .. }) => {
                        Ok(checked(judged, judged.objective_rad_per_s, judged.objective_rad_per_s))
                    }
                })
                .collect::<Result<_, SearchError>>()?
        } else {
            let profiles: Vec<Profile> = self.solved.profiles().iter().map(|p| p.profile.clone()).collect();
            let solved = SolvedProfiles::new(&finer, &profiles)?;
            asked
                .map(|judged| {
                    let (here, there) = if of == GridFigure::Pointing {
                        (judged.objective_rad_per_s, pointing_as_rate(&finer, &solved, &judged.pattern)?)
                    } else {
                        (judged.worst.rate_rad_per_s.abs(), solved.worst_case(&finer, &judged.pattern)?)
                    };
                    Ok(checked(judged, here, there.rate_rad_per_s.abs()))
                })
                .collect::<Result<_, SearchError>>()?
        };
        Ok(Some(GridCheck { of, cells_per_layer: path.cells_per_layer, finer_cells_per_layer, patterns }))
    }

    /// With what the grid may put its rates off, and with its pointing error.
    ///
    /// # Errors
    /// None that a model which could be solved would cause.
    pub(crate) fn completed(&self, aside: &Aside, judged: Judged) -> Result<Judged, SearchError> {
        let steepest = self.steepest_k_per_s();
        let grid_margin_rad_per_s = Some(aside.margin.of(self.solved, &judged.pattern, steepest)?);
        let pointing =
            Some(aside.pointing(self.model, self.solved, &judged.pattern, self.profiles.max_rate_k_per_s)?);
        Ok(Judged { grid_margin_rad_per_s, pointing, ..judged })
    }

    /// The largest rate of the drive that any number here is about.
    pub(crate) fn steepest_k_per_s(&self) -> f64 {
        let of_profiles = self.solved.profiles().iter().map(|p| p.profile.max_rate_k_per_s());
        of_profiles.fold(self.profiles.max_rate_k_per_s, f64::max)
    }

    /// By how much the grid may put the objective of any pattern off the continuum's.
    ///
    /// # Errors
    /// None that a model which could be solved would cause.
    pub(crate) fn margin_of_any(&self, aside: &Aside) -> Result<f64, SearchError> {
        let of_rate = aside.margin.of_any(self.steepest_k_per_s())?;
        let longest_s = self.solved.profiles().iter().map(|p| p.profile.duration_s()).fold(0.0, f64::max);
        // A rate that is off by no more at any time adds up to no more.
        Ok(if self.objective == Objective::Pointing { of_rate * longest_s / POINTING_S } else { of_rate })
    }

    /// What a proof for the objective is about; `None` for a quantile over built coils, and for a guaranteed worst case
    /// that the model has not.
    pub(crate) fn goal(&self) -> Option<Goal<'_>> {
        match self.objective {
            Objective::WorstRate | Objective::WorstPhase => Some(Goal::WorstRate),
            Objective::RootMeanSquare => Some(Goal::RootMeanSquare),
            Objective::GuaranteedRate => self.unit_step.map(Goal::Guaranteed),
            Objective::Pointing => Some(Goal::Pointing),
            Objective::P95 => None,
        }
    }

    /// What a proof for the objective is about, in a class; `None` as for [`Evaluator::goal`].
    pub(crate) fn task(&self, class: WindabilityClass) -> Option<Task<'_>> {
        self.goal().map(|goal| Task { model: self.model, solved: self.solved, class, goal })
    }

    /// Whether [`Evaluator::improved`] can be expected to prove what is best, so that a search may try it early.
    pub(crate) fn is_provable(&self, class: WindabilityClass) -> bool {
        let layers = self.model.coil.layers();
        let lengths_m = self.model.coil.layer_lengths_m();
        let has_equal_layers = lengths_m.iter().all(|l| *l == lengths_m[0]);
        let is_of_worst = matches!(self.objective, Objective::WorstRate | Objective::WorstPhase | Objective::Pointing);
        is_of_worst && self.can_improve(class) && has_equal_layers && layers <= PROVABLE_LAYERS
    }

    fn can_improve(&self, class: WindabilityClass) -> bool {
        self.goal().is_some()
            && class != WindabilityClass::Standard
            && (FEWEST_LAYERS..=MOST_LAYERS).contains(&self.model.coil.layers())
    }

    /// What a short search by bounds makes of the best pattern and what else was found, and whether that is proved to be
    /// the best of the class: for classes of permutations and the objectives that proofs are about. For the pointing error
    /// many moves at once are tried as well, in every class. The same patterns give the same answer.
    ///
    /// # Errors
    /// None that a model which could be solved would cause.
    pub(crate) fn improved(
        &self,
        class: WindabilityClass,
        best: Judged,
        found: &[FoundPattern],
        good_enough_rad_per_s: Option<f64>,
    ) -> Result<(Judged, bool), JudgeError> {
        let (bounded, is_optimal) = self.improved_by_bounds(class, best.clone(), found, good_enough_rad_per_s)?;
        let Some(task) = self.task(class).filter(|_| !is_optimal && best.pattern.layers() >= FEWEST_LAYERS) else {
            return Ok((bounded, is_optimal));
        };
        let starts = starts_with(&best, found);
        let mut pattern = bounded.pattern.clone();
        let before = |pattern: Pattern| -> Vec<Pattern> { std::iter::once(pattern).chain(starts.clone()).collect() };
        if matches!(self.objective, Objective::Pointing | Objective::RootMeanSquare) {
            pattern = compounded(&task, &before(pattern), COMPOUND_SEED)?;
        }
        if self.can_improve(class) {
            pattern = rearranged(&task, &before(pattern), COMPOUND_SEED)?;
        }
        if pattern == bounded.pattern {
            return Ok((bounded, false));
        }
        Ok((self.judge(&name_of(&pattern), &pattern)?, false))
    }

    /// The same by bounds alone.
    ///
    /// # Errors
    /// None that a model which could be solved would cause.
    pub(super) fn improved_by_bounds(
        &self,
        class: WindabilityClass,
        best: Judged,
        found: &[FoundPattern],
        good_enough_rad_per_s: Option<f64>,
    ) -> Result<(Judged, bool), JudgeError> {
        let Some(task) = self.task(class).filter(|_| self.can_improve(class)) else { return Ok((best, false)) };
        let most_nodes = if self.is_provable(class) { PROVING_NODES } else { IMPROVING_NODES };
        let beam_width = if best.pattern.layers() > PROVABLE_LAYERS { BEAM_WIDTH } else { 0 };
        let good_enough_rad_per_s = good_enough_rad_per_s.unwrap_or(0.0);
        let effort = ProofEffort { most_nodes, beam_width, good_enough_rad_per_s };
        let Improvement { pattern, is_optimal } = improve(&task, &starts_with(&best, found), effort)?;
        if pattern == best.pattern {
            return Ok((best, is_optimal));
        }
        Ok((self.judge(&name_of(&pattern), &pattern)?, is_optimal))
    }

    /// The best of what was found and of the baselines of the class, by the reference.
    ///
    /// `found` is in the order of its sampled cost, which never exceeds the reference: the judging ends where no
    /// further pattern can be better. A baseline stays unless something is better by more than rounding.
    ///
    /// # Errors
    /// None that a model which could be solved would cause.
    pub fn best(
        &self,
        class: WindabilityClass,
        found: &[FoundPattern],
        baselines: &[Judged],
    ) -> Result<Option<Judged>, JudgeError> {
        let mut best: Option<Judged> = None;
        let is_better = |value: f64, best: &Option<Judged>| {
            best.as_ref().is_none_or(|b| value < b.objective_rad_per_s * (1.0 - EQUALLY_GOOD))
        };
        let preferred = PREFERENCE.iter().filter_map(|c| baselines.iter().find(|b| b.name == c.key()));
        for baseline in preferred.filter(|b| class.admits(&b.pattern)) {
            if is_better(baseline.objective_rad_per_s, &best) {
                best = Some(baseline.clone());
            }
        }
        let named = |candidate: &FoundPattern| {
            let pattern = Pattern::new(candidate.segments.clone()).expect("a walk visits permutations only");
            (name_of(&pattern), pattern)
        };
        for candidates in found.chunks(self.judged_at_once()) {
            let promising: Vec<_> = candidates.iter().filter(|c| is_better(c.cost, &best)).map(named).collect();
            if promising.is_empty() {
                break;
            }
            for judged in self.judge_all(&promising)? {
                if is_better(judged.objective_rad_per_s, &best) {
                    best = Some(judged);
                }
            }
        }
        Ok(best)
    }

    /// Built coils are worth being solved for several patterns at once; the best are seldom far down the list.
    fn judged_at_once(&self) -> usize {
        const OF_BUILT_COILS: usize = 6;
        if self.objective == Objective::P95 { OF_BUILT_COILS } else { 1 }
    }

    /// In words: how much better than QUA, under which class, boundary and objective.
    pub(crate) fn statement(&self, best: &Judged, baselines: &[Judged], class: WindabilityClass) -> String {
        let boundary = match self.model.location {
            Location::OuterLayer => "with the outermost layer's temperature prescribed",
            Location::Ambient => "with the ambient temperature prescribed",
            Location::Housing(_) => "with the housing's temperature prescribed",
            Location::Spool => "with the spool's temperature prescribed",
            Location::Flange(_) => "with the temperature of the spool's flange prescribed",
        };
        let what = self.objective.title();
        let shown = |judged: &Judged| self.objective.shown(judged.objective_rad_per_s);
        let count = self.solved.profiles().len();
        let over = match self.objective {
            Objective::GuaranteedRate => "all profiles within the largest rate".to_owned(),
            Objective::P95 => format!("{} built coils", self.tolerance.map_or(0, |t| t.samples)),
            _ if count == 1 => "one profile".to_owned(),
            _ => format!("{count} profiles"),
        };
        let scope = format!("in the class {class}, {boundary}, over {over}");
        let Some(qua) = baselines.iter().find(|b| b.name == Classic::Qua.key()) else {
            return format!(
                "There is no QUA to compare with: {} layers are no multiple of 4. The best pattern found has a {what} \
                 of {} {scope}.",
                best.pattern.layers(),
                shown(best)
            );
        };
        if best.objective_rad_per_s >= qua.objective_rad_per_s * (1.0 - EQUALLY_GOOD) {
            let others: Vec<&str> = baselines
                .iter()
                .filter(|b| {
                    b.name != qua.name
                        && (b.objective_rad_per_s - qua.objective_rad_per_s).abs()
                            <= EQUALLY_GOOD * qua.objective_rad_per_s
                })
                .map(|b| b.name.as_str())
                .collect();
            let also = if others.is_empty() { String::new() } else { format!(" (and so is {})", others.join(", ")) };
            return format!(
                "QUA is as good as it gets{also}: no pattern with a smaller {what} than its {} was found {scope}.",
                shown(qua)
            );
        }
        let factor = qua.objective_rad_per_s / best.objective_rad_per_s;
        format!(
            "The best pattern found has a {what} of {}, {} QUA's {}, {scope}.",
            shown(best),
            how_much_less(factor),
            shown(qua)
        )
    }
}

/// The name of a pattern that a search found: the same pattern has the same name in every search, another one another.
pub(crate) fn name_of(pattern: &Pattern) -> String {
    // FNV-1a, folded to sixteen bits.
    let hash = pattern.segments().iter().fold(0x811c_9dc5_u32, |h, &s| (h ^ s as u32).wrapping_mul(0x0100_0193));
    format!("searched-{}-{:04x}", pattern.layers(), (hash >> 16) ^ (hash & 0xffff))
}

/// QUA's objective over the best pattern's; none where QUA does not fit the layer count or the error is zero.
pub(crate) fn improvement_over_qua(best: &Judged, baselines: &[Judged]) -> Option<f64> {
    let qua = baselines.iter().find(|b| b.name == Classic::Qua.key())?;
    (best.objective_rad_per_s > 0.0).then(|| qua.objective_rad_per_s / best.objective_rad_per_s)
}

fn how_much_less(factor: f64) -> String {
    match factor {
        f if f >= 100.0 => format!("{f:.0} times less than"),
        f if f >= 10.0 => format!("{f:.1} times less than"),
        f if f >= 2.0 => format!("{f:.2} times less than"),
        f => format!("{:.2} % less than", percent_from_fraction(1.0 - 1.0 / f)),
    }
}

#[cfg(test)]
mod tests;
