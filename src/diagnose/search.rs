//! The search over sets of effects: singles, pairs, forward steps, swaps and a backward step.

use rayon::prelude::*;

use super::DiagnoseError;
use super::anchor::{moves_sensor, way_of};
use super::candidate::Candidate;
use super::evidence::{Begin, Evidence, Role};
use super::hypothesis::{Hypothesis, Response, Trial, pairs};
use super::plain::best_gain;
use crate::fit::Effort;
use crate::rate::CoilModel;

/// What the search found.
pub(super) struct Found {
    pub base: Hypothesis,
    /// The best fit of each candidate alone, best first.
    pub singles: Vec<Hypothesis>,
    pub best: Hypothesis,
    /// What χ² is counted in: 1, or the mean square of what the best set leaves, whichever is more.
    pub variance: f64,
}

/// A set must be this much better than a smaller one.
const MARGIN: f64 = 10.0;
/// Effects that a model may lack at once.
pub(super) const MAX_EFFECTS: usize = 3;
/// Sets that are fitted in earnest after a linear look at all of them.
const PAIRS_TRIED: usize = 6;
const KINDS_TRIED: usize = 4;
/// … and at most, as far as they promise a good share of what the first does.
const KINDS_TRIED_AT_MOST: usize = 8;
/// A start whose response cannot lower χ² by this much, at any amplitude, is not worth a fit.
const WORTH_A_FIT: f64 = 6.0;
/// One effect more must promise this much: what it costs is more.
const WORTH_A_STEP: f64 = 14.0;
/// Another sensor is worth estimating boundaries for if it alone does this share of what the best effect does.
const WORTH_A_BOUNDARY: f64 = 0.3;
/// Standard deviations of χ² within which the best single effect leaves nothing for a pair.
const NOTHING_LEFT: f64 = 3.0;
/// A start is not worth a fit either that promises less than this share of what the best start of its candidate, or a removed effect, does.
const WORTH_BESIDE: f64 = 0.5;
/// Nor is a single effect whose best start promises less than this share of what the most promising one does.
const WORTH_BESIDE_THE_BEST: f64 = 0.1;
/// Starts from which a candidate is fitted alone.
const STARTS_TRIED: usize = 2;
/// A set contends with the best one of its size if it lowers χ² by this share of what that does …
const CONTENDS: f64 = 0.8;
/// … or this share, beside an effect that moves heat: on the boundary for its present value a further effect, which would
/// change that value, shows only part of what it can do …
const CONTENDS_BESIDE_HEAT: f64 = 0.2;
/// … and so many sets are given boundaries of their own at once.
const CONTENDERS: usize = 6;
/// Times that a boundary is estimated for a heat path and the heat path fitted again …
const HEAT_ROUNDS: usize = 4;
/// … unless χ² changed by less than this.
const SETTLED: f64 = 1.0;
/// A hypothesis is given up whose χ² would still be so much larger than another's …
const HOPELESS: f64 = 50.0;
/// … if it fell by the last round's step so many times more.
const ROUNDS_HOPED_FOR: f64 = 4.0;
/// Times that a bracket of lags is moved to where the fit wants it.
const SENSOR_ROUNDS: usize = 3;

