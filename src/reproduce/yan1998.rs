//! Table 2 and Figs. 2 and 3 of Yan, Lan and Jian, computed from the paper's own equations.
//!
//! ```text
//! Ω = n/(L D) κ Σ_j Ṫ_j w_j,   Ṫ_j = k0 { erfc( x_j/√(4Kt) ) − erfc( x_j/√(4K(t−t0)) ) },   x_j = (N−j)·d
//! |Ω| ≤ n κ k0 L/(4D) while all layers warm at most at k0
//! ```
//!
//! Holds for the coil of the paper's section 4 and Table 1. Leaves out the bore: the text calls it adiabatic, but the
//! paper's Eqs. (6)–(12) are those of a half space. Nothing is tuned to the printed table.
//!
//! # Source
//! Yan, Lan, Jian, "Investigation of the Temperature Compensated Method for Fiber Optic Gyros", Acta Optica Sinica
//! (received 1998-04-06). A sign is that of Eq. (4); sizes are compared.

use crate::coil::{Coil, CoilError, CoilSpec, Fibre, LayerLength};
use crate::pattern::classic::Classic;
use crate::profile::{Piece, Profile};
use crate::rate::{CoilModel, RateModel};
use crate::search::cost::worst_case::{SearchError, SolvedProfiles};
use crate::thermal::{DEFAULT_CELLS_PER_LAYER, Drive, Extent, Field, Instant, Location, PackMaterial, solve};
use crate::units::{
    REFERENCE_TEMPERATURE_K, k_per_s_from_c_per_h, m_from_mm, m_from_nm, m_from_um, rad_per_s_from_deg_per_h,
};

pub(crate) const TITLE: &str = "Yan, Lan, Jian, \"Investigation of the Temperature Compensated Method for Fiber Optic Gyros\", \
                         Acta Optica Sinica (received 1998-04-06)";

pub(crate) const LENGTHS_M: [f64; 2] = [200.0, 800.0];
pub(crate) const LAYERS: usize = 12;
/// k0, as the paper states it.
const RAMP_C_PER_H: f64 = 10.0;
/// t0.
pub(crate) const RAMP_S: f64 = 1500.0;
/// As long as the profiles of the examples; the paper does not say where its Fig. 3 ends.
pub(crate) const DURATION_S: f64 = 6000.0;
/// From the middle of Table 1's r, ρ and b; peaks do not depend on it.
const DIFFUSIVITY_M2_PER_S: f64 = 2.7e-7;

/// Table 2 as printed [°/h]: for each length ZYL, SYM, DIP, QUA.
const PUBLISHED_DEG_PER_H: [[f64; 4]; 2] = [[19.380, 14.899, 5.144, 5.136], [40.660, 30.069, 20.575, 20.542]];

/// The windings of Table 2, with SYM as Eq. (14) has it and as the text describes it.
pub(crate) const WINDINGS: [Classic; 5] = [Classic::Zyl, Classic::Sym, Classic::SymText, Classic::Dip, Classic::Qua];

/// The column of Table 2 that a winding is to be compared with.
fn published_column(winding: Classic) -> Option<usize> {
    match winding {
        Classic::Zyl => Some(0),
        Classic::Sym | Classic::SymText => Some(1),
        Classic::Dip => Some(2),
        Classic::Qua => Some(3),
        Classic::Oct | Classic::Hex => None,
    }
}

/// One field of Table 2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Peak {
    pub(crate) length_m: f64,
    pub(crate) winding: Classic,
    pub(crate) published_rad_per_s: f64,
    pub(crate) computed_rad_per_s: f64,
    /// When the computed error is largest; 0 is the right limit at the ramp's start.
    pub(crate) computed_at_s: f64,
    pub(crate) hard_bound_rad_per_s: f64,
}

impl Peak {
    pub(crate) fn is_possible(&self) -> bool {
        self.published_rad_per_s <= self.hard_bound_rad_per_s
    }
}

