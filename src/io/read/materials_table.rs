//! The `[materials]` table of a model file: what fibre, potting and spool are made of.

use std::ops::Range;

use toml_edit::{Item, Value};

use crate::io::fault::Fault;
use crate::rate::CoilModel;
use crate::stress::fibres::{FibreEntry, STRAIN_OPTIC};
use crate::stress::material::{COLDEST_K, Compression, HOTTEST_K, Material, Property};
use crate::stress::{BondedSpool, CoatedFibre, Materials, library};
use crate::units::{celsius_from_kelvin, kelvin_from_celsius, m_from_mm, m_from_um, mm_from_m, pa_from_mpa, um_from_m};

use super::toml_reader::{Limits, TableReader, TomlReader, nearest};

/// Two micrometres that are the same may differ by so much.
const DIAMETER_ROUNDING: f64 = 1e-6;
/// κ below this is none that an error could be a share of.
const LEAST_PATH_PER_K: f64 = 1e-9;
/// Of glass and coatings [µm].
const DIAMETER_UM: Limits = Limits::between(1.0, 5_000.0);

/// Materials as stated, before the coil is known.
pub(super) struct Stated {
    pub(crate) materials: Materials,
    /// What the file itself defines.
    pub(crate) own: Vec<Material>,
    spool_span: Option<Range<usize>>,
    span: Option<Range<usize>>,
    surface_span: Option<Range<usize>>,
}

/// The `[materials]` table, if there is one; a fibre of the library need not be described again.
pub(super) fn read_materials(
    r: &mut TomlReader,
    table: &mut TableReader,
    of_library: Option<&FibreEntry>,
) -> Option<Stated> {
    let before = r.fault_count();
    let own = read_own(r, table);
    let span = table.span();
    let is_present = table.is_present();
    let adhesive = named(r, table, &own, "adhesive", is_present);
    let has_spool = table.has("spool");
    let spool = named(r, table, &own, "spool", false);
    let spool_span = table.span_of("spool_thickness_mm");
    let thickness_mm = match has_spool {
        true => table.needed_number(r, "spool_thickness_mm", Limits::between(0.01, 1e3)),
        false => table.number(r, "spool_thickness_mm", Limits::between(0.01, 1e3)),
    };
    if !has_spool && thickness_mm.is_some() {
        let message = "materials.spool_thickness_mm is that of materials.spool, which is missing: state its material too, or leave both out for a pack that stands by itself";
        r.fault(Fault::new(message, spool_span.clone()));
    }
    let is_of_library = of_library.is_some() && !table.has("fibre");
    let mut fibre_table =
        if is_present && !is_of_library { table.needed_table(r, "fibre") } else { table.table(r, "fibre") };
    let surface_span = fibre_table.span_of("coatings").or_else(|| fibre_table.span());
    let glass = named(r, &mut fibre_table, &own, "glass", is_present && !is_of_library);
    let glass_diameter_um = fibre_table.needed_number(r, "glass_diameter_um", DIAMETER_UM);
    let hole_diameter_um = fibre_table.number(r, "hole_diameter_um", Limits::between(0.0, 5_000.0)).unwrap_or(0.0);
    let usual = if hole_diameter_um > 0.0 { (0.0, 0.0) } else { STRAIN_OPTIC };
    let optic = Limits::between(-1.0, 1.0);
    let p11 = fibre_table.number(r, "strain_optic_p11", optic).unwrap_or(usual.0);
    let p12 = fibre_table.number(r, "strain_optic_p12", optic).unwrap_or(usual.1);
    if let Some(glass_um) = glass_diameter_um.filter(|glass_um| hole_diameter_um >= *glass_um) {
        let message = format!(
            "materials.fibre.hole_diameter_um must be less than glass_diameter_um = {glass_um}, found {hole_diameter_um}: the hole lies in the glass"
        );
        r.fault(Fault::new(message, fibre_table.span_of("hole_diameter_um")));
    }
    let coatings = read_coatings(r, &mut fibre_table, &own, glass_diameter_um);
    fibre_table.finish(r);
    if !is_present || r.fault_count() > before {
        return None;
    }
    let fibre = match of_library.filter(|_| is_of_library) {
        Some(entry) => entry.made_of()?,
        None => CoatedFibre {
            glass: glass?,
            glass_radius_m: m_from_um(0.5 * glass_diameter_um?),
            hole_radius_m: m_from_um(0.5 * hole_diameter_um),
            coatings,
            p11,
            p12,
        },
    };
    let materials = Materials {
        fibre,
        adhesive: adhesive?,
        spool: spool.zip(thickness_mm).map(|(material, mm)| BondedSpool { material, thickness_m: m_from_mm(mm) }),
    };
    Some(Stated { materials, own, spool_span, span, surface_span })
}

