//! The model's formulas as C behind the difference equation's header: the same arithmetic, the same memory.

use nalgebra::DMatrix;

use super::header_template::filled;
use crate::compensate::formulas::{AtWork, Formulas};
use crate::effect::Subject;
use crate::effect::custom::OfLayer;

/// What the header needs of them.
#[derive(Debug)]
pub(super) struct FormulasInC {
    /// With numbers in the place of parameters.
    pub(crate) stated: Vec<String>,
    expressions: Vec<String>,
    memories: usize,
    columns: usize,
    temperatures: Vec<String>,
    rates: Vec<String>,
    shares: Vec<f64>,
    air: (usize, usize),
    rate_mean_s: f64,
}

fn list(values: impl Iterator<Item = f64>) -> String {
    values.map(|v| format!("{v:.17e}")).collect::<Vec<_>>().join(", ")
}

fn rows(of: &DMatrix<f64>) -> Vec<String> {
    of.row_iter().map(|row| format!("  {{{}}}", list(row.iter().copied()))).collect()
}

impl FormulasInC {
    pub(crate) fn new(formulas: &Formulas, work: &AtWork, rate_mean_s: f64) -> Self {
        let (mut stated, mut expressions, mut memories) = (Vec::new(), Vec::new(), 0);
        let layers = work.shares().len();
        for effect in formulas.effects() {
            let Subject::Formula(formula) = effect.subject() else { continue };
            let expression = formula.expression();
            let names: Vec<&str> = expression.variables().iter().map(|v| v.name.as_str()).collect();
            let value = |index: usize| {
                let name = names[index];
                if let Some(place) = formula.parameters().iter().position(|p| p == name) {
                    return format!("({:?})", effect.values()[place]);
                }
                if let Some(of) = OfLayer::named(name) {
                    return match of {
                        OfLayer::Temperature(layer) => format!("p->temperature[{layer}]"),
                        OfLayer::Rate(layer) => format!("p->rate[{layer}]"),
                    };
                }
                match name {
                    "t" => "p->time_s".to_owned(),
                    "T" => format!("p->temperature[{}]", layers - 1),
                    "dT_dt" => format!("p->rate[{}]", layers - 1),
                    "T_in" | "T_inner" => "p->temperature[0]".to_owned(),
                    "T_mean" => "p->mean".to_owned(),
                    "mean_rate" => "p->mean_rate".to_owned(),
                    "T_ambient" => "p->air".to_owned(),
                    "dT_ambient_dt" => "p->air_rate".to_owned(),
                    "thermal_rate" => "thermal_rate".to_owned(),
                    column => {
                        let place = formulas.columns().iter().position(|c| c == column).unwrap_or(0);
                        format!("p->column[{place}]")
                    }
                }
            };
            // Memories of one formula follow those of the formulas before.
            let offset = memories;
            let text = expression.in_c("coilwright", &value);
            let text = (0..expression.memories()).rev().fold(text, |text, slot| {
                let (from, to) = (format!("_coilwright(m, {slot}, "), format!("_coilwright(m, {}, ", slot + offset));
                if offset == 0 { text } else { text.replace(&from, &to) }
            });
            memories += expression.memories();
            expressions.push(text);
            stated.push(expression.with_values(&|name| {
                formula.parameters().iter().position(|p| p == name).map(|place| effect.values()[place])
            }));
        }
        let (temperatures, rates) = work.rows();
        Self {
            stated,
            expressions,
            memories,
            columns: formulas.columns().len(),
            temperatures: rows(temperatures),
            rates: rows(rates),
            shares: work.shares(),
            air: work.air(),
            rate_mean_s,
        }
    }

    /// The header with the formulas before its last line.
    pub(crate) fn added_to(&self, header: &str) -> String {
        let sum = self.expressions.iter().map(|e| format!("  sum += {e};")).collect::<Vec<_>>().join("\n");
        let block = filled(
            BLOCK,
            &[
                ("layers", self.shares.len().to_string()),
                ("memories", self.memories.max(1).to_string()),
                ("columns", self.columns.max(1).to_string()),
                ("temperatures", self.temperatures.join(",\n")),
                ("rates", self.rates.join(",\n")),
                ("shares", list(self.shares.iter().copied())),
                ("air", self.air.0.to_string()),
                ("slope", self.air.1.to_string()),
                ("sum", sum),
                ("mean", format!("{:?}", self.rate_mean_s)),
            ],
        );
        match header.rfind("#endif") {
            Some(end) => format!("{}{block}\n{}", &header[..end], &header[end..]),
            None => header.to_owned() + &block,
        }
    }
}

const BLOCK: &str = include_str!("formulas.h");
