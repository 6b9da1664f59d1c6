//! From measured ramps the effective asymmetric length, and what to cut.
//!
//! ```text
//! Ω = n κ 2δ (Ṫ_pack − Ṫ_lead)/D + Ω_coil,   2δ: surplus fibre at end A (δ > 0) or end B
//! cut 2δ at that end: what is left is Ω_coil
//! cut 2δ (1 − s):     what is left is Ω_coil + s (Ω − Ω_coil), whose largest size is convex in s: it has one smallest value
//! ```
//!
//! | symbol | meaning | unit | in code |
//! |---|---|---|---|
//! | 2δ | effective asymmetric length | m | `asymmetric_length_m` |
//! | Ω_coil | the error of the coil whose middle is the fibre's | rad/s | `predicted_rad_per_s` |
//!
//! δ is fitted as any effect is, with what the records say of chamber, boundary and noise.
//!
//! Holds for surplus fibre that lies outside the pack, or an asymmetry of the winding that acts as if it did. A mismatch of the
//! fibre's halves looks the same in one steady ramp ([`super::Finding::equivalents`] names what does).
//!
//! # Source
//! First-order effect of a displaced middle: [`crate::rate`]; trimming to length is the field's practice.

use super::{DiagnoseError, Finding, Request, extend};
use crate::effect::{DeclaredEffect, OFFSET_OF_MIDDLE};
use crate::numeric::maximise::{Maximum, golden_section};
use crate::predict::{PredictError, estimate_boundary, predict_from};
use crate::rate::CoilModel;
use crate::record::Record;

/// Which end of the fibre.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum End {
    A,
    B,
}

/// What to cut, and what is then left.
#[derive(Debug, Clone)]
pub(crate) struct Trim {
    pub(crate) finding: Finding,
    /// Surplus at end A; negative at end B.
    pub(crate) asymmetric_length_m: f64,
    pub(crate) standard_error_m: Option<f64>,
    pub(crate) cut_m: f64,
    pub(crate) end: End,
    /// As many turns more on the outermost layer at the other end do the same.
    pub(crate) turns_at_other_end: f64,
    pub(crate) turns_standard_error: Option<f64>,
    /// The largest rate error under the records' temperatures: of the coil as it is, and after the cut.
    pub(crate) present_rad_per_s: f64,
    pub(crate) predicted_rad_per_s: f64,
    /// The largest that an error of one standard deviation in the cut would add.
    pub(crate) uncertain_rad_per_s: Option<f64>,
    /// None where the surplus changes nothing.
    pub(crate) least: Option<Least>,
}

/// The cut that leaves the smallest largest error, where what the winding itself makes is balanced as far as one length can.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Least {
    pub(crate) cut_m: f64,
    pub(crate) end: End,
    pub(crate) turns_at_other_end: f64,
    pub(crate) rad_per_s: f64,
}

/// At which end so much, positive at end A, is to be cut.
fn end_of(length_m: f64) -> End {
    if length_m >= 0.0 { End::A } else { End::B }
}

/// The share of a surplus that leaves the smallest largest error, and that error.
fn least_share(without: &[f64], with: &[f64]) -> Option<Maximum> {
    let pairs: Vec<(f64, f64)> =
        without.iter().zip(with).map(|(a, b)| (*a, b - a)).filter(|(a, d)| a.is_finite() && d.is_finite()).collect();
    let largest = |f: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(|pair| f(pair).abs()).fold(0.0, f64::max);
    let (winding, surplus) = (largest(&|pair| pair.0), largest(&|pair| pair.1));
    // Beyond it the surplus alone makes more than the winding.
    let most = 2.0 * winding / surplus;
    let found = (surplus > 0.0 && most.is_finite())
        .then(|| golden_section(|s| -largest(&|pair| pair.0 + s * pair.1), -most, most))?;
    Some(Maximum { value: -found.value, ..found })
}

fn in_record(record: &Record, error: PredictError) -> DiagnoseError {
    DiagnoseError::Record { record: record.name().to_owned(), source: Box::new(error) }
}

