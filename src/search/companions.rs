//! Starts that searches share: patterns found under one objective or in a narrower class, judged under another.
//!
//! What makes the worst rate small makes the guaranteed worst rate small as well, but an annealer that begins anew
//! under each objective ends in another valley each time. So every search first asks, briefly, for what all objectives
//! find, with the look-ahead of the proof where the class has one, and judges it by its own. These short searches have a
//! seed of their own, the same for every command and seed, so that what one of them comes upon no other misses. In classes of
//! permutations a search's end, bounds, stretches of the fibre and orders of neighbours from the best that is known, is a draw from very
//! many minima: it too is made in common, and again only by a search that has come upon something better.

use rand_chacha::ChaCha8Rng;

use super::anneal::limits::pick;
use super::anneal::restart::generator;
use super::anneal::rounds::{FoundPattern, Plan, Rounds, Rules};
use super::cost::objective::Objective;
use super::evaluator::{EQUALLY_GOOD, Evaluator, FEWEST_LAYERS, JudgeError, Judged, MOST_STARTS, name_of};
use crate::numeric::order::sort_ascending;
use crate::pattern::Pattern;
use crate::pattern::windability::WindabilityClass;

/// Rounds of a short search.
const ROUNDS: u64 = 2;

/// Seed of the short searches.
const COMMON_SEED: u64 = 1;

/// Objectives of the short searches: what is best for the phase is best for the rate, and built coils take too long unless the
/// search is about them.
const SEARCHED: [Objective; 3] = [Objective::WorstRate, Objective::GuaranteedRate, Objective::RootMeanSquare];

/// Moves of a restart of the short search over built coils in classes of permutations at least. Its minima are many: on 14
/// layers four seeds' usual restarts ended 1.3 to 4.1 % above the best that longer ones had found, with these 0.2 %.
const MOVES_OVER_BUILT_COILS: u64 = 1 << 16;

/// Patterns of a short search that are shared.
const SHARED: usize = 8;

/// Captive runs up to which classes are searched one by one.
pub(crate) const MOST_CAPTIVE: u8 = 2;

/// Moves of a restart, over the usual, of a second short search for what a search itself makes small, in classes of permutations. With
/// one captive run on 28 layers by guaranteed rate, usual restarts of six seeds ended in two valleys 7.7 % apart; these end in the better one.
/// On 20 layers usual ones find the better minimum.
const LONGER: u64 = 4;

/// Draws of patterns that bounds begin with, besides the best, after which no more follow if they brought nothing better. By guaranteed
/// rate of 48 layers with one captive run the 4th, 8th and 10th draw bring something, by rms the 2nd, none of ten on 20 and 28.
const IDLE_DRAWS: usize = 8;

/// Stream of random numbers of these draws.
const END_STREAM: u64 = u64::MAX / 16;

/// Patterns from which a search is refined at its end.
const REFINED: usize = 4;

/// Patterns that a proof begins with.
const BEGUN_WITH: usize = 6;

/// A refinement takes this part of a restart's moves.
const REFINING_SHARE: u64 = 2;

