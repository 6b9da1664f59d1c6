//! The effect `midpoint_offset`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, ChoiceSpec, Effect, EffectSpec, Lead, Nature, ParameterSpec, SurplusFibre};
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "midpoint_offset",
    summary: "Surplus fibre 2δ at one end lies outside the pack, so the coil's middle is not the fibre's",
    equation: "|ΔΩ| = n κ 2δ |Ṫ_lead − Ṫ_pack|/D; δ > 0: surplus at end A",
    acts: Acts::Response,
    nature: Nature::Physical,
    parameters: &[ParameterSpec {
        key: "offset_m",
        unit: Unit::Metre,
        meaning: "δ, half the surplus length; positive at end A",
        lower: -20.0,
        upper: 20.0,
        start: 0.1,
        default: None,
    }],
    choices: &[ChoiceSpec {
        key: "lead",
        options: &["ambient", "isothermal"],
        meaning: "what the surplus fibre's temperature follows",
    }],
    source: "trimming of FOG coils: 0.50 °/h per metre per °C/min at D = 0.1 m",
    signature: "with an isothermal lead a step ∝ the pack's mean rate during a ramp; with an ambient lead a transient while the pack lags behind the air",
    happens: "Surplus fibre at one end lies outside the pack, so the coil's middle is not the fibre's and the halves no longer answer each other.",
    remedy: "Trim the longer lead by twice the offset, or keep both leads at the pack's temperature.",
    experiment: "heat the lead alone; trim a known length and repeat the ramp",
    build: |values, choices, _| {
        let lead = if choices[0] == 0 { Lead::Ambient } else { Lead::Isothermal };
        Box::new(MidpointOffset(SurplusFibre { offset_m: values[0], lead }))
    },
};

#[derive(Debug)]
struct MidpointOffset(SurplusFibre);

impl Effect for MidpointOffset {
    fn surplus_fibre(&self) -> Option<SurplusFibre> {
        Some(self.0)
    }
}
