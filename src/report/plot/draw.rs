//! Draws a chart that is laid out.

use plotters::coord::Shift;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::axis::three_digits;
use super::layout::{ChartLayout, FINE, LegendShape, MARK_ROW_PX, PALETTE, ROW_PX, TEXT_PX, colour, text_width_px};
use super::{Along, Chart, ChartSeries, Shape};
use super::{data, labels};
use crate::text::sink::Markup;

/// Stands for the reader's own text colour until the picture is done.
const INK: RGBColor = RGBColor(1, 2, 3);
const INK_CODE: &str = "#010203";

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

/// Blue below zero, red above; −1 and 1 are the strongest.
fn tint(share: f64) -> ShapeStyle {
    let hue = if share < 0.0 { PALETTE[0] } else { PALETTE[4] };
    hue.mix(0.06 + 0.9 * share.abs().min(1.0)).filled()
}

fn fine(px: f64) -> i32 {
    (px * f64::from(FINE)).round() as i32
}

fn at(x_px: f64, y_px: f64) -> (i32, i32) {
    (fine(x_px), fine(y_px))
}

/// A text with its anchor at a place [px].
fn text<'a>(words: &'a str, x_px: i32, y_px: i32, h: HPos, v: VPos) -> Text<'a, (i32, i32), &'a str> {
    let style =
        TextStyle::from(("sans-serif", f64::from(TEXT_PX * FINE) * 1.24).into_font()).color(&INK).pos(Pos::new(h, v));
    Text::new(words, (x_px * FINE, y_px * FINE), style)
}

pub(super) fn svg(chart: &Chart, to_read: bool) -> String {
    let layout = ChartLayout::new(chart);
    let (width, height) = (chart.width_px, layout.height as u32);
    let drawn = |what: &dyn Fn(&Area) -> Drawn| {
        let mut out = String::new();
        {
            let root =
                SVGBackend::with_string(&mut out, (width * FINE as u32, height * FINE as u32)).into_drawing_area();
            // Writing to a string cannot fail.
            let _ = what(&root);
            let _ = root.present();
        }
        let inner = out.split_once('>').map_or("", |(_, rest)| rest);
        inner.trim_end().strip_suffix("</svg>").unwrap_or(inner).to_owned()
    };
    let body = format!(
        "<g>{}</g>\n<g class=\"plot\">{}</g>\n</svg>\n",
        drawn(&|root| draw_words(chart, &layout, root)),
        drawn(&|root| draw(chart, &layout, root))
    );
    let read = if to_read { data::attribute(chart, &layout) } else { String::new() };
    finish(&body, chart, width, height, &read)
}

/// Gives the picture its natural size, a title for screen readers, and the reader's colours.
fn finish(body: &str, chart: &Chart, width: u32, height: u32, read: &str) -> String {
    let title = if chart.title.is_empty() { &chart.y.label } else { &chart.title };
    let title = title.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    let picture = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"chart\"{read} role=\"img\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {} {}\"><title>{title}</title><style>{STYLE}</style>{}",
        width * FINE as u32,
        height * FINE as u32,
        body.replace(INK_CODE, "currentColor")
    );
    Markup::of(&picture).into_string()
}

/// The same in every picture, so that several in one page do not quarrel.
pub(in crate::report) const STYLE: &str = "svg.chart{color:#1b1f24;background:#fff;font-family:system-ui,'DejaVu Sans',\
    Arial,sans-serif}svg.chart text{paint-order:stroke;stroke:#fff;stroke-width:.25em;stroke-linejoin:round}\
    @media(prefers-color-scheme:dark){svg.chart{color:#e3e6ea;background:#15181c}svg.chart text{stroke:#15181c}}\
    @media print{svg.chart{color:#000;background:#fff}svg.chart text{stroke:#fff}}";

