//! The effect `surface_film`: equation, parameters, source and signature stand in its `SPEC`.

use super::{Acts, Effect, EffectSpec, Nature, ParameterSpec};
use crate::thermal::{HeatPath, Location};
use crate::units::Unit;

pub(super) const SPEC: EffectSpec = EffectSpec {
    kind: "surface_film",
    summary: "The sensor (or the profile) is the ambient air; the outer layer follows through a film",
    equation: "k dT/dr = h (T_air − T) at r = r_out",
    acts: Acts::HeatPath,
    nature: Nature::Physical,
    parameters: &[ParameterSpec {
        key: "film_w_per_m2_k",
        unit: Unit::WattPerSquareMetreKelvin,
        meaning: "film coefficient at the outer surface",
        lower: 0.5,
        upper: 100000.0,
        start: 30.0,
        default: None,
    }],
    choices: &[],
    source: "Newton's law of cooling; film coefficients of free and forced air 2 … 250 W/(m²K), Incropera et al., table 1.1",
    signature: "the measured error begins late and rounded after each change of the recorded temperature's rate; the delay is about the pack's heat capacity over h",
    happens: "What the sensor shows is the air, and the outermost layer follows it late through the film of air around the coil.",
    remedy: "Place the sensor under the outermost layer's lacquer, or declare sensor.location = \"ambient\" with this film; more air speed makes the film's delay shorter and the coil's error larger.",
    experiment: "a second sensor under the outermost layer's lacquer, or another air speed in the chamber",
    build: |values, _, _| Box::new(SurfaceFilm { film_w_per_m2_k: values[0] }),
};

#[derive(Debug)]
struct SurfaceFilm {
    film_w_per_m2_k: f64,
}

impl Effect for SurfaceFilm {
    fn change_heat_path(&self, path: &mut HeatPath) {
        // A sensor on a housing, the spool or a flange stays there: the film then joins the air to the coil behind it.
        if path.location == Location::OuterLayer {
            path.location = Location::Ambient;
        }
        path.film_w_per_m2_k = Some(self.film_w_per_m2_k);
    }
}
