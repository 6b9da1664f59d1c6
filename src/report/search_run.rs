//! The report of a search: one page that opens offline.

use maud::{Markup, html};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use thiserror::Error;

use super::cross_section::cross_section;
use super::page::{figure, page};
use super::plot::{Axis, Chart, ChartSeries, Mark};
use super::words;
use crate::io::files::sha256_hex;
use crate::io::read::run_reader::{Run, RunPattern};
use crate::pattern::{Pattern, PatternError};
use crate::profile::Profile;
use crate::rate::RateModel;
use crate::search::cost::tolerance::{Coils, Measure, ToleranceError, ToleranceSpec, measure, study};
use crate::search::cost::worst_case::{SearchError, SolvedProfiles};
use crate::units::{
    REFERENCE_TEMPERATURE_K, c_per_h_from_k_per_s, deg_per_h_from_rad_per_s, min_from_s, percent_from_fraction,
};

#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum ReportError {
    #[error(transparent)]
    Search(#[from] SearchError),
    #[error(transparent)]
    Tolerance(#[from] ToleranceError),
    #[error("the summary holds a pattern that is none: {0}")]
    Pattern(#[from] PatternError),
    #[error("the profile {name} of the summary is not one of model.toml: run the search again")]
    Profile { name: String },
}

/// The page; `explorer` is the file beside it in which the model can be tried, if there is one.
///
/// # Errors
/// A summary that does not fit its model.
pub(crate) fn search_page(run: &Run, explorer: Option<&str>) -> Result<String, ReportError> {
    let summary = &run.summary;
    let best = Pattern::new(summary.best.segments.clone())?;
    let qua = summary.baselines.iter().find(|p| p.name == "qua");
    let title = format!("Winding pattern for {}", summary.model);
    let body = html! {
        h1 { (title) }
        @if let Some(recommendation) = &summary.recommendation { p.big { (recommendation.sentence) } } @else { p.big { (summary.statement) } }
        (figure(&relative_bars(run), &about_bars(run)))
        @if let Some(recommendation) = &summary.recommendation {
            ul { @for reason in &recommendation.reasons { li { (reason) } } }
            p { (summary.statement) }
        }
        @if let Some(explorer) = explorer {
            p.screen { a href=(explorer) { "Try other windings by hand in the explorer" } ": move layers, and see at once what evaluate says of them." }
        }
        @if let Some(former) = &summary.compared_with { p { b { (former.statement) } } }
        (facts(run))
        h2 { "Patterns compared" }
        (baselines(run))
        (words::of_windings())
        h2 { "Cross-sections" }
        div.pair {
            (figure(&cross_section(&format!("{}: {:.4} °/h", summary.best.name, summary.best.worst_rate_deg_per_h), &best), "The best pattern found."))
            @if let Some(qua) = qua {
                (figure(&cross_section(&format!("qua: {:.4} °/h", qua.worst_rate_deg_per_h), &Pattern::new(qua.segments.clone())?), "The quadrupole."))
            }
        }
        h2 { "Rate error over time" }
        div.two { @for (svg, caption) in over_time(run)? { (figure(&svg, &caption)) } }
        @let (tolerated, about_tolerance) = tolerance(run, &best)?;
        @let (traded, about_trade_off) = trade_off(run);
        div.two {
            section { h2 { "Tolerance" } (figure(&tolerated, &about_tolerance)) }
            section { h2 { "What it costs the winding shop" } (figure(&traded, &about_trade_off)) }
        }
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
        ("95 % of built coils stay below", p95_words(&summary.best)),
        ("Guaranteed worst", guaranteed_words(&summary.best)),
        ("Better than QUA by", gain),
        ("Seed, moves judged", format!("{}, {}", summary.seed, summary.evaluations)),
    ];
    html! { dl.facts { @for (name, value) in rows { @if !value.is_empty() { dt { (name) } dd { (value) } } } } }
}

/// Empty where the search was not over built coils.
fn p95_words(pattern: &RunPattern) -> String {
    pattern.p95_rate_deg_per_h.map_or_else(String::new, |p95| format!("{p95:.4} °/h"))
}

fn guaranteed_words(pattern: &RunPattern) -> String {
    pattern
        .guaranteed_worst_rate_deg_per_h
        .map_or_else(|| "no bound over all profiles (the model is not linear)".to_owned(), |g| format!("{g:.4} °/h"))
}

pub(super) fn all(run: &Run) -> impl Iterator<Item = &RunPattern> {
    run.summary.baselines.iter().chain(std::iter::once(&run.summary.best))
}

fn baselines(run: &Run) -> Markup {
    let qua = run.summary.baselines.iter().find(|p| p.name == "qua").map(|p| p.worst_rate_deg_per_h);
    let is_over_coils = run.summary.best.p95_rate_deg_per_h.is_some();
    html! {
        div.scroll { table {
            thead { tr {
                th.word { "Pattern" } th { "Worst [°/h]" } th { "Relative to QUA" }
                @if is_over_coils { th { "P95 of built coils [°/h]" } }
                th { "Guaranteed worst [°/h]" } th.word { "Worst profile" }
                th { "At [s]" } th.word { "Class" } th { "Reels" } th { "Largest climb [layers]" }
            } }
            tbody { @for pattern in all(run) { tr.best[pattern.name == run.summary.best.name] {
                td.word { (pattern.name) }
                td { (format!("{:.4}", pattern.worst_rate_deg_per_h)) }
                td { (qua.filter(|q| *q > 0.0).map_or("–".to_owned(), |q| format!("{:.3}", pattern.worst_rate_deg_per_h / q))) }
                @if is_over_coils { td { (pattern.p95_rate_deg_per_h.map_or("–".to_owned(), |p| format!("{p:.4}"))) } }
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

/// Bars that differ by more than this factor stand on a logarithmic axis, so that the shortest can be read.
const LINEAR_UP_TO: f64 = 20.0;

fn relative_bars(run: &Run) -> String {
    let of = |value: fn(&RunPattern) -> Option<f64>| -> Vec<f64> {
        all(run).map(|p| value(p).unwrap_or(f64::NAN)).collect()
    };
    let bars = [
        ("over the model's profiles", of(|p| Some(p.worst_rate_deg_per_h))),
        ("95 % of built coils stay below", of(|p| p.p95_rate_deg_per_h)),
        ("guaranteed, over all profiles", of(|p| p.guaranteed_worst_rate_deg_per_h)),
    ];
    let shown = bars.into_iter().filter(|(_, values)| values.iter().any(|v| v.is_finite()));
    let shown: Vec<(&str, Vec<f64>)> = shown.collect();
    let positive = || shown.iter().flat_map(|(_, values)| values).copied().filter(|v| *v > 0.0);
    let is_wide = positive().fold(0.0, f64::max) > LINEAR_UP_TO * positive().fold(f64::INFINITY, f64::min);
    let axis = if is_wide { Axis::log } else { Axis::linear };
    let mut chart = Chart::new("Worst rate error of each pattern")
        .size(860, 240)
        .x(axis("worst |rate error| [°/h]".to_owned()))
        .categories(all(run).map(|p| p.name.clone()));
    for (name, values) in shown {
        chart = chart.with(ChartSeries::bars(name, &values));
    }
    if let Some(qua) = run.summary.baselines.iter().find(|p| p.name == "qua") {
        chart = chart.mark(Mark::vertical("QUA", qua.worst_rate_deg_per_h));
    }
    chart.svg_to_read()
}

fn about_bars(run: &Run) -> String {
    let mut words = "Worst rate error over all listed and sampled profiles".to_owned();
    if run.summary.best.p95_rate_deg_per_h.is_some() {
        words += "; what 95 % of coils as built stay below, which is what was searched";
    }
    if all(run).any(|p| p.guaranteed_worst_rate_deg_per_h.is_some()) {
        words += "; the guaranteed worst over every profile within the model's largest ramp";
    }
    words + "."
}

/// For the profile that is worst for the best pattern and the first listed one: the profile, and every pattern's error.
fn over_time(run: &Run) -> Result<Vec<(String, String)>, ReportError> {
    let profiles = run.file.profiles.profiles();
    let worst_name = &run.summary.best.worst_profile;
    let worst = profiles.iter().find(|p| p.name() == worst_name);
    // A guaranteed worst case may be attained by a profile that is no member of the list.
    let mut shown: Vec<&Profile> = worst.into_iter().collect();
    let others = all(run).filter_map(|p| profiles.iter().find(|profile| profile.name() == p.worst_profile));
    for profile in others.chain(profiles.first()) {
        if !shown.iter().any(|known| known.name() == profile.name()) {
            shown.push(profile);
        }
    }
    if shown.is_empty() {
        return Err(ReportError::Profile { name: worst_name.clone() });
    }
    let mut figures = Vec::new();
    for profile in shown {
        let solved = SolvedProfiles::new(&run.file.model, std::slice::from_ref(profile))?;
        let history = &solved.profiles()[0].history;
        // The best one last, on top of the others.
        let baselines = run.summary.baselines.iter().filter(|p| p.name != run.summary.best.name);
        let patterns: Vec<&RunPattern> = baselines.chain(std::iter::once(&run.summary.best)).collect();
        let mut series = Vec::with_capacity(patterns.len());
        for found in patterns {
            let pattern = Pattern::new(found.segments.clone())?;
            let model = RateModel::new(&run.file.model, &pattern, &[]).map_err(SearchError::from)?;
            let rates: Vec<f64> = model.series_rad_per_s(history).into_iter().map(deg_per_h_from_rad_per_s).collect();
            series.push((found.name.as_str(), rates));
        }
        let times_min: Vec<f64> = history.times_s.iter().map(|t| min_from_s(*t)).collect();
        let (chart, scale) = on_a_readable_scale(profile.name(), &times_min, &series);
        let sufferers: Vec<&str> =
            all(run).filter(|p| p.worst_profile == profile.name()).map(|p| p.name.as_str()).collect();
        let what = if sufferers.is_empty() {
            "The first profile of the model; no pattern is at its worst under it.".to_owned()
        } else {
            format!("At their worst under this profile: {}.", sufferers.join(", "))
        };
        figures.push((chart.svg_to_read(), what + &scale));
        figures.push((profile_chart(profile), format!("What drives it: {}, from a steady state.", profile.name())));
    }
    Ok(figures)
}

/// A logarithmic scale reaches this far below the largest error of the pattern that has the smallest.
const SHOWN_BELOW: f64 = 300.0;

/// Sizes of patterns' errors over time, on a scale on which the best of them can be read; what is to be said of the scale.
pub(super) fn on_a_readable_scale(profile: &str, times_min: &[f64], series: &[(&str, Vec<f64>)]) -> (Chart, String) {
    let largest = |rates: &[f64]| rates.iter().fold(0.0, |most: f64, r| most.max(r.abs()));
    let tops = series.iter().map(|(_, rates)| largest(rates)).filter(|top| *top > 0.0);
    let floor = tops.fold(f64::INFINITY, f64::min).min(f64::MAX) / SHOWN_BELOW;
    let mut chart = Chart::new(format!("Size of the rate error under {profile}"))
        .x(Axis::linear("time [min]"))
        .y(Axis::sizes("|rate error| [°/h]", floor));
    for (name, rates) in series {
        let points = times_min.iter().zip(rates).map(|(t, rate)| (*t, *rate));
        chart = chart.with(ChartSeries::line(*name, points.collect()));
    }
    (chart, format!(" What is below {floor:.1e} °/h is drawn there."))
}

const TOLERANCE_COILS: usize = 300;
const TOLERANCE_BINS: usize = 24;
/// Largest error of a layer's turn count [turns].
const TURN_ERROR: f64 = 0.5;

/// How the best pattern's worst rate error spreads over coils as built, with what is drawn.
fn tolerance(run: &Run, best: &Pattern) -> Result<(String, String), ReportError> {
    match &run.file.tolerance {
        Some(declared) => declared_tolerance(run, best, declared),
        None => Ok((
            turn_tolerance(run, best)?,
            format!(
                "The model file has no [tolerance]: {TOLERANCE_COILS} coils, only the turns of each layer off by up to half a turn (uniform, independent; seed {}), under the best pattern's worst profile.",
                run.summary.seed
            ),
        )),
    }
}

/// With every spread that the model file declares; QUA beside.
fn declared_tolerance(run: &Run, best: &Pattern, declared: &ToleranceSpec) -> Result<(String, String), ReportError> {
    let spec = ToleranceSpec { samples: declared.samples.min(TOLERANCE_COILS), ..declared.clone() };
    let mut named = vec![(run.summary.best.name.as_str(), best.clone())];
    if let Some(qua) = run.summary.baselines.iter().find(|p| p.name == "qua" && p.name != run.summary.best.name) {
        named.push(("qua", Pattern::new(qua.segments.clone())?));
    }
    let patterns: Vec<Pattern> = named.iter().map(|(_, pattern)| pattern.clone()).collect();
    let found = study(&run.file.model, &run.file.profiles, &spec, &patterns)?;
    // Of all coils that are declared, as the search and `tolerance` have it, not of those that are drawn here.
    let p95 = Coils::new(&run.file.model, &run.file.profiles, declared)?.p95_rad_per_s(&patterns)?;
    let (axis, over) = match measure(&run.file.model, run.file.profiles.max_rate_k_per_s)? {
        Measure::Guaranteed => {
            ("guaranteed worst |rate error| [°/h]", "over every profile within the model's largest ramp (guaranteed)")
        }
        Measure::Sampled => ("worst |rate error| [°/h]", "over the model's profiles"),
    };
    let all: Vec<f64> = found.iter().flat_map(|d| &d.worst_rad_per_s).map(|r| deg_per_h_from_rad_per_s(*r)).collect();
    let edges = bin_edges(&all);
    let mut chart =
        Chart::new("Worst rate error of coils as built").size(720, 320).x(Axis::linear(axis)).y(Axis::whole("coils"));
    let mut words = Vec::new();
    for (((name, _), distribution), p95) in named.iter().zip(&found).zip(p95) {
        let p95_deg_per_h = deg_per_h_from_rad_per_s(p95);
        let values: Vec<f64> = distribution.worst_rad_per_s.iter().map(|r| deg_per_h_from_rad_per_s(*r)).collect();
        chart = chart
            .with(ChartSeries::histogram(*name, &edges, &binned(&values, &edges)))
            .mark(Mark::vertical(format!("P95 of {name}"), p95_deg_per_h));
        let shares: Vec<String> = distribution
            .variance_shares
            .iter()
            .map(|(spread, share)| format!("{} {:.0} %", spread.key(), percent_from_fraction(*share)))
            .collect();
        words.push(format!(
            "{name}: as designed {:.4}, median {:.4}, 95 % below {p95_deg_per_h:.4} °/h; of its variance {}",
            deg_per_h_from_rad_per_s(distribution.nominal_rad_per_s),
            deg_per_h_from_rad_per_s(distribution.median_rad_per_s()),
            shares.join(", ")
        ));
    }
    let caption = format!(
        "Worst rate error {over} of {} coils with every spread of the model file's [tolerance] (seed {}); P95 is that of all {} declared. {}.",
        spec.samples,
        spec.seed,
        declared.samples,
        words.join(". ")
    );
    Ok((chart.svg_to_read(), caption))
}

fn bin_edges(values: &[f64]) -> Vec<f64> {
    let (low, high) = values.iter().fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(*v), h.max(*v)));
    let width = ((high - low) / TOLERANCE_BINS as f64).max(f64::MIN_POSITIVE);
    (0..=TOLERANCE_BINS).map(|i| low + i as f64 * width).collect()
}

fn binned(values: &[f64], edges: &[f64]) -> Vec<f64> {
    let mut counts = vec![0.0; TOLERANCE_BINS];
    let width = edges[1] - edges[0];
    for value in values {
        counts[(((value - edges[0]) / width) as usize).min(TOLERANCE_BINS - 1)] += 1.0;
    }
    counts
}

/// With miscounted turns only.
fn turn_tolerance(run: &Run, best: &Pattern) -> Result<String, ReportError> {
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
    let edges = bin_edges(&found);
    let counts = binned(&found, &edges);
    Ok(Chart::new("Worst rate error of coils as wound")
        .size(720, 280)
        .x(Axis::linear("worst |rate error| [°/h]"))
        .y(Axis::whole("coils"))
        .with(ChartSeries::histogram("", &edges, &counts))
        .mark(Mark::vertical("as designed", run.summary.best.worst_rate_deg_per_h))
        .svg_to_read())
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
        .with(ChartSeries::step("", times_min.zip(held).collect()))
        .svg_to_read()
}

/// The searched front where there is one, else the patterns of this search.
fn trade_off(run: &Run) -> (String, String) {
    let chart = Chart::new("Rate error against the largest crossover")
        .x(Axis::whole("largest climb of a crossover [layers]").reaching(0.0))
        .y(Axis::log("worst |rate error| [°/h]"));
    let compared = |name: &str| {
        let points = all(run).map(|p| (p.windability.max_climb as f64, p.worst_rate_deg_per_h)).collect();
        ChartSeries::points(name, points).labelled(all(run).map(|p| p.name.clone()).collect())
    };
    let better = "Every step to the left is an easier crossover, every step down a smaller error.";
    match &run.front {
        None => (
            chart.with(compared("patterns compared")).svg_to_read(),
            format!(
                "The patterns compared above, not a searched front: coilwright pareto searches one, and with this folder as its -o it is shown here. {better}"
            ),
        ),
        Some(front) => {
            let mut chart = chart.with(compared("patterns of this search"));
            let mut captive: Vec<usize> = front.iter().map(|p| p.captive).collect();
            captive.sort_unstable();
            captive.dedup();
            for count in captive {
                let points = front.iter().filter(|p| p.captive == count);
                let points = points.map(|p| (p.max_climb as f64, p.worst_rate_deg_per_h)).collect();
                chart = chart.with(ChartSeries::points(format!("front, {count} captive"), points));
            }
            (
                chart.svg_to_read(),
                format!(
                    "The front that coilwright pareto searched (captive reels are weighed besides), and the patterns compared above. {better}"
                ),
            )
        }
    }
}

pub(super) fn convergence(run: &Run) -> String {
    let points: Vec<(f64, f64)> = run.history.iter().map(|h| (h.evaluations as f64, h.best_deg_per_h)).collect();
    let mut chart = Chart::new("Convergence of the search")
        .x(Axis::linear("moves judged [1]").reaching(0.0))
        .y(Axis::linear("best objective [°/h]"))
        .with(if points.len() > 1 {
            ChartSeries::step("best so far", points)
        } else {
            ChartSeries::points("best so far", points)
        });
    if let Some(bound) = run.summary.proof.lower_bound_deg_per_h {
        chart = chart.mark(Mark::horizontal("proved lower bound", bound));
    }
    chart.svg_to_read()
}

pub(super) fn certificate(run: &Run) -> Markup {
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
