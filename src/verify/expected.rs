//! Works a winding out again from nothing but the order of the segments, and compares.

use super::winding::{Piece, Winding};
use super::{Claim, Findings, Printed, Row, Truth};
use crate::units::{nm_from_m, um_from_m};

/// A reel as it comes into use: (name, before which step, from which reel, first and last segment).
type Loaded = (String, usize, Option<String>, usize, usize);

/// Follows the fibre: which reel holds which segment, which reel feeds which layer.
struct Supply {
    /// Of each segment (index 0 is unused): the reel that holds it, and none once it is wound.
    holder: Vec<Option<usize>>,
    loaded: Vec<Loaded>,
    captive_now: Vec<usize>,
    reels_now: Vec<usize>,
}

impl Supply {
    /// `order` counts pieces from 1.
    fn follow(order: &[usize], begins_low: &[bool]) -> (Self, Vec<usize>, Vec<bool>) {
        let count = order.len();
        let mut supply =
            Self { holder: vec![None; count + 1], loaded: Vec::new(), captive_now: Vec::new(), reels_now: Vec::new() };
        let first = order[0];
        let last_of_a = if begins_low[0] { first - 1 } else { first };
        let single = last_of_a == 0 || last_of_a == count;
        for (name, from, to) in [("A", 1, last_of_a), ("B", last_of_a + 1, count)] {
            if from <= to {
                let name = match (single, first == 1) {
                    (true, true) => "A",
                    (true, false) => "B",
                    _ => name,
                };
                supply.load(name.to_owned(), 1, None, from, to);
            }
        }
        let (mut fed_by, mut from_low) = (Vec::new(), Vec::new());
        for (i, &segment) in order.iter().enumerate() {
            let wound = |s: usize| s >= 1 && s <= count && supply.holder[s].is_none();
            let (low_joined, high_joined) = (segment > 1 && wound(segment - 1), segment < count && wound(segment + 1));
            let low = if low_joined { true } else { !high_joined && begins_low[i] };
            let (mut a, mut b) = (segment, segment);
            while a > 1 && supply.holder[a - 1].is_some() && supply.same_run(a - 1, a) {
                a -= 1;
            }
            while b < count && supply.holder[b + 1].is_some() && supply.same_run(b, b + 1) {
                b += 1;
            }
            if !low_joined && !high_joined && i > 0 {
                // An island: what is now held at both ends moves to a reel of its own.
                let (feed, left) =
                    if low { ((segment, b), (a, segment - 1)) } else { ((a, segment), (segment + 1, b)) };
                let held = supply.holder[segment].is_some_and(|reel| supply.loaded[reel].0.starts_with('C'));
                let feed_is_held = if low { feed.1 < count } else { feed.0 > 1 };
                if feed_is_held && !held {
                    supply.load_captive(i + 1, feed.0, feed.1);
                }
                if left.0 <= left.1 && left.0 > 1 && left.1 < count {
                    supply.load_captive(i + 1, left.0, left.1);
                }
            }
            fed_by.push(supply.holder[segment].unwrap_or(0));
            from_low.push(low);
            supply.holder[segment] = None;
            supply.count_runs(count);
        }
        (supply, fed_by, from_low)
    }

    /// Neighbouring unwound segments are always one run, except across the cut before the first layer.
    fn same_run(&self, low: usize, high: usize) -> bool {
        self.holder[low] == self.holder[high]
    }

    fn load(&mut self, name: String, step: usize, from: Option<String>, first: usize, last: usize) {
        let reel = self.loaded.len();
        self.loaded.push((name, step, from, first, last));
        self.holder[first..=last].fill(Some(reel));
    }

    fn load_captive(&mut self, step: usize, first: usize, last: usize) {
        let number = self.loaded.iter().filter(|l| l.0.starts_with('C')).count() + 1;
        let from = self.holder[first].map(|reel| self.loaded[reel].0.clone());
        self.load(format!("C{number}"), step, from, first, last);
    }

    fn count_runs(&mut self, count: usize) {
        let (mut runs, mut captive) = (0, 0);
        let mut s = 1;
        while s <= count {
            if self.holder[s].is_none() {
                s += 1;
                continue;
            }
            let first = s;
            while s <= count && self.holder[s].is_some() {
                s += 1;
            }
            runs += 1;
            captive += usize::from(first > 1 && s <= count);
        }
        self.reels_now.push(runs);
        self.captive_now.push(captive);
    }
}

