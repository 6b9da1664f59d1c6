//! The reproduction of the thesis chapter as a reader gets it: words, tables, CSV, pictures, JSON.

use serde::Serialize;

use super::plot::{Axis, Chart, ChartSeries, Mark};
use super::yan1998::{ErratumJson, ReproductionFile};
use crate::reproduce::thesis2021::{BAND_DEG_PER_S, LINES, TITLE, ThesisReproduction};

/// The answer of `reproduce thesis2021`.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct ThesisReproductionJson {
    pub(crate) publication: &'static str,
    pub(crate) record: &'static str,
    pub(crate) comparisons: Vec<ComparisonJson>,
    pub(crate) errata: Vec<ErratumJson>,
    pub(crate) files: Vec<String>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct ComparisonJson {
    pub(crate) place: &'static str,
    pub(crate) what: &'static str,
    pub(crate) unit: &'static str,
    /// Null where the chapter gives an equation without a number.
    pub(crate) published: Option<f64>,
    pub(crate) computed: f64,
    pub(crate) explanation: &'static str,
}

/// What the numbers are of.
pub(crate) const RECORD: &str = "simulated from the chapter's stated numbers: it prints no record";

impl ThesisReproductionJson {
    /// With the files that were written beside it.
    pub fn new(reproduction: &ThesisReproduction, files: Vec<String>) -> Self {
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

/// What the chapter has, and where it is.
const ITEMS: [(&str, &str); 26] = [
    (
        "(3-1) bias from output and scale factor",
        "row (3-1); `metrics` of counts with `--columns rate=NAME:counts,scale=N`: `bias_deg_per_h`",
    ),
    ("(3-2) bias stability", "rows (3-2); `metrics`: `bias_stability_deg_per_h`, `--average` sets the mean"),
    ("(3-3) bias repeatability", "row (3-3); `metrics` of several records: `repeatability_deg_per_h`"),
    ("(3-4) sensitivity to temperature", "rows (3-4); `metrics`: `temperature_sensitivity_deg_per_h_per_c`"),
    ("(3-5) random walk from RMS and bandwidth", "row (3-5); `metrics`: `noise[]`, white, with an interval"),
    ("(3-6) angle by random walk", "row (3-6)"),
    ("(3-7) random walk by fit of B_s²", "row (3-7); `metrics`: `allan` has the same averaging times"),
    ("Allan variance, spectral density", "`metrics`: `allan`; figure3-3.svg"),
    (
        "Fig. 3-1, F = S(1 + ε)(I + E + D)",
        "effects `scale_factor_error`, `scale_factor_temperature`, `scale_factor_asymmetry`, a table's rate as a column",
    ),
    (
        "E: temperature, its rate, its gradient's rate",
        "effects `bias_temperature`, `bias_temperature_rate`, `bias_gradient_rate`",
    ),
    ("D: bias, random walk, quantisation", "`metrics`: `bias_deg_per_h`, `noise[]`"),
    ("sums over 1 s of outputs at 100 Hz", "the record's rows; of one's own `--average-rows 100`"),
    ("Fig. 3-2, rate over temperature, before", "figure3-2.svg"),
    ("peak to peak and sensitivity, before", "rows Fig. 3-2 and (3-4)"),
    ("Fig. 3-3, spectrum", "figure3-3.svg"),
    ("means over 5 s", "every row of record.csv"),
    ("filter G(z)", "row 3.3, bandwidth; every row of record.csv"),
    ("step 1, the shift of a start-up", "rows 3.3 step 1; `compensate --turn-on`"),
    ("step 2, (3-8) to (3-10), lines by least squares", "rows (3-9), (3-10); `compensate --method piecewise`"),
    ("(3-11) lines and break points", "rows (3-11), errata"),
    ("Fig. 3-4, rate over temperature, after", "figure3-4.svg and its row"),
    ("Figs. 3-5 and 3-6, rate over time", "figure3-5-6.svg and their rows"),
    ("Figs. 3-7 and 3-8, angle over time", "figure3-7-8.svg and their rows"),
    ("peak to peak and sensitivity, after", "rows 3.3 and (3-4), errata"),
    ("all four numbers in °/h", "rows in °/h"),
    ("3.5, estimate by a Kalman filter", "rows 3.5"),
];

/// Published beside computed.
pub(crate) fn table_rows(reproduction: &ThesisReproduction) -> Vec<Vec<String>> {
    let row = |c: &crate::reproduce::thesis2021::PrintedComparison| {
        let published = c.published.map_or_else(|| "–".to_owned(), |value| format!("{value}"));
        [c.place, c.what, &published, &digits(c.computed), c.unit, c.explanation].map(str::to_owned).to_vec()
    };
    reproduction.comparisons.iter().map(row).collect()
}

fn digits(value: f64) -> String {
    super::plot::three_digits(value)
}

/// Everything that goes into the folder.
pub fn files(reproduction: &ThesisReproduction, command: &str) -> Vec<ReproductionFile> {
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
        .with(ChartSeries::points("simulated, filtered", over(temperature, before)));
    let figure_4 = breaks(chart("Fig. 3-4: rate over temperature, after", "temperature [°C]"))
        .with(ChartSeries::points("compensated", over(temperature, after)))
        .mark(Mark::horizontal("printed band", BAND_DEG_PER_S))
        .mark(Mark::horizontal("", -BAND_DEG_PER_S));
    let figure_5 = chart("Figs. 3-5 and 3-6: rate over time, after and before", "time [s]")
        .with(ChartSeries::line("before", over(time, before)))
        .with(ChartSeries::line("after", over(time, after)));
    let angle = |column: usize| -> Vec<(f64, f64)> { reproduction.angles.iter().map(|r| (r[0], r[column])).collect() };
    let figure_7 = Chart::new("Figs. 3-7 and 3-8: angle over time, after and before")
        .size(760, 400)
        .x(Axis::linear("time [s]"))
        .y(Axis::linear("angle [°]"))
        .with(ChartSeries::line("before", angle(1)))
        .with(ChartSeries::line("lines and shift taken off", angle(2)));
    let density = reproduction.spectrum.iter().map(|d| (d.frequency_hz, d.density)).collect();
    let figure_3 = Chart::new("Fig. 3-3: power spectral density before")
        .size(760, 400)
        .x(Axis::log("frequency [Hz]"))
        .y(Axis::log("density [(°/s)²/Hz]"))
        .with(ChartSeries::line("one-sided, of the raw rows", density))
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
        file("figure3-7-8.svg", figure_7.svg()),
    ]
}

fn csv(reproduction: &ThesisReproduction) -> String {
    let mut text = "place,what,published,computed,unit\n".to_owned();
    for c in &reproduction.comparisons {
        let published = c.published.map_or_else(String::new, |value| format!("{value}"));
        text += &format!("\"{}\",\"{}\",{published},{:.7},{}\n", c.place, c.what, c.computed, c.unit);
    }
    text
}

fn words(reproduction: &ThesisReproduction, command: &str) -> String {
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
    text += "\n## The chapter item by item\n\n| in the chapter | here |\n|---|---|\n";
    for (item, place) in ITEMS {
        text += &format!("| {item} | {place} |\n");
    }
    text
}
