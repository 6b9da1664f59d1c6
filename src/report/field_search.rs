//! The page of a search under temperatures from elsewhere.

use std::path::Path;

use maud::{Markup, html};

use super::cross_section::cross_section;
use super::page::{figure, page};
use super::plot::{Axis, Chart, ChartSeries, Mark};
use super::search_run::{ReportError, all, certificate, convergence, on_a_readable_scale};
use super::words;
use crate::io::read::run_reader::{Run, RunField};
use crate::io::write::field_rates::FieldRates;
use crate::pattern::Pattern;
use crate::units::{min_from_s, mm_from_m};

/// `rates` are what patterns err by under each of the files.
///
/// # Errors
/// A summary that holds a pattern which is none.
pub(crate) fn field_page(run: &Run, rates: &[FieldRates]) -> Result<String, ReportError> {
    let summary = &run.summary;
    let best = Pattern::new(summary.best.segments.clone())?;
    let qua = summary.baselines.iter().find(|p| p.name == "qua" && p.segments != summary.best.segments);
    let title = format!("Winding pattern for {} under given temperatures", summary.model);
    let body = html! {
        h1 { (title) }
        p.big { (summary.statement) }
        (figure(&bars(run), "Largest size of the rate error over all rows of all temperature files, and the quadrupole's as a line."))
        (facts(run))
        h2 { "Temperatures" }
        (fields(run))
        h2 { "Patterns compared" }
        (patterns(run))
        p { "Nothing is said of other temperatures: no profile stands behind these files, so there is no guaranteed worst case." }
        (words::of_windings())
        h2 { "Cross-sections" }
        div.pair {
            (figure(&cross_section(&format!("{}: {:.4} °/h", summary.best.name, summary.best.worst_rate_deg_per_h), &best), "The best pattern found."))
            @if let Some(qua) = qua {
                (figure(&cross_section(&format!("qua: {:.4} °/h", qua.worst_rate_deg_per_h), &Pattern::new(qua.segments.clone())?), "The quadrupole."))
            }
        }
        h2 { "Rate error over time" }
        div.two { @for (field, rates) in summary.fields.iter().zip(rates) {
            @let (svg, scale) = over_time(field, rates);
            (figure(&svg, &format!("Every pattern in every row of {}.{scale}", name(field))))
            (figure(&temperatures(field, rates), "The innermost, the middle and the outermost layer."))
        } }
        h2 { "How the search went" }
        (figure(&convergence(run), &format!("Best value known after so many judged moves; {} rounds, ended by: {}.", summary.rounds, summary.stopped_by)))
        (certificate(run))
        h2 { "Inputs" }
        details { summary { "run.toml" } pre { (run.run_toml) } }
        details { summary { "model.toml" } pre { (run.file.source) } }
    };
    Ok(page(&title, &body))
}

/// A file without its folders.
fn name(field: &RunField) -> String {
    Path::new(&field.file).file_name().map_or_else(|| field.file.clone(), |name| name.to_string_lossy().into_owned())
}

fn bars(run: &Run) -> String {
    let values: Vec<f64> = all(run).map(|pattern| pattern.worst_rate_deg_per_h).collect();
    let mut chart = Chart::new("Worst rate error of each pattern")
        .size(860, 240)
        .x(Axis::linear("worst |rate error| [°/h]").reaching(0.0))
        .categories(all(run).map(|pattern| pattern.name.clone()))
        .with(ChartSeries::bars("over the given temperatures", &values));
    if let Some(qua) = run.summary.baselines.iter().find(|pattern| pattern.name == "qua") {
        chart = chart.mark(Mark::vertical("QUA", qua.worst_rate_deg_per_h));
    }
    chart.svg_to_read()
}

