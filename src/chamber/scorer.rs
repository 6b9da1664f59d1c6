//! A fit made ready to score any number of further outputs of the rate, block by block: the filter's gains are shared.
//!
//! What [`Chamber::score`] says of columns together, this says of each alone and of any two, without a matrix over all.
//!
//! ```text
//! r̃ = V/√S cleared:  g̃ = r·v + w·s,  J̃_ab = r_a·r_b − c_a I⁻¹ c_b,   c = r·v'/√S,  w = I⁻¹ cᵀ
//! ```
//!
//! A regression clears a column of the coil's numbers alone, with the gyro as quiet as its white noise: where much is
//! unexplained, it ranks columns by what they explain, not by what the fitted wander has left of them.
//!
//! # Source
//! As [`super::score`].

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::coil_side::run_kept;
use super::derivative::Derivatives;
use super::filter::{RATE, System, Trace, Values, respond};
use super::fit::Fit;
use super::parameter::{Parameter, Place, add_priors};
use super::prior::Quantity;
use super::{Assumption, Chamber, ChamberError, Column};

/// A fit with its filter's gains and derivatives, of each record that it was fitted to.
pub(crate) struct Scorer<'c, 'a> {
    chamber: &'c Chamber<'a>,
    /// With whatever its gyro was made for it.
    fit: Fit,
    records: Vec<Prepared>,
    factor: Cholesky<f64, Dyn>,
    /// s of the fitted posterior.
    slope: DVector<f64>,
}

struct Prepared {
    record: usize,
    system: System,
    trace: Trace,
    /// v/√S.
    innovations: DVector<f64>,
    /// v'/√S, innovations × fitted coordinates.
    derivatives: DMatrix<f64>,
}

/// A column as the filter sees it, cleared of what was fitted.
#[derive(Debug, Clone)]
pub(crate) struct Scored {
    /// In units of the innovations' deviations, record after record.
    response: Vec<f64>,
    cross: DVector<f64>,
    weights: DVector<f64>,
    /// g̃ and J̃.
    pub(crate) score: f64,
    pub(crate) information: f64,
}

/// A column that what was fitted explains to this share says nothing of its own.
const OWN_SHARE: f64 = 1e-6;

impl Scored {
    /// By how much the log likelihood would rise at the best amplitude, and that amplitude.
    pub(crate) fn gain(&self) -> (f64, f64) {
        let all: f64 = self.response.iter().map(|r| r * r).sum();
        if !(self.information > OWN_SHARE * all) || !self.score.is_finite() {
            return (0.0, 0.0);
        }
        let amplitude = self.score / self.information;
        (0.5 * self.score * amplitude, amplitude)
    }

    /// By how much a fitted coordinate falls with each unit of the column's amplitude.
    pub(crate) fn weight(&self, coordinate: usize) -> f64 {
        self.weights[coordinate]
    }

    /// By how much the log likelihood would rise with two columns at once, and their amplitudes; None where one does what the other does.
    pub(crate) fn gain_with(&self, other: &Self) -> Option<(f64, [f64; 2])> {
        let both = self.information_with(other);
        let determinant = self.information * other.information - both * both;
        if !(determinant > OWN_SHARE * self.information * other.information) {
            return None;
        }
        let own = (self.score * other.information - other.score * both) / determinant;
        let others = (other.score * self.information - self.score * both) / determinant;
        let gain = 0.5 * (own * self.score + others * other.score);
        gain.is_finite().then_some((gain, [own, others]))
    }

    /// J̃ between two columns.
    pub(crate) fn information_with(&self, other: &Self) -> f64 {
        self.response.iter().zip(&other.response).map(|(a, b)| a * b).sum::<f64>() - self.cross.dot(&other.weights)
    }
}

impl<'a> Chamber<'a> {
    /// # Errors
    /// A fit whose model cannot be solved, or whose information is not positive.
    pub(crate) fn scorer(&self, fit: &Fit) -> Result<Scorer<'_, 'a>, ChamberError> {
        self.scorer_of(fit, |_| true)
    }

