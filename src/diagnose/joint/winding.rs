//! What else may have been wound: another classic, the coil the other way round, two layers exchanged.

use nalgebra::DVector;

use super::odds::{EXCHANGE, WINDING};
use super::{Outcome, Question};
use crate::chamber::{Effort, Fit};
use crate::numeric::order::sort_descending;
use crate::parallel::InParallel;
use crate::pattern::Pattern;
use crate::pattern::classic::Classic;
use crate::rate::{LayerWeights, RateModel};

/// A winding that is not the declared one.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Winding {
    pub(crate) pattern: Pattern,
    /// A classic's name, where it is one.
    pub(crate) classic: Option<&'static str>,
    /// Connected the other way round than declared (or than the classic).
    pub(crate) reversed: bool,
    /// The two layers that changed places, counted from 0 innermost.
    pub(crate) exchanged: Option<(usize, usize)>,
    /// What is held likely of it before any record is read.
    pub(crate) log_prior: f64,
    /// Rise of the log posterior in a short fit with it; until then what the score test promises.
    pub(crate) promised: f64,
}

/// The share of all exchanges that is of this pair of layers: who loses count is off by one more often than by ten, so a pair is taken to
/// be the likelier the nearer its layers are, in inverse proportion.
fn share_of_exchanges((one, other): (usize, usize), layers: usize) -> f64 {
    let all: f64 = (1..layers).map(|apart| (layers - apart) as f64 / apart as f64).sum();
    1.0 / (one.abs_diff(other) as f64 * all)
}

/// Exchanges of two layers that are looked at more closely, if the score test promises so much of them; of neighbours so many besides, which are likelier
/// beforehand. Beside a large error the test ranks to within a fifth: of layers 38 and 39 of 40, which had changed places, it promised 150, and of
/// 35 pairs that had not up to 174.
const EXCHANGES_LOOKED_AT: usize = 24;
const NEIGHBOURS_LOOKED_AT: usize = 8;
const WORTH_A_LOOK: f64 = 5.0;
/// Windings that are worth a fit. A short one ranks them to within a tenth of what they promise: of a coil that was wound as a quadrupole instead of a
/// dipole it put six others first, by 49 of 618, and the one of them that was fitted was named.
const TRIED: usize = 8;

/// The most promising other windings for a fit.
pub(super) fn promising(question: &Question, fit: &Fit) -> Outcome<Vec<Winding>> {
    let columns = question.chamber.layer_columns(fit);
    let layers = question.pattern.layers();
    if columns.len() < layers {
        return Ok(Vec::new());
    }
    let scores = question.chamber.score(fit, &columns[..layers])?;
    let model = &fit.assumed.model;
    let coil = model.wound_coil()?;
    let rate = RateModel::new(model, question.pattern, &[])?;
    let scale = rate.scale_per_m2() * coil.fibre().path_per_k();
    let gains = |pattern: &Pattern| -> Outcome<DVector<f64>> {
        let weights = LayerWeights::new(&coil, pattern)?;
        Ok(DVector::from_vec(weights.total_m2().iter().map(|w| w * scale).collect()))
    };
    let own = gains(&fit.assumed.pattern)?;
    let mut all = Vec::new();
    let mut look = |pattern: Pattern, pair| -> Outcome<()> {
        if pattern != fit.assumed.pattern && !all.iter().any(|w: &Winding| w.pattern == pattern) {
            let promised = scores.gain_of(&(gains(&pattern)? - &own));
            let log_prior = EXCHANGE.log + share_of_exchanges(pair, layers).ln();
            all.push(Winding { pattern, classic: None, reversed: false, exchanged: Some(pair), log_prior, promised });
        }
        Ok(())
    };
    for a in 0..layers {
        for b in a + 1..layers {
            let mut segments = question.pattern.segments().to_vec();
            segments.swap(a, b);
            if let Ok(pattern) = Pattern::new(segments) {
                look(pattern, (a, b))?;
            }
        }
    }
    let mut all = worth_a_look(all);
    all.extend(classics(question.pattern, &fit.assumed.pattern));
    Ok(most_likely(question, fit, all))
}

/// Exchanges that promise most, and neighbours behind them.
fn worth_a_look(mut all: Vec<Winding>) -> Vec<Winding> {
    all.retain(|w| w.promised > WORTH_A_LOOK);
    sort_descending(&mut all, |item| item.promised);
    let mut others = all.split_off(EXCHANGES_LOOKED_AT.min(all.len()));
    others.retain(|w| w.exchanged.is_some_and(|(a, b)| b - a == 1));
    all.extend(others.into_iter().take(NEIGHBOURS_LOOKED_AT));
    all
}

