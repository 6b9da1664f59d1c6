//! Stretches of the fibre in every order, two sets of them at once.
//!
//! In the classes of permutations the worst rate is a partition of numbers too, in as many dimensions as the error has shapes over
//! time that are larger than what is sought: three or four. No exchange of a few layers leads from one good pattern to a better one, and
//! the next better one is found by looking at very many. Segments that follow one another on the fibre, a stretch of it, take up as much
//! fibre in whatever order they lie on it, so that every layer outside stays where it was,
//!
//! ```text
//! Ω = constant + Σ_j f_j(z_j)            z_j: where layer j begins on the fibre, whatever comes before it
//! v(x with orders p and q of two stretches) = v(x) + ( v(x with p) − v(x) ) + ( v(x with q) − v(x) )
//! ```
//!
//! for layers of any lengths and for halves that respond alike or not, a stretch across the middle included: layers are weighed by where
//! they lie and by nothing else. Only where temperatures vary along the axis is a layer also weighed by the way in which it is
//! wound, which turns for all of them with the innermost layer's; what is found there is approximate and judged in full as all of it is.
//!
//! Each of two sets of stretches has up to 8! orders, all pairs of which, 10⁹, are looked at by two sets of sums
//! ([`box_join`](super::box_join)). What layer j adds to a stretch depends on the set of those before it, not on their order, so that the sums of all
//! orders are made of 2^n n terms.
//!
//! In `captive:K` a stretch has only the orders that are of the class while everything else stays.
//!
//! # Source
//! As of [`compound`](super::compound).

use std::ops::Range;

use rand_chacha::ChaCha8Rng;

use super::box_join::{Matching, Tree};
use super::candidates::Judge;
use super::neighbourhood::{Following, Matches, Neighbourhood, followed};
use super::{PassOutcome, Task};
use crate::pattern::windability::WindabilityClass;
use crate::pattern::{Pattern, layers_by_segment, segments_by_layer};
use crate::search::anneal::limits::{WindingLimits, pick};
use crate::search::cost::samples::SampleMatrix;
use crate::search::cost::worst_case::SearchError;

/// Segments of the stretches of a set; so many of each length are drawn.
const SHAPES: [&[usize]; 7] = [&[8], &[7, 3], &[6, 4], &[5, 5], &[4, 4, 4], &[7], &[6]];

/// With so few layers one stretch is all of the fibre.
const MOST_AS_ONE: usize = 8;

/// Pairs of shapes of which that with the most orders is taken.
const DRAWS: usize = 3;

/// Patterns of a neighbourhood that only the reference refuted, the most promising, that bring samples of their own.
const MOST_BETWEEN: usize = 4;

/// How far patterns are followed.
const FOLLOWING: Following =
    Following { chains: 4, drawn: 8, patience: 2, most_rounds: 16, seed: 0, first_stream: u64::MAX / 8 };

/// Up to so many layers two stretches are all of the fibre.
const MOST_AS_TWO: usize = 16;

/// Exchanges of two segments by which what is drawn for so few layers is off the pattern at most.
const MOST_EXCHANGES: usize = 4;

/// The best pattern that comes of given ones, at worst the best of them. The same patterns and seed give the same one, at
/// any number of threads.
///
/// # Errors
/// As [`super::prove`].
pub(crate) fn rearranged(task: &Task, starts: &[Pattern], seed: u64) -> Result<Pattern, SearchError> {
    let layers = task.model.coil.layers();
    let drawn = if layers <= MOST_AS_ONE {
        // One neighbourhood is the whole class.
        1
    } else if layers <= MOST_AS_TWO {
        2 * FOLLOWING.drawn
    } else {
        FOLLOWING.drawn
    };
    followed::<Stretches>(task, starts, Following { drawn, seed, ..FOLLOWING })
}

/// A pattern, and two sets of stretches of its fibre that do not touch each other.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Stretches {
    /// Layers in the order of the fibre.
    layers: Vec<usize>,
    sets: [Vec<Range<usize>>; 2],
}

/// A stretch in all of its orders.
#[derive(Debug, Clone, PartialEq)]
struct Orders {
    from: usize,
    length: usize,
    /// The layers of each order, one order after the other.
    layers: Vec<usize>,
    /// What each changes at the samples, likewise.
    changes: Vec<f64>,
}

