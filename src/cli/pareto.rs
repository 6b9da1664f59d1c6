//! `pareto`: how much error each step of winding effort buys.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::progress::StopFlag;
use super::screen::{Screen, held, table};
use super::{CliError, Ending};
use crate::io::files::write_atomically;
use crate::io::json::PatternJson;
use crate::io::json::pareto::{ParetoJson, PointJson, front_csv};
use crate::io::model::{ModelFile, NamedPattern};
use crate::io::read::model_file::read_model;
use crate::io::read::pattern_file::print_pattern;
use crate::io::write::pareto_parts::{Front, remove_front};
use crate::pattern::Pattern;
use crate::pattern::classic::Classic;
use crate::pattern::windability::WindabilityClass;
use crate::report::plot::{Axis, Chart, Series};
use crate::search::anneal::limits::Limits;
use crate::search::anneal::quantile::QuantileCost;
use crate::search::anneal::rounds::{
    DEFAULT_RESTARTS_PER_ROUND, Found, Optimisation, Plan, Rounds, Rules, default_moves_per_restart,
};
use crate::search::compile::Whose;
use crate::search::cost::objective::Objective;
use crate::search::cost::sampled_coils::SampledCoils;
use crate::search::cost::tolerance::Coils;
use crate::search::cost::worst_case::SolvedProfiles;
use crate::search::evaluator::{Evaluator, Judged};
use crate::search::pareto::{Point, front};
use crate::text::sink::TomlComment;

/// The front of worst-case error against windability and robustness
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Weighed are the worst rate, captive reels, largest climb, crossovers over other layers and, where the model has a\n\
    [tolerance] table, the 95 % quantile over built coils. Searched are all classes and, within each, climbs of up to 2, 3, 4,\n\
    5, 6, 8 and any number of layers, for the worst rate and for the quantile. Every point is a pattern file that schedule\n\
    takes. With -o what is done is kept in parts/, so the same command goes on after an interruption.\n\n\
    Example:\n  coilwright pareto examples/paper-200m.toml -o results/paper-200m-front"
)]
pub struct Arguments {
    /// The model file
    model: PathBuf,
    /// Writes pareto.csv, pareto.svg (with tolerances also pareto-p95.svg) and one pattern file a point into this folder
    #[arg(long, short, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Seed of the searches; without it, the model's own
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// The most captive reels that are tried one by one; any number is tried besides
    #[arg(long, value_name = "K", default_value_t = 2, value_parser = clap::value_parser!(u8).range(0..=16))]
    most_captive: u8,
    /// Rounds of restarts a class
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..))]
    rounds: u64,
}

