//! What a model adds to readings and rates that the linear system does not hold, worked out along a reference.
//!
//! ```text
//! reading += lag(δT_N),   rate += (c·δT(t) − c·δT(t − W))/W + Ω(T̄, dT̄/dt, …) − c·dT̄/dt
//! ```
//!
//! δT: the bore's heat, and the difference that a conductivity which depends on temperature makes to the layers while the
//! reference's air drives the pack; Ω: the full rate error at the reference T̄. Both are second order in what the
//! reference is wrong by, so a reference smoothed from the record's readings, and smoothed again after a fit, is enough. It
//! sees no rates: what is taken off a rate must not hang on that rate, or the density of what is left is none of the rate.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | T̄, c | the reference's layers; the linear system's rate per kelvin a second | K, rad |
//! | δT, W | known change of the layers; the rate's window | K, s |

use super::filter::{MEASURED, RATE, Values};
use super::layout::OutputGains;
use super::series::Series;
use super::shows::Shows;
use super::solved::Solved;
use super::system::driven_by_air;
use crate::effect::PackState;
use crate::numeric::hermite::hermite;
use crate::rate::{Past, RateModel};
use crate::thermal::reduced::Reduced;
use crate::thermal::{HeatPath, ThermalError};
use crate::units::REFERENCE_TEMPERATURE_K;

/// The course that a record is linearised about: smoothed air and layers, known changes included.
///
/// # Shapes
/// `outputs_k` row-major rows × outputs: the layers' means, innermost first, then their axial moments.
#[derive(Debug, Clone)]
pub(crate) struct Reference {
    pub(crate) layers: usize,
    pub(crate) outputs: usize,
    /// Above the record's `reference_k`.
    pub(crate) air_k: Vec<f64>,
    /// What the pack's modes follow: the air, but for a skin and behind a film that is switched.
    pub(super) drive_k: Vec<f64>,
    pub(crate) outputs_k: Vec<f64>,
    /// Slopes of the outputs and the air, row-major rows × (outputs + 1) \[K/s\]; empty where the course counts as straight between rows.
    pub(crate) slopes_k_per_s: Vec<f64>,
}

impl Reference {
    pub(crate) fn row(&self, row: usize) -> &[f64] {
        &self.outputs_k[row * self.outputs..(row + 1) * self.outputs]
    }

    /// Change of an output (None: of the air) over each row's window, per second; zero at the first row.
    pub(super) fn window_rates(&self, series: &Series, output: Option<usize>) -> Vec<f64> {
        let rate = |k: usize| {
            if k == 0 {
                return 0.0;
            }
            let at = |k: usize| output.map_or(self.air_k[k], |j| self.row(k)[j]);
            let window_s = series.shapes[series.shape_of(k)].window_s;
            if window_s > 0.0 {
                let (before, share) = window_start(series, k);
                (at(k) - self.between(series, before, share, output)) / window_s
            } else {
                (at(k) - at(k - 1)) / (series.times_s[k] - series.times_s[k - 1])
            }
        };
        (0..series.times_s.len()).map(rate).collect()
    }

    /// At the beginning of a row's window, between the rows where it lies there.
    pub(super) fn at_window_start(&self, series: &Series, row: usize, out: &mut Vec<f64>) -> f64 {
        let (before, share) = window_start(series, row);
        out.clear();
        out.extend((0..self.outputs).map(|j| self.between(series, before, share, Some(j))));
        self.between(series, before, share, None)
    }

    /// An output (None: the air) so far from a row to the next: on the cubic that has its slopes there, on a line where none are known.
    fn between(&self, series: &Series, before: usize, share: f64, output: Option<usize>) -> f64 {
        let at = |k: usize| output.map_or(self.air_k[k], |j| self.row(k)[j]);
        let (a, b) = (at(before), at(before + 1));
        let columns = self.outputs + 1;
        let slope = |k: usize| self.slopes_k_per_s.get(k * columns + output.unwrap_or(self.outputs));
        match slope(before).zip(slope(before + 1)) {
            Some((from, to)) => {
                let length_s = series.times_s[before + 1] - series.times_s[before];
                hermite((a, b), (length_s * from, length_s * to), share).0
            }
            None => a + share * (b - a),
        }
    }
}