    /// The fit as a regression with a quiet gyro.
    ///
    /// # Errors
    /// As [`Chamber::scorer`].
    pub(crate) fn regression(&self, fit: &Fit) -> Result<Scorer<'_, 'a>, ChamberError> {
        let mut quiet = fit.clone();
        self.quieten(&mut quiet);
        let of_noise =
            |p: &Parameter| matches!(p.place, Place::Quantity { quantity, .. } if quantity != Quantity::Film);
        self.scorer_of(&quiet, |p| !of_noise(p))
    }

    /// A gyro of the record's own white noise, with the wander that is usual beside it.
    pub(crate) fn quieten(&self, fit: &mut Fit) {
        fit.calm(&fit.records.clone());
        for &r in &fit.records {
            let floor = self.noise_floor_rad_per_s(r);
            let own = fit.numbers[r].get(Quantity::RateNoise);
            fit.numbers[r].set(Quantity::RateNoise, own.min(floor));
        }
    }

    fn scorer_of(&self, fit: &Fit, cleared: impl Fn(&Parameter) -> bool) -> Result<Scorer<'_, 'a>, ChamberError> {
        let kept: Vec<usize> = (0..fit.parameters.len()).filter(|&i| cleared(&fit.parameters[i])).collect();
        let whole = kept.len() == fit.parameters.len();
        let parameters: Vec<Parameter> = kept.iter().map(|&i| fit.parameters[i]).collect();
        let coordinates: Vec<f64> = kept.iter().map(|&i| fit.coordinates[i]).collect();
        let point = self.model_point(fit.assumed.clone(), fit.numbers.clone(), &fit.records, &fit.courses)?;
        let fitted = parameters.len();
        let mut slope = DVector::zeros(fitted);
        let mut information = DMatrix::zeros(fitted, fitted);
        let mut records = Vec::with_capacity(fit.records.len());
        for &record in &fit.records {
            let (Some(side), Some(values)) = (&point.sides[record], &point.values[record]) else {
                return Err(ChamberError::Unsolvable);
            };
            let (system, trace) =
                run_kept(side, &point.assumed, &point.numbers[record], &self.observed[record], values);
            let base = vec![trace.innovations.clone()];
            let derivatives = self.derivatives(&point, &parameters, &coordinates, &[record], &base)?;
            let own = &derivatives[0];
            let deviations: Vec<f64> = trace.innovations.iter().map(|i| i.variance.sqrt()).collect();
            let innovations = trace.innovations.iter().zip(&deviations).map(|(i, d)| i.value / d);
            let innovations = DVector::from_iterator(deviations.len(), innovations);
            let derivatives = scaled(own, &deviations, fitted);
            if whole {
                own.add_to(&trace.innovations, &mut slope, &mut information);
            } else {
                slope -= derivatives.tr_mul(&innovations);
                information += derivatives.tr_mul(&derivatives);
            }
            records.push(Prepared { record, innovations, derivatives, system, trace });
        }
        add_priors(&parameters, &coordinates, &mut slope, &mut information);
        let factor = information.cholesky().ok_or(ChamberError::Unsolvable)?;
        Ok(Scorer { chamber: self, fit: fit.clone(), records, factor, slope })
    }
}

fn scaled(own: &Derivatives, deviations: &[f64], fitted: usize) -> DMatrix<f64> {
    let mut all = DMatrix::zeros(deviations.len(), fitted);
    for (place, &p) in own.parameters.iter().enumerate() {
        let mut column = all.column_mut(p);
        for (row, d) in deviations.iter().enumerate() {
            column[row] = own.columns[place].value[row] / d;
        }
    }
    all
}

impl Scorer<'_, '_> {
    /// One column; the amplitude's unit is that of the column.
    pub(crate) fn score(&self, column: &Column) -> Scored {
        let of = |prepared: &Prepared| {
            let mut inputs = Values { of: std::array::from_fn(|_| Vec::new()) };
            inputs.of[RATE] = column.rate_rad_per_s.get(prepared.record).cloned().unwrap_or_default();
            let rows = &self.chamber.observed[prepared.record].series.rows;
            respond(&prepared.system, rows, &prepared.trace, &inputs)
        };
        self.scored(self.records.iter().map(of).collect())
    }

