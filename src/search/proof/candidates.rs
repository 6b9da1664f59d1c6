//! Full judgement of the few patterns that a search cannot refute on its own samples.

use std::ops::ControlFlow;

use super::course::Course;
use super::support::Support;
use super::{Goal, PassOutcome, StopWish, Task};
use crate::coil::Coil;
use crate::parallel::InParallel;
use crate::pattern::Pattern;
use crate::rate::{CoilModel, LayerWeights, RateError, RateModel};
use crate::search::cost::columns::{BLOCK, Norm};
use crate::search::cost::guaranteed::GuaranteedError;
use crate::search::cost::objective::rms_rad_per_s;
use crate::search::cost::pointing::pointing_as_rate;
use crate::search::cost::samples::SampleMatrix;
use crate::search::cost::worst_case::{SearchError, WorstCase};

/// A pattern and its cost by the reference, refined in time where it is a worst rate.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PatternCandidate {
    pub(crate) rate_rad_per_s: f64,
    pub(crate) segments: Vec<usize>,
}

impl PatternCandidate {
    /// The smaller rate; of equals the pattern that comes first, so that the answer does not depend on threads.
    pub(crate) fn better(self, other: Self) -> Self {
        let before = (other.rate_rad_per_s, &other.segments) < (self.rate_rad_per_s, &self.segments);
        if before { other } else { self }
    }
}

/// What shows that a pattern is not below the limit although no sample so far does; it becomes a sample.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Witness {
    /// A time of a profile.
    Instant { profile: usize, time_s: f64 },
    /// The pattern's own norm: the sample in which it shows.
    Pattern(Vec<usize>),
}

/// What was found out about a pattern.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum PatternFinding {
    /// Its worst rate is not below the limit, as a sample shows.
    Refuted {
        sample: usize,
    },
    /// It is not below the limit, but only between samples.
    RefutedBetween(Witness),
    Better(PatternCandidate),
}

/// Instants of one profile closer than this share of its duration are one sample.
const SAME_INSTANT: f64 = 1e-7;

/// A profile whose samples all stay below this share of another's refined worst rate is not refined: a peak between
/// samples exceeds them by a few per cent only, as the reference takes it too.
const PEAK_OVER_SAMPLES: f64 = 0.9;

/// What the goal is the largest of.
#[derive(Debug)]
enum Largest<'a> {
    /// What every time of the profiles shows.
    Course(Course, Task<'a>),
    /// The samples that a norm can be asked for; with what judges it, where the samples are not all there is.
    Norm(Support, Option<Task<'a>>),
    /// The samples as they are: there is nothing between them.
    Samples,
}

/// Every sample of the solved profiles, or the samples that a norm has been asked for, and the reference behind them.
#[derive(Debug)]
pub(crate) struct Judge<'a> {
    coil: Coil,
    of: Largest<'a>,
    /// What became samples besides those that were there at first, in their order.
    witnesses: Vec<Witness>,
    matrix: SampleMatrix,
    /// The profile of each of the profiles' own samples.
    profile_of: Vec<usize>,
    /// Samples in the order in which they are tried, and the same matrix in that order.
    order: Vec<usize>,
    ordered: SampleMatrix,
}

impl<'a> Judge<'a> {
    /// # Errors
    /// Effects that leave a layer no turns; rates that are not finite.
    pub(crate) fn new(task: &Task<'a>) -> Result<Self, SearchError> {
        let coil = task.model.wound_coil()?;
        let of_course = |course: Course| -> Result<_, SearchError> {
            let (samples, profile_of) = course.samples(task)?;
            Ok((Largest::Course(course, *task), samples, profile_of))
        };
        let of_norm = |support: Support| {
            let samples = support.first_samples();
            (Largest::Norm(support, Some(*task)), samples, Vec::new())
        };
        let (of, samples, profile_of) = match task.goal {
            Goal::WorstRate => of_course(Course::of_rate(task)?)?,
            Goal::Pointing => of_course(Course::of_pointing(task)?)?,
            Goal::RootMeanSquare => of_norm(Support::of_rms(task.model, task.solved)?),
            Goal::Guaranteed(step) => of_norm(Support::of_guaranteed(task.model, step)?),
        };
        Ok(Self::of(coil, of, samples, profile_of))
    }

    /// Of a norm of samples that are all there is.
    ///
    /// # Errors
    /// Effects that leave a layer no turns.
    pub(crate) fn of_samples(model: &CoilModel, samples: SampleMatrix, norm: Norm) -> Result<Self, SearchError> {
        let (of, matrix) = match norm {
            Norm::Largest => (Largest::Samples, samples),
            Norm::RootMeanSquare | Norm::Sum => {
                let support = Support::of_samples(samples, norm);
                let first = support.first_samples();
                (Largest::Norm(support, None), first)
            }
        };
        Ok(Self::of(model.wound_coil()?, of, matrix, Vec::new()))
    }

