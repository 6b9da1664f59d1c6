//! The page of a fleet: what its gyros have in common, what is single, and each gyro's own numbers.

use maud::{Markup, html};

use super::page::{figure, page};
use super::plot::{Axis, Chart, ChartSeries, Mark};
use crate::io::json::campaign::GyroJson;
use crate::io::json::fleet::{FleetEffectJson, FleetJson, GyroValueJson, MeasureJson, four_digits};

/// More gyros than these do not fit one picture; the table has them all.
const MOST_DRAWN: usize = 60;

/// The whole page.
pub(crate) fn fleet_page(name: &str, fleet: &FleetJson, gyros: &[GyroJson]) -> String {
    let (common, others): (Vec<&String>, Vec<&String>) =
        fleet.sentences.iter().partition(|s| s.starts_with("common: "));
    let failed: Vec<&GyroJson> = gyros.iter().filter(|gyro| gyro.failure.is_some()).collect();
    let mut figures = figures(fleet);
    let first = fleet.sentences.first().map_or("", String::as_str);
    let lead = figures.iter().position(|f| first.contains(&f.about)).unwrap_or(0);
    let lead = (!figures.is_empty()).then(|| figures.remove(lead));
    let said = |sentence: &str| readable(sentence, &fleet.measures);
    let body = html! {
        h1 { (name) }
        p.big { (said(&verdict(fleet.sentences.first(), failed.len(), gyros.len()))) }
        @if let Some(lead) = &lead { (lead.markup) }
        dl.facts {
            dt { "gyros" } dd { (gyros.len()) ", " (fleet.gyros) " of them with a result" }
            dt { "asked" } dd { (fleet.kind) }
            dt { "program" } dd { (concat!("coilwright ", env!("CARGO_PKG_VERSION"))) }
        }
        h2 { "What the batch has in common" }
        @for sentence in &common { p { (said(sentence.trim_start_matches("common: "))) } }
        @if common.is_empty() { p { "Nothing that was looked for." } }
        h2 { "What is single" }
        @for sentence in &others { p { (said(sentence.trim_start_matches("single: "))) } }
        @if others.is_empty() { p { "Nothing: no gyro stands apart." } }
        @if !fleet.effects.is_empty() { (effects(&fleet.effects, fleet.gyros)) }
        @if !fleet.verdicts.is_empty() { (verdicts(fleet)) }
        @if !fleet.measures.is_empty() { (measures(&fleet.measures)) }
        @if !figures.is_empty() { h2 { "Gyro by gyro" } }
        @for figure in &figures { (figure.markup) }
        h2 { "What failed" }
        @if failed.is_empty() { p { "Nothing: every gyro has a result." } } @else {
            div.scroll { table {
                tr { th.word { "gyro" } th.word { "why" } }
                @for gyro in failed { tr { td.word { (gyro.gyro) } td.word { (gyro.failure.as_deref().unwrap_or_default()) } } }
            } }
        }
    };
    page(name, &body)
}

/// A picture, and what a sentence about it holds.
struct Figure {
    about: String,
    markup: Markup,
}

fn figures(fleet: &FleetJson) -> Vec<Figure> {
    let mut found = Vec::new();
    if let Some(first) = fleet.effects.first() {
        let counts =
            |of: fn(&FleetEffectJson) -> usize| fleet.effects.iter().map(|e| of(e) as f64).collect::<Vec<f64>>();
        let chart = Chart::new("In how many gyros each effect was found")
            .size(860, 240)
            .x(Axis::whole(format!("gyros of {}", fleet.gyros)).reaching(fleet.gyros as f64))
            .categories(fleet.effects.iter().map(|e| e.kind.clone()))
            .with(ChartSeries::bars("found", &counts(|e| e.found_in.len())))
            .with(ChartSeries::bars("explains as well what was found", &counts(|e| e.equivalent_in.len())));
        let caption = "What at least half of the gyros have is common to the batch.";
        found.push(Figure { about: first.kind.clone(), markup: figure(&chart.svg_to_read(), caption) });
    }
    for effect in &fleet.effects {
        for p in effect.parameters.iter().filter(|p| p.values.len() > 1) {
            let title = format!("{} of {}", p.parameter, effect.kind);
            let svg = values(&title, &p.unit, p.mean, &p.values);
            found.push(Figure {
                about: effect.kind.clone(),
                markup: figure(&svg, "Each gyro; the line is the batch's mean."),
            });
        }
    }
    if let Some(curve) = &fleet.thermal_curve {
        let points = curve.points.iter().map(|p| (p.temperature_c, p.bias_deg_per_h)).collect();
        let chart = Chart::new("The batch's bias over temperature")
            .size(860, 240)
            .x(Axis::linear("temperature [°C]"))
            .y(Axis::linear("about each gyro's own mean [°/h]"))
            .with(ChartSeries::points("batch", points));
        let share = 100.0 * curve.common_share;
        let caption = format!(
            "Means over the gyros. The curve of the others takes {share:.0} % of a gyro's own thermal mean square away."
        );
        found
            .push(Figure { about: "bias over temperature".to_owned(), markup: figure(&chart.svg_to_read(), &caption) });
    }
    for m in &fleet.measures {
        let svg = values(&name_of(m), &m.unit, m.median, &m.values);
        found.push(Figure { about: m.key.clone(), markup: figure(&svg, "Each gyro; the line is the batch's median.") });
    }
    found
}

