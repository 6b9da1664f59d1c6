//! The worst rate error of a pattern over a set of profiles: the reference value that is reported.
//!
//! The supremum is taken over all times, both one-sided limits at every break point of a profile included, because
//! the outermost layer's rate jumps there. Between break points the error is sampled on a grid that is fine where the
//! field changes fast, and each local maximum of |Ω| is refined by golden-section search on the exact field.
//!
//! A profile ends where its last piece ends: what is to count afterwards is declared as a soak. Where electronics heat the
//! bore or a bias follows the pack's temperature the error can still grow then, which [`SolvedProfiles::after_the_ends`]
//! shows.

use std::sync::Arc;

use thiserror::Error;

use crate::coil::CoilError;
use crate::numeric::maximise::golden_section;
use crate::parallel::InParallel;
use crate::pattern::Pattern;
use crate::pattern::windability::WindabilityClass;
use crate::profile::{Piece, Profile};
use crate::rate::{CoilModel, Past, RateError, RateModel, WeightResponse};
use crate::thermal::{Drive, Field, HeatPath, Instant, Solver, StepResponse, ThermalError, ThermalHistory};
use crate::units::{REFERENCE_TEMPERATURE_K, RotationRate};

/// Why patterns cannot be judged on profiles.
#[derive(Debug, Error, Clone, PartialEq)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum SearchError {
    #[error(transparent)]
    Thermal(#[from] ThermalError),
    #[error(transparent)]
    Rate(#[from] RateError),
    #[error(transparent)]
    Coil(#[from] CoilError),
    #[error("there is no profile to search over: list one in [profiles] or set profiles.count above 0")]
    NoProfiles,
    #[error(
        "the rate error is not a finite number under profile {profile} at {time_s} s: check the effects' parameters"
    )]
    NotFinite { profile: String, time_s: f64 },
    #[error("winding.layers must be at most {most} for a proof, found {found}: use optimise without --prove")]
    TooManyLayers { found: usize, most: usize },
    #[error("a proof must begin with a pattern of the class {class}, found none: give one of that class")]
    NoStart { class: WindabilityClass },
}

/// The fields of all profiles, solved once: they do not depend on the pattern.
#[derive(Debug)]
pub struct SolvedProfiles {
    profiles: Vec<SolvedProfile>,
}

/// A profile and the pack's temperatures under it.
#[derive(Debug)]
pub struct SolvedProfile {
    pub(crate) profile: Profile,
    /// The same for every pattern.
    pub field: Arc<Field>,
    /// One list of instants a piece, from just after its start to just before its end.
    pub(crate) pieces: Vec<Vec<Instant>>,
    /// The field at all of them, in order.
    pub(crate) history: ThermalHistory,
    /// What came before the first of them, where something remembers it; empty elsewhere.
    lead: ThermalHistory,
}

/// Where and how large the rate error of a pattern is largest.
#[derive(Debug, Clone, PartialEq)]
pub struct WorstCase {
    /// With its sign.
    pub rate_rad_per_s: f64,
    /// The profile's name.
    pub profile: String,
    pub(crate) profile_index: usize,
    /// From the profile's start.
    pub time_s: f64,
}

impl std::fmt::Display for WorstCase {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let size = RotationRate { rad_per_s: self.rate_rad_per_s.abs() };
        write!(f, "{size:.4} at {:.1} s of {}", self.time_s, self.profile)
    }
}

/// Points a piece: close to its start, where layers respond one after the other, and then wider apart.
const POINTS_PER_PIECE: usize = 96;

/// A local maximum between samples exceeds its neighbours by a few per cent only: below this share of the largest sample it is not
/// the largest.
pub(super) const PEAK_SHARE: f64 = 0.9;

/// Where an effect remembers, instants are no wider apart than this share of a piece: between them what it follows counts as
/// straight.
const REMEMBERED_SHARE: f64 = 1.0 / 400.0;

