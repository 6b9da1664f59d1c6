//! The temperature that drove a measured record, from the sensor's noisy readings.
//!
//! Differentiating a thermocouple amplifies its noise, and smoothing it first smears every change of ramp. So the air
//! around the pack is treated as latent: piecewise smooth, with few kinks, seen through a film, the pack and the sensor.
//!
//! ```text
//! a' = s,  s' = c + Σ_i σ_i δ(t − t_i),  c' = b,  db ~ N(0, q dt)   air: temperature, slope, curvature, jerk; kinks σ_i
//! y_i' = −λ_i y_i + s                                                modes of the pack behind the film
//! T_out = a − Σ_i a_i y_i,   τ T_s' = T_out − T_s,   reading = T_s + N(0, σ²)
//! ```
//!
//! | symbol | meaning | unit | in code |
//! |---|---|---|---|
//! | h | film coefficient, in λ_i and a_i | W/(m² K) | `film_w_per_m2_k` |
//! | t_i, σ_i | time and size of a kink | s, K/s | `Kink` |
//! | q | how fast the jerk wanders | K²/s⁷ | `jerk_noise_k2_per_s7` |
//! | τ | lag of the sensor | s | `lag_s` |
//! | σ | noise of one reading | K | `noise_k` |
//!
//! With h, q, t_i given everything is linear and Gaussian. They are chosen by maximum likelihood: kinks are added where
//! a further shock to the slope would be most significant, moved by Newton steps on the score of a shift in time, and
//! dropped where they do not stand out. The uncertainty of what is left (that of the kinks' times included) is carried
//! into the predicted rate error.
//!
//! What heat from the bore adds to the outermost layer is taken from the readings first, and put back; so is what a
//! conductivity that depends on temperature does to it.
//!
//! Leaves out: what a half space conducts below the bore; it is estimated as if the pack ended there.
//!
//! # Source
//! Structural time-series models: Harvey, Forecasting, Structural Time Series Models and the Kalman Filter (1989),
//! chapters 2 and 7; shocks after de Jong and Penzer, J. Am. Stat. Assoc. 93 (1998) 796.

mod air;
mod filmed;
mod kinks;
#[cfg(test)]
mod known_air;
mod layout;
mod whitener;

use thiserror::Error;

use crate::numeric::piecewise::PiecewiseLinear;
use crate::thermal::{self, Drive, Extent, HeatPath, Location, ThermalError};
use air::Scene;

pub use whitener::RateWhitener;

/// Everything about a record and a model that the boundary depends on.
#[derive(Debug, Clone, Copy)]
pub struct Observation<'a> {
    pub times_s: &'a [f64],
    pub temperature_k: &'a [f64],
    /// With the model's effects; its location is where the sensor is.
    pub path: &'a HeatPath,
    pub lag_s: f64,
    /// dΩ/dṪ_j of the coil, innermost layer first [rad/s per K/s].
    pub layer_gain_rad_per_k: &'a [f64],
    /// Each rate is the mean over this interval before its stamp; 0: instantaneous.
    pub rate_mean_s: f64,
}

/// A sudden change of the air's slope.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kink {
    pub time_s: f64,
    pub slope_change_k_per_s: f64,
}

/// What was found out about the air and the film.
#[derive(Debug, Clone, PartialEq)]
pub struct Air {
    /// None: the sensor is in the air and the model's own film counts.
    pub film_w_per_m2_k: Option<f64>,
    pub jerk_noise_k2_per_s7: f64,
    pub kinks: Vec<Kink>,
    /// Standard deviation of one reading.
    pub noise_k: f64,
}

/// The estimated boundary of one record.
#[derive(Debug, Clone)]
pub struct Boundary {
    air: Air,
    outer_k: PiecewiseLinear,
    air_k: PiecewiseLinear,
    rate_variance_rad2_per_s2: Vec<f64>,
    log_likelihood: f64,
    scene: Scene,
}

