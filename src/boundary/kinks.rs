//! Maximum likelihood of the air's kinks, the film and the jerk's noise.

use super::air::{AirSpace, KINK_VARIANCE_K2_PER_S2, Scene};
use super::layout::Shock;
use super::{Air, BoundaryError, Kink, Start};
use crate::numeric::state_space::Smoothed;
use crate::thermal::Location;

/// Where the search begins: free air in a chamber [W/(m² K)].
const FIRST_FILM_W_PER_M2_K: f64 = 30.0;
const FILM_BOUNDS_W_PER_M2_K: (f64, f64) = (0.5, 1e5);
const FIRST_JERK_NOISE_K2_PER_S7: f64 = 1e-22;
const JERK_NOISE_BOUNDS_K2_PER_S7: (f64, f64) = (1e-28, 1e-12);
/// A shock must be as significant as this [χ², one degree of freedom] to be added as a kink …
const SIGNIFICANT: f64 = 20.0;
/// … and this share of the most significant one: the others may be its shadows.
const SHARE_OF_LARGEST: f64 = 0.25;
/// Kinks added in one round keep this distance [intervals].
const APART_INTERVALS: f64 = 25.0;
/// A kink smaller than this many standard deviations is dropped.
const STANDING_OUT: f64 = 6.0;
const MAX_KINKS: usize = 80;
const MAX_ROUNDS: usize = 25;
/// What a kink must add to the log-likelihood: half the logarithm of a few thousand rows.
const KINK_COST: f64 = 4.0;
/// Kinks closer than this may be one [intervals] …
const CLOSE_INTERVALS: f64 = 8.0;
/// … also if that costs this much likelihood: it is gained back when the film is fitted again.
const MERGE_SLACK: f64 = 6.0;
/// Searches, each with the film that the last one found.
const MAX_PASSES: usize = 4;
/// Newton steps for the kinks' times at most; they stop by themselves when nothing moves.
const NEWTON_STEPS: usize = 6;
/// Nothing is moved for less than this of the log-likelihood: it is a seventh of a standard deviation.
const WORTH_A_STEP: f64 = 0.01;
/// Times that kinks and film are placed in turn.
const SETTLING_ROUNDS: usize = 3;
/// No thermocouple is better [K].
const LEAST_NOISE_K: f64 = 1e-5;

/// Finds the air's model from nothing.
pub(super) fn search(scene: &mut Scene) -> Result<Air, BoundaryError> {
    let mut air = Air {
        film_w_per_m2_k: (scene.location == Location::OuterLayer).then_some(FIRST_FILM_W_PER_M2_K),
        jerk_noise_k2_per_s7: FIRST_JERK_NOISE_K2_PER_S7,
        kinks: Vec::new(),
        noise_k: reading_noise_k(&scene.temperature_k),
    };
    grow(scene, &mut air)?;
    air = refine(scene, air)?;
    // Kinks that were placed under the wrong film leave shadows beside them, and jerk in the place of others.
    let mut merit = merit_of(scene, &air)?;
    for _ in 1..MAX_PASSES {
        let again = adapt(scene, air.clone(), Start::Elsewhere)?;
        let found = merit_of(scene, &again)?;
        if found < merit + 1.0 {
            break;
        }
        (merit, air) = (found, again);
    }
    Ok(air)
}

/// Adds kinks while any would be significant, everything else following.
fn grow(scene: &Scene, air: &mut Air) -> Result<(), BoundaryError> {
    for _ in 0..MAX_ROUNDS {
        let added = significant_shocks(scene, air)?;
        if added.is_empty() || air.kinks.len() >= MAX_KINKS {
            break;
        }
        air.kinks.extend(added.into_iter().map(|time_s| Kink { time_s, slope_change_k_per_s: 0.0 }));
        air.kinks.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        place_kinks(scene, air, NEWTON_STEPS)?;
        ascend_film(scene, air, 0.3, 2)?;
        ascend_jerk_noise(scene, air, 2.0, 2)?;
        place_kinks(scene, air, NEWTON_STEPS)?;
    }
    Ok(())
}

