//! A coil model under given profiles, compiled into columns over samples: what the search runs on.
//!
//! ```text
//! Ω_s(P) = c_s + Σ_j ( A_sj w_j^A(P) + B_sj w_j^B(P) + X_sj x_j(P) )
//! ```
//!
//! Only the weights depend on the pattern, so the fields are solved and the effects asked once per search. Where the
//! halves of the fibre respond alike, A and B are one column; where nothing varies along the axis there is no X.
//!
//! # Source
//! The coefficients come from [`RateModel::weight_response`]; tests compare every value with the reference.

use crate::parallel::InParallel;
use crate::pattern::Pattern;
use crate::pattern::classic::Classic;
use crate::rate::{CoilModel, LayerWeights, RateError, RateModel, WeightResponse};
use crate::search::cost::columns::{Columns, Norm};
use crate::search::cost::worst_case::{SearchError, SolvedProfiles, WorstCase};
use crate::thermal::Instant;

/// Which column belongs to which layer and half.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ColumnLayout {
    pub(crate) layers: usize,
    /// Both halves of the fibre respond alike: their weights share a column.
    pub(crate) halves_alike: bool,
    /// Whether temperatures vary along the axis: weights have first moments then.
    pub axial: bool,
}

impl ColumnLayout {
    /// Of the half from end A.
    pub fn column_a(&self, layer: usize) -> usize {
        layer
    }

    /// Of the half from end B.
    pub fn column_b(&self, layer: usize) -> usize {
        if self.halves_alike { layer } else { self.layers + layer }
    }

    /// Only where `axial` holds.
    pub fn column_axial(&self, layer: usize) -> usize {
        self.column_b(self.layers - 1) + 1 + layer
    }

    /// How many there are.
    pub fn columns(&self) -> usize {
        self.layers * (1 + usize::from(!self.halves_alike) + usize::from(self.axial))
    }
}

/// Where a sample comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleOrigin {
    pub(crate) profile: usize,
    pub(crate) instant: Instant,
}

/// The compiled objective: columns over samples, and the lengths that turn a pattern into weights.
#[derive(Debug, Clone)]
pub struct SampleMatrix {
    /// Which column belongs to which layer and half.
    pub layout: ColumnLayout,
    /// One row a sample.
    pub columns: Columns,
    lengths_m: Vec<f64>,
}

impl SampleMatrix {
    /// From the responses of any samples of a model.
    ///
    /// # Errors
    /// Effects that leave a layer no turns.
    pub(crate) fn new(model: &CoilModel, responses: &[WeightResponse]) -> Result<Self, RateError> {
        let lengths_m = model.wound_coil()?.layer_lengths_m().to_vec();
        let layers = lengths_m.len();
        let layout = ColumnLayout {
            layers,
            halves_alike: responses.iter().all(|r| r.half_a_rad_per_s_m2 == r.half_b_rad_per_s_m2),
            axial: responses.iter().any(|r| r.axial_rad_per_s_m2.iter().any(|x| *x != 0.0)),
        };
        let constant: Vec<f64> = responses.iter().map(|r| r.constant_rad_per_s).collect();
        let of = |part: fn(&WeightResponse) -> &[f64]| {
            (0..layers)
                .map(move |j| responses.iter().map(|r| part(r).get(j).copied().unwrap_or(0.0)).collect::<Vec<f64>>())
        };
        let mut columns: Vec<Vec<f64>> = of(|r| &r.half_a_rad_per_s_m2).collect();
        if !layout.halves_alike {
            columns.extend(of(|r| &r.half_b_rad_per_s_m2));
        }
        if layout.axial {
            columns.extend(of(|r| &r.axial_rad_per_s_m2));
        }
        Ok(Self { layout, columns: Columns::new(&constant, &columns), lengths_m })
    }