#[derive(Debug, Error, Clone, PartialEq)]
pub enum BoundaryError {
    #[error("the boundary's estimate needs at least {needed} readings of temperature, found {found}")]
    TooFew { needed: usize, found: usize },
    #[error(
        "the temperature stays within {range_k:.4} K: a record without a change of temperature says nothing about the model"
    )]
    Constant { range_k: f64 },
    #[error(transparent)]
    Thermal(#[from] ThermalError),
}

/// Times that the effect of a conductivity's slope is worked out from the air, and the air from it.
const BENT_ROUNDS: usize = 2;
/// Fewer readings than this hold no ramp.
const MIN_READINGS: usize = 16;

/// Estimates the boundary from nothing but the readings.
///
/// # Errors
/// Too few readings, a constant temperature, a heat path that cannot be solved.
pub fn estimate(observation: &Observation) -> Result<Boundary, BoundaryError> {
    check(observation)?;
    let mut scene = Scene::new(observation)?;
    let air = kinks::search(&mut scene)?;
    Boundary::new(scene, air)?.unbent(observation, nearby)
}

/// How much of what was found before is still right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// It was found with another heat path or sensor. Its noise begins anew: what the other model could not follow is no
    /// noise of the sensor's, and under it no kink would stand out.
    Elsewhere,
    /// With nearly the same one: a kink may come or go.
    Nearby,
    /// With one beside it: the same kinks, moved, behind another film.
    Beside,
}

/// Estimates again, after the model changed, starting from what was found before.
///
/// # Errors
/// As [`estimate`].
pub fn refine(observation: &Observation, known: &Air, start: Start) -> Result<Boundary, BoundaryError> {
    check(observation)?;
    let mut scene = Scene::new(observation)?;
    let air = kinks::adapt(&mut scene, known.clone(), start)?;
    Boundary::new(scene, air)?.unbent(observation, nearby)
}

fn nearby(scene: &mut Scene, air: Air) -> Result<Air, BoundaryError> {
    kinks::adapt(scene, air, Start::Nearby)
}

fn check(observation: &Observation) -> Result<(), BoundaryError> {
    let found = observation.temperature_k.len();
    if found < MIN_READINGS {
        return Err(BoundaryError::TooFew { needed: MIN_READINGS, found });
    }
    let low = observation.temperature_k.iter().copied().fold(f64::INFINITY, f64::min);
    let high = observation.temperature_k.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if high == low {
        return Err(BoundaryError::Constant { range_k: high - low });
    }
    Ok(())
}

impl Boundary {
    fn new(scene: Scene, air: Air) -> Result<Self, BoundaryError> {
        let found = scene.reconstruct(&air)?;
        Ok(Self {
            outer_k: found.outer_k,
            air_k: found.air_k,
            rate_variance_rad2_per_s2: found.rate_variance_rad2_per_s2,
            log_likelihood: found.log_likelihood,
            air,
            scene,
        })
    }

    /// Estimated again with what a conductivity that depends on temperature does to the outermost layer taken from the
    /// readings, as it follows from the air that was found without; `follow` adapts the air's model to that.
    fn unbent(
        self,
        observation: &Observation,
        follow: impl Fn(&mut Scene, Air) -> Result<Air, BoundaryError>,
    ) -> Result<Self, BoundaryError> {
        let path = observation.path;
        let slope_per_k = path.conductivity_slope_per_k;
        if self.air.film_w_per_m2_k.is_none() || slope_per_k == 0.0 || path.extent == Extent::HalfSpace {
            return Ok(self);
        }
        let mut found = self;
        for _ in 0..BENT_ROUNDS {
            let film_w_per_m2_k = found.air.film_w_per_m2_k;
            let in_air = HeatPath { location: Location::Ambient, film_w_per_m2_k, ..path.without_flanges() };
            let drive = Drive::boundary(found.air_k.clone());
            let times_s = found.air_k.knots();
            let terms = thermal::slope_series(&in_air, &drive, times_s, 0.0)?;
            let (layers, powers) = (path.shape.layers, thermal::slope_powers(slope_per_k));
            let outermost = |row: usize| row * layers + layers - 1;
            let bent = (0..times_s.len())
                .map(|row| terms.iter().zip(powers).map(|(t, p)| p * t.temperature_k[outermost(row)]).sum())
                .collect();
            let bent_k = PiecewiseLinear::new(times_s.to_vec(), bent).expect("knots are in order");
            let mut scene = found.scene.bent(bent_k);
            let air = follow(&mut scene, found.air)?;
            found = Self::new(scene, air)?;
        }
        Ok(found)
    }

