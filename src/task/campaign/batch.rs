//! What the gyros of a fleet have in common, and what is single: numbers of data sheets, or effects of diagnoses.
//!
//! Parameters over gyros by the random-effects mean of DerSimonian and Laird, Controlled Clinical Trials 7, 177 (1986):
//!
//! ```text
//! w_i = 1/s_i²,   Q = Σ w_i (x_i − x̄)²,   τ² = max(0, (Q − (n − 1)) / (Σw − Σw²/Σw)),   mean = Σ x_i/(s_i² + τ²) / Σ 1/(s_i² + τ²)
//! ```

use crate::io::json::campaign::GyroJson;
use crate::io::json::diagnosis::{DiagnosisJson, FindingJson};
use crate::io::json::fleet::{FleetEffectJson, FleetJson, FleetParameterJson, GyroValueJson, VerdictJson, four_digits};

use super::measures::{self, FEWEST, apart};

/// Everything about a fleet whose cells are all done.
pub(super) fn of(kind: &str, gyros: &[GyroJson]) -> FleetJson {
    let with_result = gyros.iter().filter(|gyro| gyro.failure.is_none()).count();
    let mut fleet = FleetJson { kind: kind.to_owned(), gyros: with_result, ..FleetJson::default() };
    fleet.measures = measures::of(gyros);
    fleet.thermal_curve = measures::thermal_curve(gyros);
    let diagnoses: Vec<(&str, &DiagnosisJson)> =
        gyros.iter().filter_map(|gyro| Some((gyro.gyro.as_str(), gyro.diagnosis.as_ref()?))).collect();
    fleet.verdicts = diagnoses.iter().map(|(gyro, diagnosis)| verdict(gyro, diagnosis)).collect();
    fleet.effects = effects(&diagnoses.iter().map(|(gyro, d)| (*gyro, d.effects.as_slice())).collect::<Vec<_>>());
    fleet.sentences = sentences(&fleet);
    fleet
}

fn verdict(gyro: &str, diagnosis: &DiagnosisJson) -> VerdictJson {
    VerdictJson {
        gyro: gyro.to_owned(),
        verdict: diagnosis.verdict.clone(),
        effects: diagnosis.effects.iter().map(|effect| effect.kind.clone()).collect(),
        noise_floor_deg_per_h: diagnosis.noise_floor_deg_per_h,
    }
}

/// Gyros and what each one's diagnosis found.
type Found<'a> = [(&'a str, &'a [FindingJson])];

fn effects(diagnoses: &Found) -> Vec<FleetEffectJson> {
    let mut kinds: Vec<&str> = diagnoses.iter().flat_map(|(_, found)| *found).map(|e| e.kind.as_str()).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let mut found: Vec<FleetEffectJson> = kinds.into_iter().map(|kind| effect(kind, diagnoses)).collect();
    let had_by = |effect: &FleetEffectJson| (effect.found_in.len() + effect.equivalent_in.len(), effect.found_in.len());
    found.sort_by_key(|effect| std::cmp::Reverse(had_by(effect)));
    found
}

fn effect(kind: &str, diagnoses: &Found) -> FleetEffectJson {
    let mut own: Vec<(&str, &FindingJson)> = Vec::new();
    let mut equivalent_in = Vec::new();
    for (gyro, found) in diagnoses {
        match found.iter().find(|effect| effect.kind == kind) {
            Some(finding) => own.push((gyro, finding)),
            None if found.iter().any(|e| e.equivalents.iter().any(|other| other == kind)) => {
                equivalent_in.push((*gyro).to_owned());
            }
            None => {}
        }
    }
    FleetEffectJson {
        kind: kind.to_owned(),
        found_in: own.iter().map(|(gyro, _)| (*gyro).to_owned()).collect(),
        common: diagnoses.len() > 1 && 2 * (own.len() + equivalent_in.len()) >= diagnoses.len(),
        equivalent_in,
        parameters: parameters(&own),
    }
}

fn parameters(own: &[(&str, &FindingJson)]) -> Vec<FleetParameterJson> {
    let mut keys: Vec<&str> = own
        .iter()
        .flat_map(|(_, finding)| finding.parameters.iter().filter(|(_, p)| p.fitted))
        .map(|(key, _)| key.as_str())
        .collect();
    keys.sort_unstable();
    keys.dedup();
    keys.into_iter().filter_map(|key| parameter(key, own)).collect()
}