fn least_cut(without: &[f64], with: &[f64], length_m: f64, turn_m: f64) -> Option<Least> {
    let found = least_share(without, with)?;
    let cut_m = (1.0 - found.at) * length_m;
    Some(Least {
        cut_m: cut_m.abs(),
        end: end_of(cut_m),
        turns_at_other_end: cut_m.abs() / turn_m,
        rad_per_s: found.value,
    })
}

/// Fits the surplus fibre to the records; what its temperature follows is what fits better.
///
/// # Errors
/// As [`extend`].
pub(crate) fn trim(request: &Request) -> Result<Trim, DiagnoseError> {
    let extension = extend(request, &DeclaredEffect::at_start(OFFSET_OF_MIDDLE.spec))?;
    let place = OFFSET_OF_MIDDLE.parameter;
    let fitted = &extension.finding.parameters[place];
    let (offset_m, error_m) = (fitted.value, fitted.standard_error);
    // Fibre more or less at an end moves no heat: what drove the coil is the same with it.
    let mut driven = Vec::new();
    for record in request.records {
        let boundary = estimate_boundary(&extension.extended, request.pattern, record)
            .map_err(|error| in_record(record, error))?;
        driven.push((record, boundary));
    }
    let rates_of = |model: &CoilModel| -> Result<Vec<f64>, DiagnoseError> {
        let mut rates = Vec::new();
        for (record, boundary) in &driven {
            let found =
                predict_from(model, request.pattern, record, boundary).map_err(|error| in_record(record, error))?;
            let offset = found.offset_rad_per_s;
            rates.extend(found.rate_rad_per_s.iter().map(|rate| rate - offset));
        }
        Ok(rates)
    };
    let with_offset = |offset_m: f64| -> CoilModel {
        let mut model = extension.extended.clone();
        model.effects.retain(|e| !e.is_at(OFFSET_OF_MIDDLE));
        let mut values = extension.finding.effect.values().to_vec();
        values[place] = offset_m;
        match extension.finding.effect.with_values(values) {
            Ok(effect) if offset_m != 0.0 => model.with_effect(effect),
            _ => model,
        }
    };
    let size = |rates: &[f64]| rates.iter().map(|r| r.abs()).fold(0.0, f64::max);
    let (present, after) = (rates_of(&extension.extended)?, rates_of(&with_offset(0.0))?);
    let uncertain_rad_per_s = match error_m.filter(|e| *e > 0.0) {
        Some(error_m) => {
            let off = rates_of(&with_offset(error_m))?;
            Some(off.iter().zip(&after).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max))
        }
        None => None,
    };
    let coil = &request.model.coil;
    let outermost_m = coil.bore_radius_m() + (coil.layers() as f64 - 0.5) * coil.radial_pitch_m();
    let (length_m, turn_m) = (2.0 * offset_m, std::f64::consts::TAU * outermost_m);
    let least = least_cut(&after, &present, length_m, turn_m);
    Ok(Trim {
        asymmetric_length_m: length_m,
        standard_error_m: error_m.map(|e| 2.0 * e),
        cut_m: length_m.abs(),
        end: end_of(length_m),
        turns_at_other_end: length_m.abs() / turn_m,
        turns_standard_error: error_m.map(|e| 2.0 * e / turn_m),
        present_rad_per_s: size(&present),
        predicted_rad_per_s: size(&after),
        uncertain_rad_per_s,
        least,
        finding: extension.finding,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_largest_error_is_where_two_sizes_are_equal() {
        // |3 − s| and |−1 + 2 s| meet at s = 4/3: 5/3. What is no number counts for nothing.
        let without = [3.0, -1.0, f64::NAN];
        let found = least_share(&without, &[2.0, 1.0, 0.0]).unwrap();
        assert!((found.at - 4.0 / 3.0).abs() < 1e-6 && (found.value - 5.0 / 3.0).abs() < 1e-6, "{found:?}");
        assert_eq!(least_share(&without, &without), None);
    }
}