    pub fn air(&self) -> &Air {
        &self.air
    }

    /// The outermost layer's temperature.
    pub fn outer_k(&self) -> &PiecewiseLinear {
        &self.outer_k
    }

    /// The air's temperature.
    pub fn air_k(&self) -> &PiecewiseLinear {
        &self.air_k
    }

    /// Variance that the boundary's uncertainty gives each predicted rate [(rad/s)²].
    pub fn rate_variance_rad2_per_s2(&self) -> &[f64] {
        &self.rate_variance_rad2_per_s2
    }

    /// Of the readings, given the air's model.
    pub fn log_likelihood(&self) -> f64 {
        self.log_likelihood
    }

    /// The drive for a heat path at a location: the outermost layer's temperature, or the air's.
    pub fn drive(&self, location: Location) -> Drive {
        let boundary_k = match location {
            Location::OuterLayer => self.outer_k.clone(),
            Location::Ambient => self.air_k.clone(),
        };
        Drive { boundary_k, ambient_k: Some(self.air_k.clone()) }
    }

    /// The heat path as this boundary drives it, and the drive: a pack with a flange by the air, for the outermost layer is
    /// not of one temperature along the axis then.
    pub fn driving(&self, path: &HeatPath, further_lag_s: f64) -> (HeatPath, Drive) {
        match self.air.film_w_per_m2_k {
            Some(film) if path.flange.is_some() && path.location == Location::OuterLayer => {
                let driven = HeatPath { location: Location::Ambient, film_w_per_m2_k: Some(film), ..path.clone() };
                (driven, self.delayed_drive(Location::Ambient, further_lag_s))
            }
            _ => (path.clone(), self.delayed_drive(path.location, further_lag_s)),
        }
    }

    /// The drive if the sensor lagged by `further_lag_s` more than was taken into account: T + Δτ dT_s/dt, T_s being what
    /// the sensor shows.
    pub fn delayed_drive(&self, location: Location, further_lag_s: f64) -> Drive {
        let drive = self.drive(location);
        if further_lag_s == 0.0 {
            return drive;
        }
        let slope = self.sensor_slope_k_per_s(location);
        let values = drive.boundary_k.values().iter().zip(slope.values()).map(|(v, s)| v + further_lag_s * s).collect();
        let boundary_k = PiecewiseLinear::new(slope.knots().to_vec(), values).expect("the knots are the boundary's");
        Drive { boundary_k, ..drive }
    }

    /// dT_s/dt of what the sensor shows of the drive at a location [K/s].
    pub fn sensor_slope_k_per_s(&self, location: Location) -> PiecewiseLinear {
        let course = match location {
            Location::OuterLayer => &self.outer_k,
            Location::Ambient => &self.air_k,
        };
        let lag_s = self.scene.lag_s();
        let knots = course.knots();
        let mut sensor_slope = 0.0;
        let values = (0..knots.len())
            .map(|i| {
                if lag_s > 0.0 && i > 0 {
                    // The sensor's slope follows the boundary's through the lag.
                    let left = (-(knots[i] - knots[i - 1]) / lag_s).exp();
                    sensor_slope = sensor_slope * left + course.slope_of(i - 1) * (1.0 - left);
                } else if lag_s == 0.0 {
                    sensor_slope = 0.5 * (course.slope_before(knots[i]) + course.slope_after(knots[i]));
                }
                sensor_slope
            })
            .collect();
        PiecewiseLinear::new(knots.to_vec(), values).expect("the knots are those of the boundary")
    }

