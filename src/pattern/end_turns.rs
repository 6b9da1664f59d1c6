//! What a permutation of whole layers cannot say: turns more or fewer at the ends of the fibre.
//!
//! Turns left off at an end are missing on the layer of its segment. Turns added at an end lie on the outermost layer, in the
//! room that the other end's segment leaves there: that layer is then shared between the fibre's two ends. Either moves the
//! fibre's middle away from the joint of two segments, so that the layer in which it comes to lie belongs to both halves.
//!
//! Both pieces of a shared layer begin at a flange, each at its own: with an even number of layers the end of the fibre leaves its
//! layer at the flange at which the outermost one does not begin.

use super::{Half, Pattern, PatternError};

/// Whole turns more (above zero) or fewer (below) than whole layers at the fibre's ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct EndTurns {
    /// At the fibre's end A.
    pub a: i32,
    /// At the fibre's end B.
    pub b: i32,
}

impl EndTurns {
    pub(crate) fn is_none(self) -> bool {
        self == Self::default()
    }

    pub(crate) fn of(self, end: Half) -> i32 {
        match end {
            Half::A => self.a,
            Half::B => self.b,
        }
    }
}

impl std::fmt::Display for EndTurns {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:+} turns at end A, {:+} at end B", self.a, self.b)
    }
}

/// A piece of fibre that is wound in one go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WoundPiece {
    /// Index 0 is the innermost.
    pub(crate) layer: usize,
    /// Of an added piece the segment that it goes on from.
    pub(crate) segment: usize,
    /// The end whose turns were added here, on a layer that is another segment's.
    pub(crate) added_at: Option<Half>,
}

impl Pattern {
    /// The same order of segments with turns more or fewer at its ends.
    ///
    /// # Errors
    /// Turns added where the outermost layer has no room for them.
    pub fn with_end_turns(self, end_turns: EndTurns) -> Result<Self, PatternError> {
        for end in [Half::A, Half::B] {
            let (added, other) = (end_turns.of(end), end_turns.of(end.other()));
            if added <= 0 {
                continue;
            }
            if self.end_on_outermost_layer() != Some(end.other()) {
                return Err(PatternError::NoRoom { end, added });
            }
            if added > -other {
                return Err(PatternError::TooLittleRoom { end, added, room: (-other).max(0) });
            }
        }
        Ok(Self { end_turns, ..self })
    }

    /// Both 0 where the ends are whole layers.
    pub fn end_turns(&self) -> EndTurns {
        self.end_turns
    }

    /// The end of the fibre that lies on the outermost layer; none where that layer holds a segment from within.
    pub fn end_on_outermost_layer(&self) -> Option<Half> {
        match *self.segments.last()? {
            1 => Some(Half::A),
            last if last == self.layers() => Some(Half::B),
            _ => None,
        }
    }

    /// The end whose turns were added on the outermost layer, and how many.
    pub fn added_turns(&self) -> Option<(Half, u32)> {
        [Half::A, Half::B].into_iter().find_map(|end| {
            let added = self.end_turns.of(end);
            (added > 0).then(|| (end, added.unsigned_abs()))
        })
    }

    /// The pieces of the fibre in the order of arclength from end A.
    pub(crate) fn pieces(&self) -> Vec<WoundPiece> {
        let of_segment = |(s, layer): (usize, usize)| WoundPiece { layer, segment: s + 1, added_at: None };
        let mut pieces: Vec<WoundPiece> = self.layers_by_segment().into_iter().enumerate().map(of_segment).collect();
        let layer = self.layers() - 1;
        match self.added_turns() {
            Some((Half::A, _)) => pieces.insert(0, WoundPiece { layer, segment: 1, added_at: Some(Half::A) }),
            Some((Half::B, _)) => {
                pieces.push(WoundPiece { layer, segment: self.layers(), added_at: Some(Half::B) });
            }
            None => {}
        }
        pieces
    }

    /// Places among [`Pattern::pieces`] in the order of winding: layer by layer outwards, what is added last.
    pub(crate) fn winding_order(&self) -> Vec<usize> {
        let before = usize::from(matches!(self.added_turns(), Some((Half::A, _))));
        let mut order: Vec<usize> = self.segments.iter().map(|segment| segment - 1 + before).collect();
        match self.added_turns() {
            Some((Half::A, _)) => order.push(0),
            Some((Half::B, _)) => order.push(self.layers()),
            None => {}
        }
        order
    }

    /// Whether arclength grows away from the first flange on a piece: +1, or −1. An added piece runs against the segment that
    /// it goes on from.
    pub(crate) fn direction_of(&self, piece: &WoundPiece) -> f64 {
        match piece.added_at {
            None => self.axial_direction(piece.layer),
            Some(_) => -self.axial_direction(self.layers_by_segment()[piece.segment - 1]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pattern::classic::Classic;

    #[test]
    fn turns_can_be_added_only_where_the_other_end_leaves_room_on_the_outermost_layer() {
        // The outermost layer of the quadrupole is end A's.
        let qua = Classic::Qua.pattern(8).unwrap();
        assert_eq!(qua.end_on_outermost_layer(), Some(Half::A));
        for (a, b) in [(-3, 3), (-3, 2), (-3, 0), (0, -2), (-1, -1), (0, 0)] {
            let built = qua.clone().with_end_turns(EndTurns { a, b }).unwrap();
            assert_eq!(built.pieces().len(), 8 + usize::from(b > 0), "{a} {b}");
        }
        for (a, b) in [(3, -3), (-3, 4), (0, 1), (1, 0)] {
            assert!(qua.clone().with_end_turns(EndTurns { a, b }).is_err(), "{a} {b}");
        }
        let from_within = Pattern::new(vec![1, 4, 3, 2]).unwrap();
        assert!(from_within.with_end_turns(EndTurns { a: -2, b: 2 }).is_err());
    }

    #[test]
    fn both_pieces_of_a_shared_layer_begin_at_a_flange_of_their_own() {
        for classic in Classic::ALL {
            let pattern = classic.pattern(16).unwrap();
            let Some(owner) = pattern.end_on_outermost_layer() else { continue };
            let ends = match owner {
                Half::A => EndTurns { a: -2, b: 2 },
                Half::B => EndTurns { a: 2, b: -2 },
            };
            let built = pattern.with_end_turns(ends).unwrap();
            let pieces = built.pieces();
            // The flange at a piece's low or high end: −1 the first, +1 the second.
            let flange =
                |piece: &WoundPiece, at_high: bool| built.direction_of(piece) * if at_high { 1.0 } else { -1.0 };
            // End A's pieces hang on the rest of the fibre by their high ends, end B's by their low ends.
            let (first, last) = (&pieces[0], &pieces[pieces.len() - 1]);
            assert_eq!((first.layer, last.layer), (15, 15), "{classic:?}");
            assert_eq!(flange(first, true), -flange(last, false), "{classic:?}");
            for pair in pieces.windows(2) {
                assert_eq!(flange(&pair[0], true), flange(&pair[1], false), "{classic:?}");
            }
        }
    }
}