    /// A changed model as a direction from the fit, the whole change one unit: what it does to the innovations themselves.
    ///
    /// # Errors
    /// A changed model that cannot be solved.
    pub(crate) fn score_model(&self, changed: &Assumption) -> Result<Scored, ChamberError> {
        let fit = &self.fit;
        let there = self.chamber.model_point(changed.clone(), fit.numbers.clone(), &fit.records, &fit.courses)?;
        let of = |prepared: &Prepared| {
            let moved = self.chamber.innovations(&there, prepared.record)?;
            Ok(prepared.trace.innovations.iter().zip(&moved).map(|(here, there)| here.value - there.value).collect())
        };
        let responses: Result<Vec<Vec<f64>>, ChamberError> = self.records.iter().map(of).collect();
        Ok(self.scored(responses?))
    }

    /// By how much innovations fall, record after record, cleared of what was fitted.
    fn scored(&self, responses: Vec<Vec<f64>>) -> Scored {
        let mut response = Vec::new();
        let mut cross = DVector::zeros(self.slope.len());
        let mut score = 0.0;
        for (prepared, mut own) in self.records.iter().zip(responses) {
            own.iter_mut().zip(&prepared.trace.innovations).for_each(|(o, i)| *o /= i.variance.sqrt());
            let own = DVector::from_vec(own);
            score += own.dot(&prepared.innovations);
            cross += prepared.derivatives.tr_mul(&own);
            response.extend(own.iter().copied());
        }
        let weights = self.factor.solve(&cross);
        // The innovations fall by V per unit of amplitude: their derivative is −V.
        let score = score + weights.dot(&self.slope);
        let information = response.iter().map(|r| r * r).sum::<f64>() - cross.dot(&weights);
        Scored { response, cross, weights, score, information }
    }
}

#[cfg(test)]
mod tests {
    use super::super::dense::tests::{dip, effect, model, record};
    use super::*;
    use crate::chamber::Effort;

    #[test]
    fn two_columns_gain_together_what_their_matrix_says_and_a_model_what_its_direction_does() {
        let record = record(400);
        let declared = model(Vec::new());
        let chamber = Chamber::new(&declared, &[&record]).unwrap();
        let assumed = Assumption::new(declared, dip());
        let fit = chamber.fit(&assumed, &[], &[0], None, Effort::QUICK).unwrap();
        let course = |of: &dyn Fn(f64) -> f64| Column {
            rate_rad_per_s: vec![(0..400).map(|k| 1e-7 * of(f64::from(k))).collect()],
        };
        let columns = [course(&|k| (k / 40.0).sin()), course(&|k| (k / 43.0).sin())];
        let scores = chamber.score(&fit, &columns).unwrap();
        let best = scores.information.clone().cholesky().unwrap().solve(&scores.score);
        let scorer = chamber.scorer(&fit).unwrap();
        let [first, second] = columns.each_ref().map(|c| scorer.score(c));
        let (gain, amplitudes) = first.gain_with(&second).unwrap();
        let expected = 0.5 * best.dot(&scores.score);
        println!("{gain} for {expected}, each alone {} and {}", first.gain().0, second.gain().0);
        assert!((gain / expected - 1.0).abs() < 1e-6 && gain > first.gain().0 + second.gain().0);
        assert!((amplitudes[0] / best[0] - 1.0).abs() < 1e-6 && (amplitudes[1] / best[1] - 1.0).abs() < 1e-6);
        assert!(first.gain_with(&first).is_none());

        let changed = Assumption::new(model(vec![effect("strain_mismatch", &[1e-5])]), dip());
        let direction = chamber.score_models(&fit, &[&changed]).unwrap()[0].unwrap();
        let scored = scorer.score_model(&changed).unwrap();
        println!("{} for {}, {} for {}", scored.score, direction.score, scored.information, direction.information);
        // The direction counts what becomes of variances, too.
        assert!((scored.score / direction.score - 1.0).abs() < 0.05);
        assert!((scored.information / direction.information - 1.0).abs() < 0.02);
    }
}
