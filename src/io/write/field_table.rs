//! A temperature field as a table that is read again to the last bit: in K and K/s, every digit that there is.

use crate::thermal::ThermalHistory;

/// One line a time, both sides of a kink under one; layers are counted from the spool.
pub(crate) fn field_table(field: &ThermalHistory) -> String {
    let has_moments = !field.axial_moment_k_per_s.is_empty();
    let kinds: &[(&str, &str)] = &[("layer", "k"), ("layer", "k_per_s"), ("moment", "k"), ("moment", "k_per_s")];
    let kinds = if has_moments { kinds } else { &kinds[..2] };
    let mut header = vec!["time_s".to_owned(), "ambient_k".to_owned(), "ambient_k_per_s".to_owned()];
    header.extend(kinds.iter().flat_map(|(of, unit)| (1..=field.layers).map(move |j| format!("{of}_{j}_{unit}"))));
    let mut text = header.join(",") + "\n";
    let columns = [&field.temperature_k, &field.rate_k_per_s, &field.axial_moment_k, &field.axial_moment_k_per_s];
    for (row, time_s) in field.times_s.iter().enumerate() {
        let here = row * field.layers..(row + 1) * field.layers;
        let mut cells = vec![*time_s, field.ambient_k[row], field.ambient_rate_k_per_s[row]];
        columns[..kinds.len()].iter().for_each(|column| cells.extend_from_slice(&column[here.clone()]));
        // The shortest text that is read as the same number.
        text += &(cells.iter().map(ToString::to_string).collect::<Vec<_>>().join(",") + "\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::read::field_file::parse_field;

    #[test]
    fn what_is_written_is_read_again_to_the_last_bit() {
        let odd = |i: usize| 293.15 + (i as f64 * 0.7).sin() / 3.0;
        let history = ThermalHistory {
            layers: 2,
            times_s: vec![0.0, 0.1 + 0.2, 0.1 + 0.2, 1e3 / 3.0],
            temperature_k: (0..8).map(odd).collect(),
            rate_k_per_s: (0..8).map(|i| odd(i) / 7e5).collect(),
            axial_moment_k: (0..8).map(|i| odd(i) / 1e9).collect(),
            axial_moment_k_per_s: (0..8).map(|i| -odd(i) / 3e7).collect(),
            ambient_k: (0..4).map(odd).collect(),
            ambient_rate_k_per_s: vec![1.0 / 3.0, 0.0, -1e-300, 5e-324],
        };
        let read = parse_field("f.csv", "f", &field_table(&history)).unwrap().field;
        assert_eq!(read.history, history);
    }
}
