//! The state-space model of air, film, pack and sensor.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use nalgebra::DMatrix;

use super::filmed::{Filmed, transition};
use super::layout::{Layout, Shock};
use super::{Air, BoundaryError, Kink, Observation};
use crate::numeric::exponential::exponential;
use crate::numeric::piecewise::PiecewiseLinear;
use crate::numeric::state_space::{Measurement, Smoothed, Stage, StateSpace};
use crate::thermal::{self, BoreHeat, Drive, Extent, HeatPath, Instant, Location, Material};

/// Where only K = k/ρc is known, the film is stated for this heat capacity [J/(m³ K)]; nothing else depends on it.
const NOMINAL_HEAT_CAPACITY_J_PER_M3_K: f64 = 1.7e6;
/// Prior variance of a kink [(K/s)²]: wider than any chamber's ramp.
pub(super) const KINK_VARIANCE_K2_PER_S2: f64 = 1e-3;
/// How steady a record is taken to begin: variances of the slope [(K/s)²] and of the modes [K²].
const START_SLOPE_VARIANCE_K2_PER_S2: f64 = 1e-10;
const START_MODE_VARIANCE_K2: f64 = 1e-6;
/// Prior variance of the first temperature [K²]: the first reading says far more.
const START_TEMPERATURE_VARIANCE_K2: f64 = 1.0;
/// Prior variances of jerk and curvature are what they wander in this time [s].
const START_MEMORY_S: f64 = 1000.0;
/// A lag shorter than this share of the interval cannot be seen.
const SHORTEST_LAG_PER_INTERVAL: f64 = 0.02;
/// Where rates are instantaneous, they are taken over this share of the interval.
const INSTANT_PER_INTERVAL: f64 = 0.1;
/// Knots of the reconstructed boundary are no further apart than this share of the interval …
const KNOT_PER_INTERVAL: f64 = 0.5;
/// … and right after a kink, where the outermost layer sets out along t^(3/2), than this, and this share of the time since.
const KNOT_AFTER_KINK_PER_INTERVAL: f64 = 0.1;
const KNOT_PER_TIME_SINCE_KINK: f64 = 0.03;
/// In a longer gap between readings the air is taken to have moved on for so long only [s]: it has then wandered as far as it may
/// have before a record began, and a variance that grows with the seventh power of time would leave no digit of the readings'.
const LONGEST_GAP_S: f64 = START_MEMORY_S;
/// Two times closer than this are one [s].
pub(super) const SAME_TIME_S: f64 = 1e-6;

/// What stays the same while a record's boundary is estimated.
#[derive(Debug, Clone)]
pub(super) struct Scene {
    pub times_s: Vec<f64>,
    pub temperature_k: Vec<f64>,
    pub interval_s: f64,
    pub location: Location,
    path: HeatPath,
    /// Into the bore, where it warms what the sensor is attached to.
    bore_heat: Option<BoreHeat>,
    /// What a conductivity that depends on temperature does to the outermost layer.
    bent_k: Option<PiecewiseLinear>,
    lag_s: f64,
    layer_gain_rad_per_k: Vec<f64>,
    rate_mean_s: f64,
    /// What the film asked for last makes of the pack.
    last: Arc<Mutex<Option<Arc<Filmed>>>>,
}

/// A state-space model with what its states and stages mean.
pub(super) struct AirSpace {
    pub space: StateSpace,
    layout: Layout,
    /// Stage of each kink, of each reading.
    pub kink_stages: Vec<usize>,
    pub reading_stages: Vec<usize>,
    /// Which measurement is the rate of each row; empty without rates.
    pub rate_places: Vec<usize>,
    stage_times_s: Vec<f64>,
    outer: Vec<f64>,
    /// By how much heat from the bore and a conductivity's slope warm the outermost layer.
    added_k: Option<PiecewiseLinear>,
    /// Change of the rate functional over the window, per window.
    rate_row: Vec<f64>,
    dynamics: DMatrix<f64>,
}

/// What a stage is there for.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Event {
    WindowStart,
    Reading(usize),
    Kink(usize),
}

/// Whether and how rates are measured too.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Rates {
    None,
    /// Only their variance is asked for.
    Predicted,
    Measured {
        noise_rad_per_s: f64,
    },
}

