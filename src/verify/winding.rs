//! What the rows of a schedule wind, read back into pieces of fibre.
//!
//! A row a layer, innermost first. Turns that are missing on the layer of the first or last segment were left off at that end of the
//! fibre; one more row on the outermost layer winds what was added at the other end. Where such a piece lies along the axis follows
//! from what it hangs on: it begins at the flange at which the fibre comes from, or goes on to, the next piece.

use super::physics::wound_turns;
use super::{Claim, Findings, Printed, Truth};
use crate::coil::LayerLength;

/// l_j again: from radius and turns, or equal shares.
pub(super) fn layer_lengths_m(truth: &Truth) -> Vec<f64> {
    let raw = &truth.model.coil;
    let wound = wound_turns(truth.model);
    let layers = raw.layers();
    let (share_m, crossover) = (raw.length_m() / layers as f64, raw.crossover_turns());
    (0..layers)
        .map(|j| match raw.layer_length() {
            LayerLength::Equal => share_m * (wound[j] + crossover) / (raw.turns()[j] + crossover),
            LayerLength::Actual => {
                let radius_m = raw.bore_radius_m() + raw.radial_pitch_m() * (j as f64 + 0.5);
                2.0 * std::f64::consts::PI * radius_m * (wound[j] + crossover)
            }
        })
        .collect()
}

/// Whether arclength grows from the first flange to the second, a layer: segments alternate along the fibre.
pub(super) fn runs_outbound(segments: &[usize]) -> Vec<bool> {
    let count = segments.len();
    let first_from_low_end = begins_low(segments[0], count);
    segments.iter().map(|s| ((s % 2) == (segments[0] % 2)) == first_from_low_end).collect()
}

/// A segment that continues nothing begins with the fibre's own end, else with the end nearer to the middle.
pub(super) fn begins_low(segment: usize, count: usize) -> bool {
    segment == 1 || (segment < count && 2 * segment > count)
}

const COUNT_FROM_ONE: &str = "keep one row a layer, innermost first, numbered from 1";
const WIND_ONCE: &str = "every segment is wound exactly once: correct the segment or the missing row";
const ROOM: &str =
    "turns are added only in the room that the outermost layer's own segment leaves: emit the schedule again";

/// One stretch of fibre on one layer.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    /// Counted from 0, innermost first.
    pub(crate) layer: usize,
    pub(crate) is_of_half_a: bool,
    pub(crate) turns: f64,
    pub(crate) whole_turns: f64,
    /// Turns that would fit between the first flange and the piece.
    pub(crate) free_turns: f64,
    pub(crate) from_m: f64,
    pub(crate) to_m: f64,
    pub(crate) length_m: f64,
    pub(crate) outbound: bool,
    /// Begins with its low end where it continues nothing.
    pub(crate) begins_low: bool,
}

/// A winding of a coil.
#[derive(Debug, Clone)]
pub(super) struct Winding {
    /// By layer, innermost first.
    pub(crate) segments: Vec<usize>,
    /// Turns more or fewer at end A and at end B.
    pub(crate) ends: [i64; 2],
    /// In the order of arclength from end A.
    pub(crate) pieces: Vec<Piece>,
    /// Of each row, its place among the pieces.
    pub(crate) order: Vec<usize>,
}

/// Rows that could be a winding.
struct Rows {
    segments: Vec<usize>,
    /// Turns of the row beyond the last layer, and whether they are end A's.
    added: Option<(f64, bool)>,
}

