//! The page about records: comparison, diagnosis and measures, as far as a folder holds them.

use maud::{Markup, html};

use super::page::page;
use super::{allan, comparison, diagnosis, words};
use crate::io::files::sha256_hex;
use crate::io::json::inputs::InputsJson;
use crate::io::write::measurement_folder::Measurements;

/// One page that opens offline.
pub(crate) fn measurement_page(found: &Measurements) -> String {
    let name = found.comparison.as_ref().map(|(c, _)| format!("{} with {}", c.model, c.pattern));
    let name = name.or_else(|| found.diagnosis.as_ref().map(|(d, _)| d.model.clone()));
    let title = match name {
        Some(name) => format!("{name}: model and measurement"),
        None => "Measures of a gyro".to_owned(),
    };
    let inputs: Vec<(&str, &InputsJson)> = [
        found.comparison.as_ref().map(|(c, _)| ("Comparison", &c.inputs)),
        found.diagnosis.as_ref().map(|(d, _)| ("Diagnosis", &d.inputs)),
        found.metrics.as_ref().map(|m| ("Measures", &m.inputs)),
    ]
    .into_iter()
    .flatten()
    .collect();
    let body = html! {
        h1 { (title) }
        @if let Some((document, tables)) = &found.diagnosis { (diagnosis::section(document, tables)) }
        @if let Some((document, tables)) = &found.comparison { (comparison::section(document, tables)) }
        @if let Some(document) = &found.metrics { (allan::section(document)) }
        @if found.comparison.is_some() || found.diagnosis.is_some() { (words::of_windings()) }
        h2 { "Inputs" }
        (inputs_table(&inputs))
        (model_source(found, &inputs))
        (sources())
    };
    page(&title, &body)
}

fn inputs_table(all: &[(&str, &InputsJson)]) -> Markup {
    let mut hashes: Vec<&String> = all.iter().filter_map(|(_, i)| i.model_sha256.as_ref()).collect();
    hashes.dedup();
    html! {
        @if hashes.len() > 1 { p { b { "The parts of this page are about different model files." } } }
        div.scroll { table {
            thead { tr { th.word { "For" } th.word { "File" } th.word { "Use" } th.word { "SHA-256" } th.word { "Program" } } }
            tbody { @for (what, inputs) in all {
                @if let (Some(file), Some(hash)) = (&inputs.model_file, &inputs.model_sha256) {
                    tr { td.word { (what) } td.word { (file) } td.word { "model" } td.word { code { (hash) } } td.word { (inputs.program) } }
                }
                @for record in &inputs.records {
                    tr {
                        td.word { (what) } td.word { (record.file) } td.word { (record.role) }
                        td.word { code { (record.sha256.as_deref().unwrap_or("a pipe")) } } td.word { (inputs.program) }
                    }
                }
            } }
        } }
    }
}

/// The model file, if it is the one that the documents are about.
fn model_source(found: &Measurements, inputs: &[(&str, &InputsJson)]) -> Markup {
    let source = found.model_source.as_ref().filter(|source| {
        let hash = sha256_hex(source);
        inputs.iter().any(|(_, i)| i.model_sha256.as_ref() == Some(&hash))
    });
    html! { @if let Some(source) = source { details { summary { "The model file" } pre { (source) } } } }
}

fn sources() -> Markup {
    html! {
        h2 { "Sources" }
        ul {
            li { "Rate error: Shupe, Appl. Opt. 19, 654 (1980); Yan, Lan, Jian, Acta Optica Sinica (1998), Eq. (4), corrected." }
            li { "Boundary from noisy readings: Harvey, Forecasting, Structural Time Series Models and the Kalman Filter (1989); de Jong and Penzer, J. Am. Stat. Assoc. 93 (1998) 796." }
            li { "Noise floor: Gasser, Sroka, Jennen-Steinmetz, Biometrika 73 (1986) 625; Croux, Haesbroeck, J. Multivar. Anal. 71 (1999) 161." }
            li { "NRMSE fit: Ljung, System Identification (1999), section 16.4. Whiteness: Ljung and Box, Biometrika 65 (1978) 297." }
            li { "Information criterion: Schwarz, Ann. Stat. 6 (1978) 461. Allan deviation: IEEE Std 952, annex C; Riley, NIST SP 1065 (2008)." }
        }
    }
}
