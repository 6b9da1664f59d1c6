//! A record beside its prediction: pictures of where the model holds and where it fails, and their part of the page.

use maud::{Markup, html};

use super::page::figure;
use super::plot::{Axis, Band, Chart, ChartSeries, Mark};
use crate::compare::regimes::Regime;
use crate::io::json::comparison::{CompareJson, PartJson, RecordComparisonJson};
use crate::io::write::comparison_rows::ComparisonRow;
use crate::units::{min_from_s, percent_from_fraction};

/// Cells of the map of residuals along temperature and along its rate.
const MAP_CELLS: (usize, usize) = (28, 18);
const WIDTH_PX: u32 = 860;

/// So many of the pictures, the first, are over time; they stand below one another with one time axis.
const OVER_TIME: usize = 3;

/// A picture with the name of its file.
pub(crate) struct Picture {
    pub(crate) file: String,
    pub(crate) svg: String,
    pub(crate) caption: String,
}

/// The pictures of the `number`-th record, counted from 1.
pub(crate) fn pictures(number: usize, record: &RecordComparisonJson, rows: &[ComparisonRow]) -> Vec<Picture> {
    let picture = |name: &str, chart: Chart, caption: String| Picture {
        file: format!("record-{number}-{name}.svg"),
        svg: chart.svg_to_read(),
        caption,
    };
    let noise = record.noise_floor_deg_per_h;
    vec![
        picture(
            "prediction",
            prediction_chart(rows),
            format!("The measured rate and, over it, the prediction with the fitted offset of {:.4} °/h.", record.offset_deg_per_h),
        ),
        picture(
            "residual",
            residual_chart(record, rows),
            format!("Measured less predicted rate. The dashed lines are three times the record's noise floor of {noise:.4} °/h; the tint says in which regime each row is."),
        ),
        picture(
            "temperature",
            temperature_chart(rows),
            "Temperature of the outermost layer in the model, with the same regimes.".to_owned(),
        ),
        picture(
            "shares",
            shares_chart(record),
            "Where a regime's share of the squared error is larger than its share of the rows, the model fails there more than elsewhere.".to_owned(),
        ),
        picture(
            "states",
            states_chart(record, rows),
            "Mean residual over temperature and rate of temperature of the outermost layer. A complete model leaves a pale, patternless map.".to_owned(),
        ),
        picture(
            "autocorrelation",
            autocorrelation_chart(record),
            format!(
                "Autocorrelation of the residual in units of its expected deviation; of a white residual 99 % of the points lie in the band. Ljung–Box over {} lags: p {}.",
                record.ljung_box.lags,
                probability(record.ljung_box.p_value)
            ),
        ),
    ]
}

fn probability(value: f64) -> String {
    if value < 1e-4 { "< 0.0001".to_owned() } else { format!("= {value:.4}") }
}

fn over_time(rows: &[ComparisonRow], value: fn(&ComparisonRow) -> f64) -> Vec<(f64, f64)> {
    rows.iter().map(|row| (min_from_s(row.time_s), value(row))).collect()
}

fn prediction_chart(rows: &[ComparisonRow]) -> Chart {
    Chart::new("Record and prediction")
        .size(WIDTH_PX, 360)
        .x(Axis::linear("time [min]"))
        .y(Axis::linear("rate [°/h]"))
        .with(ChartSeries::line("measured", over_time(rows, |r| r.rate_deg_per_h)))
        .with(ChartSeries::line("predicted", over_time(rows, |r| r.predicted_deg_per_h)))
}

fn residual_chart(record: &RecordComparisonJson, rows: &[ComparisonRow]) -> Chart {
    let three = 3.0 * record.noise_floor_deg_per_h;
    let chart = Chart::new("Residual over time")
        .size(WIDTH_PX, 360)
        .x(Axis::linear("time [min]"))
        .y(Axis::linear("measured − predicted [°/h]"))
        .with(ChartSeries::line("residual", over_time(rows, |r| r.residual_deg_per_h)))
        .mark(Mark::horizontal("+3 × noise", three))
        .mark(Mark::horizontal("", -three));
    shaded(chart, rows)
}

fn temperature_chart(rows: &[ComparisonRow]) -> Chart {
    let chart = Chart::new("Temperature")
        .size(WIDTH_PX, 230)
        .x(Axis::linear("time [min]"))
        .y(Axis::linear("outermost layer [°C]"))
        .with(ChartSeries::line("temperature", over_time(rows, |r| r.temperature_c)));
    shaded(chart, rows)
}

