//! What a diagnosis leaves to be told apart, and what the records at hand say about each candidate.

use super::super::{DiagnoseError, Diagnosed, Diagnosis, Request, Verdict};
use crate::chamber::{Assumption, Effort, Fit, Free, Hold, Quantity};
use crate::rate::CoilModel;
use crate::record::Record;

/// A candidate, fitted to the records at hand in their chamber.
#[derive(Debug, Clone)]
pub(crate) struct FittedAlternative {
    pub(crate) name: String,
    pub(super) fit: Fit,
    /// What the records say of its free numbers and of the film.
    pub(super) hold: Option<Hold>,
    /// −2 ln L of all records at hand.
    pub(super) deviance: f64,
}

/// The candidates, and what is the same for all of them.
#[derive(Debug, Clone)]
pub(crate) struct ModelComparison {
    pub(super) alternatives: Vec<FittedAlternative>,
    /// What they are candidates to be added to.
    pub(super) without: Option<FittedAlternative>,
    /// The chamber, sensor and gyro of the experiment: as the likeliest candidate found them.
    pub(super) air: Option<Fit>,
    pub(super) noise_rad_per_s: f64,
    /// What χ² is counted in: 1, or what the likeliest candidate leaves a rate in units of what it expects, if that is more.
    pub(super) variance: f64,
}

impl ModelComparison {
    /// Of a diagnosis: every candidate is fitted again to the records that it was drawn from.
    ///
    /// # Errors
    /// Models that cannot be solved.
    pub(crate) fn new(request: &Request, diagnosed: &Diagnosed) -> Result<Self, DiagnoseError> {
        let Diagnosed { diagnosis, chamber, declared } = diagnosed;
        let candidates = candidates(request.model, diagnosis);
        let mut comparison =
            Self { alternatives: Vec::new(), without: None, air: None, noise_rad_per_s: 0.0, variance: 1.0 };
        if candidates.is_empty() {
            return Ok(comparison);
        }
        let records: Vec<&Record> = request.records.iter().chain(request.holdout).collect();
        let fitted: Vec<usize> = (0..request.records.len()).collect();
        let held_out: Vec<usize> = (request.records.len()..records.len()).collect();
        let mut from = declared.clone();
        let mut alternative = |(name, model): (String, CoilModel)| -> Result<FittedAlternative, DiagnoseError> {
            let free = free_numbers(request.model, &model);
            let assumed = Assumption::new(model, request.pattern.clone());
            let fit = chamber.fit(&assumed, &free, &fitted, Some(&from), Effort::QUICK)?;
            from = fit.clone();
            let mut deviance = -2.0 * fit.log_likelihood;
            for &record in &held_out {
                deviance -= 2.0 * chamber.held_out(&fit, record)?.log_likelihood;
            }
            Ok(FittedAlternative { name, hold: fit.hold(), fit, deviance })
        };
        // The likeliest first: its chamber is where the others begin.
        let mut alternatives = Vec::with_capacity(candidates.len());
        for candidate in candidates.into_iter().rev() {
            alternatives.push(alternative(candidate)?);
        }
        alternatives.reverse();
        comparison.without = Some(alternative(without_candidates(request.model, diagnosis))?);
        let likeliest = alternatives.iter().min_by(|a, b| a.deviance.total_cmp(&b.deviance));
        // The finest record is what the next one will be like.
        let finest = fitted.into_iter().min_by(|&a, &b| records[a].interval_s().total_cmp(&records[b].interval_s()));
        if let (Some(likeliest), Some(finest)) = (likeliest, finest) {
            let whiteness = chamber.noise(&likeliest.fit, finest)?.whiteness;
            comparison.variance = whiteness.powi(2).max(1.0);
            comparison.noise_rad_per_s = likeliest.fit.number(Quantity::RateNoise, finest);
            comparison.air = Some(likeliest.fit.of_record(finest));
        }
        comparison.alternatives = alternatives;
        Ok(comparison)
    }