fn draw(chart: &Chart, layout: &ChartLayout, root: &Area) -> Drawn {
    let lying = !chart.categories.is_empty();
    for band in &chart.bands {
        draw_band(chart, layout, root, band, lying)?;
    }
    draw_frame(chart, layout, root)?;
    let mut any = false;
    for (index, series) in chart.series.iter().enumerate() {
        any |= draw_series(chart, layout, root, series, index)?;
    }
    if !any {
        let (x, y) = ((layout.left + layout.right) / 2, (layout.top + layout.bottom) / 2);
        root.draw(&text("no data", x, y, HPos::Center, VPos::Center))?;
    }
    draw_marks(chart, layout, root, lying)?;
    // Over the marks, so that no line crosses a word.
    draw_bars_words(chart, layout, root)?;
    draw_labels(chart, layout, root)
}

/// Title and legend.
fn draw_words(chart: &Chart, layout: &ChartLayout, root: &Area) -> Drawn {
    if !chart.title.is_empty() {
        let style = TextStyle::from(("sans-serif", f64::from(15 * FINE) * 1.24, FontStyle::Bold).into_font())
            .color(&INK)
            .pos(Pos::new(HPos::Left, VPos::Center));
        root.draw(&Text::new(chart.title.as_str(), (12 * FINE, 18 * FINE), style))?;
    }
    for entry in &layout.legend {
        let y = f64::from(layout.legend_top + entry.row * ROW_PX + ROW_PX / 2);
        let left = f64::from(entry.left);
        let line = |from: f64, to: f64| {
            PathElement::new([at(left + from, y), at(left + to, y)], colour(entry.colour).stroke_width(2 * FINE as u32))
        };
        match entry.shape {
            LegendShape::Line => root.draw(&line(0.0, 20.0))?,
            LegendShape::Dashed => {
                for dash in [0.0, 8.0, 16.0] {
                    root.draw(&line(dash, dash + 4.0))?;
                }
            }
            LegendShape::Dot => root.draw(&Circle::new(at(left + 10.0, y), 4 * FINE, colour(entry.colour).filled()))?,
            LegendShape::Scale => {
                for step in -2..=2 {
                    let x = left + 4.0 * f64::from(step) + 8.0;
                    root.draw(&Rectangle::new([at(x, y - 5.0), at(x + 4.0, y + 5.0)], tint(0.5 * f64::from(step))))?;
                }
            }
            LegendShape::Block | LegendShape::Band => {
                let opacity = if entry.shape == LegendShape::Band { 0.25 } else { 0.9 };
                let fill = colour(entry.colour).mix(opacity).filled();
                root.draw(&Rectangle::new([at(left + 3.0, y - 5.0), at(left + 18.0, y + 5.0)], fill))?;
            }
        }
        root.draw(&text(&entry.text, entry.left + 26, y as i32, HPos::Left, VPos::Center))?;
    }
    Ok(())
}

