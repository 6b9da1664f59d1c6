//! The rate error of a coil: the readable reference that every fast path is tested against.
//!
//! ```text
//! Ω = n_g/(L D) · { Σ_j κ_j Ṫ_j w_j + 2 Σ_j κ_j d_j l_j² m_j } · gain + lead + outside
//! w_j = ∫_segment (2z − L) dz = l_j (2 z̄_j − L)
//! ```
//!
//! | symbol | meaning | unit | in code |
//! |---|---|---|---|
//! | Ω | rate error, positive as written | rad/s | `rate_error_rad_per_s` |
//! | n_g, κ | group index (the phase index where none is stated), path per kelvin | 1, 1/K | `Fibre` |
//! | L, D | fibre length, mean coil diameter | m | `Coil` |
//! | Ṫ_j | rate of the layer's axial mean temperature | K/s | `PackState::rates_k_per_s` |
//! | m_j | first axial moment of the rate | K/s | `PackState::axial_moments_k_per_s` |
//! | d_j | direction of the layer, ±1 | 1 | `Pattern::axial_direction` |
//! | w_j | layer weight, kept apart for the two halves of the fibre | m² | `LayerWeights` |
//!
//! Leaves out scale-factor errors and everything that no declared effect describes.
//!
//! # Source
//! Yan, Lan, Jian, Acta Optica Sinica (1998), Eq. (4), with the dots on ΔT that the paper lost; Shupe, Appl. Opt. 19,
//! 654 (1980). The sign is the paper's: positive Ω for a positive phase as written.

mod builder;
mod laid;
mod materials;
mod past;

use std::borrow::Cow;

use thiserror::Error;

use crate::coil::{Coil, CoilError};
use crate::effect::{DeclaredEffect, Effect, FibrePlace, Lead, PackState, SurplusFibre};
use crate::numeric::expression::EvaluationError;
use crate::pattern::{Half, Pattern};
use crate::thermal::{Extent, HeatPath, Location, PackMaterial, PackShape, ThermalHistory};
use crate::units::{LIGHT_SPEED_M_PER_S, REFERENCE_TEMPERATURE_K};

pub use builder::CoilModelBuilder;
pub(crate) use laid::Laid;
pub use past::Past;

/// A coil, how it is heated, and which physics is taken into account; everything but the pattern.
#[derive(Debug, Clone)]
pub struct CoilModel {
    /// As it is shown.
    pub name: String,
    /// As declared, before effects change it.
    pub coil: Coil,
    /// Where the pack ends inwards.
    pub extent: Extent,
    /// Of the pack, effective.
    pub material: PackMaterial,
    /// Where the sensor is, and so what a profile or a record is the temperature of.
    pub location: Location,
    /// Each recorded rate is the mean over this interval, which ends at its stamp; 0: instantaneous.
    pub rate_mean_s: f64,
    /// Finite-volume cells across a layer of the pack: 1 or an even number.
    pub cells_per_layer: usize,
    /// In the model file's order.
    pub effects: Vec<DeclaredEffect>,
}

/// Why a model has no rate error for a pattern.
#[derive(Debug, Error, Clone, PartialEq)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum RateError {
    #[error("the pattern has {pattern} layers and the coil {coil}: use a pattern of the coil's layer count")]
    Layers { pattern: usize, coil: usize },
    #[error(transparent)]
    Coil(#[from] CoilError),
    #[error(
        "{change} turns at end {end} leave layer {layer} nothing: it has {turns} turns, leave off fewer than it has"
    )]
    EndTurns { end: Half, change: i32, layer: usize, turns: f64 },
    #[error("the formula \"{formula}\" has no value at {time_s} s: {fault}")]
    Formula { formula: String, time_s: f64, fault: EvaluationError },
    #[error(
        "the formula \"{formula}\" is not linear in thermal_rate, which depends on the pattern: patterns can be evaluated with it, not searched"
    )]
    NotSearchable { formula: String },
}

