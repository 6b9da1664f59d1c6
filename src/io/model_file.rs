//! Model files: one coil, how it is heated, which physics the model includes, what the search runs over.
//!
//! A file is read whole; all its faults come at once, with the source line and key of each.

use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::coil::{Coil, CoilSpec, Fibre, LayerLength};
use crate::effect::custom::{Formula, FormulaError};
use crate::effect::{self, CATALOGUE, CHANNEL, CUSTOM, DeclaredEffect};
use crate::pattern::Pattern;
use crate::pattern::windability::WindabilityClass;
use crate::profile::{Piece, Profile, ProfileSpec};
use crate::rate::CoilModel;
use crate::thermal::{self, Extent, Location, Material};
use crate::units::{k_per_s_from_c_per_h, m_from_mm, m_from_nm, m_from_um};

use super::fault::{Fault, Faults};
use super::files::read_text;
use super::pattern_file::resolve_pattern;
use super::toml_reader::{Limits, TableReader, TomlReader, nearest, parse};

/// A model file, understood.
#[derive(Debug, Clone)]
pub struct ModelFile {
    pub path: PathBuf,
    /// As read, for hashes and for edits that keep comments.
    pub source: String,
    pub model: CoilModel,
    /// The declared pattern and its name.
    pub pattern: Option<NamedPattern>,
    pub profiles: ProfileSpec,
    pub search: SearchSettings,
    pub advice: Vec<Advice>,
}

/// A pattern under the name by which it was asked for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NamedPattern {
    pub name: String,
    pub pattern: Pattern,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SearchSettings {
    pub windability: WindabilityClass,
    pub seed: u64,
}

/// What a reader of the results should know, though it is no fault.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Advice {
    #[error("[profiles] is absent: profiles of up to 60 °C/h are sampled, 64 of 4 ramps over 6000 s, seed 1")]
    DefaultProfiles,
    #[error(
        "sensor.location is \"outer_layer\", but the effect surface_film makes the drive the ambient air; the film holds"
    )]
    FilmMovesSensor,
    #[error(
        "sensor.location is \"ambient\" without the effect surface_film: the pack's outer surface is taken to have the air's temperature"
    )]
    AmbientWithoutFilm,
    #[error("finite_pack changes nothing where thermal.model is \"pack\" already")]
    FinitePackTwice,
}

/// Used where a file has no [profiles]: steep enough for chamber tests, long enough to settle.
const DEFAULT_MAX_RATE_C_PER_H: f64 = 60.0;
const DEFAULT_COUNT: i64 = 64;
const DEFAULT_SEGMENTS: i64 = 4;
const DEFAULT_DURATION_S: f64 = 6000.0;

/// Reads and checks a model file.
///
/// # Errors
/// All faults of the file at once.
pub fn read_model(path: &Path) -> Result<ModelFile, Faults> {
    let source = read_text(path)?;
    parse_model(path, &source)
}

