//! What a document about measurements was made from: program, model file and records, each with its SHA-256.

use std::io::Read;
use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::io::fault::Faults;
use crate::io::files::sha256_hex;
use crate::io::model::ModelFile;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct InputsJson {
    pub(crate) program: String,
    /// Null for documents that no model was asked about.
    pub(crate) model_file: Option<String>,
    pub(crate) model_sha256: Option<String>,
    pub(crate) records: Vec<RecordInputJson>,
}

/// A record that a document was made from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct RecordInputJson {
    pub(crate) file: String,
    /// Null for a pipe, which cannot be read twice.
    pub(crate) sha256: Option<String>,
    /// "compared", "measured", "fitted", "held out" or "temperatures".
    pub(crate) role: String,
}

impl InputsJson {
    pub(crate) fn new(model: Option<&ModelFile>, records: Vec<RecordInputJson>) -> Self {
        Self {
            program: concat!("coilwright ", env!("CARGO_PKG_VERSION")).to_owned(),
            model_file: model.map(|m| m.path.display().to_string()),
            model_sha256: model.map(|m| sha256_hex(&m.source)),
            records,
        }
    }
}

impl RecordInputJson {
    /// # Errors
    /// A file that cannot be read.
    pub fn new(path: &Path, role: &str) -> Result<Self, Faults> {
        let file = path.display().to_string();
        let fault = |e: std::io::Error| Faults::of_file(&file, format!("cannot be read: {e}"));
        let role = role.to_owned();
        if !std::fs::metadata(path).map_err(fault)?.is_file() {
            return Ok(Self { file, sha256: None, role });
        }
        let mut hash = Sha256::new();
        let mut source = std::fs::File::open(path).map_err(fault)?;
        let mut buffer = vec![0; 1 << 16];
        loop {
            match source.read(&mut buffer).map_err(fault)? {
                0 => break,
                count => hash.update(&buffer[..count]),
            }
        }
        let sha256 = Some(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect());
        Ok(Self { file, sha256, role })
    }
}
