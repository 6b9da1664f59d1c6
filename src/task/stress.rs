//! What a coil's materials do: strains and optical path layer by layer, and which potting and spool suit its winding.

use crate::io::json::stress::{
    FreeFibreJson, LayerStressJson, PatternStressJson, PottingChoiceJson, PottingJson, StressAtJson, StressJson,
};
use crate::io::model::{ModelFile, NamedPattern};
use crate::numeric::order::sort_ascending;
use crate::parallel::InParallel;
use crate::pattern::Pattern;
use crate::rate::{CoilModel, LayerWeights, RateError};
use crate::search::cost::guaranteed::UnitStep;
use crate::search::cost::worst_case::SolvedProfiles;
use crate::stress::library::{MATERIALS, Use};
use crate::stress::material::Material;
use crate::stress::{BondedSpool, Materials, PackStress};
use crate::units::{REFERENCE_TEMPERATURE_K, celsius_from_kelvin, deg_per_h_from_rad_per_s};

use super::{Observer, TaskError, advise, own_and_classics};

/// What is asked of the stress of a coil.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Request<'a> {
    pub model: &'a ModelFile,
    /// Empty for the model's own and all classics that fit.
    pub patterns: &'a [NamedPattern],
    pub(crate) temperatures_k: &'a [f64],
}

/// Works the strains out.
///
/// # Errors
/// A model without materials, patterns of another layer count.
pub(crate) fn run(request: &Request, observer: &dyn Observer) -> Result<StressJson, TaskError> {
    let file = request.model;
    advise(file, observer);
    let materials = materials_of(file)?;
    let patterns = if request.patterns.is_empty() { own_and_classics(file) } else { request.patterns.to_vec() };
    let coil = file.model.wound_coil().map_err(RateError::from)?;
    let stress = PackStress::new(materials, &coil);
    let mut temperatures = Vec::with_capacity(request.temperatures_k.len());
    for &temperature_k in request.temperatures_k {
        let layers = stress.per_kelvin(temperature_k);
        let paths: Vec<f64> = layers.iter().map(|layer| layer.path).collect();
        let free = materials.fibre.free_fibre(coil.fibre(), temperature_k);
        let of_patterns = patterns.iter().map(|named| {
            let steady = Steady::new(&file.model, &named.pattern, &paths)?;
            Ok(PatternStressJson {
                name: named.name.clone(),
                equivalent_mismatch: steady.mismatch,
                steady_ramp_deg_per_h: deg_per_h_from_rad_per_s(steady.rate_per_k * file.profiles.max_rate_k_per_s),
            })
        });
        temperatures.push(StressAtJson {
            temperature_c: celsius_from_kelvin(temperature_k),
            free_fibre: FreeFibreJson { expansion_per_k: free.expansion_per_k, path_per_k: free.path_per_k },
            path_per_k: stress.mean_path_per_k(&coil, temperature_k),
            stress_gradient_strength: gradient_strength(&file.model, &paths),
            layers: layers
                .iter()
                .enumerate()
                .map(|(index, layer)| LayerStressJson {
                    layer: index + 1,
                    hoop_strain_per_k: layer.strain.hoop,
                    radial_strain_per_k: layer.strain.radial,
                    axial_strain_per_k: layer.strain.axial,
                    glass_transverse_strain_per_k: layer.glass_transverse,
                    path_per_k: layer.path,
                })
                .collect(),
            patterns: of_patterns.collect::<Result<_, RateError>>()?,
        });
    }
    Ok(StressJson { model: file.model.name.clone(), is_linear: materials.is_constant(), temperatures })
}

fn materials_of(file: &ModelFile) -> Result<&Materials, TaskError> {
    file.model.materials().ok_or_else(|| TaskError::NoMaterials { path: file.path.display().to_string() })
}

/// What layers of different κ make of one pattern where all of the coil changes at the same rate.
struct Steady {
    /// Ω per K/s.
    rate_per_k: f64,
    /// m of n κ m L Ṫ/(4D).
    mismatch: f64,
}

impl Steady {
    fn new(model: &CoilModel, pattern: &Pattern, paths: &[f64]) -> Result<Self, RateError> {
        let coil = model.wound_coil()?;
        let weights_m2 = LayerWeights::new(&coil, pattern)?.total_m2();
        let sum: f64 = weights_m2.iter().zip(paths).map(|(w, kappa)| w * kappa).sum();
        let (length_m, diameter_m) = (coil.length_m(), coil.sagnac_diameter_m());
        let mean = paths.iter().zip(coil.layer_lengths_m()).map(|(p, l)| p * l).sum::<f64>() / length_m;
        Ok(Self {
            rate_per_k: coil.fibre().transit_index() / (length_m * diameter_m) * sum,
            mismatch: 4.0 * sum / (mean * length_m * length_m),
        })
    }
}

/// Least squares of κ_j/κ − 1 over the profile 1/r² of a thick ring, less its mean, largest 1.
fn gradient_strength(model: &CoilModel, paths: &[f64]) -> Option<f64> {
    let coil = &model.coil;
    let lengths_m = coil.layer_lengths_m();
    let mean = |values: &[f64]| values.iter().zip(lengths_m).map(|(v, l)| v * l).sum::<f64>() / coil.length_m();
    let stress: Vec<f64> = (0..coil.layers()).map(|j| coil.layer_radius_m(j).powi(-2)).collect();
    let (of_stress, of_path) = (mean(&stress), mean(paths));
    let peak = stress.iter().map(|s| (s - of_stress).abs()).fold(0.0, f64::max);
    let (mut over, mut under) = (0.0, 0.0);
    for (s, path) in stress.iter().zip(paths) {
        let shape = (s - of_stress) / peak;
        over += shape * (path / of_path - 1.0);
        under += shape * shape;
    }
    (under > 0.0 && (over / under).is_finite()).then(|| over / under)
}