    /// Every instant of the solved profiles is a sample, in their order.
    ///
    /// # Errors
    /// Effects that leave a layer no turns.
    pub fn of_profiles(model: &CoilModel, solved: &SolvedProfiles) -> Result<(Self, Vec<SampleOrigin>), SearchError> {
        let rate_model = any_rate_model(model)?;
        let responses: Vec<WeightResponse> =
            solved.profiles().iter().in_parallel().flat_map(|profile| profile.responses(&rate_model)).collect();
        let origins = solved
            .profiles()
            .iter()
            .enumerate()
            .flat_map(|(index, solved)| {
                solved.pieces.iter().flatten().map(move |&instant| SampleOrigin { profile: index, instant })
            })
            .collect::<Vec<SampleOrigin>>();
        if let Some((_, origin)) = responses.iter().zip(&origins).find(|(response, _)| !is_finite(response)) {
            if let Some(fault) = solved.profiles()[origin.profile].fault(&rate_model) {
                return Err(fault.into());
            }
            let profile = solved.profiles()[origin.profile].profile.name().to_owned();
            return Err(SearchError::NotFinite { profile, time_s: origin.instant.time_s });
        }
        Ok((Self::new(model, &responses)?, origins))
    }

    /// From an array of sensitivities to 2 P(j) − 1 − N, row-major, one row a sample: layers of one metre whose halves
    /// respond alike. Read once, in place; `constant` may be empty.
    pub(crate) fn of_sensitivities(layers: usize, sensitivities: &[f64], constant: &[f64]) -> Self {
        let samples = sensitivities.len() / layers;
        let zero = vec![0.0; if constant.is_empty() { samples } else { 0 }];
        let constant = if constant.is_empty() { &zero } else { constant };
        let column = |j: usize| sensitivities[j..].iter().step_by(layers).copied().collect::<Vec<f64>>();
        let columns: Vec<Vec<f64>> = (0..layers).map(column).collect();
        let layout = ColumnLayout { layers, halves_alike: true, axial: false };
        Self { layout, columns: Columns::new(constant, &columns), lengths_m: vec![1.0; layers] }
    }

    /// The same matrix with the samples in another order, or fewer of them.
    pub fn select(&self, samples: &[usize]) -> Self {
        Self { layout: self.layout, columns: self.columns.select(samples), lengths_m: self.lengths_m.clone() }
    }

    /// The same matrix with further samples behind the others.
    pub(crate) fn extended(&self, responses: &[WeightResponse]) -> Self {
        let layout = self.layout;
        let longer = |column: &[f64], of: &dyn Fn(&WeightResponse) -> f64| {
            column.iter().copied().chain(responses.iter().map(of)).collect::<Vec<f64>>()
        };
        let columns: Vec<Vec<f64>> = (0..layout.columns())
            .map(|k| {
                let layer = k % layout.layers;
                longer(self.columns.column(k), &|r| match k / layout.layers {
                    0 => r.half_a_rad_per_s_m2[layer],
                    1 if !layout.halves_alike => r.half_b_rad_per_s_m2[layer],
                    _ => r.axial_rad_per_s_m2[layer],
                })
            })
            .collect();
        let constant = longer(self.columns.constant(), &|r| r.constant_rad_per_s);
        Self { layout, columns: Columns::new(&constant, &columns), lengths_m: self.lengths_m.clone() }
    }

    /// The same matrix where a pattern's weights are near given ones, as if the halves responded alike and nothing varied
    /// along the axis: what these add is taken as it is at the given weights.
    ///
    /// ```text
    /// A w^A + B w^B + X x ≈ S (w^A + w^B) + { D (w^A − w^B) + X x } at the given weights,   S = (A + B)/2,  D = (A − B)/2
    /// ```
    pub(crate) fn frozen_at(&self, weights: &LayerWeights) -> Self {
        let ColumnLayout { layers, axial, .. } = self.layout;
        let column = |k: usize| self.columns.column(k);
        let mut constant = self.columns.constant().to_vec();
        let mut means = Vec::with_capacity(layers);
        for j in 0..layers {
            let (a, b) = (column(self.layout.column_a(j)), column(self.layout.column_b(j)));
            let curved_m2 = weights.half_a_m2[j] - weights.half_b_m2[j];
            for ((c, a), b) in constant.iter_mut().zip(a).zip(b) {
                *c += 0.5 * (a - b) * curved_m2;
            }
            if axial {
                for (c, x) in constant.iter_mut().zip(column(self.layout.column_axial(j))) {
                    *c += x * weights.axial_m2[j];
                }
            }
            means.push(a.iter().zip(b).map(|(a, b)| 0.5 * (a + b)).collect());
        }
        let layout = ColumnLayout { layers, halves_alike: true, axial: false };
        Self { layout, columns: Columns::new(&constant, &means), lengths_m: self.lengths_m.clone() }
    }