    /// Whether one candidate is a special case of another, so that no data could speak against the latter.
    pub(super) fn is_within(&self, special: usize, general: usize) -> bool {
        let effects = |alternative: usize| &self.alternatives[alternative].fit.assumed.model.effects;
        let (special, general) = (effects(special), effects(general));
        special.len() < general.len() && special.iter().zip(general).all(|(a, b)| a.kind() == b.kind())
    }
}

impl FittedAlternative {
    /// The experiments that would isolate what is fitted.
    pub(super) fn isolating(&self) -> Vec<&'static str> {
        let mut effects: Vec<usize> = self.fit.free.iter().map(|f| f.effect).collect();
        effects.dedup();
        effects.into_iter().map(|e| self.fit.assumed.model.effects[e].spec().experiment).collect()
    }

    pub(super) fn model(&self) -> &CoilModel {
        &self.fit.assumed.model
    }
}

/// What was added to the declared model and fitted. A parameter that has a default is held there unless it was fitted too.
fn free_numbers(declared: &CoilModel, model: &CoilModel) -> Vec<Free> {
    let added = model.effects.iter().enumerate().skip(declared.effects.len());
    added
        .flat_map(|(place, effect)| {
            let specs = effect.spec().parameters.iter().zip(effect.values()).enumerate();
            let fitted = specs.filter(|(_, (p, v))| p.default.is_none_or(|default| p.unit.to_si(default) != **v));
            let mut fitted: Vec<usize> = fitted.map(|(i, _)| i).collect();
            if fitted.is_empty() && !effect.values().is_empty() {
                fitted.push(0);
            }
            fitted.into_iter().map(move |parameter| Free::again(place, parameter, effect))
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
    use crate::thermal::{Extent, Location, PackMaterial};

    pub(crate) fn pattern() -> Pattern {
        Classic::Dip.pattern(8).unwrap()
    }

    /// By kind and values in SI, the first of all choices.
    pub(crate) fn effect(kind: &str, values: &[f64]) -> DeclaredEffect {
        let spec = effect::find(kind).unwrap();
        DeclaredEffect::new(spec, values.to_vec(), vec![0; spec.choices.len()]).unwrap()
    }

    pub(crate) fn model(effects: Vec<DeclaredEffect>) -> CoilModel {
        let fibre = Fibre {
            refractive_index: 1.45,
            thermo_optic_per_k: 1.0e-5,
            group_index: None,
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
            material: PackMaterial::Conductivity { w_per_m_k: 0.35, heat_capacity_j_per_m3_k: 1.7e6 },
            location: Location::OuterLayer,
            rate_mean_s: 10.0,
            cells_per_layer: 2,
            effects,
        }
    }

    /// The white noise of a rate [rad/s].
    pub(crate) const NOISE_RAD_PER_S: f64 = 1e-7;

    /// All of whose effects are fitted; no record holds them. The chamber is a usual one, its film 25 W/(m²K).
    pub(crate) fn alternative(name: &str, model: CoilModel) -> FittedAlternative {
        let free = free_numbers(&super::tests::model(Vec::new()), &model);
        let fit = Fit::to_nothing(Assumption::new(model, pattern()), free, NOISE_RAD_PER_S);
        FittedAlternative { name: name.to_owned(), fit, hold: None, deviance: 0.0 }
    }

    pub(crate) fn comparison(alternatives: Vec<FittedAlternative>) -> ModelComparison {
        let air = alternatives.first().map(|r| r.fit.clone());
        ModelComparison { alternatives, without: None, air, noise_rad_per_s: NOISE_RAD_PER_S, variance: 1.0 }
    }

    #[test]
    fn a_parameter_with_a_default_is_free_only_where_it_left_it() {
        let free = |values: &[f64]| alternative("", model(vec![effect("spool_mass", values)])).fit.free.len();
        assert_eq!(free(&[800.0, 200.0, 0.0]), 2);
        assert_eq!(free(&[800.0, 200.0, 3.0]), 3);
    }
}
