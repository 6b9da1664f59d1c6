//! What a fit moves: numbers of the chamber, parameters of effects, amplitudes of inputs; and where they are likely to be.

use nalgebra::{DMatrix, DVector};

use super::Assumption;
use super::layout::Numbers;
use super::prior::Quantity;
use crate::effect::{DeclaredEffect, ParameterSpec};
use crate::units::Unit;

/// Which number a parameter is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Place {
    /// Of one record, or (None) of all.
    Quantity {
        quantity: Quantity,
        record: Option<usize>,
    },
    /// Indices of an effect of the model and of its parameter.
    Effect {
        effect: usize,
        parameter: usize,
    },
    Input {
        input: usize,
    },
}

impl Place {
    /// The effect or the input that it is of, by a name that is the same in every assumption; None: a quantity.
    pub(super) fn owner(self, assumed: &Assumption) -> Option<String> {
        match self {
            Self::Quantity { .. } => None,
            Self::Effect { effect, .. } => {
                let effect = &assumed.model.effects[effect];
                Some(format!("{} {:?} {:?}", effect.kind(), effect.choices(), effect.layer()))
            }
            Self::Input { input } => Some(assumed.inputs[input].name.clone()),
        }
    }

    /// Whether both say the same of their owners.
    pub(super) fn is_same_of_owner(self, other: Self) -> bool {
        match (self, other) {
            (Self::Effect { parameter, .. }, Self::Effect { parameter: of_other, .. }) => parameter == of_other,
            (Self::Input { .. }, Self::Input { .. }) => true,
            _ => self == other,
        }
    }
}

/// Which effect's parameters a fit moves, and how firmly what the model states holds them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Free {
    pub(crate) effect: usize,
    pub(crate) parameter: usize,
    /// What the model states of it; None: the prior is that of the effect's description.
    pub(crate) stated: Option<StatedNumber>,
    /// Of a number whose unit is a logged column's, so that no description knows how large it may be: the prior's standard deviation
    /// about zero; SI.
    pub(crate) deviation: Option<f64>,
}

/// A number that a model states.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StatedNumber {
    /// SI; not what a fit has made of it since.
    pub(crate) value: f64,
    /// The share that it is wrong by: one standard deviation.
    pub(crate) within: f64,
}

impl Free {
    /// A parameter of an effect that has been fitted before.
    pub(crate) fn again(effect: usize, parameter: usize, fitted: &DeclaredEffect) -> Self {
        let is_per_unit = fitted.spec().parameters.get(parameter).is_some_and(|p| p.unit == Unit::DegPerHourPerUnit);
        let deviation = STARTS * fitted.values()[parameter].abs();
        Self { effect, parameter, stated: None, deviation: (is_per_unit && deviation > 0.0).then_some(deviation) }
    }
}

/// How a number becomes the coordinate in which its prior is normal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scale {
    Logarithm,
    Linear,
}

/// How a prior falls off.
///
/// ```text
/// Normal:  −ln p(z) = ½ z² + ½ ln 2π            Cauchy:  −ln p(z) = ln(1 + ½ z²) + ½ ln 2π²        z = (x − mean)/deviation
/// ```
///
/// Both are as curved about the mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Tails {
    Normal,
    /// Of a size of which not even the order is known: five deviations away is nine times less likely than one.
    Cauchy,
}

/// One coordinate of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Parameter {
    pub(crate) place: Place,
    pub(crate) scale: Scale,
    pub(crate) tails: Tails,
    /// Of the prior, in the coordinate.
    pub(crate) mean: f64,
    pub(crate) deviation: f64,
    /// Bounds, in the coordinate.
    pub(crate) lower: f64,
    pub(crate) upper: f64,
}

