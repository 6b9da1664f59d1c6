//! Whether a model is adequate for a record, and where it fails, in words.
//!
//! A part of the record stands out where its χ² per row exceeds what chance and a little allow; the residual follows a
//! quantity where taking that quantity out would lower χ² by more than chance and a little allow.

use super::regimes::{RecordPart, Regime};
use super::{Comparison, Covariate};
use crate::chamber::FilmSwitches;
use crate::numeric::order::sort_descending;
use crate::units::{deg_per_h_from_rad_per_s, percent_from_fraction};

/// Whether a model is adequate for a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Adequacy {
    /// What is left is the record's noise.
    Adequate,
    /// The model lacks something.
    Missing,
}

/// One statement about where the error lies.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum ResidualFinding {
    /// The whole χ² is too large.
    Excess {
        /// Reduced χ² against noise and boundary.
        whitened_chi_square: f64,
    },
    /// The error gathers where the drive does one thing.
    Regime {
        /// What the drive does there.
        regime: Regime,
        /// Of the squared error; from 0 to 1.
        share: f64,
        /// Of the record's rows; from 0 to 1.
        share_of_rows: f64,
        /// How long a change of ramp counts as recent.
        transient_s: f64,
    },
    /// The error gathers at some temperatures.
    TemperatureBand {
        /// From and to, in words.
        band: String,
        /// Of the squared error; from 0 to 1.
        share: f64,
        /// Of the record's rows; from 0 to 1.
        share_of_rows: f64,
    },
    /// The error gathers at some rates of temperature.
    RateBand {
        /// From and to, in words.
        band: String,
        /// Of the squared error; from 0 to 1.
        share: f64,
        /// Of the record's rows; from 0 to 1.
        share_of_rows: f64,
    },
    /// The residual follows a quantity.
    Follows {
        /// Which one.
        quantity: Covariate,
        /// From −1 to 1.
        correlation: f64,
    },
    /// Readings and rates together want something else.
    Wanted {
        /// Of log likelihood, with an effect that the model lacks.
        gain: f64,
    },
    /// The rate wanders more than a gyro of this noise does.
    Wanders,
    /// Neighbouring residuals hang together.
    Coloured {
        /// Autocorrelation at lag 1.
        lag_one: f64,
        /// Within which white noise stays in 99 of 100 records.
        band: f64,
    },
    /// The residual is the record's noise.
    NothingStandsOut {
        /// Against the noise alone.
        reduced_chi_square: f64,
        /// Readings and rates that are none of the coil's, and are in it all the same.
        gross_errors: usize,
    },
    /// A part of χ² is what the estimated boundary leaves open.
    Boundary {
        /// Against the noise alone.
        reduced_chi_square: f64,
        /// The part of it that the boundary makes.
        boundary_chi_square: f64,
    },
    /// The film between air and pack is switched.
    FilmSwitched(FilmSwitches),
    /// The largest single error.
    Largest {
        /// With its sign.
        residual_rad_per_s: f64,
        /// Its row's time.
        time_s: f64,
    },
}

impl std::fmt::Display for ResidualFinding {
    #[expect(clippy::too_many_lines, reason = "a sentence for each finding")]
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let percent = |share: &f64| format!("{:.0} %", percent_from_fraction(*share));
        match self {
            ResidualFinding::Excess { whitened_chi_square } => write!(
                f,
                "the residual is {:.2} times what the record's noise and the boundary's uncertainty explain (reduced chi-square {whitened_chi_square:.3})",
                whitened_chi_square.max(0.0).sqrt()
            ),
            ResidualFinding::Regime { regime, share, share_of_rows, transient_s } => {
                let place = match regime {
                    Regime::WarmUp => "in the warm-up at the start".to_owned(),
                    Regime::Transient => format!("in the {transient_s:.0} s after each change of ramp"),
                    Regime::HeatingRamp => "in the heating ramps".to_owned(),
                    Regime::CoolingRamp => "in the cooling ramps".to_owned(),
                    Regime::Soak => "in the soaks".to_owned(),
                };
                write!(
                    f,
                    "{} of the squared error lies {place}, in {} of the rows",
                    percent(share),
                    percent(share_of_rows)
                )
            }
            ResidualFinding::TemperatureBand { band, share, share_of_rows } => write!(
                f,
                "{} of the squared error lies at {band}, in {} of the rows",
                percent(share),
                percent(share_of_rows)
            ),
            ResidualFinding::RateBand { band, share, share_of_rows } => write!(
                f,
                "{} of the squared error lies where dT/dt is {band}, in {} of the rows",
                percent(share),
                percent(share_of_rows)
            ),
            ResidualFinding::Follows { quantity, correlation } => {
                write!(f, "the residual follows {quantity} (correlation {correlation:.2})")
            }
            ResidualFinding::Wanted { gain } => write!(
                f,
                "readings and rates together become e^{gain:.0} times as likely with an effect that the model lacks: diagnose tells which"
            ),
            ResidualFinding::Wanders => {
                f.write_str("the rate wanders more than a gyro of this noise does: diagnose asks what it follows")
            }
            ResidualFinding::Coloured { lag_one, band } => write!(
                f,
                "neighbouring residuals hang together (autocorrelation {lag_one:.2} at lag 1, white within {band:.2})"
            ),
            ResidualFinding::NothingStandsOut { reduced_chi_square, gross_errors: 0 } => write!(
                f,
                "nothing stands out: the residual is the record's noise (reduced chi-square {reduced_chi_square:.3})"
            ),
            ResidualFinding::NothingStandsOut { reduced_chi_square, gross_errors } => write!(
                f,
                "nothing stands out but gross errors in {gross_errors} readings or rates: the rest of the residual is the record's noise (reduced chi-square {reduced_chi_square:.3} with them)"
            ),
            ResidualFinding::Boundary { reduced_chi_square, boundary_chi_square } => write!(
                f,
                "of the reduced chi-square of {reduced_chi_square:.3}, {boundary_chi_square:.3} is expected from the uncertainty of the estimated boundary"
            ),
            ResidualFinding::FilmSwitched(switches) => {
                write!(f, "{switches}: was a fan switched? The prediction takes this into account")
            }
            ResidualFinding::Largest { residual_rad_per_s, time_s } => write!(
                f,
                "the largest error is {:.4} °/h at {time_s:.1} s",
                deg_per_h_from_rad_per_s(*residual_rad_per_s)
            ),
        }
    }
}

