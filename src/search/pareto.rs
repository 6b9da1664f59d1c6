//! The trade-off between a small error and an easy winding: what nothing else beats in every respect.

use crate::numeric::order::sort_ascending;
use crate::pattern::windability::{Windability, WindingGraph};
use crate::search::evaluator::Judged;

/// A pattern with everything that it is weighed by; less is better throughout.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ParetoPoint {
    pub(crate) judged: Judged,
    pub(crate) windability: Windability,
}

/// Errors this close count as equal, so that rounding makes no trade-off.
const SAME_ERROR: f64 = 1e-6;

impl ParetoPoint {
    pub(crate) fn new(judged: Judged) -> Self {
        let windability = WindingGraph::new(&judged.pattern).windability();
        Self { judged, windability }
    }

    /// Nowhere worse and somewhere better.
    fn beats(&self, other: &Self) -> bool {
        let no_worse = |a: f64, b: f64| a <= b * (1.0 + SAME_ERROR);
        let better = |a: f64, b: f64| a < b * (1.0 - SAME_ERROR);
        let (a, b) = (&self.windability, &other.windability);
        let (error, other_error) = (self.judged.objective_rad_per_s, other.judged.objective_rad_per_s);
        let spreads = self.judged.p95_rad_per_s.zip(other.judged.p95_rad_per_s);
        let effort = |w: &Windability| [w.captive, w.max_climb, w.long_crossovers];
        no_worse(error, other_error)
            && spreads.is_none_or(|(p, q)| no_worse(p, q))
            && effort(a).iter().zip(effort(b)).all(|(x, y)| *x <= y)
            && (better(error, other_error)
                || spreads.is_some_and(|(p, q)| better(p, q))
                || effort(a).iter().zip(effort(b)).any(|(x, y)| *x < y))
    }
}

/// A point with at most this share of the error of all that are easier to wind is a knee.
const KNEE: f64 = 0.8;

/// Whether a point buys much: its error is well below that of every point that asks no more of the winding shop.
pub(crate) fn is_knee(point: &ParetoPoint, points: &[ParetoPoint]) -> bool {
    let effort = |p: &ParetoPoint| [p.windability.captive, p.windability.max_climb, p.windability.long_crossovers];
    let error = |p: &ParetoPoint| p.judged.objective_rad_per_s;
    let is_easier = |p: &&ParetoPoint| {
        effort(p) != effort(point) && effort(p).iter().zip(effort(point)).all(|(theirs, mine)| *theirs <= mine)
    };
    points.iter().filter(is_easier).all(|p| error(point) <= KNEE * error(p))
}

fn is_same(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME_ERROR * b.abs()
}

/// The points that no other beats, smallest error first; of several that are equal in every respect the first.
pub(crate) fn front(points: &[ParetoPoint]) -> Vec<ParetoPoint> {
    let mut kept: Vec<ParetoPoint> = Vec::new();
    for (index, point) in points.iter().enumerate() {
        let beaten = points.iter().any(|other| other.beats(point));
        let same_before = points[..index].iter().any(|other| {
            other.windability == point.windability
                && is_same(other.judged.objective_rad_per_s, point.judged.objective_rad_per_s)
                && match (other.judged.p95_rad_per_s, point.judged.p95_rad_per_s) {
                    (Some(a), Some(b)) => is_same(a, b),
                    _ => true,
                }
        });
        if !beaten && !same_before {
            kept.push(point.clone());
        }
    }
    sort_ascending(&mut kept, |item| item.judged.objective_rad_per_s);
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pattern::Pattern;
    use crate::search::cost::worst_case::WorstCase;

    fn point(segments: &[usize], objective_rad_per_s: f64) -> ParetoPoint {
        let worst =
            WorstCase { rate_rad_per_s: objective_rad_per_s, profile: "p".into(), profile_index: 0, time_s: 0.0 };
        let judged = Judged {
            name: "test".into(),
            pattern: Pattern::new(segments.to_vec()).unwrap(),
            worst,
            phase_rad: 0.0,
            guaranteed_rad_per_s: None,
            p95_rad_per_s: None,
            objective_rad_per_s,
            grid_margin_rad_per_s: None,
            pointing: None,
        };
        ParetoPoint::new(judged)
    }

    #[test]
    fn the_front_keeps_what_is_smaller_or_easier_and_drops_the_rest() {
        let cylindrical = point(&[1, 2, 3, 4], 3.0);
        let dipole = point(&[2, 3, 1, 4], 2.0);
        let worse_dipole = point(&[3, 2, 4, 1], 2.5);
        let captive = point(&[2, 4, 1, 3], 1.0);
        let found = front(&[cylindrical.clone(), dipole.clone(), worse_dipole, captive.clone()]);
        assert_eq!(found, [captive, dipole, cylindrical]);
    }
}
