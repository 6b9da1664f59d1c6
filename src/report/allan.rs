//! The Allan deviation as a picture, and a gyro's measures as a part of a page.

use maud::{Markup, html};

use super::page::figure;
use super::plot::{Axis, Chart, ChartSeries};
use crate::io::json::metrics::{AllanNoiseJson, MetricsJson, RecordMetricsJson};

/// Points of a noise's straight line; two would do, but parts of it are cut away.
const LINE_POINTS: usize = 200;
/// Lines are drawn while they are within this factor of the curve's own range.
const MARGIN: f64 = 1.6;

/// Log-log, with error bars, and with the lines of the noises that were found in it.
pub(crate) fn allan_chart(record: &RecordMetricsJson) -> Chart {
    let points: Vec<(f64, f64)> = record.allan.iter().map(|p| (p.tau_s, p.deviation_deg_per_h)).collect();
    let errors = record.allan.iter().map(|p| p.standard_error_deg_per_h).collect();
    let mut chart = Chart::new(format!("Allan deviation of {}", record.file))
        .size(860, 460)
        .x(Axis::log("averaging time τ [s]"))
        .y(Axis::log("Allan deviation σ(τ) [°/h]"))
        .with(ChartSeries::points("measured, ± one standard error", points).with_errors(errors));
    for noise in &record.allan_noises {
        // What a data sheet calls the bias instability is the curve's minimum, another number.
        let kind = if noise.slope == 0.0 { "flicker" } else { noise.noise.as_str() };
        let name = format!("{kind} {} {} (slope {})", digits(noise.value), noise.unit, slope(noise.slope));
        chart = chart.with(ChartSeries::dashed(name, line(record, noise)));
    }
    if let (Some(tau_s), Some(deviation)) = (record.bias_instability_tau_s, record.bias_instability_deg_per_h) {
        let name = format!("minimum {} °/h at {tau_s:.0} s", digits(deviation));
        chart = chart.with(ChartSeries::points(name, vec![(tau_s, deviation)]));
    }
    chart
}

/// σ = σ(1 s) τ^slope where it is near the curve; a gap elsewhere.
fn line(record: &RecordMetricsJson, noise: &AllanNoiseJson) -> Vec<(f64, f64)> {
    let (Some(first), Some(last)) = (record.allan.first(), record.allan.last()) else { return Vec::new() };
    let curve = || record.allan.iter().map(|p| p.deviation_deg_per_h).filter(|d| *d > 0.0);
    let (low, high) = (curve().fold(f64::INFINITY, f64::min) / MARGIN, curve().fold(0.0, f64::max) * MARGIN);
    (0..LINE_POINTS)
        .map(|i| {
            let share = i as f64 / (LINE_POINTS - 1) as f64;
            let tau_s = first.tau_s * (last.tau_s / first.tau_s).powf(share);
            let deviation = noise.deviation_at_1_s_deg_per_h * tau_s.powf(noise.slope);
            (tau_s, if (low..=high).contains(&deviation) { deviation } else { f64::NAN })
        })
        .collect()
}

/// Three significant digits.
fn digits(value: f64) -> String {
    super::plot::three_digits(value)
}

/// As many as a data sheet states.
fn table_digits(value: f64) -> String {
    super::plot::significant(value, 4)
}

fn slope(value: f64) -> &'static str {
    match value {
        v if v <= -1.0 => "−1",
        v if v < 0.0 => "−½",
        0.0 => "0",
        v if v < 1.0 => "+½",
        _ => "+1",
    }
}

/// The measures of all records as a part of a page.
pub(super) fn section(metrics: &MetricsJson) -> Markup {
    html! {
        h2 { "Measures of the gyro" }
        @if let Some(record) = metrics.records.first() { p.big { (in_a_sentence(record)) } }
        @for record in &metrics.records {
            @if record.allan.is_empty() {
                p { (record.file) ": no stretch without a gap is long enough for an Allan deviation." }
            } @else {
                (figure(&allan_chart(record).svg_to_read(), &caption(record)))
            }
        }
        (measures(metrics))
    }
}