/// Everything that the paper prints and the equations give.
#[derive(Debug)]
pub struct PaperReproduction {
    /// Length by length, in the order of [`WINDINGS`].
    pub(crate) peaks: Vec<Peak>,
    pub(crate) discrepancies: Vec<Discrepancy>,
    /// Fig. 2: Ṫ in every layer; it does not depend on the length.
    pub(crate) layer_rates: LayerRates,
    /// Fig. 3 (a) and (b).
    pub(crate) errors: Vec<ErrorOverTime>,
}

/// Temperature rate by depth at a number of times.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LayerRates {
    /// Of every layer, the outermost first, as the paper counts them.
    pub(crate) depths_m: Vec<f64>,
    pub(crate) times_s: Vec<f64>,
    /// One row a time, in the order of `depths_m`.
    pub(crate) rates_k_per_s: Vec<Vec<f64>>,
}

/// The rate error of the windings of one coil.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ErrorOverTime {
    pub(crate) length_m: f64,
    /// Both sides of the ramp's end are in, so that the jump there is seen.
    pub(crate) times_s: Vec<f64>,
    /// One series a winding, in the order of [`WINDINGS`].
    pub(crate) rates_rad_per_s: Vec<Vec<f64>>,
}

/// What the printed table and the paper's equations disagree (or agree) about.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Discrepancy {
    /// A printed value that no coil of this size can have.
    BeyondHardBound { winding: Classic, length_m: f64, published_rad_per_s: f64, bound_rad_per_s: f64 },
    /// The printed ratio of the two lengths, where the equations give exactly that of the lengths.
    NotProportionalToLength { winding: Classic, published_ratio: f64, computed_ratio: f64 },
    /// The printed ratio of the lengths is the equations'.
    ProportionalToLength { winding: Classic, published_ratio: f64, computed_ratio: f64 },
    /// DIP and QUA are nearly equal in the table and in the model.
    DipNearQua { length_m: f64, published_ratio: f64, computed_ratio: f64 },
    /// Which of the two symmetric windings the printed SYM/ZYL fits: at the peaks and at the ramp's end.
    SymmetricOverCylindrical { length_m: f64, published_ratio: f64, at_peak: SymRatio, at_ramps_end: SymRatio },
    /// DIP and QUA are printed larger than the equations give, by one factor.
    LargerByOneFactor { winding: Classic, length_m: f64, factor: f64 },
}

/// The computed SYM/ZYL for the two windings that the paper calls SYM.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SymRatio {
    pub(crate) eq14: f64,
    pub(crate) text: f64,
}

/// An equation that cannot stand as printed, and what the program computes instead.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Erratum {
    pub(crate) place: &'static str,
    pub(crate) printed: &'static str,
    pub(crate) used: &'static str,
}

/// Found by working the paper's equations through.
pub(crate) const ERRATA: &[Erratum] = &[
    Erratum {
        place: "Eqs. (4), (13)–(16)",
        printed: "ΔT, a temperature",
        used: "its time derivative: the dot over T is lost, as the step from (3) to (4) shows",
    },
    Erratum {
        place: "Eq. (7)",
        printed: "a factor 1/√(πt)",
        used: "1/(t√π), without which (6) has no unit of temperature and (9) does not follow",
    },
    Erratum {
        place: "Eq. (9)",
        printed: "a minus sign under the root",
        used: "no minus: the root is that of x²/(4Kt), a positive number",
    },
    Erratum {
        place: "Eq. (12), third line",
        printed: "k3 with t, and t − t1 − t2",
        used: "k3 with t − t2, and t − t2: each ramp counts from its own start",
    },
    Erratum {
        place: "Eq. (13), second line",
        printed: "no coefficient before the sum",
        used: "the coefficient of the first line",
    },
    Erratum {
        place: "Eq. (16), second line",
        printed: "no alternating sign",
        used: "(−1)^(m+1), as in the first line; without it QUA would be DIP",
    },
    Erratum {
        place: "Eq. (14) and the text on SYM",
        printed: "two different windings",
        used: "both: sym is Eq. (14), sym-text winds the second half in order as the text says",
    },
    Erratum {
        place: "Table 1, K",
        printed: "1e-7 … 1e-9 m²/s",
        used: "2.7e-7 m²/s: the table's own r, ρ and b give 2.2e-7 … 3.4e-7; peaks do not depend on K",
    },
    Erratum {
        place: "section 3",
        printed: "an adiabatic inner surface",
        used: "the half space of Eqs. (6)–(12), which has no inner surface; the effect finite_pack adds one",
    },
];

