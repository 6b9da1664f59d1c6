//! What a diagnosis leaves to be told apart, and what the records at hand say about each candidate.

use nalgebra::DMatrix;

use super::super::anchor::way_of;
use super::super::evidence::{Case, Evidence, Role, sum_of_squares};
use super::super::{Diagnosis, Verdict};
use crate::boundary::Air;
use crate::effect::Acts;
use crate::rate::CoilModel;

/// A candidate, with what is free in it and how firmly the records hold that.
#[derive(Debug, Clone)]
pub struct Rival {
    pub name: String,
    pub model: CoilModel,
    pub(super) free: Vec<Free>,
    /// R with |R (p − p̂)|² = rise of the records' χ².
    pub(super) hold: DMatrix<f64>,
    /// Of all records at hand.
    pub(super) chi_square: f64,
    /// Film and noises as they were estimated under it.
    pub(super) air: Air,
}

/// A parameter that is fitted: which of which effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Free {
    effect: usize,
    parameter: usize,
}

/// The candidates, and what is the same for all of them.
#[derive(Debug, Clone)]
pub struct Contest {
    pub(super) rivals: Vec<Rival>,
    /// What they are candidates to be added to.
    pub(super) without: Option<Rival>,
    pub(super) noise_rad_per_s: f64,
    /// What χ² is counted in: 1, or what the best candidate leaves a row, whichever is more.
    pub(super) variance: f64,
}

/// Share of a parameter's size, and of its range, over which derivatives are taken.
const STEP_SHARE: f64 = 1e-3;
const STEP_SHARE_OF_RANGE: f64 = 1e-6;

impl Contest {
    /// Of a diagnosis whose evidence is still there.
    pub(in super::super) fn new(evidence: &Evidence, declared: &CoilModel, diagnosis: &Diagnosis) -> Self {
        // The finest record is what the next one will be like.
        let finest = evidence.of(Role::Fit).min_by(|a, b| a.record.interval_s().total_cmp(&b.record.interval_s()));
        let rival = |(name, model): (String, CoilModel)| Rival::new(evidence, finest?, declared, name, model);
        let rivals: Vec<Rival> = candidates(declared, diagnosis).into_iter().filter_map(rival).collect();
        let without = (!rivals.is_empty()).then(|| without_candidates(declared, diagnosis)).and_then(rival);
        let rows = (evidence.rows(Role::Fit) + evidence.rows(Role::Holdout)).max(1);
        let least = rivals.iter().map(|r| r.chi_square).fold(f64::INFINITY, f64::min);
        Self {
            variance: if least.is_finite() { (least / rows as f64).max(1.0) } else { 1.0 },
            noise_rad_per_s: finest.map_or(0.0, |case| case.noise_rad_per_s),
            rivals,
            without,
        }
    }

    /// Whether one candidate is a special case of another, so that no data could speak against the latter.
    pub(super) fn is_within(&self, special: usize, general: usize) -> bool {
        let general = &self.rivals[general].model.effects;
        let special = &self.rivals[special].model.effects;
        special.len() < general.len() && special.iter().zip(general).all(|(a, b)| a.kind() == b.kind())
    }
}

impl Rival {
    fn new(evidence: &Evidence, finest: &Case, declared: &CoilModel, name: String, model: CoilModel) -> Option<Self> {
        let location = model.heat_path().ok()?.location;
        let anchor = finest.anchor_for(location, &way_of(&model), model.sensor_lag_s())?;
        let air = finest.anchors[anchor].boundary.air().clone();
        let residuals = evidence.residuals(&model, Role::Fit)?;
        let unseen = evidence.residuals(&model, Role::Holdout)?;
        let chi_square = sum_of_squares(&residuals) + sum_of_squares(&unseen);
        let free = free_parameters(declared, &model);
        let mut rival = Self { name, model, free, hold: DMatrix::zeros(0, 0), chi_square, air };
        let columns = rival.derivatives(&residuals, |moved| evidence.residuals(moved, Role::Fit))?;
        if !columns.is_empty() {
            let flat: Vec<f64> = columns.into_iter().flatten().collect();
            rival.hold = DMatrix::from_vec(residuals.len(), rival.free.len(), flat).qr().r();
        }
        Some(rival)
    }

