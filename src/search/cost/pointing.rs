//! The pointing error: what the rate error adds up to, as a navigator that integrates it sees.
//!
//! ```text
//! ψ(t) = ∫_0^t Ω dt = n κ/(L D) · Σ_j w_j (T_j(t) − T_j(0))                 where Ω is linear in the rates
//! max |ψ| = k_max ∫_0^∞ |G(τ)| dτ                                           over all profiles with |k| ≤ k_max
//! ```
//!
//! | symbol | meaning | unit | in code |
//! |---|---|---|---|
//! | ψ | pointing error | rad | `error_rad` |
//! | w_j, κ, n, L, D | as in [`crate::rate`] | – | – |
//! | G | rate error after a unit step of the drive's rate | rad/s per K/s | as in [`super::guaranteed`] |
//!
//! Only differences of temperature count, not the way to them. What of a model is not linear in the rates is integrated
//! between the profile's instants by Gauss's rule and added.
//!
//! # Source
//! Pointing error thermal sensitivity: Opt. Express 21 (2013) 2521 (by its abstract).

use super::guaranteed::is_linear;
use super::samples::{SampleMatrix, any_rate_model};
use super::worst_case::{PEAK_SHARE, SearchError, SolvedProfile, SolvedProfiles, WorstCase};
use crate::numeric::lobatto::gauss;
use crate::numeric::maximise::golden_section;
use crate::numeric::piecewise::PiecewiseLinear;
use crate::parallel::InParallel;
use crate::pattern::Pattern;
use crate::rate::{CoilModel, RateModel, WeightResponse};
use crate::thermal::{Drive, Instant, StepResponse, ThermalHistory, solve};
use crate::units::{REFERENCE_TEMPERATURE_K, SECONDS_PER_HOUR};

/// One hour: the unit of time by which a pointing error counts as a rate.
pub(crate) const POINTING_S: f64 = SECONDS_PER_HOUR;

/// Ratio of successive times at which the bound over all profiles is summed.
const RATIO: f64 = 1.03;
/// The first of them, in units of the shortest time on which a response changes.
const FIRST: f64 = 1e-2;
/// Of Gauss's rule between two instants.
const POINTS: usize = 4;
/// A rate error that stays at this share of its largest makes a pointing error that grows without end.
const SETTLED: f64 = 1e-6;

/// The linear part of a model: what depends on the rates alone.
fn linear_part(model: &CoilModel) -> Result<CoilModel, SearchError> {
    let coil = model.wound_coil()?;
    let mut linear = model.clone();
    linear.effects.retain(|effect| effect.bind(&coil, &[]).is_linear());
    Ok(linear)
}

/// Changes since the first row in the place of rates.
fn integrated(history: &ThermalHistory) -> ThermalHistory {
    let since = |values: &[f64], columns: usize| -> Vec<f64> {
        let first = values.get(..columns).unwrap_or_default().to_vec();
        values
            .chunks(columns.max(1))
            .flat_map(|row| row.iter().zip(&first).map(|(v, f)| v - f).collect::<Vec<_>>())
            .collect()
    };
    ThermalHistory {
        layers: history.layers,
        times_s: history.times_s.clone(),
        temperature_k: vec![REFERENCE_TEMPERATURE_K; history.temperature_k.len()],
        rate_k_per_s: since(&history.temperature_k, history.layers),
        axial_moment_k: history.axial_moment_k.clone(),
        axial_moment_k_per_s: since(&history.axial_moment_k, history.layers),
        ambient_k: vec![REFERENCE_TEMPERATURE_K; history.ambient_k.len()],
        ambient_rate_k_per_s: since(&history.ambient_k, 1),
    }
}

/// Instants of Gauss's rule between each two rows of a profile, in order, and what each counts in an integral [s].
fn between_rows(profile: &SolvedProfile) -> (ThermalHistory, Vec<f64>) {
    let rule = gauss(POINTS);
    let (mut instants, mut counts_s) = (Vec::new(), Vec::new());
    for pair in profile.history.times_s.windows(2) {
        let (middle_s, half_s) = (0.5 * (pair[0] + pair[1]), 0.5 * (pair[1] - pair[0]));
        instants.extend(rule.iter().map(|(x, _)| Instant::after(middle_s + half_s * x)));
        counts_s.extend(rule.iter().map(|(_, w)| half_s * w));
    }
    (profile.field.at(&instants), counts_s)
}