/// As [`read_model`], of a text that was read already; `path` places relative pattern files and names the source.
///
/// # Errors
/// All faults of the text at once.
pub fn parse_model(path: &Path, source: &str) -> Result<ModelFile, Faults> {
    let file = path.display().to_string();
    let document = parse(&file, source)?;
    let mut reader = TomlReader::new(&file, source);
    let r = &mut reader;
    let mut root = r.root(&document);
    let name = root.needed_text(r, "name", "a string").map(str::to_owned);
    let mut fibre_table = root.needed_table(r, "fibre");
    let mut winding = root.needed_table(r, "winding");
    let mut thermal = root.needed_table(r, "thermal");
    let mut sensor = root.table(r, "sensor");
    let effect_tables = root.tables(r, "effect");
    let mut profiles_table = root.table(r, "profiles");
    let mut search_table = root.table(r, "search");
    root.finish(r);

    let fibre = read_fibre(r, &mut fibre_table);
    fibre_table.finish(r);
    let coil = read_coil(r, &mut winding, fibre);
    let pattern = read_pattern(r, &mut winding, path);
    winding.finish(r);
    let thermal_parts = read_thermal(r, &mut thermal);
    let thermal_span = thermal.span();
    thermal.finish(r);
    let location = match sensor.word(r, "location", &["outer_layer", "ambient"]) {
        Some(1) => Location::Ambient,
        _ => Location::OuterLayer,
    };
    let rate_mean_s = sensor.number(r, "rate_mean_s", Limits::between(0.0, 1e5)).unwrap_or(0.0);
    sensor.finish(r);
    let effects = read_effects(r, effect_tables);
    let has_profiles = profiles_table.is_present();
    let profiles = read_profiles(r, &mut profiles_table);
    profiles_table.finish(r);
    let search = read_search(r, &mut search_table);
    search_table.finish(r);

    let whole = (|| {
        let (extent, material) = thermal_parts?;
        Some(CoilModel { name: name?, coil: coil?, extent, material, location, rate_mean_s, effects: effects? })
    })();
    if let Some(model) = &whole {
        check_whole(r, model, thermal_span);
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
        ModelFile { path: path.to_owned(), source: source.to_owned(), model, pattern, profiles, search, advice }
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

fn read_fibre(r: &mut TomlReader, table: &mut TableReader) -> Option<Fibre> {
    let refractive_index = table.needed_number(r, "refractive_index", Limits::between(1.0, 4.0));
    let thermo_optic_per_k = table.needed_number(r, "thermo_optic_per_k", Limits::between(-1e-3, 1e-3));
    let thermal_expansion_per_k = table.number(r, "thermal_expansion_per_k", Limits::between(-1e-3, 1e-3));
    let wavelength_nm = table.needed_number(r, "wavelength_nm", Limits::between(200.0, 10_000.0));
    let outer_diameter_um = table.needed_number(r, "outer_diameter_um", Limits::between(10.0, 5_000.0));
    Some(Fibre {
        refractive_index: refractive_index?,
        thermo_optic_per_k: thermo_optic_per_k?,
        thermal_expansion_per_k: thermal_expansion_per_k.unwrap_or(0.0),
        wavelength_m: m_from_nm(wavelength_nm?),
        outer_diameter_m: m_from_um(outer_diameter_um?),
    })
}

/// The most layers that a model may have: matrices grow with the square.
const MOST_LAYERS: i64 = 400;

fn read_coil(r: &mut TomlReader, table: &mut TableReader, fibre: Option<Fibre>) -> Option<Coil> {
    let pitch = Limits::between(10.0, 10_000.0);
    let layers = table.needed_integer(r, "layers", 1, MOST_LAYERS);
    let layers = layers.filter(|&found| {
        let even = found % 2 == 0;
        if !even {
            let message = crate::coil::CoilError::Layers { found: found as usize }.to_string();
            r.fault(Fault::new(message, table.span_of("layers")));
        }
        even
    });
    let turns_per_layer = table.number(r, "turns_per_layer", Limits::between(1.0, 1e5));
    let inner_diameter_mm = table.number(r, "inner_diameter_mm", Limits::between(1.0, 1e4));
    let mean_diameter_mm = table.number(r, "mean_diameter_mm", Limits::between(1.0, 1e4));
    let radial_pitch_um = table.number(r, "radial_pitch_um", pitch);
    let axial_pitch_um = table.number(r, "axial_pitch_um", pitch);
    let layer_length = table.needed_word(r, "layer_length", &["actual", "equal"]);
    let length_m = table.number(r, "length_m", Limits::between(0.1, 1e6));
    let diameters_stated = (table.has("inner_diameter_mm"), table.has("mean_diameter_mm"));
    if diameters_stated == (false, false) && table.is_present() {
        let message =
            "missing key winding.inner_diameter_mm: expected a number between 1 and 10000 (or mean_diameter_mm)";
        r.fault(Fault::new(message, table.span()));
    }
    if diameters_stated == (true, true) {
        let message = "winding.inner_diameter_mm and winding.mean_diameter_mm exclude each other: keep one of them";
        r.fault(Fault::new(message, table.span_of("mean_diameter_mm")));
        return None;
    }
    let (fibre, layers) = (fibre?, layers?);
    let layer_length = if layer_length? == 0 { LayerLength::Actual } else { LayerLength::Equal };
    let radial_pitch_m = radial_pitch_um.map_or(fibre.outer_diameter_m, m_from_um);
    let bore_radius_m = match (inner_diameter_mm, mean_diameter_mm) {
        (Some(inner_mm), None) => 0.5 * m_from_mm(inner_mm),
        (None, Some(mean_mm)) => 0.5 * m_from_mm(mean_mm) - 0.5 * layers as f64 * radial_pitch_m,
        _ => return None,
    };
    let spec = CoilSpec {
        layers: layers as usize,
        turns_per_layer,
        bore_radius_m,
        radial_pitch_m,
        axial_pitch_m: axial_pitch_um.map_or(fibre.outer_diameter_m, m_from_um),
        layer_length,
        length_m,
        fibre,
    };
    match Coil::new(spec) {
        Ok(coil) => Some(coil),
        Err(error) => {
            let span = match error {
                crate::coil::CoilError::LengthDisagrees { .. } => table.span_of("length_m"),
                _ => table.span(),
            };
            r.fault(Fault::new(error.to_string(), span));
            None
        }
    }
}

fn read_pattern(r: &mut TomlReader, table: &mut TableReader, path: &Path) -> Option<NamedPattern> {
    let stated = table.text(r, "pattern")?;
    let span = table.span_of("pattern");
    let layers = table.integer(r, "layers", 1, MOST_LAYERS).filter(|l| l % 2 == 0)? as usize;
    match resolve_pattern(stated, layers, path.parent()) {
        Ok(named) => Some(named),
        Err(error) => {
            r.fault(Fault::new(error.to_string(), span));
            None
        }
    }
}

fn read_thermal(r: &mut TomlReader, table: &mut TableReader) -> Option<(Extent, Material)> {
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
        (true, false) => diffusivity.map(|m2_per_s| Material::Diffusivity { m2_per_s }),
        (false, _) => {
            for key in ["conductivity_w_per_m_k", "volumetric_heat_capacity_j_per_m3_k"] {
                if table.is_present() && !table.has(key) {
                    let message =
                        format!("missing key thermal.{key}: expected a number (or give diffusivity_m2_per_s)");
                    r.fault(Fault::new(message, table.span()));
                }
            }
            conductivity.zip(capacity).map(|(w_per_m_k, heat_capacity_j_per_m3_k)| Material::Conductivity {
                w_per_m_k,
                heat_capacity_j_per_m3_k,
            })
        }
    };
    let extent = if extent? == 0 { Extent::Pack } else { Extent::HalfSpace };
    Some((extent, material?))
}

fn read_effects(r: &mut TomlReader, tables: Vec<TableReader>) -> Option<Vec<DeclaredEffect>> {
    let mut effects: Vec<DeclaredEffect> = Vec::new();
    let mut clean = true;
    for mut table in tables {
        let effect = read_effect(r, &mut table);
        let kind_span = table.span_of("kind");
        match effect {
            Some(effect) if effects.iter().any(|e| e.kind() == effect.kind() && e.spec().kind != CUSTOM.kind) => {
                let message = format!("the effect {} is declared twice: keep one of them", effect.kind());
                r.fault(Fault::new(message, kind_span));
                clean = false;
            }
            Some(effect) => {
                effects.push(effect);
                table.finish(r);
            }
            None => clean = false,
        }
    }
    clean.then_some(effects)
}

fn read_effect(r: &mut TomlReader, table: &mut TableReader) -> Option<DeclaredEffect> {
    let kinds: Vec<&str> = CATALOGUE.iter().chain([&CHANNEL, &CUSTOM]).map(|s| s.kind).collect();
    if !table.has("kind") {
        r.fault(Fault::new(format!("missing key effect.kind: expected one of {}", kinds.join(", ")), table.span()));
        return None;
    }
    let kind = table.text(r, "kind")?;
    if let Some(name) = kind.strip_prefix("channel:") {
        return read_channel(r, table, name);
    }
    if kind == CUSTOM.kind {
        return read_custom(r, table);
    }
    let Some(spec) = effect::find(kind) else {
        let mut fault = Fault::new(format!("effect.kind \"{kind}\" is not in the catalogue"), table.span_of("kind"));
        fault = match nearest(kind, &kinds) {
            Some(near) => fault.with_note(format!("did you mean \"{near}\"?")),
            None => fault.with_note(format!("known effects: {}", kinds.join(", "))),
        };
        r.fault(fault);
        return None;
    };
    let mut values = Vec::new();
    for parameter in spec.parameters {
        let limits = Limits::between(parameter.lower, parameter.upper);
        let stated = match parameter.default {
            Some(default) if !table.has(parameter.key) => Some(default),
            _ => table.needed_number(r, parameter.key, limits),
        };
        // Registers the key as known also where the default stands in for it.
        let _ = parameter.default.and_then(|_| table.number(r, parameter.key, limits));
        values.push(stated.map(|v| parameter.unit.to_si(v)));
    }
    let mut choices = Vec::new();
    for choice in spec.choices {
        choices.push(table.needed_word(r, choice.key, choice.options));
    }
    let values: Option<Vec<f64>> = values.into_iter().collect();
    let choices: Option<Vec<usize>> = choices.into_iter().collect();
    let Some((values, choices)) = values.zip(choices) else {
        // What is missing or unknown is reported here, because the caller drops the table.
        std::mem::replace(table, TableReader::gone()).finish(r);
        return None;
    };
    match DeclaredEffect::new(spec, values, choices) {
        Ok(effect) => Some(effect),
        Err(error) => {
            r.fault(Fault::new(error.to_string(), table.span()));
            None
        }
    }
}

fn read_channel(r: &mut TomlReader, table: &mut TableReader, name: &str) -> Option<DeclaredEffect> {
    if name.is_empty() {
        r.fault(Fault::new(
            "effect.kind \"channel:\" lacks the column's name: write channel:NAME",
            table.span_of("kind"),
        ));
    }
    let parameter = &CHANNEL.parameters[0];
    let gain = table.needed_number(r, parameter.key, Limits::between(parameter.lower, parameter.upper));
    match gain {
        Some(gain) if !name.is_empty() => Some(DeclaredEffect::channel(name, parameter.unit.to_si(gain))),
        _ => {
            std::mem::replace(table, TableReader::gone()).finish(r);
            None
        }
    }
}

fn read_custom(r: &mut TomlReader, table: &mut TableReader) -> Option<DeclaredEffect> {
    let source = table.needed_text(r, "formula", "a formula in °/h");
    let formula_span = table.span_of("formula");
    let mut parameters = table.table(r, "parameters");
    let named = parameters.all_numbers(r);
    let effect = source.zip(named).and_then(|(source, named)| {
        let (names, values): (Vec<String>, Vec<f64>) = named.into_iter().unzip();
        match Formula::new(source, names) {
            // The number of values is that of the names.
            Ok(formula) => DeclaredEffect::custom(formula, values).ok(),
            Err(error) => {
                r.fault(Fault::new(format!("effect.formula: {error}"), formula_place(&error, formula_span)));
                None
            }
        }
    });
    if effect.is_none() {
        std::mem::replace(table, TableReader::gone()).finish(r);
    }
    effect
}

/// The character of the source at which a formula goes wrong: its place in the string, behind the opening quote.
fn formula_place(error: &FormulaError, string: Option<Range<usize>>) -> Option<Range<usize>> {
    let string = string?;
    let FormulaError::Expression(error) = error else { return Some(string) };
    let at = error.at()?;
    let start = (string.start + 1 + at.start).min(string.end.saturating_sub(1));
    Some(start..(string.start + 1 + at.end).clamp(start, string.end))
}

fn read_profiles(r: &mut TomlReader, table: &mut TableReader) -> ProfileSpec {
    let rate = Limits::between(1e-6, 1e6);
    let max_rate = if table.is_present() { table.needed_number(r, "max_rate_c_per_h", rate) } else { None };
    let max_rate_c_per_h = max_rate.unwrap_or(DEFAULT_MAX_RATE_C_PER_H);
    let count = table.integer(r, "count", 0, 100_000).unwrap_or(DEFAULT_COUNT);
    let segments = table.integer(r, "segments", 1, 1_000).unwrap_or(DEFAULT_SEGMENTS);
    let duration_s = table.number(r, "duration_s", Limits::between(1e-3, 1e8)).unwrap_or(DEFAULT_DURATION_S);
    let seed = table.integer(r, "seed", 0, i64::MAX).unwrap_or(1);
    let mut listed: Vec<Profile> = Vec::new();
    let ramps = table.tables(r, "ramp");
    if count == 0 && ramps.is_empty() {
        let message = "profiles.count is 0 and no profile is listed: list a [[profiles.ramp]] or sample some";
        r.fault(Fault::new(message, table.span_of("count")));
    }
    for mut ramp in ramps {
        if let Some(profile) = read_ramp(r, &mut ramp, max_rate) {
            if listed.iter().any(|p| p.name() == profile.name()) {
                let message = format!("two profiles are called \"{}\": rename one", profile.name());
                r.fault(Fault::new(message, ramp.span_of("name")));
            }
            listed.push(profile);
        }
        ramp.finish(r);
    }
    ProfileSpec {
        max_rate_k_per_s: k_per_s_from_c_per_h(max_rate_c_per_h),
        count: count as usize,
        segments: segments as usize,
        duration_s,
        seed: seed as u64,
        listed,
    }
}

fn read_ramp(r: &mut TomlReader, table: &mut TableReader, max_rate_c_per_h: Option<f64>) -> Option<Profile> {
    let name = table.needed_text(r, "name", "a string");
    let pieces_span = table.span_of("pieces").or_else(|| table.span());
    if !table.has("pieces") {
        let message = "missing key profiles.ramp.pieces: expected an array of { rate_c_per_h, duration_s }";
        r.fault(Fault::new(message, table.span()));
    }
    let mut pieces = Vec::new();
    let mut clean = true;
    for mut piece in table.tables(r, "pieces") {
        let rate = piece.needed_number(r, "rate_c_per_h", Limits::between(-1e6, 1e6));
        let duration = piece.needed_number(r, "duration_s", Limits::between(1e-6, 1e8));
        if let (Some(rate), Some(most)) = (rate, max_rate_c_per_h)
            && rate.abs() > most * (1.0 + 1e-12)
        {
            let message = format!(
                "profiles.ramp.pieces.rate_c_per_h must not exceed profiles.max_rate_c_per_h = {most}, found {rate}: \
                 raise the bound, the guaranteed worst case rests on it"
            );
            r.fault(Fault::new(message, piece.span_of("rate_c_per_h")));
        }
        match rate.zip(duration) {
            Some((rate, duration_s)) => pieces.push(Piece { rate_k_per_s: k_per_s_from_c_per_h(rate), duration_s }),
            None => clean = false,
        }
        piece.finish(r);
    }
    let name = name?;
    if !clean || !table.has("pieces") {
        return None;
    }
    match Profile::new(name, pieces) {
        Ok(profile) => Some(profile),
        Err(error) => {
            r.fault(Fault::new(format!("profiles.ramp \"{name}\": {error}"), pieces_span));
            None
        }
    }
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
    let seed = table.integer(r, "seed", 0, i64::MAX).unwrap_or(1) as u64;
    SearchSettings { windability, seed }
}

/// Faults that only the model as a whole can have.
fn check_whole(r: &mut TomlReader, model: &CoilModel, thermal_span: Option<Range<usize>>) {
    match model.heat_path() {
        Err(error) => r.fault(Fault::new(error.to_string(), thermal_span)),
        Ok(path) => {
            if let Err(error) = thermal::check(&path) {
                r.fault(Fault::new(error.to_string(), thermal_span));
            }
        }
    }
}

fn advice_for(model: &CoilModel, has_profiles: bool) -> Vec<Advice> {
    let declares = |kind: &str| model.effects.iter().any(|e| e.spec().kind == kind);
    let mut advice = Vec::new();
    if !has_profiles {
        advice.push(Advice::DefaultProfiles);
    }
    match (model.location, declares("surface_film")) {
        (Location::OuterLayer, true) => advice.push(Advice::FilmMovesSensor),
        (Location::Ambient, false) => advice.push(Advice::AmbientWithoutFilm),
        _ => {}
    }
    if model.extent == Extent::Pack && declares("finite_pack") {
        advice.push(Advice::FinitePackTwice);
    }
    advice
}
