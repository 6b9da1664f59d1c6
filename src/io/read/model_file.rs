//! Model files: one coil, how it is heated, which physics the model includes, what the search runs over.
//!
//! A file is read whole; all its faults come at once, with the source line and key of each.

use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::coil::{Coil, CoilError, CoilSpec, Fibre, LayerLength, SagnacDiameter};
use crate::effect::{self, DeclaredEffect, Subject};
use crate::io::fault::{Fault, Faults};
use crate::io::files::read_text;
use crate::io::model::{Advice, LOCATIONS, ModelFile, NamedPattern, SearchSettings, location_of};
use crate::pattern::windability::WindabilityClass;
use crate::rate::CoilModel;
use crate::search::cost::objective::Objective;
use crate::thermal::{self, DEFAULT_CELLS_PER_LAYER, Extent, Location, PackMaterial};
use crate::units::{m_from_mm, m_from_um, um_from_m};

use super::boundary_table::read_boundary;
use super::effect_tables::read_effects;
use super::fibre_table::read_fibre;
use super::kind_of_file::FileKind;
use super::materials_table::{made_of, read_materials};
use super::pattern_file::{ResolveError, file_of_pattern, resolve_pattern};
use super::production_table::read_production;
use super::profile_tables::{read_profiles, too_many_ramps};
use super::record_columns::read_format;
use super::tolerance_table::read_tolerance;
use super::toml_reader::{Limits, TableReader, TomlReader, nearest, parse};

/// Reads and checks a model file.
///
/// # Errors
/// All faults of the file at once.
pub fn read_model(path: &Path) -> Result<ModelFile, Faults> {
    let source = read_text(path)?;
    parse_model(path, &source)
}

/// As [`read_model`], as a search sees it: behind the film that records showed.
///
/// # Errors
/// As [`read_model`].
pub(crate) fn read_design(path: &Path) -> Result<ModelFile, Faults> {
    read_model(path).map(ModelFile::for_search)
}

/// Whether the first line that is no comment is a row of several names, as in a CSV file.
pub(super) fn looks_like_a_record(source: &str) -> bool {
    let first = source.lines().map(str::trim).find(|line| !line.is_empty() && !line.starts_with('#'));
    first.is_some_and(|line| line.contains([',', ';', '\t']) && !line.contains(['=', '[', '{']))
}

