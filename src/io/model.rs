//! What a model file states, understood: read by `read`, answered about by `json` and `write`.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::chamber::{Estimate, Learned};
use crate::effect::DeclaredEffect;
use crate::io::record_format::RecordFormat;
use crate::pattern::Pattern;
use crate::pattern::windability::WindabilityClass;
use crate::profile::ProfileSpec;
use crate::rate::CoilModel;
use crate::schedule::production::Production;
use crate::search::cost::objective::Objective;
use crate::search::cost::tolerance::ToleranceSpec;
use crate::stress::material::Material;
use crate::thermal::{Flange, Location};

/// A model file, understood.
#[derive(Debug, Clone)]
pub struct ModelFile {
    /// Where it was read.
    pub path: PathBuf,
    /// As read, for hashes and for edits that keep comments.
    pub source: String,
    /// The coil.
    pub model: CoilModel,
    /// The declared pattern and its name.
    pub pattern: Option<NamedPattern>,
    /// The file that the declared pattern stands in, where it is no winding's name.
    pub pattern_file: Option<PathBuf>,
    /// The temperature profiles that windings are judged on.
    pub profiles: ProfileSpec,
    /// What a search takes unless it is told otherwise.
    pub search: SearchSettings,
    /// The winding shop and the fibre's description.
    pub production: Production,
    /// How built coils spread; None where the file does not say.
    pub tolerance: Option<ToleranceSpec>,
    /// How its records are to be read.
    pub record: RecordFormat,
    /// What could be meant otherwise.
    pub advice: Vec<Advice>,
    /// winding.length_m, where it is stated.
    pub stated_length_m: Option<f64>,
    /// What records taught of film, offset and chamber.
    pub learned: Option<Learned>,
    /// Materials that the file itself defines.
    pub own_materials: Vec<Material>,
}

impl ModelFile {
    /// The files that it was read from: itself, and its pattern's.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        std::iter::once(&self.path).chain(&self.pattern_file).map(PathBuf::as_path)
    }

    /// As a search sees it: profiles are courses of the air, which reaches the coil through the film that records showed.
    pub fn for_search(mut self) -> Self {
        if let Some(film) = self.learned_film() {
            self.model.effects.push(DeclaredEffect::film(film.value));
            self.advice.retain(|a| !matches!(a, Advice::PrescribedBoundary { .. }));
            self.advice.push(Advice::LearnedFilm {
                film_w_per_m2_k: film.value,
                standard_error_w_per_m2_k: film.standard_error,
            });
        }
        self
    }

    /// The film that records showed, where the model declares none and is not driven by the air already.
    pub(crate) fn learned_film(&self) -> Option<Estimate> {
        let film = self.learned.as_ref()?.film_w_per_m2_k?;
        let path = self.model.heat_path().ok()?;
        (path.location == Location::OuterLayer && path.film_w_per_m2_k.is_none()).then_some(film)
    }
}

/// What `sensor.location` can be.
pub(crate) const LOCATIONS: &[&str] = &[
    "outer_layer",
    "ambient",
    "first_housing",
    "second_housing",
    "third_housing",
    "spool",
    "first_flange",
    "second_flange",
];

/// By its place among them.
pub(crate) fn location_of(word: usize) -> Location {
    match word {
        0 => Location::OuterLayer,
        1 => Location::Ambient,
        2..=4 => Location::Housing(word - 2),
        5 => Location::Spool,
        6 => Location::Flange(Flange::First),
        _ => Location::Flange(Flange::Second),
    }
}

/// A pattern under the name by which it was asked for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NamedPattern {
    /// A classic's name or the pattern file's.
    pub name: String,
    /// The winding itself.
    pub pattern: Pattern,
}

/// What a model file states under `[search]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SearchSettings {
    /// What the winding shop can wind.
    pub windability: WindabilityClass,
    /// What is made small.
    pub objective: Objective,
    /// Of the search's random numbers.
    pub seed: u64,
}

/// What a reader of the results should know, though it is no fault.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum Advice {
    #[error("[profiles] is absent: profiles of up to 60 °C/h are sampled, 64 of 4 ramps over 6000 s, seed 1")]
    DefaultProfiles,
    #[error(
        "sensor.location is \"outer_layer\", but the effect {effect} makes the drive the ambient air; the film holds"
    )]
    FilmMovesSensor { effect: String },
    #[error(
        "sensor.location is \"ambient\" without the effect {film}: the pack's outer surface is taken to have the air's temperature"
    )]
    AmbientWithoutFilm { film: &'static str },
    #[error("{effect} changes nothing where thermal.model is \"pack\" already")]
    ChangesNothing { effect: String },
    #[error("{0}")]
    Unusual(Unusual),
    #[error(
        "winding.length_m = {stated_m} is not what turns and radii make: {used_m:.2} m is used; correct one of them, or leave length_m out"
    )]
    LengthNotUsed { stated_m: f64, used_m: f64 },
    #[error(
        "the outermost layer's temperature is prescribed: the first instant of a ramp then heats that layer alone, and windings that put the same pieces of fibre there, such as dip and qua, tie; where air surrounds the coil declare the effect {film} with sensor.location = \"ambient\""
    )]
    PrescribedBoundary { film: &'static str },
    #[error(
        "profiles are courses of the air, which reaches the coil through the film of {film_w_per_m2_k:.3} ± {standard_error_w_per_m2_k:.2} W/(m²K) that the records showed ([boundary]); take that table out to prescribe the outermost layer"
    )]
    LearnedFilm { film_w_per_m2_k: f64, standard_error_w_per_m2_k: f64 },
}

/// A value outside the range in which it usually lies.
#[derive(Debug, Clone, PartialEq)]
pub struct Unusual {
    pub(crate) key: &'static str,
    pub(crate) found: f64,
    pub(crate) low: f64,
    pub(crate) high: f64,
    pub(crate) unit: &'static str,
}

impl fmt::Display for Unusual {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { key, found, low, high, unit } = self;
        write!(f, "{key} = {found} is unusual: expected between {low} and {high}{unit}; check the unit")
    }
}
