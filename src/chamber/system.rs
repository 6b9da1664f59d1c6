//! The joint model with numbers in it: chamber, pack, sensor and gyro as one linear system.
//!
//! ```text
//! dx_i = λ_i (a − x_i) dt                     modes of the pack behind the film; a = u + f + o, the air
//! du = s dt,   ds = √q dW                     trend; q between the noise at rest and that where readings bend
//! ds = −s/τ_a dt + √q dW                      … of a stage, which approaches its set point
//! ds = (r − s)/τ_o dt,   dr = −r/τ_a dt + √q dW                 … of one that begins to do so with a delay
//! ds = b dt,   db = (ω²(v − s) − 2 ζ ω b) dt,   dv = √q dW      … of a controlled chamber, whose air follows a set point
//! df = −f/τ_f dt + σ_f √(2/τ_f) dW            turbulence
//! d(o, p) = R (o, p) dt + γ (d, e) dt,   d(d, e) = R (d, e) dt + 2 σ_o √γ dW,   R = (−γ, ω; −ω, −γ)        ripple
//! dl = (sensor's place − l)/τ dt              lag
//! dw = −w/τ_w dt + σ_w √(2/τ_w) dW            wander; drift and cycle likewise where they are asked for
//! dx_i = λ_i (a' − x_i) dt                    … behind another film ([`super::film`])
//! reading = l or the sensor's place + noise,   rate = (c·x(t) − c·x(t − W))/W + b + w + noise
//! ```
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | x_i, λ_i, c | modes, their decays and the rate per kelvin a second of each | K, 1/s, rad |
//! | τ, W, b | sensor's lag, the rate's window, offset | s, s, rad/s |
//! | τ_a, τ_o, r | time in which the air of a stage approaches its set point, and that in which its slope becomes what the step asks for | s, s, K/s |
//! | v, ω, ζ | slope of a controlled chamber's set point; angular frequency and damping ratio of what follows it | K/s, 1/s, |
//!
//! The ripple's size and phase are what a compressor makes of its load, and as smooth: driven by noise itself the oscillator
//! would have a tail that falls as 1/f², which the coil sees as white noise of its own.
//!
//! A half space, or a pack whose heat capacity is unknown, is driven by its outermost layer, which follows the air with the
//! time that a film over the pack's capacity would have.

use std::sync::Arc;

use super::decoupled::Decoupling;
use super::discretise::{ChangesAfter, ContinuousDynamics, discretise};
use super::film::drive;
use super::filter::{RATE, Step, System};
use super::layout::{Layout, Numbers, Parts};
use super::prior::Quantity;
use super::row::Film;
use super::series::{Series, Shape, TimeStep};
use super::sparse::Sparse;
use super::start::start;
use crate::thermal::{Extent, HeatPath, Location, PackMaterial};

/// Heat capacity that a pack is taken to have where only its diffusivity is known [J/(m³K)].
const USUAL_CAPACITY_J_PER_M3_K: f64 = 1.7e6;

/// A heat path as the air drives it, and the time of a skin where there is no film in it. A part that carries the sensor follows the air
/// with the coil.
pub(super) fn driven_by_air(path: &HeatPath, film_w_per_m2_k: f64) -> (HeatPath, Option<f64>) {
    let mut driven = path.clone();
    driven.conductivity_slope_per_k = 0.0;
    if path.extent == Extent::HalfSpace {
        let capacity = match path.material {
            PackMaterial::Conductivity { heat_capacity_j_per_m3_k, .. } => heat_capacity_j_per_m3_k,
            PackMaterial::Diffusivity { .. } => USUAL_CAPACITY_J_PER_M3_K,
        };
        let thickness_m = path.shape.layers as f64 * path.shape.radial_pitch_m;
        return (driven, Some(capacity * thickness_m / film_w_per_m2_k));
    }
    if let PackMaterial::Diffusivity { m2_per_s } = path.material {
        driven.material = PackMaterial::Conductivity {
            w_per_m_k: m2_per_s * USUAL_CAPACITY_J_PER_M3_K,
            heat_capacity_j_per_m3_k: USUAL_CAPACITY_J_PER_M3_K,
        };
    }
    if path.location != Location::Ambient {
        driven.film_w_per_m2_k = Some(film_w_per_m2_k);
        driven.location = Location::Ambient;
    }
    (driven, None)
}

