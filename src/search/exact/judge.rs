//! Full judgement of the few patterns that a search cannot refute on its own samples.

use rayon::prelude::*;

use crate::coil::Coil;
use crate::pattern::Pattern;
use crate::rate::{CoilModel, LayerWeights, RateError};
use crate::search::columns::BLOCK;
use crate::search::samples::SampleMatrix;
use crate::search::worst_case::{SearchError, SolvedProfiles};

/// A pattern and its worst rate by the reference, refined in time.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    pub rate_rad_per_s: f64,
    pub segments: Vec<usize>,
}

impl Candidate {
    /// The smaller rate; of equals the pattern that comes first, so that the answer does not depend on threads.
    pub fn better(self, other: Self) -> Self {
        let before = (other.rate_rad_per_s, &other.segments) < (self.rate_rad_per_s, &self.segments);
        if before { other } else { self }
    }
}

/// What was found out about a pattern.
#[derive(Debug, Clone, PartialEq)]
pub enum Finding {
    /// Its worst rate is not below the limit; the sample that shows it, if one does.
    Refuted {
        sample: Option<usize>,
    },
    Better(Candidate),
}

/// Every sample of the solved profiles, and the reference behind them.
#[derive(Debug)]
pub struct Judge<'a> {
    model: &'a CoilModel,
    solved: &'a SolvedProfiles,
    coil: Coil,
    matrix: SampleMatrix,
    /// Samples in the order in which they are tried, and the same matrix in that order.
    order: Vec<usize>,
    ordered: SampleMatrix,
}

impl<'a> Judge<'a> {
    /// # Errors
    /// Effects that leave a layer no turns; rates that are not finite.
    pub fn new(model: &'a CoilModel, solved: &'a SolvedProfiles) -> Result<Self, SearchError> {
        let (matrix, _) = SampleMatrix::of_profiles(model, solved)?;
        let order = (0..matrix.samples()).collect();
        Ok(Self { model, solved, coil: model.wound_coil()?, ordered: matrix.clone(), matrix, order })
    }

    /// All samples, in their own order.
    pub fn matrix(&self) -> &SampleMatrix {
        &self.matrix
    }

    pub fn lengths_m(&self) -> &[f64] {
        self.matrix.lengths_m()
    }

    /// A pattern's mirror image has the same rate at every instant but for the sign.
    pub fn is_mirror_symmetric(&self) -> bool {
        let layout = self.matrix.layout;
        layout.halves_alike && !layout.axial && self.matrix.columns.constant().iter().all(|c| *c == 0.0)
    }

    /// The worst rate by the reference.
    ///
    /// # Errors
    /// A pattern of another layer count.
    pub fn candidate(&self, pattern: &Pattern) -> Result<Candidate, SearchError> {
        let worst = self.solved.worst_case(self.model, pattern)?;
        Ok(Candidate { rate_rad_per_s: worst.rate_rad_per_s.abs(), segments: pattern.segments().to_vec() })
    }

    /// Whether a pattern's worst rate is below a limit: first by the samples, then by the reference.
    pub fn judge(&self, segments: &[usize], limit_rad_per_s: f64) -> Finding {
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
                return Finding::Refuted { sample: Some(self.order[from + at]) };
            }
        }
        match self.candidate(&pattern) {
            Ok(candidate) if candidate.rate_rad_per_s < limit_rad_per_s => Finding::Better(candidate),
            _ => Finding::Refuted { sample: None },
        }
    }

    fn coefficients(&self, pattern: &Pattern) -> Vec<f64> {
        let weights: Result<LayerWeights, RateError> = LayerWeights::new(&self.coil, pattern);
        self.matrix.coefficients(&weights.expect("a search makes patterns of the coil's layer count"))
    }

    /// The samples at which given patterns are worst, the most frequent first, no two next to each other.
    pub fn binding_samples(&self, patterns: &[Vec<usize>], most: usize) -> Vec<usize> {
        let worst: Vec<usize> = patterns
            .par_iter()
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

    /// Tries these samples first from now on.
    pub fn try_first(&mut self, samples: &[usize]) {
        let mut is_first = vec![false; self.matrix.samples()];
        for &s in samples {
            is_first[s] = true;
        }
        let rest = (0..is_first.len()).filter(|&s| !is_first[s]);
        self.order = samples.iter().copied().chain(rest).collect();
        self.ordered = self.matrix.select(&self.order);
    }
}
