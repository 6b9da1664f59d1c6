//! Fibres that coils are wound of: optics, glass and coatings, each with where its numbers are from.

use super::CoatedFibre;
use super::library::{NumberSource, find};
use crate::coil::Fibre;
use crate::units::{m_from_nm, m_from_um};

/// A fibre of the library.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FibreEntry {
    pub(crate) name: &'static str,
    /// solid, polarisation-maintaining, thin or hollow-core.
    pub(crate) kind: &'static str,
    pub(crate) refractive_index: f64,
    pub(crate) group_index: f64,
    pub(crate) thermo_optic_per_k: f64,
    pub(crate) wavelength_nm: f64,
    pub(crate) glass_diameter_um: f64,
    /// 0 where light runs in the glass.
    pub(crate) hole_diameter_um: f64,
    /// Materials of the library, each with its outer diameter \[µm\].
    pub(crate) coatings: &'static [(&'static str, f64)],
    pub(crate) source: NumberSource,
}

/// p11 and p12 of silica fibre: Bertholds and Dändliker, J. Lightwave Technol. 6, 17 (1988).
pub(crate) const STRAIN_OPTIC: (f64, f64) = (0.113, 0.252);

const GLASS: &str = "silica";

impl FibreEntry {
    pub(crate) fn outer_diameter_um(&self) -> f64 {
        self.coatings.last().map_or(self.glass_diameter_um, |(_, outer_um)| *outer_um)
    }

    /// Its optics; expansion is left to the materials.
    pub(crate) fn optics(&self) -> Fibre {
        Fibre {
            refractive_index: self.refractive_index,
            group_index: Some(self.group_index),
            thermo_optic_per_k: self.thermo_optic_per_k,
            thermal_expansion_per_k: 0.0,
            wavelength_m: m_from_nm(self.wavelength_nm),
            outer_diameter_m: m_from_um(self.outer_diameter_um()),
        }
    }

    /// What it is made of; none if a name is in no library, which a test excludes.
    pub(crate) fn made_of(&self) -> Option<CoatedFibre> {
        let coatings =
            self.coatings.iter().map(|(name, outer_um)| Some((find(name)?.material(), m_from_um(0.5 * outer_um))));
        let (p11, p12) = if self.hole_diameter_um > 0.0 { (0.0, 0.0) } else { STRAIN_OPTIC };
        Some(CoatedFibre {
            glass: find(GLASS)?.material(),
            glass_radius_m: m_from_um(0.5 * self.glass_diameter_um),
            hole_radius_m: m_from_um(0.5 * self.hole_diameter_um),
            coatings: coatings.collect::<Option<_>>()?,
            p11,
            p12,
        })
    }
}

const fn usual(text: &'static str) -> NumberSource {
    NumberSource { text, was_read: false }
}

/// Every fibre, thickest solid one first.
pub(crate) const FIBRES: &[FibreEntry] = &[
    FibreEntry {
        name: "standard-125-245",
        kind: "solid",
        refractive_index: 1.445,
        group_index: 1.467,
        thermo_optic_per_k: 1.0e-5,
        wavelength_nm: 1550.0,
        glass_diameter_um: 125.0,
        hole_diameter_um: 0.0,
        coatings: &[("acrylate-soft", 190.0), ("acrylate-hard", 245.0)],
        source: usual(
            "ITU-T G.652.D fibre: group index 1.467, 125 and 245 µm from makers' sheets (read); dn/dT from 39 ps/(km K) of the coated fibre (Slavík et al., Sci. Rep. 5, 15447, read) less glass and coating; phase index and inner coating usual values",
        ),
    },
    FibreEntry {
        name: "panda-125-245",
        kind: "polarisation-maintaining",
        refractive_index: 1.445,
        group_index: 1.467,
        thermo_optic_per_k: 1.0e-5,
        wavelength_nm: 1550.0,
        glass_diameter_um: 125.0,
        hole_diameter_um: 0.0,
        coatings: &[("acrylate-soft", 190.0), ("acrylate-hard", 245.0)],
        source: usual("as standard-125-245; what the stress rods add to the slow axis is left out"),
    },
    FibreEntry {
        name: "panda-80-165",
        kind: "polarisation-maintaining",
        refractive_index: 1.445,
        group_index: 1.467,
        thermo_optic_per_k: 1.0e-5,
        wavelength_nm: 1550.0,
        glass_diameter_um: 80.0,
        hole_diameter_um: 0.0,
        coatings: &[("acrylate-soft", 125.0), ("acrylate-hard", 165.0)],
        source: usual("usual diameters of gyro fibre; optics as standard-125-245"),
    },
    FibreEntry {
        name: "thin-60-100",
        kind: "thin",
        refractive_index: 1.445,
        group_index: 1.467,
        thermo_optic_per_k: 1.0e-5,
        wavelength_nm: 1550.0,
        glass_diameter_um: 60.0,
        hole_diameter_um: 0.0,
        coatings: &[("acrylate-soft", 80.0), ("acrylate-hard", 100.0)],
        source: usual("usual diameters of thin gyro fibre; optics as standard-125-245"),
    },
    FibreEntry {
        name: "hollow-core-200-330",
        kind: "hollow-core",
        refractive_index: 1.0,
        group_index: 1.003,
        thermo_optic_per_k: 0.0,
        wavelength_nm: 1550.0,
        glass_diameter_um: 200.0,
        hole_diameter_um: 80.0,
        coatings: &[("acrylate-soft", 280.0), ("acrylate-hard", 330.0)],
        source: usual(
            "light in air, so that strain alone counts (Slavík et al., Sci. Rep. 5, 15447, read); diameters of the order of published antiresonant fibres, not read; makers' differ widely",
        ),
    },
];

/// A fibre by its name.
pub(crate) fn find_fibre(name: &str) -> Option<&'static FibreEntry> {
    FIBRES.iter().find(|entry| entry.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fibre_is_made_of_what_the_library_has() {
        for entry in FIBRES {
            let made = entry.made_of().expect(entry.name);
            let outer_m = made.coatings.last().map(|(_, outer_m)| 2.0 * outer_m);
            assert_eq!(outer_m, Some(entry.optics().outer_diameter_m), "{}", entry.name);
            assert!(entry.optics().transit_index() >= entry.refractive_index);
            assert_eq!(find_fibre(entry.name).map(|e| e.kind), Some(entry.kind));
        }
    }
}