pub fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let stop = StopFlag::listen();
    let file = read_model(&arguments.model)?;
    let seed = arguments.seed.unwrap_or(file.search.seed);
    let solved = SolvedProfiles::new(&file.model, &file.profiles.profiles())?;
    let unit_step = crate::search::cost::guaranteed::UnitStep::new(&file.model, file.profiles.max_rate_k_per_s).ok();
    let evaluator = Evaluator {
        model: &file.model,
        solved: &solved,
        objective: Objective::WorstRate,
        unit_step: unit_step.as_ref(),
        profiles: &file.profiles,
        tolerance: file.tolerance.as_ref(),
    };
    let mut judged = evaluator.baselines()?;
    let captive = (1..=usize::from(arguments.most_captive)).map(WindabilityClass::Captive);
    let classes: Vec<WindabilityClass> =
        std::iter::once(WindabilityClass::Standard).chain(captive).chain([WindabilityClass::Any]).collect();
    let climbs: Vec<Option<usize>> =
        CLIMBS.into_iter().filter(|c| *c < file.model.coil.layers()).map(Some).chain([None]).collect();
    let mut whose = vec![evaluator.sampled_coils(Whose::Declared, WindabilityClass::Any, seed)?];
    if file.tolerance.is_some() {
        whose.push(evaluator.sampled_coils(Whose::Built, WindabilityClass::Any, seed)?);
    }
    let _held = arguments.output.as_deref().map(|folder| held(folder, "pareto")).transpose()?;
    let kept = arguments.output.as_deref().map(|folder| Front { folder, file: &file, seed, rounds: arguments.rounds });
    let parts = parts(&classes, &climbs, whose.len());
    let progress = screen.progress("pareto", Some(parts.len() as u64));
    for (number, part) in parts.iter().enumerate() {
        let words = part.words();
        let found = match kept.as_ref().and_then(|front| front.read_part(number + 1, &words)) {
            Some(found) => found,
            None => {
                let searched = match part.climb {
                    Climb::Unlimited => candidates(&evaluator, &file, part.class, seed, arguments.rounds, &stop)?,
                    Climb::Within { most_climb, builds } => {
                        let limits = Limits { class: part.class, most_climb };
                        limited(&evaluator, &whose[builds], limits, seed, &stop)?
                    }
                };
                let Some(found) = searched else { return Ok(interrupted(&arguments.output, screen)) };
                if let Some(front) = &kept {
                    front.write_part(number + 1, &words, &found)?;
                }
                found
            }
        };
        let name = part.class.to_string().replace(':', "-");
        judged.extend(
            evaluator.judge_all(&found.into_iter().map(|pattern| (name.clone(), pattern)).collect::<Vec<_>>())?,
        );
        progress.at(number as u64 + 1, &words);
    }
    progress.finish();
    let points = front(&with_spreads(&file, judged)?);
    let names = named(points.iter().map(|p| p.judged.name.as_str()));
    if let Some(folder) = &arguments.output {
        remove_front(folder)?;
    }
    let mut shown = Vec::new();
    for (point, name) in points.iter().zip(names) {
        let mut point = point.clone();
        point.judged.name.clone_from(&name);
        let written = match &arguments.output {
            None => None,
            Some(folder) => {
                let path = folder.join(format!("{name}.toml"));
                let comment = format!("coil: {}; a point of the front of error against windability", file.model.name);
                let pattern = NamedPattern { name, pattern: point.judged.pattern.clone() };
                write_atomically(&path, print_pattern(&pattern, &[TomlComment::of(comment)]).as_bytes())?;
                path.file_name().map(|n| n.to_string_lossy().into_owned())
            }
        };
        shown.push(PointJson::of(&point, written));
    }
    if let Some(folder) = &arguments.output {
        write_atomically(&folder.join("pareto.csv"), &front_csv(&shown))?;
        let worst = chart(&file, &shown, "worst rate error", |p| Some(p.worst_rate_deg_per_h));
        write_atomically(&folder.join("pareto.svg"), worst.as_bytes())?;
        if file.tolerance.is_some() {
            let p95 = chart(&file, &shown, "P95 over built coils", |p| p.p95_rate_deg_per_h);
            write_atomically(&folder.join("pareto-p95.svg"), p95.as_bytes())?;
        }
        screen.note(&format!("wrote {}", folder.display()));
    }
    screen.answer(ParetoJson { model: file.model.name.clone(), seed, points: shown }, text)?;
    Ok(Ending::Done)
}

/// Points shown besides the knees.
const MOST_OTHERS: usize = 8;

/// Largest climbs that are searched one by one; any climb is searched besides.
const CLIMBS: [usize; 6] = [2, 3, 4, 5, 6, 8];

const LIMITED_RESTARTS: usize = 8;

/// One search of many: a class, and within it a limit of the climb.
#[derive(Debug, Clone, Copy)]
struct Part {
    class: WindabilityClass,
    climb: Climb,
}

#[derive(Debug, Clone, Copy)]
enum Climb {
    /// By the annealer over all samples.
    Unlimited,
    /// Over one of the sets of coils.
    Within { most_climb: Option<usize>, builds: usize },
}