/// From just after a piece's start to just before its end; the spacing grows geometrically from a tenth of the
/// fastest response so that every layer's onset is seen.
fn instants_of_piece(start_s: f64, end_s: f64, path: &HeatPath, remembers: bool) -> Vec<Instant> {
    let duration_s = end_s - start_s;
    let first_s =
        (0.1 * path.shape.radial_pitch_m.powi(2) / (4.0 * path.material.diffusivity_m2_per_s())).min(0.01 * duration_s);
    let ratio = (duration_s / first_s).powf(1.0 / (POINTS_PER_PIECE - 1) as f64);
    let mut instants = vec![Instant::after(start_s)];
    instants.extend((0..POINTS_PER_PIECE - 1).map(|i| Instant::after(start_s + first_s * ratio.powi(i as i32))));
    instants.push(Instant::before(end_s));
    if remembers {
        let widest_s = REMEMBERED_SHARE * duration_s;
        let mut filled = vec![instants[0]];
        for pair in instants.windows(2) {
            let parts = ((pair[1].time_s - pair[0].time_s) / widest_s).ceil().max(1.0);
            let within = |i: usize| pair[0].time_s + (pair[1].time_s - pair[0].time_s) * i as f64 / parts;
            filled.extend((1..parts as usize).map(|i| Instant::after(within(i))));
            filled.push(pair[1]);
        }
        return filled;
    }
    instants
}

impl SolvedProfiles {
    /// # Errors
    /// No profile; a heat path that cannot be solved.
    pub fn new(model: &CoilModel, profiles: &[Profile]) -> Result<Self, SearchError> {
        if profiles.is_empty() {
            return Err(SearchError::NoProfiles);
        }
        let (solver, remembers) = (Solver::new(&model.heat_path()?)?, model.remembers());
        let profiles = profiles.iter().in_parallel().map(|p| SolvedProfile::new(p.clone(), 0, &solver, remembers));
        Ok(Self { profiles: profiles.collect::<Result<_, ThermalError>>()? })
    }

    /// What comes after the ends of profiles that end on the move: the soak in which the pack settles, without the
    /// profiles themselves. `None` where every profile ends with such a soak of its own.
    ///
    /// # Errors
    /// A heat path that cannot be solved.
    pub(crate) fn after_the_ends(&self, model: &CoilModel) -> Result<Option<Self>, SearchError> {
        let (path, remembers) = (model.heat_path()?, model.remembers());
        let settling_s = settling_s(&path)?;
        let soaked: Vec<SolvedProfile> = self
            .profiles
            .iter()
            .in_parallel()
            .filter_map(|solved| {
                let profile = &solved.profile;
                let soak = Piece { rate_k_per_s: 0.0, duration_s: settling_s };
                let last = profile.pieces()[profile.pieces().len() - 1];
                let settles = last.rate_k_per_s == 0.0 && last.duration_s >= settling_s;
                let pieces = profile.pieces().iter().copied().chain([soak]).collect();
                (!settles).then(|| {
                    let longer = Profile::new(profile.name(), pieces).expect("a soak of a positive duration");
                    // Behind its last piece a drive stays where it is.
                    SolvedProfile::on(longer, profile.pieces().len(), Arc::clone(&solved.field), &path, remembers)
                })
            })
            .collect();
        Ok((!soaked.is_empty()).then_some(Self { profiles: soaked }))
    }

    /// In the order in which they were given.
    pub fn profiles(&self) -> &[SolvedProfile] {
        &self.profiles
    }

    /// The largest |Ω| of a pattern over all profiles and times.
    ///
    /// # Example
    /// ```
    /// use coilwright::{Classic, CoilModel, ProfileSpec, SolvedProfiles};
    ///
    /// let model = CoilModel::builder("eight layers", 8).mean_diameter_m(0.08).turns_per_layer(98.0).build()?;
    /// let ramps = ProfileSpec { count: 2, ..ProfileSpec::default() };
    /// // Solved once, whatever is wound.
    /// let solved = SolvedProfiles::new(&model, &ramps.profiles())?;
    /// let qua = Classic::Qua.pattern(8)?;
    /// let worst = solved.worst_case(&model, &qua)?;
    /// assert!(worst.time_s <= ramps.duration_s);
    /// // The ends exchanged, the rate error has the other sign.
    /// let mirrored = solved.worst_case(&model, &qua.reversed())?;
    /// assert!((mirrored.rate_rad_per_s + worst.rate_rad_per_s).abs() < 1e-9 * worst.rate_rad_per_s.abs());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// A pattern of another layer count.
    pub fn worst_case(&self, model: &CoilModel, pattern: &Pattern) -> Result<WorstCase, SearchError> {
        let rate_model = RateModel::new(model, pattern, &[])?;
        if rate_model.has_formulas()
            && let Some(fault) = self.profiles.iter().find_map(|p| p.fault(&rate_model))
        {
            return Err(fault.into());
        }
        Ok(self.worst_of(&rate_model, &self.tops(&rate_model)))
    }