/// Finds the air's model beginning with what was found before.
pub(super) fn adapt(scene: &mut Scene, known: Air, start: Start) -> Result<Air, BoundaryError> {
    let mut air = known;
    connect(scene, &mut air);
    match start {
        Start::Elsewhere => {
            air.noise_k = reading_noise_k(&scene.temperature_k);
            air.jerk_noise_k2_per_s7 = air.jerk_noise_k2_per_s7.min(FIRST_JERK_NOISE_K2_PER_S7);
            place_kinks(scene, &mut air, NEWTON_STEPS)?;
            ascend_film(scene, &mut air, 0.3, 2)?;
        }
        Start::Nearby | Start::Beside => settle(scene, &mut air)?,
    }
    if start == Start::Beside {
        return Ok(air);
    }
    grow(scene, &mut air)?;
    refine(scene, air)
}

/// A film where there is one to be estimated, none elsewhere.
fn connect(scene: &Scene, air: &mut Air) {
    if scene.location == Location::Ambient {
        air.film_w_per_m2_k = None;
    } else if air.film_w_per_m2_k.is_none() {
        air.film_w_per_m2_k = Some(FIRST_FILM_W_PER_M2_K);
    }
}

/// Improves a model that is nearly right.
fn refine(scene: &mut Scene, mut air: Air) -> Result<Air, BoundaryError> {
    place_kinks(scene, &mut air, NEWTON_STEPS)?;
    drop_idle_kinks(scene, &mut air)?;
    merge_close_kinks(scene, &mut air)?;
    ascend_film(scene, &mut air, 0.1, 3)?;
    ascend_jerk_noise(scene, &mut air, 1.0, 2)?;
    settle(scene, &mut air)?;
    Ok(air)
}

/// Kinks and film in turn until neither moves, then the sensor's noise.
fn settle(scene: &Scene, air: &mut Air) -> Result<(), BoundaryError> {
    place(scene, air)?;
    let smoothed = smooth(scene, air)?.1;
    let ratio = smoothed.squared_innovations / smoothed.measurements as f64;
    air.noise_k = (air.noise_k * ratio.sqrt().clamp(0.5, 2.0)).max(LEAST_NOISE_K);
    Ok(())
}

/// Kinks and film in turn until neither moves.
pub(super) fn place(scene: &Scene, air: &mut Air) -> Result<(), BoundaryError> {
    for _ in 0..SETTLING_ROUNDS {
        place_kinks(scene, air, NEWTON_STEPS)?;
        let before = air.film_w_per_m2_k;
        ascend_film(scene, air, 0.02, 2)?;
        if air.film_w_per_m2_k == before {
            break;
        }
    }
    Ok(())
}

/// Noise of one reading, from third differences: a median, so that kinks do not count.
fn reading_noise_k(temperature_k: &[f64]) -> f64 {
    let mut differences: Vec<f64> =
        temperature_k.windows(4).map(|w| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).abs()).collect();
    differences.sort_by(f64::total_cmp);
    // var of a third difference of white noise: 1 + 9 + 9 + 1; median |x| of a Gaussian: 0.6745 σ.
    (differences[differences.len() / 2] / 0.6745 / 20.0_f64.sqrt()).max(LEAST_NOISE_K)
}

fn smooth(scene: &Scene, air: &Air) -> Result<(AirSpace, Smoothed), BoundaryError> {
    let built = scene.space(air)?;
    let smoothed = built.space.scores();
    Ok((built, smoothed))
}

fn log_likelihood(scene: &Scene, air: &Air) -> Result<f64, BoundaryError> {
    Ok(scene.space(air)?.space.log_likelihood())
}

