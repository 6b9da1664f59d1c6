//! The order of work at the winding machine: which piece of fibre goes on which layer, from which reel, which way.
//!
//! Winding goes from the innermost layer outwards. The unwound fibre is in runs, each on a supply reel. Reel A holds
//! the run with end A, reel B the run with end B; a run both of whose ends are on the coil already is *captive* and
//! gets a reel of its own, C1, C2, …, which must travel around the coil.
//!
//! A layer continues the fibre of a neighbouring segment where one is wound already. Else it begins a new island: with
//! the fibre's own end if it is the first or last segment, with the end nearer to the fibre's middle otherwise (so a
//! standard winding begins at the midpoint). Which way the carriage then travels follows from
//! [`Pattern::axial_direction`]. Turns that are added at an end of the fibre are a step of their own, the last, on the outermost
//! layer.
//!
//! Leaves out: the length of the crossovers themselves, the helix' slant, and fibre beyond the pack.

pub(crate) mod production;
mod reels;

use crate::coil::Coil;
use crate::pattern::windability::WindingGraph;
use crate::pattern::{Half, Pattern};
use crate::rate::{Laid, RateError};
use crate::thermal::Flange;
pub(crate) use reels::{Reel, ReelName};
use reels::{Reels, SegmentStart};

/// One layer's winding.
#[derive(Debug, Clone, PartialEq)]
pub struct ScheduleStep {
    /// Counted from 1, as layers and segments are.
    pub(crate) step: usize,
    pub(crate) layer: usize,
    pub(crate) half: Half,
    pub(crate) segment: usize,
    pub(crate) supply_reel: ReelName,
    /// The flange at which the layer starts; it ends at the other one.
    pub(crate) from_flange: Flange,
    /// How the spool turns, seen from the first flange, so that all fibre circulates the same way along arclength.
    pub(crate) rotation: Rotation,
    pub(crate) turns: f64,
    /// Turns that would fit between the first flange and where the layer's turns begin; 0 but for a layer with turns left off.
    pub(crate) free_turns: f64,
    /// Turns left free between the flange at which the layer starts and its first turn: above 0 only where the fibre's own end,
    /// with turns left off, is wound first.
    pub(crate) start_gap_turns: f64,
    /// Arclength from end A: the segment's low end, whichever end is wound first.
    pub(crate) fibre_from_m: f64,
    pub(crate) fibre_to_m: f64,
    pub(crate) length_m: f64,
    pub(crate) radius_m: f64,
    /// Largest climb of the crossovers that this step completes \[layers\].
    pub(crate) climb: usize,
    /// The crossovers that this step completes, the one at its start first.
    pub(crate) crossovers: Vec<Crossing>,
    /// Drawn from the supply reel so far, this step included.
    pub(crate) cumulative_m: f64,
    /// Wound of half A less wound of half B, this step included.
    pub(crate) balance_m: f64,
    /// Reels with fibre on them after this step, and how many of them are captive.
    pub(crate) reels_left: usize,
    pub(crate) captive_left: usize,
}

/// Seen from the first flange.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Rotation {
    /// A layer that is wound from its low end.
    Clockwise,
    /// A layer that is wound from its high end.
    Counterclockwise,
}

/// The fibre passing from a layer that is wound to this one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Crossing {
    pub(crate) flange: Flange,
    /// Counted from 1.
    pub(crate) from_layer: usize,
    /// In layers, inwards or outwards alike.
    pub(crate) climb: usize,
}

/// A coil's winding, step by step.
#[derive(Debug, Clone, PartialEq)]
pub struct Schedule {
    pattern: Pattern,
    steps: Vec<ScheduleStep>,
    reels: Vec<Reel>,
    length_m: f64,
    start_mark_m: f64,
}