/// Other classics, and the declared winding connected the other way round: this as likely as all of those together, which are alike.
fn classics(declared: &Pattern, assumed: &Pattern) -> Vec<Winding> {
    let layers = declared.layers();
    let known = Classic::ALL.into_iter().filter_map(|c| Some((c.pattern(layers).ok()?, Some(c.key()))));
    let mut all: Vec<Winding> = Vec::new();
    for (pattern, classic) in known.chain([(declared.clone(), None)]) {
        for (pattern, reversed) in [(pattern.clone(), false), (pattern.reversed(), true)] {
            if pattern != *assumed && !all.iter().any(|w| w.pattern == pattern) {
                let (log_prior, promised) = (WINDING.log, f64::NEG_INFINITY);
                all.push(Winding { pattern, classic, reversed, exchanged: None, log_prior, promised });
            }
        }
    }
    let reversed = declared.reversed();
    let others = all.iter().filter(|w| w.pattern != reversed).count() as f64;
    for winding in &mut all {
        winding.log_prior -= if winding.pattern == reversed { 2.0_f64.ln() } else { (2.0 * others).ln() };
    }
    all
}

fn most_likely(question: &Question, fit: &Fit, mut all: Vec<Winding>) -> Vec<Winding> {
    promise_beside(question, fit, &mut all);
    let worth = |w: &Winding| w.promised + w.log_prior;
    sort_descending(&mut all, worth);
    all.truncate(TRIED);
    all
}

/// Another winding is no small change: the likelihood says what each does beside a fit, with a gyro that does not wander, before
/// anything else is fitted.
pub(super) fn promise_beside(question: &Question, fit: &Fit, windings: &mut [Winding]) {
    let mut start = fit.clone();
    start.calm(&question.fitted);
    let promise = |winding: &Winding| {
        let mut assumed = fit.assumed.clone();
        assumed.pattern = winding.pattern.clone();
        let there = question.chamber.fit(&assumed, &fit.free, &question.fitted, Some(&start), Effort::SHORT);
        there.map_or(f64::NEG_INFINITY, |there| there.posterior() - fit.posterior())
    };
    windings.iter_mut().in_parallel().for_each(|winding| winding.promised = promise(winding));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_all_pairs_add_up_to_one_and_neighbours_have_most() {
        let layers = 36;
        let pairs = (0..layers).flat_map(|i| (i + 1..layers).map(move |j| (i, j)));
        let sum: f64 = pairs.map(|pair| share_of_exchanges(pair, layers)).sum();
        assert!((sum - 1.0).abs() < 1e-12, "{sum}");
        let ratio = share_of_exchanges((31, 32), layers) / share_of_exchanges((3, 13), layers);
        assert!((ratio - 10.0).abs() < 1e-12);
    }

    #[test]
    fn neighbours_are_looked_at_behind_others_that_promise_more() {
        let pattern = Classic::Dip.pattern(8).unwrap();
        let exchange = |pair, promised| Winding {
            pattern: pattern.clone(),
            classic: None,
            reversed: false,
            exchanged: Some(pair),
            log_prior: 0.0,
            promised,
        };
        let far = (0..40).map(|i| exchange((0, 2 + i), 200.0 - i as f64));
        let near = (0..10).map(|i| exchange((i, i + 1), 20.0 - i as f64));
        let found = worth_a_look(near.chain(far).chain([exchange((5, 6), WORTH_A_LOOK - 1.0)]).collect());
        let pairs: Vec<(usize, usize)> = found.iter().filter_map(|w| w.exchanged).collect();
        let expected = (0..EXCHANGES_LOOKED_AT).map(|i| (0, 2 + i));
        let expected = expected.chain((0..NEIGHBOURS_LOOKED_AT).map(|i| (i, i + 1)));
        assert_eq!(pairs, expected.collect::<Vec<_>>());
    }

    #[test]
    fn other_windings_share_what_is_held_likely_of_them_and_the_declared_one_reversed_has_half() {
        for declared in [Classic::Qua, Classic::Oct, Classic::Zyl] {
            let declared = declared.pattern(16).unwrap();
            let all = classics(&declared, &declared);
            let sum: f64 = all.iter().map(|w| w.log_prior.exp()).sum();
            assert!((sum / WINDING.log.exp() - 1.0).abs() < 1e-12, "{sum}");
            let reversed = all.iter().find(|w| w.pattern == declared.reversed()).unwrap();
            assert!((reversed.log_prior - (WINDING.log - 2.0_f64.ln())).abs() < 1e-12);
            assert!(all.len() > 4 && all.iter().all(|w| w.log_prior <= reversed.log_prior));
        }
    }
}