fn parameter(key: &str, own: &[(&str, &FindingJson)]) -> Option<FleetParameterJson> {
    let values: Vec<(&str, f64, f64)> = own
        .iter()
        .filter_map(|(gyro, finding)| {
            let found = finding.parameters.get(key)?;
            Some((*gyro, found.value, found.standard_error.filter(|error| *error > 0.0)?))
        })
        .collect();
    let unit = own.iter().find_map(|(_, finding)| Some(finding.parameters.get(key)?.unit.clone()))?;
    let all = Together::of(values.iter().map(|(_, value, error)| (*value, *error)))?;
    let single = |place: usize| {
        let others = values.iter().enumerate().filter(|(i, _)| *i != place).map(|(_, (_, v, e))| (*v, *e));
        let (_, value, error) = values[place];
        values.len() >= FEWEST
            && Together::of(others).is_some_and(|others| {
                let scale = (error.powi(2) + others.spread.powi(2) + others.standard_error.powi(2)).sqrt();
                (value - others.mean).abs() > apart(values.len()) * scale
            })
    };
    Some(FleetParameterJson {
        parameter: key.to_owned(),
        unit,
        mean: all.mean,
        standard_error: all.standard_error,
        spread: all.spread,
        values: (0..values.len())
            .map(|place| GyroValueJson {
                gyro: values[place].0.to_owned(),
                value: values[place].1,
                standard_error: Some(values[place].2),
                single: single(place),
            })
            .collect(),
    })
}

/// The random-effects mean.
struct Together {
    mean: f64,
    standard_error: f64,
    spread: f64,
}

impl Together {
    fn of(values: impl Iterator<Item = (f64, f64)> + Clone) -> Option<Self> {
        let sums = |spread: f64| {
            values.clone().fold((0.0, 0.0, 0.0), |(w, ww, wx): (f64, f64, f64), (value, error)| {
                let weight = 1.0 / (error.powi(2) + spread.powi(2));
                (w + weight, ww + weight * weight, wx + weight * value)
            })
        };
        let count = values.clone().count();
        if count == 0 {
            return None;
        }
        let (w, ww, wx) = sums(0.0);
        let mean = wx / w;
        let q: f64 = values.clone().map(|(value, error)| ((value - mean) / error).powi(2)).sum();
        let room = w - ww / w;
        let spread = if room > 0.0 { ((q - (count - 1) as f64) / room).max(0.0).sqrt() } else { 0.0 };
        let (w, _, wx) = sums(spread);
        Some(Self { mean: wx / w, standard_error: w.sqrt().recip(), spread })
    }
}

/// The batch in words: what is common first, then who stands apart.
fn sentences(fleet: &FleetJson) -> Vec<String> {
    let mut said = Vec::new();
    for effect in fleet.effects.iter().filter(|effect| effect.common) {
        let mut words = format!("common: {} in {} of {} gyros", effect.kind, effect.found_in.len(), fleet.gyros);
        if !effect.equivalent_in.is_empty() {
            words += &format!(", and as an equal explanation in {} more", effect.equivalent_in.len());
        }
        for p in &effect.parameters {
            words += &format!("; {}", p.in_words());
        }
        said.push(words);
    }
    for effect in fleet.effects.iter().filter(|effect| !effect.common) {
        said.push(format!("single: {} in {}", effect.kind, effect.found_in.join(", ")));
    }
    if let Some(curve) = fleet.thermal_curve.as_ref().filter(|curve| curve.common_share >= 0.5) {
        said.push(format!(
            "common: the bias over temperature of the others takes {:.0} % of a gyro's own thermal mean square away",
            100.0 * curve.common_share
        ));
    }
    for measure in &fleet.measures {
        if let Some(share) = measure.common_share.filter(|share| *share >= 0.5) {
            said.push(format!(
                "common: {}: one number for the batch takes {:.0} % of the mean square away",
                measure.key,
                100.0 * share
            ));
        }
        for value in measure.values.iter().filter(|value| value.single) {
            said.push(format!(
                "single: {}: {} = {} {}, where the batch's median is {}",
                value.gyro,
                measure.key,
                four_digits(value.value),
                measure.unit,
                four_digits(measure.median)
            ));
        }
    }
    for effect in &fleet.effects {
        for parameter in &effect.parameters {
            for value in parameter.values.iter().filter(|value| value.single) {
                said.push(format!(
                    "single: {}: {} of {} = {} {}, where the batch has {}",
                    value.gyro,
                    parameter.parameter,
                    effect.kind,
                    four_digits(value.value),
                    parameter.unit,
                    four_digits(parameter.mean)
                ));
            }
        }
    }
    if fleet.gyros < FEWEST {
        said.push(format!("with fewer than {FEWEST} gyros nobody is said to stand apart"));
    }
    said
}