/// The row after which a row's window begins, and how far to the next one.
fn window_start(series: &Series, row: usize) -> (usize, f64) {
    let start_s = series.times_s[row] - series.shapes[series.shape_of(row)].window_s;
    // Windows begin in the last interval or the one before it.
    let before = (0..row).rev().find(|&k| series.times_s[k] <= start_s + 1e-6).unwrap_or(0);
    let (t0, t1) = (series.times_s[before], series.times_s[before + 1]);
    (before, ((start_s - t0) / (t1 - t0)).clamp(0.0, 1.0))
}

/// Whether some window of a record begins between two of its rows, where the course itself is not known.
pub(super) fn begins_between_rows(series: &Series) -> bool {
    let is_between = |k: usize| {
        let share = window_start(series, k).1;
        series.shapes[series.shape_of(k)].window_s > 0.0 && share > 1e-6 && share < 1.0 - 1e-6
    };
    (1..series.times_s.len()).any(is_between)
}

/// What a model needs to have worked out.
#[derive(Debug, Clone, Copy)]
pub(super) struct Asked<'a> {
    pub(crate) path: &'a HeatPath,
    pub(crate) film_w_per_m2_k: f64,
    pub(crate) modes: usize,
    pub(crate) reduced: &'a Reduced,
    pub(crate) gains: &'a OutputGains,
    pub(crate) rate: &'a RateModel,
    /// Whether the rate is more than the gains say.
    pub(crate) beyond_linear: bool,
    pub(crate) shows: Shows,
    pub(crate) lag_s: f64,
    /// Where what is solved is kept.
    pub(super) solved: &'a Solved,
}

impl Asked<'_> {
    /// Whether there is anything to work out.
    pub(crate) fn is_empty(&self) -> bool {
        !self.beyond_linear && !self.path.has_own_course() && self.path.conductivity_slope_per_k == 0.0
    }
}

/// The known inputs of one record; columns that are empty are zero.
///
/// # Errors
/// A conductivity that is not positive somewhere in the reference.
pub(super) fn known(asked: &Asked, series: &Series, reference: &Reference) -> Result<Values, ThermalError> {
    let mut values = Values { of: std::array::from_fn(|_| Vec::new()) };
    if asked.is_empty() {
        return Ok(values);
    }
    let rows = series.times_s.len();
    let mut rates = vec![0.0; rows];
    if asked.path.has_own_course() || asked.path.conductivity_slope_per_k != 0.0 {
        let changes = changes(asked, series, reference)?;
        let columns = changes.len() / rows;
        if let Some(shown) = asked.shows.row_of(asked.reduced) {
            let of_shown: Vec<f64> = changes.chunks_exact(columns).map(|row| row[shown]).collect();
            values.of[0] = lagged(&of_shown, &series.times_s, asked.lag_s);
        }
        values.of[1] = changes.chunks_exact(columns).map(|row| row[0]).collect();
        let of_rate = |row: &[f64]| row.iter().zip(&asked.gains.outputs).map(|(c, g)| c * g).sum();
        let content: Vec<f64> = changes.chunks_exact(columns).map(of_rate).collect();
        for k in 1..rows {
            rates[k] += (content[k] - content[k - 1]) / (series.times_s[k] - series.times_s[k - 1]);
        }
    }
    if asked.beyond_linear {
        beyond_linear(asked, series, reference, &mut rates);
    }
    values.of[RATE] = rates;
    Ok(values)
}

pub(super) fn lagged(values: &[f64], times_s: &[f64], lag_s: f64) -> Vec<f64> {
    if lag_s <= 0.0 {
        return values.to_vec();
    }
    let mut shown = values[0];
    let mut out = vec![shown];
    for k in 1..values.len() {
        // Exact for an input that is linear between rows.
        let step = (times_s[k] - times_s[k - 1]) / lag_s;
        let left = (-step).exp();
        let slope = (values[k] - values[k - 1]) / step;
        shown = values[k] - slope + (shown - values[k - 1] + slope) * left;
        out.push(shown);
    }
    out
}