impl Schedule {
    /// # Errors
    /// A pattern of another layer count than the coil's.
    #[expect(clippy::too_many_lines, reason = "a step field by field, in the order of the schedule's columns")]
    pub fn new(coil: &Coil, pattern: &Pattern) -> Result<Self, RateError> {
        let Laid { pieces, .. } = Laid::new(coil, pattern)?;
        let mut ends_m = vec![0.0];
        ends_m.extend(pieces.iter().map(|piece| piece.to_m));
        let order = pattern.winding_order();
        let graph_steps = WindingGraph::new(pattern).steps();
        let first_start = island_start(pattern, 0);
        let mut reels = Reels::new(order[0] + 1, first_start, &ends_m);
        let mut balance_m = 0.0;
        let mut steps = Vec::with_capacity(order.len());
        for (number, (&at, graph_step)) in order.iter().zip(&graph_steps).enumerate() {
            let piece = &pieces[at];
            let start = match (graph_step.joined_low, graph_step.joined_high) {
                (Some(_), _) => SegmentStart::Low,
                (None, Some(_)) => SegmentStart::High,
                (None, None) => island_start(pattern, piece.layer),
            };
            let (low_flange, high_flange) =
                if piece.direction > 0.0 { (Flange::First, Flange::Second) } else { (Flange::Second, Flange::First) };
            let crossing = |joined: Option<usize>, neighbour: usize, flange: Flange| {
                let from_layer = pieces.get(neighbour)?.layer + 1;
                joined.map(|climb| Crossing { flange, from_layer, climb })
            };
            // An end without a neighbour is not joined.
            let mut crossovers: Vec<Crossing> = [
                crossing(graph_step.joined_low, at.wrapping_sub(1), low_flange),
                crossing(graph_step.joined_high, at + 1, high_flange),
            ]
            .into_iter()
            .flatten()
            .collect();
            let from_flange = if start == SegmentStart::Low { low_flange } else { high_flange };
            let whole_turns = coil.turns()[piece.layer];
            let start_gap_turns = match from_flange {
                _ if piece.share >= 1.0 => 0.0,
                Flange::First => piece.free_turns,
                Flange::Second => whole_turns - piece.free_turns - piece.turns,
            };
            crossovers.sort_by_key(|c| c.flange != from_flange);
            let (supply_reel, cumulative_m) = reels.wind(number + 1, at + 1, start);
            let half = piece.added_at.unwrap_or_else(|| pattern.half(piece.layer));
            balance_m += if half == Half::A { piece.length_m } else { -piece.length_m };
            steps.push(ScheduleStep {
                step: number + 1,
                layer: piece.layer + 1,
                half,
                segment: piece.segment,
                supply_reel,
                from_flange,
                rotation: if start == SegmentStart::Low { Rotation::Clockwise } else { Rotation::Counterclockwise },
                turns: piece.turns,
                free_turns: piece.free_turns,
                start_gap_turns,
                fibre_from_m: piece.from_m,
                fibre_to_m: piece.to_m,
                length_m: piece.length_m,
                radius_m: coil.layer_radius_m(piece.layer),
                climb: graph_step.climb,
                crossovers,
                cumulative_m,
                balance_m,
                reels_left: graph_step.reels,
                captive_left: graph_step.captive,
            });
        }
        let start_mark_m = match first_start {
            SegmentStart::Low => pieces[order[0]].from_m,
            SegmentStart::High => pieces[order[0]].to_m,
        };
        Ok(Self {
            pattern: pattern.clone(),
            steps,
            reels: reels.into_list(),
            length_m: ends_m[pieces.len()],
            start_mark_m,
        })
    }

    pub(crate) fn pattern(&self) -> &Pattern {
        &self.pattern
    }

    /// In winding order.
    pub fn steps(&self) -> &[ScheduleStep] {
        &self.steps
    }

    /// In the order in which they come into use.
    pub(crate) fn reels(&self) -> &[Reel] {
        &self.reels
    }

    /// L.
    pub(crate) fn length_m(&self) -> f64 {
        self.length_m
    }

    /// The layer (counted from 1) in which the fibre's middle lies; the inner one where it lies between two.
    pub(crate) fn midpoint_layer(&self) -> usize {
        let middle_m = 0.5 * self.length_m;
        let rounding_m = 1e-10 * self.length_m;
        let holds =
            |s: &&ScheduleStep| s.fibre_from_m <= middle_m + rounding_m && s.fibre_to_m >= middle_m - rounding_m;
        self.steps.iter().find(holds).map_or(1, |s| s.layer)
    }

    /// The place of the fibre that is fixed at the first flange before layer 1: the midpoint, for most windings.
    pub(crate) fn start_mark_m(&self) -> f64 {
        self.start_mark_m
    }

    /// Segments of half A less those of half B: this much must be trimmed from end A (or, below zero, end B) for the
    /// joint of the halves to be the middle of the fibre. Nothing where the pattern itself says how many turns its ends have.
    pub(crate) fn expected_trim_m(&self) -> f64 {
        if !self.pattern.end_turns().is_none() {
            return 0.0;
        }
        self.steps.last().map_or(0.0, |s| s.balance_m)
    }
}

