//! A traveller's page: whether everything that its reader sees is what its data say.
//!
//! The data are checked against the coil like any other file; here the page's text, element by element, is checked
//! against the data: headings, facts, reels, steps and the labels of the cross-section. Colours and lines are not.

use super::{Claim, Findings, Row, Shop, Shown};
use crate::units::{deg_per_h_from_rad_per_s, mm_from_m};

const PRINT_AGAIN: &str = "what the page shows is not what its data say: emit the schedule again, do not edit the page";
const BLANK: &str = "________________";

/// What must stand at one place of the page.
struct Place {
    row: Option<usize>,
    field: &'static str,
    /// None where anything may stand.
    text: Option<String>,
}

pub(super) fn check(claim: &Claim, found: &[Shown], findings: &mut Findings) {
    let places = places(claim);
    findings.checks += places.len();
    let same_length = places.len() == found.len();
    let differences = places.iter().zip(found).filter(|(p, f)| p.text.as_ref().is_some_and(|text| *text != f.text));
    // A piece more or less shifts all that follow: then the first difference says it.
    for (place, shown) in differences.take(if same_length { usize::MAX } else { 1 }) {
        let field = format!("{} on the page", place.field);
        let expected = format!("\"{}\"", place.text.as_deref().unwrap_or_default());
        findings.add(place.row, &field, expected, format!("\"{}\"", shown.text), PRINT_AGAIN);
    }
    if !same_length {
        let pieces = |n: usize| format!("{n} pieces of text");
        findings.add(None, "the page", pieces(places.len()), pieces(found.len()), PRINT_AGAIN);
    }
}

#[derive(Default)]
struct Page {
    places: Vec<Place>,
}

impl Page {
    /// White space as a browser has it.
    fn put(&mut self, row: Option<usize>, field: &'static str, text: impl Into<String>) {
        let text = text.into().split_whitespace().collect::<Vec<_>>().join(" ");
        self.places.push(Place { row, field, text: Some(text) });
    }

