//! Patterns on the profiles that provoke them most, where a model has no guaranteed worst case.
//!
//! An effect that is not linear in the rates of the drive leaves no bound for all profiles, and profiles that are drawn at random seldom come near
//! the worst one: a pattern that looks good on thousands of them may be twice as bad on one that reverses its ramps at the wrong times. Without such
//! effects the model is linear, and has for each pattern a bang-bang profile that is worst of all. All patterns are judged on the worst
//! profiles of all of them, by the whole model, each cut to the length of the searched ones: longer ones lead to temperatures that no searched
//! profile comes to, where what follows temperature is no longer known.
//!
//! ```text
//! provoked(p) = max over q of max over t |rate of p on the profile that is worst for q without those effects|
//! ```
//!
//! The worst of all profiles is at least as bad: this bounds what a guaranteed rate would be from below, not from above.
//!
//! # Source
//! The bang-bang profile as in [`guaranteed`](super::cost::guaranteed).

use super::cost::guaranteed::UnitStep;
use super::cost::worst_case::SolvedProfiles;
use super::evaluator::{Evaluator, JudgeError};
use crate::effect::DeclaredEffect;
use crate::pattern::Pattern;
use crate::profile::{Piece, Profile};
use crate::rate::CoilModel;

impl Evaluator<'_> {
    /// The worst rate of each pattern \[rad/s\]; none where the model has a guaranteed one, and where what is not linear is a rate that no winding changes: it
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
        let lengths_s = self.solved.profiles().iter().map(|p| p.profile.duration_s());
        let longest_s = lengths_s.fold(0.0, f64::max);
        let worst_for = |(place, pattern): (usize, &Pattern)| -> Result<Profile, JudgeError> {
            let worst = step.guaranteed(&linear, pattern)?.profile(&format!("provokes-{}", place + 1));
            Ok(end_of(&worst, longest_s))
        };
        let profiles: Vec<Profile> = patterns.iter().enumerate().map(worst_for).collect::<Result<_, _>>()?;
        let solved = SolvedProfiles::new(self.model, &profiles)?;
        let worst = |pattern: &Pattern| Ok(Some(solved.worst_case(self.model, pattern)?.rate_rad_per_s.abs()));
        patterns.iter().map(worst).collect()
    }
}

/// The last part of a profile, at most so long \[s\]: what lies further back is nearly forgotten when the worst is reached. The whole of
/// it where that is no length.
fn end_of(profile: &Profile, duration_s: f64) -> Profile {
    let mut left_s = duration_s;
    let mut pieces = Vec::new();
    for piece in profile.pieces().iter().rev() {
        let own_s = piece.duration_s.min(left_s);
        if !(own_s > 0.0) {
            break;
        }
        pieces.push(Piece { duration_s: own_s, ..*piece });
        left_s -= own_s;
    }
    pieces.reverse();
    Profile::new(profile.name(), pieces).unwrap_or_else(|_| profile.clone())
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
    const LONG_S: f64 = 1e7;

    fn provoked(effects: &[&str], duration_s: f64, patterns: &[Pattern]) -> Vec<Option<f64>> {
        let model = model(8, LayerLength::Actual, effects);
        let profiles = ProfileSpec {
            max_rate_k_per_s: MAX_RATE_K_PER_S,
            count: 4,
            segments: 3,
            duration_s,
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
            provoked(&["surface_film", "heating_cooling_asymmetry"], LONG_S, &patterns).iter().zip(&patterns)
        {
            let bound = step.guaranteed(&film, pattern).unwrap().rate_rad_per_s;
            let ratio = found.unwrap() / bound;
            assert!((0.975..1.025).contains(&ratio), "{ratio}");
        }
        assert_eq!(provoked(&["surface_film"], LONG_S, &patterns), [None; 3]);
        assert_eq!(provoked(&["surface_film", "bias_temperature"], LONG_S, &patterns), [None; 3]);
    }

    #[test]
    fn profiles_that_provoke_end_alike_and_are_no_longer_than_the_searched_ones() {
        let rates = [1.0, -1.0, 1.0].map(|sign| sign * MAX_RATE_K_PER_S);
        let pieces = rates.iter().zip([1000.0, 300.0, 1.0]);
        let pieces = pieces.map(|(&rate_k_per_s, duration_s)| Piece { rate_k_per_s, duration_s }).collect();
        let whole = Profile::new("whole", pieces).unwrap();
        let durations = |of: &Profile| of.pieces().iter().map(|p| p.duration_s).collect::<Vec<f64>>();
        assert_eq!(durations(&end_of(&whole, 401.0)), [100.0, 300.0, 1.0]);
        assert_eq!(durations(&end_of(&whole, 301.0)), [300.0, 1.0]);
        assert_eq!(end_of(&whole, LONG_S), whole);
        let patterns = [Classic::Dip, Classic::Qua].map(|c| c.pattern(8).unwrap());
        let short = provoked(&["surface_film", "heating_cooling_asymmetry"], 300.0, &patterns);
        let long = provoked(&["surface_film", "heating_cooling_asymmetry"], LONG_S, &patterns);
        assert!(
            short.iter().zip(&long).all(|(short, long)| short.unwrap() <= 1.03 * long.unwrap()),
            "{short:?} {long:?}"
        );
    }
}
