//! Materials that coils are made of, each with where its numbers are from.
//!
//! Numbers of polymers differ between batches and cures by tens of percent: those of the supplier belong into the model
//! file. Where [`NumberSource::was_read`] is false the number is the field's usual one and no accessible source of it was read.

use super::material::{Compression, Material, Property};
use crate::units::kelvin_from_celsius;

/// What a material is used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Use {
    Glass,
    Coating,
    Adhesive,
    Spool,
}

impl Use {
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Glass => "glass",
            Self::Coating => "coating",
            Self::Adhesive => "adhesive",
            Self::Spool => "spool",
        }
    }
}

/// A number or what it does over temperature; temperatures in °C, because tables of materials are.
#[derive(Debug, Clone, Copy)]
enum Stated {
    Number(f64),
    Points(&'static [(f64, f64)]),
    Transition { glassy: f64, rubbery: f64, transition_c: f64, width_k: f64 },
}

impl Stated {
    fn property(self) -> Property {
        match self {
            Self::Number(value) => Property::Constant(value),
            Self::Points(points) => {
                Property::Points(points.iter().map(|&(c, v)| (kelvin_from_celsius(c), v)).collect())
            }
            Self::Transition { glassy, rubbery, transition_c, width_k } => {
                Property::Transition { glassy, rubbery, transition_k: kelvin_from_celsius(transition_c), width_k }
            }
        }
    }
}

#[derive(Debug, Clone, Copy)]
enum Beside {
    Poisson(f64),
    BulkPa(f64),
}

/// Where numbers are from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct NumberSource {
    pub(crate) text: &'static str,
    /// Whether an accessible text with these numbers was read.
    pub(crate) was_read: bool,
}

const fn read(text: &'static str) -> NumberSource {
    NumberSource { text, was_read: true }
}

const fn usual(text: &'static str) -> NumberSource {
    NumberSource { text, was_read: false }
}

/// A material of the library.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    pub(crate) name: &'static str,
    pub(crate) used_as: Use,
    youngs_pa: Stated,
    beside: Beside,
    expansion_per_k: Stated,
    pub(crate) source: NumberSource,
}

impl Entry {
    /// As the stress of a pack needs it.
    pub fn material(&self) -> Material {
        Material {
            name: self.name.to_owned(),
            youngs_modulus_pa: self.youngs_pa.property(),
            compression: match self.beside {
                Beside::Poisson(ratio) => Compression::PoissonRatio(Property::Constant(ratio)),
                Beside::BulkPa(bulk) => Compression::BulkModulus(Property::Constant(bulk)),
            },
            expansion_per_k: self.expansion_per_k.property(),
        }
    }
}

