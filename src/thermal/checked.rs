//! What a heat path cannot be.

use super::{Extent, HeatPart, HeatPath, Location, PackMaterial, ThermalError};

/// What a heat path cannot be.
///
/// # Errors
/// Parts that contradict each other or lack a material property.
pub(crate) fn check(path: &HeatPath) -> Result<(), ThermalError> {
    if path.extent == Extent::HalfSpace {
        let extras = [
            (path.location != Location::OuterLayer, HeatPart::AmbientSensor),
            (path.spool.is_some(), HeatPart::Spool),
            (path.bore_heat.is_some(), HeatPart::BoreHeat),
            (path.flange.is_some(), HeatPart::Flange),
            (!path.gaps.is_empty(), HeatPart::Gap),
            (!path.spool_flanges.is_empty(), HeatPart::Flange),
            (!path.housings.is_empty(), HeatPart::Housing),
            (path.start.is_some_and(|s| s.is_uneven()), HeatPart::UnevenStart),
            (path.conductivity_slope_per_k != 0.0, HeatPart::VaryingConductivity),
        ];
        if let Some((_, part)) = extras.into_iter().find(|(present, _)| *present) {
            return Err(ThermalError::NeedsPack { part });
        }
    }
    if matches!(path.material, PackMaterial::Diffusivity { .. }) {
        let extras = [
            (path.location != Location::OuterLayer && path.film_w_per_m2_k.is_some(), HeatPart::Film),
            (path.spool.is_some(), HeatPart::Spool),
            (path.bore_heat.is_some(), HeatPart::BoreHeat),
            (path.flange.is_some(), HeatPart::Flange),
            (!path.gaps.is_empty(), HeatPart::Gap),
            (!path.spool_flanges.is_empty(), HeatPart::Flange),
            (!path.housings.is_empty(), HeatPart::Housing),
        ];
        if let Some((_, part)) = extras.into_iter().find(|(present, _)| *present) {
            return Err(ThermalError::NeedsConductivity { part });
        }
    }
    if path.cells_per_layer == 0 {
        return Err(ThermalError::Cells { found: path.cells_per_layer });
    }
    let most = path.shape.layers - 1;
    if let Some(gap) = path.gaps.iter().find(|gap| gap.above_layer == 0 || gap.above_layer > most) {
        return Err(ThermalError::Gap { found: gap.above_layer, most });
    }
    check_sensor(path)?;
    if path.conductivity_slope_per_k != 0.0 {
        if path.is_joined() {
            return Err(ThermalError::Together { part: HeatPart::JoinedVarying });
        }
        if path.start.is_some_and(|start| start.is_uneven()) {
            return Err(ThermalError::Together { part: HeatPart::UnevenStartVarying });
        }
    }
    Ok(())
}

/// A sensor sits on something that is there, and something drives what it does not.
fn check_sensor(path: &HeatPath) -> Result<(), ThermalError> {
    let (is_there, on) = match path.location {
        Location::OuterLayer | Location::Ambient => return Ok(()),
        Location::Housing(place) => (path.housings.iter().any(|h| h.place == place), "a housing of that place"),
        Location::Spool => (path.spool.is_some(), "the spool"),
        Location::Flange(flange) => (path.spool_flanges.iter().any(|f| f.flange == flange), "a flange of the spool"),
    };
    if !is_there {
        return Err(ThermalError::NothingThere { on });
    }
    if let Location::Housing(_) = path.location {
        return Ok(());
    }
    if path.location == Location::Spool && path.spool_wall.is_some() && path.varies_along() {
        return Err(ThermalError::Together { part: HeatPart::SensorAlong });
    }
    if path.film_w_per_m2_k.is_none() { Err(ThermalError::NeedsFilm { on }) } else { Ok(()) }
}
