//! What a misspelt word was meant to be.

/// The word that a misspelling most likely stands for.
pub(crate) fn nearest<'w>(found: &str, words: &[&'w str]) -> Option<&'w str> {
    // A name without its unit: `gain` for `gain_deg_per_h_per_unit`.
    let beginning = words.iter().find(|w| found.len() > 2 && w.strip_prefix(found).is_some_and(|r| r.starts_with('_')));
    if let Some(word) = beginning {
        return Some(word);
    }
    words
        .iter()
        .map(|w| (strsim::jaro_winkler(found, w), *w))
        .filter(|_| found.len() > 2)
        .filter(|(score, _)| *score > 0.87)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, w)| w)
}
