//! A coil's geometry and fibre: what is wound, before anybody says in which order.

use thiserror::Error;

/// The fibre's optical properties.
#[derive(Debug, Clone, PartialEq)]
pub struct Fibre {
    /// n, the phase index of the guided mode.
    pub refractive_index: f64,
    /// n_g, with which light travels; None: the phase index, as in the paper.
    pub group_index: Option<f64>,
    /// dn/dT.
    pub thermo_optic_per_k: f64,
    /// α, in n·α; 0 gives the paper's Eq. (4).
    pub thermal_expansion_per_k: f64,
    /// Of the light in vacuum.
    pub wavelength_m: f64,
    /// Over the coating.
    pub outer_diameter_m: f64,
}

impl Fibre {
    /// n_g: how long light takes, and so by how much the two beams meet a change at different times.
    pub(crate) fn transit_index(&self) -> f64 {
        self.group_index.unwrap_or(self.refractive_index)
    }

    /// κ = dn/dT + n·α, the change of optical path per metre and kelvin (paper, Eq. 2).
    pub fn path_per_k(&self) -> f64 {
        self.thermo_optic_per_k + self.refractive_index * self.thermal_expansion_per_k
    }
}

/// How the layers' lengths follow from the winding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LayerLength {
    /// All layers are L/N long (the paper).
    Equal,
    /// l_j = 2π r_j M_j.
    Actual,
}

/// Which diameter stands in the Sagnac scale factor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum SagnacDiameter {
    /// The mean of the innermost and the outermost layer's (the paper).
    #[default]
    Mean,
    /// Σ l_j 2 r_j / L: each layer's own weighs its length, so that L D is four times the area that the turns enclose.
    ByLength,
}

/// What is needed to build a [`Coil`].
#[derive(Debug, Clone, PartialEq)]
pub struct CoilSpec {
    /// The fibre that is wound.
    pub fibre: Fibre,
    /// Layers, an even number.
    pub layers: usize,
    /// Turns of a layer; None where a half space is modelled, which has no height.
    pub turns_per_layer: Option<f64>,
    /// From the coil's axis to the inner face of the innermost layer.
    pub bore_radius_m: f64,
    /// From one layer's middle to the next.
    pub radial_pitch_m: f64,
    /// From one turn's middle to the next along the axis.
    pub axial_pitch_m: f64,
    /// Whether each layer is as long as its radius makes it or all are alike.
    pub layer_length: LayerLength,
    /// The fibre's length; with `Equal` it may stand in for the turns.
    pub length_m: Option<f64>,
}

/// N layers of fibre on a spool; layer index 0 is the innermost, wound first.
///
/// # Shapes
/// `turns` and `layer_lengths_m` have one entry a layer, innermost first.
#[derive(Debug, Clone, PartialEq)]
pub struct Coil {
    fibre: Fibre,
    bore_radius_m: f64,
    radial_pitch_m: f64,
    axial_pitch_m: f64,
    layer_length: LayerLength,
    turns: Vec<f64>,
    layer_lengths_m: Vec<f64>,
    crossover_turns: f64,
    sagnac: SagnacDiameter,
}

/// A stated and a computed length may differ by this much: windings are never quite full.
const LENGTH_AGREEMENT: f64 = 0.02;

/// Why numbers make no coil.
#[derive(Debug, Error, Clone, PartialEq)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum CoilError {
    #[error(
        "winding.layers must be an even number of at least 2, found {found}: both halves of the fibre need the same number of layers"
    )]
    Layers { found: usize },
    #[error("winding.turns_per_layer is needed for layer_length = \"actual\", found none: give the turns of one layer")]
    TurnsMissing,
    #[error("the fibre's length is unknown: give winding.length_m or winding.turns_per_layer")]
    LengthMissing,
    #[error(
        "winding.length_m = {stated_m} disagrees with turns and radii, which make {computed_m:.3} m: correct one of them (they may differ by 2 %)"
    )]
    LengthDisagrees { stated_m: f64, computed_m: f64 },
    #[error("{quantity} must be positive and finite, found {found}")]
    NotPositive { quantity: &'static str, found: f64 },
}

impl Coil {
    /// # Errors
    /// An odd or too small layer count, lengths that are missing or disagree, dimensions that are not positive.
    pub fn new(spec: CoilSpec) -> Result<Self, CoilError> {
        Self::with_crossovers(spec, 0.0)
    }

