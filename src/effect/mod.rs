//! Effects: one piece of physics each, one file each.
//!
//! An effect describes what it changes — the heat path, the winding, the sensor, the fibre's response, or the rate
//! outside the coil — by overriding the methods of [`Effect`] that concern it. Prediction, search, fit, diagnosis,
//! reports and the list of effects all derive from that and from its [`EffectSpec`]. Adding an effect is one new
//! file and one line in [`CATALOGUE`].

mod axial_gradient;
mod bias_gradient_rate;
mod bias_temperature;
mod bias_temperature_rate;
mod channel;
mod conductivity_temperature;
pub mod custom;
mod declared;
mod diffusivity;
mod elsewhere;
mod finite_pack;
mod glass_transition;
mod heating_cooling_asymmetry;
mod housing;
mod layer_gain;
mod layer_gap;
mod midpoint_offset;
mod scale_factor_asymmetry;
mod scale_factor_error;
mod scale_factor_temperature;
mod self_heating;
mod sensor_lag;
mod spool_conduction;
mod spool_flange;
mod spool_mass;
mod strain_mismatch;
mod stress_gradient;
mod surface_film;
mod thermal_stress;
mod thermo_optic;
mod thermo_optic_temperature;
mod turn_mismatch;
mod turning;
mod unsteady_start;

pub(crate) use crate::numeric::expression::Memory;
pub use declared::{DeclaredEffect, DeclaredParameter, EffectError};
pub(crate) use elsewhere::set_elsewhere;

use crate::coil::Coil;
use crate::numeric::expression::{Degree, EvaluationError};
use crate::pattern::Half;
use crate::thermal::HeatPath;
use crate::units::Unit;

/// Every effect that a model file can name, in the order in which `coilwright effects` prints them.
pub const CATALOGUE: &[&EffectSpec] = &[
    &finite_pack::SPEC,
    &spool_mass::SPEC,
    &surface_film::SPEC,
    &sensor_lag::SPEC,
    &self_heating::SPEC,
    &axial_gradient::SPEC,
    &spool_flange::SPEC,
    &spool_conduction::SPEC,
    &housing::SPEC,
    &unsteady_start::SPEC,
    &conductivity_temperature::SPEC,
    &layer_gap::SPEC,
    &layer_gain::SPEC,
    &stress_gradient::SPEC,
    &strain_mismatch::SPEC,
    &glass_transition::SPEC,
    &thermo_optic_temperature::SPEC,
    &midpoint_offset::SPEC,
    &turn_mismatch::SPEC,
    &heating_cooling_asymmetry::SPEC,
    &bias_temperature::SPEC,
    &bias_temperature_rate::SPEC,
    &bias_gradient_rate::SPEC,
    &scale_factor_error::SPEC,
    &scale_factor_temperature::SPEC,
    &scale_factor_asymmetry::SPEC,
    &diffusivity::SPEC,
    &thermo_optic::SPEC,
];

/// Effects that a diagnosis does not look for by itself: what a housing, a spool's flanges or an unsteady start do to one record
/// others do too (a film and a lag; a heated flange; the start that every fit leaves free). Declared or asked for by name, they
/// are fitted as any other.
pub(crate) const NOT_SOUGHT: &[&EffectSpec] =
    &[&spool_flange::SPEC, &spool_conduction::SPEC, &housing::SPEC, &unsteady_start::SPEC];

/// An effect of any further column of a record; one declaration a column, `channel:NAME`.
pub const CHANNEL: &EffectSpec = &channel::SPEC;

/// An effect that the user writes.
pub const CUSTOM: &EffectSpec = &custom::SPEC;

/// What the materials of a model file do.
pub const THERMAL_STRESS: &EffectSpec = &thermal_stress::SPEC;

/// One parameter of one effect: what a spread of built coils varies.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Address {
    pub(crate) spec: &'static EffectSpec,
    /// Index among the spec's parameters.
    pub(crate) parameter: usize,
    /// The value at which the effect changes nothing, SI.
    pub(crate) neutral: f64,
}

/// The effect that gives a half space the end of a pack.
pub(crate) const END_OF_PACK: &EffectSpec = &finite_pack::SPEC;

/// δ of the surplus fibre at one end.
pub(crate) const OFFSET_OF_MIDDLE: Address = Address { spec: &midpoint_offset::SPEC, parameter: 0, neutral: 0.0 };
/// The factor on the pack's diffusivity.
pub(crate) const DIFFUSIVITY_FACTOR: Address = Address { spec: &diffusivity::SPEC, parameter: 0, neutral: 1.0 };
/// The film coefficient at the pack's outer surface.
pub(crate) const FILM: Address = Address { spec: &surface_film::SPEC, parameter: 0, neutral: 0.0 };
/// The film at a heated flange; one effect a flange.
pub(crate) const FLANGE_FILM: Address = Address { spec: &axial_gradient::SPEC, parameter: 0, neutral: 0.0 };
/// The heat capacity of the spool at the bore; without one nothing is held there.
pub(crate) const SPOOL: Address = Address { spec: &spool_mass::SPEC, parameter: 0, neutral: 0.0 };
/// The relative difference of the fibre's halves.
pub(crate) const MISMATCH_OF_HALVES: Address = Address { spec: &strain_mismatch::SPEC, parameter: 0, neutral: 0.0 };