    /// The whitening of rate residuals whose covariance is that of white noise plus that of the boundary's error.
    ///
    /// # Errors
    /// A heat path that cannot be solved.
    pub fn rate_whitener(&self, noise_rad_per_s: f64) -> Result<RateWhitener, BoundaryError> {
        RateWhitener::new(&self.scene, &self.air, noise_rad_per_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thermal::{self, BoreHeat, Extent, Field, Flange, FlangeFilm, Instant, Material, PackShape};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use statrs::distribution::{ContinuousCDF, Normal};

    const FILM_W_PER_M2_K: f64 = 25.0;
    const NOISE_K: f64 = 0.004;

    fn path() -> HeatPath {
        let shape = PackShape { layers: 24, bore_radius_m: 0.04, radial_pitch_m: 165e-6, height_m: 8.5e-3 };
        let material = Material::Conductivity { w_per_m_k: 0.35, heat_capacity_j_per_m3_k: 1.7e6 };
        HeatPath::new(shape, Extent::Pack, material, Location::OuterLayer)
    }

    const KINKS_S: [f64; 6] = [0.0, 903.0, 2698.0, 4507.0, 6701.0, 9000.0];

    /// A pack in air that ramps at 1 K/min with soaks between.
    fn in_chamber(path: &HeatPath) -> Field {
        let film_w_per_m2_k = Some(FILM_W_PER_M2_K);
        let in_air = HeatPath { location: Location::Ambient, film_w_per_m2_k, ..path.clone() };
        let air = PiecewiseLinear::new(KINKS_S.to_vec(), vec![293.0, 293.0, 322.9, 322.9, 286.3, 286.3]).unwrap();
        thermal::solve(&in_air, &Drive::boundary(air)).unwrap()
    }

    /// Ramps of 1 K/min with soaks between, as the outermost layer sees them through a film; and with noise.
    fn record() -> (Vec<f64>, Vec<f64>, Vec<f64>, Vec<f64>) {
        let times_s: Vec<f64> = (0..900).map(|i| 10.0 * i as f64).collect();
        let instants: Vec<Instant> = times_s.iter().map(|&t| Instant::after(t)).collect();
        let field = in_chamber(&path()).at(&instants);
        let outer_k: Vec<f64> = (0..900).map(|row| field.temperatures_k(row)[23]).collect();
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let normal = Normal::new(0.0, NOISE_K).unwrap();
        let readings = outer_k.iter().map(|t| t + normal.inverse_cdf(random.random::<f64>())).collect();
        (times_s, outer_k, readings, KINKS_S[1..5].to_vec())
    }

    fn observed<'a>(times_s: &'a [f64], temperature_k: &'a [f64], path: &'a HeatPath) -> Observation<'a> {
        Observation { times_s, temperature_k, path, lag_s: 0.0, layer_gain_rad_per_k: &[0.0; 24], rate_mean_s: 10.0 }
    }

    #[test]
    fn film_kinks_and_the_outer_layer_are_found_again_through_the_noise() {
        let (times_s, outer_k, readings, kinks_s) = record();
        let path = path();
        let found = estimate(&observed(&times_s, &readings, &path)).unwrap();
        let film = found.air().film_w_per_m2_k.unwrap();
        let times: Vec<f64> = found.air().kinks.iter().map(|k| k.time_s).collect();
        let error_k = (outer_k.iter().zip(&times_s).map(|(t, s)| (found.outer_k().value(*s) - t).powi(2)).sum::<f64>()
            / 900.0)
            .sqrt();
        println!(
            "film {film:.3} of {FILM_W_PER_M2_K}, kinks {times:.1?} of {kinks_s:?}, outer layer {error_k:.5} K rms"
        );
        assert!((film / FILM_W_PER_M2_K - 1.0).abs() < 0.02);
        assert_eq!(times.len(), kinks_s.len());
        for (found_s, true_s) in times.iter().zip(&kinks_s) {
            assert!((found_s - true_s).abs() < 2.0);
        }
        assert!(error_k < 0.25 * NOISE_K);
        assert!((found.air().noise_k / NOISE_K - 1.0).abs() < 0.1);
    }

