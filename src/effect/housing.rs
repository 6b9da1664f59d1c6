//! The effect `housing`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, ChoiceSpec, Effect, EffectSpec, Nature, ParameterSpec};
use crate::thermal::{HeatPath, Housing, Location};
use crate::units::Unit;

/// Stefan and Boltzmann's constant [W/(m² K⁴)], CODATA 2018, exact.
const STEFAN_BOLTZMANN_W_PER_M2_K4: f64 = 5.670_374_419e-8;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "housing",
    summary: "A housing or shield of one temperature stands between the chamber and the coil, behind a gap of gas or vacuum; declared with another place, there are several",
    equation: "C dT_h/dt = g (T_inside − T_h) + film (T_outside − T_h), g = k_gas/gap + 4 ε σ T_m³ + spacers, all per area of the pack's outer surface; the film of surface_film lies outside the outermost",
    acts: Acts::HeatPath,
    nature: Nature::Physical,
    parameters: &[
        ParameterSpec {
            key: "heat_capacity_j_per_m2_k",
            unit: Unit::JoulePerSquareMetreKelvin,
            meaning: "heat capacity of the housing per area of the pack's outer surface",
            lower: 1.0,
            upper: 1e7,
            start: 5000.0,
            default: None,
        },
        ParameterSpec {
            key: "gap_mm",
            unit: Unit::Millimetre,
            meaning: "width of the gap between the housing and what lies inside it",
            lower: 0.01,
            upper: 1000.0,
            start: 2.0,
            default: None,
        },
        ParameterSpec {
            key: "gas_w_per_m_k",
            unit: Unit::WattPerMetreKelvin,
            meaning: "conductivity of what fills the gap: 0.026 for air, 0.15 for helium, 0 for a vacuum",
            lower: 0.0,
            upper: 10.0,
            start: 0.026,
            default: Some(0.026),
        },
        ParameterSpec {
            key: "emissivity",
            unit: Unit::One,
            meaning: "effective emissivity across the gap, 1/(1/ε₁ + 1/ε₂ − 1)",
            lower: 0.001,
            upper: 1.0,
            start: 0.1,
            default: Some(0.1),
        },
        ParameterSpec {
            key: "radiation_c",
            unit: Unit::Celsius,
            meaning: "T_m, about which radiation is taken as linear",
            lower: -200.0,
            upper: 300.0,
            start: 20.0,
            default: Some(20.0),
        },
        ParameterSpec {
            key: "spacers_w_per_m2_k",
            unit: Unit::WattPerSquareMetreKelvin,
            meaning: "conductance of feet, screws and wires across the gap",
            lower: 0.0,
            upper: 100000.0,
            start: 0.0,
            default: Some(0.0),
        },
    ],
    choices: &[ChoiceSpec {
        key: "place",
        options: &["first", "second", "third"],
        meaning: "which housing, counted from the coil outwards",
    }],
    source: "gap conduction and linearised radiation, Incropera et al., Fundamentals of Heat and Mass Transfer, sections 3.1 and 13.3; lumped capacitance, chapter 5",
    signature: "every change of the air's rate reaches the coil late and rounded twice: once by the housing's heat capacity behind its film, once by the gap",
    happens: "The coil sees the air only through a housing that warms late, and through the gap between the two.",
    remedy: "A heavier housing or a vacuum makes the coil's gradients smaller and longer; a sensor on the housing shows what the coil is driven by.",
    experiment: "the same ramp with the housing off, or a second sensor on the housing",
    build: |values, choices, _| {
        let [capacity, gap_m, gas, emissivity, middle_k, spacers] = [0, 1, 2, 3, 4, 5].map(|i| values[i]);
        let radiation = 4.0 * emissivity * STEFAN_BOLTZMANN_W_PER_M2_K4 * middle_k.powi(3);
        Box::new(Around(Housing {
            place: choices[0],
            heat_capacity_j_per_m2_k: capacity,
            gap_w_per_m2_k: gas / gap_m + radiation + spacers,
        }))
    },
};

#[derive(Debug)]
struct Around(Housing);

impl Effect for Around {
    fn change_heat_path(&self, path: &mut HeatPath) {
        if path.location == Location::OuterLayer {
            path.location = Location::Ambient;
        }
        path.housings.push(self.0);
        path.housings.sort_by_key(|housing| housing.place);
    }
}