#[cfg(test)]
mod tests {
    use super::*;

    fn finding(kind: &str, equivalents: &[&str], value: f64) -> FindingJson {
        let document = serde_json::json!({
            "kind": kind, "choices": {}, "equivalents": equivalents, "equivalents_in_detail": [], "chi_square_less": 100.0,
            "confirmed_by": 10.0, "experiment": "",
            "parameters": { "size": { "value": value, "standard_error": 0.1, "unit": "K", "fitted": true, "at_bound": false } },
        });
        serde_json::from_value(document).expect("a finding")
    }

    #[test]
    fn an_effect_of_half_of_the_gyros_is_common_and_one_of_fewer_is_not() {
        let film = |value: f64| vec![finding("film", &["lag", "gap"], value)];
        let gap = vec![finding("gap", &["film"], 1.0)];
        let (a, b) = (film(1.0), film(1.2));
        let of = |batch: &Found| -> Vec<(String, bool, Vec<String>, Vec<String>)> {
            effects(batch).into_iter().map(|e| (e.kind, e.common, e.found_in, e.equivalent_in)).collect()
        };
        let names = |names: &[&str]| names.iter().map(|n| (*n).to_owned()).collect::<Vec<_>>();
        let row = |kind: &str, common: bool, found: &[&str], equivalent: &[&str]| {
            (kind.to_owned(), common, names(found), names(equivalent))
        };
        // Two of four have it: half is enough. One of four is not, even where it is all that this gyro has.
        let half = of(&[("1", &a), ("2", &b), ("3", &[]), ("4", &[])]);
        assert_eq!(half, [row("film", true, &["1", "2"], &[])]);
        assert_eq!(of(&[("1", &a), ("2", &[]), ("3", &[])]), [row("film", false, &["1"], &[])]);
        // An equal explanation counts as having it, for both kinds; what was found itself in more gyros stands first.
        let mixed = of(&[("1", &a), ("2", &gap), ("3", &b), ("4", &[]), ("5", &[]), ("6", &[])]);
        assert_eq!(mixed, [row("film", true, &["1", "3"], &["2"]), row("gap", true, &["2"], &["1", "3"])]);
        // A kind that is only ever an equivalent is no row: nothing was found of it. One gyro has nothing in common with itself.
        assert!(mixed.iter().all(|(kind, ..)| kind != "lag"));
        assert_eq!(of(&[("1", &a)]), [row("film", false, &["1"], &[])]);
        // Parameters are those of the gyros in which it was found, not of equal explanations.
        let parameters = &effects(&[("1", &a), ("2", &gap), ("3", &b)])[0].parameters;
        assert_eq!((parameters.len(), parameters[0].values.len()), (1, 2));
        assert!((parameters[0].mean - 1.1).abs() < 1e-12);
    }

    #[test]
    fn a_mean_over_gyros_knows_their_errors_and_their_spread() {
        // Equal errors and no spread beyond them: the plain mean, its error σ/√n.
        let same = Together::of([(1.0, 0.5), (1.2, 0.5), (0.8, 0.5), (1.0, 0.5)].into_iter()).unwrap();
        assert!((same.mean - 1.0).abs() < 1e-12 && same.spread == 0.0 && (same.standard_error - 0.25).abs() < 1e-12);
        // Errors that are far too small: the spread is the standard deviation, the mean's error s/√n.
        let apart = Together::of([(1.0, 1e-6), (3.0, 1e-6), (5.0, 1e-6)].into_iter()).unwrap();
        assert!((apart.mean - 3.0).abs() < 1e-6 && (apart.spread - 2.0).abs() < 1e-3);
        assert!((apart.standard_error - 2.0 / 3f64.sqrt()).abs() < 1e-3);
    }
}
