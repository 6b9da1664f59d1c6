//! The report of a search: one page that opens offline.

use maud::{Markup, html};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use thiserror::Error;

use super::cross_section::cross_section;
use super::page::{figure, page};
use super::plot::{Axis, Chart, Mark, Series};
use crate::io::run_reader::{Run, RunPattern};
use crate::io::schedule_file::sha256_hex;
use crate::pattern::{Pattern, PatternError};
use crate::profile::Profile;
use crate::rate::RateModel;
use crate::search::worst_case::{SearchError, SolvedProfiles};
use crate::units::{REFERENCE_TEMPERATURE_K, c_per_h_from_k_per_s, deg_per_h_from_rad_per_s, min_from_s};

#[derive(Debug, Error, Clone, PartialEq)]
pub enum ReportError {
    #[error(transparent)]
    Search(#[from] SearchError),
    #[error("the summary holds a pattern that is none: {0}")]
    Pattern(#[from] PatternError),
    #[error("the profile {name} of the summary is not one of model.toml: run the search again")]
    Profile { name: String },
}

/// # Errors
/// A summary that does not fit its model.
pub fn search_page(run: &Run) -> Result<String, ReportError> {
    let summary = &run.summary;
    let best = Pattern::new(summary.best.segments.clone())?;
    let qua = summary.baselines.iter().find(|p| p.name == "qua");
    let title = format!("Winding pattern for {}", summary.model);
    let body = html! {
        h1 { (title) }
        p.big { (summary.statement) }
        (facts(run))
        h2 { "Patterns compared" }
        (baselines(run))
        (figure(&relative_bars(run), "Worst rate error over all listed and sampled profiles, and, where it exists, the guaranteed worst over every profile within the model's largest ramp."))
        h2 { "Cross-sections" }
        div.pair {
            (figure(&cross_section(&format!("{}: {:.4} °/h", summary.best.name, summary.best.worst_rate_deg_per_h), &best), "The best pattern found."))
            @if let Some(qua) = qua {
                (figure(&cross_section(&format!("qua: {:.4} °/h", qua.worst_rate_deg_per_h), &Pattern::new(qua.segments.clone())?), "The quadrupole."))
            }
        }
        h2 { "Rate error over time" }
        @for (svg, caption) in over_time(run)? { (figure(&svg, &caption)) }
        h2 { "Tolerance" }
        (figure(&tolerance(run, &best)?, &format!("{TOLERANCE_COILS} coils, the turns of each layer off by up to half a turn (uniform, independent; seed {}), under the best pattern's worst profile.", summary.seed)))
        h2 { "What it costs the winding shop" }
        (figure(&trade_off(run), "Every step to the left is an easier crossover, every step down a smaller error."))
        h2 { "How the search went" }
        (figure(&convergence(run), &format!("Best value known after so many judged moves; {} rounds, ended by: {}.", summary.rounds, summary.stopped_by)))
        (certificate(run))
        h2 { "Inputs" }
        details { summary { "run.toml" } pre { (run.run_toml) } }
        details { summary { "model.toml" } pre { (run.file.source) } }
        (sources())
    };
    Ok(page(&title, &body))
}

fn facts(run: &Run) -> Markup {
    let summary = &run.summary;
    let coil = &run.file.model.coil;
    let gain = summary.improvement_over_qua.map_or_else(
        || "no quadrupole fits this layer count".to_owned(),
        |gain| format!("{gain:.3} (QUA's value over the best pattern's)"),
    );
    let rows = [
        (
            "Coil",
            format!(
                "{} layers, {:.1} m of fibre, mean diameter {:.1} mm",
                coil.layers(),
                coil.length_m(),
                crate::units::mm_from_m(coil.mean_diameter_m())
            ),
        ),
        ("Objective", format!("{}, winding class {}", summary.objective, summary.windability)),
        (
            "Best pattern, innermost layer first",
            summary.best.segments.iter().map(ToString::to_string).collect::<Vec<_>>().join(" "),
        ),
        (
            "Worst rate error",
            format!(
                "{:.4} °/h under {} at {:.1} s",
                summary.best.worst_rate_deg_per_h, summary.best.worst_profile, summary.best.worst_time_s
            ),
        ),
        ("Guaranteed worst", guaranteed_words(&summary.best)),
        ("Better than QUA by", gain),
        ("Seed, moves judged", format!("{}, {}", summary.seed, summary.evaluations)),
    ];
    html! { dl.facts { @for (name, value) in rows { dt { (name) } dd { (value) } } } }
}

fn guaranteed_words(pattern: &RunPattern) -> String {
    pattern
        .guaranteed_worst_rate_deg_per_h
        .map_or_else(|| "no bound over all profiles (the model is not linear)".to_owned(), |g| format!("{g:.4} °/h"))
}

fn all(run: &Run) -> impl Iterator<Item = &RunPattern> {
    run.summary.baselines.iter().chain(std::iter::once(&run.summary.best))
}

fn baselines(run: &Run) -> Markup {
    let qua = run.summary.baselines.iter().find(|p| p.name == "qua").map(|p| p.worst_rate_deg_per_h);
    html! {
        div.scroll { table {
            thead { tr {
                th.word { "Pattern" } th { "Worst [°/h]" } th { "Relative to QUA" } th { "Guaranteed worst [°/h]" } th.word { "Worst profile" }
                th { "At [s]" } th.word { "Class" } th { "Reels" } th { "Largest climb [layers]" }
            } }
            tbody { @for pattern in all(run) { tr.best[pattern.name == run.summary.best.name] {
                td.word { (pattern.name) }
                td { (format!("{:.4}", pattern.worst_rate_deg_per_h)) }
                td { (qua.filter(|q| *q > 0.0).map_or("–".to_owned(), |q| format!("{:.3}", pattern.worst_rate_deg_per_h / q))) }
                td { (pattern.guaranteed_worst_rate_deg_per_h.map_or("–".to_owned(), |g| format!("{g:.4}"))) }
                td.word { (pattern.worst_profile) }
                td { (format!("{:.1}", pattern.worst_time_s)) }
                td.word { (pattern.windability.class) }
                td { (pattern.windability.reels) }
                td { (pattern.windability.max_climb) }
            } } }
        } }
    }
}

fn relative_bars(run: &Run) -> String {
    let values: Vec<f64> = all(run).map(|p| p.worst_rate_deg_per_h).collect();
    let guaranteed: Vec<f64> = all(run).map(|p| p.guaranteed_worst_rate_deg_per_h.unwrap_or(f64::NAN)).collect();
    let mut chart = Chart::new("Worst rate error of each pattern")
        .x(Axis::linear("worst |rate error| [°/h]"))
        .categories(all(run).map(|p| p.name.clone()))
        .with(Series::bars("over the model's profiles", &values));
    if guaranteed.iter().any(|g| g.is_finite()) {
        chart = chart.with(Series::bars("guaranteed, over all profiles", &guaranteed));
    }
    if let Some(qua) = run.summary.baselines.iter().find(|p| p.name == "qua") {
        chart = chart.mark(Mark::vertical("QUA", qua.worst_rate_deg_per_h));
    }
    chart.svg()
}

/// For the profile that is worst for the best pattern and the first listed one: the profile, and every pattern's error.
fn over_time(run: &Run) -> Result<Vec<(String, String)>, ReportError> {
    let profiles = run.file.profiles.profiles();
    let worst_name = &run.summary.best.worst_profile;
    let worst = profiles.iter().find(|p| p.name() == worst_name);
    // A guaranteed worst case may be attained by a profile that is no member of the list.
    let mut shown: Vec<&Profile> = worst.into_iter().collect();
    shown.extend(profiles.first().filter(|first| first.name() != worst_name));
    if shown.is_empty() {
        return Err(ReportError::Profile { name: worst_name.clone() });
    }
    let mut figures = Vec::new();
    for profile in shown {
        let solved = SolvedProfiles::new(&run.file.model, std::slice::from_ref(profile))?;
        let history = &solved.profiles()[0].history;
        let mut chart = Chart::new(format!("Rate error under {}", profile.name()))
            .x(Axis::linear("time [min]"))
            .y(Axis::linear("rate error [°/h]"));
        // The best one last, on top of the others.
        let baselines = run.summary.baselines.iter().filter(|p| p.name != run.summary.best.name);
        let patterns: Vec<&RunPattern> = baselines.chain(std::iter::once(&run.summary.best)).collect();
        for found in patterns {
            let pattern = Pattern::new(found.segments.clone())?;
            let model = RateModel::new(&run.file.model, &pattern, &[]).map_err(SearchError::from)?;
            let rates = model.series_rad_per_s(history);
            let points = history.times_s.iter().zip(rates).map(|(t, r)| (min_from_s(*t), deg_per_h_from_rad_per_s(r)));
            chart = chart.with(Series::line(&found.name, points.collect()));
        }
        let what = if profile.name() == worst_name {
            "The profile under which the best pattern is at its worst."
        } else {
            "The first profile of the model."
        };
        figures.push((chart.svg(), what.to_owned()));
        figures.push((profile_chart(profile), format!("What drives it: {}, from a steady state.", profile.name())));
    }
    Ok(figures)
}

const TOLERANCE_COILS: usize = 300;
const TOLERANCE_BINS: usize = 24;
/// Largest error of a layer's turn count [turns].
const TURN_ERROR: f64 = 0.5;

/// How the best pattern's worst rate error spreads when turns are miscounted.
fn tolerance(run: &Run, best: &Pattern) -> Result<String, ReportError> {
    let profiles = run.file.profiles.profiles();
    let worst = profiles.iter().find(|p| p.name() == run.summary.best.worst_profile).or(profiles.first());
    let Some(profile) = worst else {
        return Err(ReportError::Profile { name: run.summary.best.worst_profile.clone() });
    };
    let solved = SolvedProfiles::new(&run.file.model, std::slice::from_ref(profile))?;
    let history = &solved.profiles()[0].history;
    let mut random = ChaCha8Rng::seed_from_u64(run.summary.seed);
    let mut found = Vec::with_capacity(TOLERANCE_COILS);
    for _ in 0..TOLERANCE_COILS {
        let mut model = run.file.model.clone();
        let turns = model.coil.turns().iter().map(|t| t + TURN_ERROR * (2.0 * random.random::<f64>() - 1.0));
        model.coil = model.coil.with_turns(turns.collect()).map_err(SearchError::from)?;
        let rates = RateModel::new(&model, best, &[]).map_err(SearchError::from)?.series_rad_per_s(history);
        found.push(deg_per_h_from_rad_per_s(rates.iter().fold(0.0, |most: f64, r| most.max(r.abs()))));
    }
    let (low, high) = found.iter().fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(*v), h.max(*v)));
    let width = ((high - low) / TOLERANCE_BINS as f64).max(f64::MIN_POSITIVE);
    let edges: Vec<f64> = (0..=TOLERANCE_BINS).map(|i| low + i as f64 * width).collect();
    let mut counts = vec![0.0; TOLERANCE_BINS];
    for value in &found {
        counts[(((value - low) / width) as usize).min(TOLERANCE_BINS - 1)] += 1.0;
    }
    Ok(Chart::new("Worst rate error of coils as wound")
        .size(720, 280)
        .x(Axis::linear("worst |rate error| [°/h]"))
        .y(Axis::linear("coils [1]"))
        .with(Series::histogram("", &edges, &counts))
        .mark(Mark::vertical("as designed", run.summary.best.worst_rate_deg_per_h))
        .svg())
}

