//! Thermal stress of a wound pack: from materials to the change of optical path of each layer.
//!
//! ```text
//! dφ/dt ∝ ξ Ṫ + n ε̇_a − n³/2 [ (p11 + p12) (ε̇_t − α_g Ṫ) + p12 (ε̇_a − α_g Ṫ) ]
//! ```
//!
//! | symbol | meaning | unit | in code |
//! |---|---|---|---|
//! | ξ | dn/dT of the free fibre | 1/K | `Fibre::thermo_optic_per_k` |
//! | ε_a, ε_t | strain of the glass along and across the fibre | 1 | `Strain`, `GlassStrain` |
//! | α_g | expansion of the glass | 1/K | `LayerMaterial::glass_expansion_per_k` |
//! | p11, p12 | elasto-optic coefficients, mean of both polarisations | 1 | `CoatedFibre` |
//!
//! A turn with its coatings and its share of adhesive is a composite cylinder ([`cell`]); layers of such cells and the spool
//! are a layered thick ring ([`ring`]). Every layer's strain follows the temperatures of all layers and of the spool, so that the
//! rate error is Σ_j w_j Σ_k K_jk Ṫ_k with a full matrix K. Moduli are tangent: they relate rates of stress and strain at
//! the temperature that is, and nothing is remembered (no creep, no stress of winding).
//!
//! The spool is taken to be as warm as the innermost layer.
//!
//! # Source
//! Strain and phase: Butter and Hocker, Appl. Opt. 17, 2867 (1978); the coil's error: Mohr and Schadt, Proc. SPIE 5502, 410
//! (2004).

pub(crate) mod cell;
pub(crate) mod fibres;
pub mod library;
pub mod material;
pub(crate) mod ring;

use std::sync::OnceLock;

use crate::coil::{Coil, Fibre};

use cell::{LayerMaterial, Ring};
use material::{COLDEST_K, HOTTEST_K, Material};
use ring::{Annulus, LayeredRing, Strain};

/// A fibre from its glass outwards.
#[derive(Debug, Clone, PartialEq)]
pub struct CoatedFibre {
    /// Core and cladding.
    pub glass: Material,
    /// To the first coating.
    pub glass_radius_m: f64,
    /// 0 where light runs in the glass; else the radius of the hole that the glass surrounds as a tube.
    pub hole_radius_m: f64,
    /// Each with its outer radius, from within outwards; the last is the fibre's surface.
    pub coatings: Vec<(Material, f64)>,
    /// Elasto-optic coefficient, mean of both polarisations.
    pub p11: f64,
    /// Elasto-optic coefficient, mean of both polarisations.
    pub p12: f64,
}

/// The spool that the pack is bonded to.
#[derive(Debug, Clone, PartialEq)]
pub struct BondedSpool {
    /// Of the spool.
    pub material: Material,
    /// Of its wall.
    pub thickness_m: f64,
}

/// What a coil is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct Materials {
    /// What is wound.
    pub fibre: CoatedFibre,
    /// Between the turns.
    pub adhesive: Material,
    /// None for a free-standing pack.
    pub spool: Option<BondedSpool>,
}

impl Materials {
    /// Whether nothing depends on temperature, so that the rate error stays linear.
    pub(crate) fn is_constant(&self) -> bool {
        self.fibre.glass.is_constant()
            && self.fibre.coatings.iter().all(|(m, _)| m.is_constant())
            && self.adhesive.is_constant()
            && self.spool.as_ref().is_none_or(|s| s.material.is_constant())
    }

    fn rings(&self, temperature_k: f64, cell_radius_m: f64) -> Vec<Ring> {
        let mut rings = self.fibre.rings(temperature_k);
        rings.push(Ring { outer_radius_m: cell_radius_m, material: self.adhesive.at(temperature_k) });
        rings
    }
}

impl CoatedFibre {
    fn rings(&self, temperature_k: f64) -> Vec<Ring> {
        let coatings = self.coatings.iter().map(|(m, radius_m)| (m, *radius_m));
        std::iter::once((&self.glass, self.glass_radius_m))
            .chain(coatings)
            .map(|(m, outer_radius_m)| Ring { outer_radius_m, material: m.at(temperature_k) })
            .collect()
    }

    /// The coated fibre by itself, nothing holding it.
    pub fn free_fibre(&self, optics: &Fibre, temperature_k: f64) -> FreeFibre {
        let cell = LayerMaterial::new(self.hole_radius_m, &self.rings(temperature_k));
        let (axial, transverse) = cell.moduli.free_expansion_per_k();
        let strain = Strain { hoop: axial, radial: transverse, axial: transverse };
        FreeFibre { expansion_per_k: axial, path_per_k: self.path_change(optics, &cell, &strain, 1.0).path }
    }

    fn path_change(&self, fibre: &Fibre, cell: &LayerMaterial, strain: &Strain, change_k: f64) -> LayerChange {
        let glass = &cell.glass;
        let across = glass.per_transverse * 0.5 * (strain.radial + strain.axial)
            + glass.per_axial * strain.hoop
            + glass.per_k * change_k;
        let free = cell.glass_expansion_per_k * change_k;
        let (n, p11, p12) = (fibre.refractive_index, self.p11, self.p12);
        let index = 0.5 * n.powi(3) * ((p11 + p12) * (across - free) + p12 * (strain.hoop - free));
        LayerChange {
            strain: *strain,
            glass_transverse: across,
            path: fibre.thermo_optic_per_k * change_k + n * strain.hoop - index,
        }
    }
}

