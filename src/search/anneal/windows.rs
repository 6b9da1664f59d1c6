//! Descent through all orders of a few neighbours, where a walk can afford too few moves to come upon them.
//!
//! Neighbouring layers exchange their segments in every order, and so do the layers of segments that follow one another on
//! the fibre: 6! orders of each. Layers that lie at an end of the inner ones that they join go to the other or stay, 2⁸ sets of eight of
//! them, which in a standard pattern is all that can be done. The best step of all windows is taken, then that of those that brought
//! something, until none is better; where few neighbours bring nothing, more of them are tried.
//!
//! # Source
//! What brought nothing is not looked at again before all is: Bentley, ORSA J. Computing 4, 387 (1992), don't-look bits.

use std::ops::Range;

use rand_chacha::ChaCha8Rng;

use super::limits::{layers_at_an_end, pick, to_other_end};
use super::restart::generator;
use crate::parallel::InParallel;
use crate::pattern::{layers_by_segment, segments_by_layer};
use crate::search::cost::{Cost, Position};

/// What is tried around a pattern.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Breadth {
    /// So many neighbours in every order.
    Orders(usize),
    /// So many layers, each at either end.
    Ends(usize),
}

/// Of a descent: as little as helps. With seven neighbours, P95 of 14 layers ends 0.2 % lower for two and a half times the
/// processor time.
const BREADTHS: [Breadth; 4] = [Breadth::Orders(4), Breadth::Orders(5), Breadth::Ends(8), Breadth::Orders(6)];

/// Sets of layers, drawn at random, that go to their other ends: for each layer so many, besides those of neighbours.
const ENDS_A_LAYER: usize = 2;

/// Descents of a round, how many steps off the best pattern they begin, and rounds without a better one after which no more
/// follow. By P95 of 48 standard layers no descent from 6 steps off came to anything better, some from 16 to something better by
/// 1.4 %, and none from 40; after four rounds without one it is not found, after six it is. P95 of 24 layers, any permutation, ends 0.7 % lower than after three.
const STARTS: u64 = 12;
const FEWEST_STEPS_OFF: u64 = 4;
const MORE_STEPS_OFF: u64 = 2;
const PATIENCE: usize = 6;

/// Of the steps off the best and of the layers that go to their other ends: the same for every search, so that what one comes upon
/// no other misses.
const STEPS_SEED: u64 = 1;

/// A step that brings no more than this share is rounding, of single precision too.
const ROUNDING: f64 = 1e-6;

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
    Ends(Vec<usize>),
}

/// The best of descents from given patterns, and from a few steps off the best of them as long as that brings better ones.
/// `goes_on` is asked between descents; none before the first.
pub(super) fn followed<C: Cost>(cost: &C, starts: &[Vec<usize>], goes_on: &dyn Fn() -> bool) -> Option<Reached> {
    let steps_from = |start: &Vec<usize>| (0..STARTS).map(|stream| steps_off(cost, start, stream)).collect::<Vec<_>>();
    let near: Vec<Vec<usize>> = starts.iter().cloned().chain(starts.iter().flat_map(steps_from)).collect();
    let (in_order, cost) = (cost, &cost.refusing_soon(&near));
    let mut reached = starts.to_vec();
    let mut best = best_descended(cost, starts, &mut reached, goes_on)?;
    let (mut round, mut idle) = (0, 0);
    while idle < PATIENCE && goes_on() {
        let near: Vec<Vec<usize>> =
            (0..STARTS).map(|start| steps_off(cost, &best.segments, round * STARTS + start)).collect();
        round += 1;
        idle += 1;
        let found = best_descended(cost, &near, &mut reached, goes_on);
        if let Some(better) = found.filter(|found| found.cost < best.cost * (1.0 - ROUNDING)) {
            (best, idle) = (better, 0);
        }
    }
    // Sums in another order round in another way.
    best.cost = in_order.at(&best.segments).cost();
    Some(best)
}

/// A pattern a few steps off a given one: exchanges, and layers that go to their other ends.
fn steps_off<C: Cost>(cost: &C, segments: &[usize], stream: u64) -> Vec<usize> {
    let mut random = generator(STEPS_SEED, stream);
    let mut at = segments.to_vec();
    for _ in 0..FEWEST_STEPS_OFF + MORE_STEPS_OFF * (stream % STARTS) {
        let is_of_ends = !cost.is_of_permutations() || pick(&mut random, 2) == 0;
        let next = if is_of_ends { an_end_off(&at, &mut random) } else { an_exchange_off(&at, &mut random) };
        if cost.admits(&next) {
            at = next;
        }
    }
    at
}

fn an_end_off(segments: &[usize], random: &mut ChaCha8Rng) -> Vec<usize> {
    let ends = layers_at_an_end(segments);
    let mut order = layers_by_segment(segments);
    if !ends.is_empty() {
        to_other_end(&mut order, ends[pick(random, ends.len())]);
    }
    segments_by_layer(&order)
}