impl Part {
    fn words(self) -> String {
        match self.climb {
            Climb::Unlimited => self.class.to_string(),
            Climb::Within { most_climb, builds } => {
                let climb = most_climb.map_or_else(|| "any climb".to_owned(), |most| format!("climbs up to {most}"));
                let whose = if builds == 0 { "as declared" } else { "as built" };
                format!("{}, {climb}, {whose}", self.class)
            }
        }
    }
}

fn parts(classes: &[WindabilityClass], climbs: &[Option<usize>], sets: usize) -> Vec<Part> {
    let of_class = |&class| {
        let within = climbs.iter().flat_map(move |&most_climb| {
            (0..sets).map(move |builds| Part { class, climb: Climb::Within { most_climb, builds } })
        });
        std::iter::once(Part { class, climb: Climb::Unlimited }).chain(within)
    };
    classes.iter().flat_map(of_class).collect()
}

fn interrupted(output: &Option<PathBuf>, screen: &Screen) -> Ending {
    screen.note(match output {
        Some(_) => "interrupted: the same command goes on from the parts that are done",
        None => "interrupted: with -o DIR the parts that are done would have been kept",
    });
    Ending::Interrupted
}

/// What a search of a class found; none if a signal came first.
fn candidates(
    evaluator: &Evaluator,
    file: &ModelFile,
    class: WindabilityClass,
    seed: u64,
    rounds: u64,
    stop: &StopFlag,
) -> Result<Option<Vec<Pattern>>, CliError> {
    let layers = file.model.coil.layers();
    let plan = Plan {
        seed,
        restarts_per_round: DEFAULT_RESTARTS_PER_ROUND,
        moves_per_restart: default_moves_per_restart(layers),
        rules: Rules { rounds, patience: rounds, moves: None, target: None },
        starts: Vec::new(),
    };
    let shared = evaluator.companions(class, &plan, &|| !stop.is_set())?;
    let Some(mut search) = evaluator.search(class, plan, None)? else { return Ok(None) };
    while search.advance() {
        if stop.is_set() {
            return Ok(None);
        }
    }
    let found = &search.state().found;
    let mut patterns = patterns(found);
    if let Some(best) = evaluator.best(class, found, &[])? {
        patterns.push(evaluator.improved(class, best, found, None)?.0.pattern);
    }
    patterns.extend(shared);
    Ok((!stop.is_set()).then_some(patterns))
}

/// What a search within limits found; none if a signal came first.
fn limited(
    evaluator: &Evaluator,
    builds: &SampledCoils,
    limits: Limits,
    seed: u64,
    stop: &StopFlag,
) -> Result<Option<Vec<Pattern>>, CliError> {
    let layers = evaluator.model.coil.layers();
    let plan = Plan {
        seed,
        restarts_per_round: LIMITED_RESTARTS,
        moves_per_restart: 4 * (layers * layers) as u64,
        rules: Rules { rounds: 1, patience: 1, moves: None, target: None },
        starts: Vec::new(),
    };
    let mut search = Optimisation::new(QuantileCost::new(builds.clone(), limits), plan);
    while search.advance() {
        if stop.is_set() {
            return Ok(None);
        }
    }
    let found = &search.state().found;
    Ok(Some(patterns(&found[..found.len().min(LIMITED_RESTARTS / 2)])))
}

fn patterns(found: &[Found]) -> Vec<Pattern> {
    let walked = |f: &Found| Pattern::new(f.segments.clone()).expect("a walk visits permutations only");
    found.iter().map(walked).collect()
}

/// The points with their 95 % quantiles, where the model states tolerances.
fn with_spreads(file: &ModelFile, judged: Vec<Judged>) -> Result<Vec<Point>, CliError> {
    let spreads = match &file.tolerance {
        None => vec![None; judged.len()],
        Some(spec) => {
            let patterns: Vec<Pattern> = judged.iter().map(|j| j.pattern.clone()).collect();
            let found = Coils::new(&file.model, &file.profiles, spec)?.p95_rad_per_s(&patterns)?;
            found.into_iter().map(Some).collect()
        }
    };
    let with = |(judged, p95_rad_per_s): (Judged, _)| Point::new(Judged { p95_rad_per_s, ..judged });
    Ok(judged.into_iter().zip(spreads).map(with).collect())
}