    /// The experiments that would isolate what is fitted.
    pub(super) fn isolating(&self) -> Vec<&'static str> {
        let mut effects: Vec<usize> = self.free.iter().map(|f| f.effect).collect();
        effects.dedup();
        effects.into_iter().map(|e| self.model.effects[e].spec().experiment).collect()
    }

    /// Whether a free parameter changes what boundary is made of readings.
    pub(super) fn moves_boundary(&self) -> bool {
        let acts = |f: &Free| self.model.effects[f.effect].spec().acts;
        self.free.iter().any(|f| matches!(acts(f), Acts::HeatPath | Acts::Sensor))
    }

    /// Values of the free parameters, SI.
    pub(super) fn values(&self) -> Vec<f64> {
        self.free.iter().map(|f| self.model.effects[f.effect].values()[f.parameter]).collect()
    }

    /// Bounds of the free parameters, SI.
    pub(super) fn bounds(&self) -> Vec<(f64, f64)> {
        let declared = |f: &Free| self.model.effects[f.effect].parameters()[f.parameter].clone();
        self.free.iter().map(declared).map(|p| (p.lower, p.upper)).collect()
    }

    /// The model with other values of the free parameters.
    pub(super) fn with(&self, values: &[f64]) -> Option<CoilModel> {
        let mut model = self.model.clone();
        for (free, &value) in self.free.iter().zip(values) {
            let mut all = model.effects[free.effect].values().to_vec();
            all[free.parameter] = value;
            model.effects[free.effect] = model.effects[free.effect].with_values(all).ok()?;
        }
        Some(model)
    }

    /// Of whatever a model gives, with respect to each free parameter; inwards where a bound is near.
    pub(super) fn derivatives(
        &self,
        at: &[f64],
        give: impl Fn(&CoilModel) -> Option<Vec<f64>>,
    ) -> Option<Vec<Vec<f64>>> {
        let values = self.values();
        let column = |(place, (lower, upper)): (usize, (f64, f64))| {
            let range = if (upper - lower).is_finite() { upper - lower } else { 0.0 };
            let size = (STEP_SHARE * values[place].abs()).max(STEP_SHARE_OF_RANGE * range).max(f64::EPSILON);
            let step = if values[place] + size <= upper { size } else { -size };
            let mut moved = values.clone();
            moved[place] += step;
            let moved = give(&self.with(&moved)?)?;
            Some(moved.iter().zip(at).map(|(m, a)| (m - a) / step).collect())
        };
        self.bounds().into_iter().enumerate().map(column).collect()
    }
}

/// What was added to the declared model and fitted. A parameter that has a default is held there unless it was fitted too.
fn free_parameters(declared: &CoilModel, model: &CoilModel) -> Vec<Free> {
    let added = model.effects.iter().enumerate().skip(declared.effects.len());
    added
        .flat_map(|(place, effect)| {
            let specs = effect.spec().parameters.iter().zip(effect.values()).enumerate();
            let fitted = specs.filter(|(_, (p, v))| p.default.is_none_or(|default| p.unit.to_si(default) != **v));
            let mut fitted: Vec<usize> = fitted.map(|(i, _)| i).collect();
            if fitted.is_empty() && !effect.values().is_empty() {
                fitted.push(0);
            }
            fitted.into_iter().map(move |parameter| Free { effect: place, parameter })
        })
        .collect()
}

