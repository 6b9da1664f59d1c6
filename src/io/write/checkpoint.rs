//! The state of a search between two slices, as a file: what `optimise --resume` goes on from.
//!
//! Costs are stored as the bits of their floating-point numbers and generators by their position in their stream, so a
//! search that is taken up again is bit for bit the search that was interrupted.

use std::path::Path;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::{Deserialize, Serialize};

use crate::io::fault::Faults;
use crate::io::files::{WriteError, sha256_hex, write_atomically};
use crate::io::json::SCHEMA_VERSION;
use crate::search::anneal::restart::Restart;
use crate::search::anneal::rounds::{FoundPattern, RoundRecord, State, Stop};
use crate::search::cost::columns::Work;

/// The name of a checkpoint in its run's folder.
pub(crate) const CHECKPOINT_FILE: &str = "checkpoint.json";

#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CheckpointJson {
    schema_version: u32,
    /// Of everything that the search depends on; a checkpoint fits only the request that it was made for.
    fingerprint: String,
    /// SHA-256 of all the rest: a search that goes on from a changed number is another search.
    checksum: String,
    round: u64,
    restarts: Vec<RestartJson>,
    found: Vec<FoundJson>,
    rounds_without_improvement: u64,
    working: Vec<usize>,
    work: WorkJson,
    history: Vec<RoundJson>,
    stop: Option<String>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RestartJson {
    index: u64,
    moves: u64,
    segments: Vec<usize>,
    best_segments: Vec<usize>,
    best_cost_bits: u64,
    generator: GeneratorJson,
    work: WorkJson,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct GeneratorJson {
    seed: [u8; 32],
    stream: u64,
    /// A 68-bit number: too wide for JSON's.
    word_position: String,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct WorkJson {
    moves: u64,
    accepted: u64,
    samples: u64,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FoundJson {
    cost_bits: u64,
    segments: Vec<usize>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RoundJson {
    round: u64,
    evaluations: u64,
    best_cost_bits: u64,
    working_samples: usize,
}

/// Writes a checkpoint: whole or not at all.
///
/// # Errors
/// A file that cannot be written.
pub fn write_checkpoint(folder: &Path, fingerprint: &str, state: &State) -> Result<(), WriteError> {
    let mut document = CheckpointJson {
        schema_version: SCHEMA_VERSION,
        fingerprint: fingerprint.to_owned(),
        checksum: String::new(),
        round: state.round,
        restarts: state.restarts.iter().map(restart_json).collect(),
        found: state
            .found
            .iter()
            .map(|f| FoundJson { cost_bits: f.cost.to_bits(), segments: f.segments.clone() })
            .collect(),
        rounds_without_improvement: state.rounds_without_improvement,
        working: state.working.clone(),
        work: work_json(state.work),
        history: state
            .history
            .iter()
            .map(|h| RoundJson {
                round: h.round,
                evaluations: h.evaluations,
                best_cost_bits: h.best_cost.to_bits(),
                working_samples: h.working_samples,
            })
            .collect(),
        stop: state.stop.map(|stop| stop.key().to_owned()),
    };
    document.checksum = sha256_hex(&document.json());
    let json = document.json();
    write_atomically(&folder.join(CHECKPOINT_FILE), (json + "\n").as_bytes())
}

/// Reads a checkpoint; none where there is no such file.
///
/// # Errors
/// A file that is no checkpoint, or one of another request.
pub(crate) fn read_checkpoint(folder: &Path, fingerprint: &str) -> Result<Option<State>, Faults> {
    let path = folder.join(CHECKPOINT_FILE);
    if !path.exists() {
        return Ok(None);
    }
    let text = crate::io::files::read_text(&path)?;
    parse_checkpoint(&path.display().to_string(), &text, fingerprint).map(Some)
}

/// As [`read_checkpoint`], of a text that was read already.
///
/// # Errors
/// A text that is no checkpoint, or one of another request.
pub fn parse_checkpoint(file: &str, text: &str, fingerprint: &str) -> Result<State, Faults> {
    let fault = |message: String| Faults::of_file(file, message);
    let remedy = "begin again with --fresh, which keeps this one as checkpoint.broken.json";
    let document: CheckpointJson =
        serde_json::from_str(text).map_err(|e| fault(format!("is no checkpoint of this program ({e}): {remedy}")))?;
    if document.schema_version != SCHEMA_VERSION {
        return Err(fault(format!(
            "expected a checkpoint of version {SCHEMA_VERSION}, found version {}: {remedy}",
            document.schema_version
        )));
    }
    if !document.is_whole() {
        return Err(fault(format!("does not hold what its checksum says: it was changed or damaged: {remedy}")));
    }
    if document.fingerprint != fingerprint {
        return Err(fault(
            "belongs to another model, seed, class or set of options than this request: repeat the request as it is \
             in run.toml, or begin again with --fresh"
                .to_owned(),
        ));
    }
    state_of(document).ok_or_else(|| fault(format!("holds a number that no search has: {remedy}")))
}

/// Where a checkpoint goes that cannot be gone on from.
pub(crate) const BROKEN_FILE: &str = "checkpoint.broken.json";

/// Keeps a checkpoint that is damaged or none aside, before another one takes its name; whether there was one.
///
/// # Errors
/// A file that cannot be renamed.
pub(crate) fn set_broken_aside(folder: &Path) -> Result<bool, WriteError> {
    let path = folder.join(CHECKPOINT_FILE);
    if !path.exists() {
        return Ok(false);
    }
    // What cannot be read may be whole.
    let bytes = std::fs::read(&path).map_err(|source| WriteError::File { path: path.clone(), source })?;
    if serde_json::from_slice::<CheckpointJson>(&bytes).is_ok_and(|document| document.is_whole()) {
        return Ok(false);
    }
    let aside = folder.join(BROKEN_FILE);
    std::fs::rename(&path, &aside).map_err(|source| WriteError::File { path: aside, source })?;
    Ok(true)
}

impl CheckpointJson {
    fn json(&self) -> String {
        serde_json::to_string(self).expect("numbers, strings and lists can always be written as JSON")
    }

    fn is_whole(&self) -> bool {
        let blank = Self { checksum: String::new(), ..self.clone() };
        sha256_hex(&blank.json()) == self.checksum
    }
}

fn restart_json(restart: &Restart) -> RestartJson {
    RestartJson {
        index: restart.index,
        moves: restart.moves,
        segments: restart.segments.clone(),
        best_segments: restart.best_segments.clone(),
        best_cost_bits: restart.best_cost.to_bits(),
        generator: GeneratorJson {
            seed: restart.random.get_seed(),
            stream: restart.random.get_stream(),
            word_position: restart.random.get_word_pos().to_string(),
        },
        work: work_json(restart.work),
    }
}

fn work_json(work: Work) -> WorkJson {
    WorkJson { moves: work.moves, accepted: work.accepted, samples: work.samples }
}

fn work_of(json: &WorkJson) -> Work {
    Work { moves: json.moves, accepted: json.accepted, samples: json.samples }
}

fn state_of(json: CheckpointJson) -> Option<State> {
    let restarts = json
        .restarts
        .into_iter()
        .map(|restart| {
            let mut random = ChaCha8Rng::from_seed(restart.generator.seed);
            random.set_stream(restart.generator.stream);
            random.set_word_pos(restart.generator.word_position.parse().ok()?);
            Some(Restart {
                index: restart.index,
                moves: restart.moves,
                segments: restart.segments,
                best_segments: restart.best_segments,
                best_cost: f64::from_bits(restart.best_cost_bits),
                random,
                work: work_of(&restart.work),
            })
        })
        .collect::<Option<_>>()?;
    let stop = match json.stop {
        Some(key) => Some(Stop::from_key(&key)?),
        None => None,
    };
    Some(State {
        round: json.round,
        restarts,
        found: json
            .found
            .into_iter()
            .map(|f| FoundPattern { cost: f64::from_bits(f.cost_bits), segments: f.segments })
            .collect(),
        rounds_without_improvement: json.rounds_without_improvement,
        working: json.working,
        work: work_of(&json.work),
        history: json
            .history
            .into_iter()
            .map(|h| RoundRecord {
                round: h.round,
                evaluations: h.evaluations,
                best_cost: f64::from_bits(h.best_cost_bits),
                working_samples: h.working_samples,
            })
            .collect(),
        stop,
    })
}
