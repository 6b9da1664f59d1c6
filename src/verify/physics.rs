//! The declared physics as plain numbers, read without the code that lets effects act.
//!
//! One match over the effects' names stands here on purpose: it is the second reading of `effect`'s catalogue. An
//! effect that it does not know makes [`Physics::read`] say so, and the rate error then counts as not verified.

use std::f64::consts::PI;
use std::sync::Arc;

use crate::effect::Subject;
use crate::effect::custom::Formula;
use crate::rate::CoilModel;
use crate::stress::Materials;
use crate::thermal::{Extent, Flange, Location, PackMaterial};

/// What the heat flows through and what the light sees, with every declared effect.
#[derive(Debug, Clone)]
pub(super) struct Physics {
    /// Ends at a bore, instead of a half space.
    pub(crate) is_pack: bool,
    pub(crate) conductivity_w_per_m_k: f64,
    pub(crate) heat_capacity_j_per_m3_k: f64,
    /// The profile is the air's (or, without a film, the surface's) instead of the outermost layer's.
    pub(crate) driven_from_outside: bool,
    pub(crate) film_w_per_m2_k: Option<f64>,
    pub(crate) spool: Option<SpoolMass>,
    pub(crate) bore_heat: Option<BoreHeat>,
    /// One, or one at either end.
    pub(crate) flanges: Vec<HeatedFlange>,
    /// Layer below a gap, counted from 1 innermost, and conductance per area [W/(m²K)].
    pub(crate) gaps: Vec<(usize, f64)>,
    /// Layer, counted from 1 innermost, and relative change of its κ.
    pub(crate) layer_changes: Vec<(usize, f64)>,
    /// Heat capacity and conductance inwards per area of the pack's outer surface, from the coil outwards.
    pub(crate) housings: Vec<[f64; 2]>,
    /// Rate of the drive before the start, and for how long.
    pub(crate) ramp_before: Option<[f64; 2]>,
    /// k and thickness of a spool's wall that conducts along the axis.
    pub(crate) spool_wall: Option<[f64; 2]>,
    pub(crate) spool_flanges: Vec<SpoolFlange>,
    pub(crate) sensor: Sensor,
    /// By how much pack, spool and housings are warmer than the drive at the start.
    pub(crate) above_k: Option<[f64; 3]>,
    /// What is not worked out a second time: housings or a ramp before the start beside a conductivity that depends on temperature.
    pub(crate) is_beyond: bool,
    pub(crate) conductivity_slope_per_k: f64,
    /// Missing on every second layer, the innermost being the first.
    pub(crate) missing_turns: f64,
    /// Factor on κ everywhere.
    pub(crate) path_factor: f64,
    pub(crate) stress_strengths: Vec<f64>,
    pub(crate) mismatches: Vec<Mismatch>,
    pub(crate) path_slopes_per_k: Vec<f64>,
    pub(crate) asymmetries: Vec<f64>,
    pub(crate) surplus: Vec<Surplus>,
    pub(crate) biases: Vec<Bias>,
    /// What the coil is made of, where its stress is to be worked out.
    pub(crate) materials: Option<Arc<Materials>>,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct SpoolMass {
    pub(crate) heat_capacity_j_per_m2_k: f64,
    pub(crate) contact_w_per_m2_k: f64,
    pub(crate) mount_w_per_m2_k: f64,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct BoreHeat {
    pub(crate) power_w_per_m2: f64,
    pub(crate) time_constant_s: f64,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct HeatedFlange {
    pub(crate) is_first: bool,
    pub(crate) film_w_per_m2_k: f64,
}

/// A flange of the spool, of one temperature; all per area of the pack's face.
#[derive(Debug, Clone, Copy)]
pub(super) struct SpoolFlange {
    pub(crate) is_first: bool,
    pub(crate) heat_capacity_j_per_m2_k: f64,
    pub(crate) contact_w_per_m2_k: f64,
    pub(crate) film_w_per_m2_k: f64,
}

/// Where the drive is: outside, or a part of the spool whose temperature a profile then is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sensor {
    Outside,
    Spool,
    Flange { is_first: bool },
}

/// κ_B − κ_A = m κ, everywhere or below a transition.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mismatch {
    pub(crate) relative: f64,
    /// Middle \[K\] and width \[K\].
    pub(crate) below: Option<(f64, f64)>,
}

/// Fibre 2δ beyond end A (δ > 0) or end B.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surplus {
    pub(crate) offset_m: f64,
    pub(crate) follows_ambient: bool,
}

/// What adds to the rate without being the coil's.
#[derive(Debug, Clone)]
pub(super) enum Bias {
    Temperature { linear_rad_per_s_k: f64, quadratic_rad_per_s_k2: f64 },
    MeanRate { gain_rad_per_k: f64 },
    GradientRate { gain_rad_per_k: f64 },
    Formula { formula: Formula, values: Vec<f64> },
}