/// The material that stands under a key, if it is known.
fn named(
    r: &mut TomlReader,
    table: &mut TableReader,
    own: &[Material],
    key: &'static str,
    is_needed: bool,
) -> Option<Material> {
    let stated = match is_needed {
        true => table.needed_text(r, key, "the name of a material (`coilwright materials` lists them)"),
        false => table.text(r, key),
    };
    let span = table.span_of(key);
    stated.and_then(|name| known(r, own, name, key, span))
}

/// Each coating with its outer radius, from the glass outwards.
fn read_coatings(
    r: &mut TomlReader,
    fibre_table: &mut TableReader,
    own: &[Material],
    glass_diameter_um: Option<f64>,
) -> Vec<(Material, f64)> {
    let mut coatings = Vec::new();
    let mut below_um = glass_diameter_um;
    for mut coating in fibre_table.tables(r, "coatings") {
        let material = named(r, &mut coating, own, "material", true);
        let outer_um = coating.needed_number(r, "outer_diameter_um", DIAMETER_UM);
        if let (Some(below), Some(outer)) = (below_um, outer_um)
            && outer <= below
        {
            let message = format!(
                "materials.fibre.coatings.outer_diameter_um must be more than the {below} µm that it covers, found {outer}: list the coatings from within outwards"
            );
            r.fault(Fault::new(message, coating.span_of("outer_diameter_um")));
        }
        below_um = outer_um.or(below_um);
        coatings.extend(material.zip(outer_um.map(|outer| m_from_um(0.5 * outer))));
        coating.finish(r);
    }
    coatings
}

/// Whether materials fit the model's coil; the model made of them.
pub(super) fn made_of(r: &mut TomlReader, stated: &Stated, model: &CoilModel) -> Option<CoilModel> {
    let before = r.fault_count();
    let (materials, coil) = (&stated.materials, &model.coil);
    let fibre = coil.fibre();
    let surface_m = materials.fibre.coatings.last().map_or(materials.fibre.glass_radius_m, |(_, outer_m)| *outer_m);
    if (2.0 * surface_m - fibre.outer_diameter_m).abs() > DIAMETER_ROUNDING * fibre.outer_diameter_m {
        let message = format!(
            "the outermost diameter under materials.fibre must be fibre.outer_diameter_um = {:.6}, found {:.6}: both are the same surface",
            um_from_m(fibre.outer_diameter_m),
            um_from_m(2.0 * surface_m)
        );
        r.fault(Fault::new(message, stated.surface_span.clone()));
    }
    if let Some(spool) = materials.spool.as_ref().filter(|spool| spool.thickness_m >= coil.bore_radius_m()) {
        let message = format!(
            "materials.spool_thickness_mm must be less than the bore's radius of {:.4} mm, found {}: the spool is a tube",
            mm_from_m(coil.bore_radius_m()),
            mm_from_m(spool.thickness_m)
        );
        r.fault(Fault::new(message, stated.spool_span.clone()));
    }
    if fibre.thermal_expansion_per_k != 0.0 {
        let message = "fibre.thermal_expansion_per_k must be left out beside [materials], which gives every layer its strain: take it out";
        r.fault(Fault::new(message, stated.span.clone()));
    }
    if r.fault_count() > before {
        return None;
    }
    let made = model.with_materials(materials);
    let path_per_k = made.coil.fibre().path_per_k();
    // Not a number where a material has none.
    if !path_per_k.is_finite() || path_per_k.abs() < LEAST_PATH_PER_K {
        let message = format!(
            "[materials] and fibre.thermo_optic_per_k make an optical path per kelvin of {path_per_k:e} at 20 °C: expected one beyond ±{LEAST_PATH_PER_K:e}, or there is no thermal error to speak of; check the materials"
        );
        r.fault(Fault::new(message, stated.span.clone()));
        return None;
    }
    Some(made)
}

