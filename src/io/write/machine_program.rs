//! A neutral program for a computer-controlled winder, version 1: CSV and plain G-code with comments.
//!
//! It says what has to happen, in the words that most controllers share; nothing is claimed about any maker's format.
//!
//! | word | meaning |
//! |---|---|
//! | `G21` `G90` | millimetres, absolute positions |
//! | `T1 M6` | supply reel into the feed: 1 is A, 2 is B, 11 is C1, 12 is C2, … |
//! | `G0 X` | carriage to the flange at which the layer starts; X = 0 is the first flange |
//! | `G92 C0` | the spool's counter to zero |
//! | `G1 X C F` | wind: carriage to X \[mm\] while the spool turns by C [turns, clockwise seen from the first flange]; F [turns/min] |
//! | `M0` | stop for adhesive |
//! | `M30` | end |

use crate::io::json::schedule::{
    LENGTH_DECIMALS, MM_DECIMALS, PROGRAM_VERSION, ProductionJson, ScheduleJson, TURNS_DECIMALS, crossover_words,
    rotation_word, rounded,
};
use crate::schedule::{Schedule, production::Production};
use crate::text::sink::JsonText;
use crate::units::mm_from_m;

/// The schedule with everything that a machine needs; `axial_pitch_m` as the coil has it.
pub fn machine_program(
    plain: &ScheduleJson,
    schedule: &Schedule,
    production: &Production,
    axial_pitch_m: f64,
) -> ScheduleJson {
    let mut document = plain.clone();
    document.document = format!("machine program {PROGRAM_VERSION}");
    document.production = Some(ProductionJson::new(production));
    for (row, reel) in document.reels.iter_mut().zip(schedule.reels()) {
        // A captive run has no end of its own to spare.
        let allowance_m = if reel.captive { 0.0 } else { production.allowance_m };
        row.load_m = Some(rounded(reel.to_m - reel.from_m + allowance_m, LENGTH_DECIMALS));
    }
    let layers = schedule.pattern().layers();
    let mut previous = None;
    for (i, (row, step)) in document.steps.iter_mut().zip(schedule.steps()).enumerate() {
        row.crossover = Some(crossover_words(step));
        row.rotation = Some(rotation_word(step.rotation).to_owned());
        row.axial_pitch_mm = Some(rounded(mm_from_m(axial_pitch_m), MM_DECIMALS));
        row.tension_n = Some(rounded(production.tension_n_at(step.layer), TURNS_DECIMALS));
        let limits_n = production.tension_limits_n_at(step.layer).map(|n| rounded(n, TURNS_DECIMALS));
        [row.tension_min_n, row.tension_max_n] = limits_n.map(Some);
        row.turns_per_min = Some(rounded(production.winding_speed_turns_per_min, TURNS_DECIMALS));
        row.reel_change = Some(previous != Some(step.supply_reel));
        let is_layer_full = schedule.steps().get(i + 1).is_none_or(|next| next.layer != step.layer);
        row.potting = Some(is_layer_full && production.pots_after(step.layer, layers));
        previous = Some(step.supply_reel);
    }
    document
}

fn reel_number(name: &str) -> i64 {
    match name {
        "A" => 1,
        "B" => 2,
        captive => captive.trim_start_matches('C').parse::<i64>().map_or(0, |n| n + 10),
    }
}

/// The program as G-code; each datum stands in it once, as a word or, where no word has it, in a comment. `schedule` as the
/// document was made from.
pub fn gcode(document: &ScheduleJson, schedule: &Schedule) -> String {
    let head = ScheduleJson { steps: Vec::new(), ..document.clone() };
    let mut out = format!("; coilwright winding program, version {PROGRAM_VERSION}\n");
    out.push_str("; X carriage in mm from the first flange, C spool in turns, clockwise seen from the first flange\n");
    out.push_str("; F in turns/min; T1 reel A, T2 reel B, T11 reel C1; M0 apply adhesive\n");
    let json = serde_json::to_string(&head).unwrap_or_default();
    out.push_str(&format!("; head {}\n", JsonText::embedded(&json)));
    out.push_str("G21\nG90\n");
    for (step, planned) in document.steps.iter().zip(schedule.steps()) {
        let pitch_mm = step.axial_pitch_mm.unwrap_or(0.0);
        let low_mm = rounded(planned.free_turns * pitch_mm, MM_DECIMALS);
        let high_mm = rounded(low_mm + step.turns * pitch_mm, MM_DECIMALS);
        let outbound = step.direction == "first-to-second";
        let (from_mm, to_mm) = if outbound { (low_mm, high_mm) } else { (high_mm, low_mm) };
        let sign = if step.rotation.as_deref() == Some("cw") { "" } else { "-" };
        // What the words below say is left out of the comment.
        out.push_str(&format!(
            "; layer {} step {} half {} segment {} from {} to {} length {} radius {} climb {} cumulative {} pitch {} tension {} least {} most {}\n",
            step.layer, step.step, step.half, step.segment, step.fibre_from_m, step.fibre_to_m, step.length_m,
            step.radius_mm, step.climb, step.cumulative_m, pitch_mm, step.tension_n.unwrap_or(0.0),
            step.tension_min_n.unwrap_or(0.0), step.tension_max_n.unwrap_or(0.0),
        ));
        out.push_str(&format!("; crossover {}\n", step.crossover.as_deref().unwrap_or("")));
        let change = if step.reel_change == Some(true) { " M6" } else { "" };
        out.push_str(&format!("T{}{change}\n", reel_number(&step.supply_reel)));
        out.push_str(&format!("G0 X{from_mm}\nG92 C0\n"));
        out.push_str(&format!("G1 X{to_mm} C{sign}{} F{}\n", step.turns, step.turns_per_min.unwrap_or(0.0)));
        if step.potting == Some(true) {
            out.push_str("M0\n");
        }
    }
    out.push_str("M30\n");
    out
}