    fn fixed(&mut self, texts: &[&'static str]) {
        for text in texts {
            self.put(None, "a heading", *text);
        }
    }

    fn fact(&mut self, name: &'static str, text: impl Into<String>) {
        self.put(None, "a heading", name);
        self.put(None, name, text);
    }

    fn anything(&mut self, field: &'static str) {
        self.places.push(Place { row: None, field, text: None });
    }
}

fn metres(value_m: f64) -> String {
    format!("{value_m:.3} m")
}

/// Empty cells hold no text and so are no places.
fn places(claim: &Claim) -> Vec<Place> {
    let mut page = Page::default();
    let title = format!("Winding traveller: {}", claim.model.as_deref().unwrap_or_default());
    page.put(None, "the title", title.clone());
    page.put(None, "the title", title);
    facts(&mut page, claim);
    reels(&mut page, claim);
    let start = metres(claim.start_mark_m.unwrap_or(0.0));
    let trim_m = claim.expected_trim_m.unwrap_or(0.0);
    let trim = if trim_m.abs() < 5e-4 {
        "The halves are of equal length: no trim is expected.".to_owned()
    } else {
        let end = if trim_m > 0.0 { "A" } else { "B" };
        format!(
            "Expected trim: {} from end {end} for the joint of the halves to be the middle of the fibre.",
            metres(trim_m.abs())
        )
    };
    let start = format!(
        "Start: mark the fibre at {start} from end A (without the allowance) and fix the mark at the first flange."
    );
    page.put(None, "where to start", format!("{start} {trim}"));
    page.fixed(&["Steps"]);
    page.fixed(&[
        "Layer",
        "Reel",
        "Half, segment",
        "Direction",
        "Spool",
        "Turns",
        "Length [m]",
        "From reel [m]",
        "A less B [m]",
        "Radius [mm]",
        "Tension [N]",
        "Crossover",
        "Then",
        "Measured [m]",
        "✓",
    ]);
    for (i, row) in claim.rows.iter().enumerate() {
        step(&mut page, i + 1, row);
    }
    page.fixed(&["Cross-section"]);
    cross_section(&mut page, claim);
    page.fixed(&[
        "The pack from the spool outwards; numbers at the left count layers, at the right segments of the fibre.",
        "Release",
        "Role",
        "Name",
        "Date",
        "Signature",
        "Wound by",
        "Potted by",
        "Inspected by",
        "Released by",
    ]);
    page.places
}

fn facts(page: &mut Page, claim: &Claim) {
    let word = |name: &str| {
        let words = claim.shop.as_ref().map_or(&[][..], |shop: &Shop| &shop.words);
        match words.iter().find(|(key, _)| *key == name) {
            Some((_, text)) if !text.is_empty() => text.clone(),
            _ => BLANK.to_owned(),
        }
    };
    page.fact("Part number", word("part_number"));
    page.fact("Revision", word("revision"));
    page.fact("Spool", word("spool"));
    page.fact("Adhesive", word("adhesive"));
    page.fact("Cure", word("cure"));
    let layers = claim.segments.as_ref().map_or(0, Vec::len);
    page.fact("Winding pattern", format!("{} ({layers} layers)", claim.pattern.as_deref().unwrap_or_default()));
    page.fact(
        "Windability",
        format!(
            "class {}, up to {} reels, crossovers over up to {} layers",
            claim.class.as_deref().unwrap_or_default(),
            claim.reels.unwrap_or(0),
            claim.max_climb.unwrap_or(0)
        ),
    );
    page.fact("Fibre", claim.fibre.clone().unwrap_or_default());
    page.fact("Fibre length", metres(claim.length_m.unwrap_or(0.0)));
    let (middle_m, layer) = (claim.midpoint_m.unwrap_or(0.0), claim.midpoint_layer.unwrap_or(0));
    page.fact("Fibre's middle", format!("{} from end A, in layer {layer}", metres(middle_m)));
    let worst = deg_per_h_from_rad_per_s(claim.worst_rate_rad_per_s.unwrap_or(0.0));
    // As the data have it, without the last bits of the conversion.
    let worst: f64 = format!("{worst:.6}").parse().unwrap_or(worst);
    let profile = claim.worst_profile.as_deref().unwrap_or_default();
    page.fact("Predicted worst rate error", format!("{worst:.4} °/h (profile {profile})"));
    page.fact("Model file, SHA-256", claim.model_sha256.clone().unwrap_or_default());
    page.put(None, "a heading", "Made by");
    page.anything("Made by");
    for name in ["Fibre lot", "Spool serial number", "Adhesive lot", "Work order"] {
        page.fact(name, BLANK);
    }
}

fn reels(page: &mut Page, claim: &Claim) {
    page.fixed(&["Supply reels"]);
    page.fixed(&["Reel", "Load", "To be wound", "Fibre from", "Fibre to", "Prepare", "Loaded, measured"]);
    for reel in claim.supply.iter().flatten() {
        let captive = if reel.captive { " (captive)" } else { "" };
        page.put(None, "a reel's name", format!("{}{captive}", reel.name));
        page.put(None, "a reel's load", metres(reel.load_m.unwrap_or(reel.to_m - reel.from_m)));
        page.put(None, "a reel's length", metres(reel.to_m - reel.from_m));
        page.put(None, "where a reel begins", metres(reel.from_m));
        page.put(None, "where a reel ends", metres(reel.to_m));
        let before = format!("before step {}", reel.prepared_before_step);
        let text = reel.taken_from.as_ref().map_or(before.clone(), |r| format!("spool over from reel {r} {before}"));
        page.put(None, "when a reel is prepared", text);
    }
}

fn step(page: &mut Page, number: usize, row: &Row) {
    let mut put = |field, text: String| {
        if !text.is_empty() {
            page.put(Some(number), field, text);
        }
    };
    put("layer", row.layer.to_string());
    let change = if row.reel_change == Some(true) { " (change)" } else { "" };
    put("supply_reel", format!("{}{change}", row.supply_reel));
    put("half and segment", format!("{} {}", row.half, row.segment));
    put("direction", row.direction.replace("-to-", " → "));
    put("rotation", row.rotation.clone().unwrap_or_default());
    put("turns", format!("{:.2}", row.turns));
    put("length_m", format!("{:.3}", row.length_m));
    put("cumulative_m", format!("{:.3}", row.cumulative_m));
    put("balance_m", format!("{:.3}", row.balance_m.unwrap_or(0.0)).replace('-', "−"));
    put("radius_mm", format!("{:.4}", mm_from_m(row.radius_m)));
    let limits = match (row.tension_min_n, row.tension_max_n) {
        (Some(least), Some(most)) => format!(" ({least:.3}–{most:.3})"),
        _ => String::new(),
    };
    put("tension_n", row.tension_n.map_or(String::new(), |t| format!("{t:.3}{limits}")));
    put("crossover", row.crossover.clone().unwrap_or_default());
    put("potting", if row.potting == Some(true) { "apply adhesive".to_owned() } else { String::new() });
    put("check box", "☐".to_owned());
}

fn cross_section(page: &mut Page, claim: &Claim) {
    let layers = claim.segments.as_ref().map_or(0, Vec::len);
    let title = format!("{}, {layers} layers", claim.pattern.as_deref().unwrap_or_default());
    page.put(None, "the drawing's title", title.clone());
    page.put(None, "the drawing's title", title);
    page.fixed(&["half A", "half B", "layer", "segment"]);
    for (i, segment) in claim.segments.iter().flatten().enumerate() {
        page.put(Some(i + 1), "the drawn layer", (i + 1).to_string());
        let half = if 2 * segment <= layers as i64 { "A" } else { "B" };
        page.put(Some(i + 1), "the drawn segment", format!("{half} {segment}"));
    }
    page.fixed(&["first flange", "spool", "second flange"]);
    page.fixed(&["arrows: from end A to end B; arcs: crossovers, black or white at the midpoint"]);
}