/// Searches sets of at most `most_effects`; boundaries for other sensors are added to the evidence on the way.
pub(super) fn search(
    evidence: &mut Evidence,
    model: &CoilModel,
    candidates: &[Candidate],
    most_effects: usize,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Found, DiagnoseError> {
    let rows = evidence.rows(Role::Fit);
    let base = {
        let trial = Trial { evidence, model, candidates };
        trial.fit(&[], Effort::QUICK).ok_or(DiagnoseError::Unsolvable)?
    };
    let mut singles = all_singles(evidence, model, candidates, &base)?;
    progress(0.6);
    let trial = Trial { evidence, model, candidates };
    let least = |list: &[Hypothesis], variance: f64| {
        list.iter().min_by(|a, b| a.merit(rows, variance).total_cmp(&b.merit(rows, variance))).cloned()
    };
    // What plain functions of time explain better than an effect does is no evidence for the effect.
    let plain_gain = |trial: &Trial, from: &Hypothesis| {
        trial.model_of(&from.members).map_or(0.0, |m| best_gain(trial.evidence, &m, from))
    };
    let noise_only = rows as f64 + NOTHING_LEFT * (2.0 * rows as f64).sqrt();
    let best_single = singles.iter().map(|h| h.chi_square).fold(base.chi_square, f64::min);
    let mut twos = Vec::new();
    if best_single > noise_only && most_effects > 1 {
        twos = fit_pairs(&trial, &base, best_single);
        settle_contenders(evidence, model, candidates, &base, &mut twos)?;
    }
    let trial = Trial { evidence, model, candidates };
    let mut variance = noise_variance(&base, singles.iter().chain(&twos), rows);
    let mut best = base.clone();
    for step in [least(&singles, variance), least(&twos, variance)].into_iter().flatten() {
        let better = step.merit(rows, variance) < best.merit(rows, variance) - MARGIN;
        if better && plain_gain(&trial, &best) < best.chi_square - step.chi_square {
            best = step;
        }
    }
    progress(0.8);
    while !best.members.is_empty() && best.members.len() < most_effects {
        // What a wrong heat path, or that of a contender, leaves in the boundary would be taken for a further effect.
        best = settled(evidence, model, candidates, best)?;
        let trial = Trial { evidence, model, candidates };
        let mut further = fit_forward(&trial, &best);
        // What a single effect could be exchanged for was fitted alone already; where nothing is left, exchanges are judged
        // as equivalents.
        if best.members.len() > 1 && best.chi_square > noise_only {
            further.extend(fit_swaps(&trial, &best));
        }
        settle_contenders(evidence, model, candidates, &best, &mut further)?;
        let trial = Trial { evidence, model, candidates };
        variance = noise_variance(&best, &further, rows).min(variance);
        let Some(next) = least(&further, variance) else { break };
        let grows = next.members.len() > best.members.len();
        let margin = if grows { MARGIN } else { 0.5 };
        let better = next.merit(rows, variance) < best.merit(rows, variance) - margin;
        if !better || (grows && plain_gain(&trial, &best) > best.chi_square - next.chi_square) {
            break;
        }
        best = next;
    }
    let trial = Trial { evidence, model, candidates };
    best = step_back(&trial, best, rows, variance);
    singles.sort_by(|a, b| a.merit(rows, variance).total_cmp(&b.merit(rows, variance)));
    Ok(Found { base, singles, best, variance })
}

/// Each candidate alone; boundaries for other sensors are added to the evidence.
pub(super) fn all_singles(
    evidence: &mut Evidence,
    model: &CoilModel,
    candidates: &[Candidate],
    base: &Hypothesis,
) -> Result<Vec<Hypothesis>, DiagnoseError> {
    // A sensor in the air needs a boundary of its own.
    for candidate in candidates.iter().filter(|c| c.moves_heat()) {
        let moved = model.with_effect(candidate.effect.clone());
        if let (Ok(there), Ok(here)) = (moved.heat_path(), model.heat_path())
            && there.location != here.location
        {
            evidence.anchor(&moved, Begin::Nearby)?;
        }
    }
    let mut singles = fit_singles(&Trial { evidence, model, candidates }, base);
    let best = singles.iter().map(|h| base.chi_square - h.chi_square).fold(0.0, f64::max);
    for single in &mut singles {
        let gain = base.chi_square - single.chi_square;
        let moves_sensor = candidates[single.members[0].candidate].moves_sensor();
        if moves_sensor && gain > MARGIN.max(WORTH_A_BOUNDARY * best) {
            *single = settled(evidence, model, candidates, single.clone())?;
        }
    }
    settle_contenders(evidence, model, candidates, base, &mut singles)?;
    Ok(singles)
}

fn noise_variance<'h>(base: &Hypothesis, others: impl IntoIterator<Item = &'h Hypothesis>, rows: usize) -> f64 {
    let least = others.into_iter().map(|h| h.chi_square).fold(base.chi_square, f64::min);
    (least / rows as f64).max(1.0)
}

/// Each candidate alone, from its most promising starts; one that promises nothing keeps its linear estimate.
fn fit_singles(trial: &Trial, base: &Hypothesis) -> Vec<Hypothesis> {
    let responses = trial.responses(base).list;
    let foremost = responses.iter().map(Response::gain).fold(0.0, f64::max);
    (0..trial.candidates.len())
        .into_par_iter()
        .filter_map(|candidate| {
            let mut own: Vec<_> = responses.iter().filter(|r| r.member.candidate == candidate).collect();
            own.sort_by(|a, b| b.gain().total_cmp(&a.gain()));
            let best = own.first()?;
            if best.gain() < WORTH_A_FIT.max(WORTH_BESIDE_THE_BEST * foremost) {
                return Some(Hypothesis {
                    members: vec![trial.scaled(&best.member, best.amplitude())],
                    chi_square: base.chi_square - best.gain(),
                    unseen: base.unseen,
                    parameters: trial.candidates[candidate].free.len(),
                    residuals: base.residuals.clone(),
                    fit: None,
                });
            }
            own.iter()
                .take(STARTS_TRIED)
                .filter(|r| r.gain() > WORTH_BESIDE * best.gain())
                .filter_map(|r| trial.fit(&[trial.scaled(&r.member, r.amplitude())], Effort::QUICK))
                .min_by(|a, b| a.chi_square.total_cmp(&b.chi_square))
        })
        .collect()
}

