//! A model from what is special about a coil; the rest is as usual.

use super::CoilModel;
use crate::coil::{Coil, CoilError, CoilSpec, Fibre, LayerLength};
use crate::effect::DeclaredEffect;
use crate::thermal::{DEFAULT_CELLS_PER_LAYER, Extent, Location, PackMaterial};

/// The fibre of Yan, Lan, Jian (1998), section 4; its Eq. (4) leaves the expansion out.
const USUAL_FIBRE: Fibre = Fibre {
    refractive_index: 1.447,
    thermo_optic_per_k: 1.35e-5,
    group_index: None,
    thermal_expansion_per_k: 0.0,
    wavelength_m: 1.3e-6,
    outer_diameter_m: 250e-6,
};

/// The pack of the same paper, Table 1: 0.3 … 0.36 W/(m K) over 1.22 … 1.54 g/cm³ and 880 J/(kg K).
const USUAL_MATERIAL: PackMaterial = PackMaterial::Diffusivity { m2_per_s: 2.7e-7 };

/// Builds a [`CoilModel`]; what is not stated is as in the table.
///
/// | what | unless stated |
/// |---|---|
/// | fibre | n = 1.447, dn/dT = 1.35e−5 /K, 1300 nm, 250 µm over the coating (Yan, Lan, Jian 1998) |
/// | pitches | the fibre's outer diameter |
/// | material | a diffusivity of 2.7e−7 m²/s (the same paper, Table 1) |
/// | extent | a pack that ends at an adiabatic bore |
/// | sensor | on the outermost layer, rates at an instant |
/// | effects | none |
///
/// The diameter and one of length and turns have no usual value. Turns give each layer its actual length; a length
/// alone is divided into equal layers, as in the paper.
///
/// # Example
/// ```
/// use coilwright::rate::CoilModel;
///
/// let model = CoilModel::builder("a coil", 40).mean_diameter_m(0.08).turns_per_layer(98.0).build()?;
/// // π · 0.08 m · 98 turns · 40 layers.
/// assert!((model.coil.length_m() - 985.2).abs() < 0.1);
/// # Ok::<(), coilwright::coil::CoilError>(())
/// ```
#[derive(Debug, Clone)]
pub struct CoilModelBuilder {
    name: String,
    layers: usize,
    fibre: Fibre,
    mean_diameter_m: f64,
    radial_pitch_m: Option<f64>,
    axial_pitch_m: Option<f64>,
    turns_per_layer: Option<f64>,
    length_m: Option<f64>,
    extent: Extent,
    material: PackMaterial,
    location: Location,
    rate_mean_s: f64,
    effects: Vec<DeclaredEffect>,
}

impl CoilModel {
    /// Begins a model of a coil of so many layers; see [`CoilModelBuilder`].
    pub fn builder(name: impl Into<String>, layers: usize) -> CoilModelBuilder {
        CoilModelBuilder {
            name: name.into(),
            layers,
            fibre: USUAL_FIBRE,
            mean_diameter_m: f64::NAN,
            radial_pitch_m: None,
            axial_pitch_m: None,
            turns_per_layer: None,
            length_m: None,
            extent: Extent::Pack,
            material: USUAL_MATERIAL,
            location: Location::OuterLayer,
            rate_mean_s: 0.0,
            effects: Vec::new(),
        }
    }
}

impl CoilModelBuilder {
    /// The fibre's optical properties and its diameter.
    pub fn fibre(mut self, fibre: Fibre) -> Self {
        self.fibre = fibre;
        self
    }

    /// Of the coil, between the innermost and the outermost layer \[m\].
    pub fn mean_diameter_m(mut self, diameter_m: f64) -> Self {
        self.mean_diameter_m = diameter_m;
        self
    }

    /// Between neighbouring layers \[m\].
    pub fn radial_pitch_m(mut self, pitch_m: f64) -> Self {
        self.radial_pitch_m = Some(pitch_m);
        self
    }

