//! The folder of a search under temperature fields from files: what `optimise --field -o` writes.

use std::path::Path;

use super::TaskError;
use super::page::{REPORT_FILE, write_report};
use super::schedule;
use super::under_fields::FieldSearchFound;
use crate::io::folder::Replacement;
use crate::io::json::Document;
use crate::io::model::ModelFile;
use crate::io::read::pattern_file::print_pattern;
use crate::io::write::checkpoint::CHECKPOINT_FILE;
use crate::io::write::field_rates::{RATES_FILE, rates_csv};
use crate::io::write::run_directory::{KINDS, baselines_csv, history_csv};
use crate::text::sink::TomlComment;

impl FieldSearchFound {
    /// Writes the pattern, its schedule, tables, the document and the page.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub(crate) fn write(&self, folder: &Path, model: &ModelFile) -> Result<(), TaskError> {
        let d = &self.document;
        let fields: Vec<&str> = d.fields.iter().map(|f| f.file.as_str()).collect();
        let comments = [
            format!("coil: {}", d.model),
            format!("objective: {}, class: {}, seed: {}", d.objective, d.windability, d.seed),
            format!("temperatures: {}", fields.join(", ")),
            format!("worst rate error: {:.6} deg/h under {}", d.best.worst_rate_deg_per_h, d.best.worst_profile),
        ];
        let comments: Vec<TomlComment> = comments.iter().map(TomlComment::of).collect();
        let mut files = Replacement::of(folder);
        files.add("best.toml", print_pattern(&self.best, &comments).as_bytes())?;
        let schedule = schedule::run(&schedule::Request { model, pattern: Some(&self.best) })?;
        for (name, text) in schedule.tables()? {
            files.add(name, text.as_bytes())?;
        }
        files.add("baselines.csv", &baselines_csv(&d.baselines, &d.best))?;
        files.add("history.csv", &history_csv(&self.history))?;
        files.add(RATES_FILE, &rates_csv(&self.rates))?;
        files.add("model.toml", model.source.as_bytes())?;
        let summary = serde_json::to_string_pretty(&Document::new(d))? + "\n";
        files.add("summary.json", summary.as_bytes())?;
        // What the request was, and how far it came, stays: the search can be taken up again.
        let kinds = KINDS.into_iter().filter(|kind| ![CHECKPOINT_FILE, "run.toml"].contains(kind));
        files.commit(&kinds.collect::<Vec<_>>())?;
        write_report(folder, &folder.join(REPORT_FILE))?;
        Ok(())
    }
}