/// Which pottings and spools are to be compared.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PottingRequest<'a> {
    pub(crate) model: &'a ModelFile,
    /// Empty for the model's own and all classics that fit.
    pub(crate) patterns: &'a [NamedPattern],
    /// Every spool of the library too, as thick as the model's; else the declared one alone.
    pub(crate) with_spools: bool,
}

/// Judges every choice by the worst rate error of its best winding.
///
/// # Errors
/// A model without materials or that cannot be solved, patterns of another layer count.
pub(crate) fn potting(request: &PottingRequest, observer: &dyn Observer) -> Result<PottingJson, TaskError> {
    let file = &request.model.clone().for_search();
    advise(file, observer);
    let declared = materials_of(file)?.clone();
    let patterns = if request.patterns.is_empty() { own_and_classics(file) } else { request.patterns.to_vec() };
    // No material moves heat: one field for all of them.
    let solved = SolvedProfiles::new(&file.model, &file.profiles.profiles())?;
    let mut choices = Vec::new();
    let all = choices_of(file, &declared, request.with_spools);
    for (index, materials) in all.iter().enumerate() {
        observer.at(index as f64 / all.len() as f64, &materials.adhesive.name);
        if !observer.goes_on() {
            break;
        }
        choices.push(judged(file, &declared, materials, &patterns, &solved)?);
    }
    sort_ascending(&mut choices, |item| item.worst_rate_deg_per_h);
    Ok(PottingJson { model: file.model.name.clone(), choices })
}

fn of_use(used_as: Use) -> impl Iterator<Item = Material> {
    MATERIALS.iter().filter(move |entry| entry.used_as == used_as).map(|entry| entry.material())
}

fn choices_of(file: &ModelFile, declared: &Materials, with_spools: bool) -> Vec<Materials> {
    let mut adhesives: Vec<Material> = of_use(Use::Adhesive).chain(file.own_materials.iter().cloned()).collect();
    // What the fibre or the spool is made of is no potting.
    let used = |m: &Material| {
        let coatings = declared.fibre.coatings.iter().map(|(coating, _)| coating);
        let spool = declared.spool.as_ref().map(|spool| &spool.material);
        coatings.chain([&declared.fibre.glass]).chain(spool).any(|other| other.name == m.name)
    };
    adhesives.retain(|m| !used(m) || m.name == declared.adhesive.name);
    if !adhesives.iter().any(|m| m.name == declared.adhesive.name) {
        adhesives.push(declared.adhesive.clone());
    }
    let mut spools = vec![declared.spool.clone()];
    if let (true, Some(spool)) = (with_spools, &declared.spool) {
        let thickness_m = spool.thickness_m;
        let others = of_use(Use::Spool).filter(|m| m.name != spool.material.name);
        spools.extend(others.map(|material| Some(BondedSpool { material, thickness_m })));
    }
    let pairs = spools.iter().flat_map(|spool| adhesives.iter().map(move |adhesive| (spool, adhesive)));
    pairs
        .map(|(spool, adhesive)| Materials { adhesive: adhesive.clone(), spool: spool.clone(), ..declared.clone() })
        .collect()
}

fn judged(
    file: &ModelFile,
    declared: &Materials,
    materials: &Materials,
    patterns: &[NamedPattern],
    solved: &SolvedProfiles,
) -> Result<PottingChoiceJson, TaskError> {
    let model = file.model.with_materials(materials);
    let worst = patterns
        .iter()
        .in_parallel()
        .map(|named| Ok((named, solved.worst_case(&model, &named.pattern)?)))
        .collect::<Result<Vec<_>, TaskError>>()?;
    let best = worst.iter().min_by(|a, b| a.1.rate_rad_per_s.abs().total_cmp(&b.1.rate_rad_per_s.abs()));
    let (named, worst) = best.ok_or(TaskError::PatternMissing)?;
    let bound = match UnitStep::new(&model, file.profiles.max_rate_k_per_s) {
        Ok(step) => Some(step.guaranteed(&model, &named.pattern)?.rate_rad_per_s),
        Err(_) => None,
    };
    let paths: Vec<f64> = PackStress::new(materials, &model.coil)
        .per_kelvin(REFERENCE_TEMPERATURE_K)
        .iter()
        .map(|layer| layer.path)
        .collect();
    Ok(PottingChoiceJson {
        adhesive: materials.adhesive.name.clone(),
        spool: materials.spool.as_ref().map(|spool| spool.material.name.clone()),
        is_declared: materials == declared,
        best_pattern: named.name.clone(),
        worst_rate_deg_per_h: deg_per_h_from_rad_per_s(worst.rate_rad_per_s.abs()),
        worst_profile: worst.profile.clone(),
        guaranteed_worst_rate_deg_per_h: bound.map(deg_per_h_from_rad_per_s),
        path_per_k: model.coil.fibre().path_per_k(),
        equivalent_mismatch: Steady::new(&model, &named.pattern, &paths)?.mismatch,
    })
}
