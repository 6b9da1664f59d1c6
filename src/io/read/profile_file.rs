//! Profile files: a `[profiles]` table on its own, as in a model file.

use std::path::Path;

use toml_edit::{Array, ArrayOfTables, DocumentMut, InlineTable, Item, Table, value};

use crate::io::fault::Faults;
use crate::io::files::read_text;
use crate::profile::{Profile, ProfileSpec};
use crate::text::sink::TomlComment;
use crate::units::c_per_h_from_k_per_s;

use super::profile_tables::read_profiles;
use super::toml_reader::{TomlReader, parse};

/// Reads and checks a profile file.
///
/// # Errors
/// All faults of the file at once.
pub fn read_profile_file(path: &Path) -> Result<ProfileSpec, Faults> {
    let source = read_text(path)?;
    parse_profiles(&path.display().to_string(), &source)
}

/// As [`read_profile_file`], of a text that was read already.
///
/// # Errors
/// All faults of the text at once.
pub fn parse_profiles(file: &str, source: &str) -> Result<ProfileSpec, Faults> {
    let document = parse(file, source)?;
    let mut reader = TomlReader::new(file, source);
    let r = &mut reader;
    let mut root = r.root(&document);
    let mut table = root.needed_table(r, "profiles");
    root.finish(r);
    let spec = read_profiles(r, &mut table);
    table.finish(r);
    reader.finish(Some(spec))
}

/// One listed profile and none sampled, with remarks in front.
pub(crate) fn print_profile(profile: &Profile, remarks: &[TomlComment]) -> String {
    let mut document = DocumentMut::new();
    let mut table = Table::new();
    // The bound is that of this profile; rounding must not put a ramp above it.
    table["max_rate_c_per_h"] = value(shortest(c_per_h_from_k_per_s(profile.max_rate_k_per_s())));
    table["count"] = value(0);
    let mut ramp = Table::new();
    ramp["name"] = value(profile.name());
    ramp["pieces"] = value(pieces(profile));
    let mut ramps = ArrayOfTables::new();
    ramps.push(ramp);
    table["ramp"] = Item::ArrayOfTables(ramps);
    document["profiles"] = Item::Table(table);
    let remarks: String = remarks.iter().map(|line| format!("# {line}\n")).collect();
    remarks + &document.to_string()
}

/// A profile's pieces as they stand in files.
pub(in crate::io) fn pieces(profile: &Profile) -> Array {
    let table = |piece: &crate::profile::Piece| {
        let mut table = InlineTable::new();
        table.insert("rate_c_per_h", shortest(c_per_h_from_k_per_s(piece.rate_k_per_s)).into());
        table.insert("duration_s", piece.duration_s.into());
        table
    };
    profile.pieces().iter().map(table).collect()
}

/// Without the last digits, which a conversion of units leaves: 10 °C/h stays 10.
fn shortest(number: f64) -> f64 {
    format!("{number:.13e}").parse().unwrap_or(number)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::profile::Piece;

    #[test]
    fn a_profile_is_read_back_as_it_was_written() {
        let piece = |rate: f64, duration_s: f64| Piece { rate_k_per_s: rate / 3600.0, duration_s };
        let profile = Profile::new("tell-apart", vec![piece(59.7, 1200.0), piece(-12.3, 3600.0)]).unwrap();
        let text = print_profile(&profile, &[TomlComment::of("for a test")]);
        assert!(text.starts_with("# for a test\n[profiles]\n"), "{text}");
        let read = parse_profiles("p.toml", &text).unwrap();
        assert_eq!((read.count, read.listed.len()), (0, 1));
        for (a, b) in read.listed[0].pieces().iter().zip(profile.pieces()) {
            assert!((a.rate_k_per_s / b.rate_k_per_s - 1.0).abs() < 1e-12 && a.duration_s == b.duration_s);
        }
    }
}
