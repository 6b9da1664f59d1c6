//! `exact`: the best winding with a proof.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::budget::parse_duration;
use super::pattern_asked::patterns_asked;
use super::progress::StopFlag;
use super::screen::Screen;
use super::watching::Watching;
use super::{CliError, Ending, offered};
use crate::io::files::write_atomically;
use crate::io::folder::check_file;
use crate::io::json::ExactJson;
use crate::io::model::NamedPattern;
use crate::io::read::model_file::read_design;
use crate::io::read::pattern_file::print_pattern;
use crate::pattern::windability::WindabilityClass;
use crate::search::cost::objective::Objective;
use crate::task::exact::{Request, run as prove};
use crate::task::under_fields::{self, FieldFile};
use crate::text::sink::TomlComment;

/// The best winding of a class with a proof, or a lower bound on what any winding can reach
#[derive(Debug, clap::Args)]
#[command(
    after_help = "The proof holds for the worst rate over all times of the model's profiles, or for another objective, the model's own or --objective. \"optimal\": no winding of the class is\n\
    better by more than one part in 10^9; \"gap\": none is better than the lower bound.\n\n\
    Examples:\n  coilwright exact examples/paper-200m.toml\n  \
    coilwright exact examples/paper-200m.toml --windability any --budget 5m -o best.toml\n  \
    coilwright exact my-coil.toml --field warm-up.csv      temperatures from a finite-element program"
)]
pub(crate) struct Arguments {
    /// The model file
    model: PathBuf,
    /// What can be wound: standard, captive:K or any; without it, the model's own
    #[arg(long, value_name = "CLASS", value_parser = offered::classes(), hide_possible_values = true)]
    windability: Option<WindabilityClass>,
    /// What is proved to be small: worst-rate, rms, guaranteed-rate or pointing; without it, the model's own
    #[arg(long, value_name = "WHAT", value_parser = offered::objectives(), hide_possible_values = true)]
    objective: Option<Objective>,
    /// Gives up after this time, e.g. 30s or 5m, with the lower bound reached until then
    #[arg(long, value_name = "TIME", default_value = "60s", value_parser = parse_duration)]
    budget: Duration,
    /// A winding's name or a pattern file to begin with, besides the classics and what a short search finds; may be
    /// repeated
    #[arg(long, short, value_name = "PATTERN", value_parser = offered::patterns(), hide_possible_values = true)]
    pattern: Vec<String>,
    /// Temperatures of the layers that were computed elsewhere, as `optimise --field` takes them: the proof is then over the rows
    /// of these files, for worst-rate, worst-phase or rms; may be repeated, each file is a case
    #[arg(long, value_name = "FILE")]
    field: Vec<PathBuf>,
    /// Seed of the short search; without it, the model's own
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Writes the samples that the proof ran on as a table, for other solvers: constant and one coefficient a layer in
    /// °/h (for pointing in °), so that the rate error is constant + Σ a_j (2 P(j) − 1 − N). Needs equal lengths and halves that respond alike
    #[arg(long, value_name = "FILE")]
    samples: Option<PathBuf>,
    /// Writes the best winding as a pattern file
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
}

fn read_besides(arguments: &Arguments) -> impl Iterator<Item = &Path> {
    arguments.pattern.iter().map(Path::new).chain(arguments.field.iter().map(PathBuf::as_path))
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let started = Instant::now();
    let file = read_design(&arguments.model)?;
    for written in arguments.output.iter().chain(&arguments.samples) {
        check_file(written, file.files().chain(read_besides(arguments)))?;
    }
    let class = arguments.windability.unwrap_or(file.search.windability);
    let request = Request {
        class,
        objective: arguments.objective.unwrap_or(file.search.objective),
        starts: patterns_asked(&file, &arguments.pattern)?.into_iter().map(|named| named.pattern).collect(),
        seed: arguments.seed.unwrap_or(file.search.seed),
        ..Request::new(&file)
    };
    let stop = StopFlag::listen();
    let watching = Watching::new(screen, "proof").stopped_by(&stop).within(started, arguments.budget);
    let fields = arguments.field.iter().map(|path| FieldFile::read(path)).collect::<Result<Vec<_>, _>>()?;
    let answer = if fields.is_empty() {
        prove(&request, &watching)?
    } else {
        let objective = under_fields::objective(&file, arguments.objective)?;
        under_fields::prove(&Request { objective, ..request.clone() }, &fields, &watching)?
    };
    watching.finish();
    let body = answer.document(started.elapsed().as_secs_f64());
    if let Some(path) = &arguments.output {
        let named = NamedPattern { name: answer.name.clone(), pattern: answer.certificate.pattern.clone() };
        let comments = [
            format!("coil: {}; class: {class}; over {}", file.model.name, answer.over),
            format!("worst rate {:.6} °/h; proof: {}", body.best.worst_rate_deg_per_h, body.proof.status),
        ];
        write_atomically(path, print_pattern(&named, &comments.map(TomlComment::of)).as_bytes())?;
        screen.note(&format!("wrote {}", path.display()));
    }
    if let Some(path) = &arguments.samples {
        match answer.samples(&file)? {
            Some(table) => write_atomically(path, table.as_bytes())?,
            None => screen.note(&format!(
                "note: {} was not written: the samples are linear in the segments only with equal lengths and halves that \
                 respond alike",
                path.display()
            )),
        }
    }
    let interrupted = stop.is_set() && !answer.is_optimal();
    screen.answer(body, text)?;
    Ok(if interrupted { Ending::Interrupted } else { Ending::Done })
}

fn text(body: &ExactJson) -> String {
    let best = &body.best;
    let objective = Objective::from_key(&body.objective).unwrap_or(Objective::WorstRate);
    let unit = objective.unit();
    let segments: Vec<String> = best.segments.iter().map(ToString::to_string).collect();
    let proof = match (body.proof.status.as_str(), body.proof.lower_bound_deg_per_h) {
        ("optimal", _) => format!(
            "optimal: no winding of the class {} is better by more than {}",
            body.windability,
            body.proof
                .grid_margin_deg_per_h
                .filter(|m| *m > 0.0)
                .map_or_else(|| "rounding".to_owned(), |m| format!("the {m:.1e} {unit} that the grid may be off"))
        ),
        (_, Some(bound)) => format!(
            "gap: no winding of the class {} is below {bound:.6} {unit}, {:.1} % under the best known",
            body.windability,
            100.0 * (1.0 - bound / body.best_objective_deg_per_h)
        ),
        _ => "none: nothing is proved; give a longer --budget".to_owned(),
    };
    let what = if objective == Objective::WorstRate {
        String::new()
    } else {
        format!("proof is of the {}, {:.6} {unit}\n", objective.title(), body.best_objective_deg_per_h)
    };
    format!(
        "{what}best     {}: {}\nworst    {:.6} °/h{}, under {} at {:.2} s\nproof    {proof}\n\
         effort   {} nodes, {} windings judged in full, {:.2} s\n",
        best.name,
        segments.join(" "),
        best.worst_rate_deg_per_h,
        best.grid_margin_deg_per_h.filter(|m| *m > 0.0).map_or_else(String::new, |m| format!(" ± {m:.1e} by the grid")),
        best.worst_profile,
        best.worst_time_s,
        body.nodes,
        body.judged,
        body.seconds
    )
}