    #[test]
    fn what_a_conductivity_that_depends_on_temperature_does_to_the_outer_layer_is_put_back() {
        let (times_s, ..) = record();
        let bent = HeatPath { conductivity_slope_per_k: 0.004, ..path() };
        let field = in_chamber(&bent).at(&times_s.iter().map(|&t| Instant::after(t)).collect::<Vec<_>>());
        let outer_k: Vec<f64> = (0..900).map(|row| field.temperatures_k(row)[23]).collect();
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let normal = Normal::new(0.0, NOISE_K).unwrap();
        let readings: Vec<f64> = outer_k.iter().map(|t| t + normal.inverse_cdf(random.random::<f64>())).collect();
        let error_k = |path: &HeatPath| {
            let found = estimate(&observed(&times_s, &readings, path)).unwrap();
            let squares = outer_k.iter().zip(&times_s).map(|(t, s)| (found.outer_k().value(*s) - t).powi(2));
            (squares.sum::<f64>() / 900.0).sqrt()
        };
        let (known, ignored) = (error_k(&bent), error_k(&path()));
        println!("outer layer off by {known:.5} K, by {ignored:.5} K if the slope is not known");
        assert!(known < 0.25 * NOISE_K);
        assert!(known < 0.8 * ignored);
    }

    #[test]
    fn a_flange_in_the_air_is_not_taken_for_a_better_film() {
        let (times_s, ..) = record();
        let flange = FlangeFilm { flange: Flange::First, film_w_per_m2_k: 40.0 };
        let path = HeatPath { flange: Some(flange), ..path() };
        let field = in_chamber(&path);
        let at_stamps = field.at(&times_s.iter().map(|&t| Instant::after(t)).collect::<Vec<_>>());
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let normal = Normal::new(0.0, NOISE_K).unwrap();
        let readings: Vec<f64> = (0..900)
            .map(|row| at_stamps.temperatures_k(row)[23] + normal.inverse_cdf(random.random::<f64>()))
            .collect();
        let found = estimate(&observed(&times_s, &readings, &path)).unwrap();
        let film = found.air().film_w_per_m2_k.unwrap();
        let (driven, drive) = found.driving(&path, 0.0);
        let again = thermal::solve(&driven, &drive).unwrap().means(&times_s, 10.0);
        let truth = field.means(&times_s, 10.0);
        let rms = |values: &[f64]| (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt();
        let differences: Vec<f64> =
            again.axial_moment_k_per_s.iter().zip(&truth.axial_moment_k_per_s).map(|(a, b)| a - b).collect();
        let error = rms(&differences) / rms(&truth.axial_moment_k_per_s);
        println!("film {film:.3} of {FILM_W_PER_M2_K}, axial moments' rates off by {error:.4} of them");
        assert!((film / FILM_W_PER_M2_K - 1.0).abs() < 0.03);
        assert!(error < 0.05);
    }

    #[test]
    fn heat_from_the_bore_is_not_taken_for_a_change_of_the_air() {
        let (times_s, outer_k, readings, _) = record();
        let mut heated = path();
        heated.location = Location::Ambient;
        heated.film_w_per_m2_k = Some(FILM_W_PER_M2_K);
        heated.bore_heat = Some(BoreHeat { power_w_per_m2: 200.0, time_constant_s: 400.0 });
        let cold = PiecewiseLinear::new(vec![0.0], vec![0.0]).unwrap();
        let instants: Vec<Instant> = times_s.iter().map(|&t| Instant::after(t)).collect();
        let field = thermal::solve(&heated, &Drive::boundary(cold)).unwrap().at(&instants);
        let warmed: Vec<f64> = (0..900).map(|row| field.temperatures_k(row)[23]).collect();
        let sum = |a: &[f64]| a.iter().zip(&warmed).map(|(a, b)| a + b).collect::<Vec<f64>>();
        let (outer_k, readings) = (sum(&outer_k), sum(&readings));
        let path = HeatPath { bore_heat: heated.bore_heat, ..path() };
        let found = estimate(&observed(&times_s, &readings, &path)).unwrap();
        let error_k = (outer_k.iter().zip(&times_s).map(|(t, s)| (found.outer_k().value(*s) - t).powi(2)).sum::<f64>()
            / 900.0)
            .sqrt();
        let (air_k, warmest_k) = (found.air_k().value(800.0), warmed[80]);
        println!("outer layer {error_k:.5} K rms; air at 800 s {air_k:.4} K, heat adds {warmest_k:.3} K to the layer");
        assert!(warmest_k > 1.0 && error_k < 0.25 * NOISE_K);
        assert!((air_k - 293.0).abs() < 0.02);
    }

    #[test]
    fn an_estimate_that_follows_a_heat_path_is_that_of_a_search_under_it() {
        let (times_s, _, readings, _) = record();
        let (path, mut other) = (path(), path());
        other.material = Material::Conductivity { w_per_m_k: 0.38, heat_capacity_j_per_m3_k: 1.7e6 };
        let elsewhere = estimate(&observed(&times_s, &readings, &other)).unwrap();
        let observation = observed(&times_s, &readings, &path);
        let searched = estimate(&observation).unwrap();
        for start in [Start::Nearby, Start::Beside] {
            let found = refine(&observation, elsewhere.air(), start).unwrap();
            let film = found.air().film_w_per_m2_k.unwrap() / searched.air().film_w_per_m2_k.unwrap() - 1.0;
            let apart_k = (times_s.iter().map(|t| (found.outer_k().value(*t) - searched.outer_k().value(*t)).powi(2)))
                .sum::<f64>()
                .sqrt()
                / 30.0;
            let less = searched.log_likelihood() - found.log_likelihood();
            println!("{start:?}: film {film:.1e}, outer layer {apart_k:.1e} K apart, log-likelihood {less:.3} less");
            assert!(less < 0.5 && film.abs() < 2e-3 && apart_k < 0.05 * NOISE_K);
            assert_eq!(found.air().kinks.len(), searched.air().kinks.len());
        }
    }

    #[test]
    fn a_record_at_one_temperature_is_refused() {
        let path = path();
        let error = estimate(&Observation {
            times_s: &(0..100).map(f64::from).collect::<Vec<_>>(),
            temperature_k: &[300.0; 100],
            path: &path,
            lag_s: 0.0,
            layer_gain_rad_per_k: &[0.0; 24],
            rate_mean_s: 1.0,
        })
        .unwrap_err();
        assert_eq!(error, BoundaryError::Constant { range_k: 0.0 });
    }
    #[test]
    fn an_estimate_that_begins_with_a_bad_one_finds_kinks_and_noise_again() {
        let (times_s, outer_k, readings, kinks_s) = record();
        let path = path();
        let observation = observed(&times_s, &readings, &path);
        // As left behind by a heat path that could not follow the readings.
        let bad = Air {
            film_w_per_m2_k: Some(70.0),
            jerk_noise_k2_per_s7: 1e-16,
            kinks: vec![Kink { time_s: 900.0, slope_change_k_per_s: 0.01 }],
            noise_k: 20.0 * NOISE_K,
        };
        let found = refine(&observation, &bad, Start::Elsewhere).unwrap();
        let air = found.air();
        let error_k = (outer_k.iter().zip(&times_s).map(|(t, s)| (found.outer_k().value(*s) - t).powi(2)).sum::<f64>()
            / 900.0)
            .sqrt();
        println!(
            "film {:?}, {} kinks, noise {:.5} K, {error_k:.5} K rms",
            air.film_w_per_m2_k,
            air.kinks.len(),
            air.noise_k
        );
        assert!((air.film_w_per_m2_k.unwrap() / FILM_W_PER_M2_K - 1.0).abs() < 0.02);
        assert!((air.noise_k / NOISE_K - 1.0).abs() < 0.1 && error_k < 0.25 * NOISE_K);
        for at_s in kinks_s {
            assert!(air.kinks.iter().any(|k| (k.time_s - at_s).abs() < 2.0));
        }
    }
}
