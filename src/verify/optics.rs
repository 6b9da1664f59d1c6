//! The rate error of a state of the pack, summed turn by turn.
//!
//! ```text
//! Ω = n/(L D) ∫ κ(z) Ṫ(z) (2z − L) dz · gain + lead + bias
//! ```
//!
//! The fibre is followed from end A through every turn; each turn's share of the integral is kept by layer and half of
//! the fibre, because that is all that κ may depend on besides temperature. Along the axis the rate is its mean and
//! 12 ζ times its first moment, with the mean κ of the halves.

use super::heat::State;
use super::physics::{Bias, Physics};
use super::strain::Strain;
use super::winding::Piece;
use crate::coil::{Coil, SagnacDiameter};
use crate::units::{REFERENCE_TEMPERATURE_K, celsius_from_kelvin, deg_per_h_from_rad_per_s, rad_per_s_from_deg_per_h};

/// Layers with more turns are summed in so many pieces.
const MOST_PIECES: f64 = 100_000.0;

#[derive(Debug)]
pub(super) struct Optics {
    physics: Physics,
    kappa_per_k: f64,
    /// n/(L D) [1/m²].
    scale_per_m2: f64,
    lengths_m: Vec<f64>,
    /// ∫ (2z − L) dz of each layer's turns in half A and in half B \[m²\].
    weights_m2: Vec<[f64; 2]>,
    /// ∫ (2z − L) 12 ζ dz \[m²\].
    axial_m2: Vec<f64>,
    /// 1/r² less its mean over the fibre, largest size 1.
    stress: Vec<f64>,
    /// Where the materials are stated.
    strain: Option<Strain>,
}

impl Optics {
    /// `pieces` in the order of arclength.
    pub(crate) fn new(coil: &Coil, physics: &Physics, pieces: &[Piece]) -> Self {
        let layers = coil.layers();
        let length_m = pieces.iter().map(|piece| piece.length_m).sum::<f64>();
        let middle_m = 0.5 * length_m;
        let mut lengths_m = vec![0.0; layers];
        let mut weights_m2 = vec![[0.0; 2]; layers];
        let mut axial_m2 = vec![0.0; layers];
        for piece in pieces {
            let (layer, start_m) = (piece.layer, piece.from_m);
            lengths_m[layer] += piece.length_m;
            let parts = piece.turns.ceil().clamp(1.0, MOST_PIECES);
            let turn_m = piece.length_m / parts;
            let zeta = |z_m: f64| {
                let wound = piece.turns * (z_m - start_m) / piece.length_m;
                let from_low_end = if piece.outbound { wound } else { piece.turns - wound };
                (piece.free_turns + from_low_end) / piece.whole_turns - 0.5
            };
            for turn in 0..parts as usize {
                let (a_m, b_m) = (start_m + turn as f64 * turn_m, start_m + (turn + 1) as f64 * turn_m);
                let cut_m = middle_m.clamp(a_m, b_m);
                weights_m2[layer][0] += (cut_m - a_m) * (a_m + cut_m - length_m);
                weights_m2[layer][1] += (b_m - cut_m) * (cut_m + b_m - length_m);
                // Two Gauss points are exact for a quadratic.
                for side in [-1.0, 1.0] {
                    let z_m = 0.5 * (a_m + b_m) + side * 0.5 * (b_m - a_m) / 3.0_f64.sqrt();
                    axial_m2[layer] += 0.5 * (b_m - a_m) * (2.0 * z_m - length_m) * 12.0 * zeta(z_m);
                }
            }
        }
        let (bore_m, pitch_m) = (coil.bore_radius_m(), coil.radial_pitch_m());
        let inverse_square = |j: usize| (bore_m + pitch_m * (j as f64 + 0.5)).powi(-2);
        let mean = (0..layers).map(|j| inverse_square(j) * lengths_m[j]).sum::<f64>() / length_m;
        let peak = (0..layers).map(|j| (inverse_square(j) - mean).abs()).fold(0.0, f64::max);
        let fibre = coil.fibre();
        let diameter_m = match coil.sagnac() {
            SagnacDiameter::Mean => 2.0 * bore_m + layers as f64 * pitch_m,
            SagnacDiameter::ByLength => {
                let of = |piece: &Piece| 2.0 * (bore_m + pitch_m * (piece.layer as f64 + 0.5)) * piece.length_m;
                pieces.iter().map(of).sum::<f64>() / length_m
            }
        };
        Self {
            kappa_per_k: fibre.thermo_optic_per_k + fibre.refractive_index * fibre.thermal_expansion_per_k,
            // The beams meet a change at times that differ by n_g (2z − L)/c.
            scale_per_m2: fibre.group_index.unwrap_or(fibre.refractive_index) / (length_m * diameter_m),
            lengths_m,
            weights_m2,
            axial_m2,
            stress: (0..layers).map(|j| (inverse_square(j) - mean) / peak).collect(),
            physics: physics.clone(),
            strain: physics.materials.as_ref().map(|materials| Strain::new(materials, coil)),
        }
    }

