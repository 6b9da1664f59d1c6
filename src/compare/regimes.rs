//! A record cut into regimes, temperature bands and rate bands, and each part's share of the squared error.
//!
//! A row belongs to the first of these that holds: **warm-up**, the first 900 s (at most a tenth of the record);
//! **transient**, the time after a change of the air's rate in which the pack settles (one and a half times its slowest
//! time constant behind the film); **soak**, the outer layer's rate within 5 % of the record's usual largest;
//! **heating ramp** or **cooling ramp**.

use crate::predict::{Boundary, PredictError, RecordPrediction};
use crate::rate::CoilModel;
use crate::record::Record;
use crate::thermal::pack::Pack;
use crate::thermal::{Extent, Location, PackMaterial};
use crate::units::{c_per_min_from_k_per_s, celsius_from_kelvin};

const WARM_UP_S: f64 = 900.0;
const WARM_UP_SHARE: f64 = 0.1;
/// Of the slowest time constant.
const SETTLING: f64 = 1.5;
/// Of the usual largest rate: what is slower is a soak.
const STILL: f64 = 0.05;
/// Of the largest bend of the air: smaller changes of its rate start no transient.
const BEND_SHARE: f64 = 0.1;
const TEMPERATURE_BANDS: usize = 6;

/// What the drive does at a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Regime {
    /// The first part of the record.
    WarmUp,
    /// Behind a change of the drive's slope, until the pack has settled.
    Transient,
    /// The outermost layer gets warmer.
    HeatingRamp,
    /// The outermost layer gets cooler.
    CoolingRamp,
    /// The outermost layer hardly changes.
    Soak,
}

impl Regime {
    pub(crate) const ALL: [Regime; 5] =
        [Regime::WarmUp, Regime::Transient, Regime::HeatingRamp, Regime::CoolingRamp, Regime::Soak];

    /// As in JSON documents.
    pub(crate) fn key(self) -> &'static str {
        match self {
            Regime::WarmUp => "warm_up",
            Regime::Transient => "transient",
            Regime::HeatingRamp => "heating_ramp",
            Regime::CoolingRamp => "cooling_ramp",
            Regime::Soak => "soak",
        }
    }
}

/// One part of a record.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordPart {
    pub(crate) name: String,
    pub(crate) rows: usize,
    pub(crate) share_of_rows: f64,
    /// Of the whole record's Σ r²; from 0 to 1.
    pub share_of_squared_error: f64,
    pub(crate) rmse_rad_per_s: f64,
    /// Σ r²/(σ² + var) over the part, divided by its rows: 1 where the model is complete.
    pub chi_square_per_row: f64,
}

/// Which row belongs where.
#[derive(Debug, Clone)]
pub(super) struct Regimes {
    of_row: Vec<usize>,
    pub(super) transient_s: f64,
    temperature_band: Vec<usize>,
    temperature_names: Vec<String>,
    rate_band: Vec<usize>,
    rate_names: Vec<String>,
}