fn profile_chart(profile: &Profile) -> String {
    let boundary = profile.temperature(REFERENCE_TEMPERATURE_K);
    let times_min = boundary.knots().iter().map(|t| min_from_s(*t));
    let rates: Vec<f64> = profile.pieces().iter().map(|p| c_per_h_from_k_per_s(p.rate_k_per_s)).collect();
    let held = rates.iter().copied().chain(rates.last().copied());
    Chart::new(format!("Ramp rate of {}", profile.name()))
        .size(720, 220)
        .x(Axis::linear("time [min]"))
        .y(Axis::linear("boundary's rate [°C/h]").reaching(0.0))
        .with(Series::step("", times_min.zip(held).collect()))
        .svg()
}

fn trade_off(run: &Run) -> String {
    let points = all(run).map(|p| (p.windability.max_climb as f64, p.worst_rate_deg_per_h)).collect();
    let labels = all(run).map(|p| p.name.clone()).collect();
    Chart::new("Rate error against the largest crossover")
        .x(Axis::linear("largest climb of a crossover [layers]").reaching(0.0))
        .y(Axis::log("worst |rate error| [°/h]"))
        .with(Series::points("patterns", points).labelled(labels))
        .svg()
}

fn convergence(run: &Run) -> String {
    let points: Vec<(f64, f64)> = run.history.iter().map(|h| (h.evaluations as f64, h.best_deg_per_h)).collect();
    let mut chart = Chart::new("Convergence of the search")
        .x(Axis::linear("moves judged [1]").reaching(0.0))
        .y(Axis::linear("best objective [°/h]"))
        .with(if points.len() > 1 {
            Series::step("best so far", points)
        } else {
            Series::points("best so far", points)
        });
    if let Some(bound) = run.summary.proof.lower_bound_deg_per_h {
        chart = chart.mark(Mark::horizontal("proved lower bound", bound));
    }
    chart.svg()
}