/// Times at which a further shock to the slope would be most significant.
fn significant_shocks(scene: &Scene, air: &Air) -> Result<Vec<f64>, BoundaryError> {
    let (built, smoothed) = smooth(scene, air)?;
    let near_s = 1.2 * scene.interval_s;
    let mut shocks: Vec<(f64, f64)> = built
        .reading_stages
        .iter()
        .zip(&scene.times_s)
        .filter(|&(_, &time_s)| air.kinks.iter().all(|k| (k.time_s - time_s).abs() > near_s))
        .map(|(&stage, &time_s)| {
            let place = Shock::Slope.place(stage);
            (smoothed.score[place].powi(2) / smoothed.information[place].max(f64::MIN_POSITIVE), time_s)
        })
        .collect();
    shocks.sort_by(|a, b| b.0.total_cmp(&a.0));
    let Some(&(largest, _)) = shocks.first() else { return Ok(Vec::new()) };
    let threshold = SIGNIFICANT.max(SHARE_OF_LARGEST * largest);
    let mut added: Vec<f64> = Vec::new();
    for (_, time_s) in shocks.into_iter().take_while(|s| s.0 >= threshold) {
        if added.iter().all(|a| (a - time_s).abs() > APART_INTERVALS * scene.interval_s) {
            added.push(time_s);
        }
    }
    Ok(added)
}

/// Newton steps for the kinks' times and sizes, all at once.
fn place_kinks(scene: &Scene, air: &mut Air, steps: usize) -> Result<(), BoundaryError> {
    let (first_s, last_s) = (scene.times_s[0], scene.times_s[scene.times_s.len() - 1]);
    let (longest_s, closest_s) = (3.0 * scene.interval_s, 0.6 * scene.interval_s);
    for step in 0..=steps {
        if air.kinks.is_empty() {
            return Ok(());
        }
        let (built, smoothed) = smooth(scene, air)?;
        let sizes = built.kink_sizes(&smoothed);
        let leads_s = built.kink_leads_s(&smoothed, air);
        let expected = built.gain_of_moving(&smoothed);
        let mut farthest_s = 0.0_f64;
        for (i, kink) in air.kinks.iter_mut().enumerate() {
            kink.slope_change_k_per_s = sizes[i].0;
            let move_s = (-leads_s[i]).clamp(-longest_s, longest_s);
            if step < steps && move_s.is_finite() {
                let inside_s = 0.1 * scene.interval_s;
                kink.time_s = (kink.time_s + move_s).clamp(first_s + inside_s, last_s - inside_s);
                farthest_s = farthest_s.max(move_s.abs());
            }
        }
        air.kinks.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        if step < steps && (farthest_s < 0.03 * scene.interval_s || expected < WORTH_A_STEP) {
            break;
        }
    }
    air.kinks.dedup_by(|later, earlier| {
        let merged = later.time_s - earlier.time_s < closest_s;
        if merged {
            earlier.slope_change_k_per_s += later.slope_change_k_per_s;
        }
        merged
    });
    Ok(())
}

/// Drops the least significant kink until all stand out.
fn drop_idle_kinks(scene: &Scene, air: &mut Air) -> Result<(), BoundaryError> {
    while !air.kinks.is_empty() {
        let (built, smoothed) = smooth(scene, air)?;
        let sizes = built.kink_sizes(&smoothed);
        let least = (0..sizes.len()).min_by(|&a, &b| sizes[a].1.total_cmp(&sizes[b].1)).unwrap_or(0);
        if sizes[least].1 > STANDING_OUT {
            break;
        }
        air.kinks.remove(least);
    }
    Ok(())
}

