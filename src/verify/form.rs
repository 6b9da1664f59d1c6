//! Whether a file holds what its kind of file holds: nothing missing, nothing more.

use sha2::{Digest, Sha256};

use super::{Claim, EMIT_AGAIN, Findings, Row};
use crate::text;

/// What `schedule` writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// The schedule itself.
    Plain,
    Traveller,
    Program,
}

impl Kind {
    fn words(self) -> &'static str {
        match self {
            Kind::Plain => "a schedule",
            Kind::Traveller => "a traveller",
            Kind::Program => "a machine program",
        }
    }

    /// The least kind that holds a column which not all have; none for a column that all have or that none has.
    pub(crate) fn of_column(name: &str) -> Option<Self> {
        OF_ROW.iter().find(|(key, ..)| *key == name).map(|(_, kind, _)| *kind)
    }
}

/// Whether a row has a field.
type Has = fn(&Row) -> bool;

/// Fields of a row that not all kinds have: with [`Kind::Program`] those of programs and travellers.
const OF_ROW: [(&str, Kind, Has); 12] = [
    ("crossover", Kind::Program, |r| r.crossover.is_some()),
    ("balance_m", Kind::Traveller, |r| r.balance_m.is_some()),
    ("rotation", Kind::Program, |r| r.rotation.is_some()),
    ("axial_pitch_mm", Kind::Program, |r| r.axial_pitch_m.is_some()),
    ("tension_n", Kind::Program, |r| r.tension_n.is_some()),
    ("tension_min_n", Kind::Program, |r| r.tension_min_n.is_some()),
    ("tension_max_n", Kind::Program, |r| r.tension_max_n.is_some()),
    ("turns_per_min", Kind::Program, |r| r.turns_per_min.is_some()),
    ("reel_change", Kind::Program, |r| r.reel_change.is_some()),
    ("potting", Kind::Program, |r| r.potting.is_some()),
    ("measured_length_m", Kind::Traveller, |r| r.measured_length_m.is_some()),
    ("checked_by", Kind::Traveller, |r| r.checked_by.is_some()),
];

pub(super) fn check(claim: &Claim, findings: &mut Findings) {
    let Some(kind) = claim.kind else { return };
    for (i, row) in claim.rows.iter().enumerate() {
        for (field, least, has) in OF_ROW {
            let belongs = kind == least || (kind == Kind::Traveller && least == Kind::Program);
            there(Some(i + 1), field, belongs, has(row), kind, findings);
        }
        by_hand(i + 1, row, findings);
    }
    check_whole(claim, kind, findings);
    check_names(claim, findings);
}

fn there(row: Option<usize>, field: &str, belongs: bool, is_there: bool, kind: Kind, findings: &mut Findings) {
    findings.checks += 1;
    match (belongs, is_there) {
        (true, false) => {
            findings.add(row, field, format!("stated in {}", kind.words()), "nothing".to_owned(), EMIT_AGAIN)
        }
        (false, true) => {
            findings.add(row, field, format!("absent from {}", kind.words()), "a value".to_owned(), EMIT_AGAIN)
        }
        _ => {}
    }
}

/// What an operator entered: a length, and a name.
fn by_hand(number: usize, row: &Row, findings: &mut Findings) {
    findings.checks += 2;
    let length = row.measured_length_m.as_deref().unwrap_or_default();
    if !length.is_empty() && !length.parse::<f64>().is_ok_and(|m| m > 0.0 && m.is_finite()) {
        let remedy = "enter the length in metres as a plain number, or leave the cell empty";
        findings.add(Some(number), "measured_length_m", "a length in metres".to_owned(), length.to_owned(), remedy);
    }
    let name = row.checked_by.as_deref().unwrap_or_default();
    if let Some(fault) = text::words_fault(name) {
        let remedy = "enter a name, or leave the cell empty";
        findings.add(Some(number), "checked_by", "a name".to_owned(), fault, remedy);
    }
}

fn check_whole(claim: &Claim, kind: Kind, findings: &mut Findings) {
    let for_shop_floor = kind != Kind::Plain;
    let mut whole = vec![
        ("model", true, claim.model.is_some()),
        ("model_sha256", true, claim.model_sha256.is_some()),
        ("pattern", true, claim.pattern.is_some()),
        ("windability.class", true, claim.class.is_some()),
        ("worst_rate_deg_per_h", true, claim.worst_rate_rad_per_s.is_some()),
    ];
    if claim.is_document {
        whole.extend([
            ("fibre", true, claim.fibre.is_some()),
            ("midpoint_m", true, claim.midpoint_m.is_some()),
            ("midpoint_layer", true, claim.midpoint_layer.is_some()),
            ("pattern_sha256", true, claim.pattern_sha256.is_some()),
            ("production", for_shop_floor, claim.shop.is_some()),
        ]);
    }
    for (field, belongs, is_there) in whole {
        there(None, field, belongs, is_there, kind, findings);
    }
    for (i, reel) in claim.supply.iter().flatten().enumerate() {
        there(None, &format!("reels[{i}].load_m"), for_shop_floor, reel.load_m.is_some(), kind, findings);
    }
}

/// Words that nothing else in the file or the model says again.
fn check_names(claim: &Claim, findings: &mut Findings) {
    findings.checks += 3;
    if let Some(found) = &claim.program
        && !is_program(found)
    {
        let expected = "\"coilwright\" and its version".to_owned();
        findings.add(None, "program", expected, format!("\"{found}\""), EMIT_AGAIN);
    }
    if let Some(found) = &claim.pattern
        && let Some(fault) = text::name_fault(found)
    {
        findings.add(None, "pattern", "a name".to_owned(), format!("one that {fault}"), EMIT_AGAIN);
    }
    if let (Some(name), Some(segments), Some(found)) = (&claim.pattern, &claim.segments, &claim.pattern_sha256)
        && *found != pattern_sha256(name, segments, claim.end_turns)
    {
        let remedy = "the pattern's name or its segments are not those that the file was made with: emit it again";
        findings.add(None, "pattern_sha256", pattern_sha256(name, segments, claim.end_turns), found.clone(), remedy);
    }
}

fn is_program(text: &str) -> bool {
    let version = text.strip_prefix("coilwright ").unwrap_or_default();
    let parts: Vec<&str> = version.split('.').collect();
    let plain = |part: &&str| !part.is_empty() && part.chars().all(|c| c.is_ascii_alphanumeric() || "-+".contains(c));
    parts.len() >= 3 && parts.iter().all(plain) && parts[0].chars().all(|c| c.is_ascii_digit())
}

/// Of the name, a line break, and the segments with spaces between; turns at the ends follow on a line of their own.
fn pattern_sha256(name: &str, segments: &[i64], end_turns: [Option<i64>; 2]) -> String {
    let segments: Vec<String> = segments.iter().map(ToString::to_string).collect();
    let mut text = format!("{name}\n{}", segments.join(" "));
    if let [Some(a), Some(b)] = end_turns {
        text += &format!("\n{a} {b}");
    }
    let digest = Sha256::digest(text.as_bytes());
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_s_name_is_its_name_and_a_version() {
        assert!(is_program("coilwright 0.1.0") && is_program("coilwright 1.2.3-rc.1+x"));
        for text in ["coilwright", "coilwright 0.1", "coilwrite 0.1.0", "coilwright 0.1.0 skip", "coilwright x.1.0", ""]
        {
            assert!(!is_program(text), "{text}");
        }
    }
}
