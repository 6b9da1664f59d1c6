//! The joint model with numbers in it: chamber, pack, sensor and gyro as one linear system.
//!
//! ```text
//! dx_i = λ_i (a − x_i) dt                     modes of the pack behind the film; a = u + f + o, the air
//! du = s dt,   ds = √q dW                     trend; q between the noise at rest and that where readings bend
//! ds = −s/τ_a dt + √q dW                      … of a stage, which approaches its set point
//! df = −f/τ_f dt + σ_f √(2/τ_f) dW            turbulence
//! d(o, p) = R (o, p) dt + γ (d, e) dt,   d(d, e) = R (d, e) dt + 2 σ_o √γ dW,   R = (−γ, ω; −ω, −γ)        ripple
//! dl = (sensor's place − l)/τ dt              lag
//! dw = −w/τ_w dt + σ_w √(2/τ_w) dW            wander; drift and cycle likewise where they are asked for
//! reading = l or the sensor's place + noise,   rate = (c·x(t) − c·x(t − W))/W + b + w + noise
//! ```
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | x_i, λ_i, c | modes, their decays and the rate per kelvin a second of each | K, 1/s, rad |
//! | τ, W, b | sensor's lag, the rate's window, offset | s, s, rad/s |
//! | τ_a | time in which the air of a stage approaches its set point | s |
//!
//! The ripple's size and phase are what a compressor makes of its load, and as smooth: driven by noise itself the oscillator
//! would have a tail that falls as 1/f², which the coil sees as white noise of its own.
//!
//! A half space, or a pack whose heat capacity is unknown, is driven by its outermost layer, which follows the air with the
//! time that a film over the pack's capacity would have.

use nalgebra::SMatrix;

use super::discretise::discretise;
use super::filter::{RATE, Step, System};
use super::prior::{OFFSET_RAD_PER_S, PRIORS, Quantity, START_APART_K, START_APART_MODES, START_APART_S, START_K};
use super::series::{Series, Shape};
pub(super) use super::shows::Shows;
use super::sparse::Sparse;
use super::stationary::followed;
use crate::numeric::statistics::median;
use crate::thermal::reduced::Reduced;
use crate::thermal::{Extent, HeatPath, Location, PackMaterial};

/// Values of the chamber's quantities, by [`Quantity`]; NaN where a model has none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Numbers(pub(crate) [f64; PRIORS.len()]);

impl Numbers {
    pub(crate) fn get(&self, quantity: Quantity) -> f64 {
        self.0[quantity as usize]
    }

    pub(crate) fn set(&mut self, quantity: Quantity, value: f64) {
        self.0[quantity as usize] = value;
    }

    /// The medians of the priors, for one record.
    pub(crate) fn medians(series: &Series) -> Self {
        let mut numbers = Self([f64::NAN; PRIORS.len()]);
        for prior in &PRIORS {
            let unit = if prior.relative { series.noise_floor_rad_per_s } else { 1.0 };
            numbers.set(prior.quantity, prior.median * unit);
        }
        numbers
    }
}

/// What the coil makes of the outputs' rates, and of the air's [rad/s per K/s].
#[derive(Debug, Clone, PartialEq)]
pub(super) struct OutputGains {
    pub(crate) outputs: Vec<f64>,
    pub(crate) air: f64,
}

/// What of a model's structure the system depends on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Parts<'a> {
    pub(crate) reduced: &'a Reduced,
    pub(crate) gains: &'a OutputGains,
    /// The drive follows the air with this time [s]; None: the film is in the modes.
    pub(crate) skin_s: Option<f64>,
    pub(crate) shows: Shows,
    pub(crate) lag_s: f64,
    pub(crate) drift: bool,
    pub(crate) cycle: bool,
}

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

/// Where each state stands.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    pub(crate) modes: usize,
    skin: Option<usize>,
    /// Level of the air's trend; its slope is the next.
    pub(crate) trend: usize,
    pub(crate) turbulence: usize,
    pub(crate) ripple: usize,
    /// What drives the ripple.
    driver: usize,
    lag: Option<usize>,
    wander: usize,
    drift: Option<usize>,
    cycle: Option<usize>,
    offset: usize,
    /// What the rate's window began with; two where windows overlap.
    windows: [usize; 2],
    /// What readings were where a window begins; only where readings are averaged.
    reading: Option<usize>,
    pub(crate) size: usize,
}

