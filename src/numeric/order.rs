//! Items in the order of a number.
//!
//! The standard library's sort is compiled anew for each comparison, two thousand lines of the compiler's code each time; here it is compiled once.

/// Smallest first; of equal numbers the earlier one first. NaN is larger than every number, or smaller if its sign is set.
pub(crate) fn sort_ascending<T>(items: &mut [T], number: impl Fn(&T) -> f64) {
    rearrange(items, by_number(&items.iter().map(number).collect::<Vec<f64>>()));
}

/// Largest first, else as [`sort_ascending`].
pub(crate) fn sort_descending<T>(items: &mut [T], number: impl Fn(&T) -> f64) {
    rearrange(items, by_number(&items.iter().map(|item| -number(item)).collect::<Vec<f64>>()));
}

/// Of each place in the order the place where its item stands.
fn by_number(numbers: &[f64]) -> Vec<usize> {
    let mut order: Vec<(f64, usize)> = numbers.iter().copied().zip(0..).collect();
    order.sort_by(compare);
    order.into_iter().map(|(_, place)| place).collect()
}

fn compare(a: &(f64, usize), b: &(f64, usize)) -> std::cmp::Ordering {
    a.0.total_cmp(&b.0)
}

/// Brings to each place the item that stood at `order`'s.
fn rearrange<T>(items: &mut [T], order: Vec<usize>) {
    let mut order = order;
    for begin in 0..order.len() {
        // Along one cycle; what is in its place is its own cycle.
        let mut place = begin;
        while order[place] != begin {
            let from = std::mem::replace(&mut order[place], place);
            items.swap(place, from);
            place = from;
        }
        order[place] = place;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_order_is_that_of_a_stable_sort(numbers in prop::collection::vec(-3_i8..4, 0..40)) {
            // Few values, so that many are equal; each with its place, so that stability shows.
            let items: Vec<(f64, usize)> = numbers.into_iter().map(f64::from).zip(0..).collect();
            let (mut up, mut down) = (items.clone(), items.clone());
            sort_ascending(&mut up, |item| item.0);
            sort_descending(&mut down, |item| item.0);
            let mut expected = items.clone();
            expected.sort_by(|a, b| a.0.total_cmp(&b.0));
            prop_assert_eq!(up, expected);
            let mut expected = items;
            expected.sort_by(|a, b| b.0.total_cmp(&a.0));
            prop_assert_eq!(down, expected);
        }
    }

    #[test]
    fn what_is_no_number_is_the_largest() {
        let mut numbers = [f64::NAN, 2.0, f64::INFINITY, -1.0, f64::NEG_INFINITY];
        sort_ascending(&mut numbers, |x| *x);
        assert_eq!(numbers[..4], [f64::NEG_INFINITY, -1.0, 2.0, f64::INFINITY]);
        sort_descending(&mut numbers, |x| *x);
        assert_eq!(numbers[1..], [f64::INFINITY, 2.0, -1.0, f64::NEG_INFINITY]);
    }
}