/// Compares every field of every row, and what is claimed of the whole.
#[expect(
    clippy::too_many_lines,
    reason = "the columns of a row, in the schedule's order: what is counted along the rows is read by the next"
)]
pub(super) fn check(truth: &Truth, claim: &Claim, winding: &Winding, findings: &mut Findings) {
    let Winding { segments, pieces, order, .. } = winding;
    let count = segments.len();
    let coil = &truth.model.coil;
    let numbers: Vec<usize> = order.iter().map(|place| place + 1).collect();
    let low: Vec<bool> = order.iter().map(|place| pieces[*place].begins_low).collect();
    let (supply, fed_by, from_low) = Supply::follow(&numbers, &low);
    let mut step_of = vec![0usize; pieces.len()];
    for (i, place) in order.iter().enumerate() {
        step_of[*place] = i;
    }
    let mut drawn_m = vec![0.0; supply.loaded.len()];
    let mut balance_m = 0.0;
    let mut max_climb = 0;
    for (i, (row, &place)) in claim.rows.iter().zip(order).enumerate() {
        let here = Some(i + 1);
        let piece = &pieces[place];
        let layer = piece.layer + 1;
        let half = if piece.is_of_half_a { "A" } else { "B" };
        findings.same(here, "half", &half.to_owned(), &row.half);
        findings.same(here, "supply_reel", &supply.loaded[fed_by[i]].0, &row.supply_reel);
        let starts_at_first = piece.outbound == from_low[i];
        let (first_to_second, second_to_first) = ("first-to-second", "second-to-first");
        let direction = if starts_at_first { first_to_second } else { second_to_first };
        findings.same(here, "direction", &direction.to_owned(), &row.direction);
        findings.near(here, "turns", piece.turns, row.turns, Printed::Plain);
        findings.near(here, "fibre_from_m", piece.from_m, row.fibre_from_m, Printed::Metres);
        findings.near(here, "fibre_to_m", piece.to_m, row.fibre_to_m, Printed::Metres);
        findings.near(here, "length_m", piece.length_m, row.length_m, Printed::Metres);
        let radius_m = coil.bore_radius_m() + coil.radial_pitch_m() * (piece.layer as f64 + 0.5);
        findings.near(here, "radius_mm", radius_m, row.radius_m, Printed::Millimetres);
        let free_m = piece.free_turns * coil.axial_pitch_m();
        findings.near_if(here, "the place along the axis", free_m, row.free_m, Printed::Millimetres);
        // Crossovers to pieces that are wound already, the one at the start of this one first.
        let mut joints: Vec<(bool, usize)> = Vec::new();
        for (neighbour, at_low) in [(place.wrapping_sub(1), true), (place + 1, false)] {
            if pieces.get(neighbour).is_some_and(|_| step_of[neighbour] < i) {
                joints.push((at_low, pieces[neighbour].layer + 1));
            }
        }
        joints.sort_by_key(|(at_low, _)| *at_low != from_low[i]);
        let climb = joints.iter().map(|(_, from)| layer.abs_diff(*from)).max().unwrap_or(0);
        max_climb = max_climb.max(climb);
        findings.same(here, "climb", &(climb as i64), &row.climb);
        drawn_m[fed_by[i]] += piece.length_m;
        findings.near(here, "cumulative_m", drawn_m[fed_by[i]], row.cumulative_m, Printed::Metres);
        balance_m += if piece.is_of_half_a { piece.length_m } else { -piece.length_m };
        findings.near_if(here, "balance_m", balance_m, row.balance_m, Printed::Metres);
        let gap_turns =
            if starts_at_first { piece.free_turns } else { piece.whole_turns - piece.free_turns - piece.turns };
        let from_flange = if starts_at_first { "first" } else { "second" };
        let begins = (gap_turns > Printed::Plain.tolerance()).then(|| {
            let gap_turns = (gap_turns * 1e4).round() / 1e4;
            format!("begin {gap_turns} turns from the {from_flange} flange")
        });
        let crossovers = joints.iter().map(|(at_low, from)| {
            let flange = if *at_low == piece.outbound { "first" } else { "second" };
            let climb = layer.abs_diff(*from);
            let plural = if climb == 1 { "" } else { "s" };
            format!("{flange} flange, from layer {from}, {climb} layer{plural}")
        });
        let words: Vec<String> = begins.into_iter().chain(crossovers).collect();
        findings.same_if(here, "crossover", &words.join("; "), row.crossover.as_ref());
        let rotation = if from_low[i] { "cw" } else { "ccw" };
        findings.same_if(here, "rotation", &rotation.to_owned(), row.rotation.as_ref());
        findings.near_if(here, "axial_pitch_mm", coil.axial_pitch_m(), row.axial_pitch_m, Printed::Millimetres);
        check_winder(truth, row, here, piece.layer, findings);
        let changed = i == 0 || fed_by[i] != fed_by[i - 1];
        findings.same_if(here, "reel_change", &changed, row.reel_change.as_ref());
        let every = truth.shop.potting_every_layers;
        let goes_on = order.get(i + 1).is_some_and(|next| pieces[*next].layer == piece.layer);
        let potting = !goes_on && (layer == count || (every > 0 && layer as i64 % every == 0));
        findings.same_if(here, "potting", &potting, row.potting.as_ref());
    }
    check_segments(claim, segments, findings);
    check_ends(claim, winding.ends, findings);
    check_name(claim, winding, findings);
    check_whole(claim, &supply, max_climb, findings);
    check_reels(truth, claim, &supply, pieces, findings);
    check_fibre(truth, claim, winding, balance_m, findings);
    if let Some(found) = &claim.shop {
        check_shop(truth, found, findings);
    }
}