/// As [`read_model`], of a text that was read already; `path` places relative pattern files and names the source.
///
/// # Errors
/// All faults of the text at once.
#[expect(
    clippy::too_many_lines,
    reason = "a step for each table of the file, in its order; what is checked last spans them"
)]
pub fn parse_model(path: &Path, source: &str) -> Result<ModelFile, Faults> {
    let file = path.display().to_string();
    let document = parse(&file, source).map_err(|faults| match looks_like_a_record(source) {
        true => Faults::of_file(&file, "is a table of rows, no model file: the model comes first, then the records"),
        false => faults,
    })?;
    FileKind::Model.check(&file, source)?;
    let mut reader = TomlReader::new(&file, source);
    let r = &mut reader;
    let mut root = r.root(&document);
    let name = root.needed_name(r, "name").map(str::to_owned);
    let mut fibre_table = root.needed_table(r, "fibre");
    let mut winding = root.needed_table(r, "winding");
    let mut thermal = root.needed_table(r, "thermal");
    let mut sensor = root.table(r, "sensor");
    let effect_tables = root.tables(r, "effect");
    let mut profiles_table = root.table(r, "profiles");
    let mut search_table = root.table(r, "search");
    let mut production_table = root.table(r, "production");
    let mut tolerance_table = root.table(r, "tolerance");
    let mut record_table = root.table(r, "record");
    let mut boundary_table = root.table(r, "boundary");
    let mut materials_table = root.table(r, "materials");
    root.finish(r);

    let has_materials = materials_table.is_present();
    let (fibre, of_library) = read_fibre(r, &mut fibre_table, has_materials);
    fibre_table.finish(r);
    let layers = read_layers(r, &mut winding);
    let coil = read_coil(r, &mut winding, layers, fibre);
    // Read a second time only where the first reading found no fault in it.
    let stated_length_m = match &coil {
        Some(_) if winding.has("length_m") => winding.number(r, "length_m", Limits::between(0.1, 1e6)),
        _ => None,
    };
    let (pattern, pattern_file) = read_pattern(r, &mut winding, layers, path).unzip();
    winding.finish(r);
    let thermal_parts = read_thermal(r, &mut thermal);
    let cells = thermal.integer(r, "cells_per_layer", 1, MOST_CELLS_PER_LAYER);
    let thermal_span = thermal.span();
    thermal.finish(r);
    let location = sensor.word(r, "location", LOCATIONS).map_or(Location::OuterLayer, location_of);
    let rate_mean_s = sensor.number(r, "rate_mean_s", Limits::between(0.0, 1e5)).unwrap_or(0.0);
    sensor.finish(r);
    let effects = read_effects(r, effect_tables);
    let materials = read_materials(r, &mut materials_table, of_library);
    materials_table.finish(r);
    let has_profiles = profiles_table.is_present();
    let profiles = read_profiles(r, &mut profiles_table);
    profiles_table.finish(r);
    let search = read_search(r, &mut search_table);
    search_table.finish(r);
    let production = read_production(r, &mut production_table);
    production_table.finish(r);
    let tolerance = read_tolerance(r, &mut tolerance_table);
    tolerance_table.finish(r);

    let record = read_format(r, &mut record_table);
    record_table.finish(r);
    let learned = read_boundary(r, &mut boundary_table);
    boundary_table.finish(r);

    let whole = (|| {
        let (extent, material) = thermal_parts?;
        let cells_per_layer = cells.map_or(DEFAULT_CELLS_PER_LAYER, |cells| cells as usize);
        Some(CoilModel {
            name: name?,
            coil: coil?,
            extent,
            material,
            location,
            rate_mean_s,
            cells_per_layer,
            effects: effects?,
        })
    })();
    let whole = match &materials {
        Some(stated) => whole.and_then(|model| made_of(r, stated, &model)),
        None => whole.filter(|_| !has_materials),
    };
    if let Some(model) = &whole {
        check_whole(r, model, thermal_span);
        check_layers(r, model, source);
        if let Some(message) = too_many_ramps(&profiles, model.coil.layers()) {
            r.fault(Fault::new(message, span_in(source, "count").or_else(|| span_in(source, "segments"))));
        }
    }
    if search.objective == Objective::P95 && tolerance.is_none() {
        let message =
            "search.objective = \"p95\" needs a [tolerance] table: state there how much what is built spreads";
        r.fault(Fault::new(message, span_in(source, "objective")));
    }
    if let (Some(model), Some(named)) = (&whole, &pattern)
        && named.pattern.layers() != model.coil.layers()
    {
        let message = format!(
            "winding.pattern \"{}\" has {} layers and winding.layers is {}: use a pattern of the coil's layer count",
            named.name,
            named.pattern.layers(),
            model.coil.layers()
        );
        r.fault(Fault::new(message, span_in(source, "pattern")));
    }
    let value = whole.map(|model| {
        let advice = advice_for(&model, has_profiles);
        ModelFile {
            path: path.to_owned(),
            source: source.to_owned(),
            model,
            pattern,
            pattern_file: pattern_file.flatten(),
            profiles,
            search,
            production,
            tolerance,
            record,
            advice,
            stated_length_m,
            learned,
            own_materials: materials.map_or_else(Vec::new, |stated| stated.own),
        }
    });
    reader.finish(value)
}

/// The first line of the source that sets a key; for faults that concern several keys.
fn span_in(source: &str, key: &str) -> Option<Range<usize>> {
    let mut start = 0;
    for line in source.split_inclusive('\n') {
        if line.trim_start().strip_prefix(key).is_some_and(|rest| rest.trim_start().starts_with('=')) {
            return Some(start..start + line.trim_end().len());
        }
        start += line.len();
    }
    None
}