impl Orders {
    fn count(&self) -> usize {
        self.layers.len() / self.length
    }
}

impl Neighbourhood for Stretches {
    const SHARES: &'static [f64] = &[0.25, 0.7, 1.0];
    const MOST_JUDGED: usize = 1024;

    /// Around the pattern, or one a few exchanges off it where two stretches are all of the fibre and leave little else to be drawn.
    fn draw(class: WindabilityClass, segments: &[usize], random: &mut ChaCha8Rng) -> Self {
        let mut segments = segments.to_vec();
        let exchanges = if segments.len() <= MOST_AS_TWO { pick(random, MOST_EXCHANGES + 1) } else { 0 };
        for _ in 0..exchanges {
            let mut exchanged = segments.clone();
            exchanged.swap(pick(random, segments.len()), pick(random, segments.len()));
            if WindingLimits::from(class).admits(&exchanged) {
                segments = exchanged;
            }
        }
        Self { layers: layers_by_segment(&segments), sets: sets(segments.len(), random) }
    }

    fn search(&self, judge: &Judge, samples: &[usize], class: WindabilityClass, limit_rad_per_s: f64) -> PassOutcome {
        if limit_rad_per_s == 0.0 || samples.is_empty() {
            return PassOutcome::default();
        }
        let selected = judge.matrix().select(samples);
        let orders: [Vec<Orders>; 2] = [0, 1].map(|set: usize| {
            self.sets[set].iter().map(|stretch| self.orders(judge, &selected, class, stretch)).collect()
        });
        let here = judge.values_at(samples, &segments_by_layer(&self.layers));
        let changes = |set: usize| -> Vec<Vec<f64>> { orders[set].iter().map(|o| o.changes.clone()).collect() };
        let trees = [Tree::of_sums(&here, &changes(0)), Tree::of_sums(&vec![0.0; samples.len()], &changes(1))];
        let predicted = |left: u32, right: u32| -> f64 {
            let mut values = here.clone();
            for (orders, number) in orders.iter().zip([left, right]) {
                for (stretch, at) in chosen(orders, number) {
                    let changes = &stretch.changes[at * samples.len()..(at + 1) * samples.len()];
                    values.iter_mut().zip(changes).for_each(|(v, c)| *v += c);
                }
            }
            values.iter().fold(0.0, |most, v| v.abs().max(most))
        };
        let pattern = |left: u32, right: u32| {
            let mut layers = self.layers.clone();
            for (orders, number) in orders.iter().zip([left, right]) {
                for (stretch, at) in chosen(orders, number) {
                    let order = &stretch.layers[at * stretch.length..(at + 1) * stretch.length];
                    layers[stretch.from..stretch.from + stretch.length].copy_from_slice(order);
                }
            }
            Some(segments_by_layer(&layers)).filter(|segments| WindingLimits::from(class).admits(segments))
        };
        let matches = Matches {
            matching: Matching { left: &trees[0], right: &trees[1] },
            samples: samples.len(),
            limit_rad_per_s,
            pattern: &pattern,
            predicted: &predicted,
        };
        let mut outcome = matches.judged::<Self>(judge);
        outcome.between.truncate(MOST_BETWEEN);
        outcome
    }
}

