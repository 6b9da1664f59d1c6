//! A diagnosis in words, for the screen and for the page, and its part of the page.

use maud::{Markup, html};

use super::ladder::ladder_chart;
use super::noise::{noise_chart, noise_in_words};
use super::page::figure;
use super::plot::{Axis, Chart, ChartSeries, Mark};
use crate::io::json::diagnosis::{DiagnosisJson, DiagnosisRow, FindingJson, FittedParameterJson, RefittedJson};
use crate::io::json::experiment::ExperimentJson;
use crate::io::json::hypothesis::HypothesisJson;
use crate::units::{h_from_s, min_from_s, percent_from_fraction};

/// Candidates that the page lists.
const CANDIDATES_SHOWN: usize = 12;

/// The verdict as a sentence.
pub(crate) fn verdict_in_words(body: &DiagnosisJson) -> String {
    let kinds = || body.effects.iter().map(|e| e.kind.as_str()).collect::<Vec<_>>().join(" and ");
    match body.verdict.as_str() {
        "adequate" => "adequate — these records show nothing that the model lacks".to_owned(),
        "missing" if body.effects.is_empty() => {
            let wrong = body.refitted.iter().map(|r| format!("{} of {}", r.parameter, r.kind)).collect::<Vec<_>>();
            format!("missing — what the model file states of {} is wrong", wrong.join(" and "))
        }
        "missing" => format!("missing — the model lacks {}", kinds()),
        "indistinguishable" => {
            format!("indistinguishable — {} or an equivalent is missing{}", kinds(), or_wound_otherwise(body))
        }
        _ if body.hypothesis.is_some() => format!("unexplained — {}", hypothesis_in_words(body).join("; ")),
        _ if !body.proposals.is_empty() => {
            let beside = if body.effects.is_empty() { String::new() } else { format!("{} and ", kinds()) };
            let formula = &body.proposals[0].formula;
            format!("unexplained by listed effects alone — {beside}{formula} °/h explain the records")
        }
        _ if body.effects.is_empty() => {
            "unexplained — something is there that no combination of known effects explains".to_owned()
        }
        _ => format!("unexplained — {} explains a part only", kinds()),
    }
}

/// A share of the posterior below which no other winding is mentioned beside effects.
const MENTIONED: f64 = 0.05;

/// The other winding that explains the records as well, if one does.
fn or_wound_otherwise(body: &DiagnosisJson) -> String {
    let wound = body.posterior.iter().filter(|s| s.probability > MENTIONED);
    let winding = wound.filter_map(|s| winding_in_words(s.hypothesis.as_ref()?)).next();
    winding.map(|winding| format!(", or the coil is wound otherwise ({winding})")).unwrap_or_default()
}

/// Another winding, a reversed coil, steps of the offset: a line each.
pub(crate) fn hypothesis_in_words(body: &DiagnosisJson) -> Vec<String> {
    let Some(said) = &body.hypothesis else { return Vec::new() };
    let mut lines = Vec::new();
    match (&said.winding, said.reversed) {
        (Some(winding), false) => lines.push(format!("this record looks like that of a coil wound as {winding}")),
        (Some(winding), true) => {
            lines.push(format!(
                "this record looks like that of a coil wound as {winding} and connected the other way round"
            ));
        }
        (None, true) => lines.push("this record looks like that of a coil connected the other way round".to_owned()),
        (None, false) => {}
    }
    if let Some([a, b]) = said.exchanged_layers {
        lines.push(format!("layers {a} and {b}, counted from the innermost, seem to have changed places in winding"));
    }
    for step in &said.offset_steps {
        lines.push(format!(
            "the offset of {} steps by {:+.4} °/h at {:.0} s",
            step.record, step.size_deg_per_h, step.time_s
        ));
    }
    lines
}

/// Stated numbers that the records contradict: a line each, with the old and the new value.
pub(crate) fn refitted_in_words(body: &DiagnosisJson) -> Vec<String> {
    let line = |r: &RefittedJson| {
        let error = r.standard_error.map_or_else(String::new, |e| format!(" ± {e:.2}"));
        let unit = if r.unit == "1" { String::new() } else { format!(" {}", r.unit) };
        format!(
            "{} of {}: the model file states {:.4}{unit}, the records say {:.4}{error}{unit}",
            r.parameter, r.kind, r.declared, r.value
        )
    };
    body.refitted.iter().map(line).collect()
}

