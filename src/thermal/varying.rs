//! What all drives of a pack share whose conductivity depends on temperature: its modes at temperatures that lie close enough together.
//!
//! The equations stand in [`super::stepped`].

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use super::bending::LinearisedPack;
use super::modal::Prepared;
use super::pack::Pack;
use super::panel::{Panel, PanelWeights};
use super::{HeatPath, ThermalError};
use crate::units::REFERENCE_TEMPERATURE_K;

/// Drives share the modes at T_m, and T_m are so far apart that the conductivity is another by this share: half of it is nothing to
/// substitution, which goes through ten times as much.
const MIDDLES_APART: f64 = 0.02;

/// What drives share whose middles lie close together.
#[derive(Debug)]
pub(super) struct Shared {
    pub(super) middle_k: f64,
    pub(super) system: LinearisedPack,
    pub(super) linear: Arc<Prepared>,
    pub(super) settling_s: f64,
    pub(super) shortest_s: f64,
    /// By the length's bits: panels behind every knot begin with the same lengths.
    weights: Mutex<HashMap<u64, Arc<PanelWeights>>>,
}

impl Shared {
    fn new(path: &HeatPath, middle_k: f64) -> Result<Self, ThermalError> {
        let factor = conducting(path, middle_k);
        let at_middle = HeatPath {
            material: path.material.scaled(factor),
            conductivity_slope_per_k: path.conductivity_slope_per_k / factor,
            ..path.clone()
        };
        let linear = Pack::new(&at_middle)?;
        Ok(Self {
            middle_k,
            system: LinearisedPack::new(&at_middle, middle_k)?,
            settling_s: linear.settling_s(),
            shortest_s: linear.shortest_s(),
            linear: Arc::new(Prepared::new(linear)),
            weights: Mutex::default(),
        })
    }

    /// Of panels of a length that comes again under other drives.
    pub(super) fn weights(&self, panel: &Panel, length_s: f64) -> Arc<PanelWeights> {
        let key = length_s.to_bits();
        if let Some(known) = self.weights.lock().ok().and_then(|known| known.get(&key).cloned()) {
            return known;
        }
        let made = Arc::new(panel.weights(&self.system.decay_per_s, length_s));
        if let Ok(mut known) = self.weights.lock() {
            known.insert(key, Arc::clone(&made));
        }
        made
    }
}

/// k/k0 at a temperature.
pub(super) fn conducting(path: &HeatPath, temperature_k: f64) -> f64 {
    1.0 + path.conductivity_slope_per_k * (temperature_k - REFERENCE_TEMPERATURE_K)
}

/// A pack with variable conductivity, for any number of drives.
#[derive(Debug, Default)]
pub(super) struct Varying {
    /// By the place of T_m among those that there can be.
    shared: Mutex<HashMap<i64, Arc<Shared>>>,
}

impl Varying {
    /// What drives about a temperature share. The same temperature gives the same, whatever was asked before.
    pub(super) fn about(&self, path: &HeatPath, temperature_k: f64) -> Result<Arc<Shared>, ThermalError> {
        let slope_per_k = path.conductivity_slope_per_k;
        let apart = MIDDLES_APART.ln_1p();
        let place = (conducting(path, temperature_k).ln() / apart).round();
        let middle_k = if slope_per_k == 0.0 {
            REFERENCE_TEMPERATURE_K
        } else {
            REFERENCE_TEMPERATURE_K + (place * apart).exp_m1() / slope_per_k
        };
        let key = place as i64;
        if let Some(known) = self.shared.lock().ok().and_then(|shared| shared.get(&key).cloned()) {
            return Ok(known);
        }
        let made = Arc::new(Shared::new(path, middle_k)?);
        if let Ok(mut shared) = self.shared.lock() {
            shared.insert(key, Arc::clone(&made));
        }
        Ok(made)
    }
}