    /// As [`Coil::new`], where each layer takes so much of a turn's fibre more to change sides: half of it at either end of the layer.
    ///
    /// # Errors
    /// As [`Coil::new`]; crossovers that take all of a stated length.
    pub(crate) fn with_crossovers(spec: CoilSpec, crossover_turns: f64) -> Result<Self, CoilError> {
        if spec.layers < 2 || !spec.layers.is_multiple_of(2) {
            return Err(CoilError::Layers { found: spec.layers });
        }
        for (quantity, found) in [
            ("the bore radius", spec.bore_radius_m),
            ("winding.radial_pitch_um", spec.radial_pitch_m),
            ("winding.axial_pitch_um", spec.axial_pitch_m),
            ("winding.turns_per_layer", spec.turns_per_layer.unwrap_or(1.0)),
            ("winding.length_m", spec.length_m.unwrap_or(1.0)),
        ] {
            if !(found > 0.0 && found.is_finite()) {
                return Err(CoilError::NotPositive { quantity, found });
            }
        }
        let mean_radius_m = spec.bore_radius_m + 0.5 * spec.layers as f64 * spec.radial_pitch_m;
        let mean_turn_m = std::f64::consts::TAU * mean_radius_m;
        let turns_per_layer = match (spec.turns_per_layer, spec.layer_length, spec.length_m) {
            (Some(turns), _, _) => turns,
            (None, LayerLength::Actual, _) => return Err(CoilError::TurnsMissing),
            (None, LayerLength::Equal, Some(length_m)) => {
                length_m / (spec.layers as f64 * mean_turn_m) - crossover_turns
            }
            (None, LayerLength::Equal, None) => return Err(CoilError::LengthMissing),
        };
        for (quantity, found) in
            [("1 + winding.crossover_turns", 1.0 + crossover_turns), ("the turns of a layer", turns_per_layer)]
        {
            if !(found > 0.0 && found.is_finite()) {
                return Err(CoilError::NotPositive { quantity, found });
            }
        }
        let mut coil = Self {
            fibre: spec.fibre,
            bore_radius_m: spec.bore_radius_m,
            radial_pitch_m: spec.radial_pitch_m,
            axial_pitch_m: spec.axial_pitch_m,
            layer_length: spec.layer_length,
            turns: vec![turns_per_layer; spec.layers],
            layer_lengths_m: Vec::new(),
            crossover_turns,
            sagnac: SagnacDiameter::Mean,
        };
        coil.layer_lengths_m = coil.lengths_of(&coil.turns);
        if let Some(stated_m) = spec.length_m {
            let computed_m = coil.length_m();
            if (stated_m - computed_m).abs() > LENGTH_AGREEMENT * stated_m {
                return Err(CoilError::LengthDisagrees { stated_m, computed_m });
            }
            if coil.layer_length == LayerLength::Equal {
                coil.layer_lengths_m = vec![stated_m / spec.layers as f64; spec.layers];
            }
        }
        Ok(coil)
    }

    fn lengths_of(&self, turns: &[f64]) -> Vec<f64> {
        let mean_radius_m = self.mean_radius_m();
        turns
            .iter()
            .enumerate()
            .map(|(layer, turns)| {
                let radius_m = match self.layer_length {
                    LayerLength::Equal => mean_radius_m,
                    LayerLength::Actual => self.layer_radius_m(layer),
                };
                std::f64::consts::TAU * radius_m * (turns + self.crossover_turns)
            })
            .collect()
    }

    /// The same coil with other turn counts; each layer's length scales with its turns.
    ///
    /// # Errors
    /// Turn counts that are not positive, or not one a layer.
    pub fn with_turns(&self, turns: Vec<f64>) -> Result<Self, CoilError> {
        if turns.len() != self.layers() {
            return Err(CoilError::Layers { found: turns.len() });
        }
        if let Some(&found) = turns.iter().find(|t| !(**t > 0.0 && t.is_finite())) {
            return Err(CoilError::NotPositive { quantity: "the turns of a layer", found });
        }
        let layer_lengths_m = self
            .layer_lengths_m
            .iter()
            .zip(&self.turns)
            .zip(&turns)
            .map(|((length_m, old), new)| length_m * (new + self.crossover_turns) / (old + self.crossover_turns))
            .collect();
        Ok(Self { turns, layer_lengths_m, ..self.clone() })
    }

    /// The same coil with layers of other lengths, each by its factor, and as many turns.
    pub(crate) fn with_lengths_scaled(&self, factors: &[f64]) -> Self {
        let mut coil = self.clone();
        coil.layer_lengths_m.iter_mut().zip(factors).for_each(|(length_m, factor)| *length_m *= factor);
        coil
    }

    /// The same coil with another diameter in its Sagnac scale factor.
    pub(crate) fn with_sagnac(&self, sagnac: SagnacDiameter) -> Self {
        Self { sagnac, ..self.clone() }
    }