impl Stretches {
    /// Every order of a stretch, or those that are of the class while everything else stays.
    fn orders(
        &self,
        judge: &Judge,
        selected: &SampleMatrix,
        class: WindabilityClass,
        stretch: &Range<usize>,
    ) -> Orders {
        let (from, length, samples) = (stretch.start, stretch.len(), selected.samples());
        let own = &self.layers[stretch.clone()];
        // What a layer adds behind a set of others.
        let added: Vec<Vec<f64>> = (0..length << length)
            .map(|index| {
                let (layer, before) = (index % length, index / length);
                if before >> layer & 1 == 1 {
                    return Vec::new();
                }
                let mut sorted: Vec<usize> = (0..length).collect();
                sorted.sort_by_key(|&k| if before >> k & 1 == 1 { 0 } else { 1 + usize::from(k != layer) });
                let mut layers = self.layers.clone();
                layers[stretch.clone()].iter_mut().zip(&sorted).for_each(|(to, &k)| *to = own[k]);
                judge.layer_values(selected, &segments_by_layer(&layers), own[layer])
            })
            .collect();
        let mut start = vec![0.0; samples];
        for k in 0..length {
            start.iter_mut().zip(&added[((1 << k) - 1) * length + k]).for_each(|(v, d)| *v -= d);
        }
        let mut values = vec![0.0; (length + 1) * samples];
        values[..samples].copy_from_slice(&start);
        let mut growing = Growing {
            own,
            added: &added,
            limits: (class != WindabilityClass::Any).then(|| WindingLimits::from(class)),
            all: self.layers.clone(),
            from,
            values,
            orders: Orders { from, length, layers: Vec::new(), changes: Vec::new() },
        };
        growing.extend(0, 0);
        growing.orders
    }
}

/// Orders of a stretch under way.
struct Growing<'a> {
    /// The stretch's layers.
    own: &'a [usize],
    /// What a layer adds behind a set of others: of set `b` and layer `k` at `b · length + k`.
    added: &'a [Vec<f64>],
    /// What an order must stay within while everything else stays; `None` for any.
    limits: Option<WindingLimits>,
    /// Layers of the whole fibre, those of the stretch as far as they are placed.
    all: Vec<usize>,
    from: usize,
    /// What the first none, one, two … placed add, one after the other.
    values: Vec<f64>,
    orders: Orders,
}

impl Growing<'_> {
    /// Every order that begins with those that are placed: so many, which make this set.
    fn extend(&mut self, count: usize, placed: usize) {
        let length = self.own.len();
        let samples = self.values.len() / (length + 1);
        if count == length {
            if self.limits.is_none_or(|limits| limits.admits(&segments_by_layer(&self.all))) {
                self.orders.layers.extend(&self.all[self.from..self.from + length]);
                self.orders.changes.extend(&self.values[length * samples..]);
            }
            return;
        }
        for k in (0..length).filter(|k| placed >> k & 1 == 0) {
            let (done, next) = self.values.split_at_mut((count + 1) * samples);
            let added = &self.added[placed * length + k];
            for ((v, d), sum) in done[count * samples..].iter().zip(added).zip(next) {
                *sum = v + d;
            }
            self.all[self.from + count] = self.own[k];
            self.extend(count + 1, placed | 1 << k);
        }
    }
}

/// Of a pair's one number, the order of each stretch; as [`Tree::of_sums`] counts.
fn chosen(orders: &[Orders], number: u32) -> impl Iterator<Item = (&Orders, usize)> {
    orders.iter().scan(number as usize, |rest, stretch| {
        let at = *rest % stretch.count();
        *rest /= stretch.count();
        Some((stretch, at))
    })
}

