//! Words beside points: where they go so that none lies on another, on a point, or outside the frame.

use super::layout::{ChartLayout, TEXT_PX, text_width_px};
use super::{Chart, Shape};

/// Free space between a point and its word [px].
const GAP_PX: f64 = 7.0;
/// Half the side of the square that a point takes [px].
const POINT_PX: f64 = 5.0;
/// A word that finds no place beside its point goes up or down by so many of its heights at most.
const MOST_ROWS: i32 = 12;

/// A box [px]: left, top, right, bottom.
type Area = [f64; 4];

/// Where a word stands [px]: left edge, middle; whether it is so far from its point that a line should lead to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LabelPlace {
    pub(super) left: f64,
    pub(super) middle: f64,
    pub(super) is_far: bool,
}

fn overlap(a: &Area, b: &Area) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

/// For each series, for each of its points, where the word goes; none where there is no word or no point to see.
pub(super) fn places(chart: &Chart, layout: &ChartLayout) -> Vec<Vec<Option<LabelPlace>>> {
    let at = |p: &(f64, f64)| {
        (chart.x.admits(p.0) && chart.y.admits(p.1))
            .then(|| (layout.x_px(chart.x.position(p.0)), layout.y_px(chart.y.position(p.1), false)))
    };
    let points = chart.series.iter().filter(|s| s.shape == Shape::Points).flat_map(|s| s.points.iter().filter_map(at));
    let mut taken: Vec<Area> = points.map(|(x, y)| [x - POINT_PX, y - POINT_PX, x + POINT_PX, y + POINT_PX]).collect();
    let frame = [layout.left, layout.top, layout.right, layout.bottom].map(f64::from);
    let mut place = |x: f64, y: f64, word: &str| -> LabelPlace {
        let (wide, high) = (f64::from(text_width_px(word)), f64::from(TEXT_PX) + 2.0);
        let area = |left: f64, middle: f64| [left, middle - high / 2.0, left + wide, middle + high / 2.0];
        let sides = [x + GAP_PX, x - GAP_PX - wide, x - wide / 2.0];
        let near = [-0.6, 0.6, 0.0].into_iter().flat_map(|row| [(sides[0], row), (sides[1], row)]);
        let over = [(sides[2], -1.2), (sides[2], 1.2)];
        let far = (2..=MOST_ROWS).flat_map(|row| {
            let row = f64::from(row) * 0.9;
            [(sides[0], -row), (sides[0], row), (sides[1], -row), (sides[1], row)]
        });
        let fits = |of: &Area| {
            of[0] >= frame[0]
                && of[2] <= frame[2]
                && of[1] >= frame[1]
                && of[3] <= frame[3]
                && !taken.iter().any(|other| overlap(of, other))
        };
        let all = near.chain(over).chain(far);
        let found = all.map(|(left, row)| (left, y + row * high, row)).find(|(left, y, _)| fits(&area(*left, *y)));
        let (left, middle, row) = found.unwrap_or((sides[0], y, 0.0));
        taken.push(area(left, middle));
        LabelPlace { left, middle, is_far: row.abs() > 1.3 }
    };
    let of =
        |series: &super::ChartSeries, place: &mut dyn FnMut(f64, f64, &str) -> LabelPlace| -> Vec<Option<LabelPlace>> {
            let words = series.labels.iter().zip(&series.points);
            words.map(|(word, point)| at(point).map(|(x, y)| place(x, y, word))).collect()
        };
    chart
        .series
        .iter()
        .map(|series| if series.shape == Shape::Points { of(series, &mut place) } else { Vec::new() })
        .collect()
}

/// Left and upper edge [px] of the word on a level mark at the height `y`: above it or below, further right or left, where it
/// covers least of what is drawn.
pub(super) fn along_a_mark(chart: &Chart, layout: &ChartLayout, word: &str, y: f64) -> (i32, i32) {
    let (wide, high) = (text_width_px(word), TEXT_PX + 3);
    let free = (layout.right - layout.left - wide - 8).max(0);
    let lines = chart.series.iter().filter(|s| !matches!(s.shape, Shape::Bars | Shape::Cells | Shape::Histogram));
    let drawn: Vec<(f64, f64)> = lines
        .flat_map(|s| &s.points)
        .filter(|p| chart.x.admits(p.0) && chart.y.admits(p.1))
        .map(|p| (layout.x_px(chart.x.position(p.0)), layout.y_px(chart.y.position(p.1), false)))
        .collect();
    let covered = |left: i32, top: i32| {
        let area = [left, top, left + wide, top + high].map(f64::from);
        drawn.iter().filter(|(x, y)| *x > area[0] && *x < area[2] && *y > area[1] && *y < area[3]).count()
    };
    let (above, below) = (y as i32 - 3 - high, y as i32 + 3);
    let heights = [above, below].into_iter().filter(|top| *top >= layout.top && *top + high <= layout.bottom);
    let places = heights.flat_map(|top| (0..=8).map(move |part| (layout.right - 4 - wide - free * part / 8, top)));
    // The first of equals: at the right, above.
    places.min_by_key(|&(left, top)| covered(left, top)).unwrap_or((layout.right - 4 - wide, below))
}

#[cfg(test)]
mod tests {
    use super::super::{Axis, ChartSeries};
    use super::*;

    #[test]
    fn a_word_on_a_mark_keeps_clear_of_a_line_that_crosses_its_end() {
        let line: Vec<(f64, f64)> = (0..400).map(|i| (f64::from(i), if i < 200 { -8.0 } else { 1.0 })).collect();
        let chart =
            Chart::new("x").with(ChartSeries::line("", line)).mark(super::super::Mark::horizontal("limit", 0.5));
        let layout = ChartLayout::new(&chart);
        let y = layout.y_px(chart.y.position(0.5), false);
        let (left, top) = along_a_mark(&chart, &layout, "limit", y);
        assert!(top < y as i32 && left + text_width_px("limit") <= (layout.left + layout.right) / 2, "{left} {top}");
    }

    #[test]
    fn words_of_points_that_lie_together_lie_apart_and_inside_the_frame() {
        let names = ["qua", "oct", "hex", "captive-1", "captive-2", "zyl"];
        let mut points = vec![(3.0, 4.3); 5];
        points.push((3.02, 4.31));
        let chart = Chart::new("x")
            .x(Axis::linear("climb").reaching(0.0))
            .y(Axis::log("rate"))
            .with(ChartSeries::points("", points).labelled(names.map(str::to_owned).to_vec()));
        let layout = ChartLayout::new(&chart);
        let found: Vec<LabelPlace> = places(&chart, &layout)[0].iter().map(|p| p.unwrap()).collect();
        let area = |i: usize| {
            let LabelPlace { left, middle, .. } = found[i];
            [left, middle - 6.0, left + f64::from(text_width_px(names[i])), middle + 6.0]
        };
        for (i, name) in names.iter().enumerate() {
            assert!(area(i)[0] >= f64::from(layout.left) && area(i)[2] <= f64::from(layout.right), "{name}");
            assert!((0..i).all(|j| !overlap(&area(i), &area(j))), "{name}");
        }
    }
}