fn draw_frame(chart: &Chart, layout: &ChartLayout, root: &Area) -> Drawn {
    let lying = !chart.categories.is_empty();
    let (left, right) = (f64::from(layout.left), f64::from(layout.right));
    let (top, bottom) = (f64::from(layout.top), f64::from(layout.bottom));
    let grid = |minor: bool| INK.mix(if minor { 0.06 } else { 0.16 }).stroke_width(FINE as u32);
    for tick in &layout.x.ticks {
        let x = layout.x_px(tick.position);
        root.draw(&PathElement::new([at(x, top), at(x, bottom)], grid(tick.label.is_empty())))?;
        root.draw(&text(&tick.label, x.round() as i32, layout.bottom + 6, HPos::Center, VPos::Top))?;
    }
    for tick in &layout.y.ticks {
        let y = layout.y_px(tick.position, lying);
        root.draw(&PathElement::new([at(left, y), at(right, y)], grid(tick.label.is_empty())))?;
        root.draw(&text(&tick.label, layout.left - 6, y.round() as i32, HPos::Right, VPos::Center))?;
    }
    for (index, name) in chart.categories.iter().enumerate() {
        let y = layout.y_px(index as f64, lying).round() as i32;
        root.draw(&text(name, layout.left - 6, y, HPos::Right, VPos::Center))?;
    }
    let frame = INK.mix(0.7).stroke_width(FINE as u32);
    root.draw(&PathElement::new([at(left, top), at(left, bottom), at(right, bottom)], frame))?;
    let x_label = format!("{}{}", chart.x.label, layout.x.suffix);
    root.draw(&text(&x_label, (layout.left + layout.right) / 2, layout.bottom + ROW_PX + 6, HPos::Center, VPos::Top))?;
    let y_label = format!("{}{}", chart.y.label, layout.y.suffix);
    let style = TextStyle::from(("sans-serif", f64::from(TEXT_PX * FINE) * 1.24).into_font())
        .transform(FontTransform::Rotate270)
        .color(&INK)
        .pos(Pos::new(HPos::Center, VPos::Top));
    root.draw(&Text::new(y_label, (6 * FINE, (layout.top + layout.bottom) / 2 * FINE), style))
}

fn draw_band(chart: &Chart, layout: &ChartLayout, root: &Area, band: &super::Band, lying: bool) -> Drawn {
    let (from, to) = (band.from.min(band.to), band.from.max(band.to));
    let corners = match band.along {
        Along::X => {
            let x = |v: f64| layout.x_px(chart.x.position(v).clamp(layout.x.low, layout.x.high));
            [at(x(from), f64::from(layout.top)), at(x(to), f64::from(layout.bottom))]
        }
        Along::Y => {
            let y = |v: f64| layout.y_px(chart.y.position(v).clamp(layout.y.low, layout.y.high), lying);
            [at(f64::from(layout.left), y(to)), at(f64::from(layout.right), y(from))]
        }
    };
    root.draw(&Rectangle::new(corners, colour(chart.hue_of(band)).mix(0.18).filled()))
}

fn draw_marks(chart: &Chart, layout: &ChartLayout, root: &Area, lying: bool) -> Drawn {
    let line = INK.mix(0.55).stroke_width(FINE as u32);
    let dash = |from: (i32, i32), to: (i32, i32)| DashedPathElement::new([from, to], 5 * FINE, 4 * FINE, line);
    for (mark, word) in chart.marks.iter().zip(&layout.mark_words) {
        match mark.along {
            Along::X if chart.x.admits(mark.value) => {
                let x = layout.x_px(chart.x.position(mark.value));
                let row = word.map_or(0, |w| w.0);
                let above = layout.top - 2 - row * MARK_ROW_PX;
                root.draw(&dash(at(x, f64::from(above)), at(x, f64::from(layout.bottom))))?;
                if let Some((_, start)) = word {
                    root.draw(&text(&mark.label, *start, above - 2, HPos::Left, VPos::Bottom))?;
                }
            }
            Along::Y if chart.y.admits(mark.value) => {
                let y = layout.y_px(chart.y.position(mark.value), lying);
                root.draw(&dash(at(f64::from(layout.left), y), at(f64::from(layout.right), y)))?;
                let (left, top) = labels::along_a_mark(chart, layout, &mark.label, y);
                root.draw(&text(&mark.label, left, top, HPos::Left, VPos::Top))?;
            }
            _ => {}
        }
    }
    Ok(())
}

/// Draws a run of points as a line, a dashed one, or, where it is one point, as a dot.
fn draw_run(
    root: &Area,
    run: &[(f64, f64)],
    is_dashed: bool,
    hue: RGBColor,
) -> Result<(), DrawingAreaErrorKind<std::io::Error>> {
    let path: Vec<(i32, i32)> = thin(run).into_iter().map(|(x, y)| at(x, y)).collect();
    if is_dashed {
        root.draw(&DashedPathElement::new(path, 6 * FINE, 4 * FINE, hue.stroke_width(3 * FINE as u32 / 2)))
    } else if path.len() == 1 {
        root.draw(&Circle::new(path[0], 2 * FINE, hue.filled()))
    } else {
        root.draw(&PathElement::new(path, hue.stroke_width(7 * FINE as u32 / 4)))
    }
}

