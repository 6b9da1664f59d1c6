//! Templates of the C headers that a compensator is exported as.

/// The template with every `@key@` replaced, in one pass: what a value holds is not looked at again.
pub(super) fn filled(template: &str, values: &[(&str, String)]) -> String {
    let mut out = String::with_capacity(2 * template.len());
    let mut parts = template.split('@');
    out.push_str(parts.next().unwrap_or_default());
    while let Some(key) = parts.next() {
        match values.iter().find(|(k, _)| *k == key) {
            Some((_, value)) => out.push_str(value),
            None => out.push_str(&format!("@{key}@")),
        }
        out.push_str(parts.next().unwrap_or_default());
    }
    out
}