/// The pointing error of a pattern; its two parts are added where the model is not linear.
#[derive(Debug)]
pub(in crate::search) struct Pointing {
    linear: RateModel,
    /// None where all is linear.
    whole: Option<RateModel>,
}

impl Pointing {
    /// # Errors
    /// A pattern of another layer count.
    pub(in crate::search) fn new(model: &CoilModel, pattern: &Pattern) -> Result<Self, SearchError> {
        let linear = RateModel::new(&linear_part(model)?, pattern, &[])?;
        let whole = if is_linear(model)? { None } else { Some(RateModel::new(model, pattern, &[])?) };
        Ok(Self { linear, whole })
    }

    /// ψ \[rad\] at every instant of a profile.
    fn series_rad(&self, profile: &SolvedProfile) -> Vec<f64> {
        let mut series = self.linear.series_rad_per_s(&integrated(&profile.history));
        if let Some(whole) = &self.whole {
            let (between, counts_s) = between_rows(profile);
            let all = whole.series_after(&between, &mut profile.past(whole));
            let linear = self.linear.series_rad_per_s(&between);
            let rest: Vec<f64> = all.iter().zip(linear).zip(counts_s).map(|((a, l), s)| (a - l) * s).collect();
            let mut sum = 0.0;
            for (psi, rest) in series[1..].iter_mut().zip(rest.chunks(POINTS)) {
                sum += rest.iter().sum::<f64>();
                *psi += sum;
            }
        }
        series
    }

    /// The largest of them by size and its time, between the instants too where the model is linear.
    fn worst_of_series(&self, profile: &SolvedProfile, series: &[f64]) -> (f64, f64) {
        let history = &profile.history;
        let size = |row: usize| series[row].abs();
        let worst = (1..series.len()).fold(0, |best, row| if size(row) > size(best) { row } else { best });
        let found = (series[worst], history.times_s[worst]);
        if self.whole.is_some() || worst == 0 || worst + 1 == series.len() {
            return found;
        }
        let error_at = |time_s: f64| {
            let changes = changes_until(profile, time_s);
            self.linear.rate_error_rad_per_s(&self.linear.state(&changes, 1, &[]))
        };
        let (from_s, to_s) = (history.times_s[worst - 1], history.times_s[worst + 1]);
        let peak = golden_section(|t| error_at(t).abs(), from_s, to_s);
        if peak.value > found.0.abs() { (error_at(peak.at), peak.at) } else { found }
    }

    /// The rate that makes in one hour what ψ is where its size is largest over a profile, and the time of it.
    pub(in crate::search) fn worst(&self, profile: &SolvedProfile) -> (f64, f64) {
        let (error_rad, time_s) = self.worst_of_series(profile, &self.series_rad(profile));
        (error_rad / POINTING_S, time_s)
    }
}

/// Changes since a profile's start: none in the first row, those until a time in the second.
fn changes_until(profile: &SolvedProfile, time_s: f64) -> ThermalHistory {
    let start = Instant::after(profile.history.times_s[0]);
    integrated(&profile.field.at(&[start, Instant::after(time_s)]))
}

/// The largest |ψ| of a pattern over all profiles and times, with its sign, as a [`WorstCase`] in rad.
///
/// # Errors
/// A pattern of another layer count.
pub fn worst_pointing(model: &CoilModel, solved: &SolvedProfiles, pattern: &Pattern) -> Result<WorstCase, SearchError> {
    let pointing = Pointing::new(model, pattern)?;
    let sampled: Vec<Vec<f64>> =
        solved.profiles().iter().in_parallel().map(|profile| pointing.series_rad(profile)).collect();
    let tops: Vec<f64> =
        sampled.iter().map(|series| series.iter().fold(0.0, |most: f64, e| most.max(e.abs()))).collect();
    let least = PEAK_SHARE * tops.iter().copied().fold(0.0, f64::max);
    let contenders: Vec<usize> = (0..tops.len()).filter(|&index| tops[index] >= least).collect();
    let of_each: Vec<WorstCase> = contenders
        .in_parallel()
        .map(|index| {
            let profile = &solved.profiles()[index];
            let (error_rad, time_s) = pointing.worst_of_series(profile, &sampled[index]);
            WorstCase {
                rate_rad_per_s: error_rad,
                profile: profile.profile.name().to_owned(),
                profile_index: index,
                time_s,
            }
        })
        .collect();
    // The first of equals, so that the answer does not depend on the number of threads.
    let mut worst = of_each[0].clone();
    for candidate in of_each {
        if candidate.rate_rad_per_s.abs() > worst.rate_rad_per_s.abs() {
            worst = candidate;
        }
    }
    Ok(worst)
}