/// What of the system is another one behind another film.
struct Behind {
    dynamics: ContinuousDynamics,
    response: Vec<f64>,
    places: [Vec<f64>; RATE],
}

impl Behind {
    fn new(parts: &Parts, layout: &Layout, numbers: &Numbers, film_ratio: f64) -> Self {
        let drive = drive(layout, parts.reduced, film_ratio);
        let (of, noise, trend_noise) = dynamics(parts, layout, numbers, film_ratio);
        let dynamics = ContinuousDynamics { of, noises: [diagonal(&noise), diagonal(&trend_noise)] };
        let (response, places) = (response(parts, layout, &drive), places(parts, layout, &drive));
        Self { dynamics, response, places }
    }

    fn decouple(&mut self, decoupling: &Decoupling) {
        decoupling.take_dynamics(&mut self.dynamics.of);
        self.dynamics.noises.iter_mut().for_each(|noise| decoupling.take_covariance(noise));
        decoupling.take_rows(&mut self.response);
        self.places.iter_mut().for_each(|place| decoupling.take_rows(place));
    }
}

/// The system for one record.
pub(super) fn system(parts: &Parts, numbers: &Numbers, series: &Series) -> System {
    in_coordinates(parts, numbers, series, Coordinates::States, None)
}

/// One with the same innovations, whose states are others: for forward passes only.
pub(super) fn decoupled_system(parts: &Parts, numbers: &Numbers, series: &Series) -> System {
    in_coordinates(parts, numbers, series, Coordinates::Decoupled, None)
}

/// As [`decoupled_system`], beside one of the same series that is known: where nothing that steps follow from is another there, they are its.
pub(super) fn decoupled_system_beside(known: &System, parts: &Parts, numbers: &Numbers, series: &Series) -> System {
    in_coordinates(parts, numbers, series, Coordinates::Decoupled, Some(known))
}

/// What the states are.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Coordinates {
    /// As above.
    States,
    /// As in [`super::decoupled`].
    Decoupled,
}

fn in_coordinates(
    parts: &Parts,
    numbers: &Numbers,
    series: &Series,
    coordinates: Coordinates,
    beside: Option<&System>,
) -> System {
    let layout = Layout::new(parts, series);
    let n = layout.size;
    let behind = series.films().iter().map(|film| numbers.film_ratio(*film));
    let mut behind: Vec<Behind> = behind.map(|ratio| Behind::new(parts, &layout, numbers, ratio)).collect();
    let (mut mean, mut covariance) = start(parts, &layout, &behind[0].dynamics.of, numbers, series);
    if coordinates == Coordinates::Decoupled {
        let decoupling = Decoupling::new(&behind[0].dynamics.of, &layout);
        behind.iter_mut().for_each(|own| own.decouple(&decoupling));
        decoupling.take_columns(&mut mean, 1);
        decoupling.take_covariance(&mut covariance);
    }
    let steps = match beside {
        Some(known) if known.dynamics.iter().eq(behind.iter().map(|own| &own.dynamics)) => Arc::clone(&known.steps),
        _ => steps(&behind, series),
    };
    // Of each film the slots of windows, and what they keep.
    let (mut keeps, mut kept): (Vec<Vec<(usize, usize)>>, Vec<f64>) = (Vec::new(), Vec::new());
    for Behind { response, places, .. } in &behind {
        let first = keeps.len();
        keeps.extend(layout.windows.iter().map(|&window| vec![(window, kept.len() / n)]));
        kept.extend(response);
        if let Some(reading) = layout.reading {
            keeps[first].push((reading, kept.len() / n));
            kept.extend(&places[0]);
        }
    }
    let square = |q: Quantity| numbers.get(q).powi(2);
    let grid = series.resolution_k.powi(2) / 12.0;
    let mut system = System {
        size: n,
        steps,
        kinks: Vec::new(),
        trend: (numbers.get(Quantity::RestNoise), numbers.get(Quantity::BendNoise)),
        slope: layout.kinked_slope(),
        rows: Sparse::new(&rows(&behind, &layout, series), n),
        variances: [
            square(Quantity::ReadingNoise),
            square(Quantity::InnerNoise),
            square(Quantity::AmbientNoise),
            square(Quantity::RateNoise),
        ],
        grids: [grid, grid, 0.0, 0.0],
        keeps,
        kept: Sparse::new(&kept, n),
        mean,
        covariance,
        dynamics: behind.into_iter().map(|own| own.dynamics).collect(),
    };
    system.kinks = system.kinks_of(series);
    system
}

