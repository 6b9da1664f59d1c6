//! A model with all its numbers, and what the filter makes of a record with it.

use std::sync::Arc;

use super::film::drive;
use super::filter::{self, Innovation, Trace, Values};
use super::known::{Asked, Reference, begins_between_rows, known, taken_off};
use super::layout::{Layout, Numbers, OutputGains, Parts};
use super::prior::Quantity;
use super::row::Film;
use super::series::Series;

use super::shows::Shows;
use super::solved::Solved;
use super::system::{decoupled_system, driven_by_air, system};
use super::{Assumption, ChamberError};
use crate::effect::PackState;
use crate::rate::{Past, RateModel};
use crate::record::Record;
use crate::thermal::reduced::Reduced;
use crate::thermal::{HeatPath, check};

/// The coil's side of a model: what does not depend on chamber and noise.
#[derive(Debug)]
pub(super) struct CoilSide {
    pub(super) path: HeatPath,
    film_w_per_m2_k: f64,
    modes: usize,
    pub(crate) reduced: Arc<Reduced>,
    pub(crate) gains: OutputGains,
    rate: RateModel,
    skin_s: Option<f64>,
    shows: Shows,
    lag_s: f64,
    beyond_linear: bool,
    solved: Solved,
}

/// A record as the chamber knows it.
#[derive(Debug, Clone)]
pub(super) struct Observed<'a> {
    pub(crate) record: &'a Record,
    pub(crate) series: Series,
    pub(crate) channels: Vec<String>,
    pub(crate) mean_k: f64,
    /// Its rates are not measurements.
    pub(crate) blind: bool,
    /// What its own air was found to be, by itself.
    pub(crate) day: Option<Numbers>,
    pub(crate) solved: Solved,
}

impl<'a> Observed<'a> {
    pub(super) fn new(record: &'a Record, series: Series, mean_k: f64, solved: Solved) -> Self {
        let channels = record.channels().iter().map(|c| c.name.clone()).collect();
        Self { record, series, channels, mean_k, blind: false, day: None, solved }
    }
}

impl CoilSide {
    /// # Errors
    /// A model that cannot be solved.
    pub(crate) fn new(
        assumed: &Assumption,
        film: f64,
        modes: usize,
        observed: &Observed,
    ) -> Result<Self, ChamberError> {
        let model = &assumed.model;
        let path = model.heat_path()?;
        let shows = Shows::of(path.location);
        let film_w_per_m2_k = if path.film_is_unknown() { film } else { path.film_w_per_m2_k.unwrap_or(f64::INFINITY) };
        check(&path)?;
        let (driven, skin_s) = driven_by_air(&path, film_w_per_m2_k);
        let reduced = observed.solved.reduced(driven, path.sensors_part(), modes, &observed.series)?;
        let rate = RateModel::new(model, &assumed.pattern, &observed.channels)?;
        let gains = gains(&rate, &reduced, observed);
        let beyond_linear = model.effects.iter().any(|e| {
            let bound = e.bind(&model.coil, &observed.channels);
            !bound.is_linear() || bound.path_depends_on_temperature() || !e.channels().is_empty()
        });
        let lag_s = model.sensor_lag_s();
        let solved = observed.solved.clone();
        Ok(Self { path, film_w_per_m2_k, modes, reduced, gains, rate, skin_s, shows, lag_s, beyond_linear, solved })
    }

