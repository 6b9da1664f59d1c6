//! Moves that stay inside a windability class, and what they change in the coefficients of the sample matrix.
//!
//! | class | position | moves |
//! |---|---|---|
//! | `standard` | the end at which each layer lies | one end, or the ends of two layers |
//! | `captive:K` | permutation | swaps and insertions that leave at most K captive runs |
//! | `any` | permutation | swaps and insertions |
//!
//! With equal lengths a swap changes two layers' weights. With actual lengths it also shifts every segment between
//! the two; their changes are in the list as well, so a proposal is always exact.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;

use crate::pattern::windability::WindabilityClass;
use crate::pattern::{axial_direction, layers_by_segment};
use crate::rate::segment_weights_m2;
use crate::search::anneal::limits::{WindingLimits, draw, most_captive, pick};
use crate::search::cost::columns::{Change, Columns};
use crate::search::cost::samples::SampleMatrix;
use crate::search::cost::signs::{segments_of_signs, sign_columns, sign_value, signs_of_segments};

/// What is walked over: the class, and the columns that fit it.
#[derive(Debug, Clone)]
pub struct Space {
    matrix: SampleMatrix,
    class: WindabilityClass,
    /// The columns of the signs, where the class is `standard` and the error linear in them.
    signs: Option<Columns>,
    /// With equal lengths: each segment's weight in either half.
    fixed: Option<SegmentWeights>,
}

/// The weight of each segment wherever it lies [m²].
#[derive(Debug, Clone)]
struct SegmentWeights {
    half_a_m2: Vec<f64>,
    half_b_m2: Vec<f64>,
}

impl Space {
    /// Of a compiled objective, over the patterns of a class.
    pub fn new(matrix: SampleMatrix, class: WindabilityClass) -> Self {
        let signs = if class == WindabilityClass::Standard { sign_columns(&matrix) } else { None };
        let fixed = matrix.equal_lengths().then(|| {
            let length_m = matrix.lengths_m().iter().sum::<f64>();
            let mut fixed = SegmentWeights { half_a_m2: Vec::new(), half_b_m2: Vec::new() };
            let mut from_m = 0.0;
            for &l in matrix.lengths_m() {
                let (a, b) = segment_weights_m2(from_m, from_m + l, length_m);
                fixed.half_a_m2.push(a);
                fixed.half_b_m2.push(b);
                from_m += l;
            }
            fixed
        });
        Self { matrix, class, signs, fixed }
    }

    /// What the winding shop can wind.
    pub fn class(&self) -> WindabilityClass {
        self.class
    }

    /// The compiled objective.
    pub fn matrix(&self) -> &SampleMatrix {
        &self.matrix
    }

    pub(crate) fn layers(&self) -> usize {
        self.matrix.layers()
    }

    /// The columns that a walk's coefficients and changes refer to.
    pub(crate) fn columns(&self) -> &Columns {
        self.signs.as_ref().unwrap_or(&self.matrix.columns)
    }

    /// Whether the class admits P(j).
    pub(crate) fn admits(&self, segments: &[usize]) -> bool {
        WindingLimits::from(self.class).admits(segments)
    }

    /// A pattern of the class drawn at random; `captive:K` starts from a standard one.
    pub fn draw(&self, random: &mut ChaCha8Rng) -> Vec<usize> {
        draw(self.class, self.layers(), random)
    }

    /// A position at a pattern of the class.
    pub(crate) fn walk(&self, segments: Vec<usize>) -> Walk {
        let mut walk = Walk {
            high: match self.class {
                WindabilityClass::Standard => signs_of_segments(&segments).unwrap_or_default(),
                _ => Vec::new(),
            },
            layers_by_segment: layers_by_segment(&segments),
            candidate: segments.clone(),
            segments,
            coefficients: Vec::new(),
            changes: Vec::new(),
            flips: Vec::new(),
        };
        walk.coefficients = walk.recomputed_coefficients(self);
        walk
    }
}

/// A pattern, its coefficients, and the proposal made last.
#[derive(Debug, Clone)]
pub(crate) struct Walk {
    segments: Vec<usize>,
    layers_by_segment: Vec<usize>,
    /// The ends, for the class `standard`; otherwise empty.
    high: Vec<bool>,
    coefficients: Vec<f64>,
    candidate: Vec<usize>,
    flips: Vec<usize>,
    changes: Vec<Change>,
}

impl Walk {
    /// P(j), innermost layer first.
    pub(crate) fn segments(&self) -> Vec<usize> {
        if self.high.is_empty() { self.segments.clone() } else { segments_of_signs(&self.high) }
    }