impl CoilModel {
    /// The coil with the turns that the effects leave it.
    ///
    /// # Errors
    /// Effects that leave a layer no turns.
    pub fn wound_coil(&self) -> Result<Coil, CoilError> {
        let mut turns = self.coil.turns().to_vec();
        for effect in self.bind_all(&self.coil, &[]) {
            effect.change_turns(&mut turns);
        }
        if turns == self.coil.turns() { Ok(self.coil.clone()) } else { self.coil.with_turns(turns) }
    }

    /// The heat path with every effect's change.
    ///
    /// # Errors
    /// As [`CoilModel::wound_coil`].
    pub fn heat_path(&self) -> Result<HeatPath, CoilError> {
        let coil = self.wound_coil()?;
        let mut path = HeatPath::new(PackShape::of(&coil), self.extent, self.material, self.location);
        path.cells_per_layer = self.cells_per_layer;
        for effect in self.bind_all(&coil, &[]) {
            effect.change_heat_path(&mut path);
        }
        Ok(path)
    }

    /// Whether the outermost layer follows the drive at once, with no film of air between them: the first instant of a
    /// ramp then heats that layer alone, and windings that put the same pieces of fibre there tie.
    pub(crate) fn prescribes_outermost_layer(&self) -> bool {
        self.heat_path().is_ok_and(|path| path.location == Location::OuterLayer && path.film_w_per_m2_k.is_none())
    }

    /// The sensor's lag behind what it is attached to \[s\]; several lags add.
    pub fn sensor_lag_s(&self) -> f64 {
        self.bind_all(&self.coil, &[]).iter().map(|e| e.sensor_lag_s()).sum()
    }

    /// The same model with one more effect.
    pub fn with_effect(&self, effect: DeclaredEffect) -> Self {
        let mut model = self.clone();
        model.effects.push(effect);
        model
    }

    /// Columns that the effects read and that are not among `channels`.
    pub(crate) fn missing_channels(&self, channels: &[String]) -> Vec<String> {
        let mut missing: Vec<String> = self.effects.iter().flat_map(|e| e.channels()).collect();
        missing.retain(|name| !channels.contains(name));
        missing.dedup();
        missing
    }

    fn bind_all(&self, coil: &Coil, channels: &[String]) -> Vec<Box<dyn Effect>> {
        self.effects.iter().map(|e| e.bind(coil, channels)).collect()
    }
}

/// Each layer's weight in the phase integral, kept apart for the two halves of the fibre.
///
/// # Shapes
/// One entry a layer, innermost first.
#[derive(Debug, Clone, PartialEq)]
pub struct LayerWeights {
    /// The part of w_j with z < L/2 \[m²\].
    pub half_a_m2: Vec<f64>,
    /// The part with z > L/2 \[m²\].
    pub half_b_m2: Vec<f64>,
    /// 2 d_j l_j² of whole layers, the weight of the axial moment \[m²\].
    pub(crate) axial_m2: Vec<f64>,
}

/// ∫(2z − L)dz over a piece of fibre, kept apart for the two halves of the fibre.
pub(crate) fn segment_weights_m2(from_m: f64, to_m: f64, length_m: f64) -> (f64, f64) {
    let middle_m = (0.5 * length_m).clamp(from_m, to_m);
    ((middle_m - from_m) * (from_m + middle_m - length_m), (to_m - middle_m) * (middle_m + to_m - length_m))
}

impl LayerWeights {
    /// # Errors
    /// A pattern of another layer count.
    pub fn new(coil: &Coil, pattern: &Pattern) -> Result<Self, RateError> {
        Ok(Self::of(&Laid::new(coil, pattern)?))
    }

    pub(crate) fn of(laid: &Laid) -> Self {
        let layers = laid.coil.layers();
        let length_m = laid.coil.length_m();
        let mut weights =
            Self { half_a_m2: vec![0.0; layers], half_b_m2: vec![0.0; layers], axial_m2: vec![0.0; layers] };
        for piece in &laid.pieces {
            let (half_a_m2, half_b_m2) = segment_weights_m2(piece.from_m, piece.to_m, length_m);
            weights.half_a_m2[piece.layer] += half_a_m2;
            weights.half_b_m2[piece.layer] += half_b_m2;
            weights.axial_m2[piece.layer] += 12.0 * piece.middle * (half_a_m2 + half_b_m2)
                + 2.0 * piece.direction * piece.share * piece.length_m.powi(2);
        }
        weights
    }