/// Two sets of stretches of a fibre, placed at random.
fn sets(segments: usize, random: &mut ChaCha8Rng) -> [Vec<Range<usize>>; 2] {
    if segments <= MOST_AS_ONE {
        return [std::iter::once(0..segments).collect(), Vec::new()];
    }
    let most_orders = |pair: &[&[usize]; 2]| -> usize {
        pair.iter().flat_map(|shape| shape.iter()).map(|&length| (1..=length).product::<usize>()).product()
    };
    let drawn = (0..DRAWS).map(|_| [SHAPES[pick(random, SHAPES.len())], SHAPES[pick(random, SHAPES.len())]]);
    let fitting = drawn.filter(|pair| pair.iter().flat_map(|shape| shape.iter()).sum::<usize>() <= segments);
    let half = [(segments / 2).min(MOST_AS_ONE - 1)];
    let [left, right] = fitting.max_by_key(most_orders).unwrap_or([&half, &half]);
    // Stretches in the order of the fibre, and how much lies before each that stays.
    let mut stretches: Vec<(usize, usize)> =
        left.iter().map(|&length| (0, length)).chain(right.iter().map(|&length| (1, length))).collect();
    for i in (1..stretches.len()).rev() {
        stretches.swap(i, pick(random, i + 1));
    }
    let mut before = vec![0; stretches.len() + 1];
    for _ in stretches.iter().map(|&(_, length)| length).sum()..segments {
        before[pick(random, stretches.len() + 1)] += 1;
    }
    let mut sets = [Vec::new(), Vec::new()];
    let mut at = 0;
    for (&(set, length), before) in stretches.iter().zip(before) {
        at += before;
        sets[set].push(at..at + length);
        at += length;
    }
    sets
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coil::LayerLength;
    use crate::search::anneal::limits::draw;
    use crate::search::anneal::restart::generator;
    use crate::search::cost::samples::tests::{model, profiles};
    use crate::search::cost::worst_case::SolvedProfiles;
    use crate::search::proof::{Goal, checked_judge};

    /// The layers along the fibre with stretches in the orders of a number.
    fn with(layers: &[usize], orders: &[Orders], number: u32) -> Vec<usize> {
        let mut layers = layers.to_vec();
        for (stretch, at) in chosen(orders, number) {
            let order = &stretch.layers[at * stretch.length..(at + 1) * stretch.length];
            layers[stretch.from..stretch.from + stretch.length].copy_from_slice(order);
        }
        layers
    }

    #[test]
    fn orders_of_two_sets_of_stretches_add_up_exactly_for_layers_of_any_lengths_and_halves_that_differ() {
        for effects in [&["surface_film"][..], &["strain_mismatch"], &["midpoint_offset", "stress_gradient"]] {
            let model = model(14, LayerLength::Actual, effects);
            let solved = SolvedProfiles::new(&model, &profiles()).unwrap();
            let class = WindabilityClass::Any;
            let judge = checked_judge(&Task { model: &model, solved: &solved, class, goal: Goal::WorstRate }).unwrap();
            let samples: Vec<usize> = (0..judge.matrix().samples()).step_by(7).collect();
            let selected = judge.matrix().select(&samples);
            for stream in 0..3 {
                let mut random = generator(1, stream);
                let drawn = Stretches::draw(class, &draw(class, 14, &mut random), &mut random);
                let orders: [Vec<Orders>; 2] = [0, 1].map(|set: usize| {
                    drawn.sets[set].iter().map(|s| drawn.orders(&judge, &selected, class, s)).collect()
                });
                let counts = [0, 1].map(|set: usize| orders[set].iter().map(Orders::count).product::<usize>());
                let here = judge.values_at(&samples, &segments_by_layer(&drawn.layers));
                let values = |layers: &[usize]| judge.values_at(&samples, &segments_by_layer(layers));
                for _ in 0..20 {
                    let [left, right] = counts.map(|count| pick(&mut random, count) as u32);
                    let layers = with(&with(&drawn.layers, &orders[0], left), &orders[1], right);
                    let mut expected = here.clone();
                    for (orders, number) in orders.iter().zip([left, right]) {
                        for (stretch, at) in chosen(orders, number) {
                            let changes = &stretch.changes[at * samples.len()..(at + 1) * samples.len()];
                            expected.iter_mut().zip(changes).for_each(|(e, c)| *e += c);
                        }
                    }
                    let found = values(&layers);
                    let scale = found.iter().chain(&here).fold(0.0_f64, |most, v| most.max(v.abs()));
                    for (e, f) in expected.iter().zip(&found) {
                        assert!((e - f).abs() < 1e-9 * scale, "{effects:?}: {e} {f} of {scale}");
                    }
                }
            }
        }
    }

    #[test]
    fn stretches_of_a_set_are_drawn_apart_and_within_the_fibre_for_every_count_of_layers() {
        for layers in 2..=64 {
            for stream in 0..20 {
                let mut random = generator(1, stream);
                let sets = sets(layers, &mut random);
                let mut taken = vec![false; layers];
                for at in sets.iter().flatten().flat_map(Clone::clone) {
                    assert!(!std::mem::replace(&mut taken[at], true), "{layers}: {sets:?}");
                }
                let orders = |set: &[Range<usize>]| set.iter().flat_map(|s| 1..=s.len()).product::<usize>();
                assert!(sets.iter().all(|set| orders(set) <= 40_320), "{layers}: {sets:?}");
            }
        }
    }
}