/// The paper's coil of one of its [`LENGTHS_M`].
///
/// # Errors
/// A length that is not positive.
pub(crate) fn model(length_m: f64) -> Result<CoilModel, CoilError> {
    model_of_layers(length_m, LAYERS)
}

/// The paper's coil with another layer count on the same mean diameter.
///
/// # Errors
/// A length that is not positive, an odd layer count, more layers than the diameter has room for.
pub fn model_of_layers(length_m: f64, layers: usize) -> Result<CoilModel, CoilError> {
    let diameter_m = m_from_um(250.0);
    let fibre = Fibre {
        refractive_index: 1.447,
        thermo_optic_per_k: 1.35e-5,
        group_index: None,
        thermal_expansion_per_k: 0.0,
        wavelength_m: m_from_nm(1300.0),
        outer_diameter_m: diameter_m,
    };
    let coil = Coil::new(CoilSpec {
        fibre,
        layers,
        turns_per_layer: None,
        bore_radius_m: 0.5 * m_from_mm(75.0) - 0.5 * layers as f64 * diameter_m,
        radial_pitch_m: diameter_m,
        axial_pitch_m: diameter_m,
        layer_length: LayerLength::Equal,
        length_m: Some(length_m),
    })?;
    Ok(CoilModel {
        name: format!("paper {length_m} m, {layers} layers"),
        coil,
        extent: Extent::HalfSpace,
        material: PackMaterial::Diffusivity { m2_per_s: DIFFUSIVITY_M2_PER_S },
        location: Location::OuterLayer,
        rate_mean_s: 0.0,
        cells_per_layer: DEFAULT_CELLS_PER_LAYER,
        effects: vec![],
    })
}

/// 10 °C/h for 1500 s, then a soak (Eq. 8).
pub fn profile() -> Profile {
    let ramp = Piece { rate_k_per_s: k_per_s_from_c_per_h(RAMP_C_PER_H), duration_s: RAMP_S };
    let soak = Piece { rate_k_per_s: 0.0, duration_s: DURATION_S - RAMP_S };
    Profile::new("paper", vec![ramp, soak]).expect("both durations are positive")
}

/// Computes all of it.
///
/// # Errors
/// None in practice: the coil is a constant.
pub fn reproduce() -> Result<PaperReproduction, SearchError> {
    let (mut peaks, mut errors) = (Vec::new(), Vec::new());
    for (row, length_m) in LENGTHS_M.into_iter().enumerate() {
        let model = model(length_m)?;
        let solved = SolvedProfiles::new(&model, &[profile()])?;
        let mut error = ErrorOverTime { length_m, times_s: Vec::new(), rates_rad_per_s: Vec::new() };
        let instants = figure_instants();
        error.times_s = instants.iter().map(|i| i.time_s).collect();
        let history = solved.profiles()[0].field.at(&instants);
        for winding in WINDINGS {
            let pattern = winding.pattern(LAYERS).expect("twelve layers fit every winding of the paper");
            let rate_model = RateModel::new(&model, &pattern, &[])?;
            let worst = solved.worst_case(&model, &pattern)?;
            let column = published_column(winding).expect("the paper's windings have a column");
            peaks.push(Peak {
                length_m,
                winding,
                published_rad_per_s: rad_per_s_from_deg_per_h(PUBLISHED_DEG_PER_H[row][column]),
                computed_rad_per_s: worst.rate_rad_per_s.abs(),
                computed_at_s: worst.time_s,
                hard_bound_rad_per_s: rate_model.hard_bound_rad_per_s(k_per_s_from_c_per_h(RAMP_C_PER_H)),
            });
            error.rates_rad_per_s.push(rate_model.series_rad_per_s(&history));
        }
        errors.push(error);
    }
    let discrepancies = discrepancies(&peaks, &errors);
    Ok(PaperReproduction { peaks, discrepancies, layer_rates: layer_rates()?, errors })
}