/// What each way of measuring a row measures.
///
/// # Shapes
/// Row-major, a row a measurement, n columns.
fn rows(behind: &[Behind], layout: &Layout, series: &Series) -> Vec<f64> {
    let mut rows = Vec::new();
    for shape in &series.shapes {
        let Behind { dynamics, response, places } = &behind[shape.film as usize];
        for place in places {
            let share = |row: &[f64]| row.iter().map(|v| v * shape.end_share).collect::<Vec<f64>>();
            let mut row = share(place);
            // Only the sensor's readings are interpolated; those of other thermometers are taken at the window's end.
            if let (Some(reading), true) = (layout.reading, std::ptr::eq(place, &raw const places[0])) {
                row[reading] = 1.0 - shape.end_share;
            } else {
                row.clone_from(place);
            }
            rows.extend(row);
        }
        rows.extend(rate_row(layout, &dynamics.of, response, shape));
    }
    rows
}

/// All steps of a record, each behind its film.
fn steps(behind: &[Behind], series: &Series) -> Arc<[Step]> {
    let mut steps: Vec<Option<Step>> = vec![None; series.steps.len()];
    for (film, behind) in series.films().iter().zip(behind) {
        let own: Vec<usize> = (0..steps.len()).filter(|&i| series.steps[i].film == *film).collect();
        let lengths_s: Vec<f64> = own.iter().map(|&i| series.steps[i].length_s).collect();
        let ContinuousDynamics { of, noises: [noise, trend_noise] } = &behind.dynamics;
        let n = behind.response.len();
        for (i, found) in own.into_iter().zip(discretise(of, [noise, trend_noise], n, &lengths_s)) {
            let [noise, trend_noise] = found.noises;
            let phi = Sparse::new(&found.transition, n);
            let phi_turned = phi.transposed(n);
            steps[i] = Some(Step { phi, phi_turned, noise, trend_noise });
        }
    }
    steps.into_iter().flatten().collect()
}

/// Row-major n × n.
pub(super) fn diagonal(entries: &[f64]) -> Vec<f64> {
    let n = entries.len();
    let mut square = vec![0.0; n * n];
    entries.iter().enumerate().for_each(|(i, e)| square[i * n + i] = *e);
    square
}

/// c: the rate per kelvin a second of each state.
pub(super) fn response(parts: &Parts, layout: &Layout, drive: &[f64]) -> Vec<f64> {
    let mut row = vec![0.0; layout.size];
    for (output, gain) in parts.gains.outputs.iter().enumerate().filter(|(_, g)| **g != 0.0) {
        row.iter_mut().zip(layout.output(parts.reduced, output, drive)).for_each(|(r, a)| *r += gain * a);
    }
    layout.air().into_iter().for_each(|i| row[i] += parts.gains.air);
    row
}

/// What each thermometer shows.
pub(super) fn places(parts: &Parts, layout: &Layout, drive: &[f64]) -> [Vec<f64>; RATE] {
    let place = sensor_place(parts, layout, drive);
    let sensor = match layout.lag {
        Some(lag) => (0..layout.size).map(|i| f64::from(i == lag)).collect(),
        None => place,
    };
    [sensor, layout.output(parts.reduced, 0, drive), layout.air_row()]
}