    /// The same matrix with the samples of another behind its own.
    pub(crate) fn joined(&self, other: &Self) -> Self {
        let both = |a: &[f64], b: &[f64]| [a, b].concat();
        let columns: Vec<Vec<f64>> =
            (0..self.columns.count()).map(|k| both(self.columns.column(k), other.columns.column(k))).collect();
        let columns = Columns::new(&both(self.columns.constant(), other.columns.constant()), &columns);
        Self { layout: self.layout, columns, lengths_m: self.lengths_m.clone() }
    }

    /// New samples, each a sum of this matrix's times weights.
    pub(crate) fn combined(&self, weights: &[Vec<(usize, f64)>]) -> Self {
        let sums = |column: &[f64]| -> Vec<f64> {
            weights.iter().map(|weights| weights.iter().map(|&(s, y)| y * column[s]).sum()).collect()
        };
        let columns: Vec<Vec<f64>> = (0..self.columns.count()).map(|k| sums(self.columns.column(k))).collect();
        let columns = Columns::new(&sums(self.columns.constant()), &columns);
        Self { layout: self.layout, columns, lengths_m: self.lengths_m.clone() }
    }

    /// No more samples than columns, with the same root of the mean square for every pattern.
    ///
    /// ```text
    /// ‖D x + c‖ = ‖R (x, 1)‖,   [D c] = Q R
    /// ```
    pub(crate) fn of_same_mean_square(&self) -> Self {
        let (samples, count) = (self.samples(), self.columns.count());
        if samples <= count + 1 {
            return self.clone();
        }
        let entry = |s: usize, k: usize| {
            if k < count { self.columns.column(k)[s] } else { self.columns.constant()[s] }
        };
        let r = nalgebra::DMatrix::from_fn(samples, count + 1, entry).qr().unpack_r();
        let factor = (r.nrows() as f64 / samples as f64).sqrt();
        let column = |k: usize| r.column(k).iter().map(|v| v * factor).collect::<Vec<f64>>();
        let columns: Vec<Vec<f64>> = (0..count).map(column).collect();
        let columns = Columns::new(&column(count), &columns);
        Self { layout: self.layout, columns, lengths_m: self.lengths_m.clone() }
    }

    /// The same matrix with every sample multiplied by its own factor.
    pub(crate) fn scaled(&self, factors: &[f64]) -> Self {
        let scale = |column: &[f64]| column.iter().zip(factors).map(|(v, f)| v * f).collect::<Vec<f64>>();
        let columns: Vec<Vec<f64>> = (0..self.columns.count()).map(|k| scale(self.columns.column(k))).collect();
        let columns = Columns::new(&scale(self.columns.constant()), &columns);
        Self { layout: self.layout, columns, lengths_m: self.lengths_m.clone() }
    }

    /// Of the patterns.
    pub fn layers(&self) -> usize {
        self.layout.layers
    }

    /// Instants of profiles, all profiles together.
    pub fn samples(&self) -> usize {
        self.columns.samples()
    }

    /// l_j, innermost layer first.
    pub fn lengths_m(&self) -> &[f64] {
        &self.lengths_m
    }

    /// Whether each segment's place along the fibre is the same for every pattern.
    pub(crate) fn equal_lengths(&self) -> bool {
        self.lengths_m.iter().all(|l| *l == self.lengths_m[0])
    }

