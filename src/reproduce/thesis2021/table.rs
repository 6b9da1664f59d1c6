//! The chapter's numbers one by one: what is printed, what comes out, and why they differ.

use super::{BAND_BIT, BAND_DEG_PER_S, LINES, PrintedComparison, in_deg_per_s};
use crate::compensate::empirical::PiecewiseBias;
use crate::metrics::{Metrics, TemperaturePoint};
use crate::units::{
    REFERENCE_TEMPERATURE_K, SECONDS_PER_HOUR, celsius_from_kelvin, kelvin_from_celsius, percent_from_fraction,
    rad_per_s_from_deg_per_s, s_from_h,
};

/// Outputs that are summed to a row.
const OUTPUTS: f64 = 100.0;
/// Between the zones' printed ends, 25 and 30 °C, and the lower break point is a point of 25 °C.
const MIDDLE_C: f64 = 25.0;

/// What the simulated record shows.
pub(super) struct SimulatedMeasures<'f> {
    pub(crate) measured: &'f Metrics,
    pub(crate) left: &'f Metrics,
    pub(crate) lines: &'f PiecewiseBias,
    pub(crate) crossings_c: [f64; 2],
    pub(crate) walk: f64,
    pub(crate) walk_by_fit: f64,
    pub(crate) shifts: [f64; 2],
    /// Of the biases of several start-ups [°/s].
    pub(crate) repeatability: f64,
    /// Of another start-up, an hour on and over its whole warming: before and behind the lines [°].
    pub(crate) angles: [[f64; 2]; 2],
    /// Of a rate of one degree an hour, with its standard error.
    pub(crate) estimate: (f64, f64),
}

