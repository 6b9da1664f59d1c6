//! The samples of a proof as a table, for other solvers.

use crate::search::proof::rows::SampleRow;
use crate::units::deg_per_h_from_rad_per_s;

/// One sample a line: the constant and a coefficient a layer [°/h], so that Ω = constant + Σ_j a_j (2 P(j) − 1 − N).
///
/// `None` where Ω is not of that form: lengths that differ, halves that respond differently, axial moments.
pub(crate) fn print_samples(rows: &[SampleRow], lengths_m: &[f64]) -> Option<String> {
    let length_m = lengths_m[0];
    let is_zero = |values: &[f64]| values.iter().all(|v| *v == 0.0);
    let linear = lengths_m.iter().all(|l| *l == length_m);
    if !linear || rows.iter().any(|row| !is_zero(&row.difference) || !is_zero(&row.axial)) {
        return None;
    }
    let head = (1..=lengths_m.len()).map(|layer| format!(",layer_{layer}")).collect::<String>();
    let mut table = format!("constant{head}\n");
    for row in rows {
        table.push_str(&deg_per_h_from_rad_per_s(row.constant).to_string());
        for mean in &row.mean {
            table.push_str(&format!(",{}", deg_per_h_from_rad_per_s(mean * length_m * length_m)));
        }
        table.push('\n');
    }
    Some(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_has_a_line_a_sample_and_is_refused_where_the_error_is_not_linear_in_the_segments() {
        let zero = vec![0.0; 2];
        let row = SampleRow { constant: 0.0, mean: vec![0.0, 1.0], difference: zero.clone(), axial: zero };
        let one = deg_per_h_from_rad_per_s(4.0);
        let expected = format!("constant,layer_1,layer_2\n0,0,{one}\n");
        assert_eq!(print_samples(std::slice::from_ref(&row), &[2.0, 2.0]), Some(expected));
        assert_eq!(print_samples(std::slice::from_ref(&row), &[2.0, 2.5]), None);
        assert_eq!(print_samples(&[SampleRow { difference: vec![0.1, 0.0], ..row }], &[2.0, 2.0]), None);
    }
}