/// By how much at most a pattern's ψ \[rad\] is another under another model of the same temperatures, at any instant of the
/// profiles.
///
/// # Errors
/// A pattern of another layer count.
pub(in crate::search) fn largest_change_rad(
    model: &CoilModel,
    other: &CoilModel,
    solved: &SolvedProfiles,
    pattern: &Pattern,
) -> Result<f64, SearchError> {
    let (one, two) = (Pointing::new(model, pattern)?, Pointing::new(other, pattern)?);
    let of_profile = |profile: &SolvedProfile| {
        let series = one.series_rad(profile);
        two.series_rad(profile).iter().zip(series).map(|(b, a)| (b - a).abs()).fold(0.0, f64::max)
    };
    Ok(solved.profiles().iter().in_parallel().map(of_profile).fold(0.0, f64::max))
}

/// The same as the rate that makes it in one hour.
///
/// # Errors
/// As [`worst_pointing`].
pub(in crate::search) fn pointing_as_rate(
    model: &CoilModel,
    solved: &SolvedProfiles,
    pattern: &Pattern,
) -> Result<WorstCase, SearchError> {
    let worst = worst_pointing(model, solved, pattern)?;
    Ok(WorstCase { rate_rad_per_s: worst.rate_rad_per_s / POINTING_S, ..worst })
}

/// ψ of any pattern as what its weights are multiplied by.
#[derive(Debug)]
pub(in crate::search) struct PointingResponses {
    linear: RateModel,
    /// None where all is linear.
    whole: Option<RateModel>,
}

impl PointingResponses {
    /// # Errors
    /// Effects that leave a layer no turns.
    pub(in crate::search) fn new(model: &CoilModel) -> Result<Self, SearchError> {
        let linear = any_rate_model(&linear_part(model)?)?;
        let whole = if is_linear(model)? { None } else { Some(any_rate_model(model)?) };
        Ok(Self { linear, whole })
    }

    /// At every instant of a profile.
    fn of_profile(&self, profile: &SolvedProfile) -> Vec<WeightResponse> {
        let changes = integrated(&profile.history);
        let of_linear =
            |history: &ThermalHistory, row: usize| self.linear.weight_response(&self.linear.state(history, row, &[]));
        let mut of_rows: Vec<WeightResponse> = (0..changes.len()).map(|row| of_linear(&changes, row)).collect();
        if let Some(whole) = &self.whole {
            let (between, counts_s) = between_rows(profile);
            let mut past = profile.past(whole);
            let mut sum = combined(&of_rows[0], 0.0, &of_rows[0], 0.0);
            for (row, &count_s) in counts_s.iter().enumerate() {
                let all = whole.weight_response_after(&whole.state(&between, row, &[]), &mut past);
                let rest = combined(&all, count_s, &of_linear(&between, row), -count_s);
                sum = combined(&sum, 1.0, &rest, 1.0);
                if (row + 1).is_multiple_of(POINTS) {
                    let of_row = &mut of_rows[(row + 1) / POINTS];
                    *of_row = combined(of_row, 1.0, &sum, 1.0);
                }
            }
        }
        of_rows
    }

    /// At a time that [`Pointing::worst`] answered: where the model is not linear, that of one of the instants.
    pub(in crate::search) fn at(&self, profile: &SolvedProfile, time_s: f64) -> WeightResponse {
        let response = if self.whole.is_none() {
            self.linear.weight_response(&self.linear.state(&changes_until(profile, time_s), 1, &[]))
        } else {
            let row = profile.history.times_s.partition_point(|t| *t < time_s);
            let mut of_rows = self.of_profile(profile);
            of_rows.swap_remove(row.min(of_rows.len() - 1))
        };
        combined(&response, 1.0 / POINTING_S, &response, 0.0)
    }
}