/// The factor on dn/dT.
pub(crate) const THERMO_OPTIC_FACTOR: Address = Address { spec: &thermo_optic::SPEC, parameter: 0, neutral: 1.0 };

/// What an effect does to a model. Every method's default is "nothing".
pub trait Effect: std::fmt::Debug + Send + Sync {
    /// Edits what the heat flows through.
    fn change_heat_path(&self, _path: &mut HeatPath) {}

    /// Edits the turn counts, innermost layer first.
    fn change_turns(&self, _turns: &mut [f64]) {}

    /// Time constant with which the sensor follows what it is attached to \[s\].
    fn sensor_lag_s(&self) -> f64 {
        0.0
    }

    /// Fibre beyond the pack at one end.
    fn surplus_fibre(&self) -> Option<SurplusFibre> {
        None
    }

    /// Factor on κ at a place of the fibre; the factors of several effects multiply.
    fn path_factor(&self, _place: &FibrePlace) -> f64 {
        1.0
    }

    /// Whether [`Effect::path_factor`] depends on the place's temperature.
    fn path_depends_on_temperature(&self) -> bool {
        false
    }

    /// The rates of temperature that the layers' optical paths follow as if each layer followed its own alone; none where
    /// they do.
    fn followed_rates(&self, _temperatures_k: &[f64], _rates_k_per_s: &[f64]) -> Option<Vec<f64>> {
        None
    }

    /// Factor on the coil's rate error; those of several effects multiply.
    fn coil_gain(&self, _state: &PackState) -> f64 {
        1.0
    }

    /// Whether Ω stays linear in the rates of temperature, with no part that is independent of them.
    fn is_linear(&self) -> bool {
        true
    }

    /// Rate that does not come from the coil [rad/s]; those of several effects add. What remembers is at rest.
    fn outside_rate_rad_per_s(&self, _state: &PackState) -> f64 {
        0.0
    }

    /// The same after the states that the memory has seen, in the order of time.
    fn outside_rate_after(&self, state: &PackState, _memory: &mut Memory) -> f64 {
        self.outside_rate_rad_per_s(state)
    }

    /// Whether there is such a rate, and it is the same with every winding.
    fn is_beside_coil(&self) -> bool {
        false
    }

    /// Whether the rate depends on states that came before.
    fn remembers(&self) -> bool {
        false
    }

    /// How [`Effect::outside_rate_rad_per_s`] depends on the coil's own rate.
    fn degree_in_thermal_rate(&self) -> Degree {
        Degree::Not
    }

    /// Why there is no rate at a state, the memory being as it was before.
    fn fault(&self, _state: &PackState, _memory: &Memory) -> Option<EvaluationError> {
        None
    }
}

/// A place of the fibre, as far as its optical response may depend on it.
#[derive(Debug, Clone, Copy)]
pub struct FibrePlace {
    /// Index 0 is the innermost.
    pub layer: usize,
    /// Which half of the fibre.
    pub half: Half,
    /// Of the layer there.
    pub temperature_k: f64,
}

/// The pack at one instant, or on average over one logging interval.
///
/// # Shapes
/// One entry a layer, innermost first; `axial_moments_k_per_s` is empty where nothing varies along the axis;
/// `channels` in the order of [`Binding::channels`].
#[derive(Debug, Clone, Copy)]
pub struct PackState<'a> {
    /// From the drive's zero.
    pub time_s: f64,
    /// Of each layer.
    pub temperatures_k: &'a [f64],
    /// dT/dt of each layer.
    pub rates_k_per_s: &'a [f64],
    /// ∫ Ṫ ζ dζ of each layer, as in [`crate::thermal::ThermalHistory`].
    pub axial_moments_k_per_s: &'a [f64],
    /// Over the fibre's length.
    pub mean_temperature_k: f64,
    /// dT/dt over the fibre's length.
    pub mean_rate_k_per_s: f64,
    /// Of the air outside the film.
    pub ambient_k: f64,
    /// Its rate of change.
    pub ambient_rate_k_per_s: f64,
    /// A record's further columns.
    pub channels: &'a [f64],
    /// The coil's own rate error, lead included, for effects that read it; [`crate::rate::RateModel`] sets it.
    pub thermal_rate_rad_per_s: f64,
}

impl PackState<'_> {
    /// d(T_out − T_in)/dt: outermost less innermost layer.
    pub(crate) fn gradient_rate_k_per_s(&self) -> f64 {
        self.rates_k_per_s[self.rates_k_per_s.len() - 1] - self.rates_k_per_s[0]
    }
}