/// Fine where the error changes fast: behind the ramp's start and its end.
fn figure_instants() -> Vec<Instant> {
    let onset_s = [0.0, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0];
    let coarse_s = |from: f64, to: f64| (1..).map(move |i| from + 60.0 * f64::from(i)).take_while(move |t| *t < to);
    let mut instants: Vec<Instant> = onset_s.iter().map(|&t| Instant::after(t)).collect();
    instants.extend(coarse_s(0.0, RAMP_S).map(Instant::after));
    instants.push(Instant::before(RAMP_S));
    instants.extend(onset_s.iter().map(|&t| Instant::after(RAMP_S + t)));
    instants.extend(coarse_s(RAMP_S, DURATION_S).map(Instant::after));
    instants.push(Instant::after(DURATION_S));
    instants
}

fn layer_rates() -> Result<LayerRates, SearchError> {
    let model = model(LENGTHS_M[0])?;
    let field: Field = solve(&model.heat_path()?, &Drive::boundary(profile().temperature(REFERENCE_TEMPERATURE_K)))?;
    let times_s = vec![1.0, 5.0, 20.0, 60.0, 300.0, RAMP_S - 1.0, RAMP_S + 5.0, RAMP_S + 60.0, RAMP_S + 600.0];
    let history = field.at(&times_s.iter().map(|&t| Instant::after(t)).collect::<Vec<_>>());
    let outermost_first = |row: usize| history.rates_k_per_s(row).iter().rev().copied().collect();
    Ok(LayerRates {
        depths_m: (0..LAYERS).map(|m| m as f64 * model.coil.radial_pitch_m()).collect(),
        rates_k_per_s: (0..times_s.len()).map(outermost_first).collect(),
        times_s,
    })
}

