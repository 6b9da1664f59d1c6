//! The commented model file that a new coil begins with.

/// The text for a coil of this name.
pub fn template(name: &str) -> String {
    const TEMPLATE: &str = include_str!("model_template.toml");
    let name = toml_edit::Value::from(name).to_string();
    TEMPLATE.replace("\"NAME\"", name.trim())
}
