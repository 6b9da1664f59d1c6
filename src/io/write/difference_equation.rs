//! The physical compensator for an embedded target: coefficients as JSON and as a C header that needs nothing else.

use super::formulas_in_c::FormulasInC;
use super::header_template::filled;
use serde::Serialize;

use crate::compensate::filter::{FORGOTTEN_ROWS, Filter, FilterGains, LEAST_LOG_WEIGHT};
use crate::compensate::physical::Physical;
use crate::text::sink::CComment;
use crate::units::deg_per_h_from_rad_per_s;

/// The physical compensator as a difference equation: °C in, °/h out.
#[derive(Debug, Serialize)]
pub struct DifferenceEquation {
    pub(crate) model: String,
    pub(crate) equations: Vec<&'static str>,
    pub(crate) interval_s: f64,
    /// The rate error that comes out belongs to the row so many rows ago.
    pub(crate) delay_rows: usize,
    pub(crate) offset_deg_per_h: f64,
    /// F, row by row.
    pub(crate) transition: Vec<Vec<f64>>,
    /// ω [°/h per °C].
    pub(crate) rate: Vec<f64>,
    /// h.
    pub(crate) reading: Vec<f64>,
    /// States that are temperatures, counted from the first reading; all start at 0.
    pub(crate) level_states: Vec<usize>,
    /// 1: one difference equation, whose gains are the only ones.
    pub(crate) most_hypotheses: usize,
    pub(crate) break_probability: f64,
    pub(crate) least_log_weight: f64,
    /// After so many rows without a reading the next one begins anew.
    pub(crate) forgotten_rows: usize,
    /// By rows since the last break; the last ones are for long ago.
    pub(crate) gains: Vec<GainsJson>,
    /// What is added to the rate error by the model's formulas [°/h], with the values of their parameters in their place.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) formulas: Vec<String>,
    #[serde(skip)]
    formulas_in_c: Option<FormulasInC>,
}

/// Gains of one age.
#[derive(Debug, Serialize)]
pub(crate) struct GainsJson {
    /// k.
    pub(crate) gain: Vec<f64>,
    /// κ [°/h per °C].
    pub(crate) chain_gain: Vec<f64>,
    /// f [°C²].
    pub(crate) variance: f64,
}

impl GainsJson {
    fn new(gains: &FilterGains, states: usize) -> Self {
        let (gain, chain) = gains.gain.split_at(states);
        Self { gain: gain.to_vec(), chain_gain: shown(chain), variance: gains.variance }
    }
}

fn shown(values: &[f64]) -> Vec<f64> {
    values.iter().map(|v| deg_per_h_from_rad_per_s(*v)).collect()
}

const PLAIN: [&str; 4] = [
    "x = F x_before; o[0] = rate . x_before; o[j] = o_before[j-1]",
    "e = temperature_c - first_reading - reading . x",
    "x = x + gain e; o[j] = o[j] + chain_gain[j] e (without a reading: neither)",
    "rate error of the row delay_rows ago = o[delay_rows] + offset; first reading: x = 0, o = 0",
];
const BRANCHES: [&str; 4] = [
    "each hypothesis of age a branches: a + 1 with l += ln(1 - break_probability), 0 with l += ln(break_probability)",
    "each branch with the gains of its age: l += -ln(variance)/2 - e^2/(2 variance)",
    "kept, from the largest l on: one of each age, at most most_hypotheses, none below the largest + least_log_weight",
    "o[delay_rows] is the mean over the hypotheses, weighted by exp(l)",
];

impl DifferenceEquation {
    /// None where the model has a bias over temperature or reads further columns, which is no difference equation.
    pub fn new(model: &str, physical: &Physical, interval_s: f64, delay_rows: usize) -> Option<Self> {
        if !physical.is_linear() {
            return None;
        }
        let Filter { transition, rate, reading, level_states, most_hypotheses, break_probability, gains, .. } =
            physical.filter(interval_s, delay_rows);
        let states = rate.len();
        let mut equations = PLAIN.to_vec();
        if most_hypotheses > 1 {
            equations.extend(BRANCHES);
        }
        let formulas_in_c = physical
            .formulas(interval_s)
            .map(|(formulas, work)| FormulasInC::new(formulas, &work, physical.rate_mean_s()));
        Some(Self {
            formulas: formulas_in_c.as_ref().map_or_else(Vec::new, |f| f.stated.clone()),
            formulas_in_c,
            model: model.to_owned(),
            equations,
            interval_s,
            delay_rows,
            offset_deg_per_h: deg_per_h_from_rad_per_s(physical.offset_rad_per_s),
            transition: transition.chunks(states).map(<[f64]>::to_vec).collect(),
            rate: shown(&rate),
            reading,
            level_states,
            most_hypotheses,
            break_probability,
            least_log_weight: LEAST_LOG_WEIGHT,
            forgotten_rows: FORGOTTEN_ROWS,
            gains: gains.iter().map(|g| GainsJson::new(g, states)).collect(),
        })
    }

    /// The same as a C header that needs nothing but the C library's exp.
    pub fn c_header(&self) -> String {
        let list = |values: &[f64]| values.iter().map(|v| format!("{v:.17e}")).collect::<Vec<_>>().join(", ");
        let rows: Vec<String> = self.transition.iter().map(|row| format!("  {{{}}}", list(row))).collect();
        let gains: Vec<String> =
            self.gains.iter().map(|g| format!("  {{{}, {}}}", list(&g.gain), list(&g.chain_gain))).collect();
        let variances: Vec<f64> = self.gains.iter().map(|g| g.variance).collect();
        let factors: Vec<f64> = variances.iter().map(|v| -0.5 * v.ln()).collect();
        let header = filled(
            HEADER,
            &[
                ("name", CComment::of(&self.model).into_string()),
                ("interval", self.interval_s.to_string()),
                ("delay", self.delay_rows.to_string()),
                ("states", self.rate.len().to_string()),
                ("ages", self.gains.len().to_string()),
                ("hypotheses", self.most_hypotheses.to_string()),
                ("forgotten", self.forgotten_rows.to_string()),
                ("transition", rows.join(",\n")),
                ("rate", list(&self.rate)),
                ("reading", list(&self.reading)),
                ("gains", gains.join(",\n")),
                ("variances", list(&variances)),
                ("factors", list(&factors)),
                ("offset", format!("{:.17e}", self.offset_deg_per_h)),
                ("no_break", format!("{:.17e}", (-self.break_probability).ln_1p())),
                ("break", format!("{:.17e}", self.break_probability.ln())),
                ("least", format!("{:.17e}", self.least_log_weight)),
            ],
        );
        match &self.formulas_in_c {
            Some(formulas) => formulas.added_to(&header),
            None => header,
        }
    }
}

const HEADER: &str = include_str!("difference_equation.h");