/// The whole χ² may exceed 1 by this, besides chance: what an estimated course and a discretised pack leave.
const TOLERATED_EXCESS: f64 = 0.15;
/// A part's χ² a row may exceed 1 by this, besides chance.
const TOLERATED_PART_EXCESS: f64 = 0.35;
/// Standard errors that count as chance.
const CHANCE: f64 = 5.0;
/// A correlation whose square is below this share explains nothing worth telling, however certain it is.
const TOLD_SHARE: f64 = 0.03;
/// A part is named where it holds this many times its share of the rows.
const CONCENTRATION: f64 = 1.25;
/// Dependences that are named at most: the rest follows from the strongest.
const MOST_DEPENDENCES: usize = 3;

fn stands_out(part: &RecordPart) -> bool {
    let chance = CHANCE * (2.0 / part.rows as f64).sqrt();
    part.chi_square_per_row > 1.0 + TOLERATED_PART_EXCESS + chance
}

/// The parts that stand out and hold more than their rows, the largest share first.
fn concentrated(parts: &[RecordPart]) -> Vec<&RecordPart> {
    let holds_more = |p: &RecordPart| p.share_of_squared_error > CONCENTRATION * p.share_of_rows;
    let mut found: Vec<&RecordPart> = parts.iter().filter(|p| stands_out(p) && holds_more(p)).collect();
    sort_descending(&mut found, |item| item.share_of_squared_error);
    found
}

pub(super) fn judge(found: &Comparison, transient_s: f64) -> (Adequacy, Vec<ResidualFinding>) {
    let mut findings = Vec::new();
    let rows = found.rows as f64;
    if found.whitened_chi_square > 1.0 + TOLERATED_EXCESS + 3.0 * (2.0 / rows).sqrt() {
        findings.push(ResidualFinding::Excess { whitened_chi_square: found.whitened_chi_square });
    }
    for part in concentrated(&found.regimes) {
        if let Some(regime) = Regime::ALL.into_iter().find(|r| r.key() == part.name) {
            let (share, share_of_rows) = (part.share_of_squared_error, part.share_of_rows);
            findings.push(ResidualFinding::Regime { regime, share, share_of_rows, transient_s });
        }
    }
    let follows = |value: f64| {
        let explained = value * value;
        explained > TOLD_SHARE && explained * rows * found.reduced_chi_square > CHANCE * CHANCE
    };
    let mut followed: Vec<(&Covariate, f64)> =
        found.correlations.iter().filter_map(|c| Some((&c.with, c.value?))).filter(|(_, v)| follows(*v)).collect();
    sort_descending(&mut followed, |item| item.1.abs());
    for (quantity, correlation) in followed.into_iter().take(MOST_DEPENDENCES) {
        findings.push(ResidualFinding::Follows { quantity: quantity.clone(), correlation });
    }
    if let Some(part) = concentrated(&found.temperature_bands).first() {
        let (band, share, share_of_rows) = (part.name.clone(), part.share_of_squared_error, part.share_of_rows);
        findings.push(ResidualFinding::TemperatureBand { band, share, share_of_rows });
    }
    if let Some(part) = concentrated(&found.rate_bands).first() {
        let (band, share, share_of_rows) = (part.name.clone(), part.share_of_squared_error, part.share_of_rows);
        findings.push(ResidualFinding::RateBand { band, share, share_of_rows });
    }
    let verdict = match &found.standing {
        Some(standing) if standing.adequate => Adequacy::Adequate,
        Some(standing) => {
            if standing.wanders {
                findings.push(ResidualFinding::Wanders);
            }
            findings.extend(standing.wanted.map(|gain| ResidualFinding::Wanted { gain }));
            Adequacy::Missing
        }
        None if findings.is_empty() => Adequacy::Adequate,
        None => Adequacy::Missing,
    };
    if verdict == Adequacy::Adequate {
        findings.clear();
    }
    let lag_one = found.autocorrelation.get(1).copied().unwrap_or(0.0);
    if verdict == Adequacy::Adequate {
        let Comparison { reduced_chi_square, gross_errors, .. } = *found;
        findings.push(ResidualFinding::NothingStandsOut { reduced_chi_square, gross_errors });
    } else if lag_one.abs() > found.autocorrelation_band {
        findings.push(ResidualFinding::Coloured { lag_one, band: found.autocorrelation_band });
    }
    findings.push(ResidualFinding::Boundary {
        reduced_chi_square: found.reduced_chi_square,
        boundary_chi_square: found.boundary_chi_square,
    });
    findings.extend(found.film_switches.clone().map(ResidualFinding::FilmSwitched));
    let largest = found.largest;
    findings.push(ResidualFinding::Largest { residual_rad_per_s: largest.residual_rad_per_s, time_s: largest.time_s });
    (verdict, findings)
}