    fn of(coil: Coil, of: Largest<'a>, matrix: SampleMatrix, profile_of: Vec<usize>) -> Self {
        Self {
            coil,
            of,
            witnesses: Vec::new(),
            profile_of,
            order: (0..matrix.samples()).collect(),
            ordered: matrix.clone(),
            matrix,
        }
    }

    /// Every sample of the profiles in order, then those that were added.
    pub(crate) fn matrix(&self) -> &SampleMatrix {
        &self.matrix
    }

    /// Whether patterns bring samples of their own, without end.
    pub(super) fn is_of_norm(&self) -> bool {
        matches!(self.of, Largest::Norm(..))
    }

    pub(crate) fn lengths_m(&self) -> &[f64] {
        self.matrix.lengths_m()
    }

    /// A pattern's mirror image has the same rate at every instant but for the sign.
    pub(crate) fn is_mirror_symmetric(&self) -> bool {
        let layout = self.matrix.layout;
        layout.halves_alike && !layout.axial && self.matrix.columns.constant().iter().all(|c| *c == 0.0)
    }

    /// The cost by the reference, and what shows it.
    ///
    /// # Errors
    /// A pattern of another layer count.
    pub(crate) fn candidate_and_witness(&self, pattern: &Pattern) -> Result<(PatternCandidate, Witness), SearchError> {
        let segments = pattern.segments().to_vec();
        let (Largest::Course(_, task) | Largest::Norm(_, Some(task))) = &self.of else {
            let rate_rad_per_s = self.sampled_worst_rad_per_s(&segments);
            return Ok((PatternCandidate { rate_rad_per_s, segments: segments.clone() }, Witness::Pattern(segments)));
        };
        let Task { model, solved, goal, .. } = *task;
        let of_time = |worst: WorstCase| {
            let witness = Witness::Instant { profile: worst.profile_index, time_s: worst.time_s };
            (worst.rate_rad_per_s.abs(), witness)
        };
        let (rate_rad_per_s, witness) = match goal {
            Goal::WorstRate => of_time(solved.worst_case(model, pattern)?),
            Goal::Pointing => of_time(pointing_as_rate(model, solved, pattern)?),
            Goal::RootMeanSquare => {
                let rate_model = RateModel::new(model, pattern, &[])?;
                (rms_rad_per_s(&rate_model, solved), Witness::Pattern(segments.clone()))
            }
            Goal::Guaranteed(step) => {
                let bound = match step.guaranteed(model, pattern) {
                    Ok(found) => found.rate_rad_per_s,
                    Err(GuaranteedError::Search(error)) => return Err(error),
                    // A model without a bound has no unit step.
                    Err(GuaranteedError::Effect { .. }) => f64::INFINITY,
                };
                (bound, Witness::Pattern(segments.clone()))
            }
        };
        Ok((PatternCandidate { rate_rad_per_s, segments }, witness))
    }

    /// The largest size over the samples, or the norm of all of them.
    pub(crate) fn sampled_worst_rad_per_s(&self, segments: &[usize]) -> f64 {
        let coefficients = self.coefficients_of(segments);
        match &self.of {
            Largest::Norm(support, _) => support.value(&coefficients),
            Largest::Course(..) | Largest::Samples => Norm::Largest.of(&self.matrix.columns.values(&coefficients)),
        }
    }

    /// Makes samples of what refuted patterns; false if none of them is new.
    pub(crate) fn add_witnesses(&mut self, witnesses: &[Witness]) -> bool {
        let (mut responses, mut attaining) = (Vec::new(), Vec::new());
        for witness in witnesses {
            if self.witnesses.iter().any(|known| self.is_same(known, witness)) {
                continue;
            }
            self.witnesses.push(witness.clone());
            match (witness, &self.of) {
                (Witness::Instant { profile, time_s }, Largest::Course(course, task)) => {
                    responses.push(course.response_at(&task.solved.profiles()[*profile], *time_s));
                }
                (Witness::Pattern(segments), Largest::Norm(..)) => attaining.push(self.coefficients_of(segments)),
                // A goal has witnesses of its own kind only; where samples are all there is, none is new.
                _ => {}
            }
        }
        let from = self.matrix.samples();
        if !responses.is_empty() {
            self.matrix = self.matrix.extended(&responses);
        }
        if let Largest::Norm(support, _) = &self.of
            && !attaining.is_empty()
        {
            self.matrix = self.matrix.joined(&support.attaining(&attaining));
        }
        let added: Vec<usize> = (from..self.matrix.samples()).collect();
        if added.is_empty() {
            return false;
        }
        self.try_first(&added);
        true
    }