/// The sets that hold the posterior mass, a line each.
pub(crate) fn posterior_in_words(body: &DiagnosisJson) -> Vec<String> {
    let shown = body.posterior.iter().filter(|s| s.probability > 0.005);
    shown
        .map(|s| {
            let name = if s.effects.is_empty() { "the declared model".to_owned() } else { s.effects.join(" + ") };
            let winding =
                s.hypothesis.as_ref().and_then(winding_in_words).map(|w| format!(" ({w})")).unwrap_or_default();
            format!("{:.1} % {name}{winding}", percent_from_fraction(s.probability))
        })
        .collect()
}

/// How a coil was wound instead, in few words.
fn winding_in_words(said: &HypothesisJson) -> Option<String> {
    let exchanged = said.exchanged_layers.map(|[a, b]| format!("layers {a} and {b} exchanged"));
    let winding = said.winding.clone();
    let reversed = said.reversed.then(|| "connected the other way round".to_owned());
    let words: Vec<String> = winding.into_iter().chain(exchanged).chain(reversed).collect();
    (!words.is_empty()).then(|| words.join(", "))
}

/// With its error, and whether a bound holds it.
pub(crate) fn value_in_words(parameter: &FittedParameterJson) -> String {
    let mut text = format!("{:.5e}", parameter.value);
    if let Some(error) = parameter.standard_error {
        text += &format!(" ± {error:.1e}");
    }
    if parameter.unit != "1" {
        text += &format!(" {}", parameter.unit);
    }
    if parameter.at_bound {
        text += " (at its bound)";
    }
    text
}

/// What happens in the coil and what to do about it, an effect a line: those that were accepted and what does as well.
pub(crate) fn explanations(found: &[FindingJson]) -> Vec<(&str, String)> {
    let mut said: Vec<(&str, String)> = Vec::new();
    for effect in found {
        let own = (effect.kind.as_str(), effect.happens.as_str(), effect.remedy.as_str());
        let others =
            effect.equivalents_in_detail.iter().map(|e| (e.kind.as_str(), e.happens.as_str(), e.remedy.as_str()));
        for (kind, happens, remedy) in std::iter::once(own).chain(others) {
            if !happens.is_empty() && !said.iter().any(|(known, _)| *known == kind) {
                said.push((kind, format!("{happens} {remedy}")));
            }
        }
    }
    said
}

/// What is left over, a line a statement; none where everything is explained.
pub(crate) fn rest_in_words(body: &DiagnosisJson) -> Vec<String> {
    let Some(rest) = &body.unexplained else { return Vec::new() };
    let mut first = format!("left over: {:.4} °/h beyond the noise", rest.excess_deg_per_h);
    if let Some(strongest) = rest.correlations.first() {
        first += &format!("; goes with {} (correlation {:+.2})", strongest.with, strongest.correlation);
    }
    let plain = rest.plain.iter().map(|plain| {
        let scale = match (plain.period_s, plain.time_constant_s) {
            (Some(period_s), _) => format!(" of period {period_s:.0} s"),
            (_, Some(time_constant_s)) => format!(" of time constant {time_constant_s:.0} s"),
            _ => String::new(),
        };
        format!("  as a {}{scale}: {:.4} °/h rms", plain.shape, plain.rms_deg_per_h)
    });
    std::iter::once(first).chain(plain).collect()
}

