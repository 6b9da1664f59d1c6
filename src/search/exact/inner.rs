//! All ways to place the innermost layers on given places, as a tree of boxes over their sums.
//!
//! With equal lengths the inner layers' sum depends on the open places only, and many nodes leave the same places open:
//! the sums are computed once and every such node asks the tree which of them bring it under the limit. The search
//! meets in the middle.

use super::orders::{LANES, MOST_LAYERS, Orders};

/// Layers that are placed from a tree: at most 720 sums, which fit the second-level cache.
pub const INNER_LAYERS: usize = 6;

/// A box over everything up to `skip`, or one way to place the layers.
#[derive(Debug, Clone, Copy)]
struct Entry {
    skip: u32,
    /// Start of its bounds: lows, then highs, or one sum.
    data: u32,
    /// Start of its places, for one way to place the layers.
    places: Option<u32>,
}

/// The tree, with its boxes in front of what they hold.
#[derive(Debug, Default)]
pub struct Inner {
    width: usize,
    layers: usize,
    entries: Vec<Entry>,
    data: Vec<f32>,
    places: Vec<u8>,
}

impl Inner {
    /// Every way that the class admits to place as many innermost layers as there are open places.
    pub fn new(orders: &Orders, open: u64) -> Self {
        let mut inner = Self { width: orders.width(), layers: open.count_ones() as usize, ..Self::default() };
        let sum = vec![0.0; inner.width];
        let mut placed = Vec::with_capacity(inner.layers);
        inner.extend(orders, open, &mut placed, &sum);
        inner
    }

    fn extend(&mut self, orders: &Orders, open: u64, placed: &mut Vec<u8>, sum: &[f32]) {
        if open == 0 {
            let skip = self.entries.len() as u32 + 1;
            let places = Some(self.places.len() as u32);
            self.entries.push(Entry { skip, data: self.data.len() as u32, places });
            self.data.extend_from_slice(sum);
            self.places.extend_from_slice(placed);
            return;
        }
        // A box over one or two sums would cost as much to look at as they do.
        let boxed = open.count_ones() > 2;
        let (at, data) = (self.entries.len(), self.data.len());
        if boxed {
            self.entries.push(Entry { skip: 0, data: data as u32, places: None });
            self.data.extend(std::iter::repeat_n(f32::INFINITY, self.width));
            self.data.extend(std::iter::repeat_n(f32::NEG_INFINITY, self.width));
        }
        let layer = open.count_ones() as usize - 1;
        let mut next = vec![0.0; self.width];
        for place in (0..MOST_LAYERS).filter(|p| open >> p & 1 == 1) {
            let left = open & !(1 << place);
            if !orders.admits(left) {
                continue;
            }
            next.copy_from_slice(sum);
            orders.add_placed(layer, place, &mut next);
            placed.push(place as u8);
            self.extend(orders, left, placed, &next);
            placed.pop();
        }
        if boxed {
            self.entries[at].skip = self.entries.len() as u32;
            self.close_box(at);
        }
    }

    /// Widens a box to everything behind it.
    fn close_box(&mut self, at: usize) {
        let width = self.width;
        let start = self.entries[at].data as usize;
        for child in at + 1..self.entries.len() {
            let Entry { data, places, .. } = self.entries[child];
            if places.is_none() {
                continue;
            }
            let (bounds, sums) = self.data[start..].split_at_mut(data as usize - start);
            let (low, high) = bounds[..2 * width].split_at_mut(width);
            for ((l, h), v) in low.iter_mut().zip(high).zip(&sums[..width]) {
                *l = l.min(*v);
                *h = h.max(*v);
            }
        }
    }

    /// Calls `visit` with the places, outermost of the inner layers first, of every sum that lies between `low` and
    /// `high` in all coordinates. Counts the boxes and sums looked at.
    pub fn matches(&self, low: &[f32], high: &[f32], nodes: &mut u64, mut visit: impl FnMut(&[u8])) {
        let mut at = 0;
        while let Some(entry) = self.entries.get(at) {
            *nodes += 1;
            let start = entry.data as usize;
            match entry.places {
                None => {
                    let (lows, highs) = self.data[start..start + 2 * self.width].split_at(self.width);
                    at = if overlaps(lows, highs, low, high) { at + 1 } else { entry.skip as usize };
                }
                Some(places) => {
                    let sum = &self.data[start..start + self.width];
                    if overlaps(sum, sum, low, high) {
                        visit(&self.places[places as usize..places as usize + self.layers]);
                    }
                    at += 1;
                }
            }
        }
    }
}

#[inline]
fn overlaps(lows: &[f32], highs: &[f32], low: &[f32], high: &[f32]) -> bool {
    for from in (0..lows.len()).step_by(LANES) {
        let to = from + LANES;
        let (lows, highs, low, high) = (&lows[from..to], &highs[from..to], &low[from..to], &high[from..to]);
        let mut outside = false;
        for i in 0..LANES {
            outside |= (lows[i] > high[i]) | (highs[i] < low[i]);
        }
        if outside {
            return false;
        }
    }
    true
}