fn an_exchange_off(segments: &[usize], random: &mut ChaCha8Rng) -> Vec<usize> {
    let mut exchanged = segments.to_vec();
    exchanged.swap(pick(random, segments.len()), pick(random, segments.len()));
    exchanged
}

/// The best of descents, one after the other: the windows of each are shared out. Where samples tell, descents are by those that tell of what was
/// `reached` before, and the best of what they come to goes on by the cost itself.
fn best_descended<C: Cost>(
    cost: &C,
    starts: &[Vec<usize>],
    reached: &mut Vec<Vec<usize>>,
    goes_on: &dyn Fn() -> bool,
) -> Option<Reached> {
    let starts = starts.iter().take_while(|_| goes_on());
    let Some(telling) = cost.that_tell(reached) else {
        return best_of(starts.map(|start| descended(cost, start)));
    };
    let found = starts.map(|start| descended(&telling, start).segments);
    let found: Vec<Reached> = found.map(|segments| Reached { cost: cost.at(&segments).cost(), segments }).collect();
    reached.extend(found.iter().map(|found| found.segments.clone()));
    Some(descended(cost, &best_of(found)?.segments))
}

fn best_of(found: impl IntoIterator<Item = Reached>) -> Option<Reached> {
    found.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost).then_with(|| a.segments.cmp(&b.segments)))
}

/// Where a descent from a pattern ends.
fn descended<C: Cost>(cost: &C, start: &[usize]) -> Reached {
    let breadths = BREADTHS.into_iter().filter(|breadth| match breadth {
        Breadth::Orders(width) => cost.is_of_permutations() && *width <= start.len(),
        Breadth::Ends(_) => true,
    });
    let breadths: Vec<(Breadth, Vec<Vec<usize>>)> = breadths
        .map(|breadth| match breadth {
            Breadth::Orders(width) => (breadth, orders(width)),
            Breadth::Ends(_) => (breadth, Vec::new()),
        })
        .collect();
    let mut position = cost.at(start);
    let mut found = Reached { cost: position.cost(), segments: start.to_vec() };
    let (mut at, mut sweep) = (0, 0);
    while let Some((breadth, orders)) = breadths.get(at) {
        let mut tried = match *breadth {
            Breadth::Orders(width) => windows(found.segments.len(), width),
            Breadth::Ends(count) => sets_of_ends(&found.segments, count, sweep),
        };
        sweep += 1;
        at += 1;
        // Windows that brought something are tried again before all are.
        while !tried.is_empty() {
            let steps: Vec<Option<Reached>> = (tried.iter().in_parallel())
                .map(|window| best_within(cost, &found.segments, &position, window, orders))
                .collect();
            let mut better = steps.iter().map(Option::is_some);
            tried.retain(|_| better.next().unwrap_or(false));
            if let Some(step) = best_of(steps.into_iter().flatten()) {
                position = cost.at(&step.segments);
                (found, at) = (step, 0);
            }
        }
    }
    found
}

/// The best pattern of a window, if it is better than the one that is there.
fn best_within<C: Cost>(
    cost: &C,
    segments: &[usize],
    position: &C::Position,
    window: &Window,
    orders: &[Vec<usize>],
) -> Option<Reached> {
    let mut position = position.clone();
    let mut limit = position.cost() * (1.0 - ROUNDING);
    let mut best = None;
    window.visit(segments, orders, |candidate| {
        if candidate == segments || !cost.admits(candidate) {
            return;
        }
        if let Some(value) = position.cost_of(cost, candidate, limit) {
            limit = value * (1.0 - ROUNDING);
            best = Some(Reached { cost: value, segments: candidate.to_vec() });
        }
    });
    best
}

impl Window {
    /// Every pattern that it allows; `orders` are those of its width.
    fn visit(&self, segments: &[usize], orders: &[Vec<usize>], mut each: impl FnMut(&[usize])) {
        // Layers whose segments change places.
        let layers: Vec<usize> = match self {
            Window::Layers(layers) => layers.clone().collect(),
            Window::Segments(within) => (0..segments.len()).filter(|&j| within.contains(&segments[j])).collect(),
            Window::Ends(layers) => {
                let mut order = layers_by_segment(segments);
                for number in 1_u64..1 << layers.len() {
                    // As a Gray code: one layer after the other.
                    to_other_end(&mut order, layers[number.trailing_zeros() as usize]);
                    each(&segments_by_layer(&order));
                }
                return;
            }
        };
        let mut candidate = segments.to_vec();
        for order in orders {
            layers.iter().zip(order).for_each(|(&layer, &from)| candidate[layer] = segments[layers[from]]);
            each(&candidate);
        }
    }
}

fn windows(layers: usize, width: usize) -> Vec<Window> {
    let of_layers = (0..=layers - width).map(|from| Window::Layers(from..from + width));
    let of_segments = (1..=layers + 1 - width).map(|from| Window::Segments(from..from + width));
    of_layers.chain(of_segments).collect()
}

