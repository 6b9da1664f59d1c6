//! The effect `stress_gradient`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, Binding, Effect, EffectSpec, FibrePlace, Nature, ParameterSpec};
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "stress_gradient",
    summary: "Elasto-optic: the thermal stress across the pack modifies the fibre's response layer by layer",
    equation: "κ_j = κ (1 + s f_j), f_j ∝ 1/r_j² less its length-weighted mean, largest |f_j| = 1",
    acts: Acts::Response,
    nature: Nature::Physical,
    parameters: &[ParameterSpec {
        key: "strength",
        unit: Unit::One,
        meaning: "s, relative change where the stress is largest",
        lower: -0.5,
        upper: 0.5,
        start: 0.03,
        default: None,
    }],
    choices: &[],
    source: "Lamé's thick ring, Timoshenko and Goodier, Theory of Elasticity (1951), section 26: the stress varies as 1/r²",
    signature: "an error ∝ the pack's mean rate during a ramp for patterns whose halves lie at different radii, besides changed transients",
    happens: "Thermal stress is largest at the bore and strains the inner layers' fibre more, so layers respond differently to the same change of temperature.",
    remedy: "A softer potting or spool, or one whose expansion matches the fibre's, lowers the stress; a winding whose halves lie at equal radii cancels most of it.",
    experiment: "coils of the same pattern potted with adhesives of different stiffness",
    build: |values, _, binding| Box::new(StressGradient { factors: factors(values[0], binding) }),
};

#[derive(Debug)]
struct StressGradient {
    /// κ_j/κ, innermost layer first.
    factors: Vec<f64>,
}

impl Effect for StressGradient {
    fn path_factor(&self, place: &FibrePlace) -> f64 {
        self.factors[place.layer]
    }
}

fn factors(strength: f64, binding: &Binding) -> Vec<f64> {
    let coil = binding.coil;
    let stress: Vec<f64> = (0..coil.layers()).map(|j| coil.layer_radius_m(j).powi(-2)).collect();
    let mean = stress.iter().zip(coil.layer_lengths_m()).map(|(s, l)| s * l).sum::<f64>() / coil.length_m();
    let peak = stress.iter().map(|s| (s - mean).abs()).fold(0.0, f64::max);
    stress.iter().map(|s| 1.0 + strength * (s - mean) / peak).collect()
}
