//! The fibre as it lies on a coil: pieces by arclength, with turns more or fewer at its ends.
//!
//! ```text
//! w = ∫ (2z − L) dz,   x = ∫ (2z − L) 12 ζ dz = 12 ζ̄ w + 2 d f l²        over a piece
//! ```
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | ζ | place along the axis over the coil's height, −½ … ½ | 1 |
//! | ζ̄, f | middle of the piece, share of a whole layer's turns that it has | 1 |
//! | d, l | its direction, its length | 1, m |
//!
//! A whole layer has f = 1 and ζ̄ = 0. A piece with fewer turns lies at the flange at which it joins the rest of the fibre. Along the
//! axis a layer's temperature counts by its mean and first moment, which is exact for whole layers and a straight line's for others.

use super::RateError;
use crate::coil::Coil;
use crate::pattern::{EndTurns, Half, Pattern};

/// One stretch of fibre on one layer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LaidPiece {
    /// Index 0 is the innermost.
    pub(crate) layer: usize,
    pub(crate) segment: usize,
    /// The end whose turns were added here, on a layer that is another segment's.
    pub(crate) added_at: Option<Half>,
    pub(crate) turns: f64,
    /// Turns that would fit between the first flange and the piece.
    pub(crate) free_turns: f64,
    /// Arclength from end A.
    pub(crate) from_m: f64,
    pub(crate) to_m: f64,
    pub(crate) length_m: f64,
    /// Whether arclength grows away from the first flange: +1, or −1.
    pub(crate) direction: f64,
    /// ζ̄ and f.
    pub(crate) middle: f64,
    pub(crate) share: f64,
}

/// A coil wound in a pattern.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Laid {
    /// With the turns that each layer then has.
    pub(crate) coil: Coil,
    /// In the order of arclength.
    pub(crate) pieces: Vec<LaidPiece>,
}

impl Laid {
    /// `coil` as it would be with whole layers.
    ///
    /// # Errors
    /// A pattern of another layer count, ends that leave a layer no turns or put more on it than it holds.
    pub(crate) fn new(coil: &Coil, pattern: &Pattern) -> Result<Self, RateError> {
        if coil.layers() != pattern.layers() {
            return Err(RateError::Layers { pattern: pattern.layers(), coil: coil.layers() });
        }
        let ends = pattern.end_turns();
        let mut built = if ends.is_none() { coil.clone() } else { coil.with_turns(turns_of(coil, pattern)?)? };
        let added = pattern.added_turns().map_or(0.0, |(_, turns)| f64::from(turns));
        let outermost = coil.layers() - 1;
        let crossover = coil.crossover_turns();
        let per_turn_m = coil.layer_lengths_m()[outermost] / (coil.turns()[outermost] + crossover);
        if added > 0.0 {
            // Both pieces of a shared layer change sides.
            let mut factors = vec![1.0; coil.layers()];
            let turns = built.turns()[outermost];
            factors[outermost] = (turns + 2.0 * crossover) / (turns + crossover);
            built = built.with_lengths_scaled(&factors);
        }
        let mut from_m = 0.0;
        let mut pieces = Vec::with_capacity(coil.layers() + 1);
        for piece in pattern.pieces() {
            let layer = piece.layer;
            let (all_turns, all_m) = (built.turns()[layer], built.layer_lengths_m()[layer]);
            let is_shared = layer == outermost && added > 0.0;
            let (turns, length_m) = match (is_shared, piece.added_at) {
                (false, _) => (all_turns, all_m),
                (true, Some(_)) => (added, per_turn_m * (added + crossover)),
                (true, None) => (all_turns - added, per_turn_m * (all_turns - added + crossover)),
            };
            let whole = coil.turns()[layer];
            let share = turns / whole;
            let direction = pattern.direction_of(&piece);
            let is_of_end_a = piece.added_at == Some(Half::A) || (piece.added_at.is_none() && piece.segment == 1);
            // End A's pieces join the rest by their high ends, end B's by their low ends.
            let side = if is_of_end_a { direction } else { -direction };
            let is_at_first = share >= 1.0 || side < 0.0;
            pieces.push(LaidPiece {
                layer,
                segment: piece.segment,
                added_at: piece.added_at,
                turns,
                free_turns: if is_at_first { 0.0 } else { whole - turns },
                from_m,
                to_m: from_m + length_m,
                length_m,
                direction,
                middle: 0.5 * side * (1.0 - share),
                share,
            });
            from_m += length_m;
        }
        Ok(Self { coil: built, pieces })
    }
}