impl Layout {
    pub(crate) fn new(parts: &Parts, series: &Series) -> Self {
        Self::with(parts, series.overlaps, series.averaged > 1)
    }

    /// `overlaps`: rates' windows do; `averaged`: readings are means.
    pub(crate) fn with(parts: &Parts, overlaps: bool, averaged: bool) -> Self {
        let mut size = 0;
        let mut take = |count: usize| {
            size += count;
            size - count
        };
        let modes = take(parts.reduced.modes());
        let _ = modes;
        let skin = parts.skin_s.map(|_| take(1));
        let (trend, turbulence, ripple, driver) = (take(2), take(1), take(2), take(2));
        let lag = (parts.lag_s > 0.0).then(|| take(1));
        let wander = take(1);
        let drift = parts.drift.then(|| take(1));
        let cycle = parts.cycle.then(|| take(2));
        let (offset, window) = (take(1), take(1));
        let windows = [window, if overlaps { take(1) } else { window }];
        let reading = averaged.then(|| take(1));
        let modes = parts.reduced.modes();
        Self {
            modes,
            skin,
            trend,
            turbulence,
            ripple,
            driver,
            lag,
            wander,
            drift,
            cycle,
            offset,
            windows,
            reading,
            size,
        }
    }

    /// How many states come before the gyro's own.
    pub(crate) fn own(&self) -> usize {
        self.wander
    }

    /// The states that show the air's temperature in equilibrium.
    pub(crate) fn levels(&self) -> impl Iterator<Item = usize> {
        (0..self.modes).chain(self.skin).chain([self.trend]).chain(self.lag)
    }

    pub(crate) fn offset(&self) -> usize {
        self.offset
    }

    /// The states that are the gyro's own.
    pub(crate) fn gyro(&self) -> impl Iterator<Item = usize> {
        let cycle = self.cycle.into_iter().flat_map(|c| [c, c + 1]);
        [self.wander, self.offset].into_iter().chain(self.drift).chain(cycle)
    }

    /// The states whose sum is the air.
    pub(crate) fn air(&self) -> [usize; 3] {
        [self.trend, self.turbulence, self.ripple]
    }

    /// What the modes follow.
    pub(crate) fn drive(&self, states: &[f64]) -> f64 {
        match self.skin {
            Some(skin) => states[skin],
            None => self.air().into_iter().map(|i| states[i]).sum(),
        }
    }

    /// An output's row over the states.
    pub(crate) fn output(&self, reduced: &Reduced, output: usize) -> Vec<f64> {
        let mut row = vec![0.0; self.size];
        row[..self.modes].copy_from_slice(reduced.row(output));
        match self.skin {
            Some(skin) => row[skin] = reduced.residue[output],
            None => self.air().into_iter().for_each(|i| row[i] = reduced.residue[output]),
        }
        row
    }

    pub(crate) fn air_row(&self) -> Vec<f64> {
        let mut row = vec![0.0; self.size];
        self.air().into_iter().for_each(|i| row[i] = 1.0);
        row
    }
}

/// The system for one record.
pub(super) fn system(parts: &Parts, numbers: &Numbers, series: &Series) -> System {
    let layout = Layout::new(parts, series);
    let n = layout.size;
    let approach_s = series.approach_s(numbers.get(Quantity::ApproachTime));
    let (f, noise, trend_noise) = dynamics(parts, &layout, numbers, approach_s);
    let steps = discretise(&f, [&noise, &trend_noise], n, &series.steps_s).into_iter().map(|found| {
        let [noise, trend_noise] = found.noises;
        let (phi, phi_turned) = (Sparse::new(&found.transition, n), Sparse::transposed(&found.transition, n));
        Step { phi, phi_turned, noise, trend_noise }
    });
    let steps = steps.collect();
    let (response, places) = (response(parts, &layout), places(parts, &layout));
    let mut rows = Vec::new();
    for shape in &series.shapes {
        for place in &places {
            let share = |row: &[f64]| row.iter().map(|v| v * shape.end_share).collect::<Vec<f64>>();
            let mut row = share(place);
            // Only the sensor's readings are interpolated; those of other thermometers are taken at the window's end.
            if let (Some(reading), true) = (layout.reading, std::ptr::eq(place, &places[0])) {
                row[reading] = 1.0 - shape.end_share;
            } else {
                row.clone_from(place);
            }
            rows.extend(row);
        }
        rows.extend(rate_row(&layout, &f, &response, shape));
    }
    let mut keeps: Vec<Vec<(usize, usize)>> = layout.windows.iter().map(|&window| vec![(window, 0)]).collect();
    let mut kept = response;
    if let Some(reading) = layout.reading {
        keeps[0].push((reading, 1));
        kept.extend(&places[0]);
    }
    let (mean, covariance) = start(parts, &layout, &f, numbers, series);
    let square = |q: Quantity| numbers.get(q).powi(2);
    let grid = series.resolution_k.powi(2) / 12.0;
    System {
        size: n,
        steps,
        trend: (numbers.get(Quantity::RestNoise), numbers.get(Quantity::BendNoise)),
        slope: layout.trend + 1,
        rows: Sparse::new(&rows, n),
        variances: [
            square(Quantity::ReadingNoise) + grid,
            square(Quantity::InnerNoise) + grid,
            square(Quantity::AmbientNoise),
            square(Quantity::RateNoise),
        ],
        keeps,
        kept: Sparse::new(&kept, n),
        mean,
        covariance,
    }
}