    /// Between neighbouring turns \[m\].
    pub fn axial_pitch_m(mut self, pitch_m: f64) -> Self {
        self.axial_pitch_m = Some(pitch_m);
        self
    }

    /// Turns of each layer; every layer is then as long as its radius makes it.
    pub fn turns_per_layer(mut self, turns: f64) -> Self {
        self.turns_per_layer = Some(turns);
        self
    }

    /// Of the whole fibre \[m\]; checked against the turns, or divided into equal layers without them.
    pub fn length_m(mut self, length_m: f64) -> Self {
        self.length_m = Some(length_m);
        self
    }

    /// Whether the pack ends at the bore or is taken for a half space.
    pub fn extent(mut self, extent: Extent) -> Self {
        self.extent = extent;
        self
    }

    /// What the pack is made of, thermally.
    pub fn material(mut self, material: PackMaterial) -> Self {
        self.material = material;
        self
    }

    /// What a profile or a record is the temperature of.
    pub fn location(mut self, location: Location) -> Self {
        self.location = location;
        self
    }

    /// Each recorded rate is the mean over this interval \[s\].
    pub fn rate_mean_s(mut self, interval_s: f64) -> Self {
        self.rate_mean_s = interval_s;
        self
    }

    /// One more effect.
    pub fn effect(mut self, effect: DeclaredEffect) -> Self {
        self.effects.push(effect);
        self
    }

    /// # Errors
    /// A coil that cannot be wound: no diameter, no length, an odd number of layers, dimensions that disagree.
    pub fn build(self) -> Result<CoilModel, CoilError> {
        let radial_pitch_m = self.radial_pitch_m.unwrap_or(self.fibre.outer_diameter_m);
        let coil = Coil::new(CoilSpec {
            layers: self.layers,
            turns_per_layer: self.turns_per_layer,
            bore_radius_m: 0.5 * self.mean_diameter_m - 0.5 * self.layers as f64 * radial_pitch_m,
            radial_pitch_m,
            axial_pitch_m: self.axial_pitch_m.unwrap_or(self.fibre.outer_diameter_m),
            layer_length: if self.turns_per_layer.is_some() { LayerLength::Actual } else { LayerLength::Equal },
            length_m: self.length_m,
            fibre: self.fibre,
        })?;
        Ok(CoilModel {
            name: self.name,
            coil,
            extent: self.extent,
            material: self.material,
            location: self.location,
            rate_mean_s: self.rate_mean_s,
            cells_per_layer: DEFAULT_CELLS_PER_LAYER,
            effects: self.effects,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_alone_makes_equal_layers_and_turns_make_actual_ones() {
        let equal = CoilModel::builder("equal", 12).mean_diameter_m(0.075).length_m(200.0).build().unwrap();
        assert!(equal.coil.layer_lengths_m().iter().all(|l| (l - 200.0 / 12.0).abs() < 1e-12));
        let actual = CoilModel::builder("actual", 12).mean_diameter_m(0.075).turns_per_layer(70.0).build().unwrap();
        let lengths_m = actual.coil.layer_lengths_m();
        let step_m = std::f64::consts::TAU * 250e-6 * 70.0;
        assert!(lengths_m.windows(2).all(|two| (two[1] - two[0] - step_m).abs() < 1e-12));
    }

    #[test]
    fn what_has_no_usual_value_must_be_stated() {
        let no_diameter = CoilModel::builder("coil", 12).length_m(200.0).build();
        assert!(matches!(no_diameter, Err(CoilError::NotPositive { quantity: "the bore radius", .. })));
        let no_length = CoilModel::builder("coil", 12).mean_diameter_m(0.075).build();
        assert_eq!(no_length.unwrap_err(), CoilError::LengthMissing);
        let odd = CoilModel::builder("coil", 11).mean_diameter_m(0.075).length_m(200.0).build();
        assert_eq!(odd.unwrap_err(), CoilError::Layers { found: 11 });
    }
}