/// Known changes of the outputs and of the part that carries the sensor, row-major rows × these.
pub(super) fn changes(asked: &Asked, series: &Series, reference: &Reference) -> Result<Vec<f64>, ThermalError> {
    let (rows, outputs) = (series.times_s.len(), asked.reduced.residue.len());
    let mut changes = vec![0.0; rows * outputs];
    for (k, line) in changes.chunks_exact_mut(outputs).enumerate() {
        if let Some(heat) = asked.reduced.own_k(series.times_s[k] - series.start_s) {
            line.copy_from_slice(&heat);
        }
    }
    let slope = asked.path.conductivity_slope_per_k;
    if slope != 0.0 {
        let mean = |k: usize| {
            let layers = &reference.row(k)[..reference.layers];
            series.reference_k + layers.iter().sum::<f64>() / layers.len() as f64
        };
        let temperatures: Vec<f64> = (0..rows).map(mean).collect();
        let low = temperatures.iter().copied().fold(f64::INFINITY, f64::min);
        let high = temperatures.iter().copied().fold(f64::NEG_INFINITY, f64::max).max(low + 1.0);
        // At three temperatures, and between them by the parabola through them: the modes that conductivity moves are
        // faster than the pack's temperature.
        let nodes = [low, 0.5 * (low + high), high];
        let mut fields = Vec::new();
        for node in nodes {
            let factor = 1.0 + slope * (node - REFERENCE_TEMPERATURE_K);
            if !(factor > 0.0) {
                return Err(ThermalError::ConductivityNotPositive { temperature_k: node, slope_per_k: slope });
            }
            let mut path = asked.path.clone();
            path.material = path.material.scaled(factor);
            path = path.driven_only();
            let (path, _) = driven_by_air(&path, asked.film_w_per_m2_k);
            let part = asked.path.sensors_part();
            let there = asked.solved.reduced(path, part, asked.modes, series)?;
            fields.push(there.driven(&series.times_s, &reference.drive_k));
        }
        let here = asked.reduced.driven(&series.times_s, &reference.drive_k);
        for (k, temperature_k) in temperatures.iter().enumerate() {
            let x = (temperature_k - nodes[1]) / (nodes[2] - nodes[1]);
            let weights = [0.5 * x * (x - 1.0), 1.0 - x * x, 0.5 * x * (x + 1.0)];
            for j in 0..outputs {
                let place = k * outputs + j;
                let there: f64 = weights.iter().zip(&fields).map(|(w, f)| w * f[place]).sum();
                changes[place] += there - here[place];
            }
        }
    }
    Ok(changes)
}

/// Adds what the full model says at the reference beyond its linear part; NaN where a channel has no value.
pub(super) fn beyond_linear(asked: &Asked, series: &Series, reference: &Reference, rates: &mut [f64]) {
    let layers = reference.layers;
    let lengths_m = asked.rate.coil().layer_lengths_m();
    let length_m = asked.rate.coil().length_m();
    let mean = |values: &[f64]| values.iter().zip(lengths_m).map(|(v, l)| v * l).sum::<f64>() / length_m;
    let mut channels = vec![0.0; series.columns.len()];
    let (mut start, mut change, mut temperatures) = (Vec::new(), Vec::new(), Vec::new());
    let mut past = Past::default();
    for (k, rate) in rates.iter_mut().enumerate() {
        channels.iter_mut().zip(&series.columns).for_each(|(value, column)| *value = column[k]);
        if k == 0 {
            // What remembers begins at rest.
            if asked.rate.remembers() {
                begin(asked, series, reference, &channels, &mut past);
            }
            continue;
        }
        let air_before = reference.at_window_start(series, k, &mut start);
        let window_s = series.shapes[series.shape_of(k)].window_s;
        let window_s = if window_s > 0.0 { window_s } else { series.times_s[k] - series.times_s[k - 1] };
        let end = reference.row(k);
        change.clear();
        change.extend(end.iter().zip(&start).map(|(b, a)| (b - a) / window_s));
        temperatures.clear();
        temperatures.extend(end[..layers].iter().zip(&start).map(|(b, a)| series.reference_k + 0.5 * (a + b)));
        let air_rate = (reference.air_k[k] - air_before) / window_s;
        let state = PackState {
            time_s: series.times_s[k],
            temperatures_k: &temperatures,
            rates_k_per_s: &change[..layers],
            axial_moments_k_per_s: &change[layers..],
            mean_temperature_k: mean(&temperatures),
            mean_rate_k_per_s: mean(&change[..layers]),
            ambient_k: series.reference_k + 0.5 * (reference.air_k[k] + air_before),
            ambient_rate_k_per_s: air_rate,
            channels: &channels,
            thermal_rate_rad_per_s: 0.0,
        };
        let linear: f64 =
            change.iter().zip(&asked.gains.outputs).map(|(c, g)| c * g).sum::<f64>() + asked.gains.air * air_rate;
        *rate += asked.rate.rate_error_after(&state, &mut past) - linear;
    }
}