/// A record's residual before and after the accepted effects.
pub(crate) fn before_and_after_chart(title: &str, rows: &[DiagnosisRow], noise_deg_per_h: f64) -> Chart {
    let points = |value: fn(&DiagnosisRow) -> f64| -> Vec<(f64, f64)> {
        rows.iter().map(|row| (min_from_s(row.time_s), value(row))).collect()
    };
    Chart::new(title)
        .size(860, 320)
        .x(Axis::linear("time [min]"))
        .y(Axis::linear("measured − predicted [°/h]"))
        .with(ChartSeries::line("as declared", points(|r| r.residual_declared_deg_per_h)))
        .with(ChartSeries::line("with the effects found", points(|r| r.residual_extended_deg_per_h)))
        .mark(Mark::horizontal("+3 × noise", 3.0 * noise_deg_per_h))
        .mark(Mark::horizontal("", -3.0 * noise_deg_per_h))
}

/// Where the residuals of the `number`-th record go, counted from 1 over fitted records and hold-outs.
pub(crate) fn before_and_after_name(number: usize) -> String {
    format!("before-after-{number}.svg")
}

/// The whole diagnosis as a part of a page.
pub(super) fn section(body: &DiagnosisJson, tables: &[Vec<DiagnosisRow>]) -> Markup {
    html! {
        h2 { "Diagnosis" }
        p.big { (verdict_in_words(body)) }
        @let proof = record_of_proof(body).filter(|_| !body.effects.is_empty() || !body.proposals.is_empty());
        @let ladder = "The error as declared and after each piece of physics that was found, on the records that were fitted and on those that were not. No model can get below the noise floor.";
        @match proof {
            Some(proof) => {
                (before_and_after(body, tables, proof))
                h2 { "Before, after, what changed" }
                (ladder_table(body))
                (figure(&ladder_chart(body).svg_to_read(), ladder))
            }
            None => {
                (figure(&ladder_chart(body).svg_to_read(), ladder))
                h2 { "Before, after, what changed" }
                (ladder_table(body))
            }
        }
        @if !body.effects.is_empty() { h2 { "What is missing" } (effects(&body.effects)) }
        (super::proposal::section(body))
        @if body.unexplained.is_some() {
            h2 { "What is left over" }
            @for line in rest_in_words(body) { p { (line) } }
        }
        @if let Some(proof) = proof {
            @for record in (0..tables.len()).filter(|record| *record != proof) { (before_and_after(body, tables, record)) }
        }
        @if !body.refitted.is_empty() {
            h2 { "Stated numbers that the records contradict" }
            ul { @for line in refitted_in_words(body) { li { (line) } } }
        }
        h2 { "Noise, told apart" }
        (figure(&noise_chart(body).svg_to_read(), "What the rate consists of beside what the coil does, and how much of the air would stay unseen if it were measured otherwise."))
        ul { @for line in noise_in_words(body) { li { (line) } } }
        h2 { "How sure" }
        ul { @for line in posterior_in_words(body) { li { (line) } } }
        @if body.suggested_experiment.is_some() || body.experiment.is_some() { h2 { "Next experiment" } }
        @if let Some(words) = &body.suggested_experiment { p { (words) } }
        @if let Some(found) = &body.experiment { (experiment(found)) }
        h2 { "Candidates" }
        (candidates(body))
        @if !body.cautions.is_empty() { ul { @for caution in &body.cautions { li { (caution) } } } }
    }
}

/// The record on which it shows best what was found: the first that was not fitted, else the first.
fn record_of_proof(body: &DiagnosisJson) -> Option<usize> {
    let records = &body.inputs.records;
    records.iter().position(|r| r.role == "held out").or((!records.is_empty()).then_some(0))
}

fn before_and_after(body: &DiagnosisJson, tables: &[Vec<DiagnosisRow>], record: usize) -> Markup {
    let (Some(of), Some(rows)) = (body.inputs.records.get(record), tables.get(record)) else { return html! {} };
    let noise = if of.role == "held out" { body.holdout_noise_floor_deg_per_h } else { None };
    let title = format!("Residual of {}", of.file);
    let chart = before_and_after_chart(&title, rows, noise.unwrap_or(body.noise_floor_deg_per_h));
    let caption =
        format!("{}, {}: the residual of the declared model and what the effects found leave of it.", of.file, of.role);
    figure(&chart.svg_to_read(), &caption)
}

