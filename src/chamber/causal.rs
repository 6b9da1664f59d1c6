//! The chamber as a filter meets it that sees one thermometer row by row: the same system, the gyro's own states left out.

use super::film::drive;
use super::fit::Fit;
use super::layout::{Layout, Numbers, OutputGains, Parts, RecordKind};
use super::learned::Learned;
use super::parameter::Place;
use super::prior::{PRIORS, Quantity};

use super::shows::Shows;
use super::system::{driven_by_air, dynamics, places, response};
use super::{Chamber, HALF_SPACE_MODES, modes_of_pack};
use crate::thermal::reduced::Reduced;
use crate::thermal::{Extent, HeatPath, ThermalError};

/// Chamber, sensor and film in numbers.
#[derive(Debug, Clone)]
pub(crate) struct Surroundings {
    pub(crate) film_w_per_m2_k: f64,
    numbers: Numbers,
}

impl Surroundings {
    /// What is likely of any chamber.
    pub(crate) fn usual() -> Self {
        let mut numbers = Numbers([f64::NAN; PRIORS.len()]);
        for prior in &PRIORS {
            // The gyro's own numbers are relative to a noise that is not there.
            numbers.set(prior.quantity, prior.median);
        }
        Self { film_w_per_m2_k: Quantity::Film.prior().median, numbers }
    }

    /// What a model file states of them.
    pub(crate) fn learned(learned: &Learned) -> Self {
        let mut usual = Self::usual();
        if let Some(film) = learned.film_w_per_m2_k {
            usual.film_w_per_m2_k = film.value;
        }
        learned.numbers.iter().for_each(|(quantity, estimate)| usual.numbers.set(*quantity, estimate.value));
        usual
    }

    /// With this density of the noise of the air's slope between its breaks.
    pub(crate) fn wandering(&self, rest_noise_k2_per_s3: f64) -> Self {
        let mut other = self.clone();
        other.numbers.set(Quantity::RestNoise, rest_noise_k2_per_s3);
        other
    }

    /// What several records of one gyro say together: the film by the relative error that each has of it, of all else the middle
    /// of logarithms.
    ///
    /// None of no record.
    pub(crate) fn together(seen: &[(Self, f64)]) -> Option<Self> {
        let (first, _) = seen.first()?;
        if seen.len() == 1 {
            return Some(first.clone());
        }
        let weight = |error: f64| error.max(LEAST_FILM_ERROR).powi(-2);
        let weights: f64 = seen.iter().map(|(_, error)| weight(*error)).sum();
        let film: f64 = seen.iter().map(|(s, error)| weight(*error) / weights * s.film_w_per_m2_k.ln()).sum();
        let middle = |place: usize| {
            let logarithms = seen.iter().map(|(s, _)| s.numbers.0[place].ln());
            (logarithms.sum::<f64>() / seen.len() as f64).exp()
        };
        Some(Self { film_w_per_m2_k: film.exp(), numbers: Numbers(std::array::from_fn(middle)) })
    }

    /// Standard deviation of one reading besides the sensor's resolution \[K\].
    pub(crate) fn reading_noise_k(&self) -> f64 {
        self.numbers.get(Quantity::ReadingNoise)
    }

    /// Density of the noise of the air's slope between its breaks \[K²/s³\].
    pub(crate) fn rest_noise_k2_per_s3(&self) -> f64 {
        self.numbers.get(Quantity::RestNoise)
    }
}

/// No film is known better than this, relative to itself: the air of a chamber moves another way every day.
const LEAST_FILM_ERROR: f64 = 0.01;