/// What a data sheet would say of a record.
fn in_a_sentence(record: &RecordMetricsJson) -> String {
    let said = [
        record.angle_random_walk_deg_per_sqrt_h.map(|v| format!("angle random walk {} °/√h", digits(v))),
        record.bias_instability_deg_per_h.map(|v| format!("bias instability {} °/h", digits(v))),
        record.temperature_sensitivity_deg_per_h_per_c.map(|v| format!("temperature sensitivity {} °/h/°C", digits(v))),
    ];
    let said: Vec<String> = std::iter::once(format!("bias {} °/h", digits(record.bias_deg_per_h)))
        .chain(said.into_iter().flatten())
        .collect();
    format!("{}: {}.", record.file, said.join(", "))
}

fn caption(record: &RecordMetricsJson) -> String {
    let walk = if record.angle_random_walk_has_slope {
        ""
    } else {
        " White noise may be absent: the angle random walk in the table is an upper bound."
    };
    format!(
        "Overlapping Allan deviation of {} regular rows of {}, with one standard error. Dashed: the noises by maximum likelihood on all octaves at once, without what follows the temperature; flicker of the size B is the flat line at 0.664 B.{walk}",
        record.allan_rows, record.file
    )
}

fn measures(metrics: &MetricsJson) -> Markup {
    type Show = fn(&RecordMetricsJson) -> Option<f64>;
    let stability = format!("Bias stability, means over {} s", metrics.bias_stability_average_s);
    let rows: [(&str, &str, Show); 11] = [
        ("Bias", "°/h", |r| Some(r.bias_deg_per_h)),
        (&stability, "°/h", |r| r.bias_stability_deg_per_h),
        ("Bias instability, minimum of the Allan deviation", "°/h", |r| r.bias_instability_deg_per_h),
        ("at averaging time", "s", |r| r.bias_instability_tau_s),
        ("Angle random walk", "°/√h", |r| r.angle_random_walk_deg_per_sqrt_h),
        ("Rate random walk", "°/h/√h", |r| r.rate_random_walk_deg_per_h_per_sqrt_h),
        ("Flicker", "°/h", |r| r.flicker_deg_per_h),
        ("Quantisation", "arcsec", |r| r.quantisation_arcsec),
        ("Temperature sensitivity", "°/h/°C", |r| r.temperature_sensitivity_deg_per_h_per_c),
        ("Peak to peak", "°/h", |r| Some(r.peak_to_peak_deg_per_h)),
        ("Duration", "s", |r| Some(r.duration_s)),
    ];
    html! {
        div.scroll { table {
            thead { tr { th.word { "Measure" } th.word { "Unit" } @for record in &metrics.records { th { (record.file) } } } }
            tbody {
                @for (name, unit, show) in rows { tr {
                    td.word { (name) } td.word { (unit) }
                    @for record in &metrics.records { td { (show(record).map_or("–".to_owned(), table_digits)) } }
                } }
            }
        } }
        @for record in &metrics.records {
            @if !record.noise.is_empty() { (noises(record)) }
            @for caution in &record.cautions { p { strong { "Caution. " } (record.file) ": " (caution) "." } }
        }
        @if let Some(repeatability) = metrics.repeatability_deg_per_h {
            p { "Repeatability of the bias over " (metrics.records.len()) " records: " (table_digits(repeatability)) " °/h." }
        }
    }
}

fn noises(record: &RecordMetricsJson) -> Markup {
    html! {
        h3 { "Noise of " (record.file) }
        p { "Maximum likelihood on the Haar variances of all octaves; the five intervals hold together with 95 %." }
        div.scroll { table {
            thead { tr { th.word { "Kind" } th { "Value" } th { "From" } th { "To" } th.word { "Unit" } } }
            tbody {
                @for noise in &record.noise { tr {
                    td.word { (noise.kind.replace('_', " ")) }
                    td { (digits(noise.value)) } td { (digits(noise.low)) } td { (digits(noise.high)) }
                    td.word { (noise.unit) }
                } }
            }
        } }
    }
}