/// A band for each stretch of one regime, from its first row to the next stretch's first.
fn shaded(mut chart: Chart, rows: &[ComparisonRow]) -> Chart {
    let mut from = 0;
    for row in 1..=rows.len() {
        if row == rows.len() || rows[row].regime != rows[from].regime {
            let to_s = rows.get(row).unwrap_or(&rows[row - 1]).time_s;
            let (words, hue) = regime_words(&rows[from].regime);
            chart = chart.band(Band::vertical(words, min_from_s(rows[from].time_s), min_from_s(to_s)).hue(hue));
            from = row;
        }
    }
    chart
}

/// A regime's name for readers, and its colour: warm for heating, cold for cooling.
pub(super) fn regime_words(key: &str) -> (&str, usize) {
    match Regime::ALL.into_iter().find(|r| r.key() == key) {
        Some(Regime::WarmUp) => ("warm-up", 3),
        Some(Regime::Transient) => ("after a change of ramp", 1),
        Some(Regime::HeatingRamp) => ("heating ramp", 4),
        Some(Regime::CoolingRamp) => ("cooling ramp", 5),
        Some(Regime::Soak) => ("soak", 7),
        None => (key, 6),
    }
}

fn shares_chart(record: &RecordComparisonJson) -> Chart {
    let share = |of: fn(&PartJson) -> f64| -> Vec<f64> {
        record.regimes.iter().map(|part| percent_from_fraction(of(part))).collect()
    };
    Chart::new("Share of the squared error by regime")
        .size(WIDTH_PX, 240)
        .x(Axis::linear("share [%]"))
        .categories(record.regimes.iter().map(|part| regime_words(&part.name).0))
        .with(ChartSeries::bars("of the squared error", &share(|p| p.share_of_squared_error)))
        .with(ChartSeries::bars("of the rows", &share(|p| p.share_of_rows)))
}

fn states_chart(record: &RecordComparisonJson, rows: &[ComparisonRow]) -> Chart {
    let range = |of: fn(&ComparisonRow) -> f64| {
        rows.iter().map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
    };
    let place = |value: f64, (low, high): (f64, f64), cells: usize| {
        (((value - low) / (high - low).max(f64::MIN_POSITIVE) * cells as f64) as usize).min(cells - 1)
    };
    let (temperature, rate) = (range(|r| r.temperature_c), range(|r| r.temperature_rate_c_per_min));
    let mut sums = vec![(0.0, 0usize); MAP_CELLS.0 * MAP_CELLS.1];
    for row in rows {
        let x = place(row.temperature_c, temperature, MAP_CELLS.0);
        let y = place(row.temperature_rate_c_per_min, rate, MAP_CELLS.1);
        let sum = &mut sums[y * MAP_CELLS.0 + x];
        *sum = (sum.0 + row.residual_deg_per_h, sum.1 + 1);
    }
    let width = (temperature.1 - temperature.0) / MAP_CELLS.0 as f64;
    let height = (rate.1 - rate.0) / MAP_CELLS.1 as f64;
    let cells: Vec<(f64, f64, f64)> = sums
        .iter()
        .enumerate()
        .filter(|(_, (_, count))| *count > 0)
        .map(|(i, (sum, count))| {
            let (x, y) = ((i % MAP_CELLS.0) as f64 + 0.5, (i / MAP_CELLS.0) as f64 + 0.5);
            (temperature.0 + x * width, rate.0 + y * height, sum / *count as f64)
        })
        .collect();
    let least = 3.0 * record.noise_floor_deg_per_h;
    Chart::new("Mean residual over temperature and its rate")
        .size(WIDTH_PX, 400)
        .x(Axis::linear("temperature T [°C]"))
        .y(Axis::linear("dT/dt [°C/min]"))
        .with(ChartSeries::cells("mean residual [°/h]", (width, height), &cells).at_least(least))
}

fn autocorrelation_chart(record: &RecordComparisonJson) -> Chart {
    let points = record.autocorrelation.iter().enumerate().skip(1).map(|(lag, value)| (lag as f64, *value)).collect();
    let band = record.autocorrelation_band_99;
    Chart::new("Autocorrelation of the residual")
        .size(WIDTH_PX, 300)
        .x(Axis::linear("lag [rows]").reaching(0.0))
        .y(Axis::linear("autocorrelation [1]"))
        .with(ChartSeries::points("autocorrelation", points))
        .band(Band::horizontal("99 % of a white residual", -band, band))
}