pub(super) struct Reconstruction {
    pub outer_k: PiecewiseLinear,
    pub air_k: PiecewiseLinear,
    pub rate_variance_rad2_per_s2: Vec<f64>,
    pub log_likelihood: f64,
}

/// A path as a pack in the air, where a film stands in front of it.
pub(super) fn behind_film(path: &HeatPath) -> HeatPath {
    let mut path = HeatPath { extent: Extent::Pack, location: Location::Ambient, ..path.clone() };
    if let Material::Diffusivity { m2_per_s } = path.material {
        path.material = Material::Conductivity {
            w_per_m_k: m2_per_s * NOMINAL_HEAT_CAPACITY_J_PER_M3_K,
            heat_capacity_j_per_m3_k: NOMINAL_HEAT_CAPACITY_J_PER_M3_K,
        };
    }
    path
}

impl Scene {
    pub fn new(observation: &Observation) -> Result<Self, BoundaryError> {
        let location = observation.path.location;
        let mut path = behind_film(observation.path);
        let bore_heat = path.bore_heat.take().filter(|_| location == Location::OuterLayer);
        path.conductivity_slope_per_k = 0.0;
        let mut steps: Vec<f64> = observation.times_s.windows(2).map(|w| w[1] - w[0]).collect();
        steps.sort_by(f64::total_cmp);
        let interval_s = steps[steps.len() / 2];
        let lag_s = if observation.lag_s < SHORTEST_LAG_PER_INTERVAL * interval_s { 0.0 } else { observation.lag_s };
        Ok(Self {
            times_s: observation.times_s.to_vec(),
            temperature_k: observation.temperature_k.to_vec(),
            interval_s,
            location,
            path,
            bore_heat,
            bent_k: None,
            lag_s,
            layer_gain_rad_per_k: observation.layer_gain_rad_per_k.to_vec(),
            rate_mean_s: observation.rate_mean_s,
            last: Arc::default(),
        })
    }

    /// With what a conductivity's slope adds to the outermost layer.
    pub fn bent(self, bent_k: PiecewiseLinear) -> Self {
        Self { bent_k: Some(bent_k), last: Arc::default(), ..self }
    }

    pub fn lag_s(&self) -> f64 {
        self.lag_s
    }

    /// Only temperatures are measured.
    pub fn space(&self, air: &Air) -> Result<AirSpace, BoundaryError> {
        self.build(air, Rates::None)
    }

    /// Rates are measured too.
    pub fn joint_space(&self, air: &Air, noise_rad_per_s: f64) -> Result<AirSpace, BoundaryError> {
        self.build(air, Rates::Measured { noise_rad_per_s })
    }

    /// What the linear path to the air leaves out of the outermost layer's temperature.
    fn added_k(&self, path: &HeatPath) -> Result<Option<PiecewiseLinear>, BoundaryError> {
        let Some(bent_k) = &self.bent_k else { return self.warmed_k(path) };
        let Some(warmed_k) = self.warmed_k(path)? else { return Ok(Some(bent_k.clone())) };
        let sums = self.times_s.iter().map(|&t| bent_k.value(t) + warmed_k.value(t)).collect();
        Ok(Some(PiecewiseLinear::new(self.times_s.clone(), sums).expect("readings are in order")))
    }

    /// What the bore's heat adds to the outermost layer behind a film, the air standing still.
    fn warmed_k(&self, path: &HeatPath) -> Result<Option<PiecewiseLinear>, BoundaryError> {
        let Some(heat) = self.bore_heat else { return Ok(None) };
        let heated = HeatPath { bore_heat: Some(heat), ..path.clone() };
        let cold = PiecewiseLinear::new(vec![self.times_s[0]], vec![0.0]).expect("one knot is in order");
        let instants: Vec<Instant> = self.times_s.iter().map(|&t| Instant::after(t)).collect();
        let field = thermal::solve(&heated, &Drive::boundary(cold))?.at(&instants);
        let outermost = (0..instants.len()).map(|row| field.temperatures_k(row)[path.shape.layers - 1]).collect();
        Ok(Some(PiecewiseLinear::new(self.times_s.clone(), outermost).expect("readings are in order")))
    }

