//! What compensators leave of a rate, as a picture.

use super::plot::{Axis, Chart, ChartSeries};
use crate::units::{deg_per_h_from_rad_per_s, h_from_s};

/// Points of a curve: means over as many rows as it takes.
const MOST_POINTS: usize = 1500;

/// One curve a method, in means, so that they can be told apart.
pub(crate) fn compensation_chart(title: &str, times_s: &[f64], curves: &[(&str, Vec<f64>)]) -> Chart {
    let rows = times_s.len().div_ceil(MOST_POINTS).max(1);
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let chart = Chart::new(title).size(860, 460).x(Axis::linear("time [h]")).y(Axis::linear(if rows > 1 {
        format!("rate, means over {rows} rows [°/h]")
    } else {
        "rate [°/h]".to_owned()
    }));
    curves.iter().fold(chart, |chart, (name, rates)| {
        let points = times_s
            .chunks(rows)
            .zip(rates.chunks(rows))
            .map(|(t, r)| (h_from_s(mean(t)), deg_per_h_from_rad_per_s(mean(r))))
            .collect();
        chart.with(ChartSeries::line(*name, points))
    })
}
