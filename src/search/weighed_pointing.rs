//! What patterns are weighed by where the pointing error is what is made small: on unseen profiles, over all profiles, over
//! built coils and over models that may be the true one, all as the rate that makes it in one hour.

use super::aside::Resolution;
use super::cost::objective::Objective;
use super::cost::pointing::{EndlessRamp, POINTING_S, pointing_as_rate};
use super::cost::tolerance::{Coils, SHARE, ToleranceError, ToleranceSpec};
use super::cost::worst_case::{SearchError, SolvedProfiles};
use super::evaluator::{Evaluator, JudgeError};
use crate::numeric::statistics::quantile;
use crate::parallel::InParallel;
use crate::pattern::Pattern;
use crate::profile::Profile;
use crate::rate::CoilModel;

/// Built coils at most: each has all profiles solved anew, where the guaranteed rate needs one step of the drive.
const MOST_BUILT: usize = 64;

/// What the pointing error of one pattern is weighed by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PointingFigures {
    pub(super) searched_rad_per_s: f64,
    /// Over all sets of unseen profiles.
    pub(super) unseen_rad_per_s: f64,
    /// Over all profiles within the largest rate; none where it grows without end, or the model has no such bound.
    pub(super) guaranteed_rad_per_s: Option<f64>,
    /// 95 % quantile over built coils, and how many.
    pub(super) built: Option<(f64, usize)>,
    /// 95 % quantile over models that may be the true one.
    pub(super) likely_rad_per_s: Option<f64>,
    /// Pointing errors closer together than this are the same in a coil that is wound.
    pub(super) resolution_rad_per_s: f64,
}

impl PointingFigures {
    pub(super) fn figure(&self) -> f64 {
        let built = self.built.map(|(p95, _)| p95);
        self.likely_rad_per_s.or(built).or(self.guaranteed_rad_per_s).unwrap_or(self.unseen_rad_per_s)
    }

    pub(super) fn figure_words(&self) -> &'static str {
        match (self.likely_rad_per_s, self.built, self.guaranteed_rad_per_s) {
            (Some(_), ..) => "95 % quantile of the worst pointing error over the models that the records allow",
            (None, Some(_), _) => "95 % quantile of the worst pointing error over built coils",
            (None, None, Some(_)) => "guaranteed worst pointing error",
            (None, None, None) => "worst pointing error on unseen profiles",
        }
    }

    /// In words, beside the number of unseen profiles.
    pub(super) fn facts(&self, profiles: usize) -> Vec<String> {
        let shown = |value: f64| Objective::Pointing.shown(value);
        let mut parts = vec![
            format!("pointing error {} on the searched profiles", shown(self.searched_rad_per_s)),
            format!("{} on {profiles} unseen ones", shown(self.unseen_rad_per_s)),
        ];
        parts.extend(self.guaranteed_rad_per_s.map(|g| format!("{} guaranteed", shown(g))));
        parts.extend(self.built.map(|(p95, coils)| format!("{} for 95 % of {coils} built coils", shown(p95))));
        parts.extend(
            self.likely_rad_per_s.map(|p95| format!("{} for 95 % of the models that the records allow", shown(p95))),
        );
        parts
    }
}

impl Evaluator<'_> {
    /// What the pointing errors of patterns are on what was not searched; `unseen` are those on unseen profiles.
    ///
    /// # Errors
    /// None that a model which could be solved would cause.
    pub(super) fn pointing_figures(
        &self,
        patterns: &[Pattern],
        unseen: &[f64],
        uncertain: &[CoilModel],
    ) -> Result<Vec<PointingFigures>, JudgeError> {
        let ramp = EndlessRamp::new(self.model)?;
        let steepest = self.profiles.max_rate_k_per_s;
        let drawn = self.profiles.profiles();
        let built = self.built_pointing(&drawn, patterns)?;
        let likely = if uncertain.is_empty() {
            None
        } else {
            let of = |model: &CoilModel| worst_pointing_under(model, &drawn, patterns);
            Some(p95_over(uncertain.iter().in_parallel().map(of), patterns.len())?)
        };
        let of = |(i, pattern): (usize, &Pattern)| -> Result<PointingFigures, SearchError> {
            let guaranteed = ramp.as_ref().map(|ramp| ramp.guaranteed_rad(pattern, steepest)).transpose()?;
            let resolution = Resolution::of(Objective::Pointing, self.model, self.solved, pattern)?;
            Ok(PointingFigures {
                searched_rad_per_s: pointing_as_rate(self.model, self.solved, pattern)?.rate_rad_per_s.abs(),
                unseen_rad_per_s: unseen[i],
                guaranteed_rad_per_s: guaranteed.flatten().map(|rad| rad / POINTING_S),
                built: built.as_ref().map(|(p95, coils)| (p95[i], *coils)),
                likely_rad_per_s: likely.as_ref().map(|p95| p95[i]),
                resolution_rad_per_s: resolution.change_rad_per_s,
            })
        };
        Ok(patterns.iter().enumerate().map(of).collect::<Result<_, _>>()?)
    }

    /// The 95 % quantile of each pattern over built coils, and how many those are; none without spreads.
    fn built_pointing(&self, drawn: &[Profile], patterns: &[Pattern]) -> Result<Option<(Vec<f64>, usize)>, JudgeError> {
        let Some(declared) = self.tolerance else { return Ok(None) };
        let spec = ToleranceSpec { samples: declared.samples.clamp(2, MOST_BUILT), ..declared.clone() };
        let coils = match Coils::new(self.model, self.profiles, &spec) {
            Ok(coils) => coils,
            Err(ToleranceError::NoSpread) => return Ok(None),
            Err(error) => return Err(error.into()),
        };
        let worst = coils.of_built(|model| worst_pointing_under(&model?, drawn, patterns));
        Ok(Some((p95_over(worst, patterns.len())?, spec.samples)))
    }
}

/// Each pattern's worst pointing error over profiles, by one model.
fn worst_pointing_under(model: &CoilModel, drawn: &[Profile], patterns: &[Pattern]) -> Result<Vec<f64>, SearchError> {
    let solved = SolvedProfiles::new(model, drawn)?;
    let of = |pattern: &Pattern| Ok(pointing_as_rate(model, &solved, pattern)?.rate_rad_per_s.abs());
    patterns.iter().map(of).collect()
}

/// The 95 % quantile of each pattern's worst pointing error over models.
fn p95_over(
    worst: impl IntoIterator<Item = Result<Vec<f64>, SearchError>>,
    patterns: usize,
) -> Result<Vec<f64>, SearchError> {
    let worst: Vec<Vec<f64>> = worst.into_iter().collect::<Result<_, _>>()?;
    let of = |p: usize| {
        let mut ascending: Vec<f64> = worst.iter().map(|model| model[p]).collect();
        ascending.sort_by(f64::total_cmp);
        quantile(&ascending, SHARE)
    };
    Ok((0..patterns).map(of).collect())
}
