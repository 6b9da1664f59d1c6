//! The compensators that know no coil for an embedded target: coefficients as JSON and as a C header that needs nothing else.

use serde::Serialize;

use super::header_template::filled;
use crate::compensate::Compensator;
use crate::compensate::empirical::{BiasLine, PiecewiseBias, Regression};
use crate::compensate::learned::{LONGEST_GAP, LearnedCoefficients};
use crate::metrics::thermal::{COLUMNS, SLOPES, USUAL_K, WARM_UPS, lags_s};
use crate::text::sink::CComment;
use crate::units::{celsius_from_kelvin, deg_per_h_from_rad_per_s};

/// An empirical compensator: °C in, °/h out.
#[derive(Debug, Serialize)]
pub struct EmpiricalExport {
    pub(crate) model: String,
    /// "piecewise", "regression" or "learned".
    pub method: &'static str,
    pub(crate) equations: Vec<&'static str>,
    pub(crate) interval_s: f64,
    /// The rate error that comes out belongs to the row so many rows ago.
    pub delay_rows: usize,
    #[serde(flatten)]
    pub(crate) coefficients: Coefficients,
}

#[derive(Debug, Serialize)]
#[serde(untagged)]
pub(crate) enum Coefficients {
    Piecewise {
        lines: Vec<LineJson>,
    },
    Regression {
        offset_deg_per_h: f64,
        per_temperature_deg_per_h_per_k: f64,
        per_rate_deg_per_h_s_per_k: f64,
        /// Of the outer less the inner temperature; null where the inner one is not read.
        per_difference_rate_deg_per_h_s_per_k: Option<f64>,
    },
    Learned {
        offset_deg_per_h: f64,
        /// Of the columns, in the order of `equations`.
        columns_deg_per_h: Vec<f64>,
        lags_s: Vec<f64>,
        /// After so long without a reading the next one begins anew.
        forgotten_s: f64,
    },
}

/// One straight piece.
#[derive(Debug, Serialize)]
pub(crate) struct LineJson {
    /// Null for the last.
    pub(crate) until_c: Option<f64>,
    pub(crate) at_20_c_deg_per_h: f64,
    pub(crate) slope_deg_per_h_per_c: f64,
}

const PIECEWISE: [&str; 1] =
    ["rate error = at_20_c + slope (temperature_c - 20) of the first line with temperature_c < until_c"];
const REGRESSION: [&str; 2] = [
    "rate error of the row delay_rows ago = offset + per_temperature (temperature_c - 20) + per_rate dT/dt [+ per_difference_rate d(T - T_inner)/dt]",
    "dT/dt: slope of the straight line through the delay_rows rows to each side of that row; a missing reading is the one before",
];
const LEARNED: [&str; 4] = [
    "x_k = T + (x_k - T) exp(-step/lags_s[k]), from the first temperature T_0 on; u = (T - T_0)/50",
    "v_1 = x_2 - x_4, v_2 = x_4 - x_6 (k from 0)",
    "columns: T - T_0; T - x_0; x_k - x_(k+1) for k = 0 ... 8; u^2; u^3; u^4; |v|, v |v|, u v for v_1, v_2; exp(-t/lags_s[k]) for k = 3, 5, 6, 8",
    "rate error = offset + sum of columns_deg_per_h times columns; a missing reading repeats the rate error before",
];

