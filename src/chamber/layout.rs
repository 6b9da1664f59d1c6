//! What of a model the system depends on, its numbers, and where each of its states stands.

use super::prior::{PRIORS, Quantity};
use super::row::Film;
use super::series::Series;
use super::shows::Shows;
use crate::thermal::reduced::Reduced;

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

    /// The ratio of a film to the usual one.
    pub(super) fn film_ratio(&self, film: Film) -> f64 {
        match film {
            Film::Usual => 1.0,
            Film::Switched => self.get(Quantity::FilmRatio),
        }
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

/// Where each state stands.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    pub(crate) modes: usize,
    pub(super) skin: Option<usize>,
    /// Level of the air's trend; its slope is the next.
    pub(crate) trend: usize,
    /// Where the air follows a set point: the slope's own rate, and next the set point's slope.
    pub(super) control: Option<usize>,
    /// Whether the air approaches a set point, its slope dying away.
    pub(super) approaches: bool,
    /// Where it does so with a delay: the slope that the stage asks for, which the air's takes on.
    pub(super) onset: Option<usize>,
    pub(crate) turbulence: usize,
    pub(crate) ripple: usize,
    /// What drives the ripple.
    pub(super) driver: usize,
    pub(super) lag: Option<usize>,
    pub(super) wander: usize,
    pub(super) drift: Option<usize>,
    pub(super) cycle: Option<usize>,
    pub(super) offset: usize,
    /// What the rate's window began with; two where windows overlap.
    pub(super) windows: [usize; 2],
    /// What readings were where a window begins; only where readings are averaged.
    pub(super) reading: Option<usize>,
    pub(crate) size: usize,
}

/// What of a record asks for states of its own.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct RecordKind {
    /// Windows of its rates overlap.
    pub(super) overlaps: bool,
    /// Its readings are means.
    pub(super) averaged: bool,
    /// Its air takes time to take on another slope.
    pub(super) controlled: bool,
    /// … or that slope dies away, at once or taken on with a delay.
    pub(super) approaches: bool,
    pub(super) delays: bool,
}

impl Layout {
    pub(crate) fn new(parts: &Parts, series: &Series) -> Self {
        let (overlaps, averaged) = (series.overlaps, series.averaged > 1);
        let (controlled, approaches, delays) = (series.controlled, series.approaches, series.delays);
        Self::with(parts, &RecordKind { overlaps, averaged, controlled, approaches, delays })
    }

    pub(crate) fn with(parts: &Parts, record: &RecordKind) -> Self {
        let mut size = 0;
        let mut take = |count: usize| {
            size += count;
            size - count
        };
        let modes = take(parts.reduced.modes());
        let _ = modes;
        let skin = parts.skin_s.map(|_| take(1));
        let trend = take(2);
        let control = record.controlled.then(|| take(2));
        let onset = (record.approaches && record.delays).then(|| take(1));
        let (turbulence, ripple, driver) = (take(1), take(2), take(2));
        let lag = (parts.lag_s > 0.0).then(|| take(1));
        let wander = take(1);
        let drift = parts.drift.then(|| take(1));
        let cycle = parts.cycle.then(|| take(2));
        let (offset, window) = (take(1), take(1));
        let windows = [window, if record.overlaps { take(1) } else { window }];
        let reading = record.averaged.then(|| take(1));
        let modes = parts.reduced.modes();
        Self {
            modes,
            skin,
            trend,
            control,
            approaches: record.approaches,
            onset,
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

    /// The slope that kinks change: the air's own, or what it takes on.
    pub(super) fn kinked_slope(&self) -> usize {
        self.onset.unwrap_or(self.trend + 1)
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

    /// An output's row over the states; `drive`: what the modes follow ([`super::film::drive`]).
    pub(crate) fn output(&self, reduced: &Reduced, output: usize, drive: &[f64]) -> Vec<f64> {
        let mut row: Vec<f64> = drive.iter().map(|d| reduced.residue[output] * d).collect();
        row.iter_mut().zip(reduced.row(output)).for_each(|(r, a)| *r += a);
        row
    }

    pub(crate) fn air_row(&self) -> Vec<f64> {
        let mut row = vec![0.0; self.size];
        self.air().into_iter().for_each(|i| row[i] = 1.0);
        row
    }
}
