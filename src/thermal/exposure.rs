//! A pack in a chamber whose air is known: what its layers do, and what the sensor shows.

use super::reduced::Reduced;
use super::{Drive, Extent, HeatPath, Instant, Location, PackMaterial, ThermalError};
use crate::numeric::piecewise::PiecewiseLinear;

/// Where only K = k/ρc is known, the film is stated for this heat capacity [J/(m³ K)]; nothing else depends on it.
const NOMINAL_HEAT_CAPACITY_J_PER_M3_K: f64 = 1.7e6;

/// A pack in air of a known course.
#[derive(Debug, Clone)]
pub(crate) struct Exposure {
    /// As the air, or the outermost layer, drives it.
    pub(crate) path: HeatPath,
    pub(crate) drive: Drive,
    /// What the sensor shows at each time, without noise.
    pub(crate) shown_k: Vec<f64>,
}

/// Times at which the sensor's input is worked out between two readings.
const STEPS_PER_READING: usize = 5;

/// Modes that are enough for a part that carries the sensor.
const PART_MODES: usize = 24;

/// A path as a pack in the air, where a film stands in front of it.
fn behind_film(path: &HeatPath) -> HeatPath {
    let mut path = HeatPath { extent: Extent::Pack, location: Location::Ambient, ..path.clone() };
    if let PackMaterial::Diffusivity { m2_per_s } = path.material {
        path.material = PackMaterial::Conductivity {
            w_per_m_k: m2_per_s * NOMINAL_HEAT_CAPACITY_J_PER_M3_K,
            heat_capacity_j_per_m3_k: NOMINAL_HEAT_CAPACITY_J_PER_M3_K,
        };
    }
    path
}

/// Puts a pack into air, the film being that of the chamber where the path does not state where the sensor's air is.
///
/// A half space is behind the film as if it ended at the bore, as the chamber's skin stands for it.
///
/// # Errors
/// A heat path that cannot be solved.
pub(crate) fn expose(
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
    let between = |w: &[f64]| -> Vec<f64> {
        let share = |step: usize| step as f64 / STEPS_PER_READING as f64;
        (0..STEPS_PER_READING).map(|step| w[0] + share(step) * (w[1] - w[0])).collect()
    };
    let fine_s: Vec<f64> = times_s.windows(2).flat_map(between).chain(times_s.last().copied()).collect();
    if let Some(part) = path.sensors_part() {
        let in_air = HeatPath {
            location: Location::Ambient,
            film_w_per_m2_k: path.film_w_per_m2_k.or(film_w_per_m2_k),
            ..path.clone()
        };
        let longest_s = fine_s[fine_s.len() - 1] - fine_s[0];
        let reduced = Reduced::new(&in_air, Some(part), PART_MODES, 0.0, longest_s)?;
        let fine_air: Vec<f64> = fine_s.iter().map(|&t| air_k.value(t)).collect();
        let rows = reduced.driven(&fine_s, &fine_air);
        let of_part = rows.chunks_exact(reduced.residue.len()).map(|row| row[reduced.outputs]).collect();
        let of_part_k = PiecewiseLinear::new(fine_s, of_part).expect("the times are in order");
        let shown_k = lagging(&of_part_k, lag_s, times_s);
        return Ok(Exposure { path: in_air, drive: by_air, shown_k });
    }
    let mut in_air = behind_film(path);
    in_air.film_w_per_m2_k = film_w_per_m2_k;
    let layers = path.shape.layers;
    let instants: Vec<Instant> = fine_s.iter().map(|&t| Instant::after(t)).collect();
    let field = super::solve(&in_air, &by_air)?.at(&instants);
    let outer: Vec<f64> = (0..fine_s.len()).map(|row| field.temperatures_k(row)[layers - 1]).collect();
    let outer_k = PiecewiseLinear::new(fine_s, outer).expect("the times are in order");
    let shown_k = lagging(&outer_k, lag_s, times_s);
    Ok(match path.extent {
        Extent::HalfSpace => {
            let drive = Drive { boundary_k: outer_k, ambient_k: by_air.ambient_k.or(Some(by_air.boundary_k)) };
            Exposure { path: path.clone(), drive, shown_k }
        }
        Extent::Pack => Exposure { path: in_air, drive: by_air, shown_k },
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lagging_sensor_trails_a_long_ramp_by_its_lag() {
        let course = PiecewiseLinear::new(vec![0.0, 5000.0], vec![300.0, 350.0]).unwrap();
        let times_s: Vec<f64> = (0..50).map(|i| 100.0 * f64::from(i)).collect();
        let shown = lagging(&course, 40.0, &times_s);
        let behind = course.value(4900.0) - shown[49];
        assert!((behind - 0.4).abs() < 1e-9, "{behind}");
        assert_eq!(lagging(&course, 0.0, &times_s)[7], course.value(700.0));
    }
}