fn facts(run: &Run) -> Markup {
    let (summary, coil) = (&run.summary, &run.file.model.coil);
    let (length_m, diameter_mm) = (coil.length_m(), mm_from_m(coil.mean_diameter_m()));
    let segments: Vec<String> = summary.best.segments.iter().map(ToString::to_string).collect();
    let gain = summary.improvement_over_qua.map_or_else(
        || "no quadrupole fits this layer count".to_owned(),
        |gain| format!("{gain:.3} (QUA's value over the best pattern's)"),
    );
    let worst = &summary.best;
    let rows = [
        ("Coil", format!("{} layers, {length_m:.1} m of fibre, mean diameter {diameter_mm:.1} mm", coil.layers())),
        ("Objective", format!("{}, winding class {}", summary.objective, summary.windability)),
        ("Best pattern, innermost layer first", segments.join(" ")),
        (
            "Worst rate error",
            format!(
                "{:.4} °/h under {} at {:.1} s",
                worst.worst_rate_deg_per_h, worst.worst_profile, worst.worst_time_s
            ),
        ),
        ("Better than QUA by", gain),
        ("Seed, moves judged", format!("{}, {}", summary.seed, summary.evaluations)),
    ];
    html! { dl.facts { @for (name, value) in rows { dt { (name) } dd { (value) } } } }
}

fn fields(run: &Run) -> Markup {
    html! { div.scroll { table {
        thead { tr {
            th.word { "File" } th { "Rows" } th { "From [min]" } th { "To [min]" } th.word { "Rates of temperature" } th.word { "SHA-256" }
        } }
        tbody { @for field in &run.summary.fields { tr {
            td.word { (name(field)) }
            td { (field.rows) }
            td { (format!("{:.2}", min_from_s(field.from_s))) }
            td { (format!("{:.2}", min_from_s(field.to_s))) }
            td.word { (field.rates) }
            td.word { code { (field.sha256.as_deref().unwrap_or("a pipe")) } }
        } } }
    } } }
}

fn patterns(run: &Run) -> Markup {
    let qua = run.summary.baselines.iter().find(|p| p.name == "qua").map(|p| p.worst_rate_deg_per_h);
    html! { div.scroll { table {
        thead { tr {
            th.word { "Pattern" } th { "Worst [°/h]" } th { "Relative to QUA" } th.word { "Worst field" } th { "At [s]" }
            th.word { "Class" } th { "Reels" } th { "Largest climb [layers]" }
        } }
        tbody { @for pattern in all(run) { tr.best[pattern.name == run.summary.best.name] {
            td.word { (pattern.name) }
            td { (format!("{:.4}", pattern.worst_rate_deg_per_h)) }
            td { (qua.filter(|q| *q > 0.0).map_or("–".to_owned(), |q| format!("{:.3}", pattern.worst_rate_deg_per_h / q))) }
            td.word { (pattern.worst_profile) }
            td { (format!("{:.1}", pattern.worst_time_s)) }
            td.word { (pattern.windability.class) }
            td { (pattern.windability.reels) }
            td { (pattern.windability.max_climb) }
        } } }
    } } }
}

fn times_min(rates: &FieldRates) -> Vec<f64> {
    rates.times_s.iter().map(|time_s| min_from_s(*time_s)).collect()
}

/// The chart, and what is to be said of its scale.
fn over_time(field: &RunField, rates: &FieldRates) -> (String, String) {
    let series: Vec<(&str, Vec<f64>)> =
        rates.patterns.iter().map(|pattern| (pattern.name.as_str(), pattern.rates_deg_per_h.clone())).collect();
    let (chart, scale) = on_a_readable_scale(&name(field), &times_min(rates), &series);
    (chart.svg_to_read(), scale)
}

fn temperatures(field: &RunField, rates: &FieldRates) -> String {
    let times_min = times_min(rates);
    let mut chart = Chart::new(format!("Layer temperatures of {}", name(field)))
        .x(Axis::linear("time [min]"))
        .y(Axis::linear("temperature [°C]"));
    for (layer, course) in &rates.layers_c {
        let points = times_min.iter().copied().zip(course.iter().copied()).collect();
        chart = chart.with(ChartSeries::line(format!("layer {layer}"), points));
    }
    chart.svg_to_read()
}