impl Regimes {
    pub(super) fn new(
        model: &CoilModel,
        record: &Record,
        boundary: &Boundary,
        prediction: &RecordPrediction,
    ) -> Result<Self, PredictError> {
        let outer: Vec<f64> = prediction.pack.iter().map(|p| p.outer_rate_k_per_s).collect();
        let mut sizes: Vec<f64> = outer.iter().map(|r| r.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let usual_largest = sizes[(sizes.len() - 1) * 95 / 100];
        let times_s = record.times_s();
        let start_s = times_s[0];
        let warm_up_s = WARM_UP_S.min(WARM_UP_SHARE * (times_s[times_s.len() - 1] - start_s));
        let transient_s = settling_s(model, boundary)?;
        let bends = &boundary.bends;
        let largest = bends.iter().map(|b| b.slope_change_k_per_s.abs()).fold(0.0, f64::max);
        let counts = |size: f64| size.abs() >= BEND_SHARE * largest;
        // In order of time.
        let bends_s: Vec<f64> = bends.iter().filter(|b| counts(b.slope_change_k_per_s)).map(|b| b.time_s).collect();
        let since_bend_s = |time_s: f64| {
            let before = bends_s.partition_point(|bend| *bend < time_s);
            before.checked_sub(1).map_or(f64::INFINITY, |last| time_s - bends_s[last])
        };
        let regime = |time_s: f64, rate: f64| {
            if time_s - start_s < warm_up_s {
                Regime::WarmUp
            } else if since_bend_s(time_s) <= transient_s {
                Regime::Transient
            } else if rate.abs() <= STILL * usual_largest {
                Regime::Soak
            } else if rate > 0.0 {
                Regime::HeatingRamp
            } else {
                Regime::CoolingRamp
            }
        };
        let of_row = times_s.iter().zip(&outer).map(|(&t, &r)| regime(t, r) as usize).collect();
        let temperature: Vec<f64> = prediction.pack.iter().map(|p| p.outer_k).collect();
        let (temperature_band, temperature_names) = temperature_bands(&temperature);
        let (rate_band, rate_names) = rate_bands(&outer, usual_largest);
        Ok(Self { of_row, transient_s, temperature_band, temperature_names, rate_band, rate_names })
    }

    pub(super) fn regime_of_row(&self) -> Vec<Regime> {
        self.of_row.iter().map(|&place| Regime::ALL[place]).collect()
    }

    pub(super) fn regimes(&self, residual: &[f64], scaled: &[f64]) -> Vec<RecordPart> {
        let names: Vec<String> = Regime::ALL.iter().map(|r| r.key().to_owned()).collect();
        parts(&names, &self.of_row, residual, scaled)
    }

    pub(super) fn temperature_bands(&self, residual: &[f64], scaled: &[f64]) -> Vec<RecordPart> {
        parts(&self.temperature_names, &self.temperature_band, residual, scaled)
    }

    pub(super) fn rate_bands(&self, residual: &[f64], scaled: &[f64]) -> Vec<RecordPart> {
        parts(&self.rate_names, &self.rate_band, residual, scaled)
    }
}

/// One and a half times the slowest time constant of pack and film together.
fn settling_s(model: &CoilModel, boundary: &Boundary) -> Result<f64, PredictError> {
    let mut path = model.heat_path()?;
    path.extent = Extent::Pack;
    if let (Some((film, _)), PackMaterial::Conductivity { .. }) = (boundary.film_w_per_m2_k, path.material) {
        path.location = Location::Ambient;
        path.film_w_per_m2_k = Some(film);
    }
    let slowest = Pack::new(&path)?.decays_per_s().iter().copied().fold(f64::INFINITY, f64::min);
    Ok(SETTLING / slowest)
}

fn temperature_bands(temperature_k: &[f64]) -> (Vec<usize>, Vec<String>) {
    let (low, high) =
        temperature_k.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), t| (low.min(*t), high.max(*t)));
    let width = ((high - low) / TEMPERATURE_BANDS as f64).max(f64::MIN_POSITIVE);
    let band = |t: &f64| (((t - low) / width) as usize).min(TEMPERATURE_BANDS - 1);
    let edge = |i: usize| celsius_from_kelvin(low + width * i as f64);
    let names = (0..TEMPERATURE_BANDS).map(|i| format!("{:.1} to {:.1} °C", edge(i), edge(i + 1))).collect();
    (temperature_k.iter().map(band).collect(), names)
}

fn rate_bands(rate_k_per_s: &[f64], usual_largest: f64) -> (Vec<usize>, Vec<String>) {
    let (still, half) = (STILL * usual_largest, 0.5 * usual_largest);
    let band = |r: &f64| match *r {
        r if r < -half => 0,
        r if r < -still => 1,
        r if r <= still => 2,
        r if r <= half => 3,
        _ => 4,
    };
    let (s, h) = (c_per_min_from_k_per_s(still), c_per_min_from_k_per_s(half));
    let names = vec![
        format!("below -{h:.3} °C/min"),
        format!("-{h:.3} to -{s:.3} °C/min"),
        format!("within ±{s:.3} °C/min"),
        format!("{s:.3} to {h:.3} °C/min"),
        format!("above {h:.3} °C/min"),
    ];
    (rate_k_per_s.iter().map(band).collect(), names)
}

/// Parts without rows are left out.
fn parts(names: &[String], places: &[usize], residual: &[f64], scaled: &[f64]) -> Vec<RecordPart> {
    let whole: f64 = residual.iter().map(|r| r * r).sum();
    let mut sums = vec![(0usize, 0.0, 0.0); names.len()];
    for ((place, r), s) in places.iter().zip(residual).zip(scaled) {
        let sum = &mut sums[*place];
        *sum = (sum.0 + 1, sum.1 + r * r, sum.2 + s * s);
    }
    names
        .iter()
        .zip(sums)
        .filter(|(_, (rows, _, _))| *rows > 0)
        .map(|(name, (rows, square, chi))| RecordPart {
            name: name.clone(),
            rows,
            share_of_rows: rows as f64 / residual.len() as f64,
            share_of_squared_error: if whole > 0.0 { square / whole } else { 0.0 },
            rmse_rad_per_s: (square / rows as f64).sqrt(),
            chi_square_per_row: chi / rows as f64,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_all_parts_add_up_to_one_and_empty_parts_are_left_out() {
        let names: Vec<String> = ["a", "b", "c"].map(String::from).into();
        let found = parts(&names, &[0, 0, 2, 2], &[1.0, 1.0, 3.0, 3.0], &[1.0, 1.0, 3.0, 3.0]);
        assert_eq!(found.iter().map(|p| p.name.as_str()).collect::<Vec<_>>(), ["a", "c"]);
        assert!((found[1].share_of_squared_error - 0.9).abs() < 1e-12);
        assert_eq!(found.iter().map(|p| p.rows).sum::<usize>(), 4);
        assert!((found[1].chi_square_per_row - 9.0).abs() < 1e-12);
    }
}