    /// What one layer alone could make of a rate [rad/s per K/s].
    pub(crate) fn largest_layer_rad_per_k(&self) -> f64 {
        let sizes = self.weights_m2.iter().flatten().map(|w| w.abs());
        self.scale_per_m2 * self.kappa_per_k * sizes.fold(0.0, f64::max)
    }

    /// Whether a user's formula is part of the rate error.
    pub(crate) fn has_formula(&self) -> bool {
        self.physics.biases.iter().any(|bias| matches!(bias, Bias::Formula { .. }))
    }

    /// κ of a layer's fibre in half A and in half B, so warm above 20 °C.
    fn kappas_per_k(&self, layer: usize, rise_k: f64) -> [f64; 2] {
        let p = &self.physics;
        let mut kappa = self.kappa_per_k * p.path_factor;
        for strength in &p.stress_strengths {
            kappa *= 1.0 + strength * self.stress[layer];
        }
        for (_, change) in p.layer_changes.iter().filter(|(number, _)| *number == layer + 1) {
            kappa += kappa * change;
        }
        for slope in &p.path_slopes_per_k {
            kappa *= 1.0 + slope * rise_k;
        }
        let mut halves = [kappa, kappa];
        for mismatch in &p.mismatches {
            let share = mismatch.below.map_or(1.0, |(middle_k, width_k)| {
                1.0 / (1.0 + ((rise_k + REFERENCE_TEMPERATURE_K - middle_k) / width_k).exp())
            });
            halves[0] *= 1.0 - 0.5 * mismatch.relative * share;
            halves[1] *= 1.0 + 0.5 * mismatch.relative * share;
        }
        halves
    }

