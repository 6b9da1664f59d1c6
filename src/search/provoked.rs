//! Patterns on the profiles that provoke them most, where a model has no guaranteed worst case.
//!
//! An effect that is not linear in the rates of the drive leaves no bound for all profiles, and profiles that are drawn at random seldom come near
//! the worst one: a pattern that looks good on thousands of them may be twice as bad on one that reverses its ramps at the wrong times. Without such
//! effects the model is linear, and has for each pattern a bang-bang profile that is worst of all. All patterns are judged on the worst
//! profiles of all of them, by the whole model:
//!
//! ```text
//! provoked(p) = max over q of max over t |rate of p on the profile that is worst for q without those effects|
//! ```
//!
//! That is no bound, but one that is searched for: the worst of all profiles is at least as bad.

use super::cost::guaranteed::UnitStep;
use super::cost::worst_case::SolvedProfiles;
use super::evaluator::{Evaluator, JudgeError};
use crate::effect::DeclaredEffect;
use crate::pattern::Pattern;
use crate::profile::Profile;
use crate::rate::CoilModel;

impl Evaluator<'_> {
    /// The worst rates [rad/s]; none where the model has a guaranteed one, and where what is not linear is a rate that no winding changes: it
    /// follows temperature, and is largest on other profiles.
    ///
    /// # Errors
    /// None that a model which could be solved would cause.
    pub(super) fn provoked_rad_per_s(&self, patterns: &[Pattern]) -> Result<Vec<Option<f64>>, JudgeError> {
        let coil = &self.model.coil;
        let (linear, other): (Vec<DeclaredEffect>, Vec<DeclaredEffect>) =
            self.model.effects.iter().cloned().partition(|e| e.bind(coil, &[]).is_linear());
        if other.is_empty() || other.iter().any(|e| e.bind(coil, &[]).is_beside_coil()) {
            return Ok(vec![None; patterns.len()]);
        }
        let linear = CoilModel { effects: linear, ..self.model.clone() };
        let step = UnitStep::new(&linear, self.profiles.max_rate_k_per_s)?;
        let worst_for = |(place, pattern): (usize, &Pattern)| -> Result<Profile, JudgeError> {
            Ok(step.guaranteed(&linear, pattern)?.profile(&format!("provokes-{}", place + 1)))
        };
        let profiles: Vec<Profile> = patterns.iter().enumerate().map(worst_for).collect::<Result<_, _>>()?;
        let solved = SolvedProfiles::new(self.model, &profiles)?;
        let worst = |pattern: &Pattern| Ok(Some(solved.worst_case(self.model, pattern)?.rate_rad_per_s.abs()));
        patterns.iter().map(worst).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coil::LayerLength;
    use crate::pattern::classic::Classic;
    use crate::profile::ProfileSpec;
    use crate::search::cost::objective::Objective;
    use crate::search::cost::samples::tests::model;

    const MAX_RATE_K_PER_S: f64 = 0.003;

    fn provoked(effects: &[&str], patterns: &[Pattern]) -> Vec<Option<f64>> {
        let model = model(8, LayerLength::Actual, effects);
        let profiles = ProfileSpec {
            max_rate_k_per_s: MAX_RATE_K_PER_S,
            count: 4,
            segments: 3,
            duration_s: 2000.0,
            seed: 1,
            listed: Vec::new(),
        };
        let solved = SolvedProfiles::new(&model, &profiles.profiles()).unwrap();
        let objective = Objective::WorstRate;
        let (profiles, unit_step, tolerance) = (&profiles, None, None);
        let evaluator = Evaluator { model: &model, solved: &solved, objective, unit_step, profiles, tolerance };
        evaluator.provoked_rad_per_s(patterns).unwrap()
    }

    #[test]
    fn where_an_effect_is_hardly_there_the_provoked_rate_is_the_guaranteed_one_without_it() {
        let patterns = [Classic::Dip, Classic::Qua, Classic::Zyl].map(|c| c.pattern(8).unwrap());
        let film = model(8, LayerLength::Actual, &["surface_film"]);
        let step = UnitStep::new(&film, MAX_RATE_K_PER_S).unwrap();
        // The rate is up to two per cent larger while the coil warms up.
        for (found, pattern) in
            provoked(&["surface_film", "heating_cooling_asymmetry"], &patterns).iter().zip(&patterns)
        {
            let bound = step.guaranteed(&film, pattern).unwrap().rate_rad_per_s;
            let ratio = found.unwrap() / bound;
            assert!((0.975..1.025).contains(&ratio), "{ratio}");
        }
        assert_eq!(provoked(&["surface_film"], &patterns), [None; 3]);
        assert_eq!(provoked(&["surface_film", "bias_temperature"], &patterns), [None; 3]);
    }
}