/// The most layers that a model may have: matrices grow with the square.
const MOST_LAYERS: i64 = 400;

fn read_layers(r: &mut TomlReader, table: &mut TableReader) -> Option<usize> {
    let layers = table.needed_integer(r, "layers", 1, MOST_LAYERS)? as usize;
    if !layers.is_multiple_of(2) {
        r.fault(Fault::new(CoilError::Layers { found: layers }.to_string(), table.span_of("layers")));
        return None;
    }
    Some(layers)
}

/// Two micrometres that are the same may differ by so much.
const PITCH_ROUNDING: f64 = 1e-9;

fn read_coil(r: &mut TomlReader, table: &mut TableReader, layers: Option<usize>, fibre: Option<Fibre>) -> Option<Coil> {
    let pitch = Limits::between(10.0, 10_000.0);
    let turns_per_layer = table.number(r, "turns_per_layer", Limits::between(1.0, 1e5));
    let inner_diameter_mm = table.number(r, "inner_diameter_mm", Limits::between(1.0, 1e4));
    let mean_diameter_mm = table.number(r, "mean_diameter_mm", Limits::between(1.0, 1e4));
    let radial_pitch_um = table.number(r, "radial_pitch_um", pitch);
    let axial_pitch_um = table.number(r, "axial_pitch_um", pitch);
    let layer_length = table.needed_word(r, "layer_length", &["actual", "equal"]);
    let length_m = table.number(r, "length_m", Limits::between(0.1, 1e6));
    let crossover_turns = table.number(r, "crossover_turns", Limits::between(0.0, 10.0)).unwrap_or(0.0);
    let sagnac = match table.word(r, "sagnac_diameter", &["mean", "by_length"]) {
        Some(1) => SagnacDiameter::ByLength,
        _ => SagnacDiameter::Mean,
    };
    let diameters_stated = (table.has("inner_diameter_mm"), table.has("mean_diameter_mm"));
    if diameters_stated == (false, false) {
        let expected = "a number between 1 and 10000 (or mean_diameter_mm)";
        table.note_missing_one_of(&["inner_diameter_mm", "mean_diameter_mm"], expected.to_owned());
    }
    if diameters_stated == (true, true) {
        let message = "winding.inner_diameter_mm and winding.mean_diameter_mm exclude each other: keep one of them";
        r.fault(Fault::new(message, table.span_of("mean_diameter_mm")));
        return None;
    }
    let layer_length = if layer_length? == 0 { LayerLength::Actual } else { LayerLength::Equal };
    match layer_length {
        LayerLength::Actual if !table.has("turns_per_layer") => {
            table.note_missing_one_of(&["turns_per_layer"], "a number, because layer_length = \"actual\"".to_owned());
        }
        LayerLength::Equal if !table.has("length_m") && !table.has("turns_per_layer") => {
            let expected = "a number between 0.1 and 1000000 (or turns_per_layer)";
            table.note_missing_one_of(&["length_m", "turns_per_layer"], expected.to_owned());
        }
        _ => {}
    }
    // What is stated but wrong is reported already and must not pass for absent.
    let readable = |key: &str, read: Option<f64>| read.is_some() || !table.has(key);
    if !readable("length_m", length_m) || !readable("turns_per_layer", turns_per_layer) {
        return None;
    }
    if turns_per_layer.is_none() && (layer_length == LayerLength::Actual || length_m.is_none()) {
        return None;
    }
    let (fibre, layers) = (fibre?, layers?);
    let radial_pitch_m = radial_pitch_um.map_or(fibre.outer_diameter_m, m_from_um);
    let bore_radius_m = match (inner_diameter_mm, mean_diameter_mm) {
        (Some(inner_mm), None) => 0.5 * m_from_mm(inner_mm),
        (None, Some(mean_mm)) => 0.5 * m_from_mm(mean_mm) - 0.5 * layers as f64 * radial_pitch_m,
        _ => return None,
    };
    let spec = CoilSpec {
        layers,
        turns_per_layer,
        bore_radius_m,
        radial_pitch_m,
        axial_pitch_m: axial_pitch_um.map_or(fibre.outer_diameter_m, m_from_um),
        layer_length,
        length_m,
        fibre,
    };
    made_coil(r, table, spec, crossover_turns).map(|coil| coil.with_sagnac(sagnac))
}