/// What a step of the ladder put into the model: the effect with its numbers, what happens in the coil and what to do about it.
fn change(body: &DiagnosisJson, added: &[&str]) -> Markup {
    html! { @for kind in added {
        p { b { (kind) }
            @for effect in body.effects.iter().filter(|e| e.kind == *kind) {
                @for (key, parameter) in effect.parameters.iter().filter(|(_, p)| p.fitted) { ", " (key) " = " (value_in_words(parameter)) }
            }
        }
        @for (_, words) in explanations(&body.effects).iter().filter(|(known, _)| known == kind) { p { (words) } }
    } }
}

fn ladder_table(body: &DiagnosisJson) -> Markup {
    let unseen = |value: Option<f64>, digits: usize| value.map_or("–".to_owned(), |v| format!("{v:.digits$}"));
    html! {
        div.scroll { table {
            thead { tr {
                th.word { "Model" } th.word.change { "What changed" } th { "Error, fitted [°/h]" } th { "× noise" } th { "Error, hold-out [°/h]" } th { "× noise" }
                th { "Reduced χ²" } th { "BIC" }
            } }
            tbody { @for (rung, added) in body.ladder.iter().zip(body.steps()) { tr {
                td.word { @if rung.effects.is_empty() { "before: as declared" } @else { "after: with " (rung.effects.join(", ")) } }
                td.word.change { (change(body, &added)) }
                td { (format!("{:.5}", rung.rmse_deg_per_h)) }
                td { (format!("{:.2}", body.multiple_of_noise(rung.rmse_deg_per_h, false))) }
                td { (unseen(rung.holdout_rmse_deg_per_h, 5)) }
                td { (unseen(rung.holdout_rmse_deg_per_h.map(|v| body.multiple_of_noise(v, true)), 2)) }
                td { (format!("{:.3}", rung.reduced_chi_square)) }
                td { (format!("{:.1}", rung.bic)) }
            } } }
        } }
        p {
            "Noise floor: " (format!("{:.5}", body.noise_floor_deg_per_h)) " °/h on the fitted records"
            @if let Some(other) = body.holdout_noise_floor_deg_per_h { ", " (format!("{other:.5}")) " °/h on the hold-out" }
            "."
        }
    }
}

fn effects(found: &[FindingJson]) -> Markup {
    html! {
        div.scroll { table {
            thead { tr {
                th.word { "Effect" } th.word { "Parameter" } th.word { "Value ± standard error" } th { "χ² less" } th { "χ² less, unseen data" }
                th.word { "Does as well" }
            } }
            tbody { @for effect in found {
                @let fitted: Vec<_> = effect.parameters.iter().filter(|(_, p)| p.fitted).collect();
                tr {
                    td.word {
                        (effect.kind)
                        @for (key, option) in &effect.choices { ", " (key) " = " (option) }
                    }
                    td.word { @for (key, _) in &fitted { (key) br; } }
                    td.word { @for (_, parameter) in &fitted { (value_in_words(parameter)) br; } }
                    td { (format!("{:.0}", effect.chi_square_less)) }
                    td { (format!("{:.0}", effect.confirmed_by)) }
                    td.word { @for other in &effect.equivalents_in_detail {
                        (other.kind) " (χ² " (format!("{:+.1}", other.chi_square_more)) ", correlation of the responses " (format!("{:+.4}", other.correlation)) ")" br;
                    } }
                }
            } }
        } }
        // What was accepted is explained where it entered the model.
        dl.facts { @for (kind, words) in explanations(found).iter().filter(|(kind, _)| !found.iter().any(|f| f.kind == *kind)) { dt { (kind) } dd { (words) } } }
    }
}

fn experiment(found: &ExperimentJson) -> Markup {
    html! {
        p { "Of " (found.profiles_tried) " profiles within what the records show the chamber to be capable of, this one tells the candidates apart best: " (found.statement) "." }
        ul { @for pair in &found.expectations { li { (pair) } } }
        (figure(&experiment_chart(found).svg_to_read(), &format!("The profile {}, {:.2} h, from a steady state at 20 °C.", found.profile, h_from_s(found.duration_s))))
        div.scroll { table {
            thead { tr { th { "Piece" } th { "Rate [°C/h]" } th { "Duration [s]" } } }
            tbody { @for (i, piece) in found.pieces.iter().enumerate() { tr {
                td { (i + 1) } td { (format!("{:.2}", piece.rate_c_per_h).replace('-', "−")) } td { (format!("{:.0}", piece.duration_s)) }
            } } }
        } }
    }
}

