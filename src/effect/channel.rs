//! `channel:NAME`: a bias that is linear in a further column of the record, such as a supply voltage.
//!
//! A profile has no further columns; there the effect adds nothing.

use super::{Acts, Binding, Effect, EffectSpec, Nature, PackState, ParameterSpec, Subject};
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "channel:NAME",
    summary: "A bias that is linear in the record's column NAME",
    equation: "Ω_b = b · c",
    acts: Acts::Outside,
    nature: Nature::Empirical,
    parameters: &[ParameterSpec {
        key: "gain_deg_per_h_per_unit",
        unit: Unit::DegPerHourPerUnit,
        meaning: "b, rate per unit of the column",
        lower: -1e6,
        upper: 1e6,
        start: 0.1,
        default: None,
    }],
    choices: &[],
    source: "empirical: a linear coefficient for whatever was logged beside temperature and rate",
    signature: "the residual follows the column, whatever the temperature does",
    happens: "The rate follows a logged quantity that has nothing to do with the coil's heat, such as a supply voltage or a laser current.",
    remedy: "Stabilise that quantity, or compensate with the logged column; no winding changes it.",
    experiment: "vary the logged quantity at constant temperature",
    build: |values, _, binding| Box::new(ChannelBias { gain_rad_per_s_per_unit: values[0], column: column(binding) }),
};

#[derive(Debug)]
struct ChannelBias {
    gain_rad_per_s_per_unit: f64,
    /// None where there is no such column.
    column: Option<usize>,
}

fn column(binding: &Binding) -> Option<usize> {
    match binding.subject {
        Subject::Channel(name) => binding.channels.iter().position(|c| c == name),
        Subject::None | Subject::Formula(_) | Subject::Materials(_) => None,
    }
}

impl Effect for ChannelBias {
    fn outside_rate_rad_per_s(&self, state: &PackState) -> f64 {
        let value = self.column.and_then(|c| state.channels.get(c)).copied().unwrap_or(0.0);
        self.gain_rad_per_s_per_unit * value
    }

    fn is_beside_coil(&self) -> bool {
        true
    }
}