/// Puts one kink in the place of those that are close, where the likelihood does not ask for more: all at once, then
/// pair by pair.
fn merge_close_kinks(scene: &Scene, air: &mut Air) -> Result<(), BoundaryError> {
    let close_s = CLOSE_INTERVALS * scene.interval_s;
    let merit = merit_of(scene, air)?;
    let mut trial = air.clone();
    trial.kinks.dedup_by(|later, earlier| {
        let close = later.time_s - earlier.time_s < close_s;
        if close {
            *earlier = merged(earlier, later);
        }
        close
    });
    if trial.kinks.len() < air.kinks.len() {
        place_kinks(scene, &mut trial, NEWTON_STEPS)?;
        ascend_jerk_noise(scene, &mut trial, 2.0, 2)?;
        ascend_film(scene, &mut trial, 0.1, 1)?;
        place_kinks(scene, &mut trial, NEWTON_STEPS)?;
        if merit_of(scene, &trial)? > merit {
            *air = trial;
            return Ok(());
        }
    }
    let mut merit = merit;
    let mut first = 0;
    while first + 1 < air.kinks.len() {
        let (a, b) = (air.kinks[first], air.kinks[first + 1]);
        if b.time_s - a.time_s < close_s {
            let mut trial = air.clone();
            trial.kinks.remove(first + 1);
            trial.kinks[first] = merged(&a, &b);
            place_kinks(scene, &mut trial, NEWTON_STEPS)?;
            let trial_merit = merit_of(scene, &trial)?;
            if trial_merit > merit - MERGE_SLACK && trial.kinks.len() < air.kinks.len() {
                *air = trial;
                merit = trial_merit;
                continue;
            }
        }
        first += 1;
    }
    Ok(())
}

fn merged(a: &Kink, b: &Kink) -> Kink {
    let total = a.slope_change_k_per_s + b.slope_change_k_per_s;
    let centre_s = (a.slope_change_k_per_s * a.time_s + b.slope_change_k_per_s * b.time_s) / total;
    let time_s = if centre_s.is_finite() { centre_s.clamp(a.time_s, b.time_s) } else { a.time_s };
    Kink { time_s, slope_change_k_per_s: total }
}

/// What a model is worth: its log-likelihood less what its kinks cost.
fn merit_of(scene: &Scene, air: &Air) -> Result<f64, BoundaryError> {
    Ok(log_likelihood(scene, air)? - KINK_COST * air.kinks.len() as f64)
}

/// Climbs the likelihood along ln h. What the kinks' times would do meanwhile is in the likelihood: small shifts of them
/// are integrated out.
fn ascend_film(scene: &Scene, air: &mut Air, step: f64, rounds: usize) -> Result<(), BoundaryError> {
    let Some(film) = air.film_w_per_m2_k else { return Ok(()) };
    let bounds = (FILM_BOUNDS_W_PER_M2_K.0.ln(), FILM_BOUNDS_W_PER_M2_K.1.ln());
    let at = |log_film: f64, from: &Air| -> Result<(f64, Air), BoundaryError> {
        let trial = Air { film_w_per_m2_k: Some(log_film.exp()), ..from.clone() };
        Ok((log_likelihood(scene, &trial)?, trial))
    };
    *air = ascend(air.clone(), film.ln(), step, rounds, bounds, at)?;
    Ok(())
}

fn ascend_jerk_noise(scene: &Scene, air: &mut Air, step: f64, rounds: usize) -> Result<(), BoundaryError> {
    let bounds = (JERK_NOISE_BOUNDS_K2_PER_S7.0.ln(), JERK_NOISE_BOUNDS_K2_PER_S7.1.ln());
    let start = air.jerk_noise_k2_per_s7.ln();
    let at = |log_noise: f64, from: &Air| -> Result<(f64, Air), BoundaryError> {
        let trial = Air { jerk_noise_k2_per_s7: log_noise.exp(), ..from.clone() };
        Ok((log_likelihood(scene, &trial)?, trial))
    };
    *air = ascend(air.clone(), start, step, rounds, bounds, at)?;
    Ok(())
}