    /// The coefficients of a pattern, from the reference's own weights.
    pub(crate) fn coefficients(&self, weights: &LayerWeights) -> Vec<f64> {
        let mut coefficients = vec![0.0; self.layout.columns()];
        for layer in 0..self.layers() {
            coefficients[self.layout.column_a(layer)] += weights.half_a_m2[layer];
            coefficients[self.layout.column_b(layer)] += weights.half_b_m2[layer];
            if self.layout.axial {
                coefficients[self.layout.column_axial(layer)] = weights.axial_m2[layer];
            }
        }
        coefficients
    }

    /// Ω at every sample, computed from nothing.
    ///
    /// # Errors
    /// A pattern of another layer count.
    pub fn rates_rad_per_s(&self, model: &CoilModel, pattern: &Pattern) -> Result<Vec<f64>, RateError> {
        let weights = LayerWeights::new(&model.wound_coil()?, pattern)?;
        Ok(self.columns.values(&self.coefficients(&weights)))
    }

    /// The cost of a pattern, computed from nothing.
    ///
    /// # Errors
    /// A pattern of another layer count.
    pub fn cost(&self, model: &CoilModel, pattern: &Pattern, norm: Norm) -> Result<f64, RateError> {
        Ok(norm.of(&self.rates_rad_per_s(model, pattern)?))
    }
}

impl SolvedProfiles {
    /// [`SolvedProfiles::worst_case`] of each of several patterns: what the layer weights are multiplied with is worked out once for all.
    ///
    /// # Errors
    /// As there.
    pub(crate) fn worst_cases(&self, model: &CoilModel, patterns: &[Pattern]) -> Result<Vec<WorstCase>, SearchError> {
        if patterns.len() < FEWEST_AT_ONCE || any_rate_model(model)?.has_formulas() {
            return patterns.iter().map(|pattern| self.worst_case(model, pattern)).collect();
        }
        let (matrix, origins) = SampleMatrix::of_profiles(model, self)?;
        let worst = |pattern: &Pattern| {
            let mut tops = vec![0.0_f64; self.profiles().len()];
            let rates_rad_per_s = matrix.rates_rad_per_s(model, pattern)?;
            origins
                .iter()
                .zip(&rates_rad_per_s)
                .for_each(|(o, rate)| tops[o.profile] = tops[o.profile].max(rate.abs()));
            Ok(self.worst_of(&RateModel::new(model, pattern, &[])?, &tops))
        };
        patterns.iter().map(worst).collect()
    }
}

fn is_finite(response: &WeightResponse) -> bool {
    let parts = [&response.half_a_rad_per_s_m2, &response.half_b_rad_per_s_m2, &response.axial_rad_per_s_m2];
    response.constant_rad_per_s.is_finite() && parts.into_iter().flatten().all(|v| v.is_finite())
}

/// Patterns from which on the responses of all samples take less than the samples of each.
const FEWEST_AT_ONCE: usize = 3;

/// A rate model with a pattern that does not matter, to ask for responses.
pub(crate) fn any_rate_model(model: &CoilModel) -> Result<RateModel, SearchError> {
    let pattern = Classic::Zyl.pattern(model.coil.layers()).expect("every even layer count has a cylindrical winding");
    let rate_model = RateModel::new(model, &pattern, &[])?;
    rate_model.check_searchable()?;
    Ok(rate_model)
}

#[cfg(test)]
pub(in crate::search) mod tests {
    use super::*;
    use crate::coil::{Coil, CoilSpec, Fibre, LayerLength};
    use crate::effect::{self, DeclaredEffect};
    use crate::profile::{Piece, Profile};
    use crate::thermal::{DEFAULT_CELLS_PER_LAYER, Extent, Location, PackMaterial};

