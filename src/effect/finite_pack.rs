//! The effect `finite_pack`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, Effect, EffectSpec, Nature};
use crate::thermal::{Extent, HeatPath};

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "finite_pack",
    summary: "The pack ends at an adiabatic bore instead of a half space",
    equation: "K (1/r) d/dr(r dT/dr) = dT/dt, dT/dr = 0 at r = r_in",
    acts: Acts::HeatPath,
    nature: Nature::Physical,
    parameters: &[],
    choices: &[],
    source: "Shupe, Appl. Opt. 19, 654 (1980); heat conduction in a hollow cylinder, Carslaw and Jaeger (1959), chapter 7",
    signature: "after each change of ramp the measured error dies out within (pack thickness)²/K, where the half space predicts a tail falling as 1/√t",
    happens: "Heat that reaches the bore cannot go further, so the inner layers catch up with the outer ones instead of trailing for ever.",
    remedy: "Declare the winding as a pack (thermal.model = \"pack\") with its conductivity and heat capacity, and evaluate windings with that model.",
    experiment: "one long ramp at constant rate: with a finite pack the error settles to a constant within minutes",
    build: |_, _, _| Box::new(FinitePack),
};

#[derive(Debug)]
struct FinitePack;

impl Effect for FinitePack {
    fn change_heat_path(&self, path: &mut HeatPath) {
        path.extent = Extent::Pack;
    }
}
