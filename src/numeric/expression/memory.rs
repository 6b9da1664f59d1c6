//! What a formula remembers from one instant to the next.
//!
//! ```text
//! lag(x, τ):   τ dy/dt = x − y,  y = x at the start;   y₁ = y₀ + (x₀ − y₀) a + (x₁ − x₀)(1 − a τ/Δ),  a = 1 − e^{−Δ/τ}
//! play(x, h):  y as it was, pulled along where x is more than h away;  y = x at the start
//! ```
//!
//! Exact where x is linear between the instants, of whatever spacing. An instant at which x has no value changes nothing.
//!
//! # Source
//! The lag: any text on linear systems. The play operator: Krasnosel'skii and Pokrovskii, Systems with Hysteresis (1989).

/// What a call remembers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Keeper {
    Lag,
    Play,
}

impl Keeper {
    pub(crate) fn named(function: &str) -> Option<Self> {
        match function {
            "lag" => Some(Keeper::Lag),
            "play" => Some(Keeper::Play),
            _ => None,
        }
    }

    pub(crate) fn name(self) -> &'static str {
        match self {
            Keeper::Lag => "lag",
            Keeper::Play => "play",
        }
    }

    /// The value once the input has gone to `x` in `step_s`.
    fn follow(self, from: &Slot, x: f64, step_s: f64, size: f64) -> f64 {
        match self {
            Keeper::Play => from.value.max(x - size).min(x + size),
            Keeper::Lag if size == 0.0 => x,
            Keeper::Lag => {
                let steps = step_s.max(0.0) / size;
                if steps == 0.0 {
                    return from.value;
                }
                let gone = -(-steps).exp_m1();
                from.value + (from.input - from.value) * gone + (x - from.input) * (1.0 - gone / steps)
            }
        }
    }
}

/// One call's last instant.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Slot {
    time_s: f64,
    input: f64,
    value: f64,
}

/// What a formula remembers; empty: at rest.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Memory {
    slots: Vec<Option<Slot>>,
}

impl Memory {
    /// play(x, h) of an effect that remembers nothing else.
    pub(crate) fn play(&mut self, time_s: f64, x: f64, half_width: f64) -> f64 {
        self.at(time_s, 1).remember(Keeper::Play, 0, x, half_width)
    }

    pub(super) fn at(&mut self, time_s: f64, count: usize) -> After<'_> {
        self.slots.resize(count, None);
        After { memory: self, time_s }
    }
}

/// Where calls that remember get their values.
pub(super) trait Recall {
    fn remember(&mut self, keeper: Keeper, slot: usize, x: f64, size: f64) -> f64;
}

/// Nothing came before.
pub(super) struct AtRest;

impl Recall for AtRest {
    fn remember(&mut self, _: Keeper, _: usize, x: f64, size: f64) -> f64 {
        if size >= 0.0 { x } else { f64::NAN }
    }
}

/// An instant after others.
pub(super) struct After<'a> {
    memory: &'a mut Memory,
    time_s: f64,
}

impl Recall for After<'_> {
    fn remember(&mut self, keeper: Keeper, slot: usize, x: f64, size: f64) -> f64 {
        if !x.is_finite() || !(size >= 0.0) {
            return f64::NAN;
        }
        let value = match &self.memory.slots[slot] {
            Some(from) => keeper.follow(from, x, self.time_s - from.time_s, size),
            None => x,
        };
        self.memory.slots[slot] = Some(Slot { time_s: self.time_s, input: x, value });
        value
    }
}

#[cfg(test)]
mod tests {
    use super::super::Expression;
    use super::*;

    fn course(formula: &str, times_s: &[f64], x: impl Fn(f64) -> f64) -> Vec<f64> {
        let e = Expression::parse(formula).unwrap();
        let mut memory = Memory::default();
        times_s.iter().map(|&t| e.evaluate_after(&[x(t)], t, &mut memory)).collect()
    }

    #[test]
    fn the_lag_of_a_ramp_is_its_closed_form_whatever_the_spacing() {
        let times_s = [0.0, 0.01, 3.0, 10.0, 400.0, 401.0, 9000.0];
        for (t, y) in times_s.iter().zip(course("lag(x, 900)", &times_s, |t| 20.0 + 0.02 * t)) {
            let exact = 20.0 + 0.02 * (t - 900.0 * (1.0 - (-t / 900.0).exp()));
            assert!((y - exact).abs() < 1e-10, "{t}: {y} {exact}");
        }
    }

    #[test]
    fn a_lag_within_a_lag_and_one_of_a_size_are_lags_of_what_stands_in_them() {
        let times_s: Vec<f64> = (0..400).map(|k| 5.0 * f64::from(k)).collect();
        let inner = course("lag(abs(x), 300)", &times_s, |t| (t / 700.0).sin());
        let sizes = course("lag(x, 300)", &times_s, |t| (t / 700.0).sin().abs());
        assert_eq!(inner, sizes);
        let twice = course("lag(lag(x, 300), 100)", &times_s, |t| 0.01 * t);
        let (t, a, b) = (1995.0, 300.0, 100.0);
        let exact = 0.01 * (t - a - b + (a * a * f64::exp(-t / a) - b * b * f64::exp(-t / b)) / (a - b));
        // The inner lag is not linear between instants of 5 s: what is left of that.
        assert!((twice[399] - exact).abs() < 1e-4, "{} {exact}", twice[399]);
    }

    #[test]
    fn play_stands_still_within_its_width_and_is_pulled_along_beyond_it() {
        let xs = [0.0, 1.0, 3.0, 5.0, 4.0, 2.0, 1.0, -4.0];
        let times_s: Vec<f64> = (0..8).map(f64::from).collect();
        let found = course("play(x, 2)", &times_s, |t| xs[t as usize]);
        assert_eq!(found, [0.0, 0.0, 1.0, 3.0, 3.0, 3.0, 3.0, -2.0]);
    }

    #[test]
    fn an_instant_without_a_value_changes_nothing() {
        let e = Expression::parse("lag(x, 50)").unwrap();
        let (mut gap, mut without) = (Memory::default(), Memory::default());
        for (t, x) in [(0.0, 1.0), (10.0, f64::NAN), (20.0, 3.0)] {
            let y = e.evaluate_after(&[x], t, &mut gap);
            assert_eq!(y.is_nan(), x.is_nan());
            if x.is_finite() {
                assert_eq!(e.evaluate_after(&[x], t, &mut without), y);
            }
        }
    }
}
