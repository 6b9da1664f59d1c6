//! Patterns that are nowhere far behind the classics: searched over many sets of profiles at once.
//!
//! A pattern that is best on the searched profiles may lose on the next ones, and so may a classic. What to wind is
//! therefore rehearsed on sets of profiles that are neither searched nor judged by, each measured by what the best
//! classic makes of it:
//!
//! ```text
//! minimise over P   max { max_k  W_k(P) / min_c W_k(c) ,   B(P) / min_c B(c) }
//! ```
//!
//! | symbol | meaning | in code |
//! |---|---|---|
//! | W_k | worst rate on set k and the listed profiles | `set_of` |
//! | B | guaranteed worst rate, where the model has one | `Support` |
//! | c | classics of the class | |
//!
//! W is a largest value over samples. B joins as further samples, each the bang-bang profile under which a pattern that
//! was found is worst (cutting planes, [`support`](super::proof::support)), until the samples say what B says.

use super::anneal::rounds::{DEFAULT_RESTARTS_PER_ROUND, Optimisation, Plan, Rounds, Rules, default_moves_per_restart};
use super::cost::columns::Norm;
use super::cost::samples::SampleMatrix;
use super::cost::worst_case::SolvedProfiles;
use super::evaluator::{Evaluator, JudgeError};
use super::proof::support::Support;
use crate::pattern::Pattern;
use crate::pattern::windability::WindabilityClass;
use crate::rate::LayerWeights;
use crate::search::cost::worst_case::SearchError;

/// Sets that are rehearsed on.
const SETS: usize = 4;

/// Times that worst admissible profiles join.
const CUTS: usize = 3;

/// Found patterns whose worst admissible profiles join, and that are handed on, each time.
const FOUND: usize = 4;

/// Rounds of restarts between two cuts, each with this part of a search's own moves.
const ROUNDS: u64 = 1;
const SHORTENED: u64 = 4;

/// The samples say what the guaranteed worst rate says when they fall short of it by no more.
const SHORT_BY: f64 = 0.01;

/// The guaranteed worst rate as samples, over the best classic's.
struct Bound {
    support: Support,
    over: f64,
}

impl Bound {
    fn value(&self, coefficients: &[f64]) -> f64 {
        self.support.value(coefficients) / self.over
    }

    fn samples(&self, coefficients: &[Vec<f64>]) -> SampleMatrix {
        self.support.attaining(coefficients).scaled(&vec![1.0 / self.over; coefficients.len()])
    }
}

