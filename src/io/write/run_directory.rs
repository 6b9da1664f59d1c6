//! The folder of a search: `run.toml`, `best.toml`, `summary.json`, `baselines.csv`, `history.csv`, `model.toml`.
//!
//! Nothing in it depends on the clock, on the number of threads, or on whether the run was interrupted and resumed:
//! the same request gives the same bytes. Speed is said on the screen only.

use std::path::Path;

use crate::io::files::{WriteError, sha256_hex, write_atomically};
use crate::io::folder::{Replacement, check_ours, check_read, remove_kinds};
use crate::io::json::search::{BestFoundJson, OptimiseJson};
use crate::io::json::{Document, PatternJson};
use crate::io::model::{ModelFile, NamedPattern};
use crate::io::read::pattern_file::print_pattern;
use crate::io::table::Table;
use crate::pattern::windability::WindabilityClass;
use crate::search::anneal::rounds::{Plan, RoundRecord, State};
use crate::search::cost::objective::Objective;
use crate::search::evaluator::Judged;
use crate::text::sink::{Cell, TomlComment};
use crate::units::deg_per_h_from_rad_per_s;

use super::checkpoint::CHECKPOINT_FILE;
use super::field_rates::RATES_FILE;

/// A request, as far as the search's course depends on it.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// The model file as it was read.
    pub file: &'a ModelFile,
    /// What the winding shop can wind.
    pub class: WindabilityClass,
    /// What is made small.
    pub objective: Objective,
    /// How it is searched.
    pub plan: &'a Plan,
    /// As given on the command line, if it was.
    pub budget: Option<&'a str>,
    /// Whether worst admissible profiles join the searched ones.
    pub cutting_planes: bool,
    /// Of temperatures from elsewhere: each file's SHA-256; none where profiles are searched.
    pub fields: &'a [String],
}

impl Request<'_> {
    /// What a checkpoint must agree with. A budget of time changes where a search ends, not its course.
    pub fn fingerprint(&self) -> String {
        sha256_hex(&format!("{}\n{}", self.settings(), self.file.source))
    }

    fn settings(&self) -> toml_edit::Table {
        let mut table = toml_edit::Table::new();
        let plan = self.plan;
        table["seed"] = toml_edit::value(plan.seed as i64);
        table["windability"] = toml_edit::value(self.class.to_string());
        table["objective"] = toml_edit::value(self.objective.key());
        table["restarts_per_round"] = toml_edit::value(plan.restarts_per_round as i64);
        table["moves_per_restart"] = toml_edit::value(plan.moves_per_restart as i64);
        table["patience_rounds"] = toml_edit::value(plan.rules.patience as i64);
        if plan.rules.rounds < i64::MAX as u64 {
            table["rounds"] = toml_edit::value(plan.rules.rounds as i64);
        }
        if let Some(moves) = plan.rules.moves {
            table["moves"] = toml_edit::value(moves as i64);
        }
        if let Some(target) = plan.rules.target {
            table["target_deg_per_h"] = toml_edit::value(deg_per_h_from_rad_per_s(target));
        }
        if self.cutting_planes {
            table["cutting_planes"] = toml_edit::value(true);
        }
        if !self.fields.is_empty() {
            table["fields_sha256"] = toml_edit::value(self.fields.iter().collect::<toml_edit::Array>());
        }
        for start in &plan.starts {
            let segments: toml_edit::Array = start.iter().map(|&s| s as i64).collect();
            table["init"] = toml_edit::value(segments);
        }
        table
    }

    /// The text of `run.toml`.
    pub(crate) fn run_toml(&self) -> String {
        let mut document = toml_edit::DocumentMut::new();
        document["program"] = toml_edit::value(concat!("coilwright ", env!("CARGO_PKG_VERSION")));
        document["command"] = toml_edit::value("optimise");
        document["model"] = toml_edit::value(self.file.path.display().to_string());
        document["model_name"] = toml_edit::value(&self.file.model.name);
        document["model_sha256"] = toml_edit::value(sha256_hex(&self.file.source));
        if let Some(budget) = self.budget {
            document["budget"] = toml_edit::value(budget);
        }
        document["search"] = toml_edit::Item::Table(self.settings());
        document.to_string()
    }
}

impl Request<'_> {
    /// What differs between the request of the run that a folder holds and this one: each option with its old and its new value.
    /// Empty where the folder does not say.
    pub(crate) fn differences(&self, folder: &Path) -> Vec<String> {
        let read = |name: &str| std::fs::read_to_string(folder.join(name)).ok();
        let old = read("run.toml").and_then(|text| text.parse::<toml_edit::DocumentMut>().ok());
        let Some(old) = old.as_ref().and_then(|document| document["search"].as_table()) else { return Vec::new() };
        let new = self.settings();
        let shown = |table: &toml_edit::Table, key: &str| {
            table.get(key).map_or_else(|| "not set".to_owned(), |item| item.to_string().trim().to_owned())
        };
        let keys =
            old.iter().chain(new.iter().filter(|(key, _)| !old.contains_key(key))).map(|(key, _)| key.to_owned());
        let mut found: Vec<String> = keys
            .map(|key| (shown(old, &key), shown(&new, &key), key))
            .filter(|(then, now, _)| then != now)
            .map(|(then, now, key)| format!("{key} was {then} and is {now}"))
            .collect();
        if read("model.toml").is_some_and(|source| source != self.file.source) {
            found.push("the model file is another one than the folder's model.toml".to_owned());
        }
        found
    }
}

