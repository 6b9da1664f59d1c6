//! The reproduction of the 1998 paper as a reader gets it: words, tables, CSV, pictures, JSON.

use serde::Serialize;

use super::plot::{Axis, Chart, ChartSeries, Mark};
use crate::pattern::classic::Classic;
use crate::reproduce::yan1998::{
    DURATION_S, Discrepancy, ERRATA, ErrorOverTime, LAYERS, LayerRates, PaperReproduction, RAMP_S, TITLE, WINDINGS,
};
use crate::units::{c_per_h_from_k_per_s, deg_per_h_from_rad_per_s, min_from_s, mm_from_m};

/// A file of the reproduction, by its name in the folder of results.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReproductionFile {
    pub(crate) name: String,
    pub(crate) contents: String,
}

/// The answer of `reproduce yan1998`.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct PaperReproductionJson {
    pub(crate) publication: &'static str,
    pub(crate) table_2: Vec<PeakJson>,
    pub(crate) discrepancies: Vec<String>,
    pub(crate) errata: Vec<ErratumJson>,
    pub(crate) files: Vec<String>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct PeakJson {
    pub(crate) length_m: f64,
    pub(crate) winding: &'static str,
    pub(crate) published_deg_per_h: f64,
    pub(crate) computed_deg_per_h: f64,
    pub(crate) computed_at_s: f64,
    pub(crate) hard_bound_deg_per_h: f64,
    pub(crate) published_is_possible: bool,
}

/// A misprint of a publication, and what was used in its place.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct ErratumJson {
    pub(crate) place: &'static str,
    pub(crate) printed: &'static str,
    pub(crate) used: &'static str,
}

impl PaperReproductionJson {
    /// With the files that were written beside it.
    pub fn new(reproduction: &PaperReproduction, files: Vec<String>) -> Self {
        let peaks = reproduction.peaks.iter().map(|peak| PeakJson {
            length_m: peak.length_m,
            winding: peak.winding.key(),
            published_deg_per_h: rounded(deg_per_h_from_rad_per_s(peak.published_rad_per_s)),
            computed_deg_per_h: deg_per_h_from_rad_per_s(peak.computed_rad_per_s),
            computed_at_s: peak.computed_at_s,
            hard_bound_deg_per_h: deg_per_h_from_rad_per_s(peak.hard_bound_rad_per_s),
            published_is_possible: peak.is_possible(),
        });
        Self {
            publication: TITLE,
            table_2: peaks.collect(),
            discrepancies: reproduction.discrepancies.iter().map(discrepancy_words).collect(),
            errata: ERRATA.iter().map(|e| ErratumJson { place: e.place, printed: e.printed, used: e.used }).collect(),
            files,
        }
    }
}

/// A printed value back to its printed digits, which the way through radians blurs.
fn rounded(published_deg_per_h: f64) -> f64 {
    format!("{published_deg_per_h:.3}").parse().unwrap_or(published_deg_per_h)
}

/// The rows of Table 2: length, winding, printed, computed, when, bound, verdict.
pub(crate) const TABLE_HEAD: [&str; 7] =
    ["length m", "winding", "published °/h", "computed °/h", "at s", "hard bound °/h", "published value"];

pub(crate) fn table_rows(reproduction: &PaperReproduction) -> Vec<Vec<String>> {
    let row = |peak: &crate::reproduce::yan1998::Peak| {
        vec![
            peak.length_m.to_string(),
            peak.winding.key().to_owned(),
            format!("{:.3}", deg_per_h_from_rad_per_s(peak.published_rad_per_s)),
            format!("{:.4}", deg_per_h_from_rad_per_s(peak.computed_rad_per_s)),
            format!("{:.1}", peak.computed_at_s),
            format!("{:.4}", deg_per_h_from_rad_per_s(peak.hard_bound_rad_per_s)),
            if peak.is_possible() { "possible" } else { "beyond the bound" }.to_owned(),
        ]
    };
    reproduction.peaks.iter().map(row).collect()
}