/// Parabolas through three points, walking uphill where the likelihood is not concave.
fn ascend(
    start: Air,
    x: f64,
    step: f64,
    rounds: usize,
    (low, high): (f64, f64),
    at: impl Fn(f64, &Air) -> Result<(f64, Air), BoundaryError>,
) -> Result<Air, BoundaryError> {
    let (mut x, mut step) = (x, step);
    let (mut best, mut air) = at(x, &start)?;
    for _ in 0..rounds {
        let (left, right) = ((x - step).max(low), (x + step).min(high));
        let (below, air_below) = at(left, &air)?;
        let (above, air_above) = at(right, &air)?;
        let curvature = below - 2.0 * best + above;
        if !curvature.is_finite() {
            break;
        }
        let towards = if curvature < 0.0 {
            (0.5 * step * (below - above) / curvature).clamp(-3.0 * step, 3.0 * step)
        } else {
            3.0 * step * (above - below).signum()
        };
        let trial_x = (x + towards).clamp(low, high);
        let expected = if curvature < 0.0 { (above - below).powi(2) / (-8.0 * curvature) } else { f64::INFINITY };
        if (expected < WORTH_A_STEP && best >= below.max(above)) || trial_x == x {
            break;
        }
        let (trial, air_trial) = at(trial_x, &air)?;
        let candidates = [(trial, trial_x, air_trial), (below, left, air_below), (above, right, air_above)];
        for (value, place, candidate) in candidates {
            if value > best {
                (best, x, air) = (value, place, candidate);
            }
        }
        // Three standard deviations, where there is a maximum: there a parabola is all that there is.
        step =
            if towards.abs() >= 2.0 * step { 1.5 * step } else { step * (3.0 / (-curvature).sqrt()).clamp(0.02, 1.0) };
    }
    Ok(air)
}

impl AirSpace {
    /// Expected size of each kink, and how many of its own standard deviations that is.
    fn kink_sizes(&self, smoothed: &Smoothed) -> Vec<(f64, f64)> {
        self.kink_stages
            .iter()
            .map(|&stage| {
                let place = Shock::Slope.place(stage);
                let size = KINK_VARIANCE_K2_PER_S2 * smoothed.score[place];
                let variance = KINK_VARIANCE_K2_PER_S2 * (1.0 - KINK_VARIANCE_K2_PER_S2 * smoothed.information[place]);
                (size, size.abs() / variance.max(f64::MIN_POSITIVE).sqrt())
            })
            .collect()
    }

    /// By how much each kink comes earlier than assumed, all at once [s].
    fn kink_leads_s(&self, smoothed: &Smoothed, air: &Air) -> Vec<f64> {
        let lead_s = |(&stage, kink): (&usize, &Kink), size_k_per_s: f64| {
            let place = Shock::Earlier.place(stage);
            let prior = self.space.stages[stage].disturbances.iter().find(|d| d.0 == Shock::Earlier as usize);
            let shift_k = match prior {
                Some(&(_, variance)) if kink.slope_change_k_per_s != 0.0 => variance * smoothed.score[place],
                // A new kink has no size yet and so no prior: as if it moved alone.
                _ => smoothed.score[place] / smoothed.information[place].max(f64::MIN_POSITIVE),
            };
            shift_k / size_k_per_s
        };
        let sizes = self.kink_sizes(smoothed);
        self.kink_stages.iter().zip(&air.kinks).zip(sizes).map(|(at, (size, _))| lead_s(at, size)).collect()
    }

    /// By how much the log-likelihood rises when all kinks move to where they should be, as far as it is a parabola.
    fn gain_of_moving(&self, smoothed: &Smoothed) -> f64 {
        self.kink_stages
            .iter()
            .map(|&stage| {
                let score = smoothed.score[Shock::Earlier.place(stage)];
                let prior = self.space.stages[stage].disturbances.iter().find(|d| d.0 == Shock::Earlier as usize);
                0.5 * score * score * prior.map_or(0.0, |d| d.1)
            })
            .sum()
    }
}