/// An effect and its equivalents, or the model with and without what is missing.
fn candidates(declared: &CoilModel, diagnosis: &Diagnosis) -> Vec<(String, CoilModel)> {
    let all = || diagnosis.effects.iter().map(|e| e.effect.kind()).collect::<Vec<_>>().join(" + ");
    match diagnosis.verdict {
        Verdict::Indistinguishable => {
            let open = diagnosis.effects.iter().find(|e| !e.equivalents.is_empty());
            let own = open.map(|e| (e.effect.kind(), diagnosis.extended.clone()));
            let others = open.into_iter().flat_map(|e| &e.equivalents);
            own.into_iter().chain(others.map(|o| (o.effect.kind(), o.extended.clone()))).collect()
        }
        Verdict::Missing => {
            vec![("the declared model".to_owned(), declared.clone()), (all(), diagnosis.extended.clone())]
        }
        Verdict::Adequate | Verdict::Unexplained => Vec::new(),
    }
}

/// The declared model with whatever is not in question.
fn without_candidates(declared: &CoilModel, diagnosis: &Diagnosis) -> (String, CoilModel) {
    let open = diagnosis.effects.iter().position(|e| !e.equivalents.is_empty());
    let mut model = declared.clone();
    if diagnosis.verdict == Verdict::Indistinguishable {
        let others = diagnosis.effects.iter().enumerate().filter(|(place, _)| Some(*place) != open);
        model.effects.extend(others.map(|(_, e)| e.effect.clone()));
    }
    ("neither".to_owned(), model)
}

#[cfg(test)]
pub(in crate::diagnose) mod tests {
    use super::*;
    use crate::coil::{Coil, CoilSpec, Fibre, LayerLength};
    use crate::effect::{self, DeclaredEffect};
    use crate::pattern::Pattern;
    use crate::pattern::classic::Classic;
    use crate::thermal::{Extent, Location, Material};

    pub fn pattern() -> Pattern {
        Classic::Dip.pattern(8).unwrap()
    }

    /// By kind and values in SI, the first of all choices.
    pub fn effect(kind: &str, values: &[f64]) -> DeclaredEffect {
        let spec = effect::find(kind).unwrap();
        DeclaredEffect::new(spec, values.to_vec(), vec![0; spec.choices.len()]).unwrap()
    }

    pub fn model(effects: Vec<DeclaredEffect>) -> CoilModel {
        let fibre = Fibre {
            refractive_index: 1.45,
            thermo_optic_per_k: 1.0e-5,
            thermal_expansion_per_k: 0.0,
            wavelength_m: 1550e-9,
            outer_diameter_m: 330e-6,
        };
        let spec = CoilSpec {
            fibre,
            layers: 8,
            turns_per_layer: Some(50.0),
            bore_radius_m: 0.04,
            radial_pitch_m: 330e-6,
            axial_pitch_m: 340e-6,
            layer_length: LayerLength::Actual,
            length_m: None,
        };
        CoilModel {
            name: "test".into(),
            coil: Coil::new(spec).unwrap(),
            extent: Extent::Pack,
            material: Material::Conductivity { w_per_m_k: 0.35, heat_capacity_j_per_m3_k: 1.7e6 },
            location: Location::OuterLayer,
            rate_mean_s: 10.0,
            cells_per_layer: 2,
            effects,
        }
    }

    /// All of whose effects are fitted; no record holds them.
    pub fn rival(name: &str, model: CoilModel) -> Rival {
        let free = free_parameters(&super::tests::model(Vec::new()), &model);
        let hold = DMatrix::zeros(free.len(), free.len());
        let air = Air { film_w_per_m2_k: Some(25.0), jerk_noise_k2_per_s7: 1e-22, kinks: Vec::new(), noise_k: 0.004 };
        Rival { name: name.to_owned(), model, free, hold, chi_square: 0.0, air }
    }

    pub fn contest(rivals: Vec<Rival>) -> Contest {
        Contest { rivals, without: None, noise_rad_per_s: 1e-7, variance: 1.0 }
    }

    #[test]
    fn a_parameter_with_a_default_is_free_only_where_it_left_it() {
        let free = |values: &[f64]| rival("", model(vec![effect("spool_mass", values)])).free.len();
        assert_eq!(free(&[800.0, 200.0, 0.0]), 2);
        assert_eq!(free(&[800.0, 200.0, 3.0]), 3);
    }
}