/// One sentence.
pub(crate) fn discrepancy_words(discrepancy: &Discrepancy) -> String {
    let upper = |winding: Classic| winding.key().to_uppercase();
    match *discrepancy {
        Discrepancy::BeyondHardBound { winding, length_m, published_rad_per_s, bound_rad_per_s } => format!(
            "{} at {length_m} m: the published {:.3} °/h exceeds {:.4} °/h, which no winding of this coil can exceed at \
             10 °C/h (n κ k0 L/(4D))",
            upper(winding),
            deg_per_h_from_rad_per_s(published_rad_per_s),
            deg_per_h_from_rad_per_s(bound_rad_per_s)
        ),
        Discrepancy::NotProportionalToLength { winding, published_ratio, computed_ratio } => format!(
            "{}: the published values at 800 m and 200 m have the ratio {published_ratio:.3}, Eqs. (13)–(16) give \
             {computed_ratio:.3}",
            upper(winding)
        ),
        Discrepancy::ProportionalToLength { winding, published_ratio, computed_ratio } => format!(
            "{}: the published values at 800 m and 200 m have the ratio {published_ratio:.3}, as the equations do \
             ({computed_ratio:.3})",
            upper(winding)
        ),
        Discrepancy::DipNearQua { length_m, published_ratio, computed_ratio } => format!(
            "DIP over QUA at {length_m} m: published {published_ratio:.4}, computed {computed_ratio:.4}; both peaks are \
             the outermost layer's alone, in the first instant of the ramp"
        ),
        Discrepancy::SymmetricOverCylindrical { length_m, published_ratio, at_peak, at_ramps_end } => format!(
            "SYM over ZYL at {length_m} m: published {published_ratio:.3}; computed at the peaks {:.3} for Eq. (14) and \
             {:.3} for the winding that the text describes, at the ramp's end {:.3} and {:.3}",
            at_peak.eq14, at_peak.text, at_ramps_end.eq14, at_ramps_end.text
        ),
        Discrepancy::LargerByOneFactor { winding, length_m, factor } => {
            format!("{} at {length_m} m: the published value is {factor:.3} times the computed one", upper(winding))
        }
    }
}

/// All files; `command` is written into the page of words.
pub fn files(reproduction: &PaperReproduction, command: &str) -> Vec<ReproductionFile> {
    let file = |name: &str, contents: String| ReproductionFile { name: name.to_owned(), contents };
    let mut files = vec![
        file("README.md", words(reproduction, command)),
        file("table2.csv", table_csv(reproduction)),
        file("figure2.csv", layer_rates_csv(&reproduction.layer_rates)),
        file("figure2.svg", layer_rates_chart(&reproduction.layer_rates)),
    ];
    for error in &reproduction.errors {
        files.push(file(&format!("figure3-{}m.csv", error.length_m), error_csv(error)));
        files.push(file(&format!("figure3-{}m.svg", error.length_m), error_chart(error)));
    }
    files
}

fn words(reproduction: &PaperReproduction, command: &str) -> String {
    let markdown_row = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let head = TABLE_HEAD.map(str::to_owned);
    let mut page = format!("# {TITLE}\n\nMade by `{command}`, coilwright {}.\n\n", env!("CARGO_PKG_VERSION"));
    page += "## Table 2: largest error, published beside computed\n\n";
    page += &markdown_row(&head);
    page += &markdown_row(&head.each_ref().map(|_| "---".to_owned()));
    page.extend(table_rows(reproduction).iter().map(|row| markdown_row(row)));
    page += "\n`sym` is Eq. (14), `sym-text` the winding that the text describes. Nothing is tuned to the published \
             table.\n\n## What the table and the equations agree and disagree about\n\n";
    page.extend(reproduction.discrepancies.iter().map(|d| format!("- {}\n", discrepancy_words(d))));
    page += "\n## Errata: what is printed and what is used\n\n";
    page.extend(ERRATA.iter().map(|e| format!("- {}: {}. Used: {}.\n", e.place, e.printed, e.used)));
    page += "\n## Fig. 2: temperature rate by depth\n\n![Fig. 2](figure2.svg)\n";
    for (error, letter) in reproduction.errors.iter().zip(["a", "b"]) {
        let length_m = error.length_m;
        page +=
            &format!("\n## Fig. 3 ({letter}): error over time, {length_m} m\n\n![Fig. 3](figure3-{length_m}m.svg)\n");
    }
    page
}

