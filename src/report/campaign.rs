//! The page of a campaign: what was asked, what to wind across the grid, what each class and layer count costs, what failed.

use maud::{Markup, html};

use super::page::{figure, page};
use super::plot::{Axis, Chart, ChartSeries};
use super::words;
use crate::io::json::campaign::{CampaignJson, CellJson};
use crate::numeric::order::sort_ascending;
use crate::search::cost::objective::Objective;

/// What costs less than this more than the best is equally good; the easier winding is then recommended.
const EQUALLY_GOOD_SHARE: f64 = 0.02;

/// Seeds that end within this share of the best one have found the same.
const SAME_SHARE: f64 = 1e-3;

/// More coils do not fit one picture; those with the smallest error stand in it.
const MOST_COILS: usize = 40;

/// More failures are counted, not listed; the table has them all.
const MOST_FAILURES: usize = 50;

/// What all seeds of one coil, class and objective found.
struct Group<'a> {
    best: &'a CellJson,
    value: f64,
    seeds: usize,
    seeds_at_best: usize,
}

/// What a cell was searched for, else its worst rate.
fn value(found: &CellJson) -> Option<f64> {
    found.objective_deg_per_h.or(found.worst_rate_deg_per_h)
}

type Key<'a> = (&'a str, usize, &'a str, &'a str);

fn key(found: &CellJson) -> Key<'_> {
    (&found.model, found.layers, &found.windability, &found.objective)
}

/// Seeds stand next to each other in the grid.
fn groups(results: &[CellJson]) -> Vec<Group<'_>> {
    let done: Vec<&CellJson> = results.iter().filter(|found| value(found).is_some()).collect();
    let of = |cells: &[&'_ CellJson]| -> (usize, f64) {
        let values = cells.iter().map(|found| value(found).unwrap_or(f64::INFINITY)).enumerate();
        values.fold((0, f64::INFINITY), |least, (i, v)| if v < least.1 { (i, v) } else { least })
    };
    done.chunk_by(|a, b| key(a) == key(b))
        .map(|cells| {
            let (index, value_at_best) = of(cells);
            let is_same = |found: &&&CellJson| value(found).is_some_and(|v| v <= value_at_best * (1.0 + SAME_SHARE));
            let seeds_at_best = cells.iter().filter(is_same).count();
            Group { best: cells[index], value: value_at_best, seeds: cells.len(), seeds_at_best }
        })
        .collect()
}

/// In the order in which they first come.
fn distinct<'a>(words: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut found: Vec<&str> = Vec::new();
    for word in words {
        if !found.contains(&word) {
            found.push(word);
        }
    }
    found
}

/// The easier class first.
fn effort(class: &str) -> usize {
    match class.split_once(':') {
        Some((_, captive)) => captive.parse().unwrap_or(usize::MAX - 1),
        None if class == "standard" => 0,
        None => usize::MAX,
    }
}

fn unit(objective: &str) -> &'static str {
    Objective::from_key(objective).map_or("°/h", |objective| match objective {
        // The table states its rate instead.
        Objective::WorstPhase => "°/h",
        other => other.unit(),
    })
}

/// For each model and objective what to wind, in a sentence.
pub(crate) fn recommendations(results: &[CellJson]) -> Vec<String> {
    let groups = groups(results);
    let mut sentences = Vec::new();
    for objective in distinct(groups.iter().map(|g| g.best.objective.as_str())) {
        for model in distinct(groups.iter().map(|g| g.best.model.as_str())) {
            let own: Vec<&Group> =
                groups.iter().filter(|g| g.best.objective == objective && g.best.model == model).collect();
            sentences.extend(sentence(model, objective, &own));
        }
    }
    sentences
}