/// Draws one series; whether there was anything to draw.
fn draw_series(
    chart: &Chart,
    layout: &ChartLayout,
    root: &Area,
    series: &ChartSeries,
    index: usize,
) -> Result<bool, DrawingAreaErrorKind<std::io::Error>> {
    let hue = colour(index);
    let place = |p: &(f64, f64)| {
        (chart.x.admits(p.0) && chart.y.admits(p.1))
            .then(|| (layout.x_px(chart.x.position(p.0)), layout.y_px(chart.y.position(p.1), false)))
    };
    let mut any = false;
    match series.shape {
        Shape::Line | Shape::Step | Shape::Dashed => {
            for run in runs(series.points.iter().map(place)) {
                any = true;
                let run = if series.shape == Shape::Step { steps(&run) } else { run };
                draw_run(root, &run, series.shape == Shape::Dashed, hue)?;
            }
        }
        Shape::Cells => {
            let most = series.largest_value().max(f64::MIN_POSITIVE);
            let half = (0.5 * series.cell.0, 0.5 * series.cell.1);
            for (&(x, y), value) in series.points.iter().zip(&series.values).filter(|(_, v)| v.is_finite()) {
                let (Some(low), Some(high)) = (place(&(x - half.0, y - half.1)), place(&(x + half.0, y + half.1)))
                else {
                    continue;
                };
                any = true;
                root.draw(&Rectangle::new([at(low.0, high.1), at(high.0, low.1)], tint(value / most)))?;
            }
        }
        Shape::Points => {
            for (&(x, y), error) in series.points.iter().zip(&series.errors) {
                // Down to the frame where the axis does not reach as far.
                let (Some(high), Some(middle)) = (place(&(x, y + error)), place(&(x, y))) else { continue };
                let low = place(&(x, y - error)).map_or(f64::from(layout.bottom), |p| p.1);
                let clamp = |y: f64| y.clamp(f64::from(layout.top), f64::from(layout.bottom));
                let bar = [at(middle.0, clamp(high.1)), at(middle.0, clamp(low))];
                root.draw(&PathElement::new(bar, hue.stroke_width(FINE as u32)))?;
            }
            let radius = if series.points.len() > 300 { 2 } else { 4 };
            for (x, y) in series.points.iter().filter_map(place) {
                any = true;
                root.draw(&Circle::new(at(x, y), radius * FINE, hue.mix(0.85).filled()))?;
            }
        }
        Shape::Histogram => {
            let floor = layout.y_px(layout.y.base(&chart.y), false);
            for pair in series.points.windows(2) {
                let (Some((x0, y0)), Some((x1, _))) = (place(&pair[0]), place(&(pair[1].0, pair[0].1))) else {
                    continue;
                };
                any = true;
                let gap = if x1 - x0 > 6.0 { 1.0 } else { 0.0 };
                root.draw(&Rectangle::new([at(x0, y0), at(x1 - gap, floor)], hue.mix(0.8).filled()))?;
            }
        }
        Shape::Bars => {
            for &(value, category) in series.points.iter().filter(|p| chart.x.admits(p.0)) {
                any = true;
                let (from, to, middle) = bar(chart, layout, index, value, category);
                root.draw(&Rectangle::new([at(from, middle - 6.0), at(to, middle + 6.0)], hue.mix(0.9).filled()))?;
            }
        }
    }
    Ok(any)
}

