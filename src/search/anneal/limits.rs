//! What the winding shop puts up with, and steps between patterns that stay within it.

use std::ops::Range;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;

use crate::pattern::layers_by_segment;
use crate::pattern::windability::WindabilityClass;
use crate::search::cost::signs::{segments_of_signs, signs_of_segments};

/// Uniform in (0, 1].
pub(super) fn uniform(random: &mut ChaCha8Rng) -> f64 {
    ((random.next_u64() >> 11) + 1) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// What the winding shop puts up with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WindingLimits {
    pub(crate) class: WindabilityClass,
    /// No crossover may climb more layers.
    pub(crate) most_climb: Option<usize>,
}

impl From<WindabilityClass> for WindingLimits {
    fn from(class: WindabilityClass) -> Self {
        Self { class, most_climb: None }
    }
}

impl WindingLimits {
    pub(crate) fn admits(self, segments: &[usize]) -> bool {
        let in_class = match self.class {
            WindabilityClass::Standard => signs_of_segments(segments).is_some(),
            WindabilityClass::Captive(most) => most_captive(segments) <= most,
            WindabilityClass::Any => true,
        };
        in_class && self.most_climb.is_none_or(|most| largest_climb(segments) <= most)
    }
}

/// Layers between the two ends of the longest crossover.
fn largest_climb(segments: &[usize]) -> usize {
    layers_by_segment(segments).windows(2).map(|pair| pair[0].abs_diff(pair[1])).max().unwrap_or(0)
}

/// Most captive runs at any step: one less than the intervals that the wound segments form.
pub(super) fn most_captive(segments: &[usize]) -> usize {
    let mut wound = vec![false; segments.len() + 2];
    let (mut intervals, mut most) = (0usize, 0);
    for &segment in segments {
        wound[segment] = true;
        intervals = intervals + 1 - usize::from(wound[segment - 1]) - usize::from(wound[segment + 1]);
        most = most.max(intervals);
    }
    most - 1
}

/// A pattern within the limits drawn at random; `captive:K` starts from a standard one, and where climbs are limited a
/// random walk starts from the cylindrical winding, which climbs least.
pub(crate) fn draw(limits: impl Into<WindingLimits>, layers: usize, random: &mut ChaCha8Rng) -> Vec<usize> {
    let limits: WindingLimits = limits.into();
    if limits.most_climb.is_some() {
        let mut segments: Vec<usize> = (1..=layers).collect();
        for _ in 0..STEPS_A_LAYER * layers {
            if let Some(next) = neighbour(limits, &segments, random) {
                segments = next;
            }
        }
        return segments;
    }
    match limits.class {
        WindabilityClass::Any => {
            let mut segments: Vec<usize> = (1..=layers).collect();
            for i in (1..layers).rev() {
                segments.swap(i, pick(random, i + 1));
            }
            segments
        }
        _ => segments_of_signs(&(1..layers).map(|_| random.next_u32() & 1 == 1).collect::<Vec<bool>>()),
    }
}

/// A number below `count`, the same on every machine.
pub(crate) fn pick(random: &mut ChaCha8Rng, count: usize) -> usize {
    ((u64::from(random.next_u32()) * count as u64) >> 32) as usize
}

/// Steps of a random walk that draws a pattern.
const STEPS_A_LAYER: usize = 32;

/// One end or two of a standard pattern; three swaps to one insertion elsewhere. `None` if it would leave the limits.
pub(crate) fn neighbour(limits: WindingLimits, segments: &[usize], random: &mut ChaCha8Rng) -> Option<Vec<usize>> {
    let layers = segments.len();
    let is_within = |candidate: &Vec<usize>| limits.admits(candidate);
    if limits.class == WindabilityClass::Standard {
        let mut high = signs_of_segments(segments)?;
        let first = pick(random, high.len());
        high[first] = !high[first];
        if high.len() > 1 && random.next_u32() & 1 == 1 {
            let second = pick(random, high.len() - 1);
            let second = if second >= first { second + 1 } else { second };
            high[second] = !high[second];
        }
        return Some(segments_of_signs(&high)).filter(is_within);
    }
    let from = pick(random, layers);
    let other = pick(random, layers - 1);
    let to = if other >= from { other + 1 } else { other };
    let mut candidate = segments.to_vec();
    if layers == 2 || random.next_u32() & 3 != 0 {
        candidate.swap(from, to);
    } else if from < to {
        candidate[from..=to].rotate_left(1);
    } else {
        candidate[to..=from].rotate_right(1);
    }
    Some(candidate).filter(is_within)
}

/// Layers that lie at one end of the inner layers that they join and can go to the other, innermost first. All sets of them that go leave as many captive runs as
/// there were.
pub(crate) fn layers_at_an_end(segments: &[usize]) -> Vec<usize> {
    let order = layers_by_segment(segments);
    (0..segments.len()).filter(|&layer| run_of(&order, segments[layer] - 1).is_some()).collect()
}

/// A layer goes to the other end of the inner layers that it joins; `order` has the layers along the fibre.
pub(crate) fn to_other_end(order: &mut [usize], layer: usize) {
    let at = order.iter().position(|other| *other == layer).unwrap_or_default();
    match run_of(order, at) {
        Some(run) if run.start < at => order[run.start..=at].rotate_right(1),
        Some(run) => order[at..run.end].rotate_left(1),
        None => {}
    }
}

/// The inner layers next to the layer at a place of the fibre; none where they lie at both sides of it or at neither.
fn run_of(order: &[usize], at: usize) -> Option<Range<usize>> {
    let layer = order[at];
    let below = order[..at].iter().rev().take_while(|other| **other < layer).count();
    let above = order[at + 1..].iter().take_while(|other| **other < layer).count();
    match (below, above) {
        (0, 1..) => Some(at + 1..at + 1 + above),
        (1.., 0) => Some(at - below..at),
        _ => None,
    }
}