    /// A tactical coil with any effects at their start values.
    pub(crate) fn model(layers: usize, layer_length: LayerLength, effects: &[&str]) -> CoilModel {
        let fibre = Fibre {
            refractive_index: 1.45,
            thermo_optic_per_k: 1.0e-5,
            group_index: None,
            thermal_expansion_per_k: 0.0,
            wavelength_m: 1550e-9,
            outer_diameter_m: 165e-6,
        };
        let spec = CoilSpec {
            fibre,
            layers,
            turns_per_layer: Some(50.0),
            bore_radius_m: 0.04,
            radial_pitch_m: 165e-6,
            axial_pitch_m: 170e-6,
            layer_length,
            length_m: None,
        };
        let declare =
            |kind: &&str| DeclaredEffect::at_start(effect::find(kind).expect("the effect is in the catalogue"));
        CoilModel {
            name: "test".into(),
            coil: Coil::new(spec).unwrap(),
            extent: Extent::Pack,
            material: PackMaterial::Conductivity { w_per_m_k: 0.35, heat_capacity_j_per_m3_k: 1.7e6 },
            location: Location::OuterLayer,
            rate_mean_s: 0.0,
            cells_per_layer: DEFAULT_CELLS_PER_LAYER,
            effects: effects.iter().map(declare).collect(),
        }
    }

    pub(crate) fn profiles() -> Vec<Profile> {
        let up = Piece { rate_k_per_s: 0.003, duration_s: 40.0 };
        let down = Piece { rate_k_per_s: -0.002, duration_s: 60.0 };
        vec![Profile::new("up", vec![up, down]).unwrap(), Profile::new("down", vec![down, up, down]).unwrap()]
    }

    #[test]
    fn worst_cases_of_several_patterns_are_those_of_each() {
        // One that is linear, one that remembers, one that has moments along the axis.
        for effects in [&["surface_film"][..], &["sensor_lag", "midpoint_offset"], &["surface_film", "axial_gradient"]]
        {
            let model = model(8, LayerLength::Actual, effects);
            let solved = SolvedProfiles::new(&model, &profiles()).unwrap();
            let patterns = [Classic::Zyl, Classic::Dip, Classic::Qua].map(|classic| classic.pattern(8).unwrap());
            let together = solved.worst_cases(&model, &patterns).unwrap();
            for (pattern, found) in patterns.iter().zip(&together) {
                assert_eq!(*found, solved.worst_case(&model, pattern).unwrap(), "{effects:?}");
            }
        }
    }

    #[test]
    fn every_sample_is_the_reference_value_with_any_effects_and_lengths() {
        let effect_sets: [&[&str]; 6] = [
            &[],
            &["strain_mismatch", "midpoint_offset"],
            &["axial_gradient"],
            &["heating_cooling_asymmetry", "stress_gradient", "turn_mismatch"],
            &["glass_transition", "bias_gradient_rate", "axial_gradient"],
            &["thermo_optic_temperature", "spool_mass"],
        ];
        for effects in effect_sets {
            for layer_length in [LayerLength::Equal, LayerLength::Actual] {
                let model = model(8, layer_length, effects);
                let solved = SolvedProfiles::new(&model, &profiles()).unwrap();
                let (matrix, origins) = SampleMatrix::of_profiles(&model, &solved).unwrap();
                for segments in [vec![3, 8, 1, 5, 2, 7, 6, 4], vec![4, 5, 6, 3, 2, 7, 8, 1]] {
                    let pattern = Pattern::new(segments).unwrap();
                    let rate_model = RateModel::new(&model, &pattern, &[]).unwrap();
                    let expected: Vec<f64> =
                        solved.profiles().iter().flat_map(|p| rate_model.series_rad_per_s(&p.history)).collect();
                    let found = matrix.rates_rad_per_s(&model, &pattern).unwrap();
                    let scale = expected.iter().map(|v| v.abs()).fold(0.0, f64::max);
                    assert_eq!((found.len(), origins.len()), (expected.len(), expected.len()));
                    for (f, e) in found.iter().zip(&expected) {
                        assert!((f - e).abs() < 1e-12 * scale, "{effects:?} {layer_length:?}: {f} {e}");
                    }
                }
            }
        }
    }
}
