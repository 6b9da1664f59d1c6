//! Haar coefficients of several columns at once, level by level, as sums of squares and products in constant memory.
//!
//! ```text
//! d = √(c_l c_r/(c_l + c_r)) (mean of the right half − mean of the left half)
//! n_j = number of d at level j,   G_j = Σ d dᵀ over the columns
//! ```
//!
//! | symbol | meaning | in code |
//! |---|---|---|
//! | c_l, c_r | values that are there in the halves of a block of 2^j places | `count` |
//! | G_j | products of all pairs of columns | `products`, upper triangle by rows |
//!
//! The coefficients are those of the orthonormal Haar transform, so white noise has the same variance at each level; at level j
//! that is 2^(j−1) times the Allan variance over 2^(j−1) places, by pairs that do not overlap. Places without a value are left out;
//! a coefficient counts where both halves are at least half full. Levels at and above a `bottom` hold all columns, those below it
//! only the first one: columns that vary slowly cost nothing where they say nothing.
//!
//! # Source
//! Percival, Walden, Wavelet Methods for Time Series Analysis (2000), sections 4.1, 8.6 (Allan variance as Haar variance).

/// What one level holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Level {
    /// Coefficients.
    pub(crate) count: f64,
    /// How many columns `products` is of: 1 below the bottom.
    pub(crate) columns: usize,
    pub(crate) products: Vec<f64>,
}

impl Level {
    fn new(columns: usize) -> Self {
        Self { count: 0.0, columns, products: vec![0.0; columns * (columns + 1) / 2] }
    }

    /// Of columns `a` ≤ `b`.
    pub(crate) fn product(&self, a: usize, b: usize) -> f64 {
        let before = a * self.columns - a * a.saturating_sub(1) / 2;
        self.products[before + b - a]
    }
}

/// The sums of a block that may still be joined with its right neighbour.
#[derive(Debug, Clone)]
struct Node {
    block: u64,
    count: f64,
    sums: Vec<f64>,
}

/// Takes values at places that increase; see the module's head.
#[derive(Debug, Clone)]
pub struct Pyramid {
    columns: usize,
    bottom: usize,
    levels: Vec<Level>,
    waiting: Vec<Option<Node>>,
    /// Of the block at the bottom: the sums of the columns but the first.
    slow: Vec<f64>,
    slow_count: f64,
}

impl Pyramid {
    /// Blocks of `2^bottom` places are the first that have all columns.
    pub fn new(columns: usize, bottom: usize) -> Self {
        Self {
            columns,
            bottom,
            levels: Vec::new(),
            waiting: Vec::new(),
            slow: vec![0.0; columns.saturating_sub(1)],
            slow_count: 0.0,
        }
    }

    /// `first` is the first column's value at a place; `slow` writes the others, asked for once a block of the bottom.
    pub fn push(&mut self, place: u64, first: f64, slow: impl FnOnce(&mut [f64])) {
        let block = place >> self.bottom;
        let begun = self.bottom > 0 && self.slow_count > 0.0 && self.waiting_block() == Some(block);
        if !begun {
            self.lift_below(self.bottom);
            slow(&mut self.slow);
            self.slow_count = 1.0;
        }
        if self.bottom == 0 {
            let mut sums = Vec::with_capacity(self.columns);
            sums.push(first);
            sums.extend_from_slice(&self.slow);
            self.join(0, Node { block: place, count: 1.0, sums });
        } else {
            self.join(0, Node { block: place, count: 1.0, sums: vec![first] });
        }
    }

    /// Which block of the bottom is under way.
    fn waiting_block(&self) -> Option<u64> {
        self.waiting
            .iter()
            .take(self.bottom)
            .enumerate()
            .find_map(|(level, node)| node.as_ref().map(|n| n.block >> (self.bottom - level)))
    }

    /// Lifts what waits below a level, as if nothing more came to join it.
    fn lift_below(&mut self, end: usize) {
        for level in 0..end.min(self.waiting.len()) {
            if let Some(alone) = self.waiting[level].take() {
                let parent = self.parent(level, alone);
                self.join(level + 1, parent);
            }
        }
    }

    /// A node one level up; at the bottom it gets the other columns.
    fn parent(&mut self, level: usize, mut node: Node) -> Node {
        node.block >>= 1;
        if level + 1 == self.bottom {
            node.sums.extend(self.slow.iter().map(|v| v * node.count));
        }
        node
    }

