//! Descent through all orders of a few neighbours, where a walk can afford too few moves to come upon them.
//!
//! Neighbouring layers exchange their segments in every order, and so do the layers of segments that follow one another on
//! the fibre: 7! orders of each. The best step of all windows is taken until none is better; where few neighbours bring
//! nothing, more of them are tried.

use std::ops::Range;

use rayon::prelude::*;

use super::limits::neighbour;
use super::quantile::QuantileCost;
use super::restart::generator;
use super::rounds::FoundPattern;
use crate::search::cost::sampled_coils::QuantileWorst;

/// Neighbours of a window: few as long as that helps.
const WIDTHS: [usize; 3] = [5, 6, 7];

/// Orders of all windows of a width at most, or it is not tried: wide ones of more than 26 layers.
const MOST_ORDERS: usize = 200_000;

/// Descents of a round, how many steps off the best pattern they begin, and rounds without a better one after which no more
/// follow. Two seeds of 24 layers with one captive run ended on one pattern so; with three steps, or two rounds, they did not.
const STARTS: u64 = 12;
const STEPS_OFF: usize = 6;
const PATIENCE: usize = 3;

/// Of the steps off the best: the same for every search, so that what one comes upon no other misses.
const STEPS_SEED: u64 = 1;

/// A step that brings no more than this share is rounding.
const ROUNDING: f64 = 1e-9;

/// What lies in a window.
#[derive(Debug, Clone)]
enum Window {
    Layers(Range<usize>),
    Segments(Range<usize>),
}

impl QuantileCost {
    /// The best of descents from given patterns, and from a few steps off the best of them as long as that brings better ones.
    pub(super) fn followed(&self, starts: &[Vec<usize>]) -> Option<FoundPattern> {
        let mut best = self.best_descended(starts)?;
        let (mut round, mut idle) = (0, 0);
        while idle < PATIENCE {
            let near: Vec<Vec<usize>> = (0..STARTS)
                .map(|start| {
                    let mut random = generator(STEPS_SEED, round * STARTS + start);
                    let step = |at: Vec<usize>, _| neighbour(self.limits, &at, &mut random).unwrap_or(at);
                    (0..STEPS_OFF).fold(best.segments.clone(), step)
                })
                .collect();
            round += 1;
            idle += 1;
            let found = self.best_descended(&near);
            if let Some(better) = found.filter(|found| found.cost < best.cost * (1.0 - ROUNDING)) {
                (best, idle) = (better, 0);
            }
        }
        Some(best)
    }

    fn best_descended(&self, starts: &[Vec<usize>]) -> Option<FoundPattern> {
        let found = starts.par_iter().map(|start| self.descended(start));
        found.min_by(|a, b| a.cost.total_cmp(&b.cost).then_with(|| a.segments.cmp(&b.segments)))
    }

    /// Where a descent from a pattern ends.
    fn descended(&self, start: &[usize]) -> FoundPattern {
        let orders = WIDTHS.map(orders);
        let mut worst = QuantileWorst::new(&self.coils, start);
        let mut found = FoundPattern { cost: worst.cost(), segments: start.to_vec() };
        let mut at = 0;
        let is_tried = |width: usize, orders: usize| {
            width <= start.len() && orders * windows(start.len(), width).len() <= MOST_ORDERS
        };
        while let Some(&width) = WIDTHS.get(at).filter(|width| is_tried(**width, orders[at].len())) {
            let segments = &found.segments;
            let step = windows(segments.len(), width)
                .into_par_iter()
                .filter_map(|window| self.best_of(segments, &worst, &window, &orders[at]))
                .min_by(|a, b| a.cost.total_cmp(&b.cost).then_with(|| a.segments.cmp(&b.segments)));
            at = if step.is_some() { 0 } else { at + 1 };
            if let Some(step) = step {
                worst = QuantileWorst::new(&self.coils, &step.segments);
                found = step;
            }
        }
        found
    }

    /// The best order of what is in a window, if it is better than the one that is there.
    fn best_of(
        &self,
        segments: &[usize],
        worst: &QuantileWorst,
        window: &Window,
        orders: &[Vec<usize>],
    ) -> Option<FoundPattern> {
        let mut worst = worst.clone();
        let mut limit = worst.cost() * (1.0 - ROUNDING);
        let mut best = None;
        // Layers whose segments change places.
        let layers: Vec<usize> = match window {
            Window::Layers(layers) => layers.clone().collect(),
            Window::Segments(within) => (0..segments.len()).filter(|&j| within.contains(&segments[j])).collect(),
        };
        for order in orders {
            let mut candidate = segments.to_vec();
            layers.iter().zip(order).for_each(|(&layer, &from)| candidate[layer] = segments[layers[from]]);
            if !self.limits.admits(&candidate) {
                continue;
            }
            if let Some(cost) = worst.propose(&self.coils, &candidate, limit) {
                limit = cost * (1.0 - ROUNDING);
                best = Some(FoundPattern { cost, segments: candidate });
            }
        }
        best
    }
}

fn windows(layers: usize, width: usize) -> Vec<Window> {
    let of_layers = (0..=layers - width).map(|from| Window::Layers(from..from + width));
    let of_segments = (1..=layers + 1 - width).map(|from| Window::Segments(from..from + width));
    of_layers.chain(of_segments).collect()
}

/// Every order of so many.
fn orders(count: usize) -> Vec<Vec<usize>> {
    let mut orders = vec![Vec::new()];
    for k in 0..count {
        let longer = |order: Vec<usize>| (0..=k).map(move |at| [&order[..at], &[k], &order[at..]].concat());
        orders = orders.into_iter().flat_map(longer).collect();
    }
    orders
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coil::LayerLength;
    use crate::pattern::windability::WindabilityClass;
    use crate::search::cost::guaranteed::UnitStep;
    use crate::search::cost::sampled_coils::SampledCoils;
    use crate::search::cost::samples::tests::model;

    #[test]
    fn a_descent_ends_where_no_order_of_few_neighbours_is_better_and_stays_in_its_class() {
        let model = model(8, LayerLength::Actual, &["surface_film"]);
        let step = UnitStep::new(&model, 0.003).unwrap();
        for class in [WindabilityClass::Any, WindabilityClass::Captive(1)] {
            let cost = QuantileCost::new(SampledCoils::nominal(&model, &step).unwrap(), class);
            let value = |segments: &[usize]| QuantileWorst::new(&cost.coils, segments).cost();
            let start: Vec<usize> = (1..=8).collect();
            let found = cost.descended(&start);
            assert!(found.cost < value(&start) && (found.cost / value(&found.segments) - 1.0).abs() < 1e-12);
            assert!(cost.limits.admits(&found.segments));
            for at in 0..=8 - WIDTHS[2] {
                for order in orders(WIDTHS[2]) {
                    let mut other = found.segments.clone();
                    order.iter().enumerate().for_each(|(k, &from)| other[at + k] = found.segments[at + from]);
                    assert!(!cost.limits.admits(&other) || value(&other) >= found.cost * (1.0 - 2.0 * ROUNDING));
                }
            }
            let followed = cost.followed(&[start]).unwrap();
            assert!(followed.cost <= found.cost);
            assert_eq!(cost.followed(&[found.segments]).unwrap(), followed);
        }
    }

    #[test]
    fn every_order_is_there_once() {
        let mut found = orders(5);
        found.sort();
        found.dedup();
        assert_eq!(found.len(), 120);
    }
}
