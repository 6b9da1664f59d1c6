//! What is left over, as JSON.

use super::*;

#[test]
fn a_wander_has_a_time_constant_and_a_cycle_a_period() {
    let told = |shape| PlainJson::new(&Plain { shape, gain: 40.0, parameters: 2, rms_rad_per_s: 1e-6 });
    let (wander, cycle) =
        (told(ResidualShape::Drift { time_constant_s: 300.0 }), told(ResidualShape::Sinusoid { period_s: 900.0 }));
    assert_eq!((wander.time_constant_s, wander.period_s), (Some(300.0), None));
    assert_eq!((cycle.time_constant_s, cycle.period_s), (None, Some(900.0)));
}