/// The coil of what is stated, where it can be one.
fn made_coil(r: &mut TomlReader, table: &TableReader, spec: CoilSpec, crossover_turns: f64) -> Option<Coil> {
    // Fibre cannot be pressed into less than its own diameter.
    if spec.radial_pitch_m < spec.fibre.outer_diameter_m * (1.0 - PITCH_ROUNDING) {
        let message = format!(
            "winding.radial_pitch_um must be at least fibre.outer_diameter_um = {}, found {}: layers cannot lie closer than the fibre is thick",
            um_from_m(spec.fibre.outer_diameter_m),
            um_from_m(spec.radial_pitch_m)
        );
        r.fault(Fault::new(message, table.span_of("radial_pitch_um")));
        return None;
    }
    match Coil::with_crossovers(spec, crossover_turns) {
        Ok(coil) => Some(coil),
        Err(error) => {
            let span = match error {
                CoilError::LengthDisagrees { .. } => table.span_of("length_m"),
                _ => table.span(),
            };
            r.fault(Fault::new(error.to_string(), span));
            None
        }
    }
}

fn read_pattern(
    r: &mut TomlReader,
    table: &mut TableReader,
    layers: Option<usize>,
    path: &Path,
) -> Option<(NamedPattern, Option<PathBuf>)> {
    let stated = table.text(r, "pattern")?;
    let span = table.span_of("pattern");
    match resolve_pattern(stated, layers?, path.parent()) {
        Ok(named) => Some((named, file_of_pattern(stated, path.parent()))),
        Err(ResolveError::File(faults)) => {
            let shown = faults.faults.iter().map(|fault| fault.message.as_str()).collect::<Vec<_>>().join("; ");
            let message = format!("the pattern file {} has faults", faults.file);
            r.fault(Fault::new(message, span).with_note(shown));
            None
        }
        Err(error) => {
            r.fault(Fault::new(error.to_string(), span));
            None
        }
    }
}

/// Beyond this a grid only costs time.
const MOST_CELLS_PER_LAYER: i64 = 32;

fn read_thermal(r: &mut TomlReader, table: &mut TableReader) -> Option<(Extent, PackMaterial)> {
    let extent = table.needed_word(r, "model", &["pack", "half_space"]);
    let conductivity = table.number(r, "conductivity_w_per_m_k", Limits::between(1e-3, 1e3));
    let capacity = table.number(r, "volumetric_heat_capacity_j_per_m3_k", Limits::between(1e3, 1e8));
    let diffusivity = table.number(r, "diffusivity_m2_per_s", Limits::between(1e-10, 1e-3));
    let both = table.has("conductivity_w_per_m_k") || table.has("volumetric_heat_capacity_j_per_m3_k");
    let material = match (table.has("diffusivity_m2_per_s"), both) {
        (true, true) => {
            let message =
                "thermal.diffusivity_m2_per_s stands instead of conductivity and heat capacity: keep one or the other";
            r.fault(Fault::new(message, table.span_of("diffusivity_m2_per_s")));
            None
        }
        (true, false) => diffusivity.map(|m2_per_s| PackMaterial::Diffusivity { m2_per_s }),
        (false, _) => {
            let pair = ["conductivity_w_per_m_k", "volumetric_heat_capacity_j_per_m3_k"];
            match pair.map(|key| table.has(key)) {
                [true, false] => table.note_missing_one_of(&pair[1..], "a number".to_owned()),
                [false, true] => table.note_missing_one_of(&pair[..1], "a number".to_owned()),
                [false, false] => {
                    let expected = format!("a number, and {} (or diffusivity_m2_per_s alone)", pair[1]);
                    table.note_missing_one_of(&[pair[0], pair[1], "diffusivity_m2_per_s"], expected);
                }
                [true, true] => {}
            }
            conductivity.zip(capacity).map(|(w_per_m_k, heat_capacity_j_per_m3_k)| PackMaterial::Conductivity {
                w_per_m_k,
                heat_capacity_j_per_m3_k,
            })
        }
    };
    let extent = if extent? == 0 { Extent::Pack } else { Extent::HalfSpace };
    Some((extent, material?))
}

