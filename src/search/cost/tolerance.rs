//! How good a pattern is when it is built imperfectly: a seeded Monte Carlo of its worst case.
//!
//! ```text
//! M_j → M_j + σ_M z_j − Poisson(λ),  pitch → pitch (1 + σ_p z),  δ → δ + σ_δ z,  K → K (1 + σ_K z),  h → h (1 + σ_h z),  m → m + σ_m z
//! share_i = Var(worst | only spread i) / Σ_i Var(worst | only spread i)
//! ```
//!
//! | symbol | meaning | in code |
//! |---|---|---|
//! | M_j | turns of layer j, each layer for itself | `turns_per_layer_sd` |
//! | pitch | radial pitch | `radial_pitch_sd` |
//! | δ | midpoint offset | `midpoint_offset_sd_m` |
//! | K, h | diffusivity, film coefficient | `diffusivity_sd`, `film_sd` |
//! | m | mismatch of the halves | `mismatch_sd` |
//! | λ | whole turns that a layer loses on average | `lost_turns_mean` |
//! | p_j | each layer's own pitch, p (1 + σ z_j): the radii and so the lengths of the layers above follow | `layer_pitch_sd` |
//! | h_f | film at each heated flange, h_f (1 + σ z) | `flange_film_sd` |
//! | 2δ | surplus that trimming leaves, evenly within ±t | `trim_residue_m` |
//! | z | standard normal, one a sample and quantity | |
//!
//! The worst case is the guaranteed one where the model has it, else the sampled one over the declared profiles.
//! All patterns see the same samples, so that they are compared with the same coils.
//!
//! # Source
//! Shares one spread at a time: Saltelli et al., Global Sensitivity Analysis (2008), section 1.2.

mod built;

use std::ops::Range;

use statrs::statistics::Statistics;
use thiserror::Error;

use crate::coil::CoilError;
use crate::effect;
use crate::numeric::order::sort_descending;
use crate::numeric::statistics::quantile;
use crate::parallel::InParallel;
use crate::pattern::Pattern;
use crate::profile::ProfileSpec;
use crate::rate::CoilModel;
use crate::search::cost::deviates::Deviates;
use crate::search::cost::guaranteed::{GuaranteedError, UnitStep};
use crate::search::cost::worst_case::{SearchError, SolvedProfiles};
use built::built;
pub(in crate::search) use built::with_middle_moved;

/// The quantile that is made small.
pub(crate) const SHARE: f64 = 0.95;

/// What winding and trimming leave, beside the spreads of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct AsBuilt {
    /// Whole turns that a layer loses on average, each layer for itself.
    pub(crate) lost_turns_mean: f64,
    /// Relative, of each layer's own radial pitch. Only lengths follow it; what heat flows through keeps the mean pitch.
    pub(crate) layer_pitch_sd: f64,
    /// Relative, of the film at each heated flange for itself.
    pub(crate) flange_film_sd: f64,
    /// The largest asymmetric length that trimming leaves; every one up to it is as likely.
    pub(crate) trim_residue_m: f64,
}

/// Spreads of what is built, as standard deviations; zero: exact.
#[derive(Clone, PartialEq)]
pub struct ToleranceSpec {
    /// Turns, independent from layer to layer.
    pub(crate) turns_per_layer_sd: f64,
    /// Relative.
    pub(crate) radial_pitch_sd: f64,
    pub(crate) midpoint_offset_sd_m: f64,
    /// Relative.
    pub(crate) diffusivity_sd: f64,
    /// Relative; acts on `surface_film`.
    pub(crate) film_sd: f64,
    /// Absolute, of `strain_mismatch`.
    pub(crate) mismatch_sd: f64,
    pub(crate) as_built: AsBuilt,
    pub(crate) samples: usize,
    pub(crate) seed: u64,
    /// A coil whose worst case is larger is scrap.
    pub(crate) limit_rad_per_s: Option<f64>,
}

/// Without what winding leaves as before there was any: cells of campaigns are told by it.
impl std::fmt::Debug for ToleranceSpec {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut shown = f.debug_struct("ToleranceSpec");
        shown
            .field("turns_per_layer_sd", &self.turns_per_layer_sd)
            .field("radial_pitch_sd", &self.radial_pitch_sd)
            .field("midpoint_offset_sd_m", &self.midpoint_offset_sd_m)
            .field("diffusivity_sd", &self.diffusivity_sd)
            .field("film_sd", &self.film_sd)
            .field("mismatch_sd", &self.mismatch_sd)
            .field("samples", &self.samples)
            .field("seed", &self.seed)
            .field("limit_rad_per_s", &self.limit_rad_per_s);
        if self.as_built != AsBuilt::default() {
            shown.field("as_built", &self.as_built);
        }
        shown.finish()
    }
}