/// What the surplus fibre's temperature follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Lead {
    Ambient,
    Isothermal,
}

/// Surplus fibre 2δ at one end, outside the pack.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurplusFibre {
    /// δ > 0: at end A.
    pub(crate) offset_m: f64,
    pub(crate) lead: Lead,
}

/// What an effect is about, where its kind alone does not say.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) enum Subject {
    #[default]
    None,
    /// A further column of a record.
    Channel(String),
    /// A formula of the user's own.
    Formula(custom::Formula),
    /// What the coil is made of.
    Materials(std::sync::Arc<crate::stress::Materials>),
}

/// What an effect is bound to before it acts.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Binding<'a> {
    pub(crate) coil: &'a Coil,
    pub(crate) subject: &'a Subject,
    /// Names of a record's further columns, in the order of [`PackState::channels`].
    pub(crate) channels: &'a [String],
}

/// Which part of the model an effect changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Acts {
    /// The temperature field changes.
    HeatPath,
    /// The coil's geometry changes.
    Winding,
    /// What the sensor shows changes, not the coil.
    Sensor,
    /// The fibre's response to the field changes.
    Response,
    /// A rate is added that does not come from the coil.
    Outside,
    /// A rate is added where a table turns the gyro.
    ScaleFactor,
}

/// What kind of knowledge an effect is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Nature {
    /// A mechanism with an equation of its own.
    Physical,
    /// Says what a rate follows, not why.
    Empirical,
    /// No physics of its own: a factor on a number that the model file states.
    DeclaredNumber,
    /// What the user wrote.
    Formula,
}

/// A numeric parameter, as a user states it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParameterSpec {
    /// The key in the model file; ends in the unit.
    pub key: &'static str,
    /// In which the model file states it.
    pub unit: Unit,
    /// In words, for people.
    pub meaning: &'static str,
    /// Bounds, start of a fit and default, all in `unit`.
    pub lower: f64,
    /// The upper bound.
    pub upper: f64,
    /// Where a fit begins.
    pub start: f64,
    /// Where a model file need not state it.
    pub(crate) default: Option<f64>,
}

/// A parameter that is one of a few words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChoiceSpec {
    /// The key in the model file.
    pub key: &'static str,
    /// What may stand there.
    pub options: &'static [&'static str],
    /// In words, for people.
    pub meaning: &'static str,
}

/// Makes an effect from its values in SI (in the order of the spec's parameters), its choices and what it is bound to.
pub(crate) type Build = fn(&[f64], &[usize], &Binding) -> Box<dyn Effect>;

/// All that is to be said about an effect.
#[derive(Debug, Clone, Copy)]
pub struct EffectSpec {
    /// The name used in model files.
    pub kind: &'static str,
    /// One line: what it adds.
    pub summary: &'static str,
    /// What it adds, as a formula.
    pub equation: &'static str,
    pub(crate) acts: Acts,
    /// Mechanism, regularity, factor on a declared number, or the user's formula.
    pub nature: Nature,
    /// What it takes; in the model file's order.
    pub parameters: &'static [ParameterSpec],
    /// What is chosen from words.
    pub choices: &'static [ChoiceSpec],
    /// Publication and equation.
    pub source: &'static str,
    /// What it looks like in a record.
    pub signature: &'static str,
    /// One plain sentence: what happens in the coil or beside it.
    pub(crate) happens: &'static str,
    /// One plain sentence: what to do about it.
    pub(crate) remedy: &'static str,
    /// Which experiment would isolate it.
    pub experiment: &'static str,
    pub(crate) build: Build,
}

/// The spec of an effect by its name in files.
pub fn find(kind: &str) -> Option<&'static EffectSpec> {
    CATALOGUE.iter().copied().find(|spec| spec.kind == kind)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_of_the_catalogue_is_described_and_starts_within_its_bounds() {
        for spec in CATALOGUE {
            for text in [spec.summary, spec.equation, spec.source, spec.signature, spec.experiment] {
                assert!(!text.is_empty(), "{}", spec.kind);
            }
            for sentence in [spec.happens, spec.remedy] {
                assert!(sentence.starts_with(char::is_uppercase) && sentence.ends_with('.'), "{}", spec.kind);
            }
            for p in spec.parameters {
                assert!(p.lower <= p.start && p.start <= p.upper, "{} {}", spec.kind, p.key);
            }
            assert!(
                DeclaredEffect::new(
                    spec,
                    DeclaredEffect::at_start(spec).values().to_vec(),
                    vec![0; spec.choices.len()]
                )
                .is_ok()
            );
        }
        let mut kinds: Vec<_> = CATALOGUE.iter().map(|s| s.kind).collect();
        kinds.sort_unstable();
        kinds.dedup();
        assert_eq!(kinds.len(), CATALOGUE.len());
    }
}