fn sentence(model: &str, objective: &str, own: &[&Group]) -> Option<String> {
    let least = own.iter().min_by(|a, b| a.value.total_cmp(&b.value))?;
    let good = own.iter().filter(|g| g.value <= least.value * (1.0 + EQUALLY_GOOD_SHARE));
    let wound = good.min_by_key(|g| (effort(&g.best.windability), g.best.layers))?;
    let unit = unit(objective);
    let found = wound.best;
    let mut words = format!(
        "{model}, {objective}: wind {} layers of the class {}: {:.4} {unit}",
        found.layers, found.windability, wound.value
    );
    if let Some(factor) = found.improvement_over_qua {
        words += &format!(", {factor:.2} times better than QUA");
    }
    if wound.best.id != least.best.id {
        words += &format!(
            "; the least of the grid, {:.4} {unit} with {} layers of the class {}, is less than 2 % below it",
            least.value, least.best.layers, least.best.windability
        );
    }
    if wound.seeds > 1 {
        words += &format!("; {} of {} seeds found it", wound.seeds_at_best, wound.seeds);
    }
    Some(words + ".")
}

/// One picture an objective: bars of the coils, one a class.
pub(crate) fn charts(results: &[CellJson]) -> Vec<(String, String)> {
    let groups = groups(results);
    let objectives = distinct(groups.iter().map(|g| g.best.objective.as_str()));
    objectives.into_iter().map(|objective| (objective.to_owned(), chart(&groups, objective))).collect()
}

fn chart(groups: &[Group], objective: &str) -> String {
    let own: Vec<&Group> = groups.iter().filter(|g| g.best.objective == objective).collect();
    // What a reader compares is one coil's classes, then coils.
    let mut coils: Vec<((&str, usize), f64)> = Vec::new();
    for group in &own {
        let coil = (group.best.model.as_str(), group.best.layers);
        match coils.iter_mut().find(|(known, _)| *known == coil) {
            Some((_, least)) => *least = least.min(group.value),
            None => coils.push((coil, group.value)),
        }
    }
    if coils.len() > MOST_COILS {
        sort_ascending(&mut coils, |item| item.1);
        coils.truncate(MOST_COILS);
    }
    let names = coils.iter().map(|((model, layers), _)| format!("{model}, {layers} layers"));
    let mut chart = Chart::new(format!("{objective}: the best of each coil and class"))
        .size(860, 240)
        .x(Axis::linear(format!("{objective} [{}]", unit(objective))))
        .categories(names);
    for class in distinct(own.iter().map(|g| g.best.windability.as_str())) {
        let of = |(coil, _): &((&str, usize), f64)| {
            let is_it = |g: &&&Group| (g.best.model.as_str(), g.best.layers) == *coil && g.best.windability == class;
            own.iter().find(is_it).map_or(f64::NAN, |g| g.value)
        };
        chart = chart.with(ChartSeries::bars(class, &coils.iter().map(of).collect::<Vec<f64>>()));
    }
    chart.svg_to_read()
}

/// The whole page.
pub(crate) fn campaign_page(answer: &CampaignJson) -> String {
    let groups = groups(&answer.results);
    let failed: Vec<&CellJson> = answer.results.iter().filter(|found| found.failure.is_some()).collect();
    let body = html! {
        h1 { (answer.campaign) }
        @for sentence in recommendations(&answer.results) { p.big { (sentence) } }
        @if groups.is_empty() { p.big { "No cell has a result." } }
        @for (objective, svg) in charts(&answer.results) {
            (figure(&svg, &format!("The best of all seeds under the objective {objective}: the shorter the bar, the smaller the error.")))
        }
        h2 { "The grid" }
        (asked(answer))
        (table(&groups))
        (words::of_windings())
        h2 { "What failed" }
        @if failed.is_empty() { p { "Nothing: every cell has a result." } } @else {
            p { (failed.len()) " of " (answer.results.len()) " cells have no result; their models permit none, and trying again would change nothing." }
            div.scroll { table {
                tr { th.word { "cell" } th.word { "model" } th { "layers" } th.word { "class" } th.word { "objective" } th.word { "why" } }
                @for found in failed.iter().take(MOST_FAILURES) { tr {
                    td.word { code { (found.id) } } td.word { (found.model) } td { (found.layers) } td.word { (found.windability) }
                    td.word { (found.objective) } td.word { (found.failure.as_deref().unwrap_or_default()) }
                } }
            } }
        }
    };
    page(&answer.campaign, &body)
}