impl<'a> Evaluator<'a> {
    /// The same model judged by another objective.
    pub(crate) fn under(&self, objective: Objective) -> Evaluator<'a> {
        Evaluator { objective, ..*self }
    }

    /// Patterns that short searches for other objectives and in narrower classes come upon; `goes_on` is asked between
    /// their slices.
    ///
    /// # Errors
    /// Rates that are not finite.
    pub(crate) fn companions(
        &self,
        class: WindabilityClass,
        plan: &Plan,
        goes_on: &dyn Fn() -> bool,
    ) -> Result<Vec<Pattern>, JudgeError> {
        let has_bound = self.unit_step.is_some();
        let plan = &Plan { seed: COMMON_SEED, ..plan.clone() };
        let mut shared = Vec::new();
        // In a class of permutations the pointing error has minima of its own.
        let is_of_pointing = self.objective == Objective::Pointing && class != WindabilityClass::Standard;
        let searched = SEARCHED.into_iter().chain(is_of_pointing.then_some(Objective::Pointing));
        for objective in searched.filter(|o| has_bound || *o != Objective::GuaranteedRate) {
            shared.extend(self.found_in_common(objective, class, plan, goes_on)?);
        }
        let narrower = narrower_than(class);
        // With few captive runs the least is often found sooner than with any, and it is one of any.
        let own = Some(self.objective)
            .filter(|o| !matches!(o, Objective::WorstRate | Objective::P95 | Objective::WorstPhase));
        for &class in &narrower {
            for objective in [Some(Objective::WorstRate), own].into_iter().flatten() {
                shared.extend(self.found_in_common(objective, class, plan, goes_on)?);
            }
        }
        if self.objective == Objective::P95 {
            for &class in narrower.first().into_iter().chain([&class]) {
                shared.extend(self.over_built_coils(class, plan, &shared, goes_on)?);
            }
        }
        shared.extend(self.ended_in_common(class, plan, &shared, goes_on)?);
        let mut seen = std::collections::BTreeSet::new();
        shared.retain(|pattern| seen.insert(pattern.segments().to_vec()));
        Ok(shared)
    }

    /// What bounds and, in classes of permutations, descents through the orders of neighbours make of the best of given patterns, in
    /// turn until neither comes upon anything better. Neither does what the other does: on 48 layers with one captive run bounds bring
    /// the guaranteed rate down by 8 % where descents bring 2 %, on 28 layers they bring nothing and descents 7 and 11 %.
    fn ended_in_common(
        &self,
        class: WindabilityClass,
        plan: &Plan,
        patterns: &[Pattern],
        goes_on: &dyn Fn() -> bool,
    ) -> Result<Vec<Pattern>, JudgeError> {
        if self.goal().is_none() {
            return Ok(Vec::new());
        }
        let mut known = self.of_class_in_order(class, patterns)?;
        known.dedup_by(|a, b| a.pattern == b.pattern);
        let mut random = generator(COMMON_SEED, END_STREAM);
        let mut ended = Vec::new();
        let mut has_descended = false;
        while goes_on() && !known.is_empty() {
            let before = known[0].clone();
            let is_optimal = self.improved_from_others(class, &mut known, &mut random, goes_on)?;
            ended.push(known[0].pattern.clone());
            let is_where_a_descent_ended = has_descended && !known[0].is_better_than(&before);
            if is_optimal || is_where_a_descent_ended || !self.descends_at_the_end(class) {
                break;
            }
            let starts: Vec<Vec<usize>> = known.iter().take(REFINED).map(|k| k.pattern.segments().to_vec()).collect();
            let rules = Rules { rounds: 0, patience: 0, moves: None, target: None };
            let Some(search) = self.search(class, Plan { rules, ..plan.clone() }, None)? else { break };
            let Some(reached) = search.in_other_orders(&starts, goes_on) else { break };
            let pattern = Pattern::new(reached.segments).expect("a descent visits permutations only");
            let reached = self.judge(&name_of(&pattern), &pattern)?;
            if !reached.is_better_than(&known[0]) {
                break;
            }
            ended.push(pattern);
            known.insert(0, reached);
            has_descended = true;
        }
        Ok(ended)
    }

    /// Improves the first of known patterns by bounds, begun together with others of them that are drawn, until several draws have brought
    /// nothing: bounds are learnt from what is near to all that they begin with, so that others make others. What is new is improved by many
    /// moves at once as well. True if the first is then proved to be the best of its class.
    fn improved_from_others(
        &self,
        class: WindabilityClass,
        known: &mut Vec<Judged>,
        random: &mut ChaCha8Rng,
        goes_on: &dyn Fn() -> bool,
    ) -> Result<bool, JudgeError> {
        let most_idle = if class == WindabilityClass::Standard { 1 } else { IDLE_DRAWS };
        let mut others = known.clone();
        let (mut idle, mut is_new) = (0, true);
        while idle < most_idle && goes_on() {
            let begun_with: Vec<FoundPattern> = others.iter().take(MOST_STARTS).map(Judged::as_found).collect();
            let (best, is_whole) = (known[0].clone(), std::mem::take(&mut is_new));
            let (improved, is_optimal) = if is_whole {
                self.improved(class, best, &begun_with, None)?
            } else {
                self.improved_by_bounds(class, best, &begun_with, None)?
            };
            idle += 1;
            if improved.is_better_than(&known[0]) {
                known.insert(0, improved);
                (idle, is_new) = (0, !is_whole);
            }
            if is_optimal {
                return Ok(true);
            }
            others.clone_from(known);
            for k in 1..MOST_STARTS.min(others.len()) {
                let other = k + pick(random, others.len() - k);
                others.swap(k, other);
            }
        }
        Ok(false)
    }

    /// Whether descents through the orders of neighbours are a part of the common end. By worst rate, bounds do all that they do: on 28 layers
    /// 33 and 163 s of them brought nothing. Of standard patterns by other objectives the annealer finds the best, or many moves at once do.
    fn descends_at_the_end(&self, class: WindabilityClass) -> bool {
        class != WindabilityClass::Standard && !matches!(self.objective, Objective::WorstRate | Objective::WorstPhase)
    }

    /// Those of the class as the reference judges them, best first.
    fn of_class_in_order(&self, class: WindabilityClass, patterns: &[Pattern]) -> Result<Vec<Judged>, JudgeError> {
        let admitted = patterns.iter().filter(|pattern| class.admits(pattern));
        let named: Vec<(String, Pattern)> = admitted.map(|pattern| (name_of(pattern), pattern.clone())).collect();
        let mut judged = self.judge_all(&named)?;
        sort_ascending(&mut judged, |item| item.objective_rad_per_s);
        Ok(judged)
    }

    /// What bounds make of the best that was found. What all searches have in common has been improved for all of them: if each
    /// went on from it in a way of its own, each would end on the least of other patterns.
    ///
    /// # Errors
    /// As [`Evaluator::improved`].
    pub(crate) fn improved_beyond(
        &self,
        shared: &[Pattern],
        class: WindabilityClass,
        best: Judged,
        found: &[FoundPattern],
        good_enough_rad_per_s: Option<f64>,
    ) -> Result<Judged, JudgeError> {
        if self.goal().is_none() {
            return Ok(best);
        }
        let common = self.of_class_in_order(class, shared)?;
        let is_as_good =
            |common: &Judged| common.objective_rad_per_s <= best.objective_rad_per_s * (1.0 + EQUALLY_GOOD);
        if common.first().is_some_and(is_as_good) {
            return Ok(best);
        }
        Ok(self.improved(class, best, found, good_enough_rad_per_s)?.0)
    }

    /// What a search by P95 that is the same for every seed finds, and what descents from there come to.
    fn over_built_coils(
        &self,
        class: WindabilityClass,
        plan: &Plan,
        known: &[Pattern],
        goes_on: &dyn Fn() -> bool,
    ) -> Result<Vec<Pattern>, JudgeError> {
        let usual = self.short_moves_per_restart(self.model.coil.layers());
        // Whoever asks for fewer moves has fewer.
        let is_longer = plan.moves_per_restart >= usual && class != WindabilityClass::Standard;
        let moves = if is_longer { MOVES_OVER_BUILT_COILS.max(usual) } else { plan.moves_per_restart.min(usual) };
        let Some(search) = self.short_search(moves, class, plan, goes_on)? else { return Ok(Vec::new()) };
        let mut found = self.shared_of(search.as_ref(), class, goes_on)?;
        let mut starts = self.judged(search.as_ref(), class, known);
        starts.extend(self.judged(search.as_ref(), class, &found));
        let reached = search.in_other_orders(&starts_of(starts), goes_on);
        let pattern = |found: FoundPattern| Pattern::new(found.segments).expect("a descent visits permutations only");
        found.extend(reached.map(pattern));
        Ok(found)
    }

    /// The best of [`Evaluator::companions`], for a proof to begin with; none where the proof itself comes upon the best at once.
    ///
    /// # Errors
    /// As there.
    pub(crate) fn best_companions(
        &self,
        class: WindabilityClass,
        goes_on: &dyn Fn() -> bool,
    ) -> Result<Vec<Pattern>, JudgeError> {
        let layers = self.model.coil.layers();
        if class == WindabilityClass::Standard || layers < FEWEST_LAYERS || self.is_provable(class) {
            return Ok(Vec::new());
        }
        let shared = self.companions(class, &Plan::usual(layers, COMMON_SEED), goes_on)?;
        let judged = self.of_class_in_order(class, &shared)?;
        Ok(judged.into_iter().take(BEGUN_WITH).map(|judged| judged.pattern).collect())
    }

    /// What a short search finds, the best of it improved by bounds.
    pub(super) fn short(
        &self,
        class: WindabilityClass,
        plan: &Plan,
        goes_on: &dyn Fn() -> bool,
    ) -> Result<Vec<Pattern>, JudgeError> {
        let moves = plan.moves_per_restart.min(self.short_moves_per_restart(self.model.coil.layers()));
        self.short_with(moves, class, plan, goes_on)
    }

    /// The same by any objective, and by the search's own, where that is a largest rate, also with longer restarts.
    fn found_in_common(
        &self,
        objective: Objective,
        class: WindabilityClass,
        plan: &Plan,
        goes_on: &dyn Fn() -> bool,
    ) -> Result<Vec<Pattern>, JudgeError> {
        let under = self.under(objective);
        let mut found = under.short(class, plan, goes_on)?;
        let usual = under.short_moves_per_restart(self.model.coil.layers());
        // Whoever asks for fewer moves has fewer.
        let is_unlimited = plan.moves_per_restart >= usual;
        // By rms and pointing error many moves at once do what longer restarts would.
        let is_of_largest_rate = matches!(objective, Objective::WorstRate | Objective::GuaranteedRate);
        let is_own = objective == self.objective && class != WindabilityClass::Standard;
        if is_own && is_of_largest_rate && is_unlimited {
            found.extend(under.short_with(LONGER * usual, class, plan, goes_on)?);
        }
        Ok(found)
    }

    fn short_with(
        &self,
        moves_per_restart: u64,
        class: WindabilityClass,
        plan: &Plan,
        goes_on: &dyn Fn() -> bool,
    ) -> Result<Vec<Pattern>, JudgeError> {
        let search = self.short_search(moves_per_restart, class, plan, goes_on)?;
        search.map_or(Ok(Vec::new()), |search| self.shared_of(search.as_ref(), class, goes_on))
    }

    /// A few rounds, at their end.
    fn short_search(
        &self,
        moves_per_restart: u64,
        class: WindabilityClass,
        plan: &Plan,
        goes_on: &dyn Fn() -> bool,
    ) -> Result<Option<Box<dyn Rounds>>, JudgeError> {
        let plan = Plan {
            seed: plan.seed,
            restarts_per_round: plan.restarts_per_round,
            moves_per_restart,
            rules: Rules { rounds: ROUNDS, patience: ROUNDS, moves: None, target: None },
            starts: Vec::new(),
        };
        let Some(mut search) = self.search(class, plan, None)? else { return Ok(None) };
        while goes_on() && search.advance() {}
        search.gather();
        Ok(Some(search))
    }

    /// The best that a short search found, and what bounds make of it.
    fn shared_of(
        &self,
        search: &dyn Rounds,
        class: WindabilityClass,
        goes_on: &dyn Fn() -> bool,
    ) -> Result<Vec<Pattern>, JudgeError> {
        let found = &search.state().found;
        let mut patterns: Vec<Pattern> =
            found.iter().take(SHARED).filter_map(|f| Pattern::new(f.segments.clone()).ok()).collect();
        if goes_on()
            && let Some(best) = self.best(class, found, &[])?
        {
            patterns.push(self.improved(class, best, found, None)?.0.pattern);
        }
        Ok(patterns)
    }

    /// What a search found and what was shared with it, the best refined from where they are; best first. `goes_on` is asked
    /// between steps of the refinement.
    pub(crate) fn gathered(
        &self,
        search: &dyn Rounds,
        class: WindabilityClass,
        shared: &[Pattern],
        refine: bool,
        goes_on: &dyn Fn() -> bool,
    ) -> Vec<FoundPattern> {
        let shared = self.judged(search, class, shared);
        let least_shared = shared.iter().map(|f| f.cost).fold(f64::INFINITY, f64::min);
        let mut found = search.state().found.clone();
        found.extend(shared);
        let mut found = in_order(found);
        if refine {
            let starts = starts_of(found.clone());
            found.extend(search.refined(&starts, search.plan().moves_per_restart / REFINING_SHARE));
            found = in_order(found);
            // What all searches have in common has descended.
            let has_descended = found.first().is_some_and(|best| best.cost >= least_shared * (1.0 - EQUALLY_GOOD));
            // Of standard patterns by other objectives the annealer finds the best, or many moves at once do.
            let is_worth_it = self.objective == Objective::P95 || class != WindabilityClass::Standard;
            if is_worth_it && !has_descended {
                found.extend(search.in_other_orders(&starts_of(found.clone()), goes_on));
                found = in_order(found);
            }
        }
        found
    }

    /// Patterns of the class, as a search judges them.
    fn judged(&self, search: &dyn Rounds, class: WindabilityClass, patterns: &[Pattern]) -> Vec<FoundPattern> {
        let admitted = patterns.iter().filter(|pattern| class.admits(pattern));
        admitted.map(|pattern| search.judged(pattern.segments())).collect()
    }
}

/// The classes within a class of permutations that are searched besides, the narrowest first: those that a front shows on their
/// own ([`MOST_CAPTIVE`]).
fn narrower_than(class: WindabilityClass) -> Vec<WindabilityClass> {
    let most = match class {
        WindabilityClass::Standard => 0,
        WindabilityClass::Captive(runs) => runs.saturating_sub(1).min(MOST_CAPTIVE.into()),
        WindabilityClass::Any => MOST_CAPTIVE.into(),
    };
    (1..=most).map(WindabilityClass::Captive).collect()
}

/// Best first, no two alike.
fn in_order(mut found: Vec<FoundPattern>) -> Vec<FoundPattern> {
    found.sort_by(|a, b| a.cost.total_cmp(&b.cost).then_with(|| a.segments.cmp(&b.segments)));
    found.dedup_by(|a, b| a.segments == b.segments);
    found
}

/// What a refinement begins with.
fn starts_of(found: Vec<FoundPattern>) -> Vec<Vec<usize>> {
    in_order(found).into_iter().take(REFINED).map(|found| found.segments).collect()
}
