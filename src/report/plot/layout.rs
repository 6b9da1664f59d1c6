//! Where the parts of a chart go, in pixels of its natural size.

use plotters::style::RGBColor;

use super::axis::{Ruler, three_digits};
use super::{Along, Axis, Chart, Shape};

/// The backend counts whole pixels; drawing on a finer grid and shrinking the picture keeps slopes smooth.
pub(super) const FINE: i32 = 4;
pub(super) const TEXT_PX: i32 = 13;
pub(super) const ROW_PX: i32 = 19;
pub(super) const MARK_ROW_PX: i32 = 17;
/// Widest glyphs of common sans-serif fonts, on average, per pixel of height.
const GLYPH: f64 = 0.58;

/// Legible on white and on near-black.
pub(super) const PALETTE: [RGBColor; 8] = [
    RGBColor(0x2f, 0x7f, 0xd6),
    RGBColor(0xd9, 0x73, 0x0d),
    RGBColor(0x1a, 0x98, 0x50),
    RGBColor(0x9b, 0x5f, 0xc0),
    RGBColor(0xd6, 0x45, 0x50),
    RGBColor(0x17, 0x9a, 0xa2),
    RGBColor(0xa5, 0x74, 0x4a),
    RGBColor(0x7d, 0x85, 0x90),
];

pub(super) fn colour(index: usize) -> RGBColor {
    PALETTE[index % PALETTE.len()]
}

/// Width of a text at the chart's font size [px].
pub(super) fn text_width_px(text: &str) -> i32 {
    (text.chars().count() as f64 * GLYPH * f64::from(TEXT_PX)).ceil() as i32
}

/// Where things are [px].
pub(super) struct ChartLayout {
    pub(super) left: i32,
    pub(super) top: i32,
    pub(super) right: i32,
    pub(super) bottom: i32,
    pub(super) height: i32,
    pub(super) x: Ruler,
    pub(super) y: Ruler,
    pub(super) legend: Vec<LegendEntry>,
    pub(super) legend_top: i32,
    /// Above the frame: one entry a vertical mark.
    pub(super) mark_words: Vec<MarkWord>,
}

/// The words on a vertical mark: row above the frame and left edge; none where the mark cannot be drawn.
type MarkWord = Option<(i32, i32)>;

pub(super) struct LegendEntry {
    pub(super) row: i32,
    pub(super) left: i32,
    pub(super) text: String,
    pub(super) colour: usize,
    pub(super) shape: LegendShape,
}

#[derive(Clone, Copy, PartialEq)]
pub(super) enum LegendShape {
    Line,
    Dashed,
    Dot,
    Block,
    Band,
    /// From the palest to the strongest tint.
    Scale,
}

/// The chart's axes, reaching as far as cells, error bars and bars do.
fn reaching_axes(chart: &Chart) -> (Axis, Axis) {
    let mut x_axis = chart.x.clone();
    let mut y_axis = chart.y.clone();
    for series in chart.series.iter().filter(|s| s.shape == Shape::Cells) {
        for (x, y) in &series.points {
            let (half_x, half_y) = (0.5 * series.cell.0, 0.5 * series.cell.1);
            x_axis = x_axis.reaching(x - half_x).reaching(x + half_x);
            y_axis = y_axis.reaching(y - half_y).reaching(y + half_y);
        }
    }
    for series in &chart.series {
        for ((_, y), error) in series.points.iter().zip(&series.errors) {
            y_axis = y_axis.reaching(y + error);
        }
    }
    if !chart.categories.is_empty() {
        x_axis = x_axis.reaching(0.0);
    }
    if chart.series.iter().any(|s| s.shape == Shape::Histogram) {
        y_axis = y_axis.reaching(0.0);
    }
    (x_axis, y_axis)
}

/// Room for the numbers at the ends of lying bars.
fn make_room_for_numbers(x: &mut Ruler, chart: &Chart) {
    let width = chart.width_px as i32;
    let longest = chart.series.iter().flat_map(|s| &s.labels).map(|l| text_width_px(l)).max().unwrap_or(0);
    let share = (f64::from(longest + 8) / (0.75 * f64::from(width))).min(0.6);
    let room = (x.high - x.low) * (share / (1.0 - share)).max(0.1);
    x.high += room;
    if x.low < 0.0 && chart.series.iter().flat_map(|s| &s.points).any(|p| p.0 < 0.0) {
        x.low -= room;
    } else {
        x.low = x.base(&chart.x);
    }
    x.ticks.retain(|t| t.position >= x.low && t.position <= x.high);
}

