//! A chamber whose air is known beforehand: what it does to a pack, what the sensor will show, and what will be made of it.

use super::air::{Scene, behind_film};
use super::{Air, Boundary, BoundaryError, Observation, RateWhitener, check, kinks};
use crate::numeric::piecewise::PiecewiseLinear;
use crate::thermal::{self, Drive, Extent, HeatPath, Instant, Location, ThermalError};

/// A pack in air of a known course.
#[derive(Debug, Clone)]
pub struct Exposure {
    /// As the air, or the outermost layer, drives it.
    pub path: HeatPath,
    pub drive: Drive,
    /// What the sensor shows at each time, without noise.
    pub shown_k: Vec<f64>,
}

/// Times at which the sensor's input is worked out between two readings.
const STEPS_PER_READING: usize = 5;

/// Puts a pack into air, the film being that of the chamber where the path does not state where the sensor's air is.
///
/// A half space is behind the film as if it ended at the bore, which is also how a boundary is estimated for it.
///
/// # Errors
/// A heat path that cannot be solved.
pub fn expose(
    path: &HeatPath,
    film_w_per_m2_k: Option<f64>,
    lag_s: f64,
    air_k: &PiecewiseLinear,
    times_s: &[f64],
) -> Result<Exposure, ThermalError> {
    let by_air = Drive::boundary(air_k.clone());
    if path.location == Location::Ambient {
        let shown_k = lagging(air_k, lag_s, times_s);
        return Ok(Exposure { path: path.clone(), drive: by_air, shown_k });
    }
    let slope_per_k = path.conductivity_slope_per_k;
    let mut in_air = behind_film(path);
    in_air.film_w_per_m2_k = film_w_per_m2_k;
    let linear = HeatPath { conductivity_slope_per_k: 0.0, ..in_air.clone() };
    let between = |w: &[f64]| -> Vec<f64> {
        let share = |step: usize| step as f64 / STEPS_PER_READING as f64;
        (0..STEPS_PER_READING).map(|step| w[0] + share(step) * (w[1] - w[0])).collect()
    };
    let fine_s: Vec<f64> = times_s.windows(2).flat_map(between).chain(times_s.last().copied()).collect();
    let layers = path.shape.layers;
    let instants: Vec<Instant> = fine_s.iter().map(|&t| Instant::after(t)).collect();
    let field = thermal::solve(&linear, &by_air)?.at(&instants);
    let mut outer: Vec<f64> = (0..fine_s.len()).map(|row| field.temperatures_k(row)[layers - 1]).collect();
    if slope_per_k != 0.0 && path.extent == Extent::Pack {
        let terms = thermal::slope_series(&linear.without_flanges(), &by_air, &fine_s, 0.0)?;
        for (row, value) in outer.iter_mut().enumerate() {
            let powers = thermal::slope_powers(slope_per_k);
            *value += terms.iter().zip(powers).map(|(t, p)| p * t.temperature_k[(row + 1) * layers - 1]).sum::<f64>();
        }
    }
    let outer_k = PiecewiseLinear::new(fine_s, outer).expect("the times are in order");
    let shown_k = lagging(&outer_k, lag_s, times_s);
    Ok(match path.extent {
        Extent::HalfSpace => {
            let drive = Drive { boundary_k: outer_k, ambient_k: by_air.ambient_k.or(Some(by_air.boundary_k)) };
            Exposure { path: path.clone(), drive, shown_k }
        }
        Extent::Pack => {
            in_air.conductivity_slope_per_k = slope_per_k;
            Exposure { path: in_air, drive: by_air, shown_k }
        }
    })
}

/// A course as a sensor shows it that follows with a lag, at rest at first.
fn lagging(course: &PiecewiseLinear, lag_s: f64, times_s: &[f64]) -> Vec<f64> {
    if lag_s <= 0.0 {
        return times_s.iter().map(|&t| course.value(t)).collect();
    }
    let mut stops: Vec<f64> = course.knots().iter().chain(times_s).copied().collect();
    stops.sort_by(f64::total_cmp);
    stops.dedup();
    let (mut at_s, mut shown) = (stops[0], course.value(stops[0]));
    let mut shown_k = Vec::with_capacity(times_s.len());
    let mut wanted = times_s.iter().peekable();
    for stop_s in stops {
        let step_s = stop_s - at_s;
        if step_s > 0.0 {
            // T_s' = (T − T_s)/τ with T straight between the stops.
            let (from, to) = (course.value(at_s), course.value(stop_s));
            let (slope, left) = ((to - from) / step_s, (-step_s / lag_s).exp());
            shown = to - slope * lag_s + (shown - from + slope * lag_s) * left;
            at_s = stop_s;
        }
        if wanted.next_if(|w| **w == stop_s).is_some() {
            shown_k.push(shown);
        }
    }
    shown_k
}

impl Boundary {
    /// The boundary of readings in a chamber of which everything is known but what the readings say: no search.
    ///
    /// # Errors
    /// As [`super::estimate`].
    pub fn in_known_chamber(observation: &Observation, air: &Air) -> Result<Self, BoundaryError> {
        check(observation)?;
        Self::new(Scene::new(observation)?, air.clone())?.unbent(observation, |_, air| Ok(air))
    }
}