/// The whole comparison as a part of a page.
pub(super) fn section(comparison: &CompareJson, tables: &[Vec<ComparisonRow>]) -> Markup {
    html! {
        h2 { "Model against measurement" }
        p.big { (verdict_words(comparison)) }
        @for (index, (record, rows)) in comparison.records.iter().zip(tables).enumerate() {
            @let pictures = pictures(index + 1, record, rows);
            @let (over_time, others) = pictures.split_at(OVER_TIME.min(pictures.len()));
            h2 { "Record " (record.file) }
            @for picture in over_time.iter().take(1) { (figure(&picture.svg, &picture.caption)) }
            ul { @for finding in &record.findings { li { (finding) } } }
            @for picture in over_time.iter().skip(1) { (figure(&picture.svg, &picture.caption)) }
            div.two { @for picture in others { (figure(&picture.svg, &picture.caption)) } }
            (measures(record))
            (parts(record))
            (correlations(record))
        }
    }
}

pub(super) fn verdict_words(comparison: &CompareJson) -> String {
    let failing: Vec<&str> =
        comparison.records.iter().filter(|r| r.verdict != "adequate").map(|r| r.file.as_str()).collect();
    if comparison.is_adequate() {
        let count = comparison.records.len();
        let what = if count == 1 { "the record".to_owned() } else { format!("all {count} records") };
        format!("Adequate: {what} can be told from the prediction by noise only.")
    } else {
        format!("Something is missing: the model does not explain {}.", failing.join(", "))
    }
}

fn measures(record: &RecordComparisonJson) -> Markup {
    let number = |value: Option<f64>, digits: usize| value.map_or("–".to_owned(), |v| format!("{v:.digits$}"));
    let rows = [
        ("Rows", record.rows.to_string()),
        ("Root mean square of the residual", format!("{:.5} °/h", record.rmse_deg_per_h)),
        (
            "Noise floor of the record",
            format!("{:.5} ± {:.5} °/h", record.noise_floor_deg_per_h, record.noise_floor_standard_error_deg_per_h),
        ),
        ("Offset", format!("{:.5} °/h", record.offset_deg_per_h)),
        ("NRMSE fit", number(record.nrmse_fit_percent, 2) + " %"),
        ("R²", number(record.r_squared, 5)),
        ("Reduced χ², against the noise alone", format!("{:.4}", record.reduced_chi_square)),
        ("Expected in it from the estimated boundary", format!("{:.4}", record.boundary_chi_square)),
        ("Reduced χ², against noise and boundary", format!("{:.4}", record.whitened_chi_square)),
        ("Largest error", format!("{:.4} °/h at {:.1} s", record.largest_error_deg_per_h, record.largest_error_time_s)),
        ("Film found", number(record.estimated_film_w_per_m2_k, 2) + " W/(m²K)"),
        ("Gross errors, gaps", format!("{}, {}", record.gross_errors.len(), record.gaps)),
        ("Noise floor from", record.noise_floor_method.clone()),
    ];
    html! { dl.facts { @for (name, value) in rows { dt { (name) } dd { (value) } } } }
}

fn parts(record: &RecordComparisonJson) -> Markup {
    let percent = |share: f64| format!("{:.1}", percent_from_fraction(share));
    html! {
        div.scroll { table {
            thead { tr {
                th.word { "Part of the record" } th { "Rows" } th { "Share of rows [%]" } th { "Share of squared error [%]" }
                th { "RMS [°/h]" } th { "χ² a row" }
            } }
            tbody { @for part in record.regimes.iter().chain(&record.temperature_bands).chain(&record.rate_bands) { tr {
                td.word { (regime_words(&part.name).0) }
                td { (part.rows) }
                td { (percent(part.share_of_rows)) }
                td { (percent(part.share_of_squared_error)) }
                td { (format!("{:.5}", part.rmse_deg_per_h)) }
                td { (format!("{:.2}", part.chi_square_per_row)) }
            } } }
        } }
    }
}

fn correlations(record: &RecordComparisonJson) -> Markup {
    html! {
        div.scroll { table {
            thead { tr { th.word { "Residual against" } th { "Correlation [1]" } } }
            tbody { @for found in &record.correlations { tr {
                td.word { (found.with) }
                td { (found.correlation.map_or("–".to_owned(), |c| format!("{c:+.3}").replace('-', "−"))) }
            } } }
        } }
    }
}