fn experiment_chart(found: &ExperimentJson) -> Chart {
    let (mut time_s, mut temperature_c) = (0.0, 20.0);
    let mut points = vec![(time_s, temperature_c)];
    for piece in &found.pieces {
        time_s += piece.duration_s;
        temperature_c += piece.rate_c_per_h * h_from_s(piece.duration_s);
        points.push((min_from_s(time_s), temperature_c));
    }
    Chart::new("The experiment's profile")
        .size(860, 240)
        .x(Axis::linear("time [min]"))
        .y(Axis::linear("air's temperature [°C]"))
        .with(ChartSeries::line("", points))
}

fn candidates(body: &DiagnosisJson) -> Markup {
    let rest = body.candidates.len().saturating_sub(CANDIDATES_SHOWN);
    let explained = |less: f64| {
        let rows: f64 = body.candidates.iter().map(|c| c.chi_square_less).fold(f64::MIN_POSITIVE, f64::max);
        percent_from_fraction(less / rows)
    };
    html! {
        p { "Each effect of the catalogue alone, added to the declared model and fitted." }
        div.scroll { table {
            thead { tr { th.word { "Effect" } th { "Reduced χ²" } th { "χ² less" } th { "Of the best single one's [%]" } th { "BIC" } } }
            tbody { @for c in body.candidates.iter().take(CANDIDATES_SHOWN) { tr {
                td.word { (c.kind) @for (key, option) in &c.choices { ", " (key) " = " (option) } }
                td { (format!("{:.3}", c.reduced_chi_square)) }
                td { (format!("{:.1}", c.chi_square_less)) }
                td { (format!("{:.1}", explained(c.chi_square_less))) }
                td { (format!("{:.1}", c.bic)) }
            } } }
        } }
        @if rest > 0 { p { "And " (rest) " more that do less." } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::Finding;
    use crate::effect::{CATALOGUE, DeclaredEffect, find};

    fn finding(kind: &str) -> FindingJson {
        FindingJson::new(&Finding::unfitted(DeclaredEffect::at_start(find(kind).expect("in the catalogue"))))
    }

    #[test]
    fn another_winding_is_said_in_few_words() {
        let said = |winding: Option<&str>, reversed, exchanged_layers| {
            let winding = winding.map(str::to_owned);
            winding_in_words(&HypothesisJson { winding, reversed, exchanged_layers, offset_steps: Vec::new() })
        };
        assert_eq!(said(None, false, Some([32, 33])).as_deref(), Some("layers 32 and 33 exchanged"));
        assert_eq!(said(Some("dip"), true, None).as_deref(), Some("dip, connected the other way round"));
        // A step of the offset alone is no winding.
        assert_eq!(said(None, false, None), None);
    }

    #[test]
    fn every_effect_of_a_set_is_explained_once_in_two_sentences() {
        let mut first = finding("strain_mismatch");
        let other = finding("bias_temperature_rate");
        first.equivalents_in_detail = vec![crate::io::json::diagnosis::EquivalentJson {
            kind: other.kind.clone(),
            choices: other.choices.clone(),
            chi_square_more: 0.0,
            correlation: 1.0,
            happens: other.happens.clone(),
            remedy: other.remedy.clone(),
            experiment: other.experiment.clone(),
        }];
        let found = [first, other, finding("spool_mass")];
        let said = explanations(&found);
        let kinds: Vec<&str> = said.iter().map(|(kind, _)| *kind).collect();
        assert_eq!(kinds, ["strain_mismatch", "bias_temperature_rate", "spool_mass"]);
        for (kind, words) in &said {
            let spec = CATALOGUE.iter().find(|s| s.kind == *kind).expect("in the catalogue");
            assert_eq!(*words, format!("{} {}", spec.happens, spec.remedy));
        }
    }
}