/// What may spread, in the order of the shares.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Spread {
    Turns,
    RadialPitch,
    MidpointOffset,
    Diffusivity,
    Film,
    Mismatch,
    LostTurns,
    LayerPitch,
    FlangeFilm,
    TrimResidue,
}

#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum ToleranceError {
    #[error("tolerance.film_percent_sd needs a film: declare the effect surface_film or leave the spread out")]
    NoFilm,
    #[error(
        "tolerance.flange_film_percent_sd needs a heated flange: declare the effect axial_gradient or leave the spread out"
    )]
    NoFlange,
    #[error("[tolerance] states no spread: give at least one standard deviation above 0")]
    NoSpread,
    #[error("a search for the 95 % quantile needs a [tolerance] table: state there how much what is built spreads")]
    NoTolerance,
    #[error(transparent)]
    Search(#[from] SearchError),
    #[error(transparent)]
    Guaranteed(#[from] GuaranteedError),
}

/// Whose worst case was drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Measure {
    Guaranteed,
    /// Over the declared profiles: the model has no guaranteed worst case.
    Sampled,
}

/// The distribution of a pattern's worst case.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Distribution {
    /// As declared, without spreads.
    pub(crate) nominal_rad_per_s: f64,
    /// Ascending.
    pub(crate) worst_rad_per_s: Vec<f64>,
    /// The share of coils within the limit, if there is one.
    pub(crate) yield_share: Option<f64>,
    /// Shares of the variance, largest first; only spreads that are above zero.
    pub(crate) variance_shares: Vec<(Spread, f64)>,
}

impl Distribution {
    /// The value that a share of the coils does not exceed, between the order statistics.
    pub(crate) fn quantile_rad_per_s(&self, share: f64) -> f64 {
        quantile(&self.worst_rad_per_s, share)
    }

    pub(crate) fn median_rad_per_s(&self) -> f64 {
        self.quantile_rad_per_s(0.5)
    }

    pub(crate) fn p95_rad_per_s(&self) -> f64 {
        self.quantile_rad_per_s(SHARE)
    }

    pub(crate) fn p99_rad_per_s(&self) -> f64 {
        self.quantile_rad_per_s(0.99)
    }
}

impl Spread {
    pub(crate) const ALL: [Spread; 10] = [
        Spread::Turns,
        Spread::RadialPitch,
        Spread::MidpointOffset,
        Spread::Diffusivity,
        Spread::Film,
        Spread::Mismatch,
        Spread::LostTurns,
        Spread::LayerPitch,
        Spread::FlangeFilm,
        Spread::TrimResidue,
    ];

    /// The key of its standard deviation in a model file.
    pub(crate) fn key(self) -> &'static str {
        match self {
            Spread::Turns => "turns_per_layer_sd",
            Spread::RadialPitch => "radial_pitch_percent_sd",
            Spread::MidpointOffset => "midpoint_offset_mm_sd",
            Spread::Diffusivity => "diffusivity_percent_sd",
            Spread::Film => "film_percent_sd",
            Spread::Mismatch => "mismatch_sd",
            Spread::LostTurns => "lost_turns_per_layer_mean",
            Spread::LayerPitch => "layer_pitch_percent_sd",
            Spread::FlangeFilm => "flange_film_percent_sd",
            Spread::TrimResidue => "trim_residue_mm",
        }
    }

    /// Whether the temperature field changes with it.
    fn is_thermal(self) -> bool {
        matches!(self, Spread::RadialPitch | Spread::Diffusivity | Spread::Film | Spread::FlangeFilm)
    }
}

impl ToleranceSpec {
    fn sd(&self, spread: Spread) -> f64 {
        match spread {
            Spread::Turns => self.turns_per_layer_sd,
            Spread::RadialPitch => self.radial_pitch_sd,
            Spread::MidpointOffset => self.midpoint_offset_sd_m,
            Spread::Diffusivity => self.diffusivity_sd,
            Spread::Film => self.film_sd,
            Spread::Mismatch => self.mismatch_sd,
            Spread::LostTurns => self.as_built.lost_turns_mean,
            Spread::LayerPitch => self.as_built.layer_pitch_sd,
            Spread::FlangeFilm => self.as_built.flange_film_sd,
            Spread::TrimResidue => self.as_built.trim_residue_m,
        }
    }

    fn active(&self) -> Vec<Spread> {
        Spread::ALL.into_iter().filter(|s| self.sd(*s) > 0.0).collect()
    }
}

/// The coils of a study, drawn once: every pattern is judged on the same ones.
pub(crate) struct Coils<'a> {
    model: &'a CoilModel,
    spec: &'a ToleranceSpec,
    active: Vec<Spread>,
    judge: Judge<'a>,
    deviates: Vec<Deviates>,
}

