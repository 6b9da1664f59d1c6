//! What a page's script is told of a chart: enough to show values under the pointer and to draw it again, zoomed, on another
//! scale, or as differences.

use plotters::style::RGBColor;
use serde_json::{Value, json};

use super::layout::{ChartLayout, FINE, colour};
use super::{Along, Chart, ChartSeries, Shape};
use crate::text::sink::JsonText;

/// A line has at most so many points in the data: first, lowest, highest and last of a quarter as many stretches.
const MOST_POINTS: usize = 2000;
/// Significant digits of a number in the data: more than a screen has pixels.
const DIGITS: usize = 6;

fn shape(of: Shape) -> &'static str {
    match of {
        Shape::Line => "line",
        Shape::Dashed => "dashed",
        Shape::Points => "points",
        Shape::Step => "step",
        Shape::Histogram => "columns",
        Shape::Bars => "bars",
        Shape::Cells => "cells",
    }
}

/// A number as short as it may be; what is none is a gap.
fn number(value: f64) -> Value {
    let short = format!("{value:.*e}", DIGITS - 1).parse::<f64>().unwrap_or(value);
    if short.is_finite() && short == short.trunc() && short.abs() < 1e9 { json!(short as i64) } else { json!(short) }
}

fn hex(index: usize) -> String {
    let RGBColor(red, green, blue) = colour(index);
    format!("#{red:02X}{green:02X}{blue:02X}")
}

/// What the eye would see of so many points on a wide screen.
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    if points.len() <= MOST_POINTS {
        return points.to_vec();
    }
    let stretch = (4 * points.len()).div_ceil(MOST_POINTS);
    let mut kept = Vec::with_capacity(MOST_POINTS);
    for part in points.chunks(stretch) {
        let by_y = |a: &usize, b: &usize| part[*a].1.total_cmp(&part[*b].1);
        let mut of_part = vec![0, part.len() - 1];
        of_part.extend((0..part.len()).min_by(by_y));
        of_part.extend((0..part.len()).max_by(by_y));
        of_part.sort_unstable();
        of_part.dedup();
        kept.extend(of_part.into_iter().map(|i| part[i]));
    }
    kept
}

fn series(index: usize, series: &ChartSeries) -> Value {
    let is_line = matches!(series.shape, Shape::Line | Shape::Step | Shape::Dashed);
    let points = if is_line { thinned(&series.points) } else { series.points.clone() };
    let numbers = |of: &[f64]| of.iter().copied().map(number).collect::<Vec<Value>>();
    json!({
        "name": series.name,
        "colour": hex(index),
        "shape": shape(series.shape),
        "x": points.iter().map(|p| number(p.0)).collect::<Vec<Value>>(),
        "y": points.iter().map(|p| number(p.1)).collect::<Vec<Value>>(),
        "labels": series.labels,
        "errors": numbers(&series.errors),
        "values": numbers(&series.values),
        "cell": [series.cell.0, series.cell.1],
    })
}

/// An attribute with the chart's data, in the picture's own units where it says where something is.
pub(super) fn attribute(chart: &Chart, layout: &ChartLayout) -> String {
    let along = |of: Along| if of == Along::X { "x" } else { "y" };
    let frame = [layout.left, layout.top, layout.right, layout.bottom].map(|px| px * FINE);
    let plot = json!({
        "frame": frame,
        "x": { "label": chart.x.label, "low": layout.x.low, "high": layout.x.high, "log": chart.x.is_log(), "floor": null },
        "y": { "label": chart.y.label, "low": layout.y.low, "high": layout.y.high, "log": chart.y.is_log(), "floor": chart.y.floor() },
        "categories": chart.categories,
        "series": chart.series.iter().enumerate().map(|(i, s)| series(i, s)).collect::<Vec<Value>>(),
        "marks": chart.marks.iter().map(|m| json!({ "along": along(m.along), "value": m.value, "label": m.label })).collect::<Vec<Value>>(),
        "bands": chart.bands.iter().map(|b| json!({
            "along": along(b.along), "from": b.from, "to": b.to, "label": b.label, "colour": hex(chart.hue_of(b)),
        })).collect::<Vec<Value>>(),
    });
    format!(" data-plot='{}'", JsonText::embedded(&plot.to_string()))
}
