//! The named windings: cylindrical, symmetric, dipole, quadrupole, octupole, 16-pole.
//!
//! # Source
//! Yan, Lan, Jian, Acta Optica Sinica (1998), section 4, for ZYL, SYM, DIP and QUA; OCT and HEX continue the
//! Thue–Morse word that makes a dipole of dipoles, and so on.

use thiserror::Error;

use super::{EndTurns, Half, Pattern};

/// A winding that has a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Classic {
    /// Cylindrical: 1, 2, …, N.
    Zyl,
    /// Symmetric as the paper's Eq. (14) has it: h, …, 1, N, …, h+1.
    Sym,
    /// Symmetric as the paper's text describes it: h, …, 1, h+1, …, N.
    SymText,
    /// Dipole: A B repeated.
    Dip,
    /// Quadrupole: ABBA repeated.
    Qua,
    /// Octupole: ABBABAAB repeated.
    Oct,
    /// 16-pole: ABBABAABBAABABBA repeated.
    Hex,
}

/// Why a classic winding does not exist for a layer count.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum ClassicError {
    #[error(
        "winding.layers must be a multiple of {multiple} for {article} {name}, found {found}: use {nearby}",
        article = if .name.starts_with('o') { "an" } else { "a" }
    )]
    Multiple { name: &'static str, multiple: usize, found: usize, nearby: Nearby },
    #[error("no winding is called {found}: use one of zyl, sym, sym-text, dip, qua, oct, hex, or a pattern file")]
    Unknown { found: String },
}

/// The layer counts on both sides of one that does not fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Nearby {
    below: usize,
    above: usize,
}

impl std::fmt::Display for Nearby {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.below == 0 { write!(f, "{}", self.above) } else { write!(f, "{} or {}", self.below, self.above) }
    }
}

impl Classic {
    /// All of them, simplest first.
    pub const ALL: [Classic; 7] =
        [Classic::Zyl, Classic::Sym, Classic::SymText, Classic::Dip, Classic::Qua, Classic::Oct, Classic::Hex];

    /// As written in model files.
    pub fn key(self) -> &'static str {
        match self {
            Classic::Zyl => "zyl",
            Classic::Sym => "sym",
            Classic::SymText => "sym-text",
            Classic::Dip => "dip",
            Classic::Qua => "qua",
            Classic::Oct => "oct",
            Classic::Hex => "hex",
        }
    }

    /// In words.
    pub fn title(self) -> &'static str {
        match self {
            Classic::Zyl => "cylindrical winding",
            Classic::Sym => "symmetric winding (Eq. 14)",
            Classic::SymText => "symmetric winding (as described in words)",
            Classic::Dip => "dipole",
            Classic::Qua => "quadrupole",
            Classic::Oct => "octupole",
            Classic::Hex => "16-pole",
        }
    }

    /// By its key, in whatever case.
    ///
    /// # Errors
    /// A name that no winding has.
    pub fn from_key(key: &str) -> Result<Self, ClassicError> {
        Self::ALL
            .into_iter()
            .find(|c| c.key().eq_ignore_ascii_case(key))
            .ok_or_else(|| ClassicError::Unknown { found: key.to_owned() })
    }

    /// The halves in the order in which they are wound, to be repeated; none where no word makes the pattern.
    fn word(self) -> Option<&'static [Half]> {
        use Half::{A, B};
        match self {
            Classic::Zyl | Classic::Sym | Classic::SymText => None,
            Classic::Dip => Some(&[A, B]),
            Classic::Qua => Some(&[A, B, B, A]),
            Classic::Oct => Some(&[A, B, B, A, B, A, A, B]),
            Classic::Hex => Some(&[A, B, B, A, B, A, A, B, B, A, A, B, A, B, B, A]),
        }
    }

    /// The layer counts that this winding fits are the multiples of this.
    pub(crate) fn multiple(self) -> usize {
        self.word().map_or(2, <[Half]>::len)
    }

    /// The pattern for a layer count.
    ///
    /// # Example
    /// ```
    /// use coilwright::Classic;
    ///
    /// // Reel A winds segments 1 and 2, reel B 3 and 4: A, B, B, A from the spool outwards.
    /// assert_eq!(Classic::Qua.pattern(4)?.segments(), [2, 3, 4, 1]);
    /// assert!(Classic::Qua.pattern(6).is_err());
    /// assert_eq!(Classic::from_key("QUA")?, Classic::Qua);
    /// # Ok::<(), coilwright::pattern::classic::ClassicError>(())
    /// ```
    ///
    /// # Errors
    /// A layer count that is no multiple of the winding's word: never truncated silently.
    pub fn pattern(self, layers: usize) -> Result<Pattern, ClassicError> {
        let multiple = self.multiple();
        if layers == 0 || !layers.is_multiple_of(multiple) {
            let below = layers / multiple * multiple;
            return Err(ClassicError::Multiple {
                name: self.title(),
                multiple,
                found: layers,
                nearby: Nearby { below, above: below + multiple },
            });
        }
        let h = layers / 2;
        let segments = match self {
            Classic::Zyl => (1..=layers).collect(),
            Classic::Sym => (1..=h).rev().chain((h + 1..=layers).rev()).collect(),
            Classic::SymText => (1..=h).rev().chain(h + 1..=layers).collect(),
            Classic::Dip | Classic::Qua | Classic::Oct | Classic::Hex => from_word(self.word().unwrap_or(&[]), layers),
        };
        Ok(Pattern { segments, end_turns: EndTurns::default() })
    }
}

/// A takes the next segment downwards from h, B upwards from h+1.
fn from_word(word: &[Half], layers: usize) -> Vec<usize> {
    let (mut next_a, mut next_b) = (layers / 2, layers / 2 + 1);
    word.iter()
        .cycle()
        .take(layers)
        .map(|half| match half {
            Half::A => {
                next_a -= 1;
                next_a + 1
            }
            Half::B => {
                next_b += 1;
                next_b - 1
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quadrupole_of_twelve_layers_is_the_one_in_the_pattern_file_format() {
        assert_eq!(Classic::Qua.pattern(12).unwrap().segments(), [6, 7, 8, 5, 4, 9, 10, 3, 2, 11, 12, 1]);
    }

    #[test]
    fn the_two_symmetric_windings_differ_in_the_order_of_the_second_half() {
        assert_eq!(Classic::Sym.pattern(6).unwrap().segments(), [3, 2, 1, 6, 5, 4]);
        assert_eq!(Classic::SymText.pattern(6).unwrap().segments(), [3, 2, 1, 4, 5, 6]);
    }

    #[test]
    fn a_layer_count_that_does_not_fit_is_refused_with_the_ones_nearby() {
        let message = Classic::Qua.pattern(22).unwrap_err().to_string();
        assert_eq!(message, "winding.layers must be a multiple of 4 for a quadrupole, found 22: use 20 or 24");
        assert!(Classic::Hex.pattern(8).unwrap_err().to_string().ends_with("use 16"));
    }

    #[test]
    fn every_winding_that_fits_is_a_permutation() {
        for layers in (2..=96).step_by(2) {
            for classic in Classic::ALL {
                if let Ok(pattern) = classic.pattern(layers) {
                    assert!(Pattern::new(pattern.segments().to_vec()).is_ok(), "{classic:?} {layers}");
                }
            }
        }
    }
}