/// Prior of an effect's parameter by its description.
///
/// | parameter | prior | reason |
/// |---|---|---|
/// | a factor (1 in the middle of its bounds' ratio) | log-normal about 1, 0.3 | it corrects a declared number |
/// | positive, with a start | log-normal about its start, 1.0 | only its order is known |
/// | a temperature in °C | normal about its start, 30 K | the range of a chamber |
/// | per unit of a logged column | normal about 0, what would make all that the rate does | the unit is whatever was logged |
/// | positive or zero | half of a normal of a hundredth of its bound | zero unless something is there |
/// | anything else | about 0, four starts, with the tails of Cauchy's density | its start is what matters in practice; how far it may go is not known |
const FACTOR_DEVIATION: f64 = 0.3;
const ORDER_DEVIATION: f64 = 1.0;
const TEMPERATURE_DEVIATION_K: f64 = 30.0;
const STARTS: f64 = 4.0;
const SHARE_OF_BOUND: f64 = 0.01;

/// Whether a parameter's description is that of a factor on a declared number.
pub(crate) fn is_factor(spec: &ParameterSpec) -> bool {
    spec.unit == Unit::One && spec.lower > 0.0 && (spec.lower * spec.upper - 1.0).abs() < 1e-9
}

impl Parameter {
    pub(super) fn of_quantity(quantity: Quantity, record: Option<usize>, medians: &Numbers) -> Self {
        let prior = quantity.prior();
        let mean = medians.get(quantity).ln();
        // Of a multiple of the noise the bounds are such multiples, too.
        let unit = if prior.relative { mean - prior.median.ln() } else { 0.0 };
        let place = Place::Quantity { quantity, record };
        Self {
            place,
            scale: Scale::Logarithm,
            tails: Tails::Normal,
            mean,
            deviation: prior.deviation,
            lower: (mean - 12.0).max(unit + prior.least.ln()),
            upper: (mean + 12.0).min(unit + prior.most.ln()),
        }
    }

    pub(super) fn of_input(input: usize, deviation: f64) -> Self {
        let (lower, upper) = (f64::NEG_INFINITY, f64::INFINITY);
        let place = Place::Input { input };
        Self { place, scale: Scale::Linear, tails: Tails::Normal, mean: 0.0, deviation, lower, upper }
    }

    pub(super) fn of_effect(effect: &DeclaredEffect, free: &Free) -> Self {
        let place = Place::Effect { effect: free.effect, parameter: free.parameter };
        let declared = &effect.parameters()[free.parameter];
        let value = effect.values()[free.parameter];
        let linear = |mean: f64, deviation: f64| {
            let (lower, upper) = (declared.lower, declared.upper);
            Self { place, scale: Scale::Linear, tails: Tails::Normal, mean, deviation, lower, upper }
        };
        let size = |deviation: f64| Self { tails: Tails::Cauchy, ..linear(0.0, deviation) };
        let logarithm = |mean: f64, deviation: f64| {
            let (lower, upper) = (declared.lower.ln(), declared.upper.ln());
            Self { place, scale: Scale::Logarithm, tails: Tails::Normal, mean, deviation, lower, upper }
        };
        if let Some(StatedNumber { value, within }) = free.stated {
            return if declared.lower > 0.0 {
                logarithm(value.ln(), within)
            } else {
                linear(value, (within * value.abs()).max(1e-3 * STARTS * value.abs().max(f64::MIN_POSITIVE)))
            };
        }
        if let Some(deviation) = free.deviation {
            return linear(0.0, deviation);
        }
        let Some(spec) = effect.spec().parameters.get(free.parameter) else {
            // A formula's own: nothing is known of it but the value it was given, and of a size that it is one.
            return if declared.lower > 0.0 {
                logarithm(value.ln(), ORDER_DEVIATION)
            } else {
                size(STARTS * value.abs().max(1e-6))
            };
        };
        let start = spec.unit.to_si(spec.start);
        if is_factor(spec) {
            logarithm(0.0, FACTOR_DEVIATION)
        } else if spec.unit == Unit::Celsius {
            linear(start, TEMPERATURE_DEVIATION_K)
        } else if spec.lower >= 0.0 && start > 0.0 {
            logarithm(start.ln(), ORDER_DEVIATION)
        } else if spec.lower == 0.0 {
            linear(0.0, SHARE_OF_BOUND * declared.upper)
        } else {
            size(STARTS * start.abs())
        }
    }

