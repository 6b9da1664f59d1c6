//! The noise of a diagnosed record told apart: as a picture, and in words with what would help most.

use super::plot::{Axis, Chart, ChartSeries};
use crate::io::json::diagnosis::{DiagnosisJson, RecordNoiseJson};

/// Lying bars: what the rate of each record consists of beside the coil, and how much the air would leave unseen otherwise.
pub(crate) fn noise_chart(body: &DiagnosisJson) -> Chart {
    let mut names: Vec<String> = ["white noise", "wander", "unresolved air", "model error"].map(str::to_owned).to_vec();
    let changes: Vec<String> =
        body.noise.first().map(|n| n.remedies.iter().map(|r| r.change.clone()).collect()).unwrap_or_default();
    names.extend(changes.iter().map(|change| format!("unresolved air with {change}")));
    let mut chart =
        Chart::new(headline(body)).size(860, 240).x(Axis::linear("root mean square [°/h]")).categories(names);
    for noise in &body.noise {
        let mut values = vec![
            noise.white_deg_per_h,
            noise.wander_deg_per_h,
            noise.unresolved_air_deg_per_h,
            noise.model_error_deg_per_h,
        ];
        values.extend(changes.iter().map(|change| {
            let own = noise.remedies.iter().find(|r| r.change == *change);
            own.map_or(f64::NAN, |r| r.unresolved_air_deg_per_h)
        }));
        let labels = values.iter().map(|v| format!("{v:.4} °/h")).collect();
        chart = chart.with(ChartSeries::bars(noise.record.clone(), &values).labelled(labels));
    }
    chart
}

fn headline(body: &DiagnosisJson) -> String {
    match body.noise.first().map(limit) {
        Some(limit) => format!("What limits {} most is {}", body.noise[0].record, limit.words()),
        None => "Noise told apart".to_owned(),
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Limit {
    White,
    Wander,
    Air,
    Model,
}

impl Limit {
    fn words(self) -> &'static str {
        match self {
            Limit::White => "the gyro's white noise",
            Limit::Wander => "the gyro's wander",
            Limit::Air => "what the air does and the sensor does not see",
            Limit::Model => "what the model is wrong by",
        }
    }
}

fn limit(n: &RecordNoiseJson) -> Limit {
    let all = [
        (n.white_deg_per_h, Limit::White),
        (n.wander_deg_per_h, Limit::Wander),
        (n.unresolved_air_deg_per_h, Limit::Air),
        (n.model_error_deg_per_h, Limit::Model),
    ];
    all.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).map_or(Limit::White, |l| l.1)
}

/// White noise, wander, unresolved air and model error of each record, what limits it most and what would help.
pub(crate) fn noise_in_words(body: &DiagnosisJson) -> Vec<String> {
    let line = |n: &RecordNoiseJson| {
        let own = limit(n);
        let best = n.remedies.first().filter(|r| r.unresolved_air_deg_per_h < n.unresolved_air_deg_per_h);
        let help = match (own, best) {
            (Limit::White, _) => ": a longer record would help".to_owned(),
            (Limit::Wander, _) => ": shorter records, or an average of several, would help".to_owned(),
            (Limit::Air, Some(best)) => {
                format!(": with {} {:.4} °/h of it would be left", best.change, best.unresolved_air_deg_per_h)
            }
            (Limit::Air, None) => String::new(),
            (Limit::Model, _) => ": something is missing, or the air is none that the model knows".to_owned(),
        };
        format!(
            "{}: white noise {:.4} ± {:.4} °/h a row, wander {:.4} °/h, unresolved air {:.4} °/h, model error {:.4} °/h; what limits it most is {}{help}",
            n.record,
            n.white_deg_per_h,
            n.white_standard_error_deg_per_h,
            n.wander_deg_per_h,
            n.unresolved_air_deg_per_h,
            n.model_error_deg_per_h,
            own.words()
        )
    };
    body.noise.iter().map(line).collect()
}
