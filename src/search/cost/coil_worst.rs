//! The worst case of one coil with any layer weights: columns that are added up, and a cheap bound from below.
//!
//! ```text
//! Σ_i |v_i|  ≥  Σ_g | Σ_{i in g} v_i |          rows looked at by groups g: an eighth of the work, enough to refuse most patterns
//! max_i |v_i|  ≥  max over some of the rows
//! ```
//!
//! Symbols as in [`sampled_coils`](super::sampled_coils).

use std::ops::{AddAssign, Mul};

use pulp::{Arch, NullaryFnOnce};

use crate::pattern::{axial_direction, layers_by_segment};
use crate::rate::{WeightResponse, segment_weights_m2};

/// Rows that are looked at as one before all of them are. By P95 of 48 layers a search takes half the processor time so; with a
/// further look at 32 as one it takes no less.
const ROWS_AS_ONE: usize = 8;

/// Rows that are added up at a time, in registers.
const LANES: usize = 16;

/// A linear map from layer weights to samples.
///
/// # Shapes
/// Columns: the constant, one a layer, and those of half B and of the axial moments where they are needed. `blocks` holds [`LANES`] rows of each
/// column, then the next rows of each; the last rows are filled up with zeros.
#[derive(Debug, Clone)]
pub(super) struct Part {
    rows: usize,
    columns: usize,
    blocks: Blocks,
    /// Where half B's columns are multiples of half A's.
    half_b_over_a: Option<Vec<f64>>,
    axial: bool,
}

#[derive(Debug, Clone)]
enum Blocks {
    Double(Vec<[f64; LANES]>),
    /// Half the room, so that more coils fit into a fast memory.
    Single(Vec<[f32; LANES]>),
}

#[derive(Debug, Clone)]
pub(super) enum Worst {
    /// Of samples: the largest size.
    Largest(Part),
    /// Of G(0+) and its changes: the sum of their sizes.
    Variation(Part),
    /// Of changes and of the heat's error at the same times.
    Heated(Part, Part),
}

/// Room for the weights and values of one coil.
#[derive(Debug, Clone, Default)]
pub(super) struct Scratch {
    half_a_m2: Vec<f64>,
    half_b_m2: Vec<f64>,
    axial_m2: Vec<f64>,
    factors: Vec<f64>,
    single: Vec<f32>,
    values: Vec<f64>,
    heat: Vec<f64>,
}

impl Part {
    pub(super) fn new(layers: usize, responses: &[WeightResponse]) -> Self {
        let column = |part: fn(&WeightResponse) -> &[f64], j: usize| -> Vec<f64> {
            responses.iter().map(|r| part(r).get(j).copied().unwrap_or(0.0)).collect()
        };
        fn half_a(response: &WeightResponse) -> &[f64] {
            &response.half_a_rad_per_s_m2
        }
        fn half_b(response: &WeightResponse) -> &[f64] {
            &response.half_b_rad_per_s_m2
        }
        fn axial(response: &WeightResponse) -> &[f64] {
            &response.axial_rad_per_s_m2
        }
        let mut columns = vec![responses.iter().map(|r| r.constant_rad_per_s).collect()];
        columns.extend((0..layers).map(|j| column(half_a, j)));
        let half_b_over_a: Option<Vec<f64>> =
            (0..layers).map(|j| ratio(&column(half_a, j), &column(half_b, j))).collect();
        if half_b_over_a.is_none() {
            columns.extend((0..layers).map(|j| column(half_b, j)));
        }
        let has_axial = responses.iter().any(|r| r.axial_rad_per_s_m2.iter().any(|x| *x != 0.0));
        if has_axial {
            columns.extend((0..layers).map(|j| column(axial, j)));
        }
        Self::of_columns(&columns, half_b_over_a, has_axial)
    }

    fn of_columns(columns: &[Vec<f64>], half_b_over_a: Option<Vec<f64>>, axial: bool) -> Self {
        let rows = columns[0].len();
        let mut blocks = Vec::with_capacity(rows.div_ceil(LANES) * columns.len());
        for first in (0..rows).step_by(LANES) {
            let block = |column: &Vec<f64>| std::array::from_fn(|i| column.get(first + i).copied().unwrap_or(0.0));
            blocks.extend(columns.iter().map(block));
        }
        Self { rows, columns: columns.len(), blocks: Blocks::Double(blocks), half_b_over_a, axial }
    }

    /// Sums of so many rows each.
    fn summed(&self, rows: usize) -> Self {
        self.each_column(|column| column.chunks(rows).map(|chunk| chunk.iter().sum()).collect())
    }