/// A measure's key without its unit, in words.
fn name_of(measure: &MeasureJson) -> String {
    let key = measure.key.as_str();
    let name = ["_deg", "_arcsec"].into_iter().filter_map(|unit| key.find(unit)).min().map_or(key, |at| &key[..at]);
    name.replace('_', " ")
}

/// A sentence with names in the place of keys.
fn readable(sentence: &str, measures: &[MeasureJson]) -> String {
    measures.iter().fold(sentence.to_owned(), |said, m| said.replace(&m.key, &name_of(m)))
}

/// What the batch shows first, in a sentence.
fn verdict(first: Option<&String>, failed: usize, gyros: usize) -> String {
    match first {
        Some(sentence) => sentence.trim_start_matches("common: ").trim_start_matches("single: ").to_owned(),
        None if failed > 0 => format!("Nothing in common was found; {failed} of {gyros} gyros have no result."),
        None => {
            "Nothing stands out: no gyro stands apart, and nothing that was looked for is common to all.".to_owned()
        }
    }
}

fn effects(effects: &[FleetEffectJson], gyros: usize) -> Markup {
    html! {
        h2 { "Effects" }
        div.scroll { table {
            tr { th.word { "effect" } th { "found in" } th { "as an equal explanation in" } th.word { "parameters over the gyros that have it" } }
            @for effect in effects { tr {
                td.word { (effect.kind) }
                td { (effect.found_in.len()) " of " (gyros) }
                td { (effect.equivalent_in.len()) }
                td.word { @for p in &effect.parameters {
                    (p.in_words()) br;
                } }
            } }
        } }
    }
}

fn verdicts(fleet: &FleetJson) -> Markup {
    html! {
        h2 { "Each gyro" }
        div.scroll { table {
            tr { th.word { "gyro" } th.word { "verdict" } th.word { "effects" } th { "noise floor °/h" } }
            @for v in &fleet.verdicts { tr {
                td.word { (v.gyro) } td.word { (v.verdict) } td.word { (v.effects.join(", ")) } td { (format!("{:.4}", v.noise_floor_deg_per_h)) }
            } }
        } }
    }
}

fn measures(measures: &[MeasureJson]) -> Markup {
    html! {
        h2 { "Data sheets" }
        div.scroll { table {
            tr { th.word { "measure" } th { "median" } th { "from gyro to gyro" } th { "gyros" } th { "common share" } th.word { "single" } }
            @for m in measures { tr {
                td.word { (name_of(m)) } td { (four_digits(m.median)) " " (m.unit) }
                td { (spread(m)) } td { (m.values.len()) }
                td { (m.common_share.map_or_else(|| "–".to_owned(), |share| format!("{:.0} %", 100.0 * share))) }
                td.word { (m.values.iter().filter(|v| v.single).map(|v| v.gyro.as_str()).collect::<Vec<_>>().join(", ")) }
            } }
        } }
    }
}

fn spread(measure: &MeasureJson) -> String {
    if measure.spread_is_factor {
        format!("a factor of {:.3}", measure.spread)
    } else {
        format!("± {} {}", four_digits(measure.spread), measure.unit)
    }
}

/// One lying bar a gyro, those that stand apart in a colour of their own.
fn values(title: &str, unit: &str, usual: f64, values: &[GyroValueJson]) -> String {
    let drawn = &values[..values.len().min(MOST_DRAWN)];
    let of = |single: bool| -> Vec<f64> {
        drawn.iter().map(|v| if v.single == single { v.value } else { f64::NAN }).collect()
    };
    let mut chart = Chart::new(title.to_owned())
        .size(860, 240)
        .x(Axis::linear(if unit == "1" { title.to_owned() } else { format!("{title} [{unit}]") }))
        .categories(drawn.iter().map(|v| v.gyro.clone()))
        .with(ChartSeries::bars("as the batch", &of(false)))
        .mark(Mark::vertical("batch", usual));
    if drawn.iter().any(|v| v.single) {
        chart = chart.with(ChartSeries::bars("apart", &of(true)));
    }
    chart.svg_to_read()
}
