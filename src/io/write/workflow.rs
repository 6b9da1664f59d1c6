//! A campaign as a workflow of an engine that exists: Snakemake, on one machine or a cluster, and Slurm's arrays.
//!
//! The files of an engine are the same for every campaign; what is particular to one stands in `config.json` or `campaign.conf`.

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::io::files::{WriteError, sha256_hex};
use crate::io::folder::{Replacement, check_read};
use crate::io::read::campaign_file::ID_DIGITS;
use crate::text::sink::{JsonText, ShellWord};
use crate::units::min_from_s;

/// Who runs the parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Engine {
    /// A graph of files, on one machine or a cluster.
    Snakemake,
    /// A cluster's queue, as one array of tasks.
    Slurm,
}

impl Engine {
    /// As on the command line.
    pub fn key(self) -> &'static str {
        match self {
            Engine::Snakemake => "snakemake",
            Engine::Slurm => "slurm",
        }
    }

    /// Slurm's arrays have at most 1001 tasks where nobody has changed MaxArraySize; Snakemake's graph takes minutes beyond so
    /// many jobs.
    fn most_parts(self) -> usize {
        match self {
            Engine::Snakemake => 10_000,
            Engine::Slurm => 1_000,
        }
    }
}

/// What is to be run.
#[derive(Debug, Clone)]
pub struct Workflow<'a> {
    /// What will run it.
    pub engine: Engine,
    /// This program, where the parts find it.
    pub program: &'a Path,
    /// The campaign's file.
    pub campaign: &'a Path,
    /// What the cells are made from.
    pub inputs: &'a [PathBuf],
    /// The cells' identifiers, in the grid's order.
    pub ids: Vec<&'a str>,
    /// Of all cells, on one thread.
    pub estimated_s: f64,
    /// What a part should take.
    pub part_s: f64,
    /// Of each part.
    pub threads: u16,
}

#[derive(Debug, Serialize)]
struct ConfigJson {
    program: String,
    campaign: String,
    /// A part runs again when one of these changes.
    inputs: Vec<String>,
    /// Changes with the cells.
    address: String,
    parts: usize,
    threads: u16,
    memory_mb: u32,
    limit_min: u64,
    retries: u32,
}

/// A cell of 48 layers and 64 profiles takes a tenth of it.
const MEMORY_MB: u32 = 1000;
/// Every job knows all cells: a million of them take 1.2 GB (`results/campaigns`).
const LISTED_CELL_MB: f64 = 0.0013;

/// A part is tried so often again.
const RETRIES: u32 = 3;

/// The estimate is an order of magnitude: a part may take so many times as long before its engine ends it; at the least so long.
const LIMIT_OVER_ESTIMATE: f64 = 6.0;
const LEAST_LIMIT_MIN: f64 = 30.0;

impl Workflow<'_> {
    /// Into how many parts the cells are dealt.
    pub fn parts(&self) -> usize {
        let wanted = (self.estimated_s / (self.part_s * f64::from(self.threads))).ceil() as usize;
        wanted.clamp(1, self.engine.most_parts().min(self.ids.len().max(1)))
    }

    fn config(&self) -> ConfigJson {
        let absolute = |path: &Path| std::path::absolute(path).unwrap_or(path.to_owned()).display().to_string();
        let parts = self.parts();
        let part_min = min_from_s(self.estimated_s / (parts as f64 * f64::from(self.threads)));
        let limit_min = (LIMIT_OVER_ESTIMATE * part_min.max(min_from_s(self.part_s))).max(LEAST_LIMIT_MIN);
        ConfigJson {
            program: absolute(self.program),
            campaign: absolute(self.campaign),
            inputs: std::iter::once(self.campaign)
                .chain(self.inputs.iter().map(PathBuf::as_path))
                .map(absolute)
                .collect(),
            address: format!("{}-{parts}", &sha256_hex(&self.ids.join("\n"))[..ID_DIGITS]),
            parts,
            threads: self.threads,
            memory_mb: MEMORY_MB + (LISTED_CELL_MB * self.ids.len() as f64) as u32,
            limit_min: limit_min.ceil() as u64,
            retries: RETRIES,
        }
    }

    /// Writes the workflow's files into a folder; their names.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<Vec<&'static str>, WriteError> {
        let config = self.config();
        let files: Vec<(&'static str, String)> = match self.engine {
            Engine::Snakemake => {
                let json =
                    serde_json::to_string_pretty(&config).expect("texts and whole numbers can be written") + "\n";
                vec![
                    ("Snakefile", SNAKEFILE.to_owned()),
                    ("config.json", JsonText::of(&json).into_string()),
                    ("profiles/laptop/config.yaml", LAPTOP.to_owned()),
                    ("profiles/slurm/config.yaml", CLUSTER.to_owned()),
                ]
            }
            Engine::Slurm => vec![
                ("submit.sh", SUBMIT.to_owned()),
                ("array.sh", ARRAY.to_owned()),
                ("merge.sh", MERGE.to_owned()),
                ("campaign.conf", config.as_shell()),
            ],
        };
        let names: Vec<&'static str> = files.iter().map(|(name, _)| *name).collect();
        check_read(folder, &names, self.inputs.iter().map(PathBuf::as_path).chain([self.campaign]))?;
        let mut replacement = Replacement::of(folder);
        for (name, text) in &files {
            replacement.add(name, text.as_bytes())?;
        }
        replacement.commit(&[])?;
        Ok(names)
    }
}

impl ConfigJson {
    fn as_shell(&self) -> String {
        format!(
            "program={}\ncampaign={}\nparts={}\nthreads={}\nmemory_mb={}\nlimit_min={}\n",
            ShellWord::of(&self.program),
            ShellWord::of(&self.campaign),
            self.parts,
            self.threads,
            self.memory_mb,
            self.limit_min
        )
    }
}

const SNAKEFILE: &str = include_str!("workflow/Snakefile");
const LAPTOP: &str = include_str!("workflow/laptop.yaml");
const CLUSTER: &str = include_str!("workflow/slurm.yaml");
const SUBMIT: &str = include_str!("workflow/submit.sh");
const ARRAY: &str = include_str!("workflow/array.sh");
const MERGE: &str = include_str!("workflow/merge.sh");

#[cfg(test)]
mod tests {
    use super::*;

    fn workflow(ids: usize, estimated_s: f64, engine: Engine) -> Workflow<'static> {
        let (program, campaign) = (Path::new("/bin/coilwright"), Path::new("/grid.toml"));
        Workflow { engine, program, campaign, inputs: &[], ids: vec!["x"; ids], estimated_s, part_s: 600.0, threads: 1 }
    }

    #[test]
    fn parts_take_as_long_as_was_asked_for_unless_the_engine_takes_no_more_of_them() {
        assert_eq!(workflow(5, 1.0, Engine::Snakemake).parts(), 1);
        assert_eq!(workflow(1000, 6000.0, Engine::Snakemake).parts(), 10);
        assert_eq!(workflow(3, 6000.0, Engine::Snakemake).parts(), 3);
        let large = workflow(1_000_000, 6e6, Engine::Slurm);
        assert_eq!(large.parts(), 1000);
        // Each part then takes 100 minutes and may take six times that.
        assert_eq!(large.config().limit_min, 600);
        // And holds the list of all cells beside its own.
        assert_eq!(large.config().memory_mb, 2300);
        assert_eq!(workflow(100, 6e6, Engine::Slurm).config().memory_mb, 1000);
    }
}
