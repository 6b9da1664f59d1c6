//! A set that is hardly better than a smaller one within it is that smaller one.

use std::cmp::Reverse;

/// Gives masses, from the largest set on, each to the best of the sets that may stand for it.
///
/// # Shapes
/// `masses`, `totals` (log posterior) and `sizes` (members): one a set. `stands_for(small, large)`: by their places; asked of smaller sets only.
pub(in crate::diagnose) fn give_to_smaller(
    masses: &mut [f64],
    totals: &[f64],
    sizes: &[usize],
    stands_for: impl Fn(usize, usize) -> bool,
) {
    let mut places: Vec<usize> = (0..masses.len()).collect();
    places.sort_by_key(|&i| Reverse(sizes[i]));
    for &large in &places {
        let within = places.iter().copied().filter(|&small| sizes[small] < sizes[large] && stands_for(small, large));
        if let Some(small) = within.max_by(|&a, &b| totals[a].total_cmp(&totals[b])) {
            masses[small] += std::mem::take(&mut masses[large]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masses_go_down_to_the_best_smaller_set_that_is_as_good_and_none_is_lost() {
        // {}, {a}, {b}, {a, b}: by how much each is worth more than nothing.
        let (totals, sizes) = ([0.0, 5.0, 6.0, 7.0], [0, 1, 1, 2]);
        let as_good = |small: usize, large: usize| totals[small] > totals[large] - 3.0;
        let mut masses = [0.1, 0.2, 0.3, 0.4];
        give_to_smaller(&mut masses, &totals, &sizes, as_good);
        assert_eq!(masses, [0.1, 0.2, 0.3 + 0.4, 0.0]);
        // Through a set that has nothing itself any more.
        let mut masses = [0.1, 0.2, 0.3, 0.4];
        give_to_smaller(&mut masses, &[6.0, 5.0, 6.5, 7.0], &sizes, |_, _| true);
        assert!((masses[0] - 1.0).abs() < 1e-12 && masses[1..] == [0.0; 3], "{masses:?}");
        let mut masses = [0.1, 0.2, 0.3, 0.4];
        give_to_smaller(&mut masses, &totals, &sizes, |_, _| false);
        assert_eq!(masses, [0.1, 0.2, 0.3, 0.4]);
    }
}