/// Pairs that promise more than the best of the singles does.
fn fit_pairs(trial: &Trial, base: &Hypothesis, best_single: f64) -> Vec<Hypothesis> {
    let responses = trial.responses(base).list;
    let needed = base.chi_square - best_single + MARGIN;
    pairs(trial, &responses, PAIRS_TRIED)
        .into_par_iter()
        .filter(|pair| pair.gain > needed)
        .filter_map(|pair| {
            let first = trial.scaled(&responses[pair.first].member, pair.amplitudes.0);
            let second = trial.scaled(&responses[pair.second].member, pair.amplitudes.1);
            trial.fit(&[first, second], Effort::QUICK)
        })
        .collect()
}

/// The most promising response of each candidate of the `count` most promising kinds, and of a few more that promise
/// nearly as much.
fn foremost(trial: &Trial, mut responses: Vec<Response>, count: usize, least_gain: f64) -> Vec<Response> {
    responses.retain(|r| r.gain() > least_gain);
    responses.sort_by(|a, b| b.gain().total_cmp(&a.gain()));
    let good = WORTH_BESIDE * responses.first().map_or(0.0, Response::gain);
    let (mut kinds, mut seen) = (Vec::new(), Vec::new());
    responses.retain(|r| {
        let kind = trial.candidates[r.member.candidate].kind();
        if !kinds.contains(&kind) {
            kinds.push(kind.clone());
        }
        let place = kinds.iter().position(|k| *k == kind).unwrap_or(kinds.len());
        let among = place < count || (place < count.max(KINDS_TRIED_AT_MOST) && r.gain() > good);
        let new = among && !seen.contains(&r.member.candidate);
        if new {
            seen.push(r.member.candidate);
        }
        new
    });
    responses
}

/// One effect more.
fn fit_forward(trial: &Trial, from: &Hypothesis) -> Vec<Hypothesis> {
    foremost(trial, trial.responses(from).list, KINDS_TRIED, WORTH_A_STEP)
        .into_par_iter()
        .filter_map(|response| {
            let mut members = from.members.clone();
            members.push(trial.scaled(&response.member, response.amplitude()));
            trial.fit(&members, Effort::QUICK)
        })
        .collect()
}

/// Each member in turn exchanged for each of the most promising others.
fn fit_swaps(trial: &Trial, from: &Hypothesis) -> Vec<Hypothesis> {
    (0..from.members.len()).flat_map(|out| fit_swap(trial, from, out, KINDS_TRIED)).collect()
}

/// One member exchanged for others of the `kinds` most promising kinds; the new one stands at its place. The rest keeps
/// its values until the new set is fitted: without any such effect it would be drawn far away.
pub(super) fn fit_swap(trial: &Trial, from: &Hypothesis, out: usize, kinds: usize) -> Vec<Hypothesis> {
    let kind = trial.candidates[from.members[out].candidate].kind();
    let mut others = from.members.clone();
    others.remove(out);
    let Some(rest) = trial.at(&others) else { return Vec::new() };
    let mut responses = trial.responses(&rest);
    responses.list.retain(|r| trial.candidates[r.member.candidate].kind() != kind);
    foremost(trial, responses.list, kinds, WORTH_BESIDE * (responses.chi_square - from.chi_square))
        .into_par_iter()
        .filter_map(|response| {
            let mut members = others.clone();
            members.insert(out, trial.scaled(&response.member, response.amplitude()));
            trial.fit(&members, Effort::QUICK)
        })
        .collect()
}

/// Leaves out what the rest does not need.
fn step_back(trial: &Trial, mut best: Hypothesis, rows: usize, variance: f64) -> Hypothesis {
    loop {
        let smaller = (0..best.members.len())
            .filter_map(|out| without(trial, &best, out))
            .min_by(|a, b| a.merit(rows, variance).total_cmp(&b.merit(rows, variance)));
        match smaller {
            Some(smaller) if smaller.merit(rows, variance) < best.merit(rows, variance) + MARGIN => best = smaller,
            _ => return best,
        }
    }
}

/// The rest of a set, fitted again without one member.
pub(super) fn without(trial: &Trial, from: &Hypothesis, out: usize) -> Option<Hypothesis> {
    let mut rest = from.members.clone();
    rest.remove(out);
    trial.fit(&rest, Effort::QUICK)
}