    /// The pack behind a film, kept until another film is asked for.
    fn filmed(&self, film_w_per_m2_k: Option<f64>) -> Result<Arc<Filmed>, BoundaryError> {
        if let Ok(last) = self.last.lock()
            && let Some(known) = last.as_ref().filter(|l| l.film_w_per_m2_k == film_w_per_m2_k)
        {
            return Ok(known.clone());
        }
        let mut path = self.path.clone();
        if film_w_per_m2_k.is_some() {
            path.film_w_per_m2_k = film_w_per_m2_k;
        }
        let filmed = Arc::new(Filmed::new(film_w_per_m2_k, &path, self.added_k(&path)?, self.interval_s)?);
        if let Ok(mut last) = self.last.lock() {
            *last = Some(filmed.clone());
        }
        Ok(filmed)
    }

    fn build(&self, air: &Air, rates: Rates) -> Result<AirSpace, BoundaryError> {
        let with_rate = rates != Rates::None;
        let filmed = self.filmed(air.film_w_per_m2_k)?;
        let Filmed { pack, order, kept, added_k, .. } = &*filmed;
        let kept = *kept;
        let layout = Layout { modes: kept, lagging: self.lag_s > 0.0, with_rate };
        let n = layout.size();

        let layer_row = |layer: usize| {
            let mut row = vec![0.0; n];
            row[layout.temperature()] = 1.0;
            for (state, &mode) in order.iter().enumerate() {
                let amplitude = pack.amplitude(layer, mode);
                if state < kept {
                    row[state] = -amplitude;
                } else {
                    row[layout.slope()] -= amplitude / pack.decays_per_s()[mode];
                }
            }
            row
        };
        let outer = layer_row(self.path.shape.layers - 1);
        let seen = match self.location {
            Location::OuterLayer => outer.clone(),
            Location::Ambient => {
                let mut row = vec![0.0; n];
                row[layout.temperature()] = 1.0;
                row
            }
        };

        let moving = layout.moving();
        let mut dynamics = DMatrix::zeros(moving, moving);
        for (state, &mode) in order.iter().take(kept).enumerate() {
            dynamics[(state, state)] = -pack.decays_per_s()[mode];
            dynamics[(state, layout.slope())] = 1.0;
        }
        dynamics[(layout.temperature(), layout.slope())] = 1.0;
        dynamics[(layout.slope(), layout.curvature())] = 1.0;
        dynamics[(layout.curvature(), layout.jerk())] = 1.0;
        let mut sensor = seen.clone();
        if layout.lagging {
            // d' = (T_seen − a − d)/τ − s, the reading being a + d.
            for state in 0..moving {
                dynamics[(layout.lag(), state)] = seen[state] / self.lag_s;
            }
            dynamics[(layout.lag(), layout.temperature())] -= 1.0 / self.lag_s;
            dynamics[(layout.lag(), layout.lag())] -= 1.0 / self.lag_s;
            dynamics[(layout.lag(), layout.slope())] -= 1.0;
            sensor = vec![0.0; n];
            sensor[layout.temperature()] = 1.0;
            sensor[layout.lag()] = 1.0;
        }

        let window_s = self.window_s();
        let mut functional = vec![0.0; n];
        for (layer, gain) in self.layer_gain_rad_per_k.iter().enumerate() {
            for (f, r) in functional.iter_mut().zip(layer_row(layer)) {
                *f += gain * r;
            }
        }
        let mut rate_row: Vec<f64> = functional.iter().map(|f| f / window_s).collect();
        if with_rate {
            rate_row[layout.window_start()] = -1.0 / window_s;
        }

        let mut rows = vec![sensor];
        let mut rate_places = Vec::new();
        if let Rates::Measured { noise_rad_per_s } = rates {
            rows.push(rate_row.iter().map(|r| r / noise_rad_per_s).collect());
        }

        let events = self.events(&air.kinks, with_rate);
        let mut transitions = Vec::new();
        let mut known: HashMap<(u64, bool), usize> = HashMap::new();
        let mut stages = Vec::with_capacity(events.len());
        let mut kink_stages = vec![0; air.kinks.len()];
        let mut reading_stages = vec![0; self.times_s.len()];
        let mut taken = 0;
        for (index, &(time_s, event)) in events.iter().enumerate() {
            let mut measurements = Vec::new();
            let mut disturbances = Vec::new();
            let step_s = events.get(index + 1).map_or(0.0, |next| (next.0 - time_s).min(LONGEST_GAP_S));
            let mut begins_window = event == Event::WindowStart;
            match event {
                Event::Reading(reading) => {
                    reading_stages[reading] = index;
                    // Warming takes far longer than the sensor's lag.
                    let added_k =
                        added_k.as_ref().map_or(0.0, |w| w.value(time_s) - self.lag_s * w.slope_before(time_s));
                    measurements.push(Measurement {
                        row: 0,
                        value: self.temperature_k[reading] - added_k,
                        variance: air.noise_k * air.noise_k,
                    });
                    taken += 1;
                    if matches!(rates, Rates::Measured { .. }) {
                        measurements.push(Measurement { row: 1, value: 0.0, variance: 1.0 });
                        rate_places.push(taken);
                        taken += 1;
                    }
                    // Without a stage of its own the next window begins here.
                    begins_window = true;
                }
                Event::Kink(kink) => {
                    kink_stages[kink] = index;
                    disturbances.push((Shock::Slope as usize, KINK_VARIANCE_K2_PER_S2));
                    let slack_k = air.kinks[kink].slope_change_k_per_s * self.interval_s;
                    disturbances.push((Shock::Earlier as usize, slack_k * slack_k));
                }
                Event::WindowStart => {}
            }
            disturbances.push((Shock::Jerk as usize, air.jerk_noise_k2_per_s7 * step_s));
            let key = ((step_s / SAME_TIME_S).round() as u64, begins_window);
            let transition = *known.entry(key).or_insert_with(|| {
                let exponential = filmed.exponential(&dynamics, step_s);
                transitions.push(transition(&exponential, layout, begins_window.then_some(&functional[..])));
                transitions.len() - 1
            });
            stages.push(Stage { measurements, disturbances, transition });
        }

        let mut mean = vec![0.0; n];
        mean[layout.temperature()] = self.temperature_k[0];
        let mut covariance = DMatrix::<f64>::zeros(n, n);
        for state in 0..layout.temperature() {
            covariance[(state, state)] = START_MODE_VARIANCE_K2;
        }
        covariance[(layout.temperature(), layout.temperature())] = START_TEMPERATURE_VARIANCE_K2;
        covariance[(layout.slope(), layout.slope())] = START_SLOPE_VARIANCE_K2_PER_S2;
        covariance[(layout.jerk(), layout.jerk())] = START_MEMORY_S * air.jerk_noise_k2_per_s7;
        covariance[(layout.curvature(), layout.curvature())] = START_MEMORY_S.powi(3) * air.jerk_noise_k2_per_s7;
        if with_rate {
            // The window before the first stamp ends where it began: steady.
            let start = layout.window_start();
            mean[start] = (0..start).map(|i| functional[i] * mean[i]).sum();
            let spread: Vec<f64> =
                (0..start).map(|i| (0..start).map(|j| covariance[(i, j)] * functional[j]).sum()).collect();
            for (i, &s) in spread.iter().enumerate() {
                covariance[(start, i)] = s;
                covariance[(i, start)] = s;
            }
            covariance[(start, start)] = (0..start).map(|i| functional[i] * spread[i]).sum();
        }
        let mut directions = vec![vec![0.0; n]; Shock::COUNT];
        directions[Shock::Jerk as usize][layout.jerk()] = 1.0;
        directions[Shock::Slope as usize][layout.slope()] = 1.0;
        for state in 0..moving {
            directions[Shock::Earlier as usize][state] = dynamics[(state, layout.slope())];
        }
        let space = StateSpace {
            size: n,
            rows,
            directions,
            transitions,
            stages,
            mean,
            covariance: covariance.as_slice().to_vec(),
        };
        Ok(AirSpace {
            space,
            layout,
            kink_stages,
            reading_stages,
            rate_places,
            added_k: added_k.clone(),
            stage_times_s: events.iter().map(|e| e.0).collect(),
            outer,
            rate_row,
            dynamics,
        })
    }

