//! The `[fibre]` table of a model file: its optics, stated or those of a fibre of the library.

use crate::coil::Fibre;
use crate::io::fault::Fault;
use crate::stress::fibres::{FIBRES, FibreEntry, find_fibre};
use crate::units::{REFERENCE_TEMPERATURE_K, m_from_nm, m_from_um};

use super::toml_reader::{Limits, TableReader, TomlReader, nearest};

/// The fibre, and the library's where one is named: what is stated beside it holds. Without materials of the coil its κ is that
/// of the coated fibre by itself.
pub(super) fn read_fibre(
    r: &mut TomlReader,
    table: &mut TableReader,
    has_materials: bool,
) -> (Option<Fibre>, Option<&'static FibreEntry>) {
    let names_one = table.has("library");
    let entry = read_library(r, table);
    let of_library = entry.map(FibreEntry::optics);
    let mut number = |r: &mut TomlReader, key: &'static str, limits: Limits| match names_one {
        true => table.number(r, key, limits),
        false => table.needed_number(r, key, limits),
    };
    let refractive_index = number(r, "refractive_index", Limits::between(1.0, 4.0));
    let thermo_optic_per_k = number(r, "thermo_optic_per_k", Limits::between(-1e-3, 1e-3));
    let wavelength_nm = number(r, "wavelength_nm", Limits::between(200.0, 10_000.0));
    let outer_diameter_um = number(r, "outer_diameter_um", Limits::between(10.0, 5_000.0));
    let group_index = table.number(r, "group_index", Limits::between(1.0, 4.0));
    let thermal_expansion_per_k = table.number(r, "thermal_expansion_per_k", Limits::between(-1e-3, 1e-3));
    let usual = of_library.as_ref();
    let fibre = (|| {
        Some(Fibre {
            refractive_index: refractive_index.or(usual.map(|f| f.refractive_index))?,
            group_index: group_index.or(usual.and_then(|f| f.group_index)),
            thermo_optic_per_k: thermo_optic_per_k.or(usual.map(|f| f.thermo_optic_per_k))?,
            thermal_expansion_per_k: thermal_expansion_per_k.unwrap_or(0.0),
            wavelength_m: wavelength_nm.map(m_from_nm).or(usual.map(|f| f.wavelength_m))?,
            outer_diameter_m: outer_diameter_um.map(m_from_um).or(usual.map(|f| f.outer_diameter_m))?,
        })
    })();
    let by_itself = entry.filter(|_| !has_materials && thermal_expansion_per_k.is_none());
    (by_itself.and_then(|entry| with_free_expansion(fibre.clone()?, entry)).or(fibre), entry)
}

/// The fibre whose κ is that of the coated one that nothing holds.
fn with_free_expansion(fibre: Fibre, entry: &FibreEntry) -> Option<Fibre> {
    let path_per_k = entry.made_of()?.free_fibre(&fibre, REFERENCE_TEMPERATURE_K).path_per_k;
    let thermal_expansion_per_k = (path_per_k - fibre.thermo_optic_per_k) / fibre.refractive_index;
    Some(Fibre { thermal_expansion_per_k, ..fibre })
}

fn read_library(r: &mut TomlReader, table: &mut TableReader) -> Option<&'static FibreEntry> {
    let stated = table.text(r, "library")?;
    let found = find_fibre(stated);
    if found.is_none() {
        let names: Vec<&str> = FIBRES.iter().map(|entry| entry.name).collect();
        let message = format!(
            "fibre.library must be one of {}, found \"{stated}\": `coilwright fibres` describes them",
            names.join(", ")
        );
        let mut fault = Fault::new(message, table.span_of("library"));
        if let Some(near) = nearest(stated, &names) {
            fault = fault.with_note(format!("did you mean \"{near}\"?"));
        }
        r.fault(fault);
    }
    found
}