/// Where a lying bar is [px]: its ends and its middle across.
fn bar(chart: &Chart, layout: &ChartLayout, index: usize, value: f64, category: f64) -> (f64, f64, f64) {
    let bars = |of: &[ChartSeries]| of.iter().filter(|s| s.shape == Shape::Bars).count() as f64;
    let zero = layout.x_px(layout.x.base(&chart.x));
    let x = layout.x_px(chart.x.position(value));
    let middle =
        layout.y_px(category, true) + (bars(&chart.series[..index]) - 0.5 * (bars(&chart.series) - 1.0)) * 14.0;
    (zero.min(x), zero.max(x).max(zero.min(x) + 1.0), middle)
}

/// The numbers at the ends of lying bars.
fn draw_bars_words(chart: &Chart, layout: &ChartLayout, root: &Area) -> Drawn {
    for (index, series) in chart.series.iter().enumerate().filter(|(_, s)| s.shape == Shape::Bars) {
        for &(value, category) in series.points.iter().filter(|p| chart.x.admits(p.0)) {
            let (from, to, middle) = bar(chart, layout, index, value, category);
            let words = series.labels.get(category as usize).cloned().unwrap_or_else(|| three_digits(value));
            let (h, place) = if value < 0.0 && !chart.x.is_log() {
                (HPos::Right, from as i32 - 4)
            } else {
                (HPos::Left, to as i32 + 4)
            };
            root.draw(&text(&words, place, middle.round() as i32, h, VPos::Center))?;
        }
    }
    Ok(())
}

/// The words beside points.
fn draw_labels(chart: &Chart, layout: &ChartLayout, root: &Area) -> Drawn {
    for (series, places) in chart.series.iter().zip(labels::places(chart, layout)) {
        for ((word, point), place) in series.labels.iter().zip(&series.points).zip(places) {
            let Some(place) = place else { continue };
            if place.is_far {
                let (x, y) = (layout.x_px(chart.x.position(point.0)), layout.y_px(chart.y.position(point.1), false));
                let to = place.left + if place.left < x { f64::from(text_width_px(word)) } else { 0.0 };
                root.draw(&PathElement::new([at(x, y), at(to, place.middle)], INK.mix(0.4).stroke_width(FINE as u32)))?;
            }
            root.draw(&text(word, place.left as i32, place.middle as i32, HPos::Left, VPos::Center))?;
        }
    }
    Ok(())
}

/// Splits at the gaps.
fn runs(points: impl Iterator<Item = Option<(f64, f64)>>) -> Vec<Vec<(f64, f64)>> {
    let mut runs: Vec<Vec<(f64, f64)>> = vec![Vec::new()];
    for point in points {
        match (point, runs.last_mut()) {
            (Some(point), Some(run)) => run.push(point),
            _ => runs.push(Vec::new()),
        }
    }
    runs.retain(|r| !r.is_empty());
    runs
}

fn steps(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut corners = Vec::with_capacity(2 * points.len());
    for pair in points.windows(2) {
        corners.extend([pair[0], (pair[1].0, pair[0].1)]);
    }
    corners.extend(points.last());
    corners
}

/// Keeps first, lowest, highest and last of the points that fall on one pixel column: what the eye would see.
fn thin(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut kept = Vec::new();
    let mut rest = points;
    while let Some(first) = rest.first() {
        let column = first.0.floor();
        let count = rest.iter().take_while(|p| p.0.floor() == column).count();
        let (here, later) = rest.split_at(count);
        if count <= 4 {
            kept.extend_from_slice(here);
        } else {
            let by_y = |a: &usize, b: &usize| here[*a].1.total_cmp(&here[*b].1);
            let lowest = (0..count).min_by(by_y).unwrap_or(0);
            let highest = (0..count).max_by(by_y).unwrap_or(0);
            let mut indices = [0, lowest.min(highest), lowest.max(highest), count - 1].to_vec();
            indices.dedup();
            kept.extend(indices.into_iter().map(|i| here[i]));
        }
        rest = later;
    }
    kept
}