    /// The last of so many rows each.
    fn last_of(&self, rows: usize) -> Self {
        self.each_column(|column| column.chunks(rows).filter_map(|chunk| chunk.last().copied()).collect())
    }

    fn each_column(&self, shorter: impl Fn(&[f64]) -> Vec<f64>) -> Self {
        let value = |column: usize, row: usize| match (&self.blocks, row / LANES * self.columns + column) {
            (Blocks::Double(blocks), block) => blocks[block][row % LANES],
            (Blocks::Single(blocks), block) => f64::from(blocks[block][row % LANES]),
        };
        let column = |k: usize| -> Vec<f64> { (0..self.rows).map(|row| value(k, row)).collect() };
        let columns: Vec<Vec<f64>> = (0..self.columns).map(|k| shorter(&column(k))).collect();
        Self::of_columns(&columns, self.half_b_over_a.clone(), self.axial)
    }

    /// In single precision, which leaves fewer digits where columns cancel: for coils that do not have the last word.
    fn single(&self) -> Self {
        let blocks = match &self.blocks {
            Blocks::Double(blocks) => blocks.iter().map(|block| block.map(|v| v as f32)).collect(),
            Blocks::Single(blocks) => blocks.clone(),
        };
        Self { blocks: Blocks::Single(blocks), half_b_over_a: self.half_b_over_a.clone(), ..*self }
    }

    /// Columns are added one after the other, in every row.
    fn values(&self, scratch: &mut Scratch, values: &mut Vec<f64>) {
        let Scratch { half_a_m2, half_b_m2, axial_m2, factors, single, .. } = scratch;
        factors.clear();
        match &self.half_b_over_a {
            Some(ratio) => {
                let halves = half_a_m2.iter().zip(half_b_m2);
                factors.extend(ratio.iter().zip(halves).map(|(ratio, (a, b))| *a + ratio * *b));
            }
            None => factors.extend(half_a_m2.iter().chain(half_b_m2.iter())),
        }
        if self.axial {
            factors.extend(axial_m2.iter());
        }
        values.clear();
        match &self.blocks {
            Blocks::Double(blocks) => Arch::new().dispatch(AddUp { blocks, columns: self.columns, factors, values }),
            Blocks::Single(blocks) => {
                single.clear();
                single.extend(factors.iter().map(|f| *f as f32));
                Arch::new().dispatch(AddUp { blocks, columns: self.columns, factors: single, values });
            }
        }
        values.truncate(self.rows);
    }
}

/// Columns times factors; wider registers, where a processor has them, change nothing in the order of additions.
struct AddUp<'a, T> {
    blocks: &'a [[T; LANES]],
    columns: usize,
    factors: &'a [T],
    values: &'a mut Vec<f64>,
}

impl<T: Copy + AddAssign + Mul<Output = T> + Into<f64>> NullaryFnOnce for AddUp<'_, T> {
    type Output = ();

    // A closure need not be inlined into what is compiled for wide registers.
    #[inline(always)]
    fn call(self) {
        for block in self.blocks.chunks_exact(self.columns) {
            let mut sum = block[0];
            for (column, factor) in block[1..].iter().zip(self.factors) {
                sum.iter_mut().zip(column).for_each(|(v, d)| *v += *factor * *d);
            }
            self.values.extend(sum.map(Into::<f64>::into));
        }
    }
}

/// b/a where b is one multiple of a but for rounding.
fn ratio(a: &[f64], b: &[f64]) -> Option<f64> {
    const ROUNDING: f64 = 1e-12;
    let largest = a.iter().map(|v| v.abs()).fold(0.0, f64::max);
    let at = a.iter().position(|v| v.abs() == largest)?;
    if largest == 0.0 {
        return b.iter().all(|v| *v == 0.0).then_some(1.0);
    }
    let ratio = b[at] / a[at];
    a.iter().zip(b).all(|(a, b)| (b - ratio * a).abs() <= ROUNDING * largest * ratio.abs()).then_some(ratio)
}

impl Worst {
    /// One that is never above this one: sums of neighbouring changes are no larger than the sum of their sizes, and the largest
    /// of some no larger than that of all.
    pub(super) fn at_least(&self) -> Self {
        match self {
            Worst::Largest(part) => Worst::Largest(part.last_of(ROWS_AS_ONE)),
            Worst::Variation(part) => Worst::Variation(part.summed(ROWS_AS_ONE)),
            Worst::Heated(changes, heat) => Worst::Heated(changes.summed(ROWS_AS_ONE), heat.last_of(ROWS_AS_ONE)),
        }
    }

