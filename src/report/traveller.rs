//! The winding traveller: what an operator follows and a quality engineer signs.

use maud::{Markup, PreEscaped, html};

use super::cross_section::{Groups, cross_section_in_groups};
use super::page::{figure, page};
use super::words;
use crate::io::json::schedule::{ScheduleJson, StepJson};
use crate::io::read::schedule_reader::DATA_ELEMENT;
use crate::pattern::Pattern;
use crate::text::sink::JsonText;

/// The traveller as one page; `document` as [`crate::io::write::traveller::traveller`] makes it.
pub fn traveller_page(document: &ScheduleJson, pattern: &Pattern) -> String {
    let title = format!("Winding traveller: {}", document.model);
    let data = JsonText::embedded(&serde_json::to_string(document).unwrap_or_default());
    let body = html! {
        h1 { (title) }
        p.big { (summary(document)) }
        (figure(&cross_section_in_groups(&format!("{}, {} layers", document.pattern, pattern.layers()), pattern, &by_reel(document)),
            "The pack from the spool outwards, coloured by reel; numbers at the left count layers, at the right segments of the fibre."))
        (head(document))
        h2 { "Supply reels" }
        (reels(document))
        p {
            "Start: mark the fibre at " b { (metres(document.start_mark_m)) } " from end A (without the allowance) and fix the mark at the first flange. "
            @if document.end_a_turns.is_some() {
                (words::OF_ENDS)
            } @else if document.expected_trim_m.abs() < 5e-4 {
                "The halves are of equal length: no trim is expected."
            } @else {
                "Expected trim: " b { (metres(document.expected_trim_m.abs())) } " from end " (if document.expected_trim_m > 0.0 { "A" } else { "B" })
                " for the joint of the halves to be the middle of the fibre."
            }
        }
        h2 { "Steps" }
        (steps(document))
        h2 { "Release" }
        (signatures())
        h2 { "What these words mean" }
        (words::of_a_traveller())
        (PreEscaped(DATA_ELEMENT)) (PreEscaped(data.as_str())) (PreEscaped("</script>"))
    };
    page(&title, &body)
}

/// What is to be wound, in a sentence.
fn summary(document: &ScheduleJson) -> String {
    let reels = document.reels.len();
    format!(
        "Wind {} of fibre in {} layers as {} from {reels} reel{}, from the spool outwards.",
        metres(document.length_m),
        document.segments.len(),
        document.pattern,
        if reels == 1 { "" } else { "s" }
    )
}

fn by_reel(document: &ScheduleJson) -> Groups {
    Groups {
        names: document.reels.iter().map(|reel| format!("reel {}", reel.name)).collect(),
        of_layer: document.steps.iter().map(|step| reel_of(document, step)).collect(),
    }
}

/// Its place in the list of reels, which chooses its colour.
fn reel_of(document: &ScheduleJson, step: &StepJson) -> usize {
    document.reels.iter().position(|reel| reel.name == step.supply_reel).unwrap_or(0)
}

/// Marks a reel with its colour; there are as many as `page::STYLE` has.
fn mark(reel: usize) -> String {
    format!("reel r{}", reel % 8)
}

fn metres(value_m: f64) -> String {
    format!("{value_m:.3} m")
}

fn head(document: &ScheduleJson) -> Markup {
    let stated = |text: &str| if text.is_empty() { "________________".to_owned() } else { text.to_owned() };
    let production = document.production.as_ref();
    let facts: Vec<(&str, String)> = vec![
        ("Part number", stated(production.map_or("", |p| &p.part_number))),
        ("Revision", stated(production.map_or("", |p| &p.revision))),
        ("Spool", stated(production.map_or("", |p| &p.spool))),
        ("Adhesive", stated(production.map_or("", |p| &p.adhesive))),
        ("Cure", stated(production.map_or("", |p| &p.cure))),
        ("Winding pattern", format!("{} ({} layers)", document.pattern, document.segments.len())),
        (
            "Windability",
            format!(
                "class {}, up to {} reels, crossovers over up to {} layers",
                document.windability.class, document.windability.reels, document.windability.max_climb
            ),
        ),
        ("Fibre", document.fibre.clone().unwrap_or_default()),
        ("Fibre length", metres(document.length_m)),
        (
            "Fibre's middle",
            format!(
                "{} from end A, in layer {}",
                metres(document.midpoint_m.unwrap_or(0.0)),
                document.midpoint_layer.unwrap_or(0)
            ),
        ),
        (
            "Predicted worst rate error",
            format!("{:.4} °/h (profile {})", document.worst_rate_deg_per_h, document.worst_profile),
        ),
        ("Model file, SHA-256", document.model_sha256.clone()),
        ("Made by", document.program.clone()),
        ("Fibre lot", stated("")),
        ("Spool serial number", stated("")),
        ("Adhesive lot", stated("")),
        ("Work order", stated("")),
    ];
    html! { dl.facts { @for (name, value) in facts { dt { (name) } dd { (value) } } } }
}