impl<'a> Coils<'a> {
    /// # Errors
    /// As [`Self::among`].
    pub(crate) fn new(
        model: &'a CoilModel,
        profiles: &'a ProfileSpec,
        spec: &'a ToleranceSpec,
    ) -> Result<Self, ToleranceError> {
        Self::among(model, profiles, spec, 0..spec.samples.max(2) as u64)
    }

    /// Some of all the coils that the seed draws, counted from 0: they are the same however many stand before and behind them.
    ///
    /// # Errors
    /// No spread at all, a film's spread without a film, models that cannot be solved.
    pub(crate) fn among(
        model: &'a CoilModel,
        profiles: &'a ProfileSpec,
        spec: &'a ToleranceSpec,
        coils: Range<u64>,
    ) -> Result<Self, ToleranceError> {
        let active = spec.active();
        if active.is_empty() {
            return Err(ToleranceError::NoSpread);
        }
        let has_film = model.effects.iter().any(|e| e.is_at(effect::FILM));
        if active.contains(&Spread::Film) && !has_film {
            return Err(ToleranceError::NoFilm);
        }
        if active.contains(&Spread::FlangeFilm) && !model.effects.iter().any(|e| e.is_at(effect::FLANGE_FILM)) {
            return Err(ToleranceError::NoFlange);
        }
        let judge = Judge::new(model, profiles)?;
        let is_further = spec.as_built != AsBuilt::default();
        let deviates = Deviates::of(spec.seed, model.coil.layers(), coils, is_further);
        Ok(Self { model, spec, active, judge, deviates })
    }

    /// As declared.
    pub(crate) fn model(&self) -> &CoilModel {
        self.model
    }

    pub(crate) fn profiles(&self) -> &ProfileSpec {
        self.judge.profiles
    }

    pub(crate) fn measure(&self) -> Measure {
        self.judge.measure
    }

    /// What is made of the models of all coils, in their order.
    pub(crate) fn of_built<R: Send>(&self, of: impl Fn(Result<CoilModel, SearchError>) -> R + Sync) -> Vec<R> {
        let all = self.deviates.iter().in_parallel();
        all.map(|coil| of(built(self.model, self.spec, &self.active, coil))).collect()
    }

    /// The worst case of each pattern as declared, without spreads.
    ///
    /// # Errors
    /// A pattern of another layer count.
    pub(crate) fn nominal_rad_per_s(&self, patterns: &[Pattern]) -> Result<Vec<f64>, SearchError> {
        self.judge.worst(self.model, None, patterns)
    }

    /// The worst case of each pattern in every coil.
    ///
    /// # Shapes
    /// Coils × patterns.
    ///
    /// # Errors
    /// A pattern of another layer count.
    pub(crate) fn worst_rad_per_s(&self, patterns: &[Pattern]) -> Result<Vec<Vec<f64>>, SearchError> {
        self.worst(&self.active, patterns)
    }

    /// The worst case of each pattern in every coil, with some of the spreads only.
    ///
    /// # Shapes
    /// Coils × patterns.
    fn worst(&self, spreads: &[Spread], patterns: &[Pattern]) -> Result<Vec<Vec<f64>>, SearchError> {
        let reuse = (!spreads.iter().any(|s| s.is_thermal())).then_some(&self.judge.nominal);
        let of = |coil: &Deviates| self.judge.worst(&built(self.model, self.spec, spreads, coil)?, reuse, patterns);
        self.deviates.iter().in_parallel().map(of).collect()
    }

    /// The 95 % quantile of each pattern, as [`study`] reports it.
    ///
    /// # Errors
    /// A pattern of another layer count.
    pub(crate) fn p95_rad_per_s(&self, patterns: &[Pattern]) -> Result<Vec<f64>, SearchError> {
        Ok(self.p95_and_yield(patterns)?.into_iter().map(|(p95, _)| p95).collect())
    }

    /// The 95 % quantile of each pattern, and the share of coils within the limit if there is one.
    ///
    /// # Errors
    /// A pattern of another layer count.
    pub(crate) fn p95_and_yield(&self, patterns: &[Pattern]) -> Result<Vec<(f64, Option<f64>)>, SearchError> {
        let worst = self.worst(&self.active, patterns)?;
        let of = |p: usize| {
            let mut ascending: Vec<f64> = worst.iter().map(|coil| coil[p]).collect();
            ascending.sort_by(f64::total_cmp);
            let within = |limit: f64| ascending.partition_point(|w| *w <= limit) as f64 / ascending.len() as f64;
            (quantile(&ascending, SHARE), self.spec.limit_rad_per_s.map(within))
        };
        Ok((0..patterns.len()).map(of).collect())
    }
}