    fn is_same(&self, known: &Witness, other: &Witness) -> bool {
        match (known, other, &self.of) {
            (
                Witness::Instant { profile, time_s },
                Witness::Instant { profile: p, time_s: t },
                Largest::Course(_, task),
            ) => {
                let same_s = SAME_INSTANT * task.solved.profiles()[*profile].profile.duration_s();
                profile == p && (time_s - t).abs() <= same_s
            }
            _ => known == other,
        }
    }

    /// Whether a pattern's worst rate is below a limit: first by the samples, then by the reference.
    pub(crate) fn judge(&self, segments: &[usize], limit_rad_per_s: f64) -> PatternFinding {
        let pattern = Pattern::new(segments.to_vec()).expect("a search makes permutations only");
        let coefficients = self.coefficients(&pattern);
        let columns = &self.ordered.columns;
        let mut block = [0.0; BLOCK];
        for from in (0..self.order.len()).step_by(BLOCK) {
            let to = (from + BLOCK).min(self.order.len());
            let block = &mut block[..to - from];
            block.copy_from_slice(&columns.constant()[from..to]);
            for (index, x) in coefficients.iter().enumerate() {
                for (v, d) in block.iter_mut().zip(&columns.column(index)[from..to]) {
                    *v += x * d;
                }
            }
            let (mut worst, mut at) = (0.0, 0);
            for (i, v) in block.iter().enumerate() {
                if v.abs() > worst {
                    (worst, at) = (v.abs(), i);
                }
            }
            if worst >= limit_rad_per_s {
                return PatternFinding::Refuted { sample: self.order[from + at] };
            }
        }
        match &self.of {
            Largest::Norm(support, _) if support.value(&coefficients) >= limit_rad_per_s => {
                PatternFinding::RefutedBetween(Witness::Pattern(segments.to_vec()))
            }
            // No sample refutes it: with nothing between them it is better.
            Largest::Norm(..) | Largest::Samples => match self.candidate_and_witness(&pattern) {
                Ok((candidate, _)) if candidate.rate_rad_per_s < limit_rad_per_s => PatternFinding::Better(candidate),
                _ => PatternFinding::RefutedBetween(Witness::Pattern(segments.to_vec())),
            },
            Largest::Course(course, task) => self.refined(course, task, &pattern, limit_rad_per_s),
        }
    }

    /// What is worst refined in time, over the profiles in the order of their worst samples, until one is not below the
    /// limit or none that is left can be worse.
    fn refined(&self, course: &Course, task: &Task, pattern: &Pattern, limit_rad_per_s: f64) -> PatternFinding {
        let of_pattern = course.of(task, pattern).expect("a search makes patterns of the coil's layers");
        let values = self.matrix.columns.values(&self.coefficients(pattern));
        let mut largest = vec![0.0_f64; task.solved.profiles().len()];
        for (&profile, v) in self.profile_of.iter().zip(&values) {
            largest[profile] = largest[profile].max(v.abs());
        }
        let mut profiles: Vec<usize> = (0..largest.len()).collect();
        profiles.sort_by(|&a, &b| largest[b].total_cmp(&largest[a]).then(a.cmp(&b)));
        let mut worst_rad_per_s = 0.0_f64;
        for profile in profiles {
            if largest[profile] < PEAK_OVER_SAMPLES * worst_rad_per_s {
                break;
            }
            let (rate_rad_per_s, time_s) = of_pattern.worst(&task.solved.profiles()[profile]);
            worst_rad_per_s = worst_rad_per_s.max(rate_rad_per_s.abs());
            if worst_rad_per_s >= limit_rad_per_s {
                return PatternFinding::RefutedBetween(Witness::Instant { profile, time_s });
            }
        }
        PatternFinding::Better(PatternCandidate {
            rate_rad_per_s: worst_rad_per_s,
            segments: pattern.segments().to_vec(),
        })
    }

    fn coefficients_of(&self, segments: &[usize]) -> Vec<f64> {
        self.coefficients(&Pattern::new(segments.to_vec()).expect("a search makes permutations only"))
    }

    /// What a pattern comes to at chosen samples.
    pub(crate) fn values_at(&self, samples: &[usize], segments: &[usize]) -> Vec<f64> {
        let coefficients = self.coefficients_of(segments);
        let columns = &self.matrix.columns;
        let at = |s: usize| {
            columns.constant()[s] + coefficients.iter().enumerate().map(|(k, x)| x * columns.column(k)[s]).sum::<f64>()
        };
        samples.iter().map(|&s| at(s)).collect()
    }

