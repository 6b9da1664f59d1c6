//! Winding patterns: which segment of the fibre lies in which layer.

pub mod classic;
pub(crate) mod end_turns;
pub mod windability;

use thiserror::Error;

pub use end_turns::{EndTurns, WoundPiece};

/// A permutation layer → segment, innermost layer first.
///
/// Segments are numbered 1 … N in the order of arclength from end A; half A is 1 … N/2. Layers are indexed from
/// 0, the innermost. The type can hold nothing but a permutation of an even number of segments, and turns more or fewer at the
/// ends only where there is room for them.
///
/// # Example
/// ```
/// use coilwright::Pattern;
///
/// let pattern = Pattern::new(vec![2, 3, 4, 1])?;
/// assert_eq!(pattern.layers(), 4);
/// assert_eq!(pattern.reversed().segments(), [3, 2, 1, 4]);
/// assert_eq!(
///     Pattern::new(vec![1, 1]).unwrap_err().to_string(),
///     "segment 1 lies on layer 1 and again on layer 2: each segment lies on exactly one layer"
/// );
/// # Ok::<(), coilwright::pattern::PatternError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Pattern {
    segments: Vec<usize>,
    end_turns: EndTurns,
}

/// Without turns at the ends as before there were any: cells of campaigns are told by it.
impl std::fmt::Debug for Pattern {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut shown = f.debug_struct("Pattern");
        shown.field("segments", &self.segments);
        if !self.end_turns.is_none() {
            shown.field("end_turns", &self.end_turns);
        }
        shown.finish()
    }
}

/// A half of the fibre, by arclength: A is z < L/2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Half {
    /// From end A to the middle.
    A,
    /// From the middle to end B.
    B,
}

impl Half {
    pub(crate) fn other(self) -> Self {
        match self {
            Half::A => Half::B,
            Half::B => Half::A,
        }
    }
}

impl std::fmt::Display for Half {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Half::A => "A",
            Half::B => "B",
        })
    }
}

/// Why numbers make no pattern.
#[derive(Debug, Error, Clone, PartialEq)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum PatternError {
    #[error("a pattern needs an even number of at least 2 segments, found {found}")]
    Count { found: usize },
    #[error("segment {segment} on layer {layer} is outside 1 … {layers}")]
    OutOfRange { layer: usize, segment: usize, layers: usize },
    #[error(
        "segment {segment} lies on layer {first} and again on layer {second}: each segment lies on exactly one layer"
    )]
    Duplicate { segment: usize, first: usize, second: usize },
    #[error(
        "{added} turns more at end {end} have no place: they go on the outermost layer, which must hold the other end's segment"
    )]
    NoRoom { end: Half, added: i32 },
    #[error(
        "{added} turns more at end {end} need as many fewer at the other end, which leaves room for {room} on the outermost layer"
    )]
    TooLittleRoom { end: Half, added: i32, room: i32 },
}

impl Pattern {
    /// Of the segment on each layer, innermost first.
    ///
    /// # Errors
    /// An odd or too small count, a segment out of range, a segment named twice. Layers in errors count from 1.
    pub fn new(segments: Vec<usize>) -> Result<Self, PatternError> {
        let layers = segments.len();
        if layers < 2 || !layers.is_multiple_of(2) {
            return Err(PatternError::Count { found: layers });
        }
        let mut seen = vec![None; layers];
        for (layer, &segment) in segments.iter().enumerate() {
            if segment == 0 || segment > layers {
                return Err(PatternError::OutOfRange { layer: layer + 1, segment, layers });
            }
            if let Some(first) = seen[segment - 1].replace(layer + 1) {
                return Err(PatternError::Duplicate { segment, first, second: layer + 1 });
            }
        }
        Ok(Self { segments, end_turns: EndTurns::default() })
    }

    /// N.
    pub fn layers(&self) -> usize {
        self.segments.len()
    }

    /// P(j), innermost layer first; segments count from 1.
    pub fn segments(&self) -> &[usize] {
        &self.segments
    }

    /// The segment on a layer (index 0 is the innermost).
    pub(crate) fn segment(&self, layer: usize) -> usize {
        self.segments[layer]
    }