/// ψ at every instant of the solved profiles as samples: what a search over the pointing error runs on.
///
/// # Errors
/// Effects that leave a layer no turns.
pub(crate) fn pointing_samples(model: &CoilModel, solved: &SolvedProfiles) -> Result<SampleMatrix, SearchError> {
    let responses = PointingResponses::new(model)?;
    let of_all: Vec<WeightResponse> =
        solved.profiles().iter().in_parallel().flat_map(|profile| responses.of_profile(profile)).collect();
    Ok(SampleMatrix::new(model, &of_all)?)
}

/// a A + b B.
fn combined(one: &WeightResponse, a: f64, other: &WeightResponse, b: f64) -> WeightResponse {
    let of = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| a * x + b * y).collect::<Vec<f64>>();
    WeightResponse {
        half_a_rad_per_s_m2: of(&one.half_a_rad_per_s_m2, &other.half_a_rad_per_s_m2),
        half_b_rad_per_s_m2: of(&one.half_b_rad_per_s_m2, &other.half_b_rad_per_s_m2),
        axial_rad_per_s_m2: of(&one.axial_rad_per_s_m2, &other.axial_rad_per_s_m2),
        constant_rad_per_s: a * one.constant_rad_per_s + b * other.constant_rad_per_s,
    }
}

/// The pack under one endless ramp of a kelvin a second, for the largest |ψ| over all profiles.
#[derive(Debug)]
pub struct EndlessRamp {
    model: CoilModel,
    /// Changes of temperature in the place of rates, and the rates themselves.
    changes: ThermalHistory,
    rates: ThermalHistory,
}

impl EndlessRamp {
    /// None where the model is not linear, or something besides the drive heats the pack.
    ///
    /// # Errors
    /// Heat paths that cannot be solved.
    pub fn new(model: &CoilModel) -> Result<Option<Self>, SearchError> {
        let path = model.heat_path()?;
        if !is_linear(model)? || path.has_own_course() {
            return Ok(None);
        }
        let response = StepResponse::of(&path)?;
        let (first_s, last_s) = (FIRST * response.shortest_s(), response.settling_s());
        let count = ((last_s / first_s).ln() / RATIO.ln()).ceil().max(1.0) as i32;
        let grid = (0..=count).map(|i| first_s * (last_s / first_s).powf(f64::from(i) / f64::from(count)));
        let instants: Vec<Instant> = std::iter::once(0.0).chain(grid).map(Instant::after).collect();
        let end_s = 10.0 * last_s;
        let ramp = PiecewiseLinear::new(vec![0.0, end_s], vec![0.0, end_s])
            .map_err(|_| SearchError::Thermal(crate::thermal::ThermalError::Eigen))?;
        let mut rates = solve(&path, &Drive::boundary(ramp))?.at(&instants);
        // Layers lag behind the drive; what all share has no weight and would only leave rounding.
        let changes = ThermalHistory { ambient_k: vec![0.0; instants.len()], ..rates.clone() };
        let mut changes = integrated(&changes);
        for (row, instant) in instants.iter().enumerate() {
            let layers = row * changes.layers..(row + 1) * changes.layers;
            changes.rate_k_per_s[layers].iter_mut().for_each(|t| *t -= instant.time_s);
            changes.ambient_rate_k_per_s[row] = 0.0;
        }
        rates.temperature_k.fill(REFERENCE_TEMPERATURE_K);
        Ok(Some(Self { model: model.clone(), changes, rates }))
    }

    /// The largest |ψ| \[rad\] over all profiles within a rate; none where a steady ramp leaves a rate error, so that ψ grows
    /// as long as the ramp does.
    ///
    /// # Errors
    /// A pattern of another layer count.
    pub fn guaranteed_rad(&self, pattern: &Pattern, max_rate_k_per_s: f64) -> Result<Option<f64>, SearchError> {
        let rate_model = RateModel::new(&self.model, pattern, &[])?;
        let rates = rate_model.series_rad_per_s(&self.rates);
        let largest = rates.iter().map(|g| g.abs()).fold(0.0, f64::max);
        if rates.last().is_some_and(|last| last.abs() > SETTLED * largest) {
            return Ok(None);
        }
        let errors = rate_model.series_rad_per_s(&self.changes);
        Ok(Some(max_rate_k_per_s * errors.windows(2).map(|e| (e[1] - e[0]).abs()).sum::<f64>()))
    }
}
