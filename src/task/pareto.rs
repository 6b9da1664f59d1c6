//! How much error each step of winding effort buys: one search a class and limit of the climb, and the front of all.

use std::collections::BTreeMap;
use std::path::Path;

use crate::io::json::pareto::{ParetoJson, PointJson};
use crate::io::model::ModelFile;
use crate::io::write::pareto_parts::Front;
use crate::pattern::Pattern;
use crate::pattern::windability::WindabilityClass;
use crate::search::anneal::limits::WindingLimits;
use crate::search::anneal::quantile::QuantileCost;
use crate::search::anneal::rounds::{
    DEFAULT_RESTARTS_PER_ROUND, FoundPattern, Optimisation, Plan, Rounds, Rules, default_moves_per_restart,
};
use crate::search::companions::MOST_CAPTIVE;
use crate::search::compile::Whose;
use crate::search::cost::guaranteed::UnitStep;
use crate::search::cost::objective::Objective;
use crate::search::cost::sampled_coils::SampledCoils;
use crate::search::cost::tolerance::Coils;
use crate::search::cost::worst_case::SolvedProfiles;
use crate::search::evaluator::{Evaluator, Judged};
use crate::search::pareto::{ParetoPoint, front, is_knee};

use super::{Observer, TaskError};

/// The most captive reels that are tried one by one, and rounds of restarts a class.
pub(crate) const DEFAULT_MOST_CAPTIVE: u8 = MOST_CAPTIVE;
pub(crate) const DEFAULT_ROUNDS: u64 = 3;

/// What is to be weighed.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// The coil and its profiles.
    pub model: &'a ModelFile,
    /// Of the searches.
    pub seed: u64,
    /// Any number is tried besides.
    pub most_captive: u8,
    /// Of each search, at most.
    pub rounds: u64,
    /// Where what is done is kept, so that the same request goes on after an interruption.
    pub kept_in: Option<&'a Path>,
}

impl<'a> Request<'a> {
    /// The model's own seed, the usual effort; nothing is kept.
    pub fn new(model: &'a ModelFile) -> Self {
        let (most_captive, rounds) = (DEFAULT_MOST_CAPTIVE, DEFAULT_ROUNDS);
        Self { model, seed: model.search.seed, most_captive, rounds, kept_in: None }
    }
}

/// The front, smallest error first, each point under a name of its own.
#[derive(Debug)]
pub struct Answer {
    pub(crate) points: Vec<ParetoPoint>,
    model: String,
    seed: u64,
}

impl Answer {
    /// As the program prints it; `files` are the pattern files that were written, one a point, or none.
    pub fn document(&self, files: Option<&[String]>) -> ParetoJson {
        let file = |index: usize| files.and_then(|files| files.get(index).cloned());
        let point =
            |(index, point): (usize, &ParetoPoint)| PointJson::of(point, is_knee(point, &self.points), file(index));
        let points = self.points.iter().enumerate().map(point).collect();
        ParetoJson { model: self.model.clone(), seed: self.seed, status: "best found", points }
    }
}

