//! Which samples a proof runs on, and the search over them.
//!
//! Samples at which patterns near the best known ones are worst come first; for permutations, random descents then
//! count which of them refute most nodes. Where a pass leaves too much to be judged in full, the samples that refuted
//! it join and the pass is repeated.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::descent::search;
use super::ends::Ends;
use super::judge::Judge;
use super::orders::{Node, Orders, Places};
use super::rows::Row;
use super::{Outcome, Watch};
use crate::pattern::Pattern;
use crate::pattern::windability::WindabilityClass;
use crate::search::signs::{segments_of_signs, signs_of_segments};

/// Samples that a search over ends begins with, and the most that it may grow to.
const FIRST_ENDS_ROWS: usize = 16;
const MOST_ENDS_ROWS: usize = 64;

/// Samples that a search over permutations begins with, and the most that it may grow to.
const FIRST_ORDERS_ROWS: usize = 32;
const MOST_ORDERS_ROWS: usize = 128;

/// Samples that the descents choose from.
const CANDIDATES: usize = 160;

/// Patterns that are asked for their worst sample.
const NEIGHBOURS: usize = 512;

const DESCENTS: usize = 512;

/// The seed of the descents: they choose samples, and do not decide what is proved.
const DESCENT_SEED: u64 = 1;

#[derive(Debug)]
enum Engine {
    Ends(Box<Ends>),
    /// One search, or two where the first layer's direction matters.
    Orders(Vec<Orders>),
}

/// A search over chosen samples.
#[derive(Debug)]
pub struct Proof {
    class: WindabilityClass,
    mirrored: bool,
    samples: Vec<usize>,
    engine: Engine,
}

impl Proof {
    pub fn new(class: WindabilityClass, judge: &mut Judge, starts: &[Pattern], best_rad_per_s: f64) -> Self {
        let mirrored = judge.is_mirror_symmetric();
        let near = neighbours(class, starts);
        let samples = if class == WindabilityClass::Standard {
            judge.binding_samples(&near, FIRST_ENDS_ROWS)
        } else {
            let mut candidates = judge.binding_samples(&near, CANDIDATES / 2);
            let stride = (judge.matrix().samples() / (CANDIDATES / 2)).max(1);
            candidates.extend((0..judge.matrix().samples()).step_by(stride));
            candidates.sort_unstable();
            candidates.dedup();
            most_refuting(judge, class, candidates, best_rad_per_s, mirrored)
        };
        let engine = Self::engine(class, judge, &samples, mirrored);
        judge.try_first(&samples);
        Self { class, mirrored, samples, engine }
    }

    fn engine(class: WindabilityClass, judge: &Judge, samples: &[usize], mirrored: bool) -> Engine {
        let rows: Vec<Row> = samples.iter().map(|&s| Row::of(judge.matrix(), s)).collect();
        if class == WindabilityClass::Standard {
            Engine::Ends(Box::new(Ends::new(&rows, judge.lengths_m(), mirrored)))
        } else {
            Engine::Orders(both_directions(&rows, judge, class))
        }
    }

    /// Samples in use.
    pub fn rows(&self, judge: &Judge) -> Vec<Row> {
        self.samples.iter().map(|&s| Row::of(judge.matrix(), s)).collect()
    }

    /// Judges every pattern whose worst rate may be below the limit.
    pub fn pass(&mut self, judge: &mut Judge, limit_rad_per_s: f64, watch: &mut Watch) -> Outcome {
        let mut whole = Outcome::default();
        loop {
            let outcome = match &self.engine {
                Engine::Ends(ends) => ends.search(judge, limit_rad_per_s, watch),
                Engine::Orders(directions) => {
                    let mut outcome = Outcome::default();
                    for orders in directions {
                        outcome.absorb(search(orders, judge, limit_rad_per_s, self.mirrored, watch));
                    }
                    outcome
                }
            };
            let complete = outcome.complete;
            let repeat = outcome.overflowed && !watch.is_stopped();
            if repeat && !self.add(judge, &outcome) {
                watch.may_overflow = false;
            }
            whole.absorb(outcome);
            if !repeat {
                whole.complete = complete;
                return whole;
            }
        }
    }