/// What a heat path makes of such a chamber that is not the true one: the film and the kinks' times that suit it best.
///
/// # Errors
/// As [`super::estimate`].
pub fn seen_by_another(observation: &Observation, air: &Air) -> Result<Air, BoundaryError> {
    check(observation)?;
    let follow = |scene: &mut Scene, mut air: Air| {
        kinks::place(scene, &mut air)?;
        Ok(air)
    };
    let mut scene = Scene::new(observation)?;
    let air = follow(&mut scene, air.clone())?;
    Ok(Boundary::new(scene, air)?.unbent(observation, follow)?.air)
}

/// As [`Boundary::rate_whitener`] of readings in such a chamber; it does not depend on what they say.
///
/// # Errors
/// A heat path that cannot be solved.
pub fn planned_whitener(
    observation: &Observation,
    air: &Air,
    noise_rad_per_s: f64,
) -> Result<RateWhitener, BoundaryError> {
    RateWhitener::new(&Scene::new(observation)?, air, noise_rad_per_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::boundary::Kink;
    use crate::thermal::{Flange, FlangeFilm, Material, PackShape};

    const FILM_W_PER_M2_K: f64 = 25.0;
    const RATE_K_PER_S: f64 = 1.0 / 60.0;

    #[test]
    fn what_a_sensor_shows_of_known_air_leads_back_to_that_air() {
        let shape = PackShape { layers: 12, bore_radius_m: 0.04, radial_pitch_m: 165e-6, height_m: 8.5e-3 };
        let material = Material::Conductivity { w_per_m_k: 0.35, heat_capacity_j_per_m3_k: 1.7e6 };
        let plain = HeatPath::new(shape, Extent::Pack, material, Location::OuterLayer);
        let air_k = PiecewiseLinear::new(vec![0.0, 600.0, 2400.0, 4000.0], vec![293.0, 293.0, 323.0, 323.0]).unwrap();
        let times_s: Vec<f64> = (0..=400).map(|i| 10.0 * f64::from(i)).collect();
        let kink = |time_s: f64, slope_change_k_per_s: f64| Kink { time_s, slope_change_k_per_s };
        let flange = Some(FlangeFilm { flange: Flange::First, film_w_per_m2_k: 40.0 });
        let paths = [
            ("plain", plain.clone(), 0.0),
            ("lagging", plain.clone(), 40.0),
            ("bent", HeatPath { conductivity_slope_per_k: 0.003, ..plain.clone() }, 0.0),
            ("half space", HeatPath { extent: Extent::HalfSpace, ..plain.clone() }, 0.0),
            ("flange", HeatPath { flange, ..plain.clone() }, 0.0),
            ("in the air", HeatPath { location: Location::Ambient, film_w_per_m2_k: Some(25.0), ..plain }, 20.0),
        ];
        for (name, path, lag_s) in paths {
            let film_w_per_m2_k = (path.location == Location::OuterLayer).then_some(FILM_W_PER_M2_K);
            let exposed = expose(&path, film_w_per_m2_k, lag_s, &air_k, &times_s).unwrap();
            assert!(exposed.shown_k[240] < air_k.value(2400.0) - 0.1 * lag_s * RATE_K_PER_S);
            let air = Air {
                film_w_per_m2_k,
                jerk_noise_k2_per_s7: 1e-22,
                kinks: vec![kink(600.0, RATE_K_PER_S), kink(2400.0, -RATE_K_PER_S)],
                noise_k: 0.004,
            };
            let observation = Observation {
                times_s: &times_s,
                temperature_k: &exposed.shown_k,
                path: &path,
                lag_s,
                layer_gain_rad_per_k: &[1e-6; 12],
                rate_mean_s: 10.0,
            };
            let found = Boundary::in_known_chamber(&observation, &air).unwrap();
            if lag_s == 0.0 && path.location == Location::OuterLayer {
                let error_k = times_s.iter().zip(&exposed.shown_k).map(|(&t, shown)| found.outer_k().value(t) - shown);
                let error_k = error_k.fold(0.0, |most: f64, e| most.max(e.abs()));
                println!("{name}: outermost layer off by {error_k:.1e} K at most");
                assert!(error_k < 5e-5, "{name}");
            }
            if path.conductivity_slope_per_k != 0.0 {
                continue;
            }
            let (driven, drive) = found.driving(&path, 0.0);
            let rates = |path: &HeatPath, drive: &Drive| {
                thermal::solve(path, drive).unwrap().means(&times_s, 10.0).rate_k_per_s
            };
            let (again, truth) = (rates(&driven, &drive), rates(&exposed.path, &exposed.drive));
            let error = again.iter().zip(&truth).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / RATE_K_PER_S;
            println!("{name}: rates off by {error:.1e} of the ramp's at most");
            assert!(error < 3e-4, "{name}");
        }
    }
}