    pub(crate) fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    fn recomputed_coefficients(&self, space: &Space) -> Vec<f64> {
        if space.signs.is_some() {
            return self.high.iter().map(|&h| sign_value(h)).collect();
        }
        let layout = space.matrix.layout;
        let lengths_m = space.matrix.lengths_m();
        let length_m = lengths_m.iter().sum::<f64>();
        let mut coefficients = vec![0.0; layout.columns()];
        let mut from_m = 0.0;
        for &layer in &self.layers_by_segment {
            let to_m = from_m + lengths_m[layer];
            let (a, b) = segment_weights_m2(from_m, to_m, length_m);
            coefficients[layout.column_a(layer)] += a;
            coefficients[layout.column_b(layer)] += b;
            if layout.axial {
                coefficients[layout.column_axial(layer)] =
                    2.0 * axial_direction(&self.segments, layer) * lengths_m[layer].powi(2);
            }
            from_m = to_m;
        }
        coefficients
    }

    /// Draws a move; its changes of the coefficients, or `None` if it would leave the class.
    pub(crate) fn propose(&mut self, space: &Space, random: &mut ChaCha8Rng) -> Option<&[Change]> {
        let layers = space.layers();
        self.changes.clear();
        if space.class == WindabilityClass::Standard {
            self.draw_flips(layers, random);
            if space.signs.is_some() {
                let change = |&m: &usize| Change { column: m, by: -2.0 * sign_value(self.high[m]) };
                self.changes.extend(self.flips.iter().map(change));
                return Some(&self.changes);
            }
            let mut high = self.high.clone();
            for &m in &self.flips {
                high[m] = !high[m];
            }
            self.candidate = segments_of_signs(&high);
        } else {
            self.draw_permutation(layers, random);
            if let WindabilityClass::Captive(most) = space.class
                && most_captive(&self.candidate) > most
            {
                self.candidate.clone_from(&self.segments);
                return None;
            }
        }
        self.collect_changes(space);
        Some(&self.changes)
    }

    /// The changes of the coefficients that lead to another pattern of the class; refuse it afterwards.
    pub(crate) fn propose_pattern(&mut self, space: &Space, segments: &[usize]) -> &[Change] {
        self.changes.clear();
        if space.signs.is_some() {
            let there = signs_of_segments(segments).unwrap_or_default();
            let changed = self.high.iter().zip(&there).enumerate().filter(|(_, (here, there))| here != there);
            self.changes.extend(changed.map(|(column, (&here, _))| Change { column, by: -2.0 * sign_value(here) }));
            return &self.changes;
        }
        self.candidate.copy_from_slice(segments);
        self.collect_changes(space);
        &self.changes
    }

    fn draw_flips(&mut self, layers: usize, random: &mut ChaCha8Rng) {
        self.flips.clear();
        let first = pick(random, layers - 1);
        self.flips.push(first);
        if layers > 2 && random.next_u32() & 1 == 1 {
            let second = pick(random, layers - 2);
            self.flips.push(if second >= first { second + 1 } else { second });
        }
    }

    /// Three swaps to one insertion.
    fn draw_permutation(&mut self, layers: usize, random: &mut ChaCha8Rng) {
        let from = pick(random, layers);
        let other = pick(random, layers - 1);
        let to = if other >= from { other + 1 } else { other };
        if layers == 2 || random.next_u32() & 3 != 0 {
            self.candidate.swap(from, to);
        } else if from < to {
            self.candidate[from..=to].rotate_left(1);
        } else {
            self.candidate[to..=from].rotate_right(1);
        }
    }