/// Neighbours among the layers at an end, and some that are drawn at random, others in each sweep.
fn sets_of_ends(segments: &[usize], count: usize, sweep: u64) -> Vec<Window> {
    let mut ends = layers_at_an_end(segments);
    if ends.len() <= count {
        return vec![Window::Ends(ends)];
    }
    let mut sets: Vec<Window> = ends.windows(count).map(|near| Window::Ends(near.to_vec())).collect();
    let mut random = generator(STEPS_SEED, u64::MAX / 2 + sweep);
    for _ in 0..ENDS_A_LAYER * ends.len() {
        for k in 0..count {
            let other = k + pick(&mut random, ends.len() - k);
            ends.swap(k, other);
        }
        sets.push(Window::Ends(ends[..count].to_vec()));
    }
    sets
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
    use crate::pattern::Pattern;
    use crate::pattern::classic::Classic;
    use crate::pattern::windability::WindabilityClass;
    use crate::search::anneal::quantile::QuantileCost;
    use crate::search::anneal::sample_cost::SampleCost;
    use crate::search::cost::columns::Norm;
    use crate::search::cost::guaranteed::UnitStep;
    use crate::search::cost::sampled_coils::SampledCoils;
    use crate::search::cost::samples::tests::model;

    fn checked<C: Cost>(cost: &C) {
        let value = |segments: &[usize]| cost.at(segments).cost();
        let start: Vec<usize> = Classic::Zyl.pattern(8).unwrap().segments().to_vec();
        let found = descended(cost, &start);
        assert!(found.cost < value(&start) && (found.cost / value(&found.segments) - 1.0).abs() < 1e-9);
        assert!(cost.admits(&found.segments));
        let widest = |window: &Window| {
            window.visit(&found.segments, &orders(6), |other| {
                assert!(!cost.admits(other) || value(other) >= found.cost * (1.0 - 3.0 * ROUNDING), "{window:?}");
            });
        };
        sets_of_ends(&found.segments, 8, 0).iter().for_each(widest);
        if cost.is_of_permutations() {
            windows(8, 6).iter().for_each(widest);
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
        let coils = || SampledCoils::nominal(&model, &step).unwrap();
        for class in [WindabilityClass::Any, WindabilityClass::Captive(1), WindabilityClass::Standard] {
            checked(&QuantileCost::new(coils(), class));
            checked(&SampleCost::new(step.samples(&model).unwrap(), class, Norm::Sum));
        }
    }

    #[test]
    fn what_is_refused_soon_is_what_is_refused_and_takes_fewer_samples() {
        let model = model(12, LayerLength::Actual, &["surface_film"]);
        let step = UnitStep::new(&model, 0.003).unwrap();
        let start: Vec<usize> = Classic::Qua.pattern(12).unwrap().segments().to_vec();
        for norm in [Norm::Largest, Norm::RootMeanSquare, Norm::Sum] {
            let cost = SampleCost::new(step.samples(&model).unwrap(), WindabilityClass::Any, norm);
            let near: Vec<Vec<usize>> = (0..STARTS).map(|stream| steps_off(&cost, &start, stream)).collect();
            let soon = cost.refusing_soon(&near);
            let (mut at, mut at_soon) = (cost.at(&start), soon.at(&start));
            for stream in STARTS..4 * STARTS {
                let other = steps_off(&cost, &start, stream);
                let here = at.cost_of(&cost, &other, f64::INFINITY).unwrap();
                let there = at_soon.cost_of(&soon, &other, f64::INFINITY).unwrap();
                assert!((here / there - 1.0).abs() < 1e-12, "{norm:?} {other:?}: {here} {there}");
            }
            let before = [at.work().samples, at_soon.work().samples];
            for stream in STARTS..4 * STARTS {
                let other = steps_off(&cost, &start, stream);
                let limit = at.cost();
                let found = [at.cost_of(&cost, &other, limit), at_soon.cost_of(&soon, &other, limit)];
                assert_eq!(found[0].is_some(), found[1].is_some(), "{norm:?} {other:?}");
            }
            let looked_at = [at.work().samples - before[0], at_soon.work().samples - before[1]];
            assert!(4 * looked_at[1] < 3 * looked_at[0], "{norm:?} {looked_at:?}");
        }
    }

    #[test]
    fn ends_of_layers_make_every_standard_pattern_once() {
        let start: Vec<usize> = Classic::Qua.pattern(8).unwrap().segments().to_vec();
        let mut all = vec![start.clone()];
        for window in sets_of_ends(&start, 8, 0) {
            window.visit(&start, &[], |other| all.push(other.to_vec()));
        }
        assert!(all.iter().all(|other| WindabilityClass::Standard.admits(&Pattern::new(other.clone()).unwrap())));
        all.sort();
        all.dedup();
        assert_eq!(all.len(), 1 << 7);
    }

    #[test]
    fn every_order_is_there_once() {
        let mut found = orders(5);
        found.sort();
        found.dedup();
        assert_eq!(found.len(), 120);
    }
}