    /// w_j, both halves together \[m²\].
    pub fn total_m2(&self) -> Vec<f64> {
        self.half_a_m2.iter().zip(&self.half_b_m2).map(|(a, b)| a + b).collect()
    }
}

/// What a state of the pack makes of layer weights: Ω is linear in them.
///
/// ```text
/// Ω = constant + Σ_j ( half_a_j w_j^A + half_b_j w_j^B + axial_j x_j )
/// ```
///
/// None of it depends on the pattern.
///
/// # Shapes
/// One entry a layer, innermost first; `axial_rad_per_s_m2` is empty where nothing varies along the axis.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightResponse {
    /// Of the half from end A.
    pub half_a_rad_per_s_m2: Vec<f64>,
    /// Of the half from end B.
    pub half_b_rad_per_s_m2: Vec<f64>,
    pub(crate) axial_rad_per_s_m2: Vec<f64>,
    /// Lead and everything outside the coil.
    pub(crate) constant_rad_per_s: f64,
}

/// A coil model with a pattern: from the pack's state to the rate error.
#[derive(Debug)]
pub struct RateModel {
    coil: Coil,
    weights: LayerWeights,
    effects: Vec<Box<dyn Effect>>,
    /// Of each effect its formula, for what is said about it; empty where it has none.
    formulas: Vec<String>,
    surplus: Vec<SurplusFibre>,
    /// Empty where κ depends on temperature.
    steady: Vec<SteadyLayer>,
}

/// What of a layer does not depend on the pack's state.
#[derive(Debug, Clone, Copy)]
struct SteadyLayer {
    /// κ_A w_A + κ_B w_B [m²/K].
    weighted_m2_per_k: f64,
    /// (κ_A + κ_B)/2 [1/K].
    path_per_k: f64,
}

impl RateModel {
    /// A coil with a pattern.
    ///
    /// # Example
    /// ```
    /// use coilwright::{Classic, CoilModel, RateModel};
    ///
    /// let model = CoilModel::builder("eight layers", 8).mean_diameter_m(0.08).turns_per_layer(98.0).build()?;
    /// let rate = RateModel::new(&model, &Classic::Qua.pattern(8)?, &[])?;
    /// // Δφ = Ω 2πLD/(λ c): a phase is linear in the rate.
    /// assert!((rate.phase_rad(2e-9) / rate.phase_rad(1e-9) - 2.0).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// `channels` names a record's further columns, in the order in which [`PackState::channels`] will hold them.
    ///
    /// # Errors
    /// A pattern of another layer count; effects that leave a layer no turns.
    pub fn new(model: &CoilModel, pattern: &Pattern, channels: &[String]) -> Result<Self, RateError> {
        let laid = Laid::new(&model.wound_coil()?, pattern)?;
        let weights = LayerWeights::of(&laid);
        let coil = laid.coil;
        let effects = model.bind_all(&coil, channels);
        let surplus = effects.iter().filter_map(|e| e.surplus_fibre()).collect();
        let formulas = model.effects.iter().map(past::formula_of).collect();
        let mut rate = Self { coil, weights, effects, formulas, surplus, steady: Vec::new() };
        if rate.effects.iter().all(|e| !e.path_depends_on_temperature()) {
            rate.steady = (0..rate.coil.layers()).map(|layer| rate.layer_at(layer, REFERENCE_TEMPERATURE_K)).collect();
        }
        Ok(rate)
    }

    fn layer_at(&self, layer: usize, temperature_k: f64) -> SteadyLayer {
        let kappa_a = self.path_per_k(layer, Half::A, temperature_k);
        let kappa_b = self.path_per_k(layer, Half::B, temperature_k);
        SteadyLayer {
            weighted_m2_per_k: kappa_a * self.weights.half_a_m2[layer] + kappa_b * self.weights.half_b_m2[layer],
            path_per_k: 0.5 * (kappa_a + kappa_b),
        }
    }

    /// A layer's response at its temperature.
    fn layer(&self, layer: usize, temperature_k: f64) -> SteadyLayer {
        self.steady.get(layer).copied().unwrap_or_else(|| self.layer_at(layer, temperature_k))
    }