/// Writes what is known when a run begins, and takes away what another run left; its checkpoint comes after it.
///
/// # Errors
/// Files that cannot be written.
pub fn write_request(folder: &Path, request: &Request) -> Result<(), WriteError> {
    let mut files = Replacement::of(folder);
    files.add("run.toml", request.run_toml().as_bytes())?;
    files.add("model.toml", request.file.source.as_bytes())?;
    files.commit(&KINDS)
}

/// What a search may leave, over profiles or over fields; the summary first: while it is there, the rest is of its run.
pub(crate) const KINDS: [&str; 12] = [
    "summary.json",
    "best.toml",
    "baselines.csv",
    "history.csv",
    RATES_FILE,
    "schedule.csv",
    "schedule.json",
    "report.html",
    "explorer.html",
    CHECKPOINT_FILE,
    "run.toml",
    "model.toml",
];

/// Refuses a folder in which a search's files would take the place of what it reads, or of a model file that no run left
/// there; the copy of its own model that a run left may be read.
///
/// # Errors
/// As said.
pub fn check_kept<'a>(folder: &Path, read: impl IntoIterator<Item = &'a Path>) -> Result<(), WriteError> {
    let is_run = folder.join("run.toml").is_file();
    let kinds: Vec<&str> = KINDS.into_iter().filter(|name| !(is_run && *name == "model.toml")).collect();
    check_read(folder, &kinds, read)?;
    check_ours(folder, "model.toml", &["run.toml", "summary.json"])
}

/// Takes away what a search left in a folder.
///
/// # Errors
/// A file that cannot be removed.
pub(crate) fn clear(folder: &Path) -> Result<(), WriteError> {
    remove_kinds(folder, &KINDS)
}

/// Writes what a run has found; the summary last, so that where it is, the rest is.
///
/// # Errors
/// Files that cannot be written.
pub(crate) fn write_results(
    folder: &Path,
    answer: &OptimiseJson,
    best: &Judged,
    state: &State,
) -> Result<(), WriteError> {
    let named = NamedPattern { name: best.name.clone(), pattern: best.pattern.clone() };
    let mut comments = vec![
        format!("coil: {}", answer.model),
        format!("objective: {}, class: {}, seed: {}", answer.objective, answer.windability, answer.seed),
        format!("worst rate error: {:.6} deg/h under {}", answer.best.worst_rate_deg_per_h, answer.best.worst_profile),
    ];
    comments.extend(answer.best.p95_rate_deg_per_h.map(|p95| format!("P95 over built coils: {p95:.6} deg/h")));
    write_atomically(
        &folder.join("best.toml"),
        print_pattern(&named, &comments.iter().map(TomlComment::of).collect::<Vec<_>>()).as_bytes(),
    )?;
    write_atomically(&folder.join("baselines.csv"), &baselines_csv(&answer.baselines, &answer.best))?;
    write_atomically(&folder.join("history.csv"), &history_csv(&state.history))?;
    let best_found = BestFoundJson { seconds: None, ..answer.best_found.clone() };
    let summary = OptimiseJson { evaluations_per_s: None, seconds: None, best_found, ..answer.clone() };
    let json = serde_json::to_string_pretty(&Document::new(summary)).expect("the answer's numbers are finite");
    write_atomically(&folder.join("summary.json"), (json + "\n").as_bytes())
}

pub(crate) fn baselines_csv(baselines: &[PatternJson], best: &PatternJson) -> Vec<u8> {
    // A column only of searches over built coils, so that the others' files stay as they are.
    let p95 = |value: &dyn Fn() -> String| best.p95_rate_deg_per_h.map(|_| value());
    let mut header: Vec<String> = [
        "name",
        "worst_rate_deg_per_h",
        "worst_phase_rad",
        "worst_profile",
        "worst_time_s",
        "guaranteed_worst_rate_deg_per_h",
    ]
    .map(str::to_owned)
    .to_vec();
    header.extend(p95(&|| "p95_rate_deg_per_h".to_owned()));
    header.extend(["class", "reels", "captive", "max_climb", "segments"].map(str::to_owned));
    let mut table = Table::with_header(header.iter().map(String::as_str));
    for pattern in baselines.iter().chain(std::iter::once(best)) {
        let segments: Vec<String> = pattern.segments.iter().map(ToString::to_string).collect();
        let mut row = vec![
            pattern.name.clone(),
            pattern.worst_rate_deg_per_h.to_string(),
            pattern.worst_phase_rad.to_string(),
            pattern.worst_profile.clone(),
            pattern.worst_time_s.to_string(),
            pattern.guaranteed_worst_rate_deg_per_h.map(|g| g.to_string()).unwrap_or_default(),
        ];
        row.extend(p95(&|| pattern.p95_rate_deg_per_h.map(|v| v.to_string()).unwrap_or_default()));
        row.extend([
            pattern.windability.class.clone(),
            pattern.windability.reels.to_string(),
            pattern.windability.captive.to_string(),
            pattern.windability.max_climb.to_string(),
            segments.join(" "),
        ]);
        table.row(row.iter().map(|text| Cell::text(text)));
    }
    table.into_bytes()
}

pub(crate) fn history_csv(history: &[RoundRecord]) -> Vec<u8> {
    let mut table = Table::with_header(["round", "evaluations", "best_deg_per_h", "working_samples"]);
    for record in history {
        let cells = [
            record.round.to_string(),
            record.evaluations.to_string(),
            deg_per_h_from_rad_per_s(record.best_cost).to_string(),
            record.working_samples.to_string(),
        ];
        table.row(cells.map(Cell::plain));
    }
    table.into_bytes()
}