/// What the rows wind, if they are a winding of this coil at all.
#[expect(clippy::too_many_lines, reason = "ends, pieces and order follow from each other by what is worked out once")]
pub(super) fn read(truth: &Truth, claim: &Claim, findings: &mut Findings) -> Option<Winding> {
    let Rows { segments, added } = rows(truth, claim, findings)?;
    let count = segments.len();
    let whole = wound_turns(truth.model);
    let layer_of = |segment: usize| segments.iter().position(|s| *s == segment).unwrap_or(0);
    let (of_a, of_b) = (layer_of(1), layer_of(count));
    let left_off = |layer: usize| -> i64 {
        let change = claim.rows[layer].turns - whole[layer];
        let is_whole = (change - change.round()).abs() <= Printed::Plain.tolerance();
        if is_whole && change < 0.0 && claim.rows[layer].turns > 0.5 { change.round() as i64 } else { 0 }
    };
    let mut ends = [left_off(of_a), left_off(of_b)];
    if let Some((turns, is_of_a)) = added {
        findings.checks += 1;
        let (end, room) = if is_of_a { (0, -ends[1]) } else { (1, -ends[0]) };
        let stated = turns.round() as i64;
        if (turns - turns.round()).abs() > Printed::Plain.tolerance() || stated < 1 || stated > room {
            let expected = format!("a whole number from 1 to {room}");
            findings.add(Some(count + 1), "turns", expected, turns.to_string(), ROOM);
        }
        ends[end] = stated.clamp(0, room);
    }
    let lengths_m = layer_lengths_m(truth);
    let crossover = truth.model.coil.crossover_turns();
    let outbound = runs_outbound(&segments);
    let piece = |layer: usize, segment: usize, turns: f64, outbound: bool| {
        // End A's fibre hangs on the rest by its high end, end B's by its low end.
        let is_of_half_a = 2 * segment <= count;
        let (is_short, joins_at_high) = (turns < whole[layer], segment == 1);
        let is_at_second = is_short && outbound == joins_at_high;
        Piece {
            layer,
            is_of_half_a,
            turns,
            whole_turns: whole[layer],
            free_turns: if is_at_second { whole[layer] - turns } else { 0.0 },
            from_m: 0.0,
            to_m: 0.0,
            length_m: lengths_m[layer] * (turns + crossover) / (whole[layer] + crossover),
            outbound,
            begins_low: begins_low(segment, count),
        }
    };
    let mut pieces: Vec<Piece> = (1..=count)
        .map(|segment| {
            let layer = layer_of(segment);
            let fewer = if segment == 1 {
                ends[0].min(0)
            } else if segment == count {
                ends[1].min(0)
            } else {
                0
            };
            piece(layer, segment, whole[layer] + fewer as f64, outbound[layer])
        })
        .collect();
    let mut order: Vec<usize> = segments.iter().map(|segment| segment - 1).collect();
    match added {
        Some((_, true)) => {
            pieces.insert(0, piece(count - 1, 1, ends[0] as f64, !outbound[of_a]));
            order.iter_mut().for_each(|place| *place += 1);
            order.push(0);
        }
        Some((_, false)) => {
            pieces.push(piece(count - 1, count, ends[1] as f64, !outbound[of_b]));
            order.push(count);
        }
        None => {}
    }
    let mut at_m = 0.0;
    for piece in &mut pieces {
        piece.from_m = at_m;
        at_m += piece.length_m;
        piece.to_m = at_m;
    }
    Some(Winding { segments, ends, pieces, order })
}

fn rows(truth: &Truth, claim: &Claim, findings: &mut Findings) -> Option<Rows> {
    let layers = truth.model.coil.layers();
    let beyond = claim.rows.get(layers).filter(|row| claim.rows.len() == layers + 1 && row.layer == layers as i64);
    findings.checks += 1;
    let mut clean = claim.rows.len() == layers || beyond.is_some();
    if !clean {
        findings.add(None, "rows", layers.to_string(), claim.rows.len().to_string(), COUNT_FROM_ONE);
    }
    let of_layers = if beyond.is_some() { &claim.rows[..layers] } else { &claim.rows[..] };
    let mut wound_on = vec![0usize; layers + 1];
    for (i, row) in of_layers.iter().enumerate() {
        let here = Some(i + 1);
        for (field, found) in [("step", row.step), ("layer", row.layer)] {
            findings.checks += 1;
            if found != i as i64 + 1 {
                findings.add(here, field, (i + 1).to_string(), found.to_string(), COUNT_FROM_ONE);
            }
        }
        findings.checks += 1;
        match usize::try_from(row.segment).ok().filter(|s| (1..=layers).contains(s)) {
            None => {
                clean = false;
                findings.add(here, "segment", format!("from 1 to {layers}"), row.segment.to_string(), WIND_ONCE);
            }
            Some(segment) if wound_on[segment] > 0 => {
                clean = false;
                let expected = format!("a segment that is not wound yet (it is in row {})", wound_on[segment]);
                findings.add(here, "segment", expected, segment.to_string(), WIND_ONCE);
            }
            Some(segment) => wound_on[segment] = i + 1,
        }
    }
    if !clean {
        return None;
    }
    let segments: Vec<usize> = of_layers.iter().map(|row| row.segment as usize).collect();
    let Some(row) = beyond else { return Some(Rows { segments, added: None }) };
    let here = Some(layers + 1);
    findings.same(here, "step", &(layers as i64 + 1), &row.step);
    findings.checks += 1;
    let other_end = match segments[layers - 1] {
        1 => Some(layers),
        last if last == layers => Some(1),
        _ => None,
    };
    if other_end != usize::try_from(row.segment).ok() {
        let expected = other_end.map_or("no further row".to_owned(), |segment| segment.to_string());
        findings.add(here, "segment", expected, row.segment.to_string(), ROOM);
        return None;
    }
    Some(Rows { segments, added: Some((row.turns, row.segment == 1)) })
}