/// Each number of the chapter beside the computed one.
#[expect(clippy::too_many_lines, reason = "a row for each number of the chapter, in the chapter's order")]
pub(super) fn comparisons(found: &SimulatedMeasures) -> Vec<PrintedComparison> {
    let row = |place, what, unit, published: Option<f64>, computed, explanation| PrintedComparison {
        place,
        what,
        unit,
        published,
        computed,
        explanation,
    };
    let sensitivity = |m: &Metrics| m.temperature_sensitivity_rad_per_s_per_k.map_or(f64::NAN, in_deg_per_s);
    // Eq. (3-4) about the middle of the chapter's own zones.
    let about_the_middle = |m: &Metrics| {
        let from_middle = |p: &&TemperaturePoint| (p.temperature_k - kelvin_from_celsius(MIDDLE_C)).abs();
        let middle = m.temperature_points.iter().min_by(|a, b| from_middle(a).total_cmp(&from_middle(b)));
        let slope = |point: &TemperaturePoint, middle: &TemperaturePoint| {
            ((point.bias_rad_per_s - middle.bias_rad_per_s) / (point.temperature_k - middle.temperature_k)).abs()
        };
        let slopes = middle.into_iter().flat_map(|middle| {
            m.temperature_points.iter().filter(move |p| *p != middle).map(move |p| slope(p, middle))
        });
        in_deg_per_s(slopes.fold(f64::NAN, f64::max))
    };
    let (before, after) =
        (in_deg_per_s(found.measured.peak_to_peak_rad_per_s), in_deg_per_s(found.left.peak_to_peak_rad_per_s));
    let bit = |value: f64| value * BAND_BIT / BAND_DEG_PER_S;
    let slope = |i: usize| found.lines.lines.get(i).map_or(f64::NAN, |l| bit(in_deg_per_s(l.slope_rad_per_s_k)));
    let at_zero = |i: usize| {
        found.lines.lines.get(i).map_or(f64::NAN, |l| {
            bit(in_deg_per_s(
                l.at_reference_rad_per_s - l.slope_rad_per_s_k * celsius_from_kelvin(REFERENCE_TEMPERATURE_K),
            ))
        })
    };
    let drawn = "lines of the first start-up, shift removed, on one with other noise and 1 °/h more; the chapter draws it, the text has no number";
    let summed = "of sums over 1 s, a hundred outputs: printed before Eq. (3-11), which has a hundredth of it; off by as much as the lines below, by the noise";
    let hourly = "the same number in °/h";
    let until = |i: usize| found.lines.lines.get(i).map_or(f64::NAN, |l| celsius_from_kelvin(l.until_k));
    let simulated = "simulated from the printed lines and band; the fit finds them again as far as the noise lets it";
    vec![
        row(
            "(3-1)",
            "scale factor S_n",
            "bit/(°/s)",
            None,
            BAND_BIT / BAND_DEG_PER_S,
            "from ±2.5 bit = ±0.0076 °/s; no number is printed",
        ),
        row(
            "(3-1)",
            "bias over the whole warming",
            "°/s",
            None,
            in_deg_per_s(found.measured.bias_rad_per_s),
            "no number is printed",
        ),
        row(
            "(3-2)",
            "bias stability before",
            "°/s",
            None,
            found.measured.bias_stability_rad_per_s.map_or(f64::NAN, in_deg_per_s),
            "of the filtered means; no number is printed",
        ),
        row(
            "(3-2)",
            "bias stability after",
            "°/s",
            None,
            found.left.bias_stability_rad_per_s.map_or(f64::NAN, in_deg_per_s),
            "no number is printed",
        ),
        row(
            "(3-3)",
            "bias repeatability",
            "°/s",
            None,
            found.repeatability,
            "of six start-ups whose offsets were drawn with 1 °/h (0.000278 °/s), behind the lines; no number is printed",
        ),
        row(
            "Fig. 3-2",
            "peak to peak before",
            "°/s",
            Some(0.04),
            before,
            "the lines' swing of 8.2 bit and the band of 5 bit: the printed numbers belong together",
        ),
        row(
            "(3-4)",
            "temperature sensitivity before",
            "°/s/°C",
            Some(0.00089),
            sensitivity(found.measured),
            "against the point at 20 °C; the chapter does not say which point m is: see the next row",
        ),
        row(
            "(3-4)",
            "temperature sensitivity before, m at 25 °C",
            "°/s/°C",
            Some(0.00089),
            about_the_middle(found.measured),
            "the printed lines themselves give 0.00088 from 14 to 25 °C and 0.00090 from 25 to 42 °C: m is in the middle zone",
        ),
        row(
            "(3-5)",
            "angle random walk, RMS/√W",
            "°/√s",
            None,
            found.walk,
            "white noise of one row over W = 1 Hz; no number is printed",
        ),
        row(
            "(3-7)",
            "angle random walk, fit of B_s²",
            "°/√s",
            None,
            found.walk_by_fit,
            "the same noise; no number is printed",
        ),
        row(
            "(3-6)",
            "angle by random walk in an hour",
            "°",
            None,
            found.walk * s_from_h(1.0).sqrt(),
            "ARW √t; no number is printed",
        ),
        row(
            "(3-6)",
            "drift angle over the warming, before",
            "°",
            None,
            found.measured.drift_angle_rad / rad_per_s_from_deg_per_s(1.0),
            "the rate integrated; no number is printed",
        ),
        row(
            "(3-6)",
            "drift angle over the warming, after",
            "°",
            None,
            found.left.drift_angle_rad / rad_per_s_from_deg_per_s(1.0),
            "nothing but rounding: the lines were fitted to this record, so the mean of what they leave is 0; no number is printed",
        ),
        row("Fig. 3-8", "drift angle of another start-up, 1 h, before", "°", None, found.angles[0][0], drawn),
        row("Fig. 3-7", "drift angle of another start-up, 1 h, after", "°", None, found.angles[0][1], drawn),
        row("Fig. 3-8", "drift angle of another start-up, 5 h, before", "°", None, found.angles[1][0], drawn),
        row("Fig. 3-7", "drift angle of another start-up, 5 h, after", "°", None, found.angles[1][1], drawn),
        row(
            "3.3",
            "bandwidth of G(z)",
            "Hz",
            Some(0.04),
            1.0 / (std::f64::consts::TAU * 4.0),
            "G is Tustin's form of a time constant of 4 s at 5 s",
        ),
        row(
            "3.3 step 1",
            "shift of another start-up, not removed",
            "°/s",
            None,
            found.shifts[0],
            "simulated with 1 °/h; no number is printed",
        ),
        row(
            "3.3 step 1",
            "shift of another start-up, removed",
            "°/s",
            None,
            found.shifts[1],
            "the mean of its first ten minutes is taken off, which this noise lets know to 1.1 °/h: a shift of 1 °/h needs hours",
        ),
        row(
            "3.5",
            "Kalman estimate of a rate of 1 °/h",
            "°/h",
            None,
            found.estimate.0 * SECONDS_PER_HOUR,
            "behind the lines, over the whole warming; the chapter recommends it and prints no number",
        ),
        row(
            "3.5",
            "its standard error",
            "°/h",
            None,
            found.estimate.1 * SECONDS_PER_HOUR,
            "the filter's own; what the lines were fitted with counts once more",
        ),
        row("(3-9)", "K_l", "bit/°C", Some(33.86), OUTPUTS * slope(0), summed),
        row("(3-9)", "K_m", "bit/°C", Some(10.45), OUTPUTS * slope(1), summed),
        row("(3-9)", "K_h", "bit/°C", Some(40.82), OUTPUTS * slope(2), summed),
        row("(3-10)", "R_0l", "bit", Some(-732.29), OUTPUTS * at_zero(0), summed),
        row("(3-10)", "R_0m", "bit", Some(-200.33), OUTPUTS * at_zero(1), summed),
        row("(3-10)", "R_0h", "bit", Some(-1149.2), OUTPUTS * at_zero(2), summed),
        row("(3-11)", "slope of the lower line", "bit/°C", Some(LINES[0].0), slope(0), simulated),
        row("(3-11)", "slope of the middle line", "bit/°C", Some(LINES[1].0), slope(1), simulated),
        row("(3-11)", "slope of the upper line", "bit/°C", Some(LINES[2].0), slope(2), simulated),
        row("(3-11)", "lower line at 0 °C", "bit", Some(LINES[0].1), at_zero(0), simulated),
        row("(3-11)", "middle line at 0 °C", "bit", Some(LINES[1].1), at_zero(1), simulated),
        row("(3-11)", "upper line at 0 °C", "bit", Some(LINES[2].1), at_zero(2), simulated),
        row(
            "(3-11)",
            "lower break point, of the lines",
            "°C",
            Some(23.6),
            found.crossings_c[0],
            "erratum: the printed lines meet elsewhere",
        ),
        row(
            "(3-11)",
            "upper break point, of the lines",
            "°C",
            Some(30.0),
            found.crossings_c[1],
            "erratum: the printed lines meet elsewhere",
        ),
        row(
            "(3-11)",
            "lower break point, fitted",
            "°C",
            Some(23.6),
            until(0),
            "the record jumps at the printed places; the noise hides where",
        ),
        row(
            "(3-11)",
            "upper break point, fitted",
            "°C",
            Some(30.0),
            until(1),
            "the record jumps at the printed places; the noise hides where",
        ),
        row(
            "Fig. 3-4",
            "band after, half of peak to peak",
            "°/s",
            Some(BAND_DEG_PER_S),
            0.5 * after,
            "the noise was chosen for it",
        ),
        row(
            "3.3",
            "peak to peak after",
            "°/s",
            Some(0.00163),
            after,
            "erratum: contradicts the printed band of ±0.0076 °/s; 0.0163 is meant",
        ),
        row(
            "3.3",
            "reduction of peak to peak",
            "%",
            Some(96.0),
            percent_from_fraction(1.0 - after / before),
            "1 − 0.00163/0.04 as printed; with the erratum 1 − 0.0163/0.04 = 59 %",
        ),
        row(
            "(3-4)",
            "temperature sensitivity after",
            "°/s/°C",
            Some(0.000_107),
            sensitivity(found.left),
            "what noise leaves in points of 5 °C; the chapter's points are finer, or its lines fit less well",
        ),
        row("3.3", "peak to peak before", "°/h", Some(144.0), before * SECONDS_PER_HOUR, hourly),
        row(
            "3.3",
            "temperature sensitivity before",
            "°/h/°C",
            Some(3.2),
            sensitivity(found.measured) * SECONDS_PER_HOUR,
            hourly,
        ),
        row("3.3", "peak to peak after", "°/h", Some(5.87), after * SECONDS_PER_HOUR, hourly),
        row(
            "3.3",
            "temperature sensitivity after",
            "°/h/°C",
            Some(0.385),
            sensitivity(found.left) * SECONDS_PER_HOUR,
            hourly,
        ),
        row("Fig. 3-6", "drift rate before", "°/s", Some(0.02), 0.5 * before, "half of peak to peak"),
        row("Fig. 3-5", "drift rate after", "°/s", Some(0.008), 0.5 * after, "half of peak to peak"),
    ]
}
