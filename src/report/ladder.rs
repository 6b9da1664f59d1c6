//! The ladder of a diagnosis as a picture: what each piece of physics bought, against the noise.

use super::plot::{Axis, Chart, ChartSeries, Mark};
use crate::io::json::diagnosis::DiagnosisJson;

/// Noise floors that differ by less than this share are one line.
const SAME_FLOOR: f64 = 0.08;

/// Lying bars, a step below the other: the error on fitted records and on the hold-out, with the noise floor.
pub(crate) fn ladder_chart(body: &DiagnosisJson) -> Chart {
    let steps = body.steps();
    let names = steps.iter().enumerate().map(|(i, added)| match i {
        0 => "as declared".to_owned(),
        _ => format!("+ {}", added.join(" + ")),
    });
    let words =
        |value: f64, holdout: bool| format!("{value:.4} °/h = {:.2} × noise", body.multiple_of_noise(value, holdout));
    let fitted: Vec<f64> = body.ladder.iter().map(|r| r.rmse_deg_per_h).collect();
    let labels = fitted.iter().map(|v| words(*v, false)).collect();
    let mut chart = Chart::new(headline(body))
        .size(860, 200)
        .x(Axis::linear("root mean square of the residual [°/h]"))
        .categories(names)
        .with(ChartSeries::bars("on the records that were fitted", &fitted).labelled(labels));
    let held_out: Vec<f64> = body.ladder.iter().map(|r| r.holdout_rmse_deg_per_h.unwrap_or(f64::NAN)).collect();
    if held_out.iter().any(|v| v.is_finite()) {
        let labels = held_out.iter().map(|v| words(*v, true)).collect();
        chart = chart.with(ChartSeries::bars("on the hold-out, which was not", &held_out).labelled(labels));
    }
    let floor = body.noise_floor_deg_per_h;
    let other = body.holdout_noise_floor_deg_per_h.filter(|h| (h / floor - 1.0).abs() > SAME_FLOOR);
    match other {
        None => chart.mark(Mark::vertical("noise floor", floor)),
        Some(other) => chart
            .mark(Mark::vertical("noise floor, fitted", floor))
            .mark(Mark::vertical("noise floor, hold-out", other)),
    }
}

/// The message of the picture.
fn headline(body: &DiagnosisJson) -> String {
    let (Some(first), Some(last)) = (body.ladder.first(), body.ladder.last()) else {
        return "Error against the noise floor".to_owned();
    };
    let unseen = first.holdout_rmse_deg_per_h.is_some();
    let multiple = |rung: &crate::io::json::diagnosis::RungJson| {
        body.multiple_of_noise(rung.holdout_rmse_deg_per_h.unwrap_or(rung.rmse_deg_per_h), unseen)
    };
    let (before, after) = (multiple(first), multiple(last));
    let fall = format!(
        "the {} falls from {before:.2} to {after:.2} times the noise",
        match unseen {
            true => "hold-out error",
            false => "error",
        }
    );
    let kinds = last.effects.join(" and ");
    let are = if last.effects.len() > 1 { "were" } else { "was" };
    match body.verdict.as_str() {
        "adequate" => format!("Nothing is missing: the error is {after:.2} times the noise"),
        "missing" => format!("{kinds} {are} missing: {fall}"),
        "indistinguishable" => format!("{kinds}, or an equivalent, {are} missing: {fall}"),
        _ if !body.proposals.is_empty() => format!("With {kinds} {fall}"),
        _ if last.effects.is_empty() => {
            format!("No known effect explains the error of {after:.2} times the noise")
        }
        _ => format!("{kinds} explains a part only: {fall}"),
    }
}
