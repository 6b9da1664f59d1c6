//! The cross-section on a traveller's page, drawn again from the segments: every bar, arrow, arc and word.

use super::Expected;
use crate::verify::winding::runs_outbound;

const WIDTH: f64 = 560.0;
const ROW: f64 = 17.0;
const TOP: f64 = 58.0;
/// Where the pack lies between the flanges.
const PACK: [f64; 2] = [150.0, 410.0];
/// In the order in which the reels are listed.
const OF_REEL: [&str; 8] = ["#2f7fd6", "#d9730d", "#1a9850", "#9b5fc0", "#d64550", "#179aa2", "#a5744a", "#7d8590"];
const INK: &str = "currentColor";

/// `reels` are the names as listed, `of_layer` the place in that list of each layer's.
#[expect(clippy::too_many_lines, reason = "the drawing as the page has it, tag after tag")]
pub(super) fn draw(page: &mut Expected, title: &str, segments: &[usize], reels: &[String], of_layer: &[usize]) {
    let count = segments.len();
    let height = TOP + ROW * count as f64 + 44.0;
    page.tags(&format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"chart\" role=\"img\" width=\"{WIDTH}\" height=\"{height}\" \
         viewBox=\"0 0 {WIDTH} {height}\">"
    ));
    page.element(None, "the drawing's title", "<title>", title);
    page.style_of_drawing();
    let word = |x: f64, y: f64, size: f64, anchor: &str| {
        let anchor = if anchor.is_empty() { String::new() } else { format!(" text-anchor=\"{anchor}\"") };
        format!("<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\"{anchor} fill=\"{INK}\">")
    };
    page.element(
        None,
        "the drawing's title",
        &format!("<text x=\"12\" y=\"20\" font-size=\"14\" font-weight=\"bold\" fill=\"{INK}\">"),
        title,
    );
    let apart = (80.0_f64).min((WIDTH - 24.0) / reels.len().max(1) as f64);
    let colour = |reel: usize| OF_REEL[reel % OF_REEL.len()];
    let of_layer = |layer: usize| colour(of_layer.get(layer).copied().unwrap_or(0));
    for (i, name) in reels.iter().enumerate() {
        let x = 12.0 + apart * i as f64;
        page.tags(&format!("<rect x=\"{x}\" y=\"28\" width=\"14\" height=\"11\" fill=\"{}\"></rect>", colour(i)));
        page.element(None, "a reel's name", &word(32.0 + apart * i as f64, 38.0, 12.0, ""), &format!("reel {name}"));
    }
    page.element(None, "a heading", &word(12.0, TOP - 6.0, 11.0, ""), "layer");
    page.element(None, "a heading", &word(WIDTH - 12.0, TOP - 6.0, 11.0, "end"), "segment");
    let middle = |layer: usize| TOP + ROW * (count - 1 - layer) as f64 + ROW / 2.0;
    let outbound = runs_outbound(segments);
    let centre = (PACK[0] + PACK[1]) / 2.0;
    for (layer, &segment) in segments.iter().enumerate() {
        let (y, half) = (middle(layer), usize::from(2 * segment > count));
        page.tags(&format!(
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" rx=\"3\" fill=\"{}\" fill-opacity=\"0.85\"></rect>",
            PACK[0],
            y - ROW / 2.0 + 1.0,
            PACK[1] - PACK[0],
            ROW - 2.0,
            of_layer(layer)
        ));
        let way = if outbound[layer] { 1.0 } else { -1.0 };
        let (from, to, barb) = (centre - 45.0 * way, centre + 45.0 * way, -7.0 * way);
        page.tags(&format!(
            "<path d=\"M{from} {y}H{to}M{0} {1}L{to} {y}L{0} {2}\" fill=\"none\" stroke=\"#fff\" stroke-width=\"1.6\"></path>",
            to + barb,
            y - 4.0,
            y + 4.0
        ));
        let here = Some(layer + 1);
        page.element(here, "the drawn layer", &word(34.0, y + 4.0, 11.0, "end"), &(layer + 1).to_string());
        let name = format!("{} {segment}", ["A", "B"][half]);
        page.element(here, "the drawn segment", &word(WIDTH - 12.0, y + 4.0, 11.0, "end"), &name);
    }
    let layer_of = |segment: usize| segments.iter().position(|s| *s == segment).unwrap_or(0);
    for segment in 1..count {
        let (from, to) = (layer_of(segment), layer_of(segment + 1));
        let side = if outbound[from] { 1.0 } else { -1.0 };
        let bulge = (8.0 + 5.0 * from.abs_diff(to) as f64).min(90.0) * 4.0 / 3.0 * side;
        let x = if outbound[from] { PACK[1] + 2.0 } else { PACK[0] - 2.0 };
        let at_middle = 2 * segment == count;
        let stroke = if at_middle { INK } else { of_layer(from) };
        page.tags(&format!(
            "<path d=\"M{x} {0}C{2} {0} {2} {1} {x} {1}\" fill=\"none\" stroke=\"{stroke}\" stroke-width=\"{3}\"></path>",
            middle(from),
            middle(to),
            x + bulge,
            if at_middle { 2.2 } else { 1.2 }
        ));
    }
    let below = height - 26.0;
    let (left, right, y) = (PACK[0] - 6.0, PACK[1] + 6.0, below - 12.0);
    page.tags(&format!(
        "<line x1=\"{left}\" x2=\"{right}\" y1=\"{y}\" y2=\"{y}\" stroke=\"{INK}\" stroke-width=\"3\"></line>"
    ));
    for (x, name) in [(PACK[0], "first flange"), (centre, "spool"), (PACK[1], "second flange")] {
        page.element(None, "a heading", &word(x, below + 4.0, 11.0, "middle"), name);
    }
    let legend = "arrows: from end A to end B; arcs: crossovers, black or white at the midpoint";
    page.element(None, "a heading", &word(centre, below + 20.0, 10.5, "middle"), legend);
    page.tags("</svg>");
}