impl Chamber<'_> {
    /// How well a fitted record knows the film, relative to it.
    pub(crate) fn film_error(fit: &Fit) -> f64 {
        let film = fit.value(Place::Quantity { quantity: Quantity::Film, record: None });
        film.map_or(1.0, |(value, error)| error / value)
    }

    /// The surroundings of a fitted record.
    pub(crate) fn surroundings(&self, fit: &Fit, record: usize) -> Surroundings {
        let mut numbers = self.numbers_for(fit, record);
        // Resolution is noise to a filter.
        let noise = numbers.get(Quantity::ReadingNoise).hypot(self.resolution_k(record) / 12f64.sqrt());
        numbers.set(Quantity::ReadingNoise, noise);
        let film = fit.value(Place::Quantity { quantity: Quantity::Film, record: None });
        Surroundings { film_w_per_m2_k: film.map_or(Quantity::Film.prior().median, |f| f.0), numbers }
    }
}

/// Pack, film, air and sensor as x' = F x + noise.
///
/// # Shapes
/// `dynamics` row-major states × states; `noise`, `functional` and `reading` one entry a state.
#[derive(Debug, Clone)]
pub(crate) struct Causal {
    pub(crate) states: usize,
    pub(crate) dynamics: Vec<f64>,
    /// Densities of the white noises that drive the states, but for the slope's.
    pub(crate) noise: Vec<f64>,
    /// The integral of the rate error \[rad/K\].
    pub(crate) functional: Vec<f64>,
    pub(crate) reading: Vec<f64>,
    /// Row-major layers × states: each layer's temperature.
    pub(crate) layers: Vec<f64>,
    /// The states that are a temperature: in equilibrium all show the air's.
    pub(crate) level_states: Vec<usize>,
    pub(crate) slope: usize,
}

/// The longest time that a half space's response is fitted to \[s\].
const LONGEST_S: f64 = 1e5;

impl Causal {
    /// For rows `row_s` apart; `layer_gains` and `air_gain` are dΩ/dṪ_j and dΩ/dȧ.
    ///
    /// # Errors
    /// A heat path that cannot be solved.
    pub(crate) fn new(
        path: &HeatPath,
        layer_gains: &[f64],
        air_gain: f64,
        lag_s: f64,
        surroundings: &Surroundings,
        row_s: f64,
    ) -> Result<Self, ThermalError> {
        let shows = Shows::of(path.location);
        let own = path.film_w_per_m2_k.unwrap_or(f64::INFINITY);
        let film = if path.film_is_unknown() { surroundings.film_w_per_m2_k } else { own };
        let (driven, skin_s) = driven_by_air(path, film);
        let modes = if path.extent == Extent::HalfSpace { HALF_SPACE_MODES } else { modes_of_pack(&driven, row_s)? };
        let reduced = Reduced::new(&driven, path.sensors_part(), modes, row_s, LONGEST_S)?;
        let mut outputs = layer_gains.to_vec();
        outputs.resize(reduced.outputs, 0.0);
        let gains = OutputGains { outputs, air: air_gain };
        let parts = Parts { reduced: &reduced, gains: &gains, skin_s, shows, lag_s, drift: false, cycle: false };
        let layout = Layout::with(&parts, &RecordKind::default());
        let mut numbers = surroundings.numbers;
        // Only the gyro's own states hang on these.
        [Quantity::RateNoise, Quantity::WanderShare, Quantity::WanderTime]
            .into_iter()
            .for_each(|q| numbers.set(q, 1.0));
        // Which set point a stream's air approaches nobody knows.
        let (f, noise, _) = dynamics(&parts, &layout, &numbers, 1.0);
        let drive = drive(&layout, &reduced, 1.0);
        let (all, n) = (layout.size, layout.own());
        let level = |row: &[f64]| row[..n].to_vec();
        Ok(Self {
            states: n,
            dynamics: f.chunks_exact(all).take(n).flat_map(|row| row[..n].to_vec()).collect(),
            noise: noise[..n].to_vec(),
            functional: level(&response(&parts, &layout, &drive)),
            reading: level(&places(&parts, &layout, &drive)[0]),
            layers: (0..reduced.layers).flat_map(|layer| level(&layout.output(&reduced, layer, &drive))).collect(),
            level_states: layout.levels().collect(),
            slope: layout.trend + 1,
        })
    }
}