fn read_search(r: &mut TomlReader, table: &mut TableReader) -> SearchSettings {
    let stated = table.text(r, "windability");
    let windability = match stated.map(WindabilityClass::parse) {
        Some(None) => {
            let found = stated.unwrap_or_default();
            let message = format!(
                "search.windability must be \"standard\", \"captive:K\" with a number K, or \"any\", found \"{found}\""
            );
            r.fault(Fault::new(message, table.span_of("windability")));
            WindabilityClass::Standard
        }
        Some(Some(class)) => class,
        None => WindabilityClass::Standard,
    };
    let keys = Objective::ALL.map(Objective::key);
    let stated = table.text(r, "objective");
    let objective = stated.map_or(Some(Objective::WorstRate), Objective::from_key).unwrap_or_else(|| {
        let found = stated.unwrap_or_default();
        let message = format!("search.objective must be one of {}, found \"{found}\"", keys.join(", "));
        let near = nearest(found, &keys).map(|near| format!("did you mean \"{near}\"?"));
        let fault = Fault::new(message, table.span_of("objective"));
        r.fault(match near {
            Some(note) => fault.with_note(note),
            None => fault,
        });
        Objective::WorstRate
    });
    let seed = table.integer(r, "seed", 0, i64::MAX).unwrap_or(1) as u64;
    SearchSettings { windability, objective, seed }
}

/// Faults that only the model as a whole can have.
fn check_whole(r: &mut TomlReader, model: &CoilModel, thermal_span: Option<Range<usize>>) {
    match model.heat_path() {
        Err(error) => r.fault(Fault::new(error.to_string(), thermal_span)),
        Ok(path) => {
            if path.extent == Extent::HalfSpace && model.cells_per_layer != DEFAULT_CELLS_PER_LAYER {
                let message = "thermal.cells_per_layer is of the grid of a pack: leave it out where thermal.model is \"half_space\"";
                r.fault(Fault::new(message, thermal_span.clone()));
            }
            if let Err(error) = thermal::check(&path) {
                r.fault(Fault::new(error.to_string(), thermal_span));
            }
        }
    }
}

/// Effects and formulas that name a layer which the coil lacks.
fn check_layers(r: &mut TomlReader, model: &CoilModel, source: &str) {
    let layers = model.coil.layers();
    for effect in &model.effects {
        if let Err(error) = effect.check_layers(layers) {
            let key = effect.spec().parameters.first().map_or("kind", |p| p.key);
            r.fault(Fault::new(error.to_string(), span_in(source, key)));
        }
        if let Subject::Formula(formula) = effect.subject()
            && let Err(error) = formula.check_layers(layers)
        {
            r.fault(Fault::new(format!("effect.formula: {error}"), span_in(source, "formula")));
        }
    }
}

fn advice_for(model: &CoilModel, has_profiles: bool) -> Vec<Advice> {
    let mut advice = Vec::new();
    if !has_profiles {
        advice.push(Advice::DefaultProfiles);
    }
    let film = model.effects.iter().find(|e| e.is_at(effect::FILM)).map(DeclaredEffect::kind);
    match (model.location, film) {
        (Location::OuterLayer, Some(effect)) => advice.push(Advice::FilmMovesSensor { effect }),
        (Location::Ambient, None) if model.heat_path().is_ok_and(|path| path.housings.is_empty()) => {
            advice.push(Advice::AmbientWithoutFilm { film: effect::FILM.spec.kind })
        }
        _ => {}
    }
    if model.extent == Extent::Pack {
        let twice = model.effects.iter().filter(|e| e.spec().kind == effect::END_OF_PACK.kind);
        advice.extend(twice.map(|e| Advice::ChangesNothing { effect: e.kind() }));
    }
    advice
}