    pub(crate) fn parts<'a>(&'a self, assumed: &Assumption) -> Parts<'a> {
        Parts {
            reduced: &self.reduced,
            gains: &self.gains,
            skin_s: self.skin_s,
            shows: self.shows,
            lag_s: self.lag_s,
            drift: assumed.drift,
            cycle: assumed.cycle,
        }
    }

    /// The row of the heat path that the sensor shows; None: the air.
    pub(super) fn shown(&self) -> Option<usize> {
        self.shows.row_of(&self.reduced)
    }

    pub(super) fn lag_s(&self) -> f64 {
        self.lag_s
    }

    fn asked(&self) -> Asked<'_> {
        Asked {
            path: &self.path,
            film_w_per_m2_k: self.film_w_per_m2_k,
            modes: self.modes,
            reduced: &self.reduced,
            gains: &self.gains,
            rate: &self.rate,
            beyond_linear: self.beyond_linear,
            shows: self.shows,
            lag_s: self.lag_s,
            solved: &self.solved,
        }
    }

    /// Whether a reference is needed.
    pub(crate) fn needs_reference(&self) -> bool {
        !self.asked().is_empty()
    }

    /// The record's values with all known inputs taken off; those of an assumption's inputs included.
    ///
    /// # Errors
    /// A conductivity that is not positive.
    pub(crate) fn values(
        &self,
        assumed: &Assumption,
        observed: &Observed,
        place: usize,
        reference: Option<&Reference>,
    ) -> Result<Values, ChamberError> {
        let mut values = match reference {
            Some(reference) => taken_off(&observed.series, &known(&self.asked(), &observed.series, reference)?),
            None => Values { of: observed.series.values.clone() },
        };
        for input in &assumed.inputs {
            let Some(added) = input.added_rad_per_s(&assumed.model, place) else { continue };
            values.of[filter::RATE].iter_mut().zip(added).for_each(|(v, a)| *v -= a);
        }
        Ok(values)
    }

    /// The rates that a course implies, without any offset; NaN at the first row.
    ///
    /// # Errors
    /// A conductivity that is not positive.
    pub(crate) fn rates(
        &self,
        assumed: &Assumption,
        observed: &Observed,
        place: usize,
        course: &Reference,
    ) -> Result<Vec<f64>, ChamberError> {
        let series = &observed.series;
        let mut rates = vec![0.0; series.times_s.len()];
        for (output, gain) in self.gains.outputs.iter().enumerate().filter(|(_, g)| **g != 0.0) {
            let own = course.window_rates(series, Some(output));
            rates.iter_mut().zip(own).for_each(|(r, o)| *r += gain * o);
        }
        let air = course.window_rates(series, None);
        rates.iter_mut().zip(air).for_each(|(r, a)| *r += self.gains.air * a);
        if self.beyond_linear {
            super::known::beyond_linear(&self.asked(), series, course, &mut rates);
        }
        for input in &assumed.inputs {
            let Some(added) = input.added_rad_per_s(&assumed.model, place) else { continue };
            rates.iter_mut().zip(added).for_each(|(r, a)| *r += a);
        }
        rates[0] = f64::NAN;
        Ok(rates)
    }

    /// Whether a course is one of this side's outputs.
    pub(crate) fn fits(&self, course: &Reference) -> bool {
        course.outputs == self.reduced.outputs
    }

    /// The course that states and known changes make, with the numbers of its record.
    ///
    /// # Errors
    /// A conductivity that is not positive.
    pub(crate) fn reference(
        &self,
        assumed: &Assumption,
        numbers: &Numbers,
        observed: &Observed,
        states: &[f64],
        before: Option<&Reference>,
    ) -> Result<Reference, ChamberError> {
        let series = &observed.series;
        let layout = Layout::new(&self.parts(assumed), series);
        let rows = series.times_s.len();
        let outputs = self.reduced.outputs;
        // Of each film what the modes follow, and of each state that shows in the outputs what it makes of them.
        let behind = |film: &Film| {
            let drive = drive(&layout, &self.reduced, numbers.film_ratio(*film));
            let of: Vec<Vec<f64>> = (0..outputs).map(|j| layout.output(&self.reduced, j, &drive)).collect();
            let shares = (0..layout.size).map(|i| (i, of.iter().map(|row| row[i]).collect::<Vec<f64>>()));
            let shown = shares.filter(|(_, shares)| shares.iter().any(|share| *share != 0.0));
            (drive, shown.collect::<Vec<(usize, Vec<f64>)>>())
        };
        let behind: Vec<_> = series.films().iter().map(behind).collect();
        let dot = |row: &[f64], x: &[f64]| row.iter().zip(x).map(|(a, b)| a * b).sum::<f64>();
        let mut found = Reference {
            layers: self.reduced.layers,
            outputs,
            air_k: Vec::with_capacity(rows),
            drive_k: Vec::with_capacity(rows),
            outputs_k: Vec::with_capacity(rows * outputs),
            slopes_k_per_s: Vec::new(),
        };
        for (k, x) in states.chunks_exact(layout.size).enumerate() {
            let (drive, shown) = &behind[series.film_at(k) as usize];
            found.air_k.push(layout.air().into_iter().map(|i| x[i]).sum());
            found.drive_k.push(dot(drive, x));
            found.outputs_k.resize((k + 1) * outputs, 0.0);
            for (state, shares) in shown {
                found.outputs_k[k * outputs..].iter_mut().zip(shares).for_each(|(o, share)| *o += share * x[*state]);
            }
        }
        // Known changes of the layers belong to the course; they were taken off the readings.
        let asked = self.asked();
        if asked.path.has_own_course() || asked.path.conductivity_slope_per_k != 0.0 {
            let about = before.unwrap_or(&found);
            let changes = super::known::changes(&asked, series, about)?;
            let of_outputs = changes.chunks_exact(changes.len() / rows).flat_map(|row| &row[..outputs]);
            found.outputs_k.iter_mut().zip(of_outputs).for_each(|(o, c)| *o += c);
        }
        Ok(found)
    }
}

