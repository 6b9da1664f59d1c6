//! A pack's cross-section: which piece of fibre lies where, which way it runs, and where it passes from layer to layer.

use maud::{PreEscaped, html};

use super::plot;
use crate::pattern::{Half, Pattern};
use crate::text::sink::Markup;

const ROW_PX: f64 = 17.0;
const WIDTH_PX: f64 = 560.0;
const LEFT_PX: f64 = 150.0;
const RIGHT_PX: f64 = 410.0;
const TOP_PX: f64 = 58.0;
/// Room for the names of groups.
const NAMES_PX: f64 = WIDTH_PX - 24.0;
const NAME_PX: f64 = 80.0;
/// Of reels and halves; a page's style has the same (`page::STYLE`, `.r0` and on).
const COLOURS: [&str; 8] = ["#2f7fd6", "#d9730d", "#1a9850", "#9b5fc0", "#d64550", "#179aa2", "#a5744a", "#7d8590"];

/// What the colours of a drawing say of layers: which half of the fibre, or which reel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Groups {
    /// As the legend has them.
    pub(crate) names: Vec<String>,
    /// A place in `names` for each layer, innermost first.
    pub(crate) of_layer: Vec<usize>,
}

impl Groups {
    /// The halves of the fibre.
    pub(crate) fn halves(pattern: &Pattern) -> Self {
        Self {
            names: vec!["half A".to_owned(), "half B".to_owned()],
            of_layer: (0..pattern.layers()).map(|layer| usize::from(pattern.half(layer) == Half::B)).collect(),
        }
    }
}

/// The drawing as one `<svg>` element: layers from the spool (bottom) outwards, coloured by half.
///
/// Arrows show the way of increasing arclength, arcs beside the flanges the crossovers.
pub fn cross_section(title: &str, pattern: &Pattern) -> String {
    cross_section_in_groups(title, pattern, &Groups::halves(pattern))
}

/// As [`cross_section`], coloured by other groups of layers.
pub(crate) fn cross_section_in_groups(title: &str, pattern: &Pattern, groups: &Groups) -> String {
    let layers = pattern.layers();
    let height_px = TOP_PX + ROW_PX * layers as f64 + 44.0;
    let middle_px = |layer: usize| TOP_PX + ROW_PX * (layers - 1 - layer) as f64 + ROW_PX / 2.0;
    let by_segment = pattern.layers_by_segment();
    let outbound = |layer: usize| pattern.axial_direction(layer) > 0.0;
    let colour = |group: usize| COLOURS[group % COLOURS.len()];
    let group_of = |layer: usize| groups.of_layer.get(layer).copied().unwrap_or(0);
    let apart_px = NAME_PX.min(NAMES_PX / groups.names.len().max(1) as f64);
    let centre_px = (LEFT_PX + RIGHT_PX) / 2.0;
    let drawn = html! {
        svg xmlns="http://www.w3.org/2000/svg" class="chart" role="img" width=(WIDTH_PX) height=(height_px)
            viewBox={ "0 0 " (WIDTH_PX) " " (height_px) } {
            title { (title) }
            style { (PreEscaped(plot::STYLE)) }
            text x="12" y="20" font-size="14" font-weight="bold" fill="currentColor" { (title) }
            @for (i, words) in groups.names.iter().enumerate() {
                rect x=(12.0 + apart_px * i as f64) y="28" width="14" height="11" fill=(colour(i)) {}
                text x=(32.0 + apart_px * i as f64) y="38" font-size="12" fill="currentColor" { (words) }
            }
            text x="12" y=(TOP_PX - 6.0) font-size="11" fill="currentColor" { "layer" }
            text x=(WIDTH_PX - 12.0) y=(TOP_PX - 6.0) font-size="11" text-anchor="end" fill="currentColor" { "segment" }
            @for layer in 0..layers {
                @let y = middle_px(layer);
                @let half = pattern.half(layer);
                rect x=(LEFT_PX) y=(y - ROW_PX / 2.0 + 1.0) width=(RIGHT_PX - LEFT_PX) height=(ROW_PX - 2.0)
                    rx="3" fill=(colour(group_of(layer))) fill-opacity="0.85" {}
                @let (from, to) = if outbound(layer) { (centre_px - 45.0, centre_px + 45.0) } else { (centre_px + 45.0, centre_px - 45.0) };
                @let head = if outbound(layer) { -7.0 } else { 7.0 };
                path d={ "M" (from) " " (y) "H" (to) "M" (to + head) " " (y - 4.0) "L" (to) " " (y) "L" (to + head) " " (y + 4.0) }
                    fill="none" stroke="#fff" stroke-width="1.6" {}
                text x="34" y=(y + 4.0) font-size="11" text-anchor="end" fill="currentColor" { (layer + 1) }
                text x=(WIDTH_PX - 12.0) y=(y + 4.0) font-size="11" text-anchor="end" fill="currentColor" {
                    (half) " " (pattern.segment(layer))
                }
            }
            @for s in 1..layers {
                @let (from, to) = (by_segment[s - 1], by_segment[s]);
                // Where a layer with growing arclength outbound ends: at the second flange.
                @let right = outbound(from);
                @let climb = from.abs_diff(to) as f64;
                @let bulge = (8.0 + 5.0 * climb).min(90.0) * 4.0 / 3.0 * if right { 1.0 } else { -1.0 };
                @let x = if right { RIGHT_PX + 2.0 } else { LEFT_PX - 2.0 };
                path d={ "M" (x) " " (middle_px(from)) "C" (x + bulge) " " (middle_px(from)) " " (x + bulge) " " (middle_px(to)) " " (x) " " (middle_px(to)) }
                    fill="none" stroke=(if 2 * s == layers { "currentColor" } else { colour(group_of(from)) })
                    stroke-width=(if 2 * s == layers { 2.2 } else { 1.2 }) {}
            }
            @let below = height_px - 26.0;
            line x1=(LEFT_PX - 6.0) x2=(RIGHT_PX + 6.0) y1=(below - 12.0) y2=(below - 12.0) stroke="currentColor" stroke-width="3" {}
            text x=(LEFT_PX) y=(below + 4.0) font-size="11" text-anchor="middle" fill="currentColor" { "first flange" }
            text x=(centre_px) y=(below + 4.0) font-size="11" text-anchor="middle" fill="currentColor" { "spool" }
            text x=(RIGHT_PX) y=(below + 4.0) font-size="11" text-anchor="middle" fill="currentColor" { "second flange" }
            text x=(centre_px) y=(below + 20.0) font-size="10.5" text-anchor="middle" fill="currentColor" {
                "arrows: from end A to end B; arcs: crossovers, black or white at the midpoint"
            }
        }
    };
    Markup::of(&drawn.into_string()).into_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pattern::classic::Classic;

    #[test]
    fn every_layer_and_every_crossover_is_drawn_once() {
        let svg = cross_section("qua", &Classic::Qua.pattern(12).unwrap());
        assert_eq!(svg.matches("fill-opacity=\"0.85\"").count(), 12);
        assert_eq!(svg.matches("stroke-width=\"1.2\"").count() + svg.matches("stroke-width=\"2.2\"").count(), 11);
    }
}