    /// The largest of a pattern, given the largest sample of each profile.
    pub(super) fn worst_of(&self, rate_model: &RateModel, tops: &[f64]) -> WorstCase {
        let candidates: Vec<WorstCase> = self
            .contenders_of(rate_model, tops, PEAK_SHARE)
            .into_iter()
            .map(|(index, (rate_rad_per_s, time_s))| {
                let profile = self.profiles[index].profile.name().to_owned();
                WorstCase { rate_rad_per_s, profile, profile_index: index, time_s }
            })
            .collect();
        // The first of equals, so that the answer does not depend on the number of threads.
        let mut worst = &candidates[0];
        for candidate in &candidates[1..] {
            if candidate.rate_rad_per_s.abs() > worst.rate_rad_per_s.abs() {
                worst = candidate;
            }
        }
        worst.clone()
    }

    /// The largest sample of each profile.
    fn tops(&self, rate_model: &RateModel) -> Vec<f64> {
        let top = |p: &SolvedProfile| p.series_rad_per_s(rate_model).iter().fold(0.0, |most: f64, r| most.max(r.abs()));
        self.profiles.iter().in_parallel().map(top).collect()
    }

    /// By their indices, in order, the profiles whose largest sample is at least this share of the largest of all; each with its
    /// largest rate error, between samples too, and the time of it. There is always one.
    pub(super) fn contenders(&self, rate_model: &RateModel, share: f64) -> Vec<(usize, (f64, f64))> {
        self.contenders_of(rate_model, &self.tops(rate_model), share)
    }

    fn contenders_of(&self, rate_model: &RateModel, tops: &[f64], share: f64) -> Vec<(usize, (f64, f64))> {
        let least = share * tops.iter().copied().fold(0.0, f64::max);
        let contenders: Vec<usize> = (0..tops.len()).filter(|&index| tops[index] >= least).collect();
        contenders.in_parallel().map(|index| (index, self.profiles[index].worst(rate_model))).collect()
    }
}

/// Ten time constants of the slowest mode, and of the bore's heat; for the half space the time to its power-law tail.
fn settling_s(path: &HeatPath) -> Result<f64, ThermalError> {
    let heat_s = 10.0 * path.own_course_s();
    let linear = HeatPath { conductivity_slope_per_k: 0.0, ..path.driven_only() };
    let response = StepResponse::of(&linear)?;
    let settled_s = match response {
        StepResponse::Pack(_) => response.settling_s() / 5.0,
        StepResponse::HalfSpace(_) => response.settling_s(),
    };
    Ok(settled_s.max(heat_s))
}

impl SolvedProfile {
    /// Sampled from a piece on; with what came before it, where that is remembered.
    pub(super) fn new(
        profile: Profile,
        first_piece: usize,
        solver: &Solver,
        remembers: bool,
    ) -> Result<Self, ThermalError> {
        let drive = Drive::boundary(profile.temperature(REFERENCE_TEMPERATURE_K));
        let field = Arc::new(solver.field(&drive)?);
        Ok(Self::on(profile, first_piece, field, solver.path(), remembers))
    }

    /// Of a field that is known.
    fn on(profile: Profile, first_piece: usize, field: Arc<Field>, path: &HeatPath, remembers: bool) -> Self {
        let boundary_k = profile.temperature(REFERENCE_TEMPERATURE_K);
        let knots = boundary_k.knots();
        let of = |knots: &[f64]| instants_of_piece(knots[0], knots[1], path, remembers);
        let pieces: Vec<Vec<Instant>> = knots[first_piece..]
            .windows(2)
            .map(of)
            .chain(std::iter::once(vec![Instant::after(profile.duration_s())]))
            .collect();
        let history = field.at(&pieces.concat());
        let before: Vec<Instant> =
            if remembers { knots[..=first_piece].windows(2).flat_map(of).collect() } else { Vec::new() };
        let lead = field.at(&before);
        Self { profile, field, pieces, history, lead }
    }

    /// What is remembered where the samples begin.
    pub(in crate::search) fn past(&self, rate_model: &RateModel) -> Past {
        let mut past = Past::default();
        if rate_model.remembers() {
            rate_model.series_after(&self.lead, &mut past);
        }
        past
    }

    /// The rate error at every sample.
    pub(crate) fn series_rad_per_s(&self, rate_model: &RateModel) -> Vec<f64> {
        rate_model.series_after(&self.history, &mut self.past(rate_model))
    }