/// Every material, by use.
pub(crate) const MATERIALS: &[Entry] = &[
    Entry {
        name: "silica",
        used_as: Use::Glass,
        youngs_pa: Stated::Number(72e9),
        beside: Beside::Poisson(0.17),
        expansion_per_k: Stated::Number(5.5e-7),
        source: usual(
            "expansion: mean from 20 to 320 °C, as tables of fused silica state it (read); E and ν: usual handbook values",
        ),
    },
    Entry {
        name: "silica-over-temperature",
        used_as: Use::Glass,
        youngs_pa: Stated::Number(72e9),
        beside: Beside::Poisson(0.17),
        expansion_per_k: Stated::Points(&[
            (-180.0, -6.5e-7),
            (-120.0, -3.0e-7),
            (-80.0, 0.0),
            (-40.0, 2.4e-7),
            (20.0, 4.8e-7),
            (100.0, 6.0e-7),
            (200.0, 6.2e-7),
        ]),
        source: usual(
            "zero at −80 °C: Souder and Hidnert, Sci. Papers Bureau of Standards 21 (1926), S524 (abstract read); the other points as expansion standards of fused silica have them, not read",
        ),
    },
    Entry {
        name: "acrylate-soft",
        used_as: Use::Coating,
        youngs_pa: Stated::Transition { glassy: 1.5e9, rubbery: 1e6, transition_c: -45.0, width_k: 6.0 },
        beside: Beside::BulkPa(2.5e9),
        expansion_per_k: Stated::Transition { glassy: 7e-5, rubbery: 2.2e-4, transition_c: -45.0, width_k: 6.0 },
        source: usual(
            "primary coating; rubbery modulus of about 1 MPa: WO 2021/091746 (below 0.5 MPa) and US 5913004 (at most 2 MPa at 23 °C), both read; the rest usual values of UV-cured urethane acrylates",
        ),
    },
    Entry {
        name: "acrylate-soft-rubbery",
        used_as: Use::Coating,
        youngs_pa: Stated::Number(1e6),
        beside: Beside::BulkPa(2.5e9),
        expansion_per_k: Stated::Number(2.2e-4),
        source: usual(
            "acrylate-soft above its glass transition, the same at every temperature, so that a model stays linear",
        ),
    },
    Entry {
        name: "acrylate-hard",
        used_as: Use::Coating,
        youngs_pa: Stated::Transition { glassy: 1.6e9, rubbery: 3e7, transition_c: 50.0, width_k: 14.0 },
        beside: Beside::BulkPa(3e9),
        expansion_per_k: Stated::Transition { glassy: 6e-5, rubbery: 1.8e-4, transition_c: 60.0, width_k: 10.0 },
        source: usual(
            "secondary coating; low end of usual values, as slow changes see a relaxed polymer: with it coated standard fibre has 41 ps/(km K), where 39 (Slavík et al., Sci. Rep. 5 (2015), 15447, read) to 40 are published",
        ),
    },
    Entry {
        name: "acrylate-hard-glassy",
        used_as: Use::Coating,
        youngs_pa: Stated::Number(1.05e9),
        beside: Beside::Poisson(0.4),
        expansion_per_k: Stated::Number(6.2e-5),
        source: usual("acrylate-hard at room temperature, the same at every temperature, so that a model stays linear"),
    },
    Entry {
        name: "polyimide",
        used_as: Use::Coating,
        youngs_pa: Stated::Number(2.5e9),
        beside: Beside::Poisson(0.34),
        expansion_per_k: Stated::Number(3e-5),
        source: usual("usual values of cast polyimide films"),
    },
    Entry {
        name: "epoxy",
        used_as: Use::Adhesive,
        youngs_pa: Stated::Number(4e9),
        beside: Beside::Poisson(0.35),
        expansion_per_k: Stated::Number(6e-5),
        source: read(
            "E and expansion: Budinski and Budinski, Engineering Materials (1999), as Princeton's MAE 324 glossary cites it; ν: usual value",
        ),
    },
    Entry {
        name: "epoxy-over-temperature",
        used_as: Use::Adhesive,
        youngs_pa: Stated::Transition { glassy: 4e9, rubbery: 3e7, transition_c: 70.0, width_k: 8.0 },
        beside: Beside::BulkPa(4.4e9),
        expansion_per_k: Stated::Transition { glassy: 6e-5, rubbery: 1.8e-4, transition_c: 70.0, width_k: 8.0 },
        source: usual("epoxy with the glass transition of a cure at room temperature"),
    },
    Entry {
        name: "epoxy-flexible",
        used_as: Use::Adhesive,
        youngs_pa: Stated::Transition { glassy: 2.5e9, rubbery: 1e7, transition_c: 5.0, width_k: 8.0 },
        beside: Beside::BulkPa(3e9),
        expansion_per_k: Stated::Transition { glassy: 7e-5, rubbery: 2e-4, transition_c: 5.0, width_k: 8.0 },
        source: usual("usual values of flexibilised epoxies, whose glass transition lies within the range of use"),
    },
    Entry {
        name: "acrylate-uv",
        used_as: Use::Adhesive,
        youngs_pa: Stated::Number(1e9),
        beside: Beside::Poisson(0.4),
        expansion_per_k: Stated::Number(1e-4),
        source: usual("usual values of optical UV-cured adhesives at room temperature"),
    },
    Entry {
        name: "silicone",
        used_as: Use::Adhesive,
        youngs_pa: Stated::Number(1.2e6),
        beside: Beside::BulkPa(1.1e9),
        expansion_per_k: Stated::Number(3.1e-4),
        source: usual(
            "unfilled; E of 0.2 to 1.6 MPa: PMC11019708, table 2 (read); bulk modulus and expansion: usual values",
        ),
    },
    Entry {
        name: "silicone-crystallising",
        used_as: Use::Adhesive,
        youngs_pa: Stated::Transition { glassy: 1.2e9, rubbery: 1.8e7, transition_c: -50.0, width_k: 4.0 },
        beside: Beside::BulkPa(1.1e9),
        expansion_per_k: Stated::Transition { glassy: 3e-4, rubbery: 4e-4, transition_c: -50.0, width_k: 4.0 },
        source: read(
            "TR-55 filled silicone, LLNL-TR-426277: shear modulus 6 MPa and 400 MPa on both sides of −40 to −60 °C, expansions 4e−4 and 3e−4 (abstract); its peak in between left out",
        ),
    },
    Entry {
        name: "aluminium-6061",
        used_as: Use::Spool,
        youngs_pa: Stated::Number(68.9e9),
        beside: Beside::Poisson(0.35),
        expansion_per_k: Stated::Number(24e-6),
        source: read("Hibbeler, Mechanics of Materials, table of properties (6061-T6)"),
    },
    Entry {
        name: "titanium-alloy",
        used_as: Use::Spool,
        youngs_pa: Stated::Number(120e9),
        beside: Beside::Poisson(0.36),
        expansion_per_k: Stated::Number(9.4e-6),
        source: read("Hibbeler, Mechanics of Materials, table of properties (Ti-6Al-4V)"),
    },
    Entry {
        name: "stainless-304",
        used_as: Use::Spool,
        youngs_pa: Stated::Number(193e9),
        beside: Beside::Poisson(0.27),
        expansion_per_k: Stated::Number(17e-6),
        source: read("Hibbeler, Mechanics of Materials, table of properties (stainless 304)"),
    },
    Entry {
        name: "invar",
        used_as: Use::Spool,
        youngs_pa: Stated::Number(141e9),
        beside: Beside::Poisson(0.29),
        expansion_per_k: Stated::Number(1.3e-6),
        source: usual("usual values of Fe-36Ni"),
    },
    Entry {
        name: "carbon-quasi-isotropic",
        used_as: Use::Spool,
        youngs_pa: Stated::Number(55e9),
        beside: Beside::Poisson(0.31),
        expansion_per_k: Stated::Number(2e-6),
        source: usual("usual values of a quasi-isotropic carbon laminate in its plane, taken as isotropic"),
    },
];

/// A material by its name.
pub fn find(name: &str) -> Option<&'static Entry> {
    MATERIALS.iter().find(|entry| entry.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stress::material::{COLDEST_K, HOTTEST_K};

    #[test]
    fn every_material_is_one_at_every_temperature_and_says_where_it_is_from() {
        for entry in MATERIALS {
            let material = entry.material();
            let least = material.least_poisson_ratio(COLDEST_K, HOTTEST_K);
            assert!((0.0..0.5).contains(&least), "{}: {least}", entry.name);
            assert!(entry.source.text.len() > 20, "{}", entry.name);
            assert_eq!(find(entry.name).map(|e| e.name), Some(entry.name));
        }
        let mut names: Vec<&str> = MATERIALS.iter().map(|e| e.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), MATERIALS.len());
    }
}
