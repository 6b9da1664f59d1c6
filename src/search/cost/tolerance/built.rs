//! The model of one coil as it is built.

use super::{Spread, ToleranceSpec};
use crate::coil::Coil;
use crate::effect::{self, Address, DeclaredEffect};
use crate::rate::CoilModel;
use crate::search::cost::deviates::Deviates;
use crate::search::cost::worst_case::SearchError;

/// A factor is not varied below this: a coil with less is no coil.
const LEAST_FACTOR: f64 = 0.1;

/// The model of one coil as built, with the given spreads only.
pub(super) fn built(
    model: &CoilModel,
    spec: &ToleranceSpec,
    spreads: &[Spread],
    coil: &Deviates,
) -> Result<CoilModel, SearchError> {
    let mut model = model.clone();
    for &spread in spreads {
        let index = Spread::ALL.iter().position(|s| *s == spread).unwrap_or(0);
        let change = spec.sd(spread) * coil.others.get(index).copied().unwrap_or(0.0);
        let factor = (1.0 + change).max(LEAST_FACTOR);
        match spread {
            Spread::Turns => {
                let turns = model.coil.turns().iter().zip(&coil.turns);
                let turns = turns.map(|(m, z)| (m + spec.turns_per_layer_sd * z).max(LEAST_FACTOR * m)).collect();
                model.coil = model.coil.with_turns(turns)?;
            }
            Spread::RadialPitch => {
                model.coil = model.coil.with_radial_pitch(model.coil.radial_pitch_m() * factor)?;
            }
            Spread::MidpointOffset => change_effect(&mut model, effect::OFFSET_OF_MIDDLE, |offset_m| offset_m + change),
            Spread::Diffusivity => change_effect(&mut model, effect::DIFFUSIVITY_FACTOR, |f| f * factor),
            Spread::Film => change_effect(&mut model, effect::FILM, |film| film * factor),
            Spread::Mismatch => change_effect(&mut model, effect::MISMATCH_OF_HALVES, |m| m + change),
            Spread::LostTurns => {
                let turns = model.coil.turns().iter().zip(&coil.lost);
                let left = |(m, u): (&f64, &f64)| (m - poisson(spec.sd(spread), *u)).max(LEAST_FACTOR * m);
                let turns = turns.map(left).collect();
                model.coil = model.coil.with_turns(turns)?;
            }
            Spread::LayerPitch => model.coil = with_layer_pitches(&model.coil, spec.sd(spread), &coil.pitches),
            Spread::FlangeFilm => {
                let at_flanges = model.effects.iter_mut().filter(|e| e.is_at(effect::FLANGE_FILM));
                for (heated, z) in at_flanges.zip(coil.flanges) {
                    let mut values = heated.values().to_vec();
                    values[effect::FLANGE_FILM.parameter] *= (1.0 + spec.sd(spread) * z).max(LEAST_FACTOR);
                    if let Ok(changed) = heated.with_values(values) {
                        *heated = changed;
                    }
                }
            }
            Spread::TrimResidue => {
                let half_m = 0.5 * spec.sd(spread) * coil.trim;
                change_effect(&mut model, effect::OFFSET_OF_MIDDLE, |offset_m| offset_m + half_m);
            }
        }
    }
    Ok(model)
}

/// The model with the middle of the fibre further from the coil's.
pub(in crate::search) fn with_middle_moved(model: &CoilModel, by_m: f64) -> CoilModel {
    let mut moved = model.clone();
    change_effect(&mut moved, effect::OFFSET_OF_MIDDLE, |offset_m| offset_m + by_m);
    moved
}

/// The smallest count that a Poisson variable of this mean does not exceed with a probability of u.
fn poisson(mean: f64, u: f64) -> f64 {
    const MOST: u32 = 10_000;
    let mut term = (-mean).exp();
    let (mut below, mut count) = (term, 0);
    while u > below && count < MOST {
        count += 1;
        term *= mean / f64::from(count);
        below += term;
    }
    f64::from(count)
}

/// Layers whose own pitches spread: each layer's length follows its radius.
fn with_layer_pitches(coil: &Coil, sd: f64, deviates: &[f64]) -> Coil {
    let pitch_m = coil.radial_pitch_m();
    let mut inside_m = coil.bore_radius_m();
    let mut factors = Vec::with_capacity(coil.layers());
    for (layer, z) in deviates.iter().enumerate() {
        let own_m = pitch_m * (1.0 + sd * z).max(LEAST_FACTOR);
        factors.push((inside_m + 0.5 * own_m) / coil.layer_radius_m(layer));
        inside_m += own_m;
    }
    coil.with_lengths_scaled(&factors)
}

/// Changes a parameter within its bounds; an effect that is not declared begins where it changes nothing.
fn change_effect(model: &mut CoilModel, address: Address, change: impl Fn(f64) -> f64) {
    let Address { spec, parameter: index, neutral } = address;
    let parameter = &spec.parameters[index];
    let within = |si: f64| si.clamp(parameter.unit.to_si(parameter.lower), parameter.unit.to_si(parameter.upper));
    let declared = model.effects.iter_mut().find(|e| e.is_at(address));
    let mut values = declared.as_ref().map_or(vec![neutral; spec.parameters.len()], |e| e.values().to_vec());
    values[index] = within(change(values[index]));
    match declared {
        Some(effect) => {
            if let Ok(changed) = effect.with_values(values) {
                *effect = changed;
            }
        }
        None => model.effects.extend(DeclaredEffect::new(spec, values, vec![0; spec.choices.len()])),
    }
}