fn lines(rows: impl IntoIterator<Item = Vec<String>>) -> String {
    rows.into_iter().map(|row| row.join(",") + "\n").collect()
}

fn table_csv(reproduction: &PaperReproduction) -> String {
    let head = [
        "length_m",
        "winding",
        "published_deg_per_h",
        "computed_deg_per_h",
        "computed_at_s",
        "hard_bound_deg_per_h",
        "published_value",
    ];
    lines(std::iter::once(head.map(str::to_owned).to_vec()).chain(table_rows(reproduction)))
}

fn layer_rates_csv(figure: &LayerRates) -> String {
    let mut head = vec!["layer_from_outside".to_owned(), "depth_mm".to_owned()];
    head.extend(figure.times_s.iter().map(|t| format!("rate_c_per_h_at_{t}_s")));
    let rows = figure.depths_m.iter().enumerate().map(|(m, &depth_m)| {
        let mut row = vec![(m + 1).to_string(), format!("{:.2}", mm_from_m(depth_m))];
        row.extend(figure.rates_k_per_s.iter().map(|rates| format!("{:.6}", c_per_h_from_k_per_s(rates[m]))));
        row
    });
    lines(std::iter::once(head).chain(rows))
}

fn layer_rates_chart(figure: &LayerRates) -> String {
    let title = format!("Temperature rate by depth: {LAYERS} layers, 10 °C/h for {RAMP_S} s, half space");
    let chart = Chart::new(title)
        .x(Axis::linear("depth below the outermost layer [mm]"))
        .y(Axis::linear("temperature rate [°C/h]").reaching(0.0));
    figure
        .times_s
        .iter()
        .zip(&figure.rates_k_per_s)
        .fold(chart, |chart, (time_s, rates)| {
            let points =
                figure.depths_m.iter().zip(rates).map(|(&d, &r)| (mm_from_m(d), c_per_h_from_k_per_s(r))).collect();
            let name = format!("{time_s} s");
            // After the ramp's end the lines are dashed.
            chart.with(if *time_s > RAMP_S {
                ChartSeries::dashed(name, points)
            } else {
                ChartSeries::line(name, points)
            })
        })
        .svg()
}

fn error_csv(figure: &ErrorOverTime) -> String {
    let mut head = vec!["time_s".to_owned()];
    head.extend(WINDINGS.map(|w| format!("{}_deg_per_h", w.key().replace('-', "_"))));
    let rows = figure.times_s.iter().enumerate().map(|(i, time_s)| {
        let mut row = vec![format!("{time_s}")];
        row.extend(figure.rates_rad_per_s.iter().map(|series| format!("{:.6}", deg_per_h_from_rad_per_s(series[i]))));
        row
    });
    lines(std::iter::once(head).chain(rows))
}

fn error_chart(figure: &ErrorOverTime) -> String {
    let title = format!("Rate error of a {} m coil: 10 °C/h for {RAMP_S} s, then a soak", figure.length_m);
    let chart = Chart::new(title)
        .x(Axis::linear("time [min]").reaching(min_from_s(DURATION_S)))
        .y(Axis::linear("rate error [°/h]"))
        .mark(Mark::vertical("ramp ends", min_from_s(RAMP_S)));
    WINDINGS
        .iter()
        .zip(&figure.rates_rad_per_s)
        .fold(chart, |chart, (winding, series)| {
            let points = figure
                .times_s
                .iter()
                .zip(series)
                .map(|(&t, &r)| (min_from_s(t), deg_per_h_from_rad_per_s(r)))
                .collect();
            chart.with(ChartSeries::line(winding.key(), points))
        })
        .svg()
}