    /// The coefficients of the layer weights at any instant, with all that was before it.
    pub(in crate::search) fn response_at(&self, rate_model: &RateModel, instant: Instant) -> WeightResponse {
        let mut past = self.past(rate_model);
        if rate_model.remembers() {
            let before = self.history.times_s.partition_point(|t| *t < instant.time_s);
            for row in 0..before {
                rate_model.rate_error_after(&rate_model.state(&self.history, row, &[]), &mut past);
            }
        }
        let history = self.field.at(&[instant]);
        rate_model.weight_response_after(&rate_model.state(&history, 0, &[]), &mut past)
    }

    /// The coefficients at every sample.
    pub(in crate::search) fn responses(&self, rate_model: &RateModel) -> Vec<WeightResponse> {
        let mut past = self.past(rate_model);
        let state = |row: usize| rate_model.state(&self.history, row, &[]);
        (0..self.history.len()).map(|row| rate_model.weight_response_after(&state(row), &mut past)).collect()
    }

    /// Why there is no rate at some sample, if a formula is why.
    pub(in crate::search) fn fault(&self, rate_model: &RateModel) -> Option<RateError> {
        let mut past = self.past(rate_model);
        (0..self.history.len())
            .find_map(|row| rate_model.checked_after(&rate_model.state(&self.history, row, &[]), &mut past).err())
    }

    /// The rate error with its sign and the time at which its size is largest.
    pub(in crate::search) fn worst(&self, rate_model: &RateModel) -> (f64, f64) {
        let mut past = self.past(rate_model);
        let mut pasts = Vec::new();
        let series: Vec<f64> = (0..self.history.len())
            .map(|row| {
                let rate = rate_model.rate_error_after(&rate_model.state(&self.history, row, &[]), &mut past);
                if rate_model.remembers() {
                    pasts.push(past.clone());
                }
                rate
            })
            .collect();
        let largest = series.iter().map(|r| r.abs()).fold(0.0, f64::max);
        let (mut best_rate, mut best_time_s) = (0.0_f64, 0.0);
        let mut offset = 0;
        for piece in &self.pieces {
            let size = |i: usize| series[offset + i].abs();
            for i in 0..piece.len() {
                if size(i) > best_rate.abs() {
                    (best_rate, best_time_s) = (series[offset + i], piece[i].time_s);
                }
                let is_peak = i > 0 && i + 1 < piece.len() && size(i) >= size(i - 1) && size(i) >= size(i + 1);
                if is_peak && size(i) > PEAK_SHARE * largest {
                    let rate_at = |time_s: f64| {
                        let history = self.field.at(&[Instant::after(time_s)]);
                        let mut past = pasts.get(offset + i - 1).cloned().unwrap_or_default();
                        rate_model.rate_error_after(&rate_model.state(&history, 0, &[]), &mut past)
                    };
                    let peak = golden_section(|t| rate_at(t).abs(), piece[i - 1].time_s, piece[i + 1].time_s);
                    if peak.value > best_rate.abs() {
                        (best_rate, best_time_s) = (rate_at(peak.at), peak.at);
                    }
                }
            }
            offset += piece.len();
        }
        (best_rate, best_time_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coil::LayerLength;
    use crate::pattern::classic::Classic;
    use crate::search::cost::samples::tests::model;

    #[test]
    fn what_comes_after_a_profile_is_what_a_soak_at_its_end_would_show_and_can_be_the_worst() {
        let model = model(8, LayerLength::Actual, &["surface_film", "self_heating"]);
        let ramp = Piece { rate_k_per_s: 1e-6, duration_s: 2.0 };
        let soak = Piece { rate_k_per_s: 0.0, duration_s: 3e4 };
        let short = [Profile::new("short", vec![ramp]).unwrap()];
        let soaked = [Profile::new("soaked", vec![ramp, soak]).unwrap()];
        let within = SolvedProfiles::new(&model, &short).unwrap();
        let whole = SolvedProfiles::new(&model, &soaked).unwrap();
        let after = within.after_the_ends(&model).unwrap().unwrap();
        let mut grows = 0;
        for classic in [Classic::Zyl, Classic::Dip, Classic::Qua] {
            let worst = |solved: &SolvedProfiles| {
                solved.worst_case(&model, &classic.pattern(8).unwrap()).unwrap().rate_rad_per_s.abs()
            };
            let (within, whole, after) = (worst(&within), worst(&whole), worst(&after));
            assert!((within.max(after) / whole - 1.0).abs() < 1e-6, "{classic:?}: {within} {after} {whole}");
            grows += usize::from(after > 1.01 * within);
        }
        assert!(grows > 0);
        assert!(whole.after_the_ends(&model).unwrap().is_none());
    }
}