    /// What one layer of a pattern adds at the samples of a selection.
    pub(super) fn layer_values(&self, selected: &SampleMatrix, segments: &[usize], layer: usize) -> Vec<f64> {
        let coefficients = self.coefficients_of(segments);
        let layout = selected.layout;
        let mut columns = vec![layout.column_a(layer)];
        if !layout.halves_alike {
            columns.push(layout.column_b(layer));
        }
        if layout.axial {
            columns.push(layout.column_axial(layer));
        }
        let at = |s: usize| columns.iter().map(|&k| coefficients[k] * selected.columns.column(k)[s]).sum();
        (0..selected.samples()).map(at).collect()
    }

    fn coefficients(&self, pattern: &Pattern) -> Vec<f64> {
        let weights: Result<LayerWeights, RateError> = LayerWeights::new(&self.coil, pattern);
        self.matrix.coefficients(&weights.expect("a search makes patterns of the coil's layer count"))
    }

    /// The samples at which given patterns are worst, the most frequent first, no two next to each other.
    pub(crate) fn binding_samples(&mut self, patterns: &[Vec<usize>], most: usize) -> Vec<usize> {
        if matches!(self.of, Largest::Norm(..)) {
            // Each pattern's own sample: of the first and then of every so many-th.
            let stride = patterns.len().div_ceil(most).max(1);
            let from = self.matrix.samples();
            let chosen: Vec<Witness> =
                patterns.iter().step_by(stride).map(|segments| Witness::Pattern(segments.clone())).collect();
            self.add_witnesses(&chosen);
            return (from..self.matrix.samples()).take(most).collect();
        }
        let worst: Vec<usize> = patterns
            .iter()
            .in_parallel()
            .map(|segments| {
                let pattern = Pattern::new(segments.clone()).expect("a search makes permutations only");
                let values = self.matrix.columns.values(&self.coefficients(&pattern));
                let mut at = 0;
                for (s, v) in values.iter().enumerate() {
                    if v.abs() > values[at].abs() {
                        at = s;
                    }
                }
                at
            })
            .collect();
        let mut counts = vec![0usize; self.matrix.samples()];
        for s in worst {
            counts[s] += 1;
        }
        let mut samples: Vec<usize> = (0..counts.len()).filter(|&s| counts[s] > 0).collect();
        samples.sort_by_key(|&s| (std::cmp::Reverse(counts[s]), s));
        let mut chosen: Vec<usize> = Vec::new();
        for s in samples {
            if chosen.len() < most && chosen.iter().all(|c| c.abs_diff(s) > 1) {
                chosen.push(s);
            }
        }
        chosen
    }

    /// Tries these samples first from now on, and the others in the order that they have.
    pub(crate) fn try_first(&mut self, samples: &[usize]) {
        let mut is_first = vec![false; self.matrix.samples()];
        for &s in samples {
            is_first[s] = true;
        }
        let rest: Vec<usize> = self.order.iter().copied().filter(|&s| !is_first[s]).collect();
        self.order = samples.iter().copied().chain(rest).collect();
        self.ordered = self.matrix.select(&self.order);
    }
}

impl PassOutcome {
    /// Judges one pattern and keeps what comes of it.
    pub(super) fn consider(&mut self, judge: &Judge, segments: &[usize], limit_rad_per_s: f64) {
        self.judged += 1;
        let limit = self.best.as_ref().map_or(limit_rad_per_s, |b| b.rate_rad_per_s);
        match judge.judge(segments, limit) {
            PatternFinding::Better(candidate) => {
                self.best = Some(match self.best.take() {
                    Some(best) => best.better(candidate),
                    None => candidate,
                });
            }
            PatternFinding::Refuted { sample } if self.refuting.len() < MOST_REFUTING => self.refuting.push(sample),
            PatternFinding::Refuted { .. } => {}
            PatternFinding::RefutedBetween(witness) => self.between.push(witness),
        }
    }

    /// Considers a pattern; breaks off where the samples refute too little.
    pub(super) fn judge(
        &mut self,
        judge: &Judge,
        segments: &[usize],
        limit_rad_per_s: f64,
        watch: &StopWish,
    ) -> ControlFlow<()> {
        self.consider(judge, segments, limit_rad_per_s);
        let too_much = self.judged > MOST_JUDGED || self.between.len() > MOST_BETWEEN;
        if watch.may_overflow && too_much {
            self.overflowed = true;
            return ControlFlow::Break(());
        }
        watch.pause()
    }
}

/// Refuting samples that one share remembers.
const MOST_REFUTING: usize = 64;

/// Patterns that one share may judge on all samples before it asks for more samples to refute them by.
const MOST_JUDGED: u64 = 512;

/// Patterns that one share may judge by the reference in vain, which takes a thousand times longer, before it asks for
/// samples at the instants that refuted them.
const MOST_BETWEEN: usize = 3;