fn asked(answer: &CampaignJson) -> Markup {
    let results = &answer.results;
    let listed = |of: fn(&CellJson) -> &str| distinct(results.iter().map(of)).join(", ");
    let mut layers: Vec<usize> = results.iter().map(|found| found.layers).collect();
    layers.sort_unstable();
    layers.dedup();
    let mut seeds: Vec<u64> = results.iter().map(|found| found.seed).collect();
    seeds.sort_unstable();
    seeds.dedup();
    let evaluations: u64 = results.iter().map(|found| found.evaluations).sum();
    let numbers = |of: &[String]| of.join(", ");
    html! {
        dl.facts {
            dt { "coils" } dd { (listed(|found| &found.model)) }
            dt { "layers" } dd { (numbers(&layers.iter().map(ToString::to_string).collect::<Vec<_>>())) }
            dt { "classes" } dd { (listed(|found| &found.windability)) }
            dt { "objectives" } dd { (listed(|found| &found.objective)) }
            dt { "seeds" } dd { (seeds.len()) }
            dt { "cells" } dd { (results.len()) " done, " (answer.failed.len()) " of them without a result" }
            dt { "moves judged" } dd { (evaluations) }
            dt { "program" } dd { (concat!("coilwright ", env!("CARGO_PKG_VERSION"))) }
        }
    }
}

fn table(groups: &[Group]) -> Markup {
    html! {
        div.scroll { table {
            thead { tr {
                th.word { "coil" } th { "layers" } th.word { "class" } th.word { "objective" } th { "best" } th { "QUA over it" }
                th { "seeds at best" } th.word { "segments, innermost layer first" }
            } }
            @for group in groups { tr {
                td.word { (group.best.model) } td { (group.best.layers) } td.word { (group.best.windability) } td.word { (group.best.objective) }
                td { (format!("{:.4} {}", group.value, unit(&group.best.objective))) }
                td { (group.best.improvement_over_qua.map_or_else(|| "–".to_owned(), |f| format!("{f:.3}"))) }
                td { (group.seeds_at_best) " of " (group.seeds) }
                td.word { code { (group.best.segments.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ")) } }
            } }
        } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(layers: usize, class: &str, seed: u64, value: Option<f64>) -> CellJson {
        CellJson {
            id: format!("{layers}{class}{seed}"),
            kind: "search".to_owned(),
            model: "coil".to_owned(),
            layers,
            windability: class.to_owned(),
            objective: "worst-rate".to_owned(),
            seed,
            worst_rate_deg_per_h: value,
            objective_deg_per_h: value,
            improvement_over_qua: Some(2.0),
            evaluations: 1,
            stopped_by: "rounds".to_owned(),
            segments: vec![1, 2],
            failure: value.is_none().then(|| "no turns".to_owned()),
        }
    }

    #[test]
    fn of_equally_good_windings_the_easiest_is_recommended_and_failures_are_named() {
        let results = vec![
            cell(8, "standard", 1, Some(1.01)),
            cell(8, "standard", 2, Some(1.5)),
            cell(8, "any", 1, Some(1.0)),
            cell(12, "standard", 1, None),
        ];
        let words = recommendations(&results);
        assert_eq!(words.len(), 1);
        assert!(words[0].contains("wind 8 layers of the class standard: 1.0100 °/h"), "{}", words[0]);
        assert!(
            words[0].contains("the least of the grid, 1.0000 °/h") && words[0].contains("1 of 2 seeds"),
            "{}",
            words[0]
        );
        let failed = vec!["12standard1".to_owned()];
        let answer = CampaignJson {
            campaign: "c".to_owned(),
            cells: Vec::new(),
            searched: 0,
            missing: Vec::new(),
            failed,
            results,
            built_coils: Vec::new(),
            fleet: None,
        };
        let page = campaign_page(&answer);
        assert!(page.contains("no turns") && page.contains("1 of 4 cells have no result"));
    }
}