/// What the winding machine is set to for a row.
fn check_winder(truth: &Truth, row: &Row, here: Option<usize>, layer: usize, findings: &mut Findings) {
    let shop = truth.shop;
    let tension_n = shop.tension_n * (1.0 - shop.tension_taper_per_layer * layer as f64).max(0.0);
    findings.near_if(here, "tension_n", tension_n, row.tension_n, Printed::Plain);
    for (field, sign, found) in [("tension_min_n", -1.0, row.tension_min_n), ("tension_max_n", 1.0, row.tension_max_n)]
    {
        findings.near_if(here, field, tension_n * (1.0 + sign * shop.tension_limit), found, Printed::Plain);
    }
    let speed = shop.winding_speed_turns_per_min;
    findings.near_if(here, "turns_per_min", speed, row.turns_per_min, Printed::Plain);
}

fn check_segments(claim: &Claim, segments: &[usize], findings: &mut Findings) {
    let claimed: Vec<i64> = segments.iter().map(|&s| s as i64).collect();
    findings.checks += 1;
    if let Some(found) = claim.segments.as_ref().filter(|found| **found != claimed) {
        findings.add(
            None,
            "segments",
            format!("{claimed:?}, as the rows have it"),
            format!("{found:?}"),
            super::EMIT_AGAIN,
        );
    }
}

/// The fibre as a whole: its words, its middle, where winding starts and what is left over.
fn check_fibre(truth: &Truth, claim: &Claim, winding: &Winding, balance_m: f64, findings: &mut Findings) {
    let Winding { pieces, order, .. } = winding;
    let length_m = pieces.last().map_or(0.0, |piece| piece.to_m);
    findings.near_if(None, "length_m", length_m, claim.length_m, Printed::Metres);
    let fibre = truth.model.coil.fibre();
    let (coated_um, wave_nm) = (um_from_m(fibre.outer_diameter_m), nm_from_m(fibre.wavelength_m));
    let fibre = format!("{coated_um:.1} µm over the coating, n {} at {wave_nm:.0} nm", fibre.refractive_index);
    findings.same_if(None, "fibre", &fibre, claim.fibre.as_ref());
    let middle_m = 0.5 * length_m;
    findings.near_if(None, "midpoint_m", middle_m, claim.midpoint_m, Printed::Metres);
    // Exactly between two pieces, up to rounding, the one that is wound first.
    let slack_m = 1e-10 * length_m;
    let holds = |place: &usize| (pieces[*place].from_m - slack_m..=pieces[*place].to_m + slack_m).contains(&middle_m);
    let of_middle = order.iter().find(|place| holds(place)).map_or(0, |place| pieces[*place].layer as i64 + 1);
    findings.same_if(None, "midpoint_layer", &of_middle, claim.midpoint_layer.as_ref());
    let first = &pieces[order[0]];
    let start_m = if first.begins_low { first.from_m } else { first.to_m };
    findings.near_if(None, "start_mark_m", start_m, claim.start_mark_m, Printed::Metres);
    // Ends with turns of their own are as long as they shall be.
    let trim_m = if winding.ends == [0, 0] { balance_m } else { 0.0 };
    findings.near_if(None, "expected_trim_m", trim_m, claim.expected_trim_m, Printed::Metres);
}

fn check_whole(claim: &Claim, supply: &Supply, max_climb: usize, findings: &mut Findings) {
    let captive = supply.captive_now.iter().copied().max().unwrap_or(0);
    let class = if captive == 0 { "standard".to_owned() } else { format!("captive:{captive}") };
    findings.same_if(None, "windability.class", &class, claim.class.as_ref());
    let reels = supply.reels_now.iter().copied().max().unwrap_or(0).max(1);
    findings.same_if(None, "windability.reels", &(reels as i64), claim.reels.as_ref());
    findings.same_if(None, "windability.captive", &(captive as i64), claim.captive.as_ref());
    findings.same_if(None, "windability.max_climb", &(max_climb as i64), claim.max_climb.as_ref());
}

