//! What a hand on the pattern asks: which exchange of two layers helps most, and what each layer adds to the rate error.
//!
//! Exchanges are judged on samples, as a search judges its moves; the rate that is stated afterwards is the reference's.

use crate::pattern::Pattern;
use crate::pattern::windability::WindingGraph;
use crate::rate::{CoilModel, LayerWeights, RateError, RateModel};
use crate::search::cost::columns::{Change, Norm, SampleValues};
use crate::search::cost::samples::SampleMatrix;
use crate::search::cost::worst_case::{SearchError, SolvedProfile};
use crate::thermal::Instant;

/// A pattern with two layers exchanged.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Swap {
    /// Counted from 1, the inner one first.
    pub(crate) layers: (usize, usize),
    pub(crate) pattern: Pattern,
    /// By the samples it was judged on, and the cost without the exchange [rad/s].
    pub(crate) cost_rad_per_s: f64,
    pub(crate) before_rad_per_s: f64,
}

/// The exchange of two layers that makes the cost smallest; none where no exchange makes it smaller. With `as_easy` only
/// patterns count that leave no more captive runs than the one they are made of.
///
/// # Errors
/// A pattern of another layer count.
pub(crate) fn best_swap(
    model: &CoilModel,
    matrix: &SampleMatrix,
    norm: Norm,
    pattern: &Pattern,
    as_easy: bool,
) -> Result<Option<Swap>, RateError> {
    let coil = model.wound_coil()?;
    let here = matrix.coefficients(&LayerWeights::new(&coil, pattern)?);
    let mut values = SampleValues::new(&matrix.columns, &here, norm);
    let before_rad_per_s = values.cost();
    let captive = |pattern: &Pattern| WindingGraph::new(pattern).windability().captive;
    let most = captive(pattern);
    let mut best: Option<Swap> = None;
    for outer in 1..pattern.layers() {
        for inner in 0..outer {
            let mut segments = pattern.segments().to_vec();
            segments.swap(inner, outer);
            let swapped = Pattern::new(segments).expect("an exchange leaves a permutation");
            if as_easy && captive(&swapped) > most {
                continue;
            }
            let there = matrix.coefficients(&LayerWeights::new(&coil, &swapped)?);
            let changes: Vec<Change> = (0..here.len())
                .filter(|&k| there[k] != here[k])
                .map(|column| Change { column, by: there[column] - here[column] })
                .collect();
            let limit = best.as_ref().map_or(before_rad_per_s, |b| b.cost_rad_per_s);
            if let Some(cost) = values.propose(&matrix.columns, &changes, limit).filter(|cost| *cost < limit) {
                let layers = (inner + 1, outer + 1);
                best = Some(Swap { layers, pattern: swapped, cost_rad_per_s: cost, before_rad_per_s });
            }
        }
    }
    Ok(best)
}

/// What adds up to the rate error at an instant [rad/s].
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Shares {
    /// Of each layer, innermost first.
    pub(crate) layers_rad_per_s: Vec<f64>,
    /// Lead and everything outside the coil.
    pub(crate) rest_rad_per_s: f64,
}

/// What each layer adds to the rate error of a pattern at an instant of a profile.
///
/// # Errors
/// A pattern of another layer count; formulas that are not linear in the coil's own rate.
pub(crate) fn shares(
    model: &CoilModel,
    profile: &SolvedProfile,
    pattern: &Pattern,
    instant: Instant,
) -> Result<Shares, SearchError> {
    let rate_model = RateModel::new(model, pattern, &[])?;
    rate_model.check_searchable()?;
    let response = profile.response_at(&rate_model, instant);
    let weights = rate_model.weights();
    let of = |j: usize| {
        response.half_a_rad_per_s_m2[j] * weights.half_a_m2[j]
            + response.half_b_rad_per_s_m2[j] * weights.half_b_m2[j]
            + response.axial_rad_per_s_m2.get(j).map_or(0.0, |x| x * weights.axial_m2[j])
    };
    Ok(Shares {
        layers_rad_per_s: (0..pattern.layers()).map(of).collect(),
        rest_rad_per_s: response.constant_rad_per_s,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coil::LayerLength;
    use crate::pattern::classic::Classic;
    use crate::profile::{Piece, Profile};
    use crate::search::cost::samples::tests::model;
    use crate::search::cost::worst_case::SolvedProfiles;

    fn solved(model: &CoilModel) -> SolvedProfiles {
        let piece = |rate_k_per_s, duration_s| Piece { rate_k_per_s, duration_s };
        let up_and_down = Profile::new("up and down", vec![piece(0.01, 900.0), piece(-0.006, 1500.0)]).unwrap();
        SolvedProfiles::new(model, &[up_and_down]).unwrap()
    }

    #[test]
    fn the_best_exchange_is_the_best_of_all_that_the_reference_knows() {
        for length in [LayerLength::Equal, LayerLength::Actual] {
            let model = model(8, length, &["surface_film", "strain_mismatch"]);
            let solved = solved(&model);
            let (matrix, _) = SampleMatrix::of_profiles(&model, &solved).unwrap();
            let dip = Classic::Dip.pattern(8).unwrap();
            let cost = |pattern: &Pattern| matrix.cost(&model, pattern, Norm::Largest).unwrap();
            let mut least = cost(&dip);
            for outer in 1..8 {
                for inner in 0..outer {
                    let mut segments = dip.segments().to_vec();
                    segments.swap(inner, outer);
                    least = least.min(cost(&Pattern::new(segments).unwrap()));
                }
            }
            let found = best_swap(&model, &matrix, Norm::Largest, &dip, false).unwrap().unwrap();
            assert!((found.cost_rad_per_s / least - 1.0).abs() < 1e-9, "{found:?} {least}");
            assert!((cost(&found.pattern) / least - 1.0).abs() < 1e-9);
            let captive = |pattern: &Pattern| WindingGraph::new(pattern).windability().captive;
            let easy = best_swap(&model, &matrix, Norm::Largest, &dip, true).unwrap();
            assert!(easy.is_none_or(|easy| captive(&easy.pattern) <= captive(&dip)));
        }
    }

    #[test]
    fn the_layers_shares_add_up_to_the_rate_error() {
        let model =
            model(8, LayerLength::Actual, &["surface_film", "strain_mismatch", "axial_gradient", "bias_temperature"]);
        let solved = solved(&model);
        let pattern = Classic::Dip.pattern(8).unwrap();
        let worst = solved.worst_case(&model, &pattern).unwrap();
        let shares = shares(&model, &solved.profiles()[0], &pattern, Instant::after(worst.time_s)).unwrap();
        let sum = shares.layers_rad_per_s.iter().sum::<f64>() + shares.rest_rad_per_s;
        assert!((sum / worst.rate_rad_per_s - 1.0).abs() < 1e-9, "{sum} {worst:?}");
    }
}
