//! Gross outliers of a series: single values that do not belong to their neighbours.

/// Replaces values that lie further than `threshold` from the median of the five around them by that median.
///
/// Returns the indices of what was replaced. A step or a ramp stays: a median of five moves with them.
pub fn despike(values: &mut [f64], threshold: f64) -> Vec<usize> {
    let original = values.to_vec();
    let mut replaced = Vec::new();
    for (i, value) in values.iter_mut().enumerate() {
        let from = i.saturating_sub(2).min(original.len().saturating_sub(5));
        let mut around = original[from..(from + 5).min(original.len())].to_vec();
        around.sort_by(f64::total_cmp);
        let median = around[around.len() / 2];
        // At both ends the median is that of values to one side: a ramp of two steps is no spike.
        let spread = around[around.len() - 2] - around[1.min(around.len() - 1)];
        if (*value - median).abs() > threshold + spread.abs() {
            *value = median;
            replaced.push(i);
        }
    }
    replaced
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spike_goes_and_ramps_steps_and_ends_stay() {
        let mut values: Vec<f64> = (0..40).map(|i| if i < 20 { i as f64 } else { 100.0 }).collect();
        values[7] = -400.0;
        assert_eq!(despike(&mut values, 3.0), [7]);
        assert!((5.0..=9.0).contains(&values[7]));
        assert_eq!((values[0], values[19], values[20], values[39]), (0.0, 19.0, 100.0, 100.0));
    }
}