    /// The same coil with another radial pitch; radii and actual lengths follow, the bore stays.
    ///
    /// # Errors
    /// A pitch that is not positive.
    pub fn with_radial_pitch(&self, radial_pitch_m: f64) -> Result<Self, CoilError> {
        if !(radial_pitch_m > 0.0 && radial_pitch_m.is_finite()) {
            return Err(CoilError::NotPositive { quantity: "winding.radial_pitch_um", found: radial_pitch_m });
        }
        let mut coil = Self { radial_pitch_m, ..self.clone() };
        if coil.layer_length == LayerLength::Actual {
            coil.layer_lengths_m = coil.lengths_of(&coil.turns);
        }
        Ok(coil)
    }

    /// The same coil of fibre with another expansion, which adds to κ.
    pub(crate) fn with_thermal_expansion(&self, per_k: f64) -> Self {
        let mut coil = self.clone();
        coil.fibre.thermal_expansion_per_k = per_k;
        coil
    }

    /// The fibre that is wound.
    pub fn fibre(&self) -> &Fibre {
        &self.fibre
    }

    /// N.
    pub fn layers(&self) -> usize {
        self.turns.len()
    }

    /// Whether each layer is as long as its radius makes it or all are alike.
    pub fn layer_length(&self) -> LayerLength {
        self.layer_length
    }

    /// M_j, innermost layer first.
    pub fn turns(&self) -> &[f64] {
        &self.turns
    }

    /// l_j, innermost layer first.
    pub fn layer_lengths_m(&self) -> &[f64] {
        &self.layer_lengths_m
    }

    /// Fibre that each layer takes to change sides \[turns\].
    pub(crate) fn crossover_turns(&self) -> f64 {
        self.crossover_turns
    }

    pub(crate) fn sagnac(&self) -> SagnacDiameter {
        self.sagnac
    }

    /// L.
    pub fn length_m(&self) -> f64 {
        self.layer_lengths_m.iter().sum()
    }

    /// r_in, the spool's surface.
    pub fn bore_radius_m(&self) -> f64 {
        self.bore_radius_m
    }

    /// The pack's outer surface.
    pub fn outer_radius_m(&self) -> f64 {
        self.bore_radius_m + self.layers() as f64 * self.radial_pitch_m
    }

    /// From one layer's middle to the next.
    pub fn radial_pitch_m(&self) -> f64 {
        self.radial_pitch_m
    }

    /// From one turn's middle to the next along the axis.
    pub fn axial_pitch_m(&self) -> f64 {
        self.axial_pitch_m
    }

    /// Between the flanges.
    pub(crate) fn height_m(&self) -> f64 {
        self.axial_pitch_m * self.turns.iter().copied().fold(0.0, f64::max)
    }

    /// r_j, the middle of a layer (index 0 is the innermost).
    pub fn layer_radius_m(&self, layer: usize) -> f64 {
        self.bore_radius_m + (layer as f64 + 0.5) * self.radial_pitch_m
    }

    fn mean_radius_m(&self) -> f64 {
        self.bore_radius_m + 0.5 * self.layers() as f64 * self.radial_pitch_m
    }

    /// Between the innermost and the outermost layer's.
    pub fn mean_diameter_m(&self) -> f64 {
        2.0 * self.mean_radius_m()
    }

    /// D, the diameter in the Sagnac scale factor.
    pub(crate) fn sagnac_diameter_m(&self) -> f64 {
        match self.sagnac {
            SagnacDiameter::Mean => self.mean_diameter_m(),
            SagnacDiameter::ByLength => {
                let lengths = self.layer_lengths_m.iter().enumerate();
                lengths.map(|(layer, length_m)| 2.0 * self.layer_radius_m(layer) * length_m).sum::<f64>()
                    / self.length_m()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::coil::SagnacDiameter;
    use crate::rate::CoilModel;

    #[test]
    fn a_diameter_by_length_makes_length_times_diameter_four_times_the_area_of_all_turns() {
        let model = CoilModel::builder("x", 24).mean_diameter_m(0.08).turns_per_layer(50.0).build().unwrap();
        let coil = model.coil.with_sagnac(SagnacDiameter::ByLength);
        let area_m2: f64 = (0..24).map(|j| 50.0 * std::f64::consts::PI * coil.layer_radius_m(j).powi(2)).sum();
        assert!((coil.length_m() * coil.sagnac_diameter_m() / (4.0 * area_m2) - 1.0).abs() < 1e-13);
        // 1 + Var(r)/r², of radii that are spread evenly.
        let relative = 24.0 * 250e-6 / 12f64.sqrt() / 0.04 * (1.0 - 1.0 / 576.0_f64).sqrt();
        assert!((coil.sagnac_diameter_m() / coil.mean_diameter_m() - 1.0 - relative.powi(2)).abs() < 1e-12);
        let equal = CoilModel::builder("x", 24).mean_diameter_m(0.08).length_m(300.0).build().unwrap().coil;
        let by_length = equal.with_sagnac(SagnacDiameter::ByLength);
        assert!((by_length.sagnac_diameter_m() / equal.mean_diameter_m() - 1.0).abs() < 1e-14);
    }
}