fn known(r: &mut TomlReader, own: &[Material], name: &str, key: &str, span: Option<Range<usize>>) -> Option<Material> {
    if let Some(material) = own.iter().find(|m| m.name == name) {
        return Some(material.clone());
    }
    if let Some(entry) = library::find(name) {
        return Some(entry.material());
    }
    let message = format!(
        "materials: {key} = \"{name}\" is no material of the library and none of [[materials.own]]: `coilwright materials` lists what there is"
    );
    let names: Vec<&str> =
        own.iter().map(|m| m.name.as_str()).chain(library::MATERIALS.iter().map(|e| e.name)).collect();
    let mut fault = Fault::new(message, span);
    if let Some(near) = nearest(name, &names) {
        fault = fault.with_note(format!("did you mean \"{near}\"?"));
    }
    r.fault(fault);
    None
}

fn read_own(r: &mut TomlReader, table: &mut TableReader) -> Vec<Material> {
    let mut own: Vec<Material> = Vec::new();
    for mut stated in table.tables(r, "own") {
        let before = r.fault_count();
        let name = stated.needed_name(r, "name").map(str::to_owned);
        let modulus = Limits::between(1e-4, 2e6);
        let youngs = needed_property(r, &mut stated, "youngs_modulus_mpa", modulus, pa_from_mpa);
        let poisson = property(r, &mut stated, "poisson_ratio", Limits::between(0.0, 0.4999), |v| v);
        let bulk = property(r, &mut stated, "bulk_modulus_mpa", modulus, pa_from_mpa);
        let expansion = needed_property(r, &mut stated, "expansion_per_k", Limits::between(-1e-3, 1e-2), |v| v);
        stated.words(r, "source");
        let compression = match (poisson, bulk) {
            (Some(ratio), None) => Some(Compression::PoissonRatio(ratio)),
            (None, Some(bulk)) => Some(Compression::BulkModulus(bulk)),
            (Some(_), Some(_)) => {
                let message = "materials.own.poisson_ratio and bulk_modulus_mpa say the same: keep one of them";
                r.fault(Fault::new(message, stated.span_of("bulk_modulus_mpa")));
                None
            }
            (None, None) => {
                if !stated.has("poisson_ratio") && !stated.has("bulk_modulus_mpa") {
                    let expected = "a number between 0 and 0.4999 (or bulk_modulus_mpa)".to_owned();
                    stated.note_missing_one_of(&["poisson_ratio", "bulk_modulus_mpa"], expected);
                }
                None
            }
        };
        let span = stated.span();
        let of_bulk = stated.span_of("bulk_modulus_mpa");
        stated.finish(r);
        if r.fault_count() > before {
            continue;
        }
        let (Some(name), Some(youngs_modulus_pa), Some(compression), Some(expansion_per_k)) =
            (name, youngs, compression, expansion)
        else {
            continue;
        };
        let material = Material { name, youngs_modulus_pa, compression, expansion_per_k };
        let least = material.least_poisson_ratio(COLDEST_K, HOTTEST_K);
        if least < 0.0 {
            let message = format!(
                "materials.own \"{}\": youngs_modulus_mpa over bulk_modulus_mpa make a Poisson's ratio of {least:.3}: expected E below 3 K at every temperature",
                material.name
            );
            r.fault(Fault::new(message, of_bulk));
        } else if own.iter().any(|m| m.name == material.name) || library::find(&material.name).is_some() {
            let message = format!("two materials are called \"{}\": rename this one", material.name);
            r.fault(Fault::new(message, span));
        } else {
            own.push(material);
        }
    }
    own
}

