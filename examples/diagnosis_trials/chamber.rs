//! Measurements in a chamber, simulated with the program's own models.

use std::error::Error;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{ContinuousCDF, Normal};

use super::Hidden;
use coilwright::coil::{Coil, CoilSpec, Fibre, LayerLength};
use coilwright::numeric::piecewise::PiecewiseLinear;
use coilwright::pattern::Pattern;
use coilwright::pattern::classic::Classic;
use coilwright::predict::rates_rad_per_s;
use coilwright::rate::CoilModel;
use coilwright::record::{Channel, Record};
use coilwright::thermal::{self, DEFAULT_CELLS_PER_LAYER, Drive, Extent, Instant, Location, PackMaterial};
use coilwright::units::{kelvin_from_celsius, rad_per_s_from_deg_per_h};

const INTERVAL_S: f64 = 10.0;
/// Between the pack and the chamber's air.
pub const FILM_W_PER_M2_K: f64 = 25.0;
const READING_NOISE_K: f64 = 0.004;

/// A coil with its winding; `extent` is what the model file claims.
pub fn declared(index: usize, extent: Extent) -> Result<(CoilModel, Pattern), Box<dyn Error>> {
    let coils = [
        (12, 71.0, 36e-3, 250e-6, Classic::Zyl),
        (24, 50.0, 40e-3, 165e-6, Classic::Dip),
        (20, 45.0, 30e-3, 200e-6, Classic::Sym),
        (16, 60.0, 40e-3, 165e-6, Classic::Qua),
    ];
    let (layers, turns, bore_radius_m, pitch_m, classic) = coils[index % coils.len()];
    let coil = Coil::new(CoilSpec {
        fibre: Fibre {
            refractive_index: 1.45,
            thermo_optic_per_k: 1e-5,
            group_index: None,
            thermal_expansion_per_k: 0.0,
            wavelength_m: 1.55e-6,
            outer_diameter_m: pitch_m,
        },
        layers,
        turns_per_layer: Some(turns),
        bore_radius_m,
        radial_pitch_m: pitch_m,
        axial_pitch_m: 1.02 * pitch_m,
        layer_length: LayerLength::Actual,
        length_m: None,
    })?;
    let model = CoilModel {
        name: classic.key().to_owned(),
        coil,
        extent,
        material: PackMaterial::Conductivity { w_per_m_k: 0.35, heat_capacity_j_per_m3_k: 1.7e6 },
        location: Location::OuterLayer,
        rate_mean_s: INTERVAL_S,
        cells_per_layer: DEFAULT_CELLS_PER_LAYER,
        effects: Vec::new(),
    };
    Ok((model, classic.pattern(layers)?))
}

/// The chamber: soaks and ramps of 0.5 … 2.5 K/min.
fn chamber(random: &mut ChaCha8Rng, end_s: f64) -> Result<PiecewiseLinear, Box<dyn Error>> {
    let (mut times_s, mut values_k) = (vec![0.0, 600.0], vec![kelvin_from_celsius(20.0); 2]);
    let mut upwards = random.random::<f64>() < 0.5;
    while times_s[times_s.len() - 1] < end_s {
        let (time_s, value_k) = (times_s[times_s.len() - 1], values_k[values_k.len() - 1]);
        let rate_k_per_s = (0.5 + 2.0 * random.random::<f64>()) / 60.0;
        let change_k = 12.0 + 28.0 * random.random::<f64>();
        let target_k = if upwards { value_k + change_k } else { value_k - change_k };
        upwards = !upwards;
        times_s.push(time_s + change_k / rate_k_per_s);
        values_k.push(target_k);
        times_s.push(time_s + change_k / rate_k_per_s + 400.0 + 800.0 * random.random::<f64>());
        values_k.push(target_k);
    }
    Ok(PiecewiseLinear::new(times_s, values_k)?)
}