fn certificate(run: &Run) -> Markup {
    let proof = &run.summary.proof;
    let bound = proof.lower_bound_deg_per_h.map_or(String::new(), |b| format!(" Lower bound: {b:.6} °/h."));
    let words = match proof.status.as_str() {
        "optimal" => "The best pattern is proved optimal in its class.",
        "gap" => "The class has been searched up to the gap between best value and lower bound.",
        _ => "Nothing is proved about better patterns; coilwright exact searches for a proof.",
    };
    html! {
        h2 { "Certificate" }
        p { (words) (bound) }
        dl.facts {
            dt { "Model file, SHA-256" } dd { code { (sha256_hex(&run.file.source)) } }
            dt { "Program" } dd { (concat!("coilwright ", env!("CARGO_PKG_VERSION"))) }
        }
    }
}

fn sources() -> Markup {
    html! {
        h2 { "Sources" }
        ul {
            li { "Rate error: Shupe, Appl. Opt. 19, 654 (1980); Yan, Lan, Jian, Acta Optica Sinica (1998), Eq. (4), corrected." }
            li { "Windings: cylindrical, symmetric, dipole and quadrupole after Yan et al.; octupole and 16-pole continue the pattern." }
            li { "The worst case is a maximum refined in time, both one-sided limits at the profiles' break points included." }
            li { "The guaranteed worst case is the integral of the absolute impulse response times the largest ramp." }
        }
    }
}