/// A coated fibre that nothing holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FreeFibre {
    pub(crate) expansion_per_k: f64,
    /// κ.
    pub path_per_k: f64,
}

/// What a layer does for a change of all temperatures: strains, and the change of optical path per metre of fibre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LayerChange {
    /// Of the fibre there.
    pub strain: Strain,
    pub(crate) glass_transverse: f64,
    /// Change of optical path per metre of fibre.
    pub path: f64,
}

/// Step of the temperatures at which cells are worked out; between them all that is linear is interpolated.
const CELL_STEP_K: f64 = 0.125;

/// The stress of one coil, ready for any temperatures.
#[derive(Debug)]
pub struct PackStress {
    materials: Materials,
    fibre: Fibre,
    bore_radius_m: f64,
    pitch_m: f64,
    /// Of a turn's share of the pack's cross section, as a circle.
    cell_radius_m: f64,
    layers: usize,
    /// By temperature, worked out when first asked for; one where nothing depends on temperature.
    cells: Vec<OnceLock<LayerMaterial>>,
    /// The ring, where nothing depends on temperature.
    steady: Option<LayeredRing>,
}

impl PackStress {
    /// For a coil wound from these materials.
    pub fn new(materials: &Materials, coil: &Coil) -> Self {
        let is_constant = materials.is_constant();
        let nodes = if is_constant { 1 } else { ((HOTTEST_K - COLDEST_K) / CELL_STEP_K) as usize + 1 };
        let mut pack = Self {
            materials: materials.clone(),
            fibre: coil.fibre().clone(),
            bore_radius_m: coil.bore_radius_m(),
            pitch_m: coil.radial_pitch_m(),
            cell_radius_m: (coil.radial_pitch_m() * coil.axial_pitch_m() / std::f64::consts::PI).sqrt(),
            layers: coil.layers(),
            cells: vec![OnceLock::new(); nodes],
            steady: None,
        };
        if is_constant {
            pack.steady = Some(pack.ring(&vec![COLDEST_K; pack.layers]));
        }
        pack
    }

    fn node(&self, place: usize) -> &LayerMaterial {
        self.cells[place].get_or_init(|| {
            let temperature_k = COLDEST_K + place as f64 * CELL_STEP_K;
            let rings = self.materials.rings(temperature_k, self.cell_radius_m);
            LayerMaterial::new(self.materials.fibre.hole_radius_m, &rings)
        })
    }

    fn cell(&self, temperature_k: f64) -> LayerMaterial {
        let last = self.cells.len() - 1;
        let place = ((temperature_k - COLDEST_K) / CELL_STEP_K).clamp(0.0, last as f64);
        let below = (place as usize).min(last.saturating_sub(1));
        if last == 0 { *self.node(0) } else { self.node(below).between(self.node(below + 1), place - below as f64) }
    }

    fn ring(&self, temperatures_k: &[f64]) -> LayeredRing {
        let spool = self.materials.spool.as_ref().map(|spool| Annulus {
            inner_m: self.bore_radius_m - spool.thickness_m,
            outer_m: self.bore_radius_m,
            moduli: cell::LayerModuli::isotropic(&spool.material.at(temperatures_k[0])),
            is_wound: false,
        });
        let layers = temperatures_k.iter().enumerate().map(|(j, &temperature_k)| Annulus {
            inner_m: self.bore_radius_m + j as f64 * self.pitch_m,
            outer_m: self.bore_radius_m + (j + 1) as f64 * self.pitch_m,
            moduli: self.cell(temperature_k).moduli,
            is_wound: true,
        });
        LayeredRing::new(&spool.into_iter().chain(layers).collect::<Vec<_>>())
    }

    /// What each layer does, innermost first, for changes of the layers' temperatures at given ones; or their rates
    /// for rates.
    pub fn changes(&self, temperatures_k: &[f64], changes_k: &[f64]) -> Vec<LayerChange> {
        let made;
        let ring = match &self.steady {
            Some(ring) => ring,
            None => {
                made = self.ring(temperatures_k);
                &made
            }
        };
        let with_spool = self.materials.spool.is_some();
        let of_spool = with_spool.then(|| changes_k[0]);
        let loads: Vec<f64> = of_spool.into_iter().chain(changes_k.iter().copied()).collect();
        let strains = ring.strains(&loads);
        let own = strains[usize::from(with_spool)..].iter().zip(temperatures_k).zip(changes_k);
        own.map(|((strain, &temperature_k), &change_k)| {
            self.materials.fibre.path_change(&self.fibre, &self.cell(temperature_k), strain, change_k)
        })
        .collect()
    }

    /// As [`PackStress::changes`], where the whole coil changes by one kelvin.
    pub fn per_kelvin(&self, temperature_k: f64) -> Vec<LayerChange> {
        self.changes(&vec![temperature_k; self.layers], &vec![1.0; self.layers])
    }

    /// κ on average over the layers, by their lengths, where the whole coil changes its temperature.
    pub(crate) fn mean_path_per_k(&self, coil: &Coil, temperature_k: f64) -> f64 {
        let layers = self.per_kelvin(temperature_k);
        let sum: f64 = layers.iter().zip(coil.layer_lengths_m()).map(|(layer, l)| layer.path * l).sum();
        sum / coil.length_m()
    }
}
