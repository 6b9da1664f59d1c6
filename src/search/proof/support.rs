//! A norm of many samples as the largest of infinitely many single ones.
//!
//! ```text
//! ‖v‖ = max over y in B of Σ_s y_s v_s
//! ```
//!
//! | cost | B, the ball of the dual norm | the y that attains it |
//! |---|---|---|
//! | rms, √(Σ v²/S) | Σ y² ≤ 1/S | v_s / (S ‖v‖) |
//! | guaranteed, Σ \|v\| | \|y_s\| ≤ 1 | sgn v_s |
//! | guaranteed with a heated bore, max_t (Σ_{s≤t} \|v_s\| + \|g_t\|) | the same up to one t, and ±1 at g_t | signs up to the worst t |
//!
//! Every y makes a sample like any other, and what bounds it from below bounds the norm. So a proof about a norm is a
//! proof about a largest value, to which samples are added as patterns ask for them: each pattern that no sample
//! refutes brings the y that attains its own norm. For the guaranteed worst case that sample is the bang-bang profile
//! under which the pattern is worst.
//!
//! # Source
//! Kelley, J. SIAM 8, 703 (1960), cutting planes; Rockafellar, Convex Analysis (1970), section 13, support functions.

use crate::rate::{CoilModel, WeightResponse};
use crate::search::cost::columns::Norm;
use crate::search::cost::guaranteed::UnitStep;
use crate::search::cost::objective::Objective;
use crate::search::cost::samples::SampleMatrix;
use crate::search::cost::worst_case::{SearchError, SolvedProfiles};

/// The samples of a norm, and how they make it.
#[derive(Debug)]
pub(crate) struct Support {
    matrix: SampleMatrix,
    kind: Kind,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    RootMeanSquare,
    /// The first so many samples are changes of G, and as many again errors of the heat where there are any.
    Guaranteed {
        changes: usize,
        heated: bool,
    },
}

/// Signed weights of samples, zero where not mentioned.
type Weights = Vec<(usize, f64)>;

/// Every so many-th time of the unit step is a sample to begin with.
const STRIDE: usize = 4;

impl Support {
    /// Of the rms rate.
    ///
    /// # Errors
    /// Effects that leave a layer no turns; rates that are not finite.
    pub(crate) fn of_rms(model: &CoilModel, solved: &SolvedProfiles) -> Result<Self, SearchError> {
        let matrix = Objective::RootMeanSquare.of_profiles(model, solved)?;
        Ok(Self { matrix, kind: Kind::RootMeanSquare })
    }

    /// Of the guaranteed worst rate.
    ///
    /// # Errors
    /// Effects that leave a layer no turns.
    pub(crate) fn of_guaranteed(model: &CoilModel, step: &UnitStep) -> Result<Self, SearchError> {
        let parts = step.parts(model, 1)?;
        let (changes, heated) = (parts.changes.len(), !parts.heat.is_empty());
        let responses: Vec<WeightResponse> = parts.changes.into_iter().chain(parts.heat).collect();
        let matrix = SampleMatrix::new(model, &responses)?;
        Ok(Self { matrix, kind: Kind::Guaranteed { changes, heated } })
    }

    /// Of samples that are all there is.
    pub(crate) fn of_samples(matrix: SampleMatrix, norm: Norm) -> Self {
        let kind = match norm {
            Norm::RootMeanSquare => Kind::RootMeanSquare,
            Norm::Largest | Norm::Sum => Kind::Guaranteed { changes: matrix.samples(), heated: false },
        };
        Self { matrix, kind }
    }

    pub(crate) fn matrix(&self) -> &SampleMatrix {
        &self.matrix
    }

    /// The norm for given coefficients.
    pub(crate) fn value(&self, coefficients: &[f64]) -> f64 {
        let values = self.matrix.columns.values(coefficients);
        match self.kind {
            Kind::RootMeanSquare => Norm::RootMeanSquare.of(&values),
            Kind::Guaranteed { changes, heated } => heaviest(&values, changes, heated).1,
        }
    }

    /// Samples to begin with.
    pub(crate) fn first_samples(&self) -> SampleMatrix {
        let weights: Vec<Weights> = match self.kind {
            Kind::RootMeanSquare => {
                // Σ y² = 1/S with a single entry.
                let size = 1.0 / (self.matrix.samples() as f64).sqrt();
                (0..self.matrix.samples()).map(|s| vec![(s, size)]).collect()
            }
            Kind::Guaranteed { changes, .. } => {
                // G itself at a time is the sum of its changes until then.
                let ends = (0..changes).step_by(STRIDE).chain([changes - 1]);
                ends.map(|end| (0..=end).map(|s| (s, 1.0)).collect()).collect()
            }
        };
        self.matrix.combined(&weights)
    }

    /// One sample for each choice of coefficients: that in which its norm shows.
    pub(crate) fn attaining(&self, coefficients: &[Vec<f64>]) -> SampleMatrix {
        let weights: Vec<Weights> = coefficients.iter().map(|c| self.attaining_weights(c)).collect();
        self.matrix.combined(&weights)
    }

    fn attaining_weights(&self, coefficients: &[f64]) -> Weights {
        let values = self.matrix.columns.values(coefficients);
        match self.kind {
            Kind::RootMeanSquare => {
                let scale = values.len() as f64 * Norm::RootMeanSquare.of(&values);
                if scale > 0.0 { values.iter().map(|v| v / scale).enumerate().collect() } else { vec![(0, 0.0)] }
            }
            Kind::Guaranteed { changes, heated } => {
                let (until, _) = heaviest(&values, changes, heated);
                let mut weights: Weights = (0..=until).map(|s| (s, values[s].signum())).collect();
                if heated {
                    weights.push((changes + until, values[changes + until].signum()));
                }
                weights
            }
        }
    }
}

/// Until which change the sum counts, and the sum with the heat's error there.
fn heaviest(values: &[f64], changes: usize, heated: bool) -> (usize, f64) {
    if !heated {
        return (changes - 1, values.iter().map(|v| v.abs()).sum());
    }
    let (mut sum, mut best) = (0.0, (0, 0.0));
    for (s, change) in values[..changes].iter().enumerate() {
        sum += change.abs();
        let with_heat = sum + values[changes + s].abs();
        if with_heat > best.1 {
            best = (s, with_heat);
        }
    }
    best
}