    fn join(&mut self, mut level: usize, mut node: Node) {
        loop {
            while self.levels.len() <= level {
                let columns = if self.levels.len() < self.bottom { 1 } else { self.columns };
                self.levels.push(Level::new(columns));
                self.waiting.push(None);
            }
            match self.waiting[level].take() {
                Some(left) if left.block ^ 1 == node.block && left.block < node.block => {
                    self.detail(level, &left, &node);
                    node.count += left.count;
                    node.sums.iter_mut().zip(&left.sums).for_each(|(sum, more)| *sum += more);
                }
                Some(alone) => {
                    // Its partner never came.
                    let parent = self.parent(level, alone);
                    self.join(level + 1, parent);
                    if node.block & 1 == 0 {
                        self.waiting[level] = Some(node);
                        return;
                    }
                }
                None if node.block & 1 == 0 => {
                    self.waiting[level] = Some(node);
                    return;
                }
                None => {}
            }
            node = self.parent(level, node);
            level += 1;
        }
    }

    fn detail(&mut self, level: usize, left: &Node, right: &Node) {
        let least = 0.5 * (1u64 << level) as f64;
        if left.count < least || right.count < least {
            return;
        }
        let scale = (left.count * right.count / (left.count + right.count)).sqrt();
        let (by_left, by_right) = (scale / left.count, scale / right.count);
        let details: Vec<f64> = right.sums.iter().zip(&left.sums).map(|(r, l)| r * by_right - l * by_left).collect();
        let held = &mut self.levels[level];
        held.count += 1.0;
        let mut place = 0;
        for (a, one) in details.iter().enumerate() {
            for (sum, other) in held.products[place..].iter_mut().zip(&details[a..]) {
                *sum += one * other;
            }
            place += details.len() - a;
        }
    }

    /// The levels that have at least one coefficient, the finest first; with each its number, the finest being 1.
    pub fn finish(mut self) -> Vec<(usize, Level)> {
        let mut level = 0;
        while level < self.waiting.len() {
            if let Some(alone) = self.waiting[level].take() {
                // The last one of all has nobody above.
                if self.waiting[level + 1..].iter().any(Option::is_some) {
                    let parent = self.parent(level, alone);
                    self.join(level + 1, parent);
                }
            }
            level += 1;
        }
        self.levels.into_iter().enumerate().map(|(i, l)| (i + 1, l)).filter(|(_, l)| l.count > 0.0).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn levels(values: &[(u64, f64)], bottom: usize) -> Vec<(usize, Level)> {
        let mut pyramid = Pyramid::new(2, bottom);
        for &(place, value) in values {
            pyramid.push(place, value, |slow| slow[0] = 3.0 * (place >> bottom) as f64);
        }
        pyramid.finish()
    }

    #[test]
    fn the_coefficients_of_eight_values_are_those_worked_out_by_hand() {
        let values: Vec<(u64, f64)> =
            [1.0, 2.0, 4.0, 3.0, 0.0, 5.0, 6.0, 6.0].iter().enumerate().map(|(i, v)| (i as u64, *v)).collect();
        let found = levels(&values, 0);
        let squares: Vec<f64> = found.iter().map(|(_, l)| l.product(0, 0)).collect();
        // (1 + 1 + 25 + 0)/2, (4² + 7²)/4, 7²/8.
        assert_eq!(found.iter().map(|(_, l)| l.count).collect::<Vec<_>>(), [4.0, 2.0, 1.0]);
        for (found, expected) in squares.iter().zip([13.5, 16.25, 49.0 / 8.0]) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
        // The orthonormal transform keeps the square sum but for the mean's.
        let total: f64 = values.iter().map(|v| v.1 * v.1).sum();
        let mean: f64 = values.iter().map(|v| v.1).sum::<f64>() / 8.0;
        assert!((squares.iter().sum::<f64>() - (total - 8.0 * mean * mean)).abs() < 1e-12);
    }

    #[test]
    fn a_bottom_changes_nothing_in_the_first_column() {
        let values: Vec<(u64, f64)> = (0..1000).filter(|i| i % 7 != 3).map(|i| (i, ((i * i) % 31) as f64)).collect();
        let (fine, coarse) = (levels(&values, 0), levels(&values, 3));
        assert_eq!(fine.len(), coarse.len());
        for (a, b) in fine.iter().zip(&coarse) {
            assert_eq!(a.1.count, b.1.count);
            assert!((a.1.product(0, 0) - b.1.product(0, 0)).abs() < 1e-9 * a.1.product(0, 0).max(1.0));
        }
        assert_eq!(coarse[0].1.columns, 1);
        assert_eq!(coarse[3].1.columns, 2);
    }

    #[test]
    fn blocks_that_are_not_half_full_give_no_coefficient() {
        let values: Vec<(u64, f64)> = (0..8).chain([12]).map(|i| (i, 1.0)).collect();
        let found = levels(&values, 0);
        assert_eq!(found.iter().map(|(_, l)| l.count).collect::<Vec<_>>(), [4.0, 2.0, 1.0]);
    }
}
