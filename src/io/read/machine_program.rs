//! Reads a winder's program back, to be verified; `io::write::machine_program` lists its words.

use crate::io::fault::{Fault, Faults};
use crate::io::json::schedule::{ScheduleJson, StepJson};

/// Raised when a word of the program changes its meaning.
pub const PROGRAM_VERSION: u32 = 1;

fn reel_name(number: i64) -> String {
    match number {
        1 => "A".to_owned(),
        2 => "B".to_owned(),
        n => format!("C{}", n - 10),
    }
}

/// Reads a program back, to be verified.
///
/// # Errors
/// Every line that is not as [`gcode`](crate::io::write::machine_program::gcode) writes it.
pub fn parse_gcode(file: &str, text: &str) -> Result<ScheduleJson, Faults> {
    let mut head: Option<ScheduleJson> = None;
    let mut steps: Vec<StepJson> = Vec::new();
    let mut faults = Vec::new();
    let mut ended = false;
    // What the carriage's start says, until the winding move confirms it.
    let mut start_mm = f64::NAN;
    let mut offset = 0;
    for line in text.split_inclusive('\n') {
        let span = offset..offset + line.trim_end().len();
        offset += line.len();
        let line = line.trim();
        let mut fault = |message: String| faults.push(Fault::new(message, Some(span.clone())));
        if let Some(json) = line.strip_prefix("; head ") {
            match serde_json::from_str(json) {
                Ok(found) => head = Some(found),
                Err(error) => fault(format!("the head cannot be understood: {error}")),
            }
        } else if let Some(words) = line.strip_prefix("; layer ") {
            match step_of_comment(words) {
                Some(step) => steps.push(step),
                None => fault("the comment of a layer cannot be understood: emit the program again".to_owned()),
            }
        } else if let (Some(words), Some(step)) = (line.strip_prefix("; crossover"), steps.last_mut()) {
            step.crossover = Some(words.trim().to_owned());
        } else if line.is_empty() || line == "%" || line.starts_with(';') || ["G21", "G90", "G92 C0"].contains(&line) {
        } else if line == "M30" {
            ended = true;
        } else if let Some(step) = steps.last_mut() {
            if !obey(step, line, &mut start_mm) {
                fault(format!("the line \"{line}\" is not of this program's words, or contradicts another line"));
            }
        } else {
            fault(format!("the line \"{line}\" stands before the first layer"));
        }
    }
    if !ended {
        faults.push(Fault::new("the program does not end with M30: is it whole?", None));
    }
    for step in steps.iter().filter(|step| step.crossover.is_none()) {
        let message = format!("layer {} has no comment that begins with \"; crossover\"", step.layer);
        faults.push(Fault::new(message, None));
    }
    if head.is_none() {
        faults.push(Fault::new("the comment that begins with \"; head\" is missing", None));
    }
    match head {
        Some(head) if faults.is_empty() => Ok(ScheduleJson { steps, ..head }),
        _ => Err(Faults { file: file.to_owned(), source: text.to_owned(), faults }),
    }
}

fn step_of_comment(words: &str) -> Option<StepJson> {
    let words: Vec<&str> = words.split_whitespace().collect();
    let keys = [
        "step",
        "half",
        "segment",
        "from",
        "to",
        "length",
        "radius",
        "climb",
        "cumulative",
        "pitch",
        "tension",
        "least",
        "most",
    ];
    if words.len() != 1 + 2 * keys.len() || !keys.iter().enumerate().all(|(i, key)| words[1 + 2 * i] == *key) {
        return None;
    }
    let value = |key: &str| keys.iter().position(|k| *k == key).map(|i| words[2 + 2 * i]);
    let number = |key: &str| value(key)?.parse::<f64>().ok().filter(|v| v.is_finite());
    let whole = |key: &str| value(key)?.parse::<i64>().ok();
    Some(StepJson {
        step: whole("step")?,
        layer: words[0].parse().ok()?,
        half: value("half")?.to_owned(),
        segment: whole("segment")?,
        supply_reel: String::new(),
        direction: String::new(),
        turns: 0.0,
        fibre_from_m: number("from")?,
        fibre_to_m: number("to")?,
        length_m: number("length")?,
        radius_mm: number("radius")?,
        climb: whole("climb")?,
        cumulative_m: number("cumulative")?,
        crossover: None,
        balance_m: None,
        rotation: None,
        axial_pitch_mm: Some(number("pitch")?),
        tension_n: Some(number("tension")?),
        tension_min_n: Some(number("least")?),
        tension_max_n: Some(number("most")?),
        turns_per_min: None,
        reel_change: Some(false),
        potting: Some(false),
        measured_length_m: None,
        checked_by: None,
    })
}

/// Enters what a line commands into the step; whether it could be understood and contradicts nothing.
fn obey(step: &mut StepJson, line: &str, start_mm: &mut f64) -> bool {
    let words: Vec<&str> = line.split_whitespace().collect();
    let number = |word: &str, letter: char| word.strip_prefix(letter)?.parse::<f64>().ok().filter(|v| v.is_finite());
    match words.as_slice() {
        [tool] | [tool, "M6"] if tool.starts_with('T') => {
            let Ok(reel) = tool[1..].parse::<i64>() else { return false };
            step.supply_reel = reel_name(reel);
            step.reel_change = Some(words.len() == 2);
            true
        }
        ["G0", x] => match number(x, 'X') {
            Some(from_mm) => {
                *start_mm = from_mm;
                true
            }
            None => false,
        },
        ["G1", x, c, f] => {
            let (Some(to_mm), Some(turns), Some(speed)) = (number(x, 'X'), number(c, 'C'), number(f, 'F')) else {
                return false;
            };
            step.direction = if to_mm > *start_mm { "first-to-second" } else { "second-to-first" }.to_owned();
            step.rotation = Some(if turns > 0.0 { "cw" } else { "ccw" }.to_owned());
            step.turns = turns.abs();
            step.turns_per_min = Some(speed);
            // The way of the carriage is the turns times the pitch, from a flange to the other.
            let way_mm = (to_mm - *start_mm).abs();
            let expected_mm = step.turns * step.axial_pitch_mm.unwrap_or(0.0);
            (way_mm - expected_mm).abs() < 5.001e-5 && to_mm.min(*start_mm) == 0.0
        }
        ["M0"] => {
            step.potting = Some(true);
            true
        }
        _ => false,
    }
}
