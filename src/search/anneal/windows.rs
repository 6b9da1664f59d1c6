//! Descent through all orders of a few neighbours, where a walk can afford too few moves to come upon them.
//!
//! Neighbouring layers exchange their segments in every order, and so do the layers of segments that follow one another on
//! the fibre: 6! orders of each. The best step of all windows is taken until none is better; where few neighbours bring
//! nothing, more of them are tried.

use std::ops::Range;

use rayon::prelude::*;

use super::limits::pick;
use super::restart::generator;
use crate::search::cost::{Cost, Position};

/// Neighbours of a window: few as long as that helps. With one more, P95 of 14 layers ends 0.2 % lower for two and a half times
/// the processor time.
const WIDTHS: [usize; 3] = [4, 5, 6];

/// Descents of a round, how many steps off the best pattern they begin, and rounds without a better one after which no more
/// follow. By P95 with one captive run on 24 layers (windows one wider) two seeds ended on one pattern so, and up to 0.4 % above
/// it with three or twelve steps.
const STARTS: u64 = 12;
const STEPS_OFF: usize = 6;
const PATIENCE: usize = 3;

/// Of the steps off the best: the same for every search, so that what one comes upon no other misses.
const STEPS_SEED: u64 = 1;

/// A step that brings no more than this share is rounding.
const ROUNDING: f64 = 1e-9;

/// A pattern that a descent came to.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Reached {
    /// In the cost's unit.
    pub(super) cost: f64,
    /// P(j), innermost layer first.
    pub(super) segments: Vec<usize>,
}

/// What lies in a window.
#[derive(Debug, Clone)]
enum Window {
    Layers(Range<usize>),
    Segments(Range<usize>),
}

/// The best of descents from given patterns, and from a few steps off the best of them as long as that brings better ones.
/// `goes_on` is asked between descents; none before the first.
pub(super) fn followed<C: Cost>(cost: &C, starts: &[Vec<usize>], goes_on: &dyn Fn() -> bool) -> Option<Reached> {
    let mut best = best_descended(cost, starts, goes_on)?;
    let (mut round, mut idle) = (0, 0);
    while idle < PATIENCE && goes_on() {
        let near: Vec<Vec<usize>> =
            (0..STARTS).map(|start| steps_off(cost, &best.segments, round * STARTS + start)).collect();
        round += 1;
        idle += 1;
        let found = best_descended(cost, &near, goes_on);
        if let Some(better) = found.filter(|found| found.cost < best.cost * (1.0 - ROUNDING)) {
            (best, idle) = (better, 0);
        }
    }
    Some(best)
}

/// A pattern a few exchanges off a given one.
fn steps_off<C: Cost>(cost: &C, segments: &[usize], stream: u64) -> Vec<usize> {
    let mut random = generator(STEPS_SEED, stream);
    let mut at = segments.to_vec();
    for _ in 0..STEPS_OFF {
        let (one, other) = (pick(&mut random, at.len()), pick(&mut random, at.len()));
        at.swap(one, other);
        if !cost.admits(&at) {
            at.swap(one, other);
        }
    }
    at
}

/// One descent after the other: the windows of each are shared out.
fn best_descended<C: Cost>(cost: &C, starts: &[Vec<usize>], goes_on: &dyn Fn() -> bool) -> Option<Reached> {
    let found = starts.iter().take_while(|_| goes_on()).map(|start| descended(cost, start));
    found.min_by(|a, b| a.cost.total_cmp(&b.cost).then_with(|| a.segments.cmp(&b.segments)))
}

/// Where a descent from a pattern ends.
fn descended<C: Cost>(cost: &C, start: &[usize]) -> Reached {
    let orders = WIDTHS.map(orders);
    let mut position = cost.at(start);
    let mut found = Reached { cost: position.cost(), segments: start.to_vec() };
    let mut at = 0;
    while let Some(&width) = WIDTHS.get(at).filter(|width| **width <= start.len()) {
        let segments = &found.segments;
        let step = windows(segments.len(), width)
            .into_par_iter()
            .filter_map(|window| best_order(cost, segments, &position, &window, &orders[at]))
            .min_by(|a, b| a.cost.total_cmp(&b.cost).then_with(|| a.segments.cmp(&b.segments)));
        at = if step.is_some() { 0 } else { at + 1 };
        if let Some(step) = step {
            position = cost.at(&step.segments);
            found = step;
        }
    }
    found
}

/// The best order of what is in a window, if it is better than the one that is there.
fn best_order<C: Cost>(
    cost: &C,
    segments: &[usize],
    position: &C::Position,
    window: &Window,
    orders: &[Vec<usize>],
) -> Option<Reached> {
    let mut position = position.clone();
    let mut limit = position.cost() * (1.0 - ROUNDING);
    let mut best = None;
    // Layers whose segments change places.
    let layers: Vec<usize> = match window {
        Window::Layers(layers) => layers.clone().collect(),
        Window::Segments(within) => (0..segments.len()).filter(|&j| within.contains(&segments[j])).collect(),
    };
    let mut candidate = segments.to_vec();
    for order in orders {
        layers.iter().zip(order).for_each(|(&layer, &from)| candidate[layer] = segments[layers[from]]);
        if candidate == segments || !cost.admits(&candidate) {
            continue;
        }
        if let Some(value) = position.cost_of(cost, &candidate, limit) {
            limit = value * (1.0 - ROUNDING);
            best = Some(Reached { cost: value, segments: candidate.clone() });
        }
    }
    best
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
    use crate::search::anneal::quantile::QuantileCost;
    use crate::search::anneal::sample_cost::SampleCost;
    use crate::search::cost::columns::Norm;
    use crate::search::cost::guaranteed::UnitStep;
    use crate::search::cost::sampled_coils::SampledCoils;
    use crate::search::cost::samples::tests::model;

    fn checked<C: Cost>(cost: &C) {
        let value = |segments: &[usize]| cost.at(segments).cost();
        let start: Vec<usize> = (1..=8).collect();
        let found = descended(cost, &start);
        assert!(found.cost < value(&start) && (found.cost / value(&found.segments) - 1.0).abs() < 1e-9);
        assert!(cost.admits(&found.segments));
        for at in 0..=8 - WIDTHS[2] {
            for order in orders(WIDTHS[2]) {
                let mut other = found.segments.clone();
                order.iter().enumerate().for_each(|(k, &from)| other[at + k] = found.segments[at + from]);
                assert!(!cost.admits(&other) || value(&other) >= found.cost * (1.0 - 3.0 * ROUNDING));
            }
        }
        let all = followed(cost, std::slice::from_ref(&start), &|| true).unwrap();
        assert!(all.cost <= found.cost && cost.admits(&all.segments));
        assert_eq!(followed(cost, &[start], &|| false), None);
        let again = followed(cost, &[found.segments], &|| true).unwrap();
        assert!((again.cost / all.cost - 1.0).abs() < 1e-9, "{again:?} {all:?}");
    }

    #[test]
    fn a_descent_ends_where_no_order_of_few_neighbours_is_better_and_stays_in_its_class() {
        let model = model(8, LayerLength::Actual, &["surface_film"]);
        let step = UnitStep::new(&model, 0.003).unwrap();
        for class in [WindabilityClass::Any, WindabilityClass::Captive(1)] {
            checked(&QuantileCost::new(SampledCoils::nominal(&model, &step).unwrap(), class));
            checked(&SampleCost::new(step.samples(&model).unwrap(), class, Norm::Sum));
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