impl Physics {
    /// # Errors
    /// The name of an effect that is not known here.
    #[expect(
        clippy::too_many_lines,
        reason = "an arm for each effect: a second reading of the catalogue that calls nothing of the first"
    )]
    pub(crate) fn read(model: &CoilModel) -> Result<Self, &'static str> {
        let (conductivity, heat_capacity) = match model.material {
            PackMaterial::Conductivity { w_per_m_k, heat_capacity_j_per_m3_k } => (w_per_m_k, heat_capacity_j_per_m3_k),
            // Nothing but the ratio can matter then.
            PackMaterial::Diffusivity { m2_per_s } => (m2_per_s, 1.0),
        };
        let mut p = Self {
            is_pack: model.extent == Extent::Pack,
            conductivity_w_per_m_k: conductivity,
            heat_capacity_j_per_m3_k: heat_capacity,
            driven_from_outside: model.location != Location::OuterLayer,
            film_w_per_m2_k: None,
            spool: None,
            bore_heat: None,
            flanges: Vec::new(),
            gaps: Vec::new(),
            layer_changes: Vec::new(),
            housings: Vec::new(),
            ramp_before: None,
            spool_wall: None,
            spool_flanges: Vec::new(),
            sensor: match model.location {
                Location::Spool => Sensor::Spool,
                Location::Flange(flange) => Sensor::Flange { is_first: flange == Flange::First },
                Location::OuterLayer | Location::Ambient | Location::Housing(_) => Sensor::Outside,
            },
            above_k: None,
            is_beyond: false,
            conductivity_slope_per_k: 0.0,
            missing_turns: 0.0,
            path_factor: 1.0,
            stress_strengths: Vec::new(),
            mismatches: Vec::new(),
            path_slopes_per_k: Vec::new(),
            asymmetries: Vec::new(),
            surplus: Vec::new(),
            biases: Vec::new(),
            materials: None,
        };
        let mut housings = Vec::new();
        for effect in &model.effects {
            let (values, choices) = (effect.values(), effect.choices());
            match (effect.subject(), effect.spec().kind, values) {
                // A profile has no further columns: nothing is added.
                (Subject::Channel(_), ..) => {}
                (Subject::Formula(formula), ..) => {
                    p.biases.push(Bias::Formula { formula: formula.clone(), values: values.to_vec() });
                }
                (Subject::Materials(materials), ..) => p.materials = Some(materials.clone()),
                (_, "finite_pack", _) => p.is_pack = true,
                (_, "spool_mass", &[capacity, contact, mount]) => {
                    p.spool = Some(SpoolMass {
                        heat_capacity_j_per_m2_k: capacity,
                        contact_w_per_m2_k: contact,
                        mount_w_per_m2_k: mount,
                    });
                }
                (_, "surface_film", &[film]) => {
                    p.driven_from_outside = true;
                    p.film_w_per_m2_k = Some(film);
                }
                // A profile has no table that turns.
                (_, "scale_factor_error" | "scale_factor_temperature" | "scale_factor_asymmetry", _) => {}
                // Between the coil and what a record shows; a profile is the coil's own.
                (_, "sensor_lag", _) => {}
                (_, "self_heating", &[power_w_per_m2, time_constant_s]) => {
                    p.bore_heat = Some(BoreHeat { power_w_per_m2, time_constant_s });
                }
                (_, "axial_gradient", &[film_w_per_m2_k]) => {
                    p.flanges.push(HeatedFlange { is_first: choices == [0], film_w_per_m2_k });
                }
                (_, "unsteady_start", &[pack_k, spool_k, housing_k, rate_k_per_s, lasted_s]) => {
                    p.ramp_before = (rate_k_per_s != 0.0).then_some([rate_k_per_s, lasted_s]);
                    let above_k = [pack_k, spool_k, housing_k];
                    p.above_k = (above_k != [0.0; 3]).then_some(above_k);
                }
                (_, "spool_conduction", &[conductivity, wall_m]) => p.spool_wall = Some([conductivity, wall_m]),
                (_, "spool_flange", &[capacity, contact, film]) => {
                    let is_first = choices == [0];
                    // Declared again, it is that flange.
                    p.spool_flanges.retain(|known| known.is_first != is_first);
                    p.spool_flanges.push(SpoolFlange {
                        is_first,
                        heat_capacity_j_per_m2_k: capacity,
                        contact_w_per_m2_k: contact,
                        film_w_per_m2_k: film,
                    });
                }
                (_, "housing", &[capacity, gap_m, gas, emissivity, middle_k, spacers]) => {
                    p.driven_from_outside = true;
                    // σ from the constants that define it: 2 π⁵ k⁴/(15 h³ c²).
                    let (k, h, c): (f64, f64, f64) = (1.380_649e-23, 6.626_070_15e-34, 299_792_458.0);
                    let sigma = 2.0 * PI.powi(5) * k.powi(4) / (15.0 * h.powi(3) * c * c);
                    let inwards = gas / gap_m + spacers + 4.0 * emissivity * sigma * middle_k.powi(3);
                    housings.push((choices.first().copied().unwrap_or(0), [capacity, inwards]));
                }
                (_, "conductivity_temperature", &[slope]) => p.conductivity_slope_per_k = slope,
                (_, "layer_gap", &[above, conductance]) => p.gaps.push((above as usize, conductance)),
                (_, "layer_gain", &[layer, change]) => p.layer_changes.push((layer as usize, change)),
                (_, "stress_gradient", &[strength]) => p.stress_strengths.push(strength),
                (_, "strain_mismatch", &[relative]) => p.mismatches.push(Mismatch { relative, below: None }),
                (_, "glass_transition", &[relative, middle_k, width_k]) => {
                    p.mismatches.push(Mismatch { relative, below: Some((middle_k, width_k)) });
                }
                (_, "thermo_optic_temperature", &[slope]) => p.path_slopes_per_k.push(slope),
                (_, "midpoint_offset", &[offset_m]) => {
                    p.surplus.push(Surplus { offset_m, follows_ambient: choices == [0] });
                }
                (_, "turn_mismatch", &[turns]) => p.missing_turns += turns,
                (_, "heating_cooling_asymmetry", &[gain]) => p.asymmetries.push(gain),
                (_, "bias_temperature", &[linear_rad_per_s_k, quadratic_rad_per_s_k2]) => {
                    p.biases.push(Bias::Temperature { linear_rad_per_s_k, quadratic_rad_per_s_k2 });
                }
                (_, "bias_temperature_rate", &[gain_rad_per_k]) => p.biases.push(Bias::MeanRate { gain_rad_per_k }),
                (_, "bias_gradient_rate", &[gain_rad_per_k]) => p.biases.push(Bias::GradientRate { gain_rad_per_k }),
                (_, "diffusivity", &[factor]) => p.conductivity_w_per_m_k *= factor,
                (_, "thermo_optic", &[factor]) => p.path_factor *= factor,
                (_, kind, _) => return Err(kind),
            }
        }
        housings.sort_by_key(|(place, _)| *place);
        if let Location::Housing(place) = model.location {
            // Where the drive is a housing, what lies outside it is cut off.
            housings.retain(|(known, _)| *known <= place);
            p.film_w_per_m2_k = None;
        }
        p.housings = housings.into_iter().map(|(_, housing)| housing).collect();
        if p.film_w_per_m2_k.is_none() {
            // The outermost then has the drive's temperature: only its gap is left.
            p.film_w_per_m2_k = p.housings.pop().map(|[_, inwards]| inwards);
        }
        // What is stepped begins at rest, and knows no housing.
        let is_at_rest_alone = p.housings.is_empty() && p.ramp_before.is_none() && p.sensor == Sensor::Outside;
        p.is_beyond |= p.conductivity_slope_per_k != 0.0 && !is_at_rest_alone;
        // A pack that is warmer than a surface whose temperature is given has no finite rate at first.
        let is_given = p.film_w_per_m2_k.is_none() && p.housings.is_empty();
        p.is_beyond |= is_given && p.above_k.is_some_and(|[pack_k, ..]| pack_k != 0.0);
        Ok(p)
    }

    /// Whether a rate error depends on temperatures themselves, not only on their rates.
    pub(crate) fn depends_on_temperature(&self) -> bool {
        let of_bias = |b: &Bias| matches!(b, Bias::Temperature { .. } | Bias::Formula { .. });
        !self.path_slopes_per_k.is_empty()
            || self.materials.as_ref().is_some_and(|m| !m.is_constant())
            || self.mismatches.iter().any(|m| m.below.is_some())
            || self.biases.iter().any(of_bias)
    }

    pub(crate) fn diffusivity_m2_per_s(&self) -> f64 {
        self.conductivity_w_per_m_k / self.heat_capacity_j_per_m3_k
    }
}

/// The turns that are wound: the declared ones, every second layer less those that nesting takes.
pub(super) fn wound_turns(model: &CoilModel) -> Vec<f64> {
    let missing: f64 = model.effects.iter().filter(|e| e.spec().kind == "turn_mismatch").flat_map(|e| e.values()).sum();
    let declared = model.coil.turns().iter().enumerate();
    declared.map(|(j, turns)| if j % 2 == 1 { turns - missing } else { *turns }).collect()
}