impl Evaluator<'_> {
    /// Patterns that are least behind the best of `classics` where they are furthest behind; best first. None without
    /// classics or profiles to draw.
    ///
    /// # Errors
    /// None that a model which could be solved would cause.
    #[expect(clippy::too_many_lines, reason = "set up once, then one loop of search and cut")]
    pub(super) fn rehearsed(
        &self,
        class: WindabilityClass,
        classics: &[Pattern],
        starts: &[Pattern],
        seed: u64,
    ) -> Result<Vec<Pattern>, JudgeError> {
        let spec = self.drawn_spec(SETS, super::validation::Draw::Rehearsal);
        let profiles = spec.profiles();
        let drawn = profiles.len() - spec.listed.len();
        if classics.is_empty() || drawn == 0 {
            return Ok(Vec::new());
        }
        let solved = SolvedProfiles::new(self.model, &profiles)?;
        let (matrix, origins) = SampleMatrix::of_profiles(self.model, &solved)?;
        let set_of = |profile: usize| profile.checked_sub(spec.listed.len()).map(|drawn_at| drawn_at * SETS / drawn);
        let sets: Vec<Option<usize>> = origins.iter().map(|origin| set_of(origin.profile)).collect();
        let coil = self.model.wound_coil().map_err(SearchError::from)?;
        let weights = |pattern: &Pattern| LayerWeights::new(&coil, pattern).map_err(SearchError::from);
        let least = least_of_classics(&matrix, &sets, classics, &weights)?;
        let over_listed = least.iter().copied().fold(f64::INFINITY, f64::min);
        if !(over_listed > 0.0) {
            return Ok(Vec::new());
        }
        let factors: Vec<f64> = sets.iter().map(|set| 1.0 / set.map_or(over_listed, |k| least[k])).collect();
        let mut matrix = matrix.scaled(&factors);
        let coefficients = |matrix: &SampleMatrix, pattern: &Pattern| Ok(matrix.coefficients(&weights(pattern)?));
        let bound = self.bound_over_classics(matrix.layout, classics, &weights)?;
        if let Some(bound) = &bound {
            let of: Result<Vec<Vec<f64>>, SearchError> =
                classics.iter().chain(starts).map(|p| coefficients(&matrix, p)).collect();
            matrix = matrix.joined(&bound.samples(&of?));
        }
        let layers = self.model.coil.layers();
        let admitted = starts.iter().filter(|p| class.admits(p)).take(FOUND);
        let mut known: Vec<Vec<usize>> = admitted.map(|p| p.segments().to_vec()).collect();
        let mut answered: Vec<Pattern> = Vec::new();
        for cut in 0..CUTS {
            let plan = Plan {
                seed: seed.wrapping_add(cut as u64),
                restarts_per_round: DEFAULT_RESTARTS_PER_ROUND,
                moves_per_restart: default_moves_per_restart(layers) / SHORTENED,
                rules: Rules { rounds: ROUNDS, patience: ROUNDS, moves: None, target: None },
                starts: known.clone(),
            };
            let cost = self.sample_cost(matrix.clone(), class, Norm::Largest)?;
            let mut search = Optimisation::new(cost, plan);
            while search.advance() {}
            let mut found = search.state().found.clone();
            if search.is_approximated() {
                let starts: Vec<Vec<usize>> = found.iter().take(FOUND).map(|f| f.segments.clone()).collect();
                found.extend(search.refined(&starts, search.plan().moves_per_restart));
                found.sort_by(|a, b| a.cost.total_cmp(&b.cost).then_with(|| a.segments.cmp(&b.segments)));
                found.dedup_by(|a, b| a.segments == b.segments);
            }
            found.truncate(FOUND);
            known = found.iter().map(|f| f.segments.clone()).collect();
            let patterns: Vec<Pattern> = known.iter().filter_map(|s| Pattern::new(s.clone()).ok()).collect();
            // The last cut knows most.
            answered.splice(0..0, patterns.iter().cloned());
            let Some(bound) = &bound else { break };
            let of: Result<Vec<Vec<f64>>, SearchError> = patterns.iter().map(|p| coefficients(&matrix, p)).collect();
            let of = of?;
            let falls_short =
                of.iter().zip(&found).take(1).any(|(c, found)| bound.value(c) > found.cost * (1.0 + SHORT_BY));
            if !falls_short {
                break;
            }
            matrix = matrix.joined(&bound.samples(&of));
        }
        let mut seen = std::collections::BTreeSet::new();
        answered.retain(|pattern| seen.insert(pattern.segments().to_vec()));
        Ok(answered)
    }

    fn bound_over_classics(
        &self,
        layout: super::cost::samples::ColumnLayout,
        classics: &[Pattern],
        weights: &dyn Fn(&Pattern) -> Result<LayerWeights, SearchError>,
    ) -> Result<Option<Bound>, JudgeError> {
        let Some(step) = self.unit_step else { return Ok(None) };
        let support = Support::of_guaranteed(self.model, step)?;
        if support.matrix().layout != layout {
            return Ok(None);
        }
        let mut over = f64::INFINITY;
        for classic in classics {
            over = over.min(support.value(&support.matrix().coefficients(&weights(classic)?)));
        }
        Ok((over > 0.0 && over.is_finite()).then_some(Bound { support, over }))
    }
}

/// The least worst rate of a classic on each set, the listed profiles included.
fn least_of_classics(
    matrix: &SampleMatrix,
    sets: &[Option<usize>],
    classics: &[Pattern],
    weights: &dyn Fn(&Pattern) -> Result<LayerWeights, SearchError>,
) -> Result<Vec<f64>, SearchError> {
    let mut least = vec![f64::INFINITY; SETS];
    for classic in classics {
        let values = matrix.columns.values(&matrix.coefficients(&weights(classic)?));
        let (mut listed, mut worst) = (0.0_f64, vec![0.0_f64; SETS]);
        for (v, set) in values.iter().zip(sets) {
            match set {
                Some(k) => worst[*k] = worst[*k].max(v.abs()),
                None => listed = listed.max(v.abs()),
            }
        }
        for (least, worst) in least.iter_mut().zip(worst) {
            *least = least.min(worst.max(listed));
        }
    }
    Ok(least)
}