/// The Monte Carlo of some patterns, all over the same coils.
///
/// # Errors
/// No spread at all, a film's spread without a film, models that cannot be solved.
pub(crate) fn study(
    model: &CoilModel,
    profiles: &ProfileSpec,
    spec: &ToleranceSpec,
    patterns: &[Pattern],
) -> Result<Vec<Distribution>, ToleranceError> {
    let coils = Coils::new(model, profiles, spec)?;
    let active = &coils.active;
    let nominal = coils.nominal_rad_per_s(patterns)?;
    let together = coils.worst_rad_per_s(patterns)?;
    let alone: Vec<Vec<Vec<f64>>> = if active.len() == 1 {
        vec![together.clone()]
    } else {
        active.iter().map(|s| coils.worst(&[*s], patterns)).collect::<Result<_, _>>()?
    };
    Ok((0..patterns.len())
        .map(|p| {
            let mut worst_rad_per_s: Vec<f64> = together.iter().map(|coil| coil[p]).collect();
            worst_rad_per_s.sort_by(f64::total_cmp);
            let within = |limit: f64| worst_rad_per_s.iter().filter(|w| **w <= limit).count();
            let yield_share = spec.limit_rad_per_s.map(|l| within(l) as f64 / worst_rad_per_s.len() as f64);
            let variances: Vec<f64> = alone.iter().map(|coils| coils.iter().map(|c| c[p]).variance()).collect();
            let sum: f64 = variances.iter().sum();
            let mut variance_shares: Vec<(Spread, f64)> = active
                .iter()
                .zip(&variances)
                .map(|(spread, v)| (*spread, if sum > 0.0 { v / sum } else { 0.0 }))
                .collect();
            sort_descending(&mut variance_shares, |item| item.1);
            Distribution { nominal_rad_per_s: nominal[p], worst_rad_per_s, yield_share, variance_shares }
        })
        .collect())
}

/// Whether the worst cases of [`study`] are guaranteed ones.
pub(crate) fn measure(model: &CoilModel, max_rate_k_per_s: f64) -> Result<Measure, ToleranceError> {
    match UnitStep::new(model, max_rate_k_per_s) {
        Ok(_) => Ok(Measure::Guaranteed),
        Err(GuaranteedError::Effect { .. }) => Ok(Measure::Sampled),
        Err(GuaranteedError::Search(error)) => Err(error.into()),
    }
}

/// The field that worst cases are taken from; it does not depend on the pattern.
enum Solved {
    Step(Box<UnitStep>),
    Profiles(SolvedProfiles),
}

struct Judge<'a> {
    profiles: &'a ProfileSpec,
    measure: Measure,
    nominal: Solved,
}

impl<'a> Judge<'a> {
    fn new(model: &CoilModel, profiles: &'a ProfileSpec) -> Result<Self, ToleranceError> {
        let measure = measure(model, profiles.max_rate_k_per_s)?;
        let nominal = solved(model, profiles, measure)?;
        Ok(Self { profiles, measure, nominal })
    }

    /// The worst case of each pattern; `reuse` where the field is known.
    fn worst(&self, model: &CoilModel, reuse: Option<&Solved>, patterns: &[Pattern]) -> Result<Vec<f64>, SearchError> {
        let fresh;
        let field = match reuse {
            Some(field) => field,
            None => {
                fresh = solved(model, self.profiles, self.measure)?;
                &fresh
            }
        };
        match field {
            Solved::Step(step) => {
                let worst = |pattern| match step.guaranteed(model, pattern) {
                    Ok(found) => Ok(found.rate_rad_per_s),
                    Err(GuaranteedError::Search(error)) => Err(error),
                    Err(GuaranteedError::Effect { .. }) => Ok(f64::INFINITY),
                };
                patterns.iter().map(worst).collect()
            }
            Solved::Profiles(profiles) => {
                Ok(profiles.worst_cases(model, patterns)?.iter().map(|worst| worst.rate_rad_per_s.abs()).collect())
            }
        }
    }
}

fn solved(model: &CoilModel, profiles: &ProfileSpec, measure: Measure) -> Result<Solved, SearchError> {
    if measure == Measure::Guaranteed {
        match UnitStep::new(model, profiles.max_rate_k_per_s) {
            Ok(step) => return Ok(Solved::Step(Box::new(step))),
            Err(GuaranteedError::Search(error)) => return Err(error),
            // Spreads add no effect that would make a linear model nonlinear.
            Err(GuaranteedError::Effect { .. }) => {}
        }
    }
    Ok(Solved::Profiles(SolvedProfiles::new(model, &profiles.profiles())?))
}

impl From<CoilError> for ToleranceError {
    fn from(error: CoilError) -> Self {
        ToleranceError::Search(error.into())
    }
}

#[cfg(test)]
mod tests;
