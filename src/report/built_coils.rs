//! The page of a campaign over built coils: how bad the worst of them are, pattern by pattern.

use maud::{Markup, html};

use super::page::{figure, page};
use super::plot::{Axis, Chart, ChartSeries};
use super::words;
use crate::io::json::built_coils::{BuiltCoilsJson, BuiltPatternJson, QuantileJson};
use crate::io::json::campaign::CampaignJson;

/// Patterns beyond these are in the table only.
const MOST_CURVES: usize = 8;

/// Header and rows, one a model and pattern, in °/h.
pub(crate) fn built_coils_table(models: &[BuiltCoilsJson]) -> (Vec<&'static str>, Vec<Vec<String>>) {
    let header = vec![
        "model",
        "coils",
        "pattern",
        "nominal",
        "median",
        "P95",
        "P99",
        "P99.9",
        "95 % interval",
        "worst",
        "yield",
    ];
    let mut rows = Vec::new();
    for model in models {
        for pattern in &model.patterns {
            let mut row = vec![
                model.model.clone(),
                model.samples.to_string(),
                pattern.name.clone(),
                format!("{:.4}", pattern.nominal_deg_per_h),
            ];
            row.extend(pattern.quantiles.iter().map(|q| format!("{:.4}", q.value_deg_per_h)));
            row.push(pattern.quantiles.last().map(interval).unwrap_or_default());
            row.push(format!("{:.4}", pattern.largest_deg_per_h));
            // One coil more or less is seen, and nothing finer.
            let decimals = ((model.samples.max(1) as f64).log10().ceil() - 2.0).max(0.0) as usize;
            row.push(pattern.yield_share.map_or_else(|| "–".to_owned(), |y| format!("{:.decimals$} %", 100.0 * y)));
            rows.push(row);
        }
    }
    (header, rows)
}

/// Too few coils leave an end of it open.
fn interval(quantile: &QuantileJson) -> String {
    match (quantile.low_deg_per_h, quantile.high_deg_per_h) {
        (Some(low), Some(high)) => format!("{low:.4} to {high:.4}"),
        (Some(low), None) => format!("at least {low:.4}"),
        (None, Some(high)) => format!("at most {high:.4}"),
        (None, None) => "unknown".to_owned(),
    }
}

/// Of each model the pattern whose P99.9 is least, in a sentence.
fn recommendation(model: &BuiltCoilsJson) -> Option<String> {
    let last = |pattern: &&BuiltPatternJson| pattern.quantiles.last().map_or(f64::INFINITY, |q| q.value_deg_per_h);
    let least = model.patterns.iter().min_by(|a, b| last(a).total_cmp(&last(b)))?;
    let own = least.quantiles.last()?;
    // Patterns are judged on the same coils, so overlapping intervals still order them; who does not overlap does so for any coils.
    let as_good: Vec<&str> = model
        .patterns
        .iter()
        .filter(|p| p.name != least.name)
        .filter(|p| p.quantiles.last().and_then(|q| q.low_deg_per_h).is_some_and(|low| own.high_deg_per_h >= Some(low)))
        .map(|p| p.name.as_str())
        .collect();
    let mut words = format!(
        "{}: of {} coils wound as {} one in a thousand is worse than {:.4} °/h ({} with 95 %)",
        model.model,
        model.samples,
        least.name,
        own.value_deg_per_h,
        interval(own)
    );
    if !as_good.is_empty() {
        words += &format!("; within that interval so are {}", as_good.join(", "));
    }
    Some(words + ".")
}

/// How many coils are worse than what, one curve a pattern.
fn chart(model: &BuiltCoilsJson) -> String {
    let mut chart = Chart::new(format!("{}: coils that are worse", model.model))
        .size(860, 320)
        .x(Axis::linear("worst case [°/h]"))
        .y(Axis::log("share of the coils"));
    for pattern in model.patterns.iter().take(MOST_CURVES) {
        let points = pattern.exceeded.iter().map(|(share, worst)| (*worst, *share)).collect();
        chart = chart.with(ChartSeries::line(&pattern.name, points));
    }
    chart.svg_to_read()
}

/// The whole page.
pub(crate) fn built_coils_page(answer: &CampaignJson) -> String {
    let models = &answer.built_coils;
    let (header, rows) = built_coils_table(models);
    let body = html! {
        h1 { (answer.campaign) }
        @for sentence in models.iter().filter_map(recommendation) { p.big { (sentence) } }
        @if models.is_empty() { p.big { "No block has a result." } }
        @for model in models {
            (figure(&chart(model), "The share of coils whose worst case is larger: the further to the left and the steeper, the better."))
        }
        (asked(answer))
        div.scroll { table {
            thead { tr { @for (place, name) in header.iter().enumerate() { @if is_word(place) { th.word { (name) } } @else { th { (name) } } } } }
            @for row in &rows { tr { @for (place, cell) in row.iter().enumerate() { @if is_word(place) { td.word { (cell) } } @else { td { (cell) } } } } }
        } }
        @if models.iter().flat_map(|m| &m.patterns).flat_map(|p| &p.quantiles).any(|q| q.high_deg_per_h.is_none()) {
            p { "An interval that says only \u{201c}at least\u{201d} has no upper end, because too few coils were drawn: state more samples." }
        }
        p { "All patterns of a model were judged on the same coils. P99 and P99.9 are exact; median and P95 are read from counts, off by at most a thousandth. "
            "The interval holds the quantile of all coils that could be built with 95 %, whatever their distribution." }
        (words::of_windings())
        h2 { "What failed" }
        @if answer.failed.is_empty() { p { "Nothing: every block has a result." } } @else {
            p { (answer.failed.len()) " of " (answer.cells.len()) " blocks have no result; their files in cells/ say why: " (answer.failed.join(", ")) }
        }
    };
    page(&answer.campaign, &body)
}

fn is_word(place: usize) -> bool {
    place == 0 || place == 2
}

fn asked(answer: &CampaignJson) -> Markup {
    let of = |model: &BuiltCoilsJson| {
        let limit = model.limit_deg_per_h.map_or_else(String::new, |limit| format!(", limit {limit} °/h"));
        format!(
            "{} of {} layers: {} coils, seed {}, {} worst case{limit}",
            model.model, model.layers, model.samples, model.seed, model.measure
        )
    };
    html! {
        dl.facts {
            @for model in &answer.built_coils { dt { "drawn" } dd { (of(model)) } }
            dt { "blocks" } dd { (answer.cells.len()) }
            dt { "program" } dd { (concat!("coilwright ", env!("CARGO_PKG_VERSION"))) }
        }
    }
}