    /// Ω; the profile begins at 20 °C.
    pub(crate) fn rate_rad_per_s(&self, state: &State) -> f64 {
        let length_m: f64 = self.lengths_m.iter().sum();
        let mean = |values: &[f64]| values.iter().zip(&self.lengths_m).map(|(v, l)| v * l).sum::<f64>() / length_m;
        let mean_rate = mean(&state.rate_k_per_s);
        // ∫ κ Ṫ (2z − L) dz, and ∫ κ Ṫ dz with the mean κ of the halves.
        let (mut coil, mut moved) = (0.0, 0.0);
        let followed = self.strain.as_ref().map(|strain| {
            let temperatures_k: Vec<f64> = match state.rise_k.len() {
                0 => vec![REFERENCE_TEMPERATURE_K; state.rate_k_per_s.len()],
                _ => state.rise_k.iter().map(|rise| rise + REFERENCE_TEMPERATURE_K).collect(),
            };
            let paths = strain.paths(&temperatures_k, &state.rate_k_per_s);
            paths.iter().map(|path| path / self.kappa_per_k).collect::<Vec<f64>>()
        });
        for (layer, rate) in followed.as_ref().unwrap_or(&state.rate_k_per_s).iter().enumerate() {
            let [a, b] = self.kappas_per_k(layer, state.rise_k[layer]);
            let both = 0.5 * (a + b);
            coil += (a * self.weights_m2[layer][0] + b * self.weights_m2[layer][1]) * rate;
            coil += state.moment_k_per_s.get(layer).map_or(0.0, |moment| both * self.axial_m2[layer] * moment);
            moved += both * rate * self.lengths_m[layer];
        }
        let mut gain = 1.0;
        for asymmetry in &self.physics.asymmetries {
            gain *= 1.0 + asymmetry * if mean_rate == 0.0 { 0.0 } else { mean_rate.signum() };
        }
        // Surplus at end A moves every place of the coil by 2δ and the fibre's middle by δ; the surplus itself weighs
        // ∫_0^{2δ} (2z − L − 2δ) dz = −2δ L. At end B, with δ < 0, both come out with the other sign.
        let surplus = self.physics.surplus.iter().map(|s| {
            let lead_rate = if s.follows_ambient { state.ambient_rate_k_per_s } else { 0.0 };
            2.0 * s.offset_m * (moved - self.kappa_per_k * lead_rate * length_m)
        });
        let coil_rate = self.scale_per_m2 * (coil * gain + surplus.sum::<f64>());
        let mean_rise = mean(&state.rise_k);
        let bias = |b: &Bias| bias_rad_per_s(b, state, mean_rise, mean_rate, coil_rate);
        coil_rate + self.physics.biases.iter().map(bias).sum::<f64>()
    }
}

fn bias_rad_per_s(bias: &Bias, state: &State, mean_rise_k: f64, mean_rate_k_per_s: f64, coil_rate: f64) -> f64 {
    let outer = state.rise_k.len() - 1;
    match bias {
        Bias::Temperature { linear_rad_per_s_k, quadratic_rad_per_s_k2 } => {
            linear_rad_per_s_k * mean_rise_k + quadratic_rad_per_s_k2 * mean_rise_k * mean_rise_k
        }
        Bias::MeanRate { gain_rad_per_k } => gain_rad_per_k * mean_rate_k_per_s,
        Bias::GradientRate { gain_rad_per_k } => gain_rad_per_k * (state.rate_k_per_s[outer] - state.rate_k_per_s[0]),
        Bias::Formula { formula, values } => {
            // The other names are columns of a record, which a profile does not have.
            if !formula.channels().is_empty() {
                return 0.0;
            }
            let celsius = |rise_k: f64| celsius_from_kelvin(rise_k + REFERENCE_TEMPERATURE_K);
            let known = |name: &str| match name {
                "t" => state.time_s,
                "T" => celsius(state.rise_k[outer]),
                "dT_dt" => state.rate_k_per_s[outer],
                "T_in" | "T_inner" => celsius(state.rise_k[0]),
                "T_mean" => celsius(mean_rise_k),
                "mean_rate" => mean_rate_k_per_s,
                "T_ambient" => celsius(state.ambient_rise_k),
                "dT_ambient_dt" => state.ambient_rate_k_per_s,
                "thermal_rate" => deg_per_h_from_rad_per_s(coil_rate),
                of_layer => layer_value(of_layer, state, &celsius),
            };
            let arguments: Vec<f64> = formula
                .expression()
                .variables()
                .iter()
                .map(|v| match formula.parameters().iter().position(|p| *p == v.name) {
                    Some(i) => values[i],
                    None => known(&v.name),
                })
                .collect();
            rad_per_s_from_deg_per_h(formula.expression().evaluate(&arguments))
        }
    }
}

/// `T_layer_K` or `dT_layer_K_dt`, the innermost layer being the first.
fn layer_value(name: &str, state: &State, celsius: &dyn Fn(f64) -> f64) -> f64 {
    let digits: String = name.chars().filter(char::is_ascii_digit).collect();
    let layer = digits.parse::<usize>().unwrap_or(0).wrapping_sub(1);
    let of = |values: &[f64]| values.get(layer).copied().unwrap_or(f64::NAN);
    if name.starts_with('d') { of(&state.rate_k_per_s) } else { celsius(of(&state.rise_k)) }
}
