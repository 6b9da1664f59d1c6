//! The effect `sensor_lag`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, Effect, EffectSpec, Nature, ParameterSpec};
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "sensor_lag",
    summary: "The sensor follows the outer layer with a first-order lag",
    equation: "τ dT_sensor/dt = T_outer − T_sensor",
    acts: Acts::Sensor,
    nature: Nature::Physical,
    parameters: &[ParameterSpec {
        key: "lag_s",
        unit: Unit::Second,
        meaning: "time constant of the sensor",
        lower: 0.0,
        upper: 2000.0,
        start: 30.0,
        default: None,
    }],
    choices: &[],
    source: "first-order sensor dynamics; thermocouples in lacquer have lags of seconds to minutes",
    signature: "the measured error comes earlier than the predicted one by τ at each change of ramp, and is sharper",
    happens: "The sensor reaches the temperature of what it is attached to only after its own time constant, so the coil seems to answer before it is warmed.",
    remedy: "Declare the lag, or fit a smaller or better attached sensor; the coil itself is not at fault and no winding changes it.",
    experiment: "a step of the chamber's temperature with a bare second thermocouple beside the first",
    build: |values, _, _| Box::new(SensorLag { lag_s: values[0] }),
};

#[derive(Debug)]
struct SensorLag {
    lag_s: f64,
}

impl Effect for SensorLag {
    fn sensor_lag_s(&self) -> f64 {
        self.lag_s
    }
}