/// The turns of each layer, innermost first, with those that the ends add and leave off.
fn turns_of(coil: &Coil, pattern: &Pattern) -> Result<Vec<f64>, RateError> {
    let EndTurns { a, b } = pattern.end_turns();
    let layers = pattern.layers_by_segment();
    let outermost = coil.layers() - 1;
    let mut turns = coil.turns().to_vec();
    for (end, own, change) in [(Half::A, layers[0], a), (Half::B, layers[outermost], b)] {
        if change < 0 {
            turns[own] += f64::from(change);
            if turns[own] <= 0.0 {
                return Err(RateError::EndTurns { end, change, layer: own + 1, turns: coil.turns()[own] });
            }
        }
    }
    if let Some((_, added)) = pattern.added_turns() {
        turns[outermost] += f64::from(added);
    }
    Ok(turns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pattern::classic::Classic;
    use crate::rate::{CoilModel, LayerWeights};

    /// ∫ (2z − L) dz of each layer, of fibre that is followed through every turn from end A.
    fn turn_by_turn(pattern: &Pattern, radius_m: impl Fn(usize) -> f64, whole: u32) -> Vec<f64> {
        let EndTurns { a, b } = pattern.end_turns();
        let layers = pattern.layers();
        let mut turns: Vec<(usize, i64)> = Vec::new();
        for (segment, layer) in pattern.layers_by_segment().into_iter().enumerate() {
            let fewer = if segment == 0 {
                a.min(0)
            } else if segment == layers - 1 {
                b.min(0)
            } else {
                0
            };
            turns.push((layer, i64::from(whole) + i64::from(fewer)));
        }
        turns.insert(0, (layers - 1, i64::from(a.max(0))));
        turns.push((layers - 1, i64::from(b.max(0))));
        let of_turn: Vec<usize> =
            turns.into_iter().flat_map(|(layer, count)| std::iter::repeat_n(layer, count as usize)).collect();
        let length_of = |layer: usize| std::f64::consts::TAU * radius_m(layer);
        let length_m: f64 = of_turn.iter().map(|layer| length_of(*layer)).sum();
        let mut weights = vec![0.0; layers];
        let mut from_m = 0.0;
        for layer in of_turn {
            let to_m = from_m + length_of(layer);
            weights[layer] += (to_m - from_m) * (from_m + to_m - length_m);
            from_m = to_m;
        }
        weights
    }

    #[test]
    fn the_weights_are_those_of_the_fibre_followed_turn_by_turn() {
        let model = CoilModel::builder("x", 8).mean_diameter_m(0.08).turns_per_layer(20.0).build().unwrap();
        for classic in [Classic::Zyl, Classic::Dip, Classic::Qua] {
            let whole = classic.pattern(8).unwrap();
            let moved = match whole.end_on_outermost_layer() {
                Some(Half::A) => [EndTurns { a: -7, b: 7 }, EndTurns { a: -19, b: 4 }],
                _ => [EndTurns { a: 7, b: -7 }, EndTurns { a: 4, b: -19 }],
            };
            let fewer = [EndTurns { a: -5, b: 0 }, EndTurns { a: -1, b: -3 }, EndTurns::default()];
            for ends in fewer.into_iter().chain(moved) {
                let pattern = whole.clone().with_end_turns(ends).unwrap();
                let expected = turn_by_turn(&pattern, |layer| model.coil.layer_radius_m(layer), 20);
                let laid = Laid::new(&model.coil, &pattern).unwrap();
                let weights = LayerWeights::of(&laid).total_m2();
                let size = laid.coil.length_m().powi(2);
                for (found, expected) in weights.iter().zip(&expected) {
                    assert!((found - expected).abs() < 1e-12 * size, "{classic:?} {ends}: {weights:?} {expected:?}");
                }
                assert!(weights.iter().sum::<f64>().abs() < 1e-12 * size);
            }
        }
    }

    #[test]
    fn ends_that_leave_a_layer_nothing_are_refused_by_its_number() {
        let model = CoilModel::builder("x", 8).mean_diameter_m(0.08).turns_per_layer(20.0).build().unwrap();
        let pattern = Classic::Qua.pattern(8).unwrap().with_end_turns(EndTurns { a: 0, b: -20 }).unwrap();
        let refused = Laid::new(&model.coil, &pattern).unwrap_err();
        assert_eq!(refused, RateError::EndTurns { end: Half::B, change: -20, layer: 7, turns: 20.0 });
    }
}