    pub(crate) fn coil(&self) -> &Coil {
        &self.coil
    }

    /// Of every layer, by half.
    pub fn weights(&self) -> &LayerWeights {
        &self.weights
    }

    /// n_g/(L D) [1/m²].
    pub(crate) fn scale_per_m2(&self) -> f64 {
        self.coil.fibre().transit_index() / (self.coil.length_m() * self.coil.sagnac_diameter_m())
    }

    /// κ times the effects' factors [1/K].
    fn path_per_k(&self, layer: usize, half: Half, temperature_k: f64) -> f64 {
        let place = FibrePlace { layer, half, temperature_k };
        self.coil.fibre().path_per_k() * self.effects.iter().map(|e| e.path_factor(&place)).product::<f64>()
    }

    /// Ω, with everything that the model declares; what remembers is at rest.
    pub fn rate_error_rad_per_s(&self, state: &PackState) -> f64 {
        self.rate_error_after(state, &mut Past::default())
    }

    /// The same after the states that the past holds, in the order of time.
    pub fn rate_error_after(&self, state: &PackState, past: &mut Past) -> f64 {
        let coil = self.thermal_rate_rad_per_s(state);
        coil + self.outside_rad_per_s(&PackState { thermal_rate_rad_per_s: coil, ..*state }, past)
    }