    /// One of half the work: of changes over two rows, which is hardly less, in single precision. What is looked at by instants has each of
    /// them.
    pub(super) fn coarser(&self) -> Self {
        match self {
            Worst::Largest(part) => Worst::Largest(part.single()),
            Worst::Variation(part) => Worst::Variation(part.summed(2).single()),
            Worst::Heated(changes, heat) => Worst::Heated(changes.summed(2).single(), heat.last_of(2).single()),
        }
    }

    /// In single precision.
    pub(super) fn single(&self) -> Self {
        match self {
            Worst::Largest(part) => Worst::Largest(part.single()),
            Worst::Variation(part) => Worst::Variation(part.single()),
            Worst::Heated(changes, heat) => Worst::Heated(changes.single(), heat.single()),
        }
    }

    /// Whether a pattern's axial weights enter.
    pub(super) fn asks_axial(&self) -> bool {
        match self {
            Worst::Largest(part) | Worst::Variation(part) => part.axial,
            Worst::Heated(changes, heat) => changes.axial || heat.axial,
        }
    }

    /// With the weights of a scratch.
    pub(super) fn of(&self, scratch: &mut Scratch) -> f64 {
        let mut values = std::mem::take(&mut scratch.values);
        let worst = match self {
            Worst::Largest(part) => {
                part.values(scratch, &mut values);
                values.iter().map(|v| v.abs()).fold(0.0, f64::max)
            }
            Worst::Variation(part) => {
                part.values(scratch, &mut values);
                sum_of_sizes(&values)
            }
            Worst::Heated(changes, heat) => {
                changes.values(scratch, &mut values);
                let mut heated = std::mem::take(&mut scratch.heat);
                heat.values(scratch, &mut heated);
                let mut sum = 0.0;
                let mut largest = 0.0_f64;
                for (change, heat) in values.iter().zip(&heated) {
                    sum += change.abs();
                    largest = largest.max(sum + heat.abs());
                }
                scratch.heat = heated;
                largest
            }
        };
        scratch.values = values;
        worst
    }
}

/// Eight lanes, so that the order of additions is the same on every machine.
fn sum_of_sizes(values: &[f64]) -> f64 {
    let mut lanes = [0.0_f64; 8];
    let chunks = values.chunks_exact(8);
    let rest: f64 = chunks.remainder().iter().map(|v| v.abs()).sum();
    for chunk in chunks {
        for (lane, v) in lanes.iter_mut().zip(chunk) {
            *lane += v.abs();
        }
    }
    lanes.iter().sum::<f64>() + rest
}

/// A pattern as a search handles it.
pub(super) struct Arrangement<'a> {
    segments: &'a [usize],
    layers_by_segment: Vec<usize>,
}

impl<'a> Arrangement<'a> {
    pub(super) fn new(segments: &'a [usize]) -> Self {
        Self { segments, layers_by_segment: layers_by_segment(segments) }
    }