fn sensor_place(parts: &Parts, layout: &Layout, drive: &[f64]) -> Vec<f64> {
    match parts.shows.row_of(parts.reduced) {
        Some(row) => layout.output(parts.reduced, row, drive),
        None => layout.air_row(),
    }
}

fn rate_row(layout: &Layout, f: &[f64], response: &[f64], shape: &Shape) -> Vec<f64> {
    let (n, window_s) = (layout.size, shape.window_s);
    let mut row = vec![0.0; n];
    if window_s > 0.0 {
        row.iter_mut().zip(response).for_each(|(r, c)| *r = c / window_s);
        row[layout.windows[shape.slot as usize]] = -1.0 / window_s;
    } else {
        // The rate at an instant: c·F x.
        for (i, c) in response.iter().enumerate() {
            row.iter_mut().zip(&f[i * n..(i + 1) * n]).for_each(|(r, v)| *r += c * v);
        }
    }
    row[layout.offset] = 1.0;
    row[layout.wander] = 1.0;
    for i in [layout.drift, layout.cycle].into_iter().flatten() {
        row[i] = 1.0;
    }
    row
}

/// F behind a film of this ratio to that of the modes, the diagonal of G without the trend's noise, and that of the trend's per unit of its density.
pub(super) fn dynamics(
    parts: &Parts,
    layout: &Layout,
    numbers: &Numbers,
    film_ratio: f64,
) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let n = layout.size;
    let (mut f, mut g) = (vec![0.0; n * n], vec![0.0; n]);
    let get = |q: Quantity| numbers.get(q);
    let drive = drive(layout, parts.reduced, film_ratio);
    for (i, &l) in parts.reduced.decay_per_s.iter().enumerate() {
        drive.iter().enumerate().for_each(|(j, d)| f[i * n + j] = l * d);
        f[i * n + i] -= l;
    }
    if let (Some(skin), Some(skin_s)) = (layout.skin, parts.skin_s) {
        let decay_per_s = film_ratio / skin_s;
        f[skin * n + skin] = -decay_per_s;
        layout.air().into_iter().for_each(|j| f[skin * n + j] = decay_per_s);
    }
    let trend = trend(layout, numbers, &mut f);
    let mut relax = |i: usize, size: f64, time_s: f64| {
        f[i * n + i] = -1.0 / time_s;
        g[i] = 2.0 * size * size / time_s;
    };
    relax(layout.turbulence, get(Quantity::TurbulenceSize), get(Quantity::TurbulenceTime));
    relax(layout.wander, get(Quantity::WanderShare) * get(Quantity::RateNoise), get(Quantity::WanderTime));
    if let Some(drift) = layout.drift {
        relax(drift, get(Quantity::DriftSize), get(Quantity::DriftTime));
    }
    let (size, period_s, coherence_s) =
        (get(Quantity::RippleSize), get(Quantity::RipplePeriod), get(Quantity::RippleCoherence));
    for (i, driver) in [(layout.ripple, layout.driver), (layout.ripple + 1, layout.driver + 1)] {
        // A driver of √2 the size, as slow as what it drives, gives this size.
        relax(i, 0.0, coherence_s);
        relax(driver, std::f64::consts::SQRT_2 * size, coherence_s);
    }
    for (i, driver) in [(layout.ripple, layout.driver), (layout.ripple + 1, layout.driver + 1)] {
        f[i * n + driver] = 1.0 / coherence_s;
    }
    rotate(&mut f, n, layout.ripple, period_s);
    rotate(&mut f, n, layout.driver, period_s);
    if let Some(cycle) = layout.cycle {
        rotate(&mut f, n, cycle, get(Quantity::CyclePeriod));
    }
    if let Some(lag) = layout.lag {
        for (j, v) in sensor_place(parts, layout, &drive).iter().enumerate() {
            f[lag * n + j] += v / parts.lag_s;
        }
        f[lag * n + lag] -= 1.0 / parts.lag_s;
    }
    (f, g, trend)
}