/// With which end a segment begins that continues nothing.
fn island_start(pattern: &Pattern, layer: usize) -> SegmentStart {
    let segment = pattern.segment(layer);
    if segment == 1 || (segment != pattern.layers() && pattern.half(layer) == Half::B) {
        SegmentStart::Low
    } else {
        SegmentStart::High
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coil::{CoilSpec, Fibre, LayerLength};
    use crate::pattern::classic::Classic;

    fn coil(layers: usize) -> Coil {
        Coil::new(CoilSpec {
            fibre: Fibre {
                refractive_index: 1.45,
                thermo_optic_per_k: 1e-5,
                group_index: None,
                thermal_expansion_per_k: 0.0,
                wavelength_m: 1.55e-6,
                outer_diameter_m: 165e-6,
            },
            layers,
            turns_per_layer: Some(50.0),
            bore_radius_m: 0.04,
            radial_pitch_m: 165e-6,
            axial_pitch_m: 170e-6,
            layer_length: LayerLength::Actual,
            length_m: None,
        })
        .unwrap()
    }

    fn reels_of(schedule: &Schedule) -> Vec<String> {
        schedule.steps().iter().map(|s| s.supply_reel.to_string()).collect()
    }

    #[test]
    fn the_quadrupole_alternates_between_reels_a_and_b_and_starts_at_the_midpoint() {
        let schedule = Schedule::new(&coil(8), &Classic::Qua.pattern(8).unwrap()).unwrap();
        assert_eq!(reels_of(&schedule), ["A", "B", "B", "A", "A", "B", "B", "A"]);
        let half_m: f64 = schedule.steps().iter().filter(|s| s.half == Half::A).map(|s| s.length_m).sum();
        assert!((schedule.start_mark_m() - half_m).abs() < 1e-9);
        // Both innermost layers start at the midpoint, at the first flange.
        assert_eq!((schedule.steps()[0].from_flange, schedule.steps()[1].from_flange), (Flange::First, Flange::First));
    }

    #[test]
    fn a_cylindrical_coil_comes_from_one_reel() {
        let schedule = Schedule::new(&coil(6), &Classic::Zyl.pattern(6).unwrap()).unwrap();
        assert_eq!(reels_of(&schedule), ["A"; 6]);
        assert_eq!(schedule.reels().len(), 1);
        assert!((schedule.steps()[5].cumulative_m - schedule.length_m()).abs() < 1e-9);
    }

    #[test]
    fn the_second_half_of_the_symmetric_winding_hangs_on_a_captive_reel() {
        let schedule = Schedule::new(&coil(6), &Classic::Sym.pattern(6).unwrap()).unwrap();
        assert_eq!(reels_of(&schedule), ["A", "A", "A", "C1", "C1", "C1"]);
        let captive = schedule.reels().iter().find(|r| r.captive).unwrap();
        assert_eq!((captive.prepared_before_step, captive.taken_from), (4, Some(ReelName::B)));
        // The last layer closes the fibre at both its ends.
        assert_eq!(schedule.steps()[5].crossovers.len(), 2);
    }

    #[test]
    fn for_every_pattern_of_six_layers_the_fibre_is_continuous_and_every_reel_is_emptied() {
        let coil = coil(6);
        for_each_permutation(6, &mut |segments| {
            let pattern = Pattern::new(segments.to_vec()).unwrap();
            let schedule = Schedule::new(&coil, &pattern).unwrap();
            let end_at = |segment: usize, high: bool| {
                let step = &schedule.steps()[pattern.layers_by_segment()[segment - 1]];
                let rises = pattern.axial_direction(step.layer - 1) > 0.0;
                if high == rises { Flange::Second } else { Flange::First }
            };
            for segment in 1..6 {
                assert_eq!(end_at(segment, true), end_at(segment + 1, false), "{pattern}");
            }
            for reel in schedule.reels() {
                let drawn_m: f64 =
                    schedule.steps().iter().filter(|s| s.supply_reel == reel.name).map(|s| s.length_m).sum();
                let given_m: f64 = schedule
                    .reels()
                    .iter()
                    .filter(|r| r.taken_from == Some(reel.name))
                    .map(|r| r.to_m - r.from_m)
                    .sum();
                assert!((drawn_m + given_m - (reel.to_m - reel.from_m)).abs() < 1e-9, "{pattern} {reel:?}");
            }
            for step in schedule.steps() {
                assert_eq!(step.climb, step.crossovers.iter().map(|c| c.climb).max().unwrap_or(0));
                if let Some(first) = step.crossovers.first() {
                    assert_eq!(first.flange, step.from_flange, "{pattern} {step:?}");
                }
            }
            let captive_reels = schedule.reels().iter().filter(|r| r.captive).count();
            let captive_most = schedule.steps().iter().map(|s| s.captive_left).max().unwrap_or(0);
            assert!(captive_reels >= captive_most, "{pattern}");
        });
    }

    fn for_each_permutation(n: usize, visit: &mut dyn FnMut(&[usize])) {
        fn descend(rest: &mut Vec<usize>, done: &mut Vec<usize>, visit: &mut dyn FnMut(&[usize])) {
            if rest.is_empty() {
                visit(done);
            }
            for i in 0..rest.len() {
                let segment = rest.remove(i);
                done.push(segment);
                descend(rest, done, visit);
                done.pop();
                rest.insert(i, segment);
            }
        }
        descend(&mut (1..=n).collect(), &mut Vec::new(), visit);
    }
}