    /// Takes in the samples that refuted most, and the instants at which only the reference could; false if there is
    /// no room or nothing new.
    fn add(&mut self, judge: &mut Judge, outcome: &Outcome) -> bool {
        let first_new = judge.matrix().samples();
        let mut joining: Vec<usize> = Vec::new();
        if judge.add_peaks(&outcome.between) {
            joining.extend(first_new..judge.matrix().samples());
        }
        let has_new_instants = !joining.is_empty();
        let mut sorted = outcome.refuting.clone();
        sorted.sort_unstable();
        let mut counted: Vec<(usize, usize)> = sorted.chunk_by(|a, b| a == b).map(|c| (c.len(), c[0])).collect();
        counted.sort_by_key(|&(count, sample)| (std::cmp::Reverse(count), sample));
        joining.extend(counted.into_iter().map(|(_, sample)| sample));
        let most = if self.class == WindabilityClass::Standard { MOST_ENDS_ROWS } else { MOST_ORDERS_ROWS };
        let room = most.min(2 * self.samples.len());
        let before = self.samples.len();
        for sample in joining {
            if self.samples.len() < room && !self.samples.contains(&sample) {
                self.samples.push(sample);
            }
        }
        if self.samples.len() > before {
            self.engine = Self::engine(self.class, judge, &self.samples, self.mirrored);
            judge.try_first(&self.samples);
        }
        has_new_instants || self.samples.len() > before
    }
}

fn both_directions(rows: &[Row], judge: &Judge, class: WindabilityClass) -> Vec<Orders> {
    let signs: &[Option<f32>] = if judge.matrix().layout.axial { &[Some(1.0), Some(-1.0)] } else { &[None] };
    signs.iter().map(|&sign| Orders::new(rows, judge.lengths_m(), class, sign)).collect()
}

/// Patterns one step away from given ones: two layers exchanged, or one or two layers at the other end.
fn neighbours(class: WindabilityClass, starts: &[Pattern]) -> Vec<Vec<usize>> {
    let mut found: Vec<Vec<usize>> = starts.iter().map(|p| p.segments().to_vec()).collect();
    for start in starts {
        for a in 0..start.layers() - 1 {
            for b in a..start.layers() {
                let mut segments = start.segments().to_vec();
                match signs_of_segments(&segments) {
                    Some(mut high) if class == WindabilityClass::Standard => {
                        high[a] = !high[a];
                        if b != a && b < high.len() {
                            high[b] = !high[b];
                        }
                        found.push(segments_of_signs(&high));
                    }
                    _ => {
                        segments.swap(a, b);
                        found.push(segments);
                    }
                }
            }
        }
    }
    let stride = found.len().div_ceil(NEIGHBOURS).max(1);
    found.into_iter().step_by(stride).collect()
}

/// The candidates that refute most nodes in random descents.
fn most_refuting(
    judge: &Judge,
    class: WindabilityClass,
    candidates: Vec<usize>,
    limit_rad_per_s: f64,
    mirrored: bool,
) -> Vec<usize> {
    let rows: Vec<Row> = candidates.iter().map(|&s| Row::of(judge.matrix(), s)).collect();
    let directions = both_directions(&rows, judge, class);
    let mut random = ChaCha8Rng::seed_from_u64(DESCENT_SEED);
    let mut counts = vec![0usize; candidates.len()];
    let mut places = Places::default();
    for descent in 0..DESCENTS {
        let orders = &directions[descent % directions.len()];
        let mut node = orders.root();
        while node.open != 0 {
            let mut alive: Vec<Node> = Vec::new();
            for place in 0..orders.layers() {
                if orders.place(&mut node, place, mirrored) {
                    match orders.refuting_row(&node, limit_rad_per_s as f32, &mut places) {
                        Some(row) => counts[row] += 1,
                        None => alive.push(node.clone()),
                    }
                    node.take_back();
                }
            }
            if alive.is_empty() {
                break;
            }
            let at = (u64::from(random.next_u32()) * alive.len() as u64) >> 32;
            node = alive.swap_remove(at as usize);
        }
    }
    let mut order: Vec<usize> = (0..candidates.len()).collect();
    order.sort_by_key(|&i| (std::cmp::Reverse(counts[i]), i));
    order.truncate(FIRST_ORDERS_ROWS);
    order.into_iter().map(|i| candidates[i]).collect()
}
