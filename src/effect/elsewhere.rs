//! Words that people take for effects and that a model file states in other places.

/// What is no effect by that name but known all the same: where a model file states it.
const SET_ELSEWHERE: &[(&str, &str)] = &[
    (
        "film",
        "the effect surface_film puts one between air and coil (film_w_per_m2_k); what records showed of it stands under [boundary], which `coilwright extend` writes",
    ),
    ("air", "what records showed of the chamber's air stands under [boundary], which `coilwright extend` writes"),
    (
        "boundary",
        "what records showed of the air stands under [boundary], which `coilwright extend` writes; a film is the effect surface_film",
    ),
    ("sensor", "where it measures is location under [sensor]; how it lags is the effect sensor_lag"),
    ("lag", "the sensor's is the effect sensor_lag"),
    ("spool", "its heat is the effect spool_mass; its diameter follows from [winding]"),
    ("fibre", "its properties stand under [fibre]"),
    ("fiber", "its properties stand under [fibre]"),
    ("conductivity", "it is conductivity_w_per_m_k under [thermal]"),
    (
        "thermal_stress",
        "it follows from what stands under [materials]; `coilwright materials` lists what may stand there",
    ),
    ("materials", "they stand under [materials]; `coilwright materials` lists what may stand there"),
    ("adhesive", "it is adhesive under [materials]; `coilwright potting` compares them"),
    ("potting", "it is adhesive under [materials]; `coilwright potting` compares them"),
    ("ramp", "the steepest is max_rate_c_per_h under [profiles], listed ones are [[profiles.ramp]]"),
    ("profile", "ramps and courses of temperature stand under [profiles]"),
    ("profiles", "ramps and courses of temperature stand under [profiles]"),
    ("tolerance", "how much built coils spread stands under [tolerance]"),
    ("pattern", "it is pattern under [winding]; `coilwright patterns` lists the classic ones"),
    ("winding", "turns, layers and pattern stand under [winding]"),
    ("offset", "the gyro's is fitted to each record; surplus fibre at the middle is the effect midpoint_offset"),
    ("noise", "it is not stated: `coilwright metrics` and `coilwright diagnose` find it in records"),
];

/// Where a model file states what is no effect by that name; none where nothing is known by it.
pub(crate) fn set_elsewhere(word: &str) -> Option<&'static str> {
    SET_ELSEWHERE.iter().find(|(known, _)| *known == word).map(|(_, place)| *place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::CATALOGUE;

    #[test]
    fn a_word_that_is_set_elsewhere_is_no_effect() {
        for (word, place) in SET_ELSEWHERE {
            assert!(!CATALOGUE.iter().any(|spec| spec.kind == *word), "{word}");
            assert!(place.chars().next().is_some_and(char::is_lowercase), "{place}");
        }
        assert!(set_elsewhere("film").is_some_and(|place| place.contains("surface_film")));
        assert_eq!(set_elsewhere("surface_film"), None);
    }
}