impl EmpiricalExport {
    /// None of the physical compensator.
    pub fn new(model: &str, compensator: &Compensator, interval_s: f64) -> Option<Self> {
        let shown = deg_per_h_from_rad_per_s;
        let (equations, delay_rows, coefficients): (&[&'static str], usize, Coefficients) = match compensator {
            Compensator::Physical(_) => return None,
            Compensator::Piecewise(PiecewiseBias { lines }) => {
                let line = |line: &BiasLine| LineJson {
                    until_c: line.until_k.is_finite().then(|| celsius_from_kelvin(line.until_k)),
                    at_20_c_deg_per_h: shown(line.at_reference_rad_per_s),
                    slope_deg_per_h_per_c: shown(line.slope_rad_per_s_k),
                };
                (&PIECEWISE, 0, Coefficients::Piecewise { lines: lines.iter().map(line).collect() })
            }
            Compensator::Regression(Regression { coefficients, has_inner, .. }) => {
                let [offset, temperature, rate, difference] = coefficients.map(shown);
                let coefficients = Coefficients::Regression {
                    offset_deg_per_h: offset,
                    per_temperature_deg_per_h_per_k: temperature,
                    per_rate_deg_per_h_s_per_k: rate,
                    per_difference_rate_deg_per_h_s_per_k: has_inner.then_some(difference),
                };
                (&REGRESSION, compensator.delay_rows(interval_s), coefficients)
            }
            Compensator::Learned(LearnedCoefficients { coefficients, interval_s: of_record_s, .. }) => {
                let (offset, columns) = coefficients.split_first()?;
                let coefficients = Coefficients::Learned {
                    offset_deg_per_h: shown(*offset),
                    columns_deg_per_h: columns.iter().map(|c| shown(*c)).collect(),
                    lags_s: lags_s(*of_record_s).to_vec(),
                    forgotten_s: LONGEST_GAP * of_record_s,
                };
                (&LEARNED, 0, coefficients)
            }
        };
        Some(Self {
            model: model.to_owned(),
            method: compensator.method().key(),
            equations: equations.to_vec(),
            interval_s,
            delay_rows,
            coefficients,
        })
    }

    /// Whether a step takes the inner temperature too.
    pub fn reads_inner(&self) -> bool {
        matches!(self.coefficients, Coefficients::Regression { per_difference_rate_deg_per_h_s_per_k: Some(_), .. })
    }

    /// The same as a C header.
    pub fn c_header(&self) -> String {
        let number = |v: f64| format!("{v:.17e}");
        let list = |values: &[f64]| values.iter().map(|v| number(*v)).collect::<Vec<_>>().join(", ");
        let mut values = vec![
            ("name", CComment::of(&self.model).into_string()),
            ("method", self.method.to_owned()),
            ("interval", number(self.interval_s)),
            ("seconds", self.interval_s.to_string()),
            ("delay", self.delay_rows.to_string()),
        ];
        let body = match &self.coefficients {
            Coefficients::Piecewise { lines } => {
                let column = |of: fn(&LineJson) -> f64| list(&lines.iter().map(of).collect::<Vec<_>>());
                values.extend([
                    ("lines", lines.len().to_string()),
                    // The last line goes on to any temperature: its end is not looked at.
                    ("until", column(|l| l.until_c.unwrap_or(0.0))),
                    ("at", column(|l| l.at_20_c_deg_per_h)),
                    ("slope", column(|l| l.slope_deg_per_h_per_c)),
                ]);
                PIECEWISE_H
            }
            Coefficients::Regression {
                offset_deg_per_h,
                per_temperature_deg_per_h_per_k,
                per_rate_deg_per_h_s_per_k,
                per_difference_rate_deg_per_h_s_per_k,
            } => {
                values.extend([
                    ("offset", number(*offset_deg_per_h)),
                    ("per_temperature", number(*per_temperature_deg_per_h_per_k)),
                    ("per_rate", number(*per_rate_deg_per_h_s_per_k)),
                    ("per_difference", number(per_difference_rate_deg_per_h_s_per_k.unwrap_or(0.0))),
                    ("inner", if self.reads_inner() { "double inner_c, " } else { "" }.to_owned()),
                    ("difference", if self.reads_inner() { "temperature_c - inner_c" } else { "0.0" }.to_owned()),
                ]);
                REGRESSION_H
            }
            Coefficients::Learned { offset_deg_per_h, columns_deg_per_h, lags_s, forgotten_s } => {
                let indices = |all: &[usize]| all.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
                let (short, long): (Vec<usize>, Vec<usize>) = SLOPES.iter().copied().unzip();
                values.extend([
                    ("offset", number(*offset_deg_per_h)),
                    ("columns", COLUMNS.to_string()),
                    ("coefficients", list(columns_deg_per_h)),
                    ("lag_count", lags_s.len().to_string()),
                    ("lags", list(lags_s)),
                    ("forgotten", number(*forgotten_s)),
                    ("usual", number(USUAL_K)),
                    ("slope_count", SLOPES.len().to_string()),
                    ("short", indices(&short)),
                    ("long", indices(&long)),
                    ("warm_count", WARM_UPS.len().to_string()),
                    ("warm", indices(&WARM_UPS)),
                ]);
                LEARNED_H
            }
        };
        filled(&format!("{HEAD_H}{body}\n#endif\n"), &values)
    }
}

const HEAD_H: &str = include_str!("empirical_head.h");
const PIECEWISE_H: &str = include_str!("piecewise.h");
const REGRESSION_H: &str = include_str!("regression.h");
const LEARNED_H: &str = include_str!("learned.h");