impl ChartLayout {
    pub(super) fn new(chart: &Chart) -> Self {
        let width = chart.width_px as i32;
        let title = if chart.title.is_empty() { 8 } else { 34 };
        let lying = !chart.categories.is_empty();
        let x_wanted = (width / 95).max(2) as usize;
        let finite = || {
            chart.series.iter().flat_map(|s| s.points.iter()).filter(|(x, y)| chart.x.admits(*x) && chart.y.admits(*y))
        };
        let marks = |along: Along| {
            let marks = chart.marks.iter().filter(move |m| m.along == along).map(|m| m.value);
            marks.chain(chart.bands.iter().filter(move |b| b.along == along).flat_map(|b| [b.from, b.to]))
        };
        let has = |wanted: Shape| chart.series.iter().any(|s| s.shape == wanted);
        let x_margin = if lying || has(Shape::Points) { 0.04 } else { 0.0 };
        let (x_axis, y_axis) = reaching_axes(chart);
        let x_values: Vec<f64> = if lying {
            chart.series.iter().flat_map(|s| s.points.iter()).map(|p| p.0).collect()
        } else {
            finite().map(|p| p.0).collect()
        };
        let mut x = x_axis.ruler(x_values.into_iter().chain(marks(Along::X)), x_wanted, x_margin);
        if lying {
            make_room_for_numbers(&mut x, chart);
        }
        let legend_width = width - 24;
        let (legend, rows) = legend(chart, legend_width);
        let legend_top = title;
        let without_marks = title + rows * ROW_PX + 8;
        let below = 6 + ROW_PX + if chart.x.label.is_empty() { 4 } else { ROW_PX + 6 };
        let stated = (chart.height_px as i32).max(without_marks + below + 60);
        let y = if lying {
            Ruler { low: -0.5, high: chart.categories.len() as f64 - 0.5, ticks: Vec::new(), suffix: String::new() }
        } else {
            let wanted = ((stated - below - without_marks) / 46).max(2) as usize;
            let mut y = y_axis.ruler(finite().map(|p| p.1).chain(marks(Along::Y)), wanted, 0.05);
            if has(Shape::Histogram) {
                y.low = y.base(&chart.y);
            }
            y
        };
        let longest = y.ticks.iter().map(|t| &t.label).chain(&chart.categories).map(|l| text_width_px(l)).max();
        let label = if chart.y.label.is_empty() { 0 } else { ROW_PX };
        let left = (8 + label + longest.unwrap_or(0) + 8).min(width / 2);
        let last = x.ticks.iter().rev().find(|t| !t.label.is_empty()).map_or(0, |t| text_width_px(&t.label) / 2);
        let right = width - 10.max(last + 4);
        let (mark_words, mark_rows) = place_mark_words(chart, &x, left, right);
        let top = without_marks + mark_rows * MARK_ROW_PX;
        let height = if lying {
            let bars = chart.series.len().max(1) as i32;
            top + below + chart.categories.len() as i32 * (14 + 14 * bars)
        } else {
            stated
        };
        let bottom = height - below;
        Self { left, top, right, bottom, height, x, y, legend, legend_top, mark_words }
    }

    pub(super) fn x_px(&self, position: f64) -> f64 {
        along(&self.x, position, self.left, self.right)
    }

    pub(super) fn y_px(&self, position: f64, lying: bool) -> f64 {
        let share = (position - self.y.low) / (self.y.high - self.y.low);
        let share = if lying { share } else { 1.0 - share };
        f64::from(self.top) + share * f64::from(self.bottom - self.top)
    }
}

fn along(ruler: &Ruler, position: f64, from: i32, to: i32) -> f64 {
    f64::from(from) + (position - ruler.low) / (ruler.high - ruler.low) * f64::from(to - from)
}

/// Words that would lie on one another go to different rows; also says how many rows there are.
fn place_mark_words(chart: &Chart, x: &Ruler, left: i32, right: i32) -> (Vec<MarkWord>, i32) {
    let mut taken: Vec<(i32, i32, i32)> = Vec::new();
    let mut place = |mark: &super::Mark| {
        if mark.along != Along::X || !chart.x.admits(mark.value) || mark.label.is_empty() {
            return None;
        }
        let wide = text_width_px(&mark.label);
        let middle = along(x, chart.x.position(mark.value), left, right) as i32;
        let start = (middle - wide / 2).min(right - wide).max(left);
        let free = |row: i32| !taken.iter().any(|t| t.0 == row && start < t.2 && t.1 < start + wide + 8);
        let row = (0..6).find(|r| free(*r)).unwrap_or(0);
        taken.push((row, start, start + wide + 8));
        Some((row, start))
    };
    let words: Vec<MarkWord> = chart.marks.iter().map(&mut place).collect();
    let rows = taken.iter().map(|t| t.0 + 1).max().unwrap_or(0);
    (words, rows)
}

/// Places the legend's entries in rows; none where there is nothing to tell apart.
fn legend(chart: &Chart, width: i32) -> (Vec<LegendEntry>, i32) {
    let series = chart.series.iter().enumerate().map(|(i, s)| {
        let shape = match s.shape {
            Shape::Line | Shape::Step => LegendShape::Line,
            Shape::Dashed => LegendShape::Dashed,
            Shape::Points => LegendShape::Dot,
            Shape::Histogram | Shape::Bars => LegendShape::Block,
            Shape::Cells => LegendShape::Scale,
        };
        let text = match s.shape {
            Shape::Cells => {
                format!("{}: −{} … {}", s.name, three_digits(s.largest_value()), three_digits(s.largest_value()))
            }
            _ => s.name.clone(),
        };
        (text, i, shape)
    });
    let is_first = |i: usize| chart.bands[..i].iter().all(|b| b.label != chart.bands[i].label);
    let bands = chart.bands.iter().enumerate().filter(|(i, _)| is_first(*i));
    let bands = bands.map(|(_, b)| (b.label.clone(), chart.hue_of(b), LegendShape::Band));
    let entries: Vec<_> = series.chain(bands).filter(|e| !e.0.is_empty()).collect();
    if entries.len() < 2 && entries.iter().all(|e| e.2 != LegendShape::Scale) {
        return (Vec::new(), 0);
    }
    let (mut row, mut left) = (0, 12);
    let mut placed = Vec::with_capacity(entries.len());
    for (text, colour, shape) in entries {
        let wide = 26 + text_width_px(&text) + 14;
        if left > 12 && left + wide > width {
            (row, left) = (row + 1, 12);
        }
        placed.push(LegendEntry { row, left, text, colour, shape });
        left += wide;
    }
    (placed, row + 1)
}
