//! What a call reads, so that it writes over none of it.

use std::path::{Path, PathBuf};

use coilwright::io::model::ModelFile;
use coilwright::task::measurement::Measurement;

use crate::pattern::PatternArgument;

/// The files that a call reads, as far as they are files.
#[derive(Debug, Default)]
pub struct Reads(Vec<PathBuf>);

impl Reads {
    pub fn of(model: &ModelFile) -> Self {
        Self(model.files().map(Path::to_owned).collect())
    }

    pub fn patterns<'a>(mut self, stated: impl IntoIterator<Item = &'a PatternArgument>) -> Self {
        self.0.extend(stated.into_iter().filter_map(PatternArgument::file));
        self
    }

    pub fn records<'a>(mut self, taken: impl IntoIterator<Item = &'a Measurement>) -> Self {
        // One that was made in memory came from no file.
        self.0.extend(taken.into_iter().filter(|m| m.sha256.is_some()).map(|m| PathBuf::from(&m.file)));
        self
    }

    pub fn files<'a>(mut self, paths: impl IntoIterator<Item = &'a PathBuf>) -> Self {
        self.0.extend(paths.into_iter().cloned());
        self
    }

    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        self.0.iter().map(PathBuf::as_path)
    }
}