/// c: the rate per kelvin a second of each state.
pub(super) fn response(parts: &Parts, layout: &Layout) -> Vec<f64> {
    let mut row = vec![0.0; layout.size];
    for (output, gain) in parts.gains.outputs.iter().enumerate().filter(|(_, g)| **g != 0.0) {
        row.iter_mut().zip(layout.output(parts.reduced, output)).for_each(|(r, a)| *r += gain * a);
    }
    layout.air().into_iter().for_each(|i| row[i] += parts.gains.air);
    row
}

/// What each thermometer shows.
pub(super) fn places(parts: &Parts, layout: &Layout) -> [Vec<f64>; RATE] {
    let place = sensor_place(parts, layout);
    let sensor = match layout.lag {
        Some(lag) => (0..layout.size).map(|i| f64::from(i == lag)).collect(),
        None => place,
    };
    [sensor, layout.output(parts.reduced, 0), layout.air_row()]
}

fn sensor_place(parts: &Parts, layout: &Layout) -> Vec<f64> {
    match parts.shows {
        Shows::Air => layout.air_row(),
        // What carries the sensor is the last row.
        Shows::Part => layout.output(parts.reduced, parts.reduced.part.unwrap_or(parts.reduced.layers - 1)),
        Shows::OuterLayer => layout.output(parts.reduced, parts.reduced.layers - 1),
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

/// F, the diagonal of G without the trend's noise, and that of the trend's per unit of its density.
pub(super) fn dynamics(
    parts: &Parts,
    layout: &Layout,
    numbers: &Numbers,
    approach_s: f64,
) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let n = layout.size;
    let (mut f, mut g) = (vec![0.0; n * n], vec![0.0; n]);
    let get = |q: Quantity| numbers.get(q);
    let driving: Vec<usize> = match layout.skin {
        Some(skin) => vec![skin],
        None => layout.air().to_vec(),
    };
    for (i, &l) in parts.reduced.decay_per_s.iter().enumerate() {
        f[i * n + i] = -l;
        driving.iter().for_each(|&j| f[i * n + j] = l);
    }
    if let (Some(skin), Some(skin_s)) = (layout.skin, parts.skin_s) {
        f[skin * n + skin] = -1.0 / skin_s;
        layout.air().into_iter().for_each(|j| f[skin * n + j] = 1.0 / skin_s);
    }
    f[layout.trend * n + layout.trend + 1] = 1.0;
    f[(layout.trend + 1) * n + layout.trend + 1] = -1.0 / approach_s;
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
        for (j, v) in sensor_place(parts, layout).iter().enumerate() {
            f[lag * n + j] += v / parts.lag_s;
        }
        f[lag * n + lag] -= 1.0 / parts.lag_s;
    }
    let mut trend = vec![0.0; n];
    trend[layout.trend + 1] = 1.0;
    (f, g, trend)
}

fn rotate(f: &mut [f64], n: usize, place: usize, period_s: f64) {
    let omega = std::f64::consts::TAU / period_s;
    f[place * n + place + 1] = omega;
    f[(place + 1) * n + place] = -omega;
}