/// One simulated record and the root mean square of what is hidden, in noises.
pub fn simulate(
    name: &str,
    (truth, plain): (&CoilModel, &CoilModel),
    pattern: &Pattern,
    hidden: &Hidden,
    noise_deg_per_h: f64,
    rows: usize,
    random: &mut ChaCha8Rng,
) -> Result<(Record, f64), Box<dyn Error>> {
    let air_k = chamber(random, rows as f64 * INTERVAL_S)?;
    let times_s: Vec<f64> = (0..rows).map(|i| INTERVAL_S * i as f64).collect();
    let instants: Vec<Instant> = times_s.iter().map(|&t| Instant::before(t)).collect();
    let drive = Drive::boundary(air_k.clone());
    let rates_of = |model: &CoilModel, record: &Record| -> Result<(Vec<f64>, Vec<f64>), Box<dyn Error>> {
        let mut path = model.heat_path()?;
        path.extent = Extent::Pack;
        path.location = Location::Ambient;
        path.film_w_per_m2_k = Some(FILM_W_PER_M2_K);
        let field = thermal::solve(&path, &drive)?;
        let rates = rates_rad_per_s(model, pattern, record, &field.means(&times_s, INTERVAL_S))?;
        let history = field.at(&instants);
        Ok((rates, (0..rows).map(|row| history.temperatures_k(row)[history.layers - 1]).collect()))
    };
    let normal = Normal::new(0.0, 1.0)?;
    let mut gauss = || normal.inverse_cdf(random.random::<f64>().clamp(1e-12, 1.0 - 1e-12));
    let column: Vec<f64> = times_s.iter().map(|t| 0.2 * (t / 180.0).sin() + 0.1 * (t / 1100.0).cos()).collect();
    let blank = Record::new(name, times_s.clone(), vec![293.0; rows], vec![0.0; rows])?
        .with_channel(Channel { name: "supply_v".to_owned(), values: column.clone() })?;
    let (mut rates, outer_k) = rates_of(truth, &blank)?;
    let (without, _) = rates_of(plain, &blank)?;
    let mut seen_k = outer_k;
    match hidden {
        Hidden::Effect("surface_film", ..) => seen_k = times_s.iter().map(|&t| air_k.value(t)).collect(),
        Hidden::Effect("sensor_lag", values, _) => {
            // Exact for a temperature that is linear between the stamps.
            let (lag_s, mut state_k) = (values[0], seen_k[0]);
            let decay = (-INTERVAL_S / lag_s).exp();
            for row in 1..rows {
                let slope = (seen_k[row] - seen_k[row - 1]) / INTERVAL_S;
                let next_k = seen_k[row];
                let start_k = next_k - slope * INTERVAL_S;
                let settled_k = start_k - slope * lag_s;
                let lagging_k = next_k - slope * lag_s + (state_k - settled_k) * decay;
                seen_k[row - 1] = state_k;
                state_k = lagging_k;
            }
            seen_k[rows - 1] = state_k;
        }
        Hidden::Column(gain_deg_per_h) => {
            let gain = rad_per_s_from_deg_per_h(*gain_deg_per_h);
            rates.iter_mut().zip(&column).for_each(|(r, c)| *r += gain * c);
        }
        Hidden::Outside(shape, amplitude_deg_per_h) => {
            let amplitude = rad_per_s_from_deg_per_h(*amplitude_deg_per_h);
            for (rate, t) in rates.iter_mut().zip(&times_s) {
                *rate += amplitude
                    * match *shape {
                        "sinusoid" => (t / 170.0).sin(),
                        "ageing" => -(-t / 1500.0).exp_m1(),
                        _ => (t / 260.0).sin().signum(),
                    };
            }
        }
        Hidden::Nothing | Hidden::Effect(..) => {}
    }
    let noise = rad_per_s_from_deg_per_h(noise_deg_per_h);
    let difference: Vec<f64> = rates.iter().zip(&without).map(|(a, b)| a - b).collect();
    let mean = difference.iter().sum::<f64>() / rows as f64;
    let size = (difference.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / rows as f64).sqrt() / noise;
    let offset = rad_per_s_from_deg_per_h(0.1);
    let measured: Vec<f64> = rates.iter().map(|r| r + offset + noise * gauss()).collect();
    let resolution_k = 1e-3;
    let read_k: Vec<f64> =
        seen_k.iter().map(|t| ((t + READING_NOISE_K * gauss()) / resolution_k).round() * resolution_k).collect();
    let record = Record::new(name, times_s, read_k, measured)?
        .with_channel(Channel { name: "supply_v".to_owned(), values: column })?;
    Ok((record, size))
}