/// Estimates boundaries for the sets that do nearly as well as the best one of a list and that move heat otherwise than any
/// boundary was estimated for: they cannot be ranked on a boundary of another's.
pub(super) fn settle_contenders(
    evidence: &mut Evidence,
    model: &CoilModel,
    candidates: &[Candidate],
    from: &Hypothesis,
    list: &mut [Hypothesis],
) -> Result<(), DiagnoseError> {
    let gain = |h: &Hypothesis| from.chi_square - h.chi_square;
    let beside_heat = from.members.iter().any(|m| candidates[m.candidate].moves_heat());
    let share = if beside_heat { CONTENDS_BESIDE_HEAT } else { CONTENDS };
    let least = MARGIN.max(share * list.iter().map(gain).fold(0.0, f64::max));
    let mut order: Vec<usize> = (0..list.len()).filter(|&i| gain(&list[i]) > least).collect();
    order.sort_by(|&a, &b| list[a].chi_square.total_cmp(&list[b].chi_square));
    let mut ways = Vec::new();
    let mut to_beat = f64::INFINITY;
    for place in order {
        let trial = Trial { evidence, model, candidates };
        let Some(with) = trial.model_of(&list[place].members) else { continue };
        let way = way_of(&with);
        let seen = ways.contains(&way);
        // With more or fewer free parameters the same effects may be found at other values; a lag's bracket is dearer.
        if seen && (moves_sensor(&with) || evidence.is_anchored(&with)) {
            list[place] = trial.fit(&list[place].members, Effort::QUICK).unwrap_or_else(|| list[place].clone());
        } else if !evidence.is_anchored(&with) && ways.len() < CONTENDERS {
            list[place] = settle(evidence, model, candidates, list[place].clone(), to_beat)?;
            ways.push(way);
        } else {
            continue;
        }
        to_beat = to_beat.min(list[place].total());
    }
    Ok(())
}

/// Settles a set, unless a boundary was estimated for its effects before.
pub(super) fn settled(
    evidence: &mut Evidence,
    model: &CoilModel,
    candidates: &[Candidate],
    hypothesis: Hypothesis,
) -> Result<Hypothesis, DiagnoseError> {
    let with = (Trial { evidence, model, candidates }).model_of(&hypothesis.members);
    let known = with.is_none_or(|with| evidence.is_anchored(&with));
    if known { Ok(hypothesis) } else { settle(evidence, model, candidates, hypothesis, f64::INFINITY) }
}

/// Estimates the boundary anew under what a hypothesis found, and fits again.
///
/// A boundary that was estimated for one lag is only extrapolated to another: the minimum over estimates made for each lag
/// is where the middle of a bracket and the fit agree. A hypothesis that will not come near `to_beat`, the χ² of another, is
/// given up.
pub(super) fn settle(
    evidence: &mut Evidence,
    model: &CoilModel,
    candidates: &[Candidate],
    mut hypothesis: Hypothesis,
    to_beat: f64,
) -> Result<Hypothesis, DiagnoseError> {
    let with = |evidence: &Evidence, h: &Hypothesis| (Trial { evidence, model, candidates }).model_of(&h.members);
    let fit = |evidence: &Evidence, h: &Hypothesis| {
        (Trial { evidence, model, candidates }).fit(&h.members, Effort::QUICK).unwrap_or_else(|| h.clone())
    };
    let hopeless =
        |h: &Hypothesis, before: f64| h.total() - ROUNDS_HOPED_FOR * (before - h.total()).max(0.0) > to_beat + HOPELESS;
    let Some(found) = with(evidence, &hypothesis) else { return Ok(hypothesis) };
    let heat = (Trial { evidence, model, candidates }).heat_parameters(&hypothesis.members);
    let lags = hypothesis.members.iter().any(|m| candidates[m.candidate].moves_sensor());
    if !lags {
        for round in 1..=HEAT_ROUNDS {
            let Some(found) = with(evidence, &hypothesis) else { break };
            evidence.anchor(&found, Begin::Nearby)?;
            evidence.tilt(&found, &heat)?;
            let before = hypothesis.total();
            hypothesis = fit(evidence, &hypothesis);
            let settled = (hypothesis.total() - before).abs() < SETTLED;
            if settled || round == HEAT_ROUNDS || hopeless(&hypothesis, before) {
                break;
            }
        }
        return Ok(hypothesis);
    }
    if !evidence.is_bracketed(&found) {
        evidence.anchor(&found, Begin::Nearby)?;
        let before = hypothesis.total();
        hypothesis = fit(evidence, &hypothesis);
        if hopeless(&hypothesis, before) {
            return Ok(hypothesis);
        }
    }
    for _ in 0..SENSOR_ROUNDS {
        let Some(found) = with(evidence, &hypothesis) else { break };
        evidence.bracket(&found, Begin::Nearby)?;
        evidence.tilt(&found, &heat)?;
        hypothesis = fit(evidence, &hypothesis);
        if with(evidence, &hypothesis).is_some_and(|m| evidence.is_central(&m)) {
            break;
        }
    }
    Ok(hypothesis)
}