fn discrepancies(peaks: &[Peak], errors: &[ErrorOverTime]) -> Vec<Discrepancy> {
    let of = |winding: Classic, length_m: f64| {
        peaks
            .iter()
            .find(|p| p.winding == winding && p.length_m == length_m)
            .expect("there is a peak for every winding and length")
    };
    let [short_m, long_m] = LENGTHS_M;
    let in_table = [Classic::Zyl, Classic::Sym, Classic::Dip, Classic::Qua];
    let mut found = Vec::new();
    for length_m in LENGTHS_M {
        for peak in in_table.map(|w| of(w, length_m)).into_iter().filter(|p| !p.is_possible()) {
            found.push(Discrepancy::BeyondHardBound {
                winding: peak.winding,
                length_m,
                published_rad_per_s: peak.published_rad_per_s,
                bound_rad_per_s: peak.hard_bound_rad_per_s,
            });
        }
    }
    for winding in in_table {
        let (short, long) = (of(winding, short_m), of(winding, long_m));
        let published_ratio = long.published_rad_per_s / short.published_rad_per_s;
        let computed_ratio = long.computed_rad_per_s / short.computed_rad_per_s;
        // The table prints four or five digits.
        found.push(if (published_ratio / computed_ratio - 1.0).abs() < 1e-3 {
            Discrepancy::ProportionalToLength { winding, published_ratio, computed_ratio }
        } else {
            Discrepancy::NotProportionalToLength { winding, published_ratio, computed_ratio }
        });
    }
    for error in errors {
        let length_m = error.length_m;
        let [zyl, eq14, text, dip, qua] = WINDINGS.map(|w| of(w, length_m));
        let ramps_end = error.times_s.iter().position(|t| *t == RAMP_S).expect("the ramp's end is in the figure");
        let [late_zyl, late_eq14, late_text] = [0, 1, 2].map(|w: usize| error.rates_rad_per_s[w][ramps_end].abs());
        found.push(Discrepancy::SymmetricOverCylindrical {
            length_m,
            published_ratio: eq14.published_rad_per_s / zyl.published_rad_per_s,
            at_peak: SymRatio {
                eq14: eq14.computed_rad_per_s / zyl.computed_rad_per_s,
                text: text.computed_rad_per_s / zyl.computed_rad_per_s,
            },
            at_ramps_end: SymRatio { eq14: late_eq14 / late_zyl, text: late_text / late_zyl },
        });
        found.push(Discrepancy::DipNearQua {
            length_m,
            published_ratio: dip.published_rad_per_s / qua.published_rad_per_s,
            computed_ratio: dip.computed_rad_per_s / qua.computed_rad_per_s,
        });
        for peak in [dip, qua] {
            let factor = peak.published_rad_per_s / peak.computed_rad_per_s;
            found.push(Discrepancy::LargerByOneFactor { winding: peak.winding, length_m, factor });
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_printed_zyl_and_sym_are_impossible_and_dip_and_qua_scale_as_the_model_does() {
        let found = reproduce().unwrap().discrepancies;
        let beyond: Vec<(Classic, f64)> = found
            .iter()
            .filter_map(|d| match d {
                Discrepancy::BeyondHardBound { winding, length_m, .. } => Some((*winding, *length_m)),
                _ => None,
            })
            .collect();
        use Classic::{Dip, Qua, Sym, Zyl};
        assert_eq!(beyond, [(Zyl, 200.0), (Sym, 200.0), (Zyl, 800.0), (Sym, 800.0)]);
        let not_proportional: Vec<(Classic, f64)> = found
            .iter()
            .filter_map(|d| match d {
                Discrepancy::NotProportionalToLength { winding, published_ratio, .. } => {
                    Some((*winding, (published_ratio * 1000.0).round()))
                }
                _ => None,
            })
            .collect();
        assert_eq!(not_proportional, [(Zyl, 2098.0), (Sym, 2018.0)]);
        for winding in [Dip, Qua] {
            assert!(
                found.iter().any(|d| matches!(d, Discrepancy::ProportionalToLength { winding: w, published_ratio, .. }
                if *w == winding && (published_ratio - 4.0).abs() < 5e-4))
            );
        }
    }

    #[test]
    fn the_printed_ratio_of_sym_to_zyl_fits_the_winding_of_the_text_late_in_the_ramp() {
        let mut compared = 0;
        for discrepancy in reproduce().unwrap().discrepancies {
            let Discrepancy::SymmetricOverCylindrical { published_ratio, at_peak, at_ramps_end, .. } = discrepancy
            else {
                continue;
            };
            compared += 1;
            assert!((at_peak.text - published_ratio).abs() < (at_peak.eq14 - published_ratio).abs());
            // A rate that is linear in depth gives N³/8 over N(N²−1)/6.
            let linear = 0.75 * 144.0 / 143.0;
            assert!((at_ramps_end.text - linear).abs() < 1e-2, "{at_ramps_end:?}");
            assert!((at_ramps_end.text - published_ratio).abs() < 0.02, "{at_ramps_end:?}");
            assert!((at_ramps_end.eq14 - published_ratio).abs() > 0.2, "{at_ramps_end:?}");
        }
        assert_eq!(compared, 2);
    }

    #[test]
    fn both_sides_of_the_ramps_end_are_in_the_figure() {
        let times: Vec<f64> = figure_instants().iter().map(|i| i.time_s).collect();
        assert!(times.windows(2).all(|w| w[1] >= w[0]));
        assert_eq!(times.iter().filter(|t| **t == RAMP_S).count(), 2);
    }
}