/// Mean and covariance before the first row.
fn start(parts: &Parts, layout: &Layout, f: &[f64], numbers: &Numbers, series: &Series) -> (Vec<f64>, Vec<f64>) {
    let n = layout.size;
    let mut mean = vec![0.0; n];
    let rates: Vec<f64> = series.values[RATE].iter().copied().filter(|v| v.is_finite()).collect();
    mean[layout.offset] = median(&rates);
    let mut covariance = stationary(layout, f, numbers);
    let mut add = |direction: &[f64], size: f64| {
        for i in (0..n).filter(|&i| direction[i] != 0.0) {
            for j in 0..n {
                covariance[i * n + j] += size * size * direction[i] * direction[j];
            }
        }
    };
    let slow: Vec<usize> = (0..layout.modes).chain(layout.skin).chain(layout.lag).collect();
    let mut together = vec![0.0; n];
    slow.iter().for_each(|&i| together[i] = 1.0);
    let mut ramp = vec![0.0; n];
    ramp[layout.trend + 1] = 1.0;
    let skin_s = parts.skin_s.unwrap_or(0.0);
    parts.reduced.decay_per_s.iter().enumerate().for_each(|(i, l)| ramp[i] = -1.0 / l - skin_s);
    layout.skin.into_iter().for_each(|i| ramp[i] = -skin_s);
    layout.lag.into_iter().for_each(|i| ramp[i] = -parts.lag_s + ramp[0]);
    let slope = numbers.get(Quantity::StartSlope);
    let apart = START_APART_K.hypot(START_APART_S * slope);
    add(&ramp, slope);
    add(&together, apart);
    together[layout.trend] = 1.0;
    add(&together, START_K);
    let mut one = |i: usize, size: f64| {
        let mut direction = vec![0.0; n];
        direction[i] = 1.0;
        add(&direction, size);
    };
    one(layout.trend + 1, slope);
    (0..layout.modes).for_each(|i| one(i, START_APART_MODES * apart));
    one(layout.turbulence, numbers.get(Quantity::TurbulenceSize));
    one(layout.wander, numbers.get(Quantity::WanderShare) * numbers.get(Quantity::RateNoise));
    layout.drift.into_iter().for_each(|i| one(i, numbers.get(Quantity::DriftSize)));
    layout
        .cycle
        .into_iter()
        .for_each(|i| [i, i + 1].into_iter().for_each(|i| one(i, numbers.get(Quantity::CycleSize))));
    one(layout.offset, OFFSET_RAD_PER_S);
    // ⟨o²⟩ = ⟨o d⟩ = σ², ⟨d²⟩ = 2 σ².
    let ripple = numbers.get(Quantity::RippleSize);
    for (i, driver) in [(layout.ripple, layout.driver), (layout.ripple + 1, layout.driver + 1)] {
        let mut direction = vec![0.0; n];
        (direction[i], direction[driver]) = (1.0, 1.0);
        add(&direction, ripple);
        direction[i] = 0.0;
        add(&direction, ripple);
    }
    (mean, covariance)
}

/// What turbulence and ripple have made of pack and sensor.
fn stationary(layout: &Layout, f: &[f64], numbers: &Numbers) -> Vec<f64> {
    let square = |q: Quantity| numbers.get(q).powi(2);
    let (turbulence, ripple) = (square(Quantity::TurbulenceSize), square(Quantity::RippleSize));
    let driving = [layout.turbulence, layout.ripple, layout.ripple + 1, layout.driver, layout.driver + 1];
    // As in `start`.
    let own = SMatrix::from_fn(|a, b| match (a, b) {
        (0, 0) => turbulence,
        (3, 3) | (4, 4) => 2.0 * ripple,
        (1, 1) | (2, 2) | (1, 3) | (3, 1) | (2, 4) | (4, 2) => ripple,
        _ => 0.0,
    });
    let followers: Vec<usize> = layout.skin.into_iter().chain(0..layout.modes).chain(layout.lag).collect();
    followed(f, layout.size, driving, &own, &followers)
}

impl System {
    /// Takes the offset as known and the gyro as steady: what is left of a rate's variance is air and white noise.
    pub(crate) fn forget_offset(&mut self, parts: &Parts, series: &Series) {
        let layout = Layout::new(parts, series);
        for i in 0..self.size {
            self.covariance[i * self.size + layout.offset] = 0.0;
            self.covariance[layout.offset * self.size + i] = 0.0;
        }
    }
}
