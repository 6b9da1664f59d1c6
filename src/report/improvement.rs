//! The page of `improve`: what to wind next, why, and what to look for.

use maud::html;
use serde_json::Value;

use super::page::{figure, page};
use super::plot::{Axis, Chart, ChartSeries};
use super::proposal::proposal_in_words;
use super::words;
use crate::io::json::improve::{ImproveJson, PredictedRow};
use crate::units::min_from_s;

/// Points drawn of a record, at most.
const MOST_POINTS: usize = 1000;

/// One page that opens offline; the folders beside it hold the steps' own pages.
pub(crate) fn improvement_page(body: &ImproveJson, rows: &[PredictedRow]) -> String {
    let words = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let content = html! {
        h1 { "The next winding of " (body.model) }
        p.big { (words(&body.recommendation["sentence"])) }
        (figure(&predicted_chart(rows), "What the new coil should show: the first record as it should be with the new winding; 95 % of the rows lie between the dashed lines."))
        ul { @for reason in list(&body.recommendation["reasons"]) { li { (words(&reason)) } } }
        h2 { "What the records said" }
        p { "Verdict: " (words(&body.verdict)) "." }
        ul { @for effect in list(&body.effects) {
            li { b { (words(&effect["kind"])) } ": " (words(&effect["happens"])) " " (words(&effect["remedy"])) }
        } }
        @for proposal in &body.proposals { ul {
            @for line in proposal_in_words(proposal) { li { (line) } }
        } }
        @if let Some(film) = body.film_w_per_m2_k {
            p { "The air reached the coil through a film of " (format!("{film:.2}")) " W/(m²K); the search was run behind it." }
        }
        p { (words(&body.measured_pattern_under_new_model["statement"])) }
        p { (body.predicted_gain.words()) "." }
        h2 { "The next experiment" }
        p { (words(&body.suggested_experiment)) }
        (words::of_windings())
        h2 { "Step by step" }
        ul {
            @for step in &body.steps { li {
                (step.step) ": "
                @if let Some(file) = page_of(&step.step) {
                    a href=(format!("{}/{file}", step.step)) { (step.folder) }
                } @else { code { (step.folder) } }
            } }
        }
    };
    page(&format!("The next winding of {}", body.model), &content)
}

/// The page in a step's folder, which is beside this one and has the step's name.
fn page_of(step: &str) -> Option<&'static str> {
    match step {
        "before" | "after" | "diagnosis" | "search" => Some(REPORT),
        "schedule" => Some(TRAVELLER),
        _ => None,
    }
}

const REPORT: &str = "report.html";
const TRAVELLER: &str = "traveller.html";

fn predicted_chart(rows: &[PredictedRow]) -> String {
    let stride = rows.len().div_ceil(MOST_POINTS).max(1);
    let line = |of: fn(&PredictedRow) -> f64| -> Vec<(f64, f64)> {
        rows.iter().step_by(stride).map(|row| (min_from_s(row.time_s), of(row))).collect()
    };
    Chart::new("Predicted record")
        .size(860, 320)
        .x(Axis::linear("time [min]"))
        .y(Axis::linear("rate [°/h]"))
        .with(ChartSeries::line("predicted", line(|row| row.rate_deg_per_h)))
        .with(ChartSeries::dashed("lower", line(|row| row.low_deg_per_h)))
        .with(ChartSeries::dashed("upper", line(|row| row.high_deg_per_h)))
        .svg_to_read()
}
