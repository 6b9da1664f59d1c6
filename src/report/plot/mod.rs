//! Charts as SVG: say what is to be seen, get a picture that is finished.
//!
//! A [`Chart`] takes two [`Axis`] and any number of [`ChartSeries`], marks and bands, and finds by itself where the axes
//! end, which numbers stand along them, where the legend goes, and how many points a line needs. The text and the
//! lines of the frame take the reader's colour (light or dark), the series have colours that are legible on both. The
//! same chart gives the same bytes.
//!
//! ```
//! use coilwright::report::plot::{Axis, Chart, ChartSeries, Mark};
//! let svg = Chart::new("Rate error during a ramp")
//!     .x(Axis::linear("time [min]"))
//!     .y(Axis::linear("rate error [°/h]"))
//!     .with(ChartSeries::line("quadrupole", vec![(0.0, 0.0), (5.0, 2.1), (25.0, 0.3)]))
//!     .with(ChartSeries::line("searched", vec![(0.0, 0.0), (5.0, 0.2), (25.0, 0.0)]))
//!     .mark(Mark::vertical("ramp ends", 20.0))
//!     .svg();
//! assert!(svg.starts_with("<svg") && svg.contains("rate error [°/h]"));
//! ```
//!
//! Numbers that are not finite (or, on a logarithmic axis, not positive) leave a gap.

mod axis;
mod data;
mod draw;
mod labels;
mod layout;

pub(super) use axis::{significant, three_digits};
pub(super) use draw::STYLE;

pub use axis::Axis;

/// What a series looks like.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Shape {
    Line,
    Dashed,
    Points,
    /// Each value holds until the next.
    Step,
    /// Columns between neighbouring edges; the points are (left edge, height), the last one closes the last column.
    Histogram,
    /// One value a category; the points are (value, index of the category).
    Bars,
    /// Rectangles of one size, tinted by a value; the points are their middles.
    Cells,
}

/// One set of numbers under one name.
#[derive(Debug, Clone, PartialEq)]
pub struct ChartSeries {
    name: String,
    shape: Shape,
    points: Vec<(f64, f64)>,
    /// Written next to the points; empty or one a point.
    labels: Vec<String>,
    /// Half the length of a bar through each point; empty or one a point.
    errors: Vec<f64>,
    /// What a cell's tint says; one a point.
    values: Vec<f64>,
    /// Width and height of a cell.
    cell: (f64, f64),
    least: f64,
}

impl ChartSeries {
    /// A continuous line through the points in their order.
    pub fn line(name: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self::of(name, Shape::Line, points)
    }

    /// A thin dashed line: a reference, a prediction.
    pub fn dashed(name: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self::of(name, Shape::Dashed, points)
    }

    pub(crate) fn points(name: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self::of(name, Shape::Points, points)
    }

    /// Each value holds until the next one's x.
    pub(crate) fn step(name: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self::of(name, Shape::Step, points)
    }

    /// Columns of a histogram: `edges` has one entry more than `heights`.
    pub(crate) fn histogram(name: impl Into<String>, edges: &[f64], heights: &[f64]) -> Self {
        let mut points: Vec<(f64, f64)> = edges.iter().copied().zip(heights.iter().copied()).collect();
        if let Some(&edge) = edges.get(points.len()) {
            points.push((edge, 0.0));
        }
        Self::of(name, Shape::Histogram, points)
    }

    /// Lying bars, one value for each of the chart's [`Chart::categories`].
    pub(crate) fn bars(name: impl Into<String>, values: &[f64]) -> Self {
        let points = values.iter().enumerate().map(|(i, v)| (*v, i as f64)).collect();
        Self::of(name, Shape::Bars, points)
    }

    /// Rectangles of one size around their middles, (x, y, value): blue below zero, red above, the paler the smaller.
    pub(crate) fn cells(name: impl Into<String>, size: (f64, f64), cells: &[(f64, f64, f64)]) -> Self {
        let points = cells.iter().map(|c| (c.0, c.1)).collect();
        let values = cells.iter().map(|c| c.2).collect();
        Self { values, cell: size, ..Self::of(name, Shape::Cells, points) }
    }

    /// Draws a bar of one standard error up and down through each point.
    pub(crate) fn with_errors(mut self, errors: Vec<f64>) -> Self {
        self.errors = errors;
        self
    }

    /// The strongest tint of cells stands for no less than this.
    pub(crate) fn at_least(mut self, value: f64) -> Self {
        self.least = value;
        self
    }

    /// What the strongest tint of the cells stands for.
    fn largest_value(&self) -> f64 {
        self.values.iter().filter(|v| v.is_finite()).fold(self.least, |most: f64, v| most.max(v.abs()))
    }

    /// Writes a word next to each point.
    pub(crate) fn labelled(mut self, labels: Vec<String>) -> Self {
        self.labels = labels;
        self
    }

    fn of(name: impl Into<String>, shape: Shape, points: Vec<(f64, f64)>) -> Self {
        let (labels, errors, values) = (Vec::new(), Vec::new(), Vec::new());
        Self { name: name.into(), shape, points, labels, errors, values, cell: (0.0, 0.0), least: 0.0 }
    }
}

/// Along which axis a mark or a band is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Along {
    X,
    Y,
}

/// A thin line across the chart with a word on it.
#[derive(Debug, Clone, PartialEq)]
pub struct Mark {
    label: String,
    along: Along,
    value: f64,
}

impl Mark {
    /// At one x.
    pub fn vertical(label: impl Into<String>, x: f64) -> Self {
        Self { label: label.into(), along: Along::X, value: x }
    }

    /// At one y.
    pub(crate) fn horizontal(label: impl Into<String>, y: f64) -> Self {
        Self { label: label.into(), along: Along::Y, value: y }
    }
}

