//! What is held likely of a coil before any record is read, and what is left out for being unlikely: one table.
//!
//! None of these was set by trials; each says what is believed of coils, files and gyros, or what 95 % means.

/// A natural logarithm of prior odds, with its reason.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::diagnose) struct Odds {
    pub(crate) name: &'static str,
    pub(crate) log: f64,
    pub(crate) reason: &'static str,
}

const fn odds(name: &'static str, log: f64, reason: &'static str) -> Odds {
    Odds { name, log, reason }
}

pub(in crate::diagnose) const EFFECT: Odds =
    odds("effect", -3.0, "one effect of the catalogue is missing in one coil of twenty");
pub(super) const REFITTED: Odds = odds("refitted", -2.3, "a number of a model file is wrong in one of ten");
pub(super) const WINDING: Odds = odds(
    "winding",
    -3.9,
    "one coil in fifty is connected the other way round, or wound as another classic, whichever it is: half of these each",
);
pub(super) const EXCHANGE: Odds =
    odds("exchange", -4.6, "one coil in a hundred has two of its layers exchanged, whichever they are");
pub(super) const OUTSIDE: Odds =
    odds("outside", -3.0, "what no catalogue lists is as likely as any one effect that a catalogue lists");
pub(super) const STEP: Odds = odds("step", -3.9, "one record in fifty has a step of its offset, anywhere in it");
/// 95 % against 5 %.
pub(super) const CERTAIN: Odds =
    odds("certain", 2.944_438_979_166_440_3, "ln 19: what must be said with 95 % outweighs all else so many times");

/// How far a stated number of a model file may be off: one deviation of its logarithm. Tables of materials differ by as much.
pub(super) const STATED_WITHIN: f64 = 0.25;
/// A declared number is never known better than this share of itself (methods for conductivity and for dn/dT state some per cent): to
/// correct it by less is no news, however surely it is found.
pub(super) const KNOWN_WITHIN: f64 = 0.01;
/// An estimate so many deviations of its prior away is beyond what is physical: one in two thousand of a normal one; of a mechanism's size, 14 times
/// where it is usually looked for.
pub(super) const PHYSICAL: f64 = 3.5;
/// Sets so much less likely than the best hold no more than e⁻²⁰ of the mass.
pub(super) const WINDOW: f64 = 20.0;

#[cfg(test)]
mod tests {
    use statrs::distribution::{ContinuousCDF, Normal};

    use super::*;

    #[test]
    fn odds_are_what_their_reasons_say() {
        for (odds, expected) in [
            (EFFECT, 1.0_f64 / 20.0),
            (REFITTED, 0.1),
            (WINDING, 0.02),
            (EXCHANGE, 0.01),
            (OUTSIDE, 0.05),
            (STEP, 0.02),
            (CERTAIN, 0.95 / 0.05),
        ] {
            assert!((odds.log - expected.ln()).abs() < 0.02, "{}", odds.name);
            assert!(odds.reason.len() > 20);
        }
        let beyond = 2.0 * Normal::new(0.0, 1.0).unwrap().sf(PHYSICAL);
        assert!((beyond * 2000.0 - 1.0).abs() < 0.1);
    }
}