    /// P⁻¹ as layer indices: entry s−1 is the layer of segment s.
    pub(crate) fn layers_by_segment(&self) -> Vec<usize> {
        layers_by_segment(&self.segments)
    }

    pub(crate) fn half(&self, layer: usize) -> Half {
        if self.segments[layer] <= self.layers() / 2 { Half::A } else { Half::B }
    }

    /// The same coil with its ends exchanged: s → N+1−s. Flips the sign of the rate error.
    pub fn reversed(&self) -> Self {
        let layers = self.layers();
        let end_turns = EndTurns { a: self.end_turns.b, b: self.end_turns.a };
        Self { segments: self.segments.iter().map(|s| layers + 1 - s).collect(), end_turns }
    }

    /// Whether arclength z grows away from the first flange (where layer 1 starts) on a layer: +1, or −1.
    ///
    /// The fibre fills a layer from flange to flange, so segments alternate. Layer 1 starts with the end of its
    /// segment that is nearer to the fibre's middle, or with the fibre's own end if it is wound with that.
    pub(crate) fn axial_direction(&self, layer: usize) -> f64 {
        axial_direction(&self.segments, layer)
    }
}

/// P⁻¹ as layer indices, of P(j), innermost layer first: entry s−1 is the layer of segment s.
pub(crate) fn layers_by_segment(segments: &[usize]) -> Vec<usize> {
    let mut layers = vec![0; segments.len()];
    for (layer, &segment) in segments.iter().enumerate() {
        layers[segment - 1] = layer;
    }
    layers
}

/// The other way round: P(j) of the layers in the order of the fibre.
pub(crate) fn segments_by_layer(layers_by_segment: &[usize]) -> Vec<usize> {
    let mut segments = vec![0; layers_by_segment.len()];
    for (at, &layer) in layers_by_segment.iter().enumerate() {
        segments[layer] = at + 1;
    }
    segments
}

/// As [`Pattern::axial_direction`], of segments that are known to be a permutation.
pub(crate) fn axial_direction(segments: &[usize], layer: usize) -> f64 {
    let (first, last) = (segments[0], segments.len());
    let starts_low = first == 1 || (first != last && first > last / 2);
    let same_parity = (segments[layer] + first).is_multiple_of(2);
    if starts_low == same_parity { 1.0 } else { -1.0 }
}

impl TryFrom<Vec<usize>> for Pattern {
    type Error = PatternError;

    fn try_from(segments: Vec<usize>) -> Result<Self, PatternError> {
        Self::new(segments)
    }
}

impl std::fmt::Display for Pattern {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (i, segment) in self.segments.iter().enumerate() {
            if i > 0 {
                f.write_str(" ")?;
            }
            write!(f, "{segment}")?;
        }
        if !self.end_turns.is_none() {
            write!(f, " ({})", self.end_turns)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_permutations_of_an_even_count_are_patterns() {
        assert!(Pattern::new(vec![2, 1]).is_ok());
        assert_eq!(Pattern::new(vec![1]), Err(PatternError::Count { found: 1 }));
        assert_eq!(Pattern::new(vec![1, 2, 3]), Err(PatternError::Count { found: 3 }));
        assert_eq!(Pattern::new(vec![1, 3]), Err(PatternError::OutOfRange { layer: 2, segment: 3, layers: 2 }));
        assert_eq!(Pattern::new(vec![2, 1, 2, 4]), Err(PatternError::Duplicate { segment: 2, first: 1, second: 3 }));
    }

    #[test]
    fn a_cylindrical_coil_runs_to_and_fro_from_the_first_flange() {
        let zyl = Pattern::new(vec![1, 2, 3, 4]).unwrap();
        assert_eq!((0..4).map(|j| zyl.axial_direction(j)).collect::<Vec<_>>(), [1.0, -1.0, 1.0, -1.0]);
    }

    #[test]
    fn both_layers_next_to_the_middle_of_a_dipole_coil_start_at_the_first_flange() {
        let dip = Pattern::new(vec![2, 3, 1, 4]).unwrap();
        assert_eq!((dip.axial_direction(0), dip.axial_direction(1)), (-1.0, 1.0));
    }
}