/// A tinted range with an entry in the legend.
#[derive(Debug, Clone, PartialEq)]
pub struct Band {
    label: String,
    along: Along,
    from: f64,
    to: f64,
    /// Place in the palette; without it, one for each label.
    hue: Option<usize>,
}

impl Band {
    /// Between two x, over the whole height.
    pub fn vertical(label: impl Into<String>, from: f64, to: f64) -> Self {
        Self { label: label.into(), along: Along::X, from, to, hue: None }
    }

    /// Between two y, over the whole width.
    pub(crate) fn horizontal(label: impl Into<String>, from: f64, to: f64) -> Self {
        Self { label: label.into(), along: Along::Y, from, to, hue: None }
    }

    /// With the palette's colour of this number instead of the next free one.
    pub fn hue(mut self, index: usize) -> Self {
        self.hue = Some(index);
        self
    }
}

/// A chart to be drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    title: String,
    width_px: u32,
    height_px: u32,
    x: Axis,
    y: Axis,
    series: Vec<ChartSeries>,
    marks: Vec<Mark>,
    bands: Vec<Band>,
    categories: Vec<String>,
}

impl Chart {
    /// 720 × 400 pixels, linear axes without labels. An empty title takes no room.
    pub fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            width_px: 720,
            height_px: 400,
            x: Axis::linear(""),
            y: Axis::linear(""),
            series: Vec::new(),
            marks: Vec::new(),
            bands: Vec::new(),
            categories: Vec::new(),
        }
    }

    /// Natural size; the picture scales without loss. At least 240 × 160.
    pub fn size(mut self, width_px: u32, height_px: u32) -> Self {
        (self.width_px, self.height_px) = (width_px.clamp(240, 8000), height_px.clamp(160, 8000));
        self
    }

    /// With this horizontal axis.
    pub fn x(mut self, axis: Axis) -> Self {
        self.x = axis;
        self
    }

    /// With this vertical axis.
    pub fn y(mut self, axis: Axis) -> Self {
        self.y = axis;
        self
    }

    /// Adds a series; colours follow the order.
    pub fn with(mut self, series: ChartSeries) -> Self {
        self.series.push(series);
        self
    }

    /// With this mark, over those before it.
    pub fn mark(mut self, mark: Mark) -> Self {
        self.marks.push(mark);
        self
    }

    /// With this band behind all marks.
    pub fn band(mut self, band: Band) -> Self {
        self.bands.push(band);
        self
    }

    /// Names along the vertical axis, from the top, for [`ChartSeries::bars`]; the height follows their number.
    pub(crate) fn categories(mut self, names: impl IntoIterator<Item = impl Into<String>>) -> Self {
        self.categories = names.into_iter().map(Into::into).collect();
        self
    }

    /// Where in the palette a band's colour is: bands of one label have one colour.
    fn hue_of(&self, band: &Band) -> usize {
        let first = self.bands.iter().position(|b| b.label == band.label).unwrap_or(0);
        band.hue.unwrap_or(first + 7)
    }

    /// The picture: one `<svg>` element, as a file of its own or inside a page.
    pub fn svg(&self) -> String {
        draw::svg(self, false)
    }

    /// The same with its data beside it, from which a page's script shows values under the pointer and draws it again, zoomed, on
    /// another scale, or as differences.
    pub(crate) fn svg_to_read(&self) -> String {
        draw::svg(self, true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_chart_gives_the_same_bytes() {
        let chart = Chart::new("a < b & c").with(ChartSeries::line("x", vec![(0.0, 1.0), (1.0, f64::NAN), (2.0, 3.0)]));
        assert_eq!(chart.svg(), chart.svg());
        assert!(chart.svg().contains("a &lt; b &amp; c"));
    }

    #[test]
    fn a_chart_to_read_says_where_its_axes_are_whatever_its_names_hold() {
        let hostile = "'><script>\"&";
        let chart = Chart::new("x").y(Axis::log("y")).with(ChartSeries::line(hostile, vec![(0.0, 1.0), (1.0, 100.0)]));
        let drawn = chart.svg_to_read();
        assert!(!drawn.contains("<script>"));
        let held = drawn.split("data-plot='").nth(1).and_then(|rest| rest.split('\'').next()).unwrap();
        let held: serde_json::Value = serde_json::from_str(held).unwrap();
        assert_eq!(held["series"][0]["name"], hostile);
        assert_eq!(held["y"], serde_json::json!({ "label": "y", "low": 0.0, "high": 2.0, "log": true, "floor": null }));
        assert_eq!(held["series"][0]["y"], serde_json::json!([1, 100]));
        assert!(!chart.svg().contains("data-plot"));
    }

    #[test]
    fn a_line_of_a_million_points_stays_a_small_file() {
        let points = (0..1_000_000).map(|i| (f64::from(i), (f64::from(i) * 0.01).sin())).collect();
        assert!(Chart::new("").with(ChartSeries::line("x", points)).svg().len() < 200_000);
    }

    #[test]
    fn errors_of_either_sign_stand_on_one_logarithmic_scale_by_their_size() {
        let series = ChartSeries::line("x", vec![(0.0, -10.0), (1.0, 0.0), (2.0, 0.1)]);
        let drawn = Chart::new("x").y(Axis::sizes("|y|", 0.01)).with(series).svg_to_read();
        assert!(drawn.contains("\"floor\":0.01") && drawn.contains("\"y\":[-10,0,0.1]"), "{drawn}");
    }

    #[test]
    fn a_chart_without_data_says_so() {
        assert!(Chart::new("empty").svg().contains("no data"));
        assert!(Chart::new("nan").with(ChartSeries::points("x", vec![(f64::NAN, 1.0)])).svg().contains("no data"));
    }
}