    /// Weights of a coil whose layers have these lengths; axial ones where a worst case asks for them.
    pub(super) fn weigh(&self, lengths_m: &[f64], length_m: f64, asks_axial: bool, scratch: &mut Scratch) {
        scratch.half_a_m2.resize(lengths_m.len(), 0.0);
        scratch.half_b_m2.resize(lengths_m.len(), 0.0);
        let mut from_m = 0.0;
        for &layer in &self.layers_by_segment {
            let to_m = from_m + lengths_m[layer];
            let (a, b) = segment_weights_m2(from_m, to_m, length_m);
            scratch.half_a_m2[layer] = a;
            scratch.half_b_m2[layer] = b;
            from_m = to_m;
        }
        if asks_axial {
            scratch.axial_m2.clear();
            let axial = |(layer, l): (usize, &f64)| 2.0 * axial_direction(self.segments, layer) * l.powi(2);
            scratch.axial_m2.extend(lengths_m.iter().enumerate().map(axial));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coil::LayerLength;
    use crate::pattern::classic::Classic;
    use crate::pattern::windability::WindabilityClass;
    use crate::search::anneal::limits::draw;
    use crate::search::anneal::restart::generator;
    use crate::search::cost::guaranteed::UnitStep;
    use crate::search::cost::samples::tests::model;

    #[test]
    fn the_bound_from_groups_of_rows_is_never_above_the_worst_case_and_near_it() {
        for effects in [&["surface_film"][..], &["strain_mismatch", "surface_film"]] {
            let model = model(12, LayerLength::Actual, effects);
            let parts = UnitStep::new(&model, 0.003).unwrap().parts(&model, 3).unwrap();
            let changes = || Part::new(12, &parts.changes);
            let coil = model.wound_coil().unwrap();
            // Heat is of the same shape as changes are.
            let all = [Worst::Variation(changes()), Worst::Largest(changes()), Worst::Heated(changes(), changes())];
            for worst in all {
                let bound = worst.at_least();
                let mut nearest = 0.0_f64;
                for stream in 0..20 {
                    let segments = draw(WindabilityClass::Any, 12, &mut generator(1, stream));
                    let mut scratch = Scratch::default();
                    Arrangement::new(&segments).weigh(coil.layer_lengths_m(), coil.length_m(), true, &mut scratch);
                    let share = bound.of(&mut scratch) / worst.of(&mut scratch);
                    assert!(share <= 1.0 + 1e-12, "{share}");
                    nearest = nearest.max(share);
                }
                assert!(nearest > 0.5, "{nearest}");
            }
        }
    }

    /// Of a quadrupole, where columns cancel most, and of patterns drawn at random.
    #[test]
    fn single_precision_changes_a_worst_case_by_a_hundred_thousandth_at_most_and_half_the_rows_by_a_fifth() {
        let model = model(12, LayerLength::Actual, &["strain_mismatch", "surface_film"]);
        let parts = UnitStep::new(&model, 0.003).unwrap().parts(&model, 3).unwrap();
        let changes = || Part::new(12, &parts.changes);
        let coil = model.wound_coil().unwrap();
        let quadrupole = Classic::Qua.pattern(12).unwrap().segments().to_vec();
        let drawn = (0..20).map(|stream| draw(WindabilityClass::Any, 12, &mut generator(1, stream)));
        for segments in drawn.chain([quadrupole]) {
            let mut scratch = Scratch::default();
            Arrangement::new(&segments).weigh(coil.layer_lengths_m(), coil.length_m(), true, &mut scratch);
            for worst in [Worst::Variation(changes()), Worst::Largest(changes()), Worst::Heated(changes(), changes())] {
                let [double, single, coarser] =
                    [&worst, &worst.single(), &worst.coarser()].map(|worst| worst.of(&mut scratch));
                assert!((single / double - 1.0).abs() < 1e-5, "{segments:?}: {single} {double}");
                assert!(coarser / double < 1.0 + 1e-5 && coarser / double > 0.8, "{segments:?}: {coarser} {double}");
            }
        }
    }

    #[test]
    fn a_coil_that_is_looked_at_at_no_time_has_no_error() {
        let worst = Worst::Largest(Part::new(8, &[]));
        let mut scratch = Scratch::default();
        Arrangement::new(&[1, 2, 3, 4, 5, 6, 7, 8]).weigh(&[100.0; 8], 800.0, true, &mut scratch);
        assert_eq!([worst.at_least().of(&mut scratch), worst.of(&mut scratch)], [0.0, 0.0]);
    }

    #[test]
    fn columns_are_added_up_as_one_by_one() {
        let model = model(10, LayerLength::Actual, &["strain_mismatch"]);
        let parts = UnitStep::new(&model, 0.003).unwrap().parts(&model, 3).unwrap();
        let part = Part::new(10, &parts.changes);
        let segments = draw(WindabilityClass::Any, 10, &mut generator(1, 0));
        let mut scratch = Scratch::default();
        let coil = model.wound_coil().unwrap();
        Arrangement::new(&segments).weigh(coil.layer_lengths_m(), coil.length_m(), true, &mut scratch);
        let mut values = Vec::new();
        part.values(&mut scratch, &mut values);
        let of = |columns: &[f64], weights: &[f64]| -> f64 { columns.iter().zip(weights).map(|(d, w)| d * w).sum() };
        let expected: Vec<f64> = (parts.changes.iter())
            .map(|response| {
                response.constant_rad_per_s
                    + of(&response.half_a_rad_per_s_m2, &scratch.half_a_m2)
                    + of(&response.half_b_rad_per_s_m2, &scratch.half_b_m2)
                    + of(&response.axial_rad_per_s_m2, &scratch.axial_m2)
            })
            .collect();
        let largest = expected.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        assert!(expected.len() > 100 && largest > 0.0);
        for (value, expected) in values.iter().zip(&expected) {
            assert!((value - expected).abs() <= 1e-10 * largest, "{value} {expected}");
        }
    }
}
