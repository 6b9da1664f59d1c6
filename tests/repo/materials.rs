//! What the program is built upon, from Cargo's own account of it: as a bill of materials (CycloneDX), and for the rules.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::process::Command;

use serde_json::{Value, json};

use crate::source::root;

/// A package that becomes part of the program, or that runs while it is built.
pub struct Material {
    pub name: String,
    pub version: String,
    pub licence: String,
    /// Of the registry; none where it comes from elsewhere.
    pub checksum: Option<String>,
    pub source: Option<String>,
    /// The names of what it is built upon.
    pub upon: BTreeSet<String>,
    /// What runs while the program is built.
    pub build_script: Option<PathBuf>,
    id: String,
}

/// All of them, on every platform and with all features; not what only tests and benchmarks use.
pub fn materials() -> Vec<Material> {
    let metadata = metadata();
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let packages: BTreeMap<String, Value> =
        list(&metadata["packages"]).into_iter().map(|p| (text(&p["id"]), p)).collect();
    let nodes: BTreeMap<String, Value> =
        list(&metadata["resolve"]["nodes"]).into_iter().map(|n| (text(&n["id"]), n)).collect();
    let checksums = checksums();
    let own = packages.values().find(|p| p["name"] == "coilwright").expect("the program is a package");
    let mut waiting = vec![text(&own["id"])];
    let mut found: BTreeMap<String, Material> = BTreeMap::new();
    while let Some(id) = waiting.pop() {
        if found.contains_key(&id) {
            continue;
        }
        let used = |d: &Value| list(&d["dep_kinds"]).iter().any(|kind| kind["kind"] != "dev");
        let upon: Vec<String> = list(&nodes[&id]["deps"]).iter().filter(|d| used(d)).map(|d| text(&d["pkg"])).collect();
        let package = &packages[&id];
        let (name, version) = (text(&package["name"]), text(&package["version"]));
        let is_script = |t: &&Value| list(&t["kind"]).iter().any(|kind| kind == "custom-build");
        let targets = list(&package["targets"]);
        let material = Material {
            licence: text(&package["license"]),
            checksum: checksums.get(&(name.clone(), version.clone())).cloned(),
            source: package["source"].as_str().map(str::to_owned),
            upon: upon.iter().map(|id| text(&packages[id]["name"])).collect(),
            build_script: targets.iter().find(is_script).map(|t| PathBuf::from(text(&t["src_path"]))),
            id: id.clone(),
            name,
            version,
        };
        found.insert(id, material);
        waiting.extend(upon);
    }
    found.into_values().collect()
}

fn metadata() -> Value {
    let run = |offline: &[&str]| {
        Command::new(env!("CARGO"))
            .args(["metadata", "--format-version", "1", "--locked", "--all-features"])
            .args(offline)
            .current_dir(root())
            .output()
            .expect("cargo runs these rules")
    };
    // Without the network where what other platforms need is there already.
    let out = Some(run(&["--offline"])).filter(|out| out.status.success()).unwrap_or_else(|| run(&[]));
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    serde_json::from_slice(&out.stdout).expect("cargo writes JSON")
}

/// By name and version, as Cargo.lock has them.
fn checksums() -> BTreeMap<(String, String), String> {
    let lock = std::fs::read_to_string(root().join("Cargo.lock")).expect("Cargo.lock is part of the repository");
    lock.split("[[package]]")
        .filter_map(|package| {
            let value = |key: &str| {
                let line = package.lines().find_map(|line| line.strip_prefix(key)?.trim().strip_prefix('='))?;
                Some(line.trim().trim_matches('"').to_owned())
            };
            Some(((value("name")?, value("version")?), value("checksum")?))
        })
        .collect()
}

/// The bill of materials as a CycloneDX document; the same bytes for the same Cargo.lock.
pub fn bill(materials: &[Material]) -> Value {
    let reference = |m: &Material| format!("pkg:cargo/{}@{}", m.name, m.version);
    let component = |m: &Material| {
        let kind = if m.name == "coilwright" { "application" } else { "library" };
        let mut component = json!({
            "type": kind,
            "bom-ref": reference(m),
            "name": m.name,
            "version": m.version,
            "purl": reference(m),
            "licenses": [{ "expression": m.licence.replace('/', " OR ") }],
        });
        if let Some(checksum) = &m.checksum {
            component["hashes"] = json!([{ "alg": "SHA-256", "content": checksum }]);
        }
        component
    };
    let (own, others): (Vec<&Material>, Vec<&Material>) = materials.iter().partition(|m| m.name == "coilwright");
    let upon = |m: &Material| {
        let used: BTreeSet<String> =
            materials.iter().filter(|other| m.upon.contains(&other.name) && other.id != m.id).map(reference).collect();
        json!({ "ref": reference(m), "dependsOn": used })
    };
    json!({
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": { "component": own.first().map(|m| component(m)) },
        "components": others.into_iter().map(component).collect::<Vec<_>>(),
        "dependencies": materials.iter().map(upon).collect::<Vec<_>>(),
    })
}