/// Searches part by part; `None` if the observer ended it.
///
/// # Errors
/// A model that cannot be solved; parts that cannot be kept.
pub fn run(request: &Request, observer: &dyn Observer) -> Result<Option<Answer>, TaskError> {
    let (file, seed) = (&request.model.clone().for_search(), request.seed);
    let solved = SolvedProfiles::new(&file.model, &file.profiles.profiles())?;
    let unit_step = UnitStep::new(&file.model, file.profiles.max_rate_k_per_s).ok();
    let evaluator = Evaluator {
        model: &file.model,
        solved: &solved,
        objective: Objective::WorstRate,
        unit_step: unit_step.as_ref(),
        profiles: &file.profiles,
        tolerance: file.tolerance.as_ref(),
    };
    let mut judged = evaluator.baselines()?;
    let captive = (1..=usize::from(request.most_captive)).map(WindabilityClass::Captive);
    let classes: Vec<WindabilityClass> =
        std::iter::once(WindabilityClass::Standard).chain(captive).chain([WindabilityClass::Any]).collect();
    let climbs: Vec<Option<usize>> =
        CLIMBS.into_iter().filter(|c| *c < file.model.coil.layers()).map(Some).chain([None]).collect();
    let mut whose = vec![evaluator.sampled_coils(Whose::Declared, WindabilityClass::Any, seed)?];
    if file.tolerance.is_some() {
        whose.push(evaluator.sampled_coils(Whose::Built, WindabilityClass::Any, seed)?);
    }
    let kept = request.kept_in.map(|folder| Front { folder, file, seed, rounds: request.rounds });
    let parts = parts(&classes, &climbs, whose.len());
    for (number, part) in parts.iter().enumerate() {
        let words = part.words();
        let found = match kept.as_ref().and_then(|front| front.read_part(number + 1, &words)) {
            Some(found) => found,
            None => {
                let searched = match part.climb {
                    Climb::Unlimited => candidates(&evaluator, file, part.class, seed, request.rounds, observer)?,
                    Climb::Within { most_climb, builds } => {
                        let limits = WindingLimits { class: part.class, most_climb };
                        limited(&evaluator, &whose[builds], limits, seed, observer)?
                    }
                };
                let Some(found) = searched else { return Ok(None) };
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
        observer.at((number + 1) as f64 / parts.len() as f64, &words);
    }
    if let Some(front) = &kept {
        front.keep_parts(parts.len())?;
    }
    let mut points = front(&with_spreads(file, judged)?);
    // Knees first; stable, so that each part keeps its order by error.
    let all = points.clone();
    points.sort_by_key(|point| !is_knee(point, &all));
    let names = named(points.iter().map(|p| p.judged.name.as_str()));
    for (point, name) in points.iter_mut().zip(names) {
        point.judged.name = name;
    }
    Ok(Some(Answer { points, model: file.model.name.clone(), seed }))
}

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

/// What a search of a class found; none if a signal came first.
fn candidates(
    evaluator: &Evaluator,
    file: &ModelFile,
    class: WindabilityClass,
    seed: u64,
    rounds: u64,
    observer: &dyn Observer,
) -> Result<Option<Vec<Pattern>>, TaskError> {
    let layers = file.model.coil.layers();
    let plan = Plan {
        seed,
        restarts_per_round: DEFAULT_RESTARTS_PER_ROUND,
        moves_per_restart: default_moves_per_restart(layers),
        rules: Rules { rounds, patience: rounds, moves: None, target: None },
        starts: Vec::new(),
    };
    let shared = evaluator.companions(class, &plan, &|| observer.goes_on())?;
    let Some(mut search) = evaluator.search(class, plan, None)? else { return Ok(None) };
    while search.advance() {
        if !observer.goes_on() {
            return Ok(None);
        }
    }
    let mut patterns = patterns(&search.state().found);
    let found = evaluator.gathered(search.as_ref(), class, &shared, false, &|| true);
    if let Some(best) = evaluator.best(class, &found, &[])? {
        patterns.push(evaluator.improved_beyond(&shared, class, best, &found, None)?.pattern);
    }
    patterns.extend(shared);
    Ok(observer.goes_on().then_some(patterns))
}

/// What a search within limits found; none if a signal came first.
fn limited(
    evaluator: &Evaluator,
    builds: &SampledCoils,
    limits: WindingLimits,
    seed: u64,
    observer: &dyn Observer,
) -> Result<Option<Vec<Pattern>>, TaskError> {
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
        if !observer.goes_on() {
            return Ok(None);
        }
    }
    let found = &search.state().found;
    Ok(Some(patterns(&found[..found.len().min(LIMITED_RESTARTS / 2)])))
}

fn patterns(found: &[FoundPattern]) -> Vec<Pattern> {
    let walked = |f: &FoundPattern| Pattern::new(f.segments.clone()).expect("a walk visits permutations only");
    found.iter().map(walked).collect()
}

/// The points with their 95 % quantiles, where the model states tolerances.
fn with_spreads(file: &ModelFile, judged: Vec<Judged>) -> Result<Vec<ParetoPoint>, TaskError> {
    let spreads = match &file.tolerance {
        None => vec![None; judged.len()],
        Some(spec) => {
            let patterns: Vec<Pattern> = judged.iter().map(|j| j.pattern.clone()).collect();
            let found = Coils::new(&file.model, &file.profiles, spec)?.p95_rad_per_s(&patterns)?;
            found.into_iter().map(Some).collect()
        }
    };
    let with = |(judged, p95_rad_per_s): (Judged, _)| ParetoPoint::new(Judged { p95_rad_per_s, ..judged });
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

#[cfg(feature = "report")]
mod folder {
    use super::*;
    use crate::io::folder::Replacement;
    use crate::io::json::PatternJson;
    use crate::io::json::pareto::front_csv;
    use crate::io::model::NamedPattern;
    use crate::io::read::pattern_file::print_pattern;
    use crate::io::write::pareto_parts::files_of_front;
    use crate::pattern::classic::Classic;
    use crate::report::plot::{Axis, Chart, ChartSeries};
    use crate::text::sink::TomlComment;

    impl Answer {
        /// Writes the table, the pictures and one pattern file a point in place of what an earlier front left.
        ///
        /// # Errors
        /// Files that cannot be written.
        pub fn write(&self, folder: &Path, file: &ModelFile) -> Result<ParetoJson, TaskError> {
            let mut replacement = Replacement::of(folder);
            let mut files = Vec::with_capacity(self.points.len());
            for point in &self.points {
                let name = point.judged.name.clone();
                let file_name = format!("{name}.toml");
                let comment = format!("coil: {}; a point of the front of error against windability", file.model.name);
                let pattern = NamedPattern { name, pattern: point.judged.pattern.clone() };
                let text = print_pattern(&pattern, &[TomlComment::of(comment)]);
                replacement.add(&file_name, text.as_bytes())?;
                files.push(file_name);
            }
            let document = self.document(Some(&files));
            let shown = &document.points;
            replacement.add_list("pareto.csv", &front_csv(shown))?;
            let worst = chart(file, shown, "worst rate error", |p| Some(p.worst_rate_deg_per_h));
            replacement.add("pareto.svg", worst.as_bytes())?;
            if file.tolerance.is_some() {
                let p95 = chart(file, shown, "P95 over built coils", |p| p.p95_rate_deg_per_h);
                replacement.add("pareto-p95.svg", p95.as_bytes())?;
            }
            let former = files_of_front(folder);
            replacement.commit(&former.iter().map(String::as_str).collect::<Vec<_>>())?;
            Ok(document)
        }
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
            chart = chart.with(ChartSeries::points(format!("{count} captive"), places).labelled(labels));
        }
        chart.svg()
    }
}