    /// The interval over which a rate is the mean, as far as the variance of its prediction goes.
    fn window_s(&self) -> f64 {
        if self.rate_mean_s <= 0.0 {
            INSTANT_PER_INTERVAL * self.interval_s
        } else {
            self.rate_mean_s.min(self.interval_s)
        }
    }

    /// Readings, kinks and (where no reading is there) beginnings of windows, in the order of time.
    fn events(&self, kinks: &[Kink], with_rate: bool) -> Vec<(f64, Event)> {
        let mut events: Vec<(f64, Event)> = Vec::with_capacity(2 * self.times_s.len() + kinks.len());
        let window_s = self.window_s();
        for (reading, &time_s) in self.times_s.iter().enumerate() {
            if with_rate && reading > 0 {
                let start_s = time_s - window_s;
                if start_s > self.times_s[reading - 1] + 1e-3 * window_s {
                    events.push((start_s, Event::WindowStart));
                }
            }
            events.push((time_s, Event::Reading(reading)));
        }
        events.extend(kinks.iter().enumerate().map(|(i, k)| (k.time_s, Event::Kink(i))));
        events.sort_by(|a, b| a.0.total_cmp(&b.0));
        events
    }

    /// The boundary and the variance of the predicted rates.
    pub fn reconstruct(&self, air: &Air) -> Result<Reconstruction, BoundaryError> {
        let built = self.build(air, Rates::Predicted)?;
        let smoothed = built.space.smooth(&built.rate_row);
        let layout = built.layout;
        let n = layout.size();
        let mut kink_s = f64::NEG_INFINITY;
        let (mut knots_s, mut outer_k, mut air_k) = (Vec::new(), Vec::new(), Vec::new());
        let mut push = |time_s: f64, state: &[f64]| {
            if knots_s.last().is_none_or(|&last: &f64| time_s > last + 1e3 * SAME_TIME_S) {
                knots_s.push(time_s);
                let added_k = built.added_k.as_ref().map_or(0.0, |w| w.value(time_s));
                outer_k.push(added_k + state.iter().zip(&built.outer).map(|(x, o)| x * o).sum::<f64>());
                air_k.push(state[layout.temperature()]);
            }
        };
        let mut between: HashMap<u64, Vec<f64>> = HashMap::new();
        for (stage, &time_s) in built.stage_times_s.iter().enumerate() {
            let state = &smoothed.states[stage * n..stage * n + layout.moving()];
            push(time_s, state);
            let Some(&next_s) = built.stage_times_s.get(stage + 1) else { break };
            if built.kink_stages.contains(&stage) {
                kink_s = time_s;
            }
            if next_s - time_s > LONGEST_GAP_S {
                // A straight line is as good as any.
                continue;
            }
            let since_kink_s = time_s - kink_s;
            let near_s = KNOT_AFTER_KINK_PER_INTERVAL * self.interval_s + KNOT_PER_TIME_SINCE_KINK * since_kink_s;
            let longest_s = near_s.min(KNOT_PER_INTERVAL * self.interval_s);
            let pieces = ((next_s - time_s) / longest_s - 1e-9).ceil().clamp(1.0, 64.0) as usize;
            if pieces < 2 {
                continue;
            }
            // Disturbances enter right after the stage: read them off the next state's kink.
            let mut from = state.to_vec();
            let shock = built.shock(&smoothed, stage);
            for (x, w) in from.iter_mut().zip(shock) {
                *x += w;
            }
            let step_s = (next_s - time_s) / pieces as f64;
            let key = (step_s / SAME_TIME_S).round() as u64;
            let step = between.entry(key).or_insert_with(|| {
                transition(&exponential(&(&built.dynamics * step_s)), Layout { with_rate: false, ..layout }, None)
            });
            for piece in 1..pieces {
                from =
                    step.chunks_exact(layout.moving()).map(|r| r.iter().zip(&from).map(|(a, b)| a * b).sum()).collect();
                push(time_s + piece as f64 * step_s, &from);
            }
        }
        let rate_variance_rad2_per_s2 =
            built.reading_stages.iter().map(|&stage| smoothed.functional_variance[stage]).collect();
        let series = |values: Vec<f64>| {
            PiecewiseLinear::new(knots_s.clone(), values).expect("knots increase and states are finite")
        };
        Ok(Reconstruction {
            outer_k: series(outer_k),
            air_k: series(air_k),
            rate_variance_rad2_per_s2,
            log_likelihood: smoothed.log_likelihood,
        })
    }
}

impl AirSpace {
    /// The expected disturbance of each moving state right after a stage.
    fn shock(&self, smoothed: &Smoothed, stage: usize) -> Vec<f64> {
        let mut shock = vec![0.0; self.layout.moving()];
        for &(direction, variance) in &self.space.stages[stage].disturbances {
            let size = variance * smoothed.score[stage * Shock::COUNT + direction];
            for (s, d) in shock.iter_mut().zip(&self.space.directions[direction]) {
                *s += size * d;
            }
        }
        shock
    }
}