    pub(crate) fn value(&self, coordinate: f64) -> f64 {
        match self.scale {
            Scale::Logarithm => coordinate.exp(),
            Scale::Linear => coordinate,
        }
    }

    pub(crate) fn coordinate(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Logarithm => value.ln(),
            Scale::Linear => value,
        }
    }

    /// By how much the prior is lower there than at its mean, in its natural logarithm.
    pub(crate) fn cost(&self, coordinate: f64) -> f64 {
        let half = 0.5 * self.distance(coordinate).powi(2);
        match self.tails {
            Tails::Normal => half,
            Tails::Cauchy => half.ln_1p(),
        }
    }

    /// Natural logarithm of the prior's density.
    pub(super) fn log_prior(&self, coordinate: f64) -> f64 {
        let whole = match self.tails {
            Tails::Normal => std::f64::consts::TAU.sqrt(),
            Tails::Cauchy => std::f64::consts::SQRT_2 * std::f64::consts::PI,
        };
        -self.cost(coordinate) - (self.deviation * whole).ln()
    }

    /// Derivative of the prior's logarithm, and the precision of the normal that touches it there and is nowhere higher.
    pub(super) fn prior_slope(&self, coordinate: f64) -> (f64, f64) {
        let z = self.distance(coordinate);
        let falls = match self.tails {
            Tails::Normal => 1.0,
            Tails::Cauchy => 1.0 / (1.0 + 0.5 * z * z),
        };
        (-z * falls / self.deviation, falls * self.deviation.powi(-2))
    }

    /// From the prior's mean, in its deviations.
    pub(crate) fn distance(&self, coordinate: f64) -> f64 {
        (coordinate - self.mean) / self.deviation
    }

    /// Step of a difference, in the coordinate.
    pub(super) fn step(&self) -> f64 {
        match self.scale {
            Scale::Logarithm => 0.01,
            Scale::Linear => 0.01 * self.deviation,
        }
    }

    /// Longest step of a fit, in the coordinate.
    pub(super) fn stride(&self) -> f64 {
        match self.scale {
            Scale::Logarithm => 1.0,
            Scale::Linear => 3.0 * self.deviation,
        }
    }

    pub(super) fn is_of_chamber(&self) -> bool {
        matches!(self.place, Place::Quantity { .. })
    }

    pub(super) fn is_quantity(&self, asked: Quantity) -> bool {
        matches!(self.place, Place::Quantity { quantity, .. } if quantity == asked)
    }

    /// Whether a record's likelihood depends on it.
    pub(super) fn concerns(&self, record: usize) -> bool {
        !matches!(self.place, Place::Quantity { record: Some(own), .. } if own != record)
    }

    /// Whether the coil's side of the model stays as it is.
    pub(super) fn leaves_coil(&self) -> bool {
        matches!(self.place, Place::Quantity { quantity, .. } if quantity != Quantity::Film)
    }

    /// Reads it from what is assumed; what records share is as the `first` that is fitted has it.
    pub(super) fn read(&self, assumed: &Assumption, numbers: &[Numbers], first: usize) -> f64 {
        let value = match self.place {
            Place::Quantity { quantity, record } => numbers[record.unwrap_or(first)].get(quantity),
            Place::Effect { effect, parameter } => assumed.model.effects[effect].values()[parameter],
            Place::Input { input } => assumed.inputs[input].amplitude,
        };
        self.coordinate(value)
    }
}