/// The air's level and slope in F, and what drives them per unit of the density of the trend's noise.
fn trend(layout: &Layout, numbers: &Numbers, f: &mut [f64]) -> Vec<f64> {
    let n = layout.size;
    f[layout.trend * n + layout.trend + 1] = 1.0;
    if layout.approaches {
        let dying = layout.kinked_slope();
        f[dying * n + dying] = -1.0 / numbers.get(Quantity::ApproachTime);
    }
    if let Some(onset) = layout.onset {
        let (slope, rate_per_s) = (layout.trend + 1, 1.0 / numbers.get(Quantity::OnsetTime));
        f[slope * n + slope] = -rate_per_s;
        f[slope * n + onset] = rate_per_s;
    }
    let mut trend = vec![0.0; n];
    match layout.control {
        Some(control) => {
            let (slope, frequency_per_s) = (layout.trend + 1, 1.0 / numbers.get(Quantity::ControlTime));
            f[slope * n + control] = 1.0;
            f[control * n + control] = -2.0 * numbers.get(Quantity::ControlDamping) * frequency_per_s;
            f[control * n + slope] = -frequency_per_s * frequency_per_s;
            f[control * n + control + 1] = frequency_per_s * frequency_per_s;
            trend[control + 1] = 1.0;
        }
        None => trend[layout.kinked_slope()] = 1.0,
    }
    trend
}

fn rotate(f: &mut [f64], n: usize, place: usize, period_s: f64) {
    let omega = std::f64::consts::TAU / period_s;
    f[place * n + place + 1] = omega;
    f[(place + 1) * n + place] = -omega;
}

impl System {
    /// What a kink makes of the states by the end of the step that it is within, for each of a record's.
    fn kinks_of(&self, series: &Series) -> Vec<Vec<f64>> {
        match series.after_kinks.as_slice() {
            [] => Vec::new(),
            times => self.after_kinks(series, times).of(times),
        }
    }

    /// What kinks in a record make of the states, up to the longest of these times after them.
    pub(super) fn after_kinks(&self, series: &Series, times: &[TimeStep]) -> AfterKinks {
        let behind = |(film, dynamics): (&Film, &ContinuousDynamics)| {
            let own = times.iter().filter(|time| time.film == *film);
            let longest_s = own.map(|time| time.length_s).fold(0.0, f64::max);
            (*film, ChangesAfter::new(&dynamics.of, self.size, self.slope, longest_s))
        };
        AfterKinks { behind: series.films().iter().zip(self.dynamics.iter()).map(behind).collect() }
    }

    /// Takes the offset as known and the gyro as steady: what is left of a rate's variance is air and white noise.
    pub(crate) fn forget_offset(&mut self, parts: &Parts, series: &Series) {
        let layout = Layout::new(parts, series);
        for i in 0..self.size {
            self.covariance[i * self.size + layout.offset] = 0.0;
            self.covariance[layout.offset * self.size + i] = 0.0;
        }
    }
}

/// What kinks of the air's slope make of the states, behind each of a record's films.
pub(super) struct AfterKinks {
    behind: Vec<(Film, ChangesAfter)>,
}

impl AfterKinks {
    /// By the end of the step that each is within, which is so long after it.
    pub(super) fn of(&self, after_kinks: &[TimeStep]) -> Vec<Vec<f64>> {
        let mut changes: Vec<Vec<f64>> = vec![Vec::new(); after_kinks.len()];
        for (film, after) in &self.behind {
            let own: Vec<usize> = (0..changes.len()).filter(|&i| after_kinks[i].film == *film).collect();
            let times_s: Vec<f64> = own.iter().map(|&i| after_kinks[i].length_s).collect();
            own.into_iter().zip(after.at(&times_s)).for_each(|(i, change)| changes[i] = change);
        }
        changes
    }
}
