//! Where a record begins: the mean and the covariance of all states before its first row.

use nalgebra::SMatrix;

use super::filter::RATE;
use super::layout::{Layout, Numbers, Parts};
use super::prior::{OFFSET_RAD_PER_S, Quantity, START_APART_K, START_APART_MODES, START_APART_S, START_K};
use super::series::Series;
use super::stationary::followed;
use crate::numeric::statistics::median;

/// Mean and covariance before the first row.
pub(super) fn start(
    parts: &Parts,
    layout: &Layout,
    f: &[f64],
    numbers: &Numbers,
    series: &Series,
) -> (Vec<f64>, Vec<f64>) {
    let n = layout.size;
    let mut mean = vec![0.0; n];
    let rates: Vec<f64> = series.values[RATE].iter().copied().filter(|v| v.is_finite()).collect();
    mean[layout.offset] = median(&rates);
    let mut covariance = stationary(layout, f, numbers);
    let mut add = |direction: &[f64], size: f64| {
        for i in (0..n).filter(|&i| direction[i] != 0.0) {
            for j in 0..n {
                covariance[i * n + j] += size * size * direction[i] * direction[j];
            }
        }
    };
    let slow: Vec<usize> = (0..layout.modes).chain(layout.skin).chain(layout.lag).collect();
    let mut together = vec![0.0; n];
    slow.iter().for_each(|&i| together[i] = 1.0);
    let mut ramp = vec![0.0; n];
    ramp[layout.trend + 1] = 1.0;
    layout.control.into_iter().for_each(|i| ramp[i + 1] = 1.0);
    layout.onset.into_iter().for_each(|i| ramp[i] = 1.0);
    let skin_s = parts.skin_s.unwrap_or(0.0);
    parts.reduced.decay_per_s.iter().enumerate().for_each(|(i, l)| ramp[i] = -1.0 / l - skin_s);
    layout.skin.into_iter().for_each(|i| ramp[i] = -skin_s);
    layout.lag.into_iter().for_each(|i| ramp[i] = -parts.lag_s + ramp[0]);
    let slope = numbers.get(Quantity::StartSlope);
    let apart = START_APART_K.hypot(START_APART_S * slope);
    add(&ramp, slope);
    add(&together, apart);
    together[layout.trend] = 1.0;
    add(&together, START_K);
    let mut one = |i: usize, size: f64| {
        let mut direction = vec![0.0; n];
        direction[i] = 1.0;
        add(&direction, size);
    };
    one(layout.trend + 1, slope);
    if let Some(i) = layout.control {
        one(i, slope / numbers.get(Quantity::ControlTime));
        one(i + 1, slope);
    }
    layout.onset.into_iter().for_each(|i| one(i, slope));
    (0..layout.modes).for_each(|i| one(i, START_APART_MODES * apart));
    one(layout.turbulence, numbers.get(Quantity::TurbulenceSize));
    one(layout.wander, numbers.get(Quantity::WanderShare) * numbers.get(Quantity::RateNoise));
    layout.drift.into_iter().for_each(|i| one(i, numbers.get(Quantity::DriftSize)));
    layout
        .cycle
        .into_iter()
        .for_each(|i| [i, i + 1].into_iter().for_each(|i| one(i, numbers.get(Quantity::CycleSize))));
    one(layout.offset, OFFSET_RAD_PER_S);
    // ⟨o²⟩ = ⟨o d⟩ = σ², ⟨d²⟩ = 2 σ².
    let ripple = numbers.get(Quantity::RippleSize);
    for (i, driver) in [(layout.ripple, layout.driver), (layout.ripple + 1, layout.driver + 1)] {
        let mut direction = vec![0.0; n];
        (direction[i], direction[driver]) = (1.0, 1.0);
        add(&direction, ripple);
        direction[i] = 0.0;
        add(&direction, ripple);
    }
    (mean, covariance)
}

/// What turbulence and ripple have made of pack and sensor.
fn stationary(layout: &Layout, f: &[f64], numbers: &Numbers) -> Vec<f64> {
    let square = |q: Quantity| numbers.get(q).powi(2);
    let (turbulence, ripple) = (square(Quantity::TurbulenceSize), square(Quantity::RippleSize));
    let driving = [layout.turbulence, layout.ripple, layout.ripple + 1, layout.driver, layout.driver + 1];
    // As in `start`.
    let own = SMatrix::from_fn(|a, b| match (a, b) {
        (0, 0) => turbulence,
        (3, 3) | (4, 4) => 2.0 * ripple,
        (1, 1) | (2, 2) | (1, 3) | (3, 1) | (2, 4) | (4, 2) => ripple,
        _ => 0.0,
    });
    let followers: Vec<usize> = layout.skin.into_iter().chain(0..layout.modes).chain(layout.lag).collect();
    followed(f, layout.size, driving, &own, &followers)
}