/// Ω by unit rates of each output, at the record's mean temperature.
fn gains(rate: &RateModel, reduced: &Reduced, observed: &Observed) -> OutputGains {
    let temperatures = vec![observed.mean_k; reduced.layers];
    let lengths_m = rate.coil().layer_lengths_m();
    let length_m = rate.coil().length_m();
    let channels = vec![0.0; observed.channels.len()];
    let after = |rates: &[f64], air: f64, past: &mut Past| {
        let state = PackState {
            time_s: 0.0,
            temperatures_k: &temperatures,
            rates_k_per_s: &rates[..reduced.layers],
            axial_moments_k_per_s: &rates[reduced.layers..],
            mean_temperature_k: observed.mean_k,
            mean_rate_k_per_s: rates.iter().zip(lengths_m).map(|(r, l)| r * l).sum::<f64>() / length_m,
            ambient_k: observed.mean_k,
            ambient_rate_k_per_s: air,
            channels: &channels,
            thermal_rate_rad_per_s: 0.0,
        };
        rate.rate_error_after(&state, past)
    };
    // What remembers does not follow at once: it stays as it is while the pack stands still.
    let mut still = Past::default();
    after(&vec![0.0; reduced.outputs], 0.0, &mut still);
    let of = |rates: &[f64], air: f64| after(rates, air, &mut still.clone());
    // Both signs: what depends on the sign of a rate has no linear part in this.
    let mut unit = vec![0.0; reduced.outputs];
    let mut outputs = Vec::with_capacity(reduced.outputs);
    for j in 0..reduced.outputs {
        unit[j] = 1.0;
        let up = of(&unit, 0.0);
        unit[j] = -1.0;
        outputs.push(0.5 * (up - of(&unit, 0.0)));
        unit[j] = 0.0;
    }
    OutputGains { outputs, air: 0.5 * (of(&unit, 1.0) - of(&unit, -1.0)) }
}

/// One record through the filter.
pub(super) fn run(
    side: &CoilSide,
    assumed: &Assumption,
    numbers: &Numbers,
    observed: &Observed,
    values: &Values,
) -> Vec<Innovation> {
    let system = decoupled_system(&side.parts(assumed), numbers, &observed.series);
    filter::forward(&system, &observed.series.rows, values, false).innovations
}

/// As [`run`], with everything that the other passes need.
pub(super) fn run_kept(
    side: &CoilSide,
    assumed: &Assumption,
    numbers: &Numbers,
    observed: &Observed,
    values: &Values,
) -> (filter::System, Trace) {
    let system = system(&side.parts(assumed), numbers, &observed.series);
    let trace = filter::forward(&system, &observed.series.rows, values, true);
    (system, trace)
}

/// A rate with this variance says nothing beside any gyro's [(rad/s)²].
pub(super) const BLIND_RAD2_PER_S2: f64 = 1e-2;

/// The smoothed course of one record, as its readings alone have it: a model that is linearised about a course which has seen the
/// rates would take from each rate a part of what it is to explain, and be likelier for that.
///
/// # Errors
/// A conductivity that is not positive.
pub(super) fn smoothed(
    side: &CoilSide,
    assumed: &Assumption,
    numbers: &Numbers,
    observed: &Observed,
    place: usize,
    before: Option<&Reference>,
) -> Result<Reference, ChamberError> {
    let values = side.values(assumed, observed, place, before)?;
    let mut system = system(&side.parts(assumed), numbers, &observed.series);
    system.variances[filter::RATE] += BLIND_RAD2_PER_S2;
    let trace = filter::forward(&system, &observed.series.rows, &values, true);
    let states = filter::smooth(&system, &observed.series.rows, &trace);
    let mut course = side.reference(assumed, numbers, observed, &states, before)?;
    if begins_between_rows(&observed.series) {
        course.slopes_k_per_s =
            side.slopes(&Layout::new(&side.parts(assumed), &observed.series), &observed.series, &states, &course);
    }
    Ok(course)
}

/// The film as a number of the chamber, where the model does not state one.
pub(super) fn film_is_free(assumed: &Assumption) -> Result<bool, ChamberError> {
    Ok(assumed.model.heat_path()?.film_is_unknown())
}

/// All quantities that an assumption has, for each record or for all.
pub(super) fn quantities(assumed: &Assumption, observed: &Observed) -> Result<Vec<Quantity>, ChamberError> {
    let mut all = Vec::new();
    if film_is_free(assumed)? {
        all.push(Quantity::Film);
    }
    all.push(Quantity::ReadingNoise);
    if observed.record.inner_k().is_some() {
        all.push(Quantity::InnerNoise);
    }
    if observed.record.ambient_k().is_some() {
        all.push(Quantity::AmbientNoise);
    }
    if !observed.blind {
        all.extend([Quantity::RateNoise, Quantity::WanderShare, Quantity::WanderTime]);
    }
    all.extend([
        Quantity::RestNoise,
        Quantity::BendNoise,
        Quantity::TurbulenceSize,
        Quantity::TurbulenceTime,
        Quantity::RippleSize,
        Quantity::RipplePeriod,
        Quantity::RippleCoherence,
        Quantity::StartSlope,
    ]);
    if observed.series.controlled {
        all.extend([Quantity::ControlTime, Quantity::ControlDamping]);
    }
    if observed.series.approaches {
        all.push(Quantity::ApproachTime);
        if observed.series.delays {
            all.push(Quantity::OnsetTime);
        }
    }
    if !observed.series.film_switches_s.is_empty() {
        all.push(Quantity::FilmRatio);
    }
    if assumed.drift {
        all.extend([Quantity::DriftSize, Quantity::DriftTime]);
    }
    if assumed.cycle {
        all.extend([Quantity::CycleSize, Quantity::CyclePeriod]);
    }
    Ok(all)
}