/// Adds what priors say of coordinates to the slope and the information of a log likelihood.
///
/// # Shapes
/// One coordinate, slope and row a parameter.
pub(super) fn add_priors(
    parameters: &[Parameter],
    coordinates: &[f64],
    slope: &mut DVector<f64>,
    information: &mut DMatrix<f64>,
) {
    for (i, (parameter, &coordinate)) in parameters.iter().zip(coordinates).enumerate() {
        let (prior_slope, precision) = parameter.prior_slope(coordinate);
        slope[i] += prior_slope;
        information[(i, i)] += precision;
    }
}

/// Writes coordinates into what is assumed and its numbers; false if an effect refuses its value.
pub(super) fn write(
    parameters: &[Parameter],
    coordinates: &[f64],
    assumed: &mut Assumption,
    numbers: &mut [Numbers],
) -> bool {
    for (parameter, &coordinate) in parameters.iter().zip(coordinates) {
        let value = parameter.value(coordinate);
        match parameter.place {
            Place::Quantity { quantity, record } => match record {
                Some(record) => numbers[record].set(quantity, value),
                None => numbers.iter_mut().for_each(|n| n.set(quantity, value)),
            },
            Place::Effect { effect, parameter } => {
                let mut values = assumed.model.effects[effect].values().to_vec();
                values[parameter] = value;
                match assumed.model.effects[effect].with_values(values) {
                    Ok(moved) => assumed.model.effects[effect] = moved,
                    Err(_) => return false,
                }
            }
            Place::Input { input } => assumed.inputs[input].amplitude = value,
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::super::dense::tests::model;
    use super::super::{Chamber, Effort, Fit};
    use super::*;
    use crate::effect::find;
    use crate::pattern::classic::Classic;
    use crate::rate::CoilModel;
    use crate::record::Record;

    /// Forty rows of 10 s that warm by 0.6 K a minute, with a rate that is noise.
    fn warming() -> Record {
        let times_s: Vec<f64> = (1..=40).map(|i| 10.0 * f64::from(i)).collect();
        let temperature_k = (0..40).map(|i| 293.0 + 0.1 * f64::from(i)).collect();
        let rates = (0..40).map(|i| 1e-7 * f64::from(i * i).sin()).collect();
        Record::new("warming", times_s, temperature_k, rates).unwrap()
    }

    #[test]
    fn what_a_model_states_is_the_prior_whatever_a_fit_has_made_of_it() {
        let fitted = DeclaredEffect::new(find("surface_film").unwrap(), vec![17.4], vec![]).unwrap();
        let stated = Some(StatedNumber { value: 12.4, within: 0.25 });
        let parameter = Parameter::of_effect(&fitted, &Free { effect: 0, parameter: 0, stated, deviation: None });
        assert_eq!((parameter.mean, parameter.deviation), (12.4f64.ln(), 0.25));
    }

    #[test]
    fn priors_are_densities_whose_slopes_are_theirs_and_both_are_as_curved_at_their_means() {
        let effect = |kind: &str, value: f64| {
            let effect = DeclaredEffect::new(find(kind).unwrap(), vec![value], vec![]).unwrap();
            Parameter::of_effect(&effect, &Free { effect: 0, parameter: 0, stated: None, deviation: None })
        };
        let (size, factor) = (effect("strain_mismatch", 0.002), effect("diffusivity", 1.1));
        assert_eq!((size.tails, factor.tails), (Tails::Cauchy, Tails::Normal));
        for parameter in [size, factor] {
            let at = |z: f64| parameter.mean + z * parameter.deviation;
            // z = tan u, so that the tails are within reach.
            let steps = 20_000;
            let width = std::f64::consts::PI / f64::from(steps);
            let cell = |i: i32| {
                let u = -0.5 * std::f64::consts::PI + (f64::from(i) + 0.5) * width;
                parameter.log_prior(at(u.tan())).exp() * parameter.deviation / u.cos().powi(2) * width
            };
            let whole: f64 = (0..steps).map(cell).sum();
            assert!((whole - 1.0).abs() < 1e-3, "{whole}");
            for z in [-6.0, -1.0, 0.0, 0.3, 4.0] {
                let by = 1e-4 * parameter.deviation;
                let rise = parameter.log_prior(at(z) + by) - parameter.log_prior(at(z) - by);
                let (slope, precision) = parameter.prior_slope(at(z));
                assert!((rise / (2.0 * by) - slope).abs() < 1e-5 / parameter.deviation, "{z}");
                assert!(precision > 0.0 && precision <= parameter.deviation.powi(-2) * (1.0 + 1e-12));
            }
            assert!((parameter.cost(at(0.1)) - 0.005).abs() < 2e-5);
        }
        assert!((size.cost(size.mean + 5.0 * size.deviation).exp() / 1.5 - 9.0).abs() < 1e-9);
    }

    #[test]
    fn a_fit_to_one_record_begins_with_that_records_film() {
        let record = warming();
        let model = model(Vec::new());
        let chamber = Chamber::new(&model, &[&record, &record]).unwrap();
        let assumed = Assumption::new(model.clone(), Classic::Qua.pattern(8).unwrap());
        let mut day = chamber.fit(&assumed, &[], &[1], None, Effort::NONE).unwrap();
        day.numbers[1].set(Quantity::Film, 71.0);
        assert!(day.number(Quantity::Film, 0) < 50.0);
        let again = chamber.fit(&assumed, &[], &[1], Some(&day), Effort::NONE).unwrap();
        assert!((again.number(Quantity::Film, 1) / 71.0 - 1.0).abs() < 1e-12);
    }

    #[test]
    fn derivatives_of_an_effect_serve_no_other_that_has_its_place_since() {
        let record = warming();
        let model = model(Vec::new());
        let chamber = Chamber::new(&model, &[&record]).unwrap();
        let with = |effects: &[DeclaredEffect]| {
            let model = CoilModel { effects: effects.to_vec(), ..model.clone() };
            let free = (0..effects.len()).map(|effect| Free { effect, parameter: 0, stated: None, deviation: None });
            (Assumption::new(model, Classic::Qua.pattern(8).unwrap()), free.collect::<Vec<_>>())
        };
        let declared =
            |kind: &str, values: &[f64]| DeclaredEffect::new(find(kind).unwrap(), values.to_vec(), vec![]).unwrap();
        let [first, second] = [declared("strain_mismatch", &[0.001]), declared("bias_temperature", &[1e-9, 0.0])];
        let (both, free) = with(&[first, second.clone()]);
        let both = chamber.fit(&both, &free, &[0], None, Effort::NONE).unwrap();
        let (alone, free) = with(&[second]);
        let errors = |from: Option<&Fit>| {
            let fit = chamber.fit(&alone, &free, &[0], from, Effort::NONE).unwrap();
            let of_effect = fit.parameters.iter().position(|p| matches!(p.place, Place::Effect { .. }));
            fit.standard_errors[of_effect.unwrap()]
        };
        let (carried, fresh) = (errors(Some(&both)), errors(None));
        assert!((carried / fresh - 1.0).abs() < 0.05, "{carried} {fresh}");
    }

    #[test]
    fn a_drift_is_half_the_noise_or_more_and_a_time_of_it_is_no_multiple_of_the_noise() {
        let record = warming();
        let model = model(Vec::new());
        let chamber = Chamber::new(&model, &[&record]).unwrap();
        let medians = Numbers::medians(&chamber.observed[0].series);
        let least = |quantity| Parameter::of_quantity(quantity, Some(0), &medians).lower.exp();
        let noise = chamber.noise_floor_rad_per_s(0);
        assert!((least(Quantity::DriftSize) / (0.5 * noise) - 1.0).abs() < 1e-12);
        assert!((least(Quantity::DriftTime) / 100.0 - 1.0).abs() < 1e-12);
    }
}
