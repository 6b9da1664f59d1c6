//! The grid that a sensor's readings lie on: its step, and readings in a row that are one value of it.

/// Thermometers whose readings lie on the sensor's grid: itself and that at the bore.
pub(super) const GRIDDED: usize = 2;

/// Of each value how many in a row are equal to it, itself included; 1 where there is none.
pub(super) fn run_lengths(values: &[f64]) -> Vec<f64> {
    let runs = values.chunk_by(|a, b| a == b);
    runs.flat_map(|run| std::iter::repeat_n(run.len() as f64, run.len())).collect()
}

/// Readings lie on a grid where of the differences of neighbouring values this share are multiples of the smallest …
const ON_GRID: f64 = 0.9;
/// … within this share of it: a logger's last digit.
const OFF_GRID: f64 = 0.1;

/// The step of the grid that readings lie on; 0 where they lie on none.
pub(super) fn resolution(readings: &[f64]) -> f64 {
    let mut sorted: Vec<f64> = readings.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let apart: Vec<f64> = sorted.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 1e-7).collect();
    let least = apart.iter().copied().fold(f64::INFINITY, f64::min);
    let is_multiple = |d: &&f64| (*d / least - (*d / least).round()).abs() < OFF_GRID;
    let multiples = apart.iter().filter(is_multiple).count();
    if multiples > 0 && multiples as f64 >= ON_GRID * apart.len() as f64 { least } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_is_found_where_readings_lie_on_one_and_nowhere_else() {
        let course: Vec<f64> =
            (0..400).map(|k| 20.0 * (0.013 * f64::from(k)).sin() + (2.7 * f64::from(k)).sin()).collect();
        assert_eq!(resolution(&course), 0.0);
        assert_eq!(resolution(&[20.0; 5]), 0.0);
        for step in [0.001, 0.0625, 0.1] {
            let rounded: Vec<f64> = course.iter().map(|v| 273.15 + (v / step).round() * step).collect();
            assert!((resolution(&rounded) - step).abs() < 1e-9, "{} for {step}", resolution(&rounded));
        }
        // A third of a tenth, with four digits in the file.
        let written = course.iter().map(|v| 1e-4 * (1e4 * (v * 30.0).round() / 30.0).round()).collect::<Vec<_>>();
        assert!((resolution(&written) - 0.0333).abs() < 2e-4, "{}", resolution(&written));
    }
}
