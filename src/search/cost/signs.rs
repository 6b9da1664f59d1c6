//! The class `standard` as a choice of signs: every layer lies at the low or the high end of what is inside it.
//!
//! Wound from the inside out, layer m joins the interval of segments below it at its low end (ε = −1) or at its high
//! end (ε = +1). Where both halves of the fibre respond alike the error is then linear in the signs, for any layer
//! lengths:
//!
//! ```text
//! v_s = c_s + Σ_m ε_m d_ms,   d_ms = l_m ( Λ_{m−1} A_sm − Σ_{i<m} l_i A_si ),   Λ_m = Σ_{i≤m} l_i
//! ```
//!
//! | symbol | meaning | unit | in code |
//! |---|---|---|---|
//! | ε_m | the end at which layer m lies; the innermost layer has none | 1 | `signs`, true: high |
//! | d_m | column of sign m | rad/s | `sign_columns` |
//! | A_sm | response of a layer's weight | rad/s/m² | `SampleMatrix` |
//!
//! It follows from w_m = l_m (ε_m Λ_{m−1} − Σ_{k>m} ε_k l_k): layer m's own place in its interval, and the shift of that
//! interval by every layer outside it. So 2^(N−1) patterns are the corners of a cube, mirror images are opposite
//! corners, a move is one sign, and the exact search is a closest-pair problem.

use crate::search::cost::columns::Columns;
use crate::search::cost::samples::SampleMatrix;

/// The columns d_m; column k belongs to layer index k + 1.
///
/// `None` where the halves respond differently or something varies along the axis: then the error is not linear in
/// the signs.
pub fn sign_columns(matrix: &SampleMatrix) -> Option<Columns> {
    if !matrix.layout.halves_alike || matrix.layout.axial {
        return None;
    }
    let lengths_m = matrix.lengths_m();
    let mut inside_m = lengths_m[0];
    let mut inside: Vec<f64> = matrix.columns.column(0).iter().map(|a| lengths_m[0] * a).collect();
    let mut columns = Vec::with_capacity(lengths_m.len() - 1);
    for (layer, &length_m) in lengths_m.iter().enumerate().skip(1) {
        let own = matrix.columns.column(layer);
        columns.push(own.iter().zip(&inside).map(|(a, sum)| length_m * (inside_m * a - sum)).collect());
        for (sum, a) in inside.iter_mut().zip(own) {
            *sum += length_m * a;
        }
        inside_m += length_m;
    }
    Some(Columns::new(matrix.columns.constant(), &columns))
}

/// P(j), innermost layer first, of a choice of ends; `high` has one entry a layer but the innermost.
pub fn segments_of_signs(high: &[bool]) -> Vec<usize> {
    let (mut low_end, mut high_end) = (1, high.len() + 1);
    let mut segments = vec![0; high.len() + 1];
    for (layer, &at_high_end) in high.iter().enumerate().rev() {
        if at_high_end {
            segments[layer + 1] = high_end;
            high_end -= 1;
        } else {
            segments[layer + 1] = low_end;
            low_end += 1;
        }
    }
    segments[0] = low_end;
    segments
}

/// The ends that make a pattern, or `None` for a pattern that is not of the class `standard`.
pub(crate) fn signs_of_segments(segments: &[usize]) -> Option<Vec<bool>> {
    let (mut low, mut high) = (segments[0], segments[0]);
    segments[1..]
        .iter()
        .map(|&segment| {
            if segment == high + 1 {
                high = segment;
                Some(true)
            } else if segment + 1 == low {
                low = segment;
                Some(false)
            } else {
                None
            }
        })
        .collect()
}

/// ±1 for true and false.
pub(crate) fn sign_value(high: bool) -> f64 {
    if high { 1.0 } else { -1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coil::LayerLength;
    use crate::pattern::Pattern;
    use crate::pattern::windability::WindabilityClass;
    use crate::search::cost::samples::tests::{model, profiles};
    use crate::search::cost::worst_case::SolvedProfiles;

    #[test]
    fn signs_and_segments_are_two_names_of_every_standard_pattern_and_of_no_other() {
        for bits in 0..1u32 << 7 {
            let high: Vec<bool> = (0..7).map(|m| bits >> m & 1 == 1).collect();
            let segments = segments_of_signs(&high);
            assert!(WindabilityClass::Standard.admits(&Pattern::new(segments.clone()).unwrap()));
            assert_eq!(signs_of_segments(&segments), Some(high));
        }
        assert_eq!(signs_of_segments(&[3, 2, 1, 6, 5, 4]), None);
    }

    #[test]
    fn the_error_of_every_standard_pattern_is_linear_in_its_signs_also_with_actual_lengths() {
        for layer_length in [LayerLength::Equal, LayerLength::Actual] {
            let model = model(8, layer_length, &["stress_gradient", "midpoint_offset", "turn_mismatch"]);
            let solved = SolvedProfiles::new(&model, &profiles()).unwrap();
            let (matrix, _) = SampleMatrix::of_profiles(&model, &solved).unwrap();
            let columns = sign_columns(&matrix).unwrap();
            for bits in 0..1u32 << 7 {
                let high: Vec<bool> = (0..7).map(|m| bits >> m & 1 == 1).collect();
                let coefficients: Vec<f64> = high.iter().map(|&h| sign_value(h)).collect();
                let found = columns.values(&coefficients);
                let pattern = Pattern::new(segments_of_signs(&high)).unwrap();
                let expected = matrix.rates_rad_per_s(&model, &pattern).unwrap();
                let scale = expected.iter().map(|v| v.abs()).fold(1e-9, f64::max);
                for (f, e) in found.iter().zip(&expected) {
                    assert!((f - e).abs() < 1e-11 * scale, "{bits:b}: {f} {e}");
                }
            }
        }
    }
}