    /// What the layers' optical paths follow: their rates of temperature, unless an effect makes them follow others'.
    fn followed_rates<'a>(&self, state: &PackState<'a>) -> Cow<'a, [f64]> {
        let mut rates = Cow::Borrowed(state.rates_k_per_s);
        for effect in &self.effects {
            if let Some(followed) = effect.followed_rates(state.temperatures_k, &rates) {
                rates = Cow::Owned(followed);
            }
        }
        rates
    }

    /// The coil's own part of Ω, lead included.
    fn thermal_rate_rad_per_s(&self, state: &PackState) -> f64 {
        let scale = self.scale_per_m2();
        let rates_k_per_s = self.followed_rates(state);
        let mut coil_sum = 0.0;
        for (layer, (&rate, &temperature_k)) in rates_k_per_s.iter().zip(state.temperatures_k).enumerate() {
            let here = self.layer(layer, temperature_k);
            coil_sum += here.weighted_m2_per_k * rate;
            if let Some(moment) = state.axial_moments_k_per_s.get(layer) {
                coil_sum += here.path_per_k * self.weights.axial_m2[layer] * moment;
            }
        }
        let gain: f64 = self.effects.iter().map(|e| e.coil_gain(state)).product();
        let lead: f64 = self.surplus.iter().map(|s| self.surplus_rad_per_s(s, state, &rates_k_per_s)).sum();
        scale * coil_sum * gain + lead
    }

    /// The coefficients of the layer weights in Ω at a state; the fast paths of the search are compiled from them.
    pub fn weight_response(&self, state: &PackState) -> WeightResponse {
        self.weight_response_after(state, &mut Past::default())
    }

    /// The same after the states that the past holds; what is not linear in the coil's own rate is refused by
    /// [`RateModel::check_searchable`].
    pub(crate) fn weight_response_after(&self, state: &PackState, past: &mut Past) -> WeightResponse {
        let gain: f64 = self.effects.iter().map(|e| e.coil_gain(state)).product();
        let rates_k_per_s = self.followed_rates(state);
        let lead: f64 = self.surplus.iter().map(|s| self.surplus_rad_per_s(s, state, &rates_k_per_s)).sum();
        // What is outside the coil may follow the coil's own rate: c + s Ω.
        let outside_at = |rate: f64, past: &mut Past| {
            self.outside_rad_per_s(&PackState { thermal_rate_rad_per_s: rate, ..*state }, past)
        };
        let follows = self.follows_thermal_rate();
        let followed = if follows { outside_at(1.0, &mut past.clone()) } else { 0.0 };
        let outside = outside_at(0.0, past);
        let own = if follows { 1.0 + followed - outside } else { 1.0 };
        let scale = self.scale_per_m2() * gain * own;
        let layers = state.rates_k_per_s.len();
        let kappa = |layer: usize, half| self.path_per_k(layer, half, state.temperatures_k[layer]);
        let of_half = |half| (0..layers).map(|j| scale * kappa(j, half) * rates_k_per_s[j]).collect::<Vec<f64>>();
        let axial = state.axial_moments_k_per_s.iter().enumerate();
        WeightResponse {
            half_a_rad_per_s_m2: of_half(Half::A),
            half_b_rad_per_s_m2: of_half(Half::B),
            axial_rad_per_s_m2: axial
                .map(|(j, moment)| scale * 0.5 * (kappa(j, Half::A) + kappa(j, Half::B)) * moment)
                .collect(),
            constant_rad_per_s: own * lead + outside,
        }
    }

    /// Surplus fibre 2δ at end A moves the coil by 2δ along z and adds a lead at z < 2δ; exact in δ.
    fn surplus_rad_per_s(&self, surplus: &SurplusFibre, state: &PackState, rates_k_per_s: &[f64]) -> f64 {
        let lead_rate = match surplus.lead {
            Lead::Ambient => state.ambient_rate_k_per_s,
            Lead::Isothermal => 0.0,
        };
        let moved: f64 = rates_k_per_s
            .iter()
            .zip(state.temperatures_k)
            .zip(self.coil.layer_lengths_m())
            .enumerate()
            .map(|(layer, ((rate, &temperature_k), length_m))| {
                self.layer(layer, temperature_k).path_per_k * rate * length_m
            })
            .sum();
        let lead = self.coil.fibre().path_per_k() * lead_rate * self.coil.length_m();
        self.scale_per_m2() * 2.0 * surplus.offset_m * (moved - lead)
    }

    /// Δφ for a rate error: Δφ = Ω 2πLD/(λ c0) \[rad\].
    pub fn phase_rad(&self, rate_rad_per_s: f64) -> f64 {
        rate_rad_per_s * std::f64::consts::TAU * self.coil.length_m() * self.coil.sagnac_diameter_m()
            / (self.coil.fibre().wavelength_m * LIGHT_SPEED_M_PER_S)
    }

    /// The hard bound n_g κ k0 L/(4D) on |Ω| of the coil alone while all layer rates lie between 0 and `rate_k_per_s`.
    pub fn hard_bound_rad_per_s(&self, rate_k_per_s: f64) -> f64 {
        let fibre = self.coil.fibre();
        fibre.transit_index() * fibre.path_per_k() * rate_k_per_s * self.coil.length_m()
            / (4.0 * self.coil.sagnac_diameter_m())
    }

    /// The state of row `row` of a history; `channels` as named when the model was made.
    pub fn state<'a>(&self, history: &'a ThermalHistory, row: usize, channels: &'a [f64]) -> PackState<'a> {
        let temperatures_k = history.temperatures_k(row);
        let rates_k_per_s = history.rates_k_per_s(row);
        PackState {
            time_s: history.times_s[row],
            temperatures_k,
            rates_k_per_s,
            axial_moments_k_per_s: history.axial_moments_k_per_s(row),
            mean_temperature_k: self.length_mean(temperatures_k),
            mean_rate_k_per_s: self.length_mean(rates_k_per_s),
            ambient_k: history.ambient_k[row],
            ambient_rate_k_per_s: history.ambient_rate_k_per_s[row],
            channels,
            thermal_rate_rad_per_s: 0.0,
        }
    }

    /// Ω over a whole history that begins at rest, for models without further channels.
    pub fn series_rad_per_s(&self, history: &ThermalHistory) -> Vec<f64> {
        self.series_after(history, &mut Past::default())
    }

    /// The same after what the past holds.
    pub(crate) fn series_after(&self, history: &ThermalHistory, past: &mut Past) -> Vec<f64> {
        (0..history.len()).map(|row| self.rate_error_after(&self.state(history, row, &[]), past)).collect()
    }

    fn length_mean(&self, layers: &[f64]) -> f64 {
        layers.iter().zip(self.coil.layer_lengths_m()).map(|(v, l)| v * l).sum::<f64>() / self.coil.length_m()
    }
}