    /// From `segments` to `candidate`.
    fn collect_changes(&mut self, space: &Space) {
        let layout = space.matrix.layout;
        let lengths_m = space.matrix.lengths_m();
        let changed = || (0..self.segments.len()).filter(|&j| self.segments[j] != self.candidate[j]);
        let mut push = |column: usize, by: f64| {
            if by != 0.0 {
                self.changes.push(Change { column, by });
            }
        };
        if let Some(fixed) = &space.fixed {
            for layer in changed() {
                let (new, old) = (self.candidate[layer] - 1, self.segments[layer] - 1);
                let (a, b) = (fixed.half_a_m2[new] - fixed.half_a_m2[old], fixed.half_b_m2[new] - fixed.half_b_m2[old]);
                if layout.halves_alike {
                    push(layer, a + b);
                } else {
                    push(layout.column_a(layer), a);
                    push(layout.column_b(layer), b);
                }
            }
        } else {
            let length_m = lengths_m.iter().sum::<f64>();
            let of_change = |ends: fn(usize, usize) -> usize, start: usize| {
                changed().fold(start, |at, j| ends(ends(at, self.segments[j]), self.candidate[j]))
            };
            let (first, last) = (of_change(usize::min, usize::MAX), of_change(usize::max, 0));
            let mut order = self.layers_by_segment.clone();
            for layer in changed() {
                order[self.candidate[layer] - 1] = layer;
            }
            let mut from_m: f64 = order[..first - 1].iter().map(|&j| lengths_m[j]).sum();
            for &layer in &order[first - 1..last] {
                let to_m = from_m + lengths_m[layer];
                let (a, b) = segment_weights_m2(from_m, to_m, length_m);
                if layout.halves_alike {
                    push(layer, a + b - self.coefficients[layer]);
                } else {
                    push(layout.column_a(layer), a - self.coefficients[layout.column_a(layer)]);
                    push(layout.column_b(layer), b - self.coefficients[layout.column_b(layer)]);
                }
                from_m = to_m;
            }
        }
        if layout.axial {
            for (layer, l) in lengths_m.iter().enumerate() {
                let change = axial_direction(&self.candidate, layer) - axial_direction(&self.segments, layer);
                push(layout.column_axial(layer), 2.0 * change * l * l);
            }
        }
    }

    /// Goes where the last proposal leads.
    pub(crate) fn accept(&mut self, space: &Space) {
        for change in &self.changes {
            self.coefficients[change.column] += change.by;
        }
        if space.class == WindabilityClass::Standard {
            for &m in &self.flips {
                self.high[m] = !self.high[m];
            }
            if space.signs.is_some() {
                return;
            }
        }
        for (layer, &segment) in self.candidate.iter().enumerate() {
            if self.segments[layer] != segment {
                self.segments[layer] = segment;
                self.layers_by_segment[segment - 1] = layer;
            }
        }
    }

    /// Forgets the last proposal.
    pub(crate) fn refuse(&mut self, space: &Space) {
        if space.class != WindabilityClass::Standard {
            self.candidate.copy_from_slice(&self.segments);
        }
    }
}

#[cfg(test)]
mod tests {
    use rand_chacha::rand_core::SeedableRng;

    use super::*;
    use crate::coil::LayerLength;
    use crate::pattern::Pattern;
    use crate::pattern::windability::WindingGraph;
    use crate::search::cost::columns::{Norm, SampleValues};
    use crate::search::cost::samples::tests::{model, profiles};
    use crate::search::cost::worst_case::SolvedProfiles;

    #[test]
    fn counting_intervals_agrees_with_the_winding_graph() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        for _ in 0..500 {
            let mut segments: Vec<usize> = (1..=10).collect();
            for i in (1..10).rev() {
                segments.swap(i, pick(&mut random, i + 1));
            }
            let graph = WindingGraph::new(&Pattern::new(segments.clone()).unwrap());
            assert_eq!(most_captive(&segments), graph.windability().captive);
        }
    }

    #[test]
    fn a_thousand_accepted_moves_cost_what_recomputation_says_and_stay_in_the_class() {
        use WindabilityClass::{Any, Captive, Standard};
        for effects in [&[][..], &["strain_mismatch", "axial_gradient", "midpoint_offset"][..]] {
            for layer_length in [LayerLength::Equal, LayerLength::Actual] {
                let model = model(10, layer_length, effects);
                let solved = SolvedProfiles::new(&model, &profiles()).unwrap();
                let (matrix, _) = SampleMatrix::of_profiles(&model, &solved).unwrap();
                for class in [Standard, Captive(1), Any] {
                    let space = Space::new(matrix.clone(), class);
                    let mut random = ChaCha8Rng::seed_from_u64(7);
                    let mut walk = space.walk(space.draw(&mut random));
                    for norm in [Norm::Largest, Norm::RootMeanSquare, Norm::Sum] {
                        let mut values = SampleValues::new(space.columns(), walk.coefficients(), norm);
                        for _ in 0..1000 {
                            let Some(changes) = walk.propose(&space, &mut random) else { continue };
                            values.propose(space.columns(), changes, f64::INFINITY).unwrap();
                            values.accept();
                            walk.accept(&space);
                        }
                        let pattern = Pattern::new(walk.segments()).unwrap();
                        assert!(class.admits(&pattern));
                        let expected = matrix.cost(&model, &pattern, norm).unwrap();
                        let scale = matrix.cost(&model, &Pattern::new((1..=10).collect()).unwrap(), norm).unwrap();
                        let found = values.cost();
                        assert!((found - expected).abs() < 1e-12 * scale, "{class} {norm:?}: {found} {expected}");
                    }
                }
            }
        }
    }
}