fn reels(document: &ScheduleJson) -> Markup {
    html! {
        div.scroll { table {
            thead { tr { th.word { "Reel" } th { "Load" } th { "To be wound" } th { "Fibre from" } th { "Fibre to" } th.word { "Prepare" } th { "Loaded, measured" } } }
            tbody { @for (place, reel) in document.reels.iter().enumerate() { tr {
                td.word { b class=(mark(place)) { (reel.name) } @if reel.captive { " (captive)" } }
                td.keep { b { (metres(reel.load_m.unwrap_or(reel.to_m - reel.from_m))) } }
                td.keep { (metres(reel.to_m - reel.from_m)) }
                td.keep { (metres(reel.from_m)) } td.keep { (metres(reel.to_m)) }
                td.word {
                    @if let Some(source) = &reel.taken_from { "spool over from reel " (source) " before step " (reel.prepared_before_step) }
                    @else { "before step " (reel.prepared_before_step) }
                }
                td.fill {}
            } } }
        } }
    }
}

fn steps(document: &ScheduleJson) -> Markup {
    html! {
        div.scroll { table {
            thead { tr {
                th { "Layer" } th.word { "Reel" } th.word { "Half, segment" } th.word { "Direction" } th.word { "Spool" } th { "Turns" }
                th { "Length [m]" } th { "From reel [m]" } th { "A less B [m]" } th { "Radius [mm]" } th { "Tension [N]" }
                th.word.long { "Crossover" } th.word { "Then" } th { "Measured [m]" } th { "✓" }
            } }
            tbody { @for row in &document.steps { tr {
                td { (row.layer) }
                td.word { b class=(mark(reel_of(document, row))) { (row.supply_reel) } @if row.reel_change == Some(true) { " (change)" } }
                td.word { (row.half) " " (row.segment) }
                td.word.keep { (row.direction.replace("-to-", " → ")) }
                td.word { (row.rotation.as_deref().unwrap_or("")) }
                td { (format!("{:.2}", row.turns)) }
                td { (format!("{:.3}", row.length_m)) }
                td { (format!("{:.3}", row.cumulative_m)) }
                td { (format!("{:.3}", row.balance_m.unwrap_or(0.0)).replace('-', "−")) }
                td { (format!("{:.4}", row.radius_mm)) }
                td { (tension(row)) }
                td.word { (row.crossover.as_deref().unwrap_or("")) }
                td.word { @if row.potting == Some(true) { "apply adhesive" } }
                td.fill {}
                td { "☐" }
            } } }
        } }
    }
}

/// Set-point and limits.
fn tension(row: &StepJson) -> String {
    match (row.tension_n, row.tension_min_n, row.tension_max_n) {
        (Some(set), Some(least), Some(most)) => format!("{set:.3} ({least:.3}–{most:.3})"),
        (Some(set), ..) => format!("{set:.3}"),
        _ => String::new(),
    }
}

fn signatures() -> Markup {
    html! {
        div.scroll { table {
            thead { tr { th.word { "Role" } th.word { "Name" } th.word { "Date" } th.word { "Signature" } } }
            tbody { @for role in ["Wound by", "Potted by", "Inspected by", "Released by"] {
                tr { td.word { (role) } td.fill {} td.fill {} td.fill {} }
            } }
        } }
    }
}
