//! What coils are made of, mechanically: stiffness and expansion over temperature.

use crate::units::REFERENCE_TEMPERATURE_K;

/// A property over temperature.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Property {
    Constant(f64),
    /// Temperatures \[K\], rising, and values; held beyond the ends, straight between.
    Points(Vec<(f64, f64)>),
    /// From one value to another through a transition.
    Transition {
        glassy: f64,
        rubbery: f64,
        transition_k: f64,
        width_k: f64,
    },
}

/// How values lie between two that are known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Scale {
    Linear,
    /// Moduli fall by orders of magnitude within a few kelvin.
    Logarithmic,
}

impl Property {
    fn at(&self, temperature_k: f64, scale: Scale) -> f64 {
        let between = |a: f64, b: f64, share: f64| match scale {
            Scale::Linear => a + share * (b - a),
            Scale::Logarithmic => a * (b / a).powf(share),
        };
        match self {
            Self::Constant(value) => *value,
            Self::Points(points) => {
                let after = points.partition_point(|(t, _)| *t < temperature_k);
                match (after.checked_sub(1).and_then(|i| points.get(i)), points.get(after)) {
                    (Some(&(t0, v0)), Some(&(t1, v1))) => between(v0, v1, (temperature_k - t0) / (t1 - t0)),
                    (Some(&(_, only)), None) | (None, Some(&(_, only))) => only,
                    (None, None) => f64::NAN,
                }
            }
            &Self::Transition { glassy, rubbery, transition_k, width_k } => {
                between(rubbery, glassy, 1.0 / (1.0 + ((temperature_k - transition_k) / width_k).exp()))
            }
        }
    }

    /// Whether it changes with temperature at all.
    pub(crate) fn is_constant(&self) -> bool {
        match self {
            Self::Constant(_) => true,
            Self::Points(points) => points.windows(2).all(|two| two[0].1 == two[1].1),
            Self::Transition { glassy, rubbery, .. } => glassy == rubbery,
        }
    }
}

/// What is stated beside Young's modulus.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Compression {
    /// ν.
    PoissonRatio(Property),
    /// K \[Pa\]: what a polymer keeps while its Young's modulus falls through the glass transition.
    BulkModulus(Property),
}

/// An isotropic material.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    pub(crate) name: String,
    /// E \[Pa\].
    pub(crate) youngs_modulus_pa: Property,
    pub(crate) compression: Compression,
    /// α \[1/K\].
    pub(crate) expansion_per_k: Property,
}

/// A material at one temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Elastic {
    pub(crate) youngs_modulus_pa: f64,
    pub(crate) poisson_ratio: f64,
    pub(crate) expansion_per_k: f64,
}

impl Elastic {
    /// μ.
    pub(crate) fn shear_pa(&self) -> f64 {
        self.youngs_modulus_pa / (2.0 * (1.0 + self.poisson_ratio))
    }

    /// Lamé's λ.
    pub(crate) fn lame_pa(&self) -> f64 {
        let nu = self.poisson_ratio;
        self.youngs_modulus_pa * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
    }

    /// k = λ + μ, the bulk modulus in plane strain.
    pub(crate) fn plane_bulk_pa(&self) -> f64 {
        self.lame_pa() + self.shear_pa()
    }

    /// 3 K α: stress per kelvin of what cannot expand.
    pub(crate) fn thermal_stress_pa_per_k(&self) -> f64 {
        (3.0 * self.lame_pa() + 2.0 * self.shear_pa()) * self.expansion_per_k
    }
}

/// A Poisson's ratio at which nothing can be computed any more lies beyond this.
pub(crate) const MOST_POISSON_RATIO: f64 = 0.49995;

impl Material {
    /// Of the same modulus, ratio and expansion at every temperature.
    pub fn constant(name: &str, youngs_modulus_pa: f64, poisson_ratio: f64, expansion_per_k: f64) -> Self {
        Self {
            name: name.to_owned(),
            youngs_modulus_pa: Property::Constant(youngs_modulus_pa),
            compression: Compression::PoissonRatio(Property::Constant(poisson_ratio)),
            expansion_per_k: Property::Constant(expansion_per_k),
        }
    }

    pub(crate) fn at(&self, temperature_k: f64) -> Elastic {
        let youngs_modulus_pa = self.youngs_modulus_pa.at(temperature_k, Scale::Logarithmic);
        let poisson_ratio = match &self.compression {
            Compression::PoissonRatio(ratio) => ratio.at(temperature_k, Scale::Linear),
            Compression::BulkModulus(bulk) => {
                0.5 - youngs_modulus_pa / (6.0 * bulk.at(temperature_k, Scale::Logarithmic))
            }
        };
        Elastic {
            youngs_modulus_pa,
            poisson_ratio: poisson_ratio.min(MOST_POISSON_RATIO),
            expansion_per_k: self.expansion_per_k.at(temperature_k, Scale::Linear),
        }
    }

    /// Whether stiffness and expansion are the same at every temperature.
    pub(crate) fn is_constant(&self) -> bool {
        let (Compression::PoissonRatio(beside) | Compression::BulkModulus(beside)) = &self.compression;
        self.youngs_modulus_pa.is_constant() && beside.is_constant() && self.expansion_per_k.is_constant()
    }

    /// The least Poisson's ratio between two temperatures: what is stated as E and K may contradict itself.
    pub(crate) fn least_poisson_ratio(&self, from_k: f64, to_k: f64) -> f64 {
        let steps = 100;
        (0..=steps)
            .map(|i| self.at(from_k + (to_k - from_k) * f64::from(i) / f64::from(steps)).poisson_ratio)
            .fold(f64::INFINITY, f64::min)
    }
}

/// Between these temperatures a coil is looked at.
pub(crate) const COLDEST_K: f64 = REFERENCE_TEMPERATURE_K - 220.0;
pub(crate) const HOTTEST_K: f64 = REFERENCE_TEMPERATURE_K + 180.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_modulus_falls_by_equal_ratios_and_is_held_beyond_the_ends() {
        let property = Property::Points(vec![(250.0, 1e9), (300.0, 1e7)]);
        let at = |t| property.at(t, Scale::Logarithmic);
        assert!((at(275.0) / 1e8 - 1.0).abs() < 1e-12);
        assert_eq!((at(200.0), at(400.0)), (1e9, 1e7));
        assert!((property.at(275.0, Scale::Linear) / 5.05e8 - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_polymer_keeps_its_bulk_modulus_through_the_glass_transition() {
        let transition = |glassy, rubbery| Property::Transition { glassy, rubbery, transition_k: 230.0, width_k: 5.0 };
        let soft = Material {
            name: "soft".into(),
            youngs_modulus_pa: transition(2e9, 1e6),
            compression: Compression::BulkModulus(Property::Constant(2.5e9)),
            expansion_per_k: transition(7e-5, 2.5e-4),
        };
        let (cold, warm) = (soft.at(150.0), soft.at(320.0));
        assert!((cold.poisson_ratio - (0.5 - 2.0 / 15.0)).abs() < 1e-6);
        assert!((warm.youngs_modulus_pa / 1e6 - 1.0).abs() < 1e-4 && warm.poisson_ratio > 0.4999);
        assert!((warm.expansion_per_k / 2.5e-4 - 1.0).abs() < 1e-6);
        assert!(!soft.is_constant() && Material::constant("glass", 72e9, 0.17, 5e-7).is_constant());
    }
}
