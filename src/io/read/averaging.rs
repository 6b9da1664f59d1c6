//! Several rows averaged into one, of a record that is held and of one that passes by.

use crate::numeric::statistics::median;
use crate::record::{RecordRow, usual_interval_s};

use super::record_columns::{ColumnQuantity, RecordColumn};

/// Of `rows` rows each; the stamp is that of the last, since a rate's mean ends at its stamp.
pub(super) fn average(columns: &[RecordColumn], values: Vec<Vec<f64>>, rows: usize) -> Vec<Vec<f64>> {
    if rows <= 1 {
        return values;
    }
    let mean = |chunk: &[f64]| chunk.iter().sum::<f64>() / chunk.len() as f64;
    let Some(times) =
        columns.iter().position(|c| c.quantity == ColumnQuantity::Time).map(|place| values[place].clone())
    else {
        return values;
    };
    let steps: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
    let usual_s = median(&steps);
    let is_whole = |from: usize| is_whole(times[from + rows - 1] - times[from], rows, usual_s);
    let starts: Vec<usize> = (0..times.len() / rows).map(|i| i * rows).filter(|from| is_whole(*from)).collect();
    let reduced = |column: &RecordColumn, values: &[f64]| -> Vec<f64> {
        let last = column.quantity == ColumnQuantity::Time;
        starts.iter().map(|f| if last { values[f + rows - 1] } else { mean(&values[*f..f + rows]) }).collect()
    };
    columns.iter().zip(&values).map(|(column, values)| reduced(column, values)).collect()
}

/// A mean across a gap is a mean over another time: it is left out.
fn is_whole(span_s: f64, rows: usize, usual_s: f64) -> bool {
    span_s < (rows as f64 - 0.5) * usual_s
}

/// What became of the rows, in words; nothing where none were averaged.
pub(super) fn remark(rows: usize, before: usize, after: usize) -> Option<String> {
    let left_out = before.saturating_sub(after * rows);
    let rest = if left_out > 0 {
        format!(", {left_out} left out (a gap among them, or too few at the end)")
    } else {
        String::new()
    };
    (rows > 1).then(|| format!("{before} rows averaged into {after}, {rows} each{rest}"))
}

/// Averages rows as they pass by.
#[derive(Debug)]
pub(super) struct Averager {
    rows: usize,
    /// Of the first rows that came.
    usual_s: Option<f64>,
    /// Fewer than are averaged into one.
    held: Vec<RecordRow>,
    means: Vec<RecordRow>,
    made: usize,
}

impl Averager {
    pub(super) fn new(rows: usize) -> Self {
        Self { rows: rows.max(1), usual_s: None, held: Vec::new(), means: Vec::new(), made: 0 }
    }

    /// How many means there were.
    pub(super) fn made(&self) -> usize {
        self.made
    }

    /// The means that these rows complete; the rows themselves where nothing is averaged.
    pub(super) fn averaged<'r>(&'r mut self, chunk: &'r [RecordRow]) -> &'r [RecordRow] {
        if self.rows == 1 {
            return chunk;
        }
        let usual = || usual_interval_s(&chunk.iter().map(|row| row.time_s).collect::<Vec<_>>());
        let usual_s = *self.usual_s.get_or_insert_with(usual);
        self.means.clear();
        for row in chunk {
            self.held.push(*row);
            if self.held.len() == self.rows {
                let (first, last) = (self.held[0], *row);
                if is_whole(last.time_s - first.time_s, self.rows, usual_s) {
                    let mean = |of: fn(&RecordRow) -> f64| self.held.iter().map(of).sum::<f64>() / self.rows as f64;
                    self.means.push(RecordRow {
                        time_s: last.time_s,
                        temperature_k: mean(|r| r.temperature_k),
                        rate_rad_per_s: mean(|r| r.rate_rad_per_s),
                        table_rad_per_s: last.table_rad_per_s.map(|_| mean(|r| r.table_rad_per_s.unwrap_or(0.0))),
                    });
                }
                self.held.clear();
            }
        }
        self.made += self.means.len();
        &self.means
    }
}
