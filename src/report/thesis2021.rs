//! The reproduction of the thesis chapter as a reader gets it: words, tables, CSV, pictures, JSON.

use serde::Serialize;

use super::plot::{Axis, Chart, Mark, Series};
use super::yan1998::ReproductionFile;
use crate::reproduce::thesis2021::{BAND_DEG_PER_S, LINES, Reproduction, TITLE};

/// The answer of `reproduce thesis2021`.
#[derive(Debug, Serialize)]
pub struct ReproductionJson {
    pub(crate) publication: &'static str,
    pub(crate) record: &'static str,
    pub(crate) comparisons: Vec<ComparisonJson>,
    pub(crate) errata: Vec<ErratumJson>,
    pub(crate) files: Vec<String>,
}

#[derive(Debug, Serialize)]
pub(crate) struct ComparisonJson {
    pub(crate) place: &'static str,
    pub(crate) what: &'static str,
    pub(crate) unit: &'static str,
    /// Null where the chapter gives an equation without a number.
    pub(crate) published: Option<f64>,
    pub(crate) computed: f64,
    pub(crate) explanation: &'static str,
}

#[derive(Debug, Serialize)]
pub(crate) struct ErratumJson {
    pub(crate) place: &'static str,
    pub(crate) printed: &'static str,
    pub(crate) used: &'static str,
}

/// What the numbers are of.
pub(crate) const RECORD: &str = "simulated from the chapter's stated numbers: it prints no record";

impl ReproductionJson {
    /// With the files that were written beside it.
    pub fn new(reproduction: &Reproduction, files: Vec<String>) -> Self {
        let comparisons = reproduction.comparisons.iter().map(|c| ComparisonJson {
            place: c.place,
            what: c.what,
            unit: c.unit,
            published: c.published,
            computed: c.computed,
            explanation: c.explanation,
        });
        let errata = reproduction.errata.iter().map(|(place, printed, used)| ErratumJson { place, printed, used });
        Self { publication: TITLE, record: RECORD, comparisons: comparisons.collect(), errata: errata.collect(), files }
    }
}

pub(crate) const TABLE_HEAD: [&str; 6] =
    ["place", "what", "published", "computed", "unit", "why they differ, or what it is"];

/// Published beside computed.
pub(crate) fn table_rows(reproduction: &Reproduction) -> Vec<Vec<String>> {
    let row = |c: &crate::reproduce::thesis2021::Comparison| {
        let published = c.published.map_or_else(|| "–".to_owned(), |value| format!("{value}"));
        [c.place, c.what, &published, &digits(c.computed), c.unit, c.explanation].map(str::to_owned).to_vec()
    };
    reproduction.comparisons.iter().map(row).collect()
}

fn digits(value: f64) -> String {
    super::plot::three_digits(value)
}

/// Everything that goes into the folder.
pub fn files(reproduction: &Reproduction, command: &str) -> Vec<ReproductionFile> {
    let file = |name: &str, contents: String| ReproductionFile { name: name.to_owned(), contents };
    let over = |x: usize, y: usize| -> Vec<(f64, f64)> { reproduction.rows.iter().map(|r| (r[x], r[y])).collect() };
    let (time, temperature, before, after) = (0, 1, 2, 3);
    let chart =
        |title: &str, x: &str| Chart::new(title).size(760, 400).x(Axis::linear(x)).y(Axis::linear("rate [°/s]"));
    let breaks = |chart: Chart| {
        LINES[..2]
            .iter()
            .fold(chart, |chart, line| chart.mark(Mark::vertical(format!("{} °C, printed", line.2), line.2)))
    };
    let figure_2 = breaks(chart("Fig. 3-2: rate over temperature, before", "temperature [°C]"))
        .with(Series::points("simulated, filtered", over(temperature, before)));
    let figure_4 = breaks(chart("Fig. 3-4: rate over temperature, after", "temperature [°C]"))
        .with(Series::points("compensated", over(temperature, after)))
        .mark(Mark::horizontal("printed band", BAND_DEG_PER_S))
        .mark(Mark::horizontal("", -BAND_DEG_PER_S));
    let figure_5 = chart("Figs. 3-5 and 3-6: rate over time, after and before", "time [s]")
        .with(Series::line("before", over(time, before)))
        .with(Series::line("after", over(time, after)));
    let density = reproduction.spectrum.iter().map(|d| (d.frequency_hz, d.density)).collect();
    let figure_3 = Chart::new("Fig. 3-3: power spectral density before")
        .size(760, 400)
        .x(Axis::log("frequency [Hz]"))
        .y(Axis::log("density [(°/s)²/Hz]"))
        .with(Series::line("one-sided, of the raw rows", density))
        .mark(Mark::vertical("0.04 Hz, printed", 0.04));
    let mut rows = "time_s,temperature_c,rate_deg_per_s,rate_compensated_deg_per_s\n".to_owned();
    for [time_s, temperature_c, before, after] in &reproduction.rows {
        rows += &format!("{time_s},{temperature_c:.4},{before:.7},{after:.7}\n");
    }
    vec![
        file("README.md", words(reproduction, command)),
        file("comparisons.csv", csv(reproduction)),
        file("record.csv", rows),
        file("figure3-2.svg", figure_2.svg()),
        file("figure3-3.svg", figure_3.svg()),
        file("figure3-4.svg", figure_4.svg()),
        file("figure3-5-6.svg", figure_5.svg()),
    ]
}

fn csv(reproduction: &Reproduction) -> String {
    let mut text = "place,what,published,computed,unit\n".to_owned();
    for c in &reproduction.comparisons {
        let published = c.published.map_or_else(String::new, |value| format!("{value}"));
        text += &format!("\"{}\",\"{}\",{published},{:.7},{}\n", c.place, c.what, c.computed, c.unit);
    }
    text
}

fn words(reproduction: &Reproduction, command: &str) -> String {
    let mut text =
        format!("# {TITLE}\n\nWritten by `{command}`. The record is {RECORD}.\n\n| {} |\n", TABLE_HEAD.join(" | "));
    text += "|---|---|---|---|---|---|\n";
    for row in table_rows(reproduction) {
        text += &format!("| {} |\n", row.join(" | "));
    }
    text += "\n## Errata: what is printed and what is used\n\n";
    for (place, printed, used) in reproduction.errata {
        text += &format!("- {place}: {printed}. Used: {used}.\n");
    }
    text
}