fn needed_property(
    r: &mut TomlReader,
    table: &mut TableReader,
    key: &'static str,
    limits: Limits,
    si: fn(f64) -> f64,
) -> Option<Property> {
    if !table.has(key) {
        table.note_missing_one_of(&[key], SHAPES.to_owned());
    }
    property(r, table, key, limits, si)
}

const SHAPES: &str = "a number, [[temperature_c, value], …] or { glassy, rubbery, transition_c, width_k }";

/// A property over temperature, as a number, as points or as a glass transition.
fn property(
    r: &mut TomlReader,
    table: &mut TableReader,
    key: &'static str,
    limits: Limits,
    si: fn(f64) -> f64,
) -> Option<Property> {
    if !table.states(key) {
        return None;
    }
    if table.raw(key).and_then(Item::as_value).is_some_and(|v| v.is_float() || v.is_integer()) {
        return table.number(r, key, limits).map(|v| Property::Constant(si(v)));
    }
    if table.raw(key).is_some_and(Item::is_table_like) {
        let mut transition = table.table(r, key);
        let glassy = transition.needed_number(r, "glassy", limits);
        let rubbery = transition.needed_number(r, "rubbery", limits);
        let range = Limits::between(celsius_from_kelvin(COLDEST_K), celsius_from_kelvin(HOTTEST_K));
        let transition_c = transition.needed_number(r, "transition_c", range);
        let width_k = transition.needed_number(r, "width_k", Limits::between(1.0, 100.0));
        transition.finish(r);
        return Some(Property::Transition {
            glassy: si(glassy?),
            rubbery: si(rubbery?),
            transition_k: kelvin_from_celsius(transition_c?),
            width_k: width_k?,
        });
    }
    let span = table.span_of(key);
    let found = table.raw(key).map(|item| points(item, limits));
    match found {
        Some(Ok(points)) => {
            let si_points = points.into_iter().map(|(c, v)| (kelvin_from_celsius(c), si(v))).collect();
            Some(Property::Points(si_points))
        }
        Some(Err(what)) => {
            let message = format!("materials.own.{key} must be {SHAPES}, {what}");
            r.fault(Fault::new(message, span));
            None
        }
        None => None,
    }
}

fn points(item: &Item, limits: Limits) -> Result<Vec<(f64, f64)>, String> {
    let Item::Value(Value::Array(array)) = item else { return Err("found something else".to_owned()) };
    let number = |v: &Value| v.as_float().or_else(|| v.as_integer().map(|i| i as f64)).filter(|n| n.is_finite());
    let mut points: Vec<(f64, f64)> = Vec::new();
    for (i, pair) in array.iter().enumerate() {
        let two: Vec<f64> = pair.as_array().into_iter().flatten().filter_map(number).collect();
        let ([temperature_c, value], Some(2)) = (&two[..], pair.as_array().map(|a| a.len())) else {
            return Err(format!("found in entry {} something that is no pair of numbers", i + 1));
        };
        if !(*value >= limits.lower && *value <= limits.upper) {
            return Err(format!("found in entry {} {value}: expected {} to {}", i + 1, limits.lower, limits.upper));
        }
        if points.last().is_some_and(|(last, _)| temperature_c <= last) {
            return Err(format!("found in entry {} a temperature that does not rise", i + 1));
        }
        points.push((*temperature_c, *value));
    }
    if points.is_empty() { Err("found an empty array".to_owned()) } else { Ok(points) }
}