/// What a document says of the ends must be what its rows wind; without any it says nothing.
fn check_ends(claim: &Claim, ends: [i64; 2], findings: &mut Findings) {
    if !claim.is_document {
        return;
    }
    let shown = |turns: Option<i64>| turns.map_or("nothing".to_owned(), |turns| turns.to_string());
    for ((field, turns), found) in ["end_a_turns", "end_b_turns"].into_iter().zip(ends).zip(claim.end_turns) {
        let expected = (ends != [0, 0]).then_some(turns);
        findings.same(None, field, &shown(expected), &shown(found));
    }
}

fn check_reels(truth: &Truth, claim: &Claim, supply: &Supply, pieces: &[Piece], findings: &mut Findings) {
    let Some(reels) = &claim.supply else { return };
    findings.same(None, "reels", &supply.loaded.len(), &reels.len());
    for (i, (reel, (name, step, from, first, last))) in reels.iter().zip(&supply.loaded).enumerate() {
        let field = |key: &str| format!("reels[{i}].{key}");
        findings.same(None, &field("name"), name, &reel.name);
        findings.same(None, &field("captive"), &name.starts_with('C'), &reel.captive);
        findings.same(None, &field("prepared_before_step"), &(*step as i64), &reel.prepared_before_step);
        let shown = |from: &Option<String>| from.clone().unwrap_or_else(|| "none".to_owned());
        findings.same(None, &field("taken_from"), &shown(from), &shown(&reel.taken_from));
        findings.near(None, &field("from_m"), pieces[first - 1].from_m, reel.from_m, Printed::Metres);
        findings.near(None, &field("to_m"), pieces[*last - 1].to_m, reel.to_m, Printed::Metres);
        let allowance_m = if name.starts_with('C') { 0.0 } else { truth.shop.allowance_m };
        let load_m = pieces[*last - 1].to_m - pieces[first - 1].from_m + allowance_m;
        findings.near_if(None, &field("load_m"), load_m, reel.load_m, Printed::Metres);
    }
}

fn check_shop(truth: &Truth, found: &super::Shop, findings: &mut Findings) {
    let shop = truth.shop;
    for ((name, expected), (_, found)) in shop.words.iter().zip(&found.words) {
        findings.same(None, &format!("production.{name}"), expected, found);
    }
    for (name, expected, found) in [
        ("tension_n", shop.tension_n, found.tension_n),
        ("tension_taper_percent_per_layer", shop.tension_taper_per_layer, found.tension_taper_per_layer),
        ("tension_limit_percent", shop.tension_limit, found.tension_limit),
        ("allowance_m", shop.allowance_m, found.allowance_m),
        ("winding_speed_turns_per_min", shop.winding_speed_turns_per_min, found.winding_speed_turns_per_min),
    ] {
        findings.checks += 1;
        // Copied, not computed: equal but for the last bit.
        if !((expected - found).abs() <= 1e-12 * expected.abs()) {
            let name = format!("production.{name}");
            findings.add(None, &name, expected.to_string(), found.to_string(), super::EMIT_AGAIN);
        }
    }
    let every = "production.potting_every_layers";
    findings.same(None, every, &shop.potting_every_layers, &found.potting_every_layers);
}

/// A classic winding's name must stand for that winding, which has whole layers only.
fn check_name(claim: &Claim, winding: &Winding, findings: &mut Findings) {
    let Some(name) = &claim.pattern else { return };
    let segments = &winding.segments;
    let count = segments.len();
    let h = count / 2;
    let of_word = |word: &str| {
        let (mut low, mut high) = (h + 1, h);
        let letters: Vec<char> = word.chars().collect();
        (0..count)
            .map(|i| {
                if letters[i % letters.len()] == 'A' {
                    low -= 1;
                    low
                } else {
                    high += 1;
                    high
                }
            })
            .collect::<Vec<usize>>()
    };
    let word = match name.as_str() {
        "dip" => "AB",
        "qua" => "ABBA",
        "oct" => "ABBABAAB",
        "hex" => "ABBABAABBAABABBA",
        _ => "",
    };
    let expected: Vec<usize> = match name.as_str() {
        "zyl" => (1..=count).collect(),
        "sym" => (1..=h).rev().chain((h + 1..=count).rev()).collect(),
        "sym-text" => (1..=h).rev().chain(h + 1..=count).collect(),
        _ if !word.is_empty() && count.is_multiple_of(word.len()) => of_word(word),
        _ => return,
    };
    findings.checks += 1;
    if expected != *segments || winding.ends != [0, 0] {
        let remedy = "name the pattern by what it is, or wind the one that is named";
        let [a, b] = winding.ends;
        let ends = if [a, b] == [0, 0] { String::new() } else { format!(" with {a:+} turns at end A, {b:+} at end B") };
        findings.add(None, "pattern", format!("the name of {segments:?}{ends}"), name.clone(), remedy);
    }
}
