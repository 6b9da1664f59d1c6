//! What a diagnosis proposes beyond the catalogue, in words and as a part of the page.

use maud::{Markup, html};

use super::page::figure;
use super::plot::{Axis, Chart, ChartSeries};
use crate::io::json::diagnosis::DiagnosisJson;
use crate::io::json::proposals::{ProposalJson, TermJson, TermParameterJson};
use crate::units::percent_from_fraction;

/// A parameter with its error.
fn parameter_in_words(key: &str, parameter: &TermParameterJson) -> String {
    let error = parameter.standard_error.map_or_else(String::new, |e| format!(" ± {e:.1e}"));
    format!("{key} = {:.4e}{error} {}", parameter.value, parameter.unit)
}

/// A proposal, a line a statement.
pub(crate) fn proposal_in_words(proposal: &ProposalJson) -> Vec<String> {
    let mut lines = vec![format!(
        "proposed: rate error = {} [°/h], {:.1} % of the posterior",
        proposal.formula,
        percent_from_fraction(proposal.probability)
    )];
    for term in &proposal.terms {
        lines.push(format!("  {} ({})", term.text, term.form));
        lines.extend(term.parameters.iter().map(|(key, p)| format!("    {}", parameter_in_words(key, p))));
        lines.push(format!("    looks like {}", term.reading));
    }
    lines.push(match &proposal.only_describes {
        None => "  predicts: it held on records that it was not fitted to".to_owned(),
        Some(why) => format!("  only describes these records: {why}"),
    });
    lines.push(format!("  {}", proposal.advice));
    for other in proposal.alternatives.iter().take(ALTERNATIVES_SHOWN) {
        let share = percent_from_fraction(other.probability);
        lines.push(format!("  nearly as well: {} ({share:.1} %)", other.formula));
    }
    lines.extend(proposal.experiment.iter().map(|e| format!("  {e}")));
    lines
}

/// Alternatives that are listed.
const ALTERNATIVES_SHOWN: usize = 6;

/// What is left against a term's variable: points, the fitted curve, and its band of two standard errors.
pub(crate) fn term_chart(term: &TermJson) -> Option<Chart> {
    let first = term.shown.first()?;
    let amplitude = term.parameters.get("a");
    let share = amplitude.and_then(|a| Some(2.0 * a.standard_error? / a.value.abs())).unwrap_or(0.0);
    let mut chart = Chart::new(format!("What is left, against {}", first.variable))
        .size(860, 380)
        .x(Axis::linear(first.variable.clone()))
        .y(Axis::linear("measured − all but this term [°/h]"));
    for shown in &term.shown {
        let points = shown.x.iter().copied().zip(shown.left_deg_per_h.iter().copied()).collect();
        chart = chart.with(ChartSeries::points(shown.record.clone(), points));
    }
    // In the order of time: what remembers draws a loop.
    let curve = |factor: f64| -> Vec<(f64, f64)> {
        first.x.iter().copied().zip(first.term_deg_per_h.iter().map(|v| factor * v)).collect()
    };
    Some(
        chart
            .with(ChartSeries::line("the term, fitted", curve(1.0)))
            .with(ChartSeries::dashed("± 2 standard errors", curve(1.0 + share)))
            .with(ChartSeries::dashed("", curve(1.0 - share))),
    )
}

/// The proposals of a diagnosis.
pub(super) fn section(body: &DiagnosisJson) -> Markup {
    html! {
        @for proposal in &body.proposals {
            h2 { "Proposed, beyond the catalogue" }
            p.big { "rate error = " (proposal.formula) " [°/h]" }
            @for term in &proposal.terms {
                p { (term.text) ": it looks like " (term.reading) "." }
                ul { @for (key, parameter) in &term.parameters { li { (parameter_in_words(key, parameter)) } } }
                @if let Some(chart) = term_chart(term) {
                    (figure(&chart.svg_to_read(), "What is left of the records without this term, averaged over a few rows, against the variable it depends on; the line is the term as fitted on the first record, in the order of time, so that what remembers draws a loop."))
                }
            }
            ul { @for line in proposal_in_words(proposal).iter().skip_while(|l| !l.starts_with("  predicts") && !l.starts_with("  only")) { li { (line.trim()) } } }
        }
    }
}
