//! Pictures of the pack's temperatures and of their rates.

use super::plot::{Axis, Chart, ChartSeries};
use crate::io::json::temperatures::TemperaturesJson;
use crate::units::min_from_s;

/// More lines than this cannot be told apart.
const LINES: usize = 6;

/// The temperature of some layers, and of the ambient.
pub(crate) fn temperature_chart(body: &TemperaturesJson) -> Chart {
    let ambient = body.times_s.iter().zip(&body.ambient_c).map(|(t, v)| (min_from_s(*t), *v)).collect();
    layers(body, &body.temperatures_c, "Layer temperatures", "temperature [°C]")
        .with(ChartSeries::dashed("ambient or drive", ambient))
}

/// The rate of some layers.
pub(crate) fn rate_chart(body: &TemperaturesJson) -> Chart {
    layers(body, &body.rates_c_per_h, "Rates of the layers' temperatures", "rate [°C/h]")
}

fn layers(body: &TemperaturesJson, rows: &[Vec<f64>], what: &str, unit: &str) -> Chart {
    let count = rows.first().map_or(0, Vec::len);
    let lines = LINES.min(count);
    let mut chart = Chart::new(format!("{what}: {}, {}", body.model, body.drive))
        .x(Axis::linear("time [min]"))
        .y(Axis::linear(unit));
    for line in 0..lines {
        let layer = if lines > 1 { line * (count - 1) / (lines - 1) } else { 0 };
        let points = body.times_s.iter().zip(rows).map(|(t, row)| (min_from_s(*t), row[layer])).collect();
        let place = match layer {
            0 => " (spool)",
            l if l + 1 == count => " (outermost)",
            _ => "",
        };
        chart = chart.with(ChartSeries::line(format!("layer {}{place}", layer + 1), points));
    }
    chart
}