/// The first row's state, standing still.
fn begin(asked: &Asked, series: &Series, reference: &Reference, channels: &[f64], past: &mut Past) {
    let layers = reference.layers;
    let temperatures: Vec<f64> = reference.row(0)[..layers].iter().map(|t| series.reference_k + t).collect();
    let still = vec![0.0; reference.outputs];
    let lengths_m = asked.rate.coil().layer_lengths_m();
    let mean: f64 = temperatures.iter().zip(lengths_m).map(|(t, l)| t * l).sum();
    asked.rate.rate_error_after(
        &PackState {
            time_s: series.times_s[0],
            temperatures_k: &temperatures,
            rates_k_per_s: &still[..layers],
            axial_moments_k_per_s: &still[layers..],
            mean_temperature_k: mean / asked.rate.coil().length_m(),
            mean_rate_k_per_s: 0.0,
            ambient_k: series.reference_k + reference.air_k[0],
            ambient_rate_k_per_s: 0.0,
            channels,
            thermal_rate_rad_per_s: 0.0,
        },
        past,
    );
}

/// Takes known inputs off a record's values.
pub(super) fn taken_off(series: &Series, known: &Values) -> Values {
    let less = |m: usize| {
        let own = &series.values[m];
        if known.of[m].is_empty() { own.clone() } else { own.iter().zip(&known.of[m]).map(|(v, k)| v - k).collect() }
    };
    Values { of: std::array::from_fn::<_, MEASURED, _>(less) }
}

#[cfg(test)]
mod tests {
    use super::super::dense::tests::{effect, model};
    use super::super::kinks::tests::kinked;
    use super::super::model_point::log_likelihood;
    use super::super::{Assumption, Chamber, Effort};
    use super::*;
    use crate::pattern::classic::Classic;
    use crate::record::Record;

    /// Rows 40 s apart, each rate the mean over 10 s: on a line between the rows the rate of each layer is that over 40 s.
    #[test]
    fn where_windows_begin_between_rows_what_is_not_linear_is_told_by_the_slopes_there() {
        let (hidden, pattern) =
            (model(vec![effect("heating_cooling_asymmetry", &[0.3])]), Classic::Zyl.pattern(8).unwrap());
        let whole = kinked(&hidden, &pattern);
        let every_fourth = |column: &[f64]| column.iter().copied().skip(3).step_by(4).collect::<Vec<f64>>();
        let columns = [whole.times_s(), whole.temperature_k(), whole.rate_rad_per_s()].map(every_fourth);
        let [times_s, temperature_k, rate_rad_per_s] = columns;
        let record = Record::new("spaced", times_s, temperature_k, rate_rad_per_s).unwrap();
        let assumed = Assumption::new(hidden.clone(), pattern);
        let close = Chamber::new(&hidden, &[&whole]).unwrap();
        assert!(!begins_between_rows(&close.observed[0].series));
        let chamber = Chamber::new(&hidden, &[&record]).unwrap();
        assert!(begins_between_rows(&chamber.observed[0].series));
        let fit = chamber.fit(&assumed, &[], &[0], None, Effort::QUICK).unwrap();
        let likelihood = |courses: &[Option<Reference>]| {
            let point = chamber.model_point(assumed.clone(), fit.numbers.clone(), &[0], courses).unwrap();
            log_likelihood(&chamber.innovations(&point, 0).unwrap())
        };
        let mut straight = fit.courses.clone();
        straight.iter_mut().flatten().for_each(|course| course.slopes_k_per_s.clear());
        let (with_slopes, on_lines) = (likelihood(&fit.courses), likelihood(&straight));
        println!("{with_slopes} with slopes, {on_lines} on lines");
        assert!(with_slopes > on_lines + 5.0, "{with_slopes} with slopes, {on_lines} on lines");
    }
}