/// Names made distinct by a number where several points have the same.
fn named<'n>(names: impl Iterator<Item = &'n str>) -> Vec<String> {
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    names
        .map(|name| {
            let count = seen.entry(name).or_insert(0);
            *count += 1;
            if *count == 1 { name.to_owned() } else { format!("{name}-{count}") }
        })
        .collect()
}

fn chart(
    file: &ModelFile,
    points: &[PointJson],
    what: &str,
    error_deg_per_h: fn(&PatternJson) -> Option<f64>,
) -> String {
    let mut chart = Chart::new(format!("{}: {what} against largest climb", file.model.name))
        .x(Axis::linear("largest climb [layers]"))
        .y(Axis::log(format!("{what} [°/h]")));
    let mut captive: Vec<usize> = points.iter().map(|p| p.pattern.windability.captive).collect();
    captive.sort_unstable();
    captive.dedup();
    for count in captive {
        let of_count = points.iter().filter(|p| p.pattern.windability.captive == count);
        let place = |p: &PointJson| {
            let at = (p.pattern.windability.max_climb as f64, error_deg_per_h(&p.pattern)?);
            // The classics are what a reader knows: they bear their names.
            let classic = Classic::ALL.iter().any(|c| c.key() == p.pattern.name);
            Some((at, if classic { p.pattern.name.clone() } else { String::new() }))
        };
        let (places, labels) = of_count.filter_map(place).unzip();
        chart = chart.with(Series::points(format!("{count} captive"), places).labelled(labels));
    }
    chart.svg()
}

/// A point with at most this share of the error of all that are easier to wind is a knee.
const KNEE: f64 = 0.8;

/// Whether the point buys much: its error is well below that of every point that asks no more of the winding shop.
fn is_knee(point: &PointJson, points: &[PointJson]) -> bool {
    let effort = |p: &PointJson| [p.pattern.windability.captive, p.pattern.windability.max_climb, p.long_crossovers];
    let error = |p: &PointJson| p.pattern.worst_rate_deg_per_h;
    let is_easier = |p: &&PointJson| {
        effort(p) != effort(point) && effort(p).iter().zip(effort(point)).all(|(theirs, mine)| *theirs <= mine)
    };
    points.iter().filter(is_easier).all(|p| error(point) <= KNEE * error(p))
}

fn text(answer: &ParetoJson) -> String {
    let (knees, others): (Vec<&PointJson>, Vec<&PointJson>) =
        answer.points.iter().partition(|point| is_knee(point, &answer.points));
    let mut shown: Vec<Vec<String>> = Vec::new();
    let row = |p: &PointJson| {
        vec![
            p.pattern.name.clone(),
            format!("{:.4}", p.pattern.worst_rate_deg_per_h),
            p.pattern.p95_rate_deg_per_h.map_or_else(|| "–".to_owned(), |q| format!("{q:.4}")),
            p.pattern.windability.captive.to_string(),
            p.pattern.windability.max_climb.to_string(),
            p.long_crossovers.to_string(),
        ]
    };
    let mut merged = 0;
    for row in knees.iter().map(|p| row(p)).chain(others.iter().take(MOST_OTHERS).map(|p| row(p))) {
        // The same but for the name.
        if shown.iter().any(|known| known[1..] == row[1..]) {
            merged += 1;
        } else {
            shown.push(row);
        }
    }
    let left_out = merged + others.len().saturating_sub(MOST_OTHERS);
    let more = if left_out > 0 {
        format!("\n{left_out} further points are in --format json and, with -o, in pareto.csv\n")
    } else {
        String::new()
    };
    format!(
        "{}: the best found; none of these is beaten in every respect by another known one\n\n{}{more}",
        answer.model,
        table(&["pattern", "worst °/h", "P95 °/h", "captive", "climb", "crossovers > 1"], shown)
    )
}
