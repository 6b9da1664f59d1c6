//! A machine program: read by a grammar of exactly what is emitted, and run on a model of the machine.
//!
//! ```text
//! program = remark(3) head "G21" "G90" layer* "M30"
//! layer   = "; layer …" "; crossover …" tool "G0 X…" "G92 C0" "G1 X… C… F…" ["M0"]
//! tool    = "T" number [" M6"]
//! ```
//!
//! Each line stands in its place or is a violation of its own. The machine knows which reel feeds, where the carriage is,
//! how far the spool has turned and whether the program has ended; what it has wound after each layer is a row that is
//! then held against the coil like any other file's.

use super::{Findings, Row};
use crate::units::m_from_mm;

const EXACTLY: &str = "the program is not what was emitted, line by line: emit it again, do not edit it";
/// More surplus lines than this are counted, not listed.
const MOST_LISTED: usize = 20;

/// Before the head: what the words mean.
const REMARKS: [&str; 3] = [
    "; coilwright winding program, version 1",
    "; X carriage in mm from the first flange, C spool in turns, clockwise seen from the first flange",
    "; F in turns/min; T1 reel A, T2 reel B, T11 reel C1; M0 apply adhesive",
];
/// What begins the line that a reader of files understands by itself.
const HEAD: &str = "; head {";
/// Millimetres and absolute positions, before anything moves.
const UNITS: [&str; 2] = ["G21", "G90"];
const END: &str = "M30";

/// What a layer's comment says, in its order; its words are those of a schedule's columns.
const OF_LAYER: [&str; 14] = [
    "layer",
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

/// The machine, as far as the program's words move it.
#[derive(Debug, Default)]
struct Machine {
    /// As the last `T` said it.
    reel: Option<String>,
    carriage_mm: f64,
    spool_turns: f64,
}

/// What the program's next line must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    Remark(usize),
    Head,
    Units(usize),
    /// A layer's comment, or the end where `M0` may stand before it.
    Layer {
        may_stop: bool,
    },
    Crossover,
    Tool,
    Start,
    Zero,
    Wind,
    Ended,
}

impl Place {
    fn expected(self) -> String {
        match self {
            Place::Remark(i) => format!("\"{}\"", REMARKS[i]),
            Place::Head => format!("a line that begins with \"{HEAD}\""),
            Place::Units(i) => format!("\"{}\"", UNITS[i]),
            Place::Layer { may_stop } => {
                format!("{}the comment of the next layer or \"{END}\"", if may_stop { "\"M0\", " } else { "" })
            }
            Place::Crossover => "a comment that begins with \"; crossover \"".to_owned(),
            Place::Tool => "\"T\" and the number of a reel, with \" M6\" where it changes".to_owned(),
            Place::Start => "\"G0 X\" and the flange at which the layer starts".to_owned(),
            Place::Zero => "\"G92 C0\"".to_owned(),
            Place::Wind => "\"G1 X… C… F…\"".to_owned(),
            Place::Ended => "nothing after the end of the program".to_owned(),
        }
    }
}

/// Runs the program: a row a layer that was wound, whole; every line that does not belong is a violation.
pub(super) fn run(text: &str, findings: &mut Findings) -> Vec<Row> {
    let mut run =
        Run { place: Place::Remark(0), lost: false, machine: Machine::default(), rows: Vec::new(), row: None };
    let mut surplus = 0;
    for (i, line) in text.lines().enumerate() {
        findings.checks += 1;
        let expected = run.place.expected();
        if !run.take(line) {
            surplus += 1;
            if surplus <= MOST_LISTED {
                findings.add(None, &format!("line {}", i + 1), expected, format!("\"{}\"", shortened(line)), EXACTLY);
            }
        }
    }
    if surplus > MOST_LISTED {
        let found = format!("{} more", surplus - MOST_LISTED);
        findings.add(None, "further lines", "none that do not belong".to_owned(), found, EXACTLY);
    }
    findings.checks += 2;
    if run.place != Place::Ended {
        let expected = run.place.expected();
        findings.add(None, "the program's end", expected, "the end of the file".to_owned(), EXACTLY);
    }
    if !text.ends_with('\n') {
        let found = "a last line without its end: is the file whole?".to_owned();
        findings.add(None, "the program's end", "a line break after M30".to_owned(), found, EXACTLY);
    }
    run.rows
}

fn shortened(line: &str) -> String {
    const MOST: usize = 80;
    if line.chars().count() <= MOST { line.to_owned() } else { line.chars().take(MOST).chain(['…']).collect() }
}

struct Run {
    place: Place,
    /// A line was not understood: up to the next layer nothing is wound.
    lost: bool,
    machine: Machine,
    rows: Vec<Row>,
    row: Option<Row>,
}

impl Run {
    /// Whether the line stands where it belongs; then the machine has done what it says.
    fn take(&mut self, line: &str) -> bool {
        let next = match self.place {
            Place::Remark(i) => {
                (line == REMARKS[i]).then_some(if i + 1 < REMARKS.len() { Place::Remark(i + 1) } else { Place::Head })
            }
            Place::Head => line.starts_with(HEAD).then_some(Place::Units(0)),
            Place::Units(i) => (line == UNITS[i]).then_some(if i + 1 < UNITS.len() {
                Place::Units(i + 1)
            } else {
                Place::Layer { may_stop: false }
            }),
            Place::Layer { may_stop: true } if line == "M0" => {
                if let Some(row) = &mut self.row {
                    row.potting = Some(true);
                }
                Some(Place::Layer { may_stop: false })
            }
            Place::Layer { .. } => self.between_layers(line),
            Place::Crossover => self.crossover(line),
            Place::Tool => self.tool(line),
            Place::Start => self.start(line),
            Place::Zero => (line == "G92 C0").then(|| {
                self.machine.spool_turns = 0.0;
                Place::Wind
            }),
            Place::Wind => self.wind(line),
            Place::Ended => None,
        };
        match next {
            Some(place) => {
                self.place = place;
                true
            }
            // A layer that cannot be followed is not wound; the next one begins anew.
            None if self.place != Place::Ended && line.starts_with("; layer ") => {
                if !matches!(self.place, Place::Layer { .. }) {
                    self.row = None;
                }
                self.place = self.between_layers(line).unwrap_or(self.place);
                false
            }
            None => {
                self.lost |=
                    matches!(self.place, Place::Crossover | Place::Tool | Place::Start | Place::Zero | Place::Wind);
                false
            }
        }
    }

    /// The layer that was wound is whole; another one begins, or the program ends.
    fn between_layers(&mut self, line: &str) -> Option<Place> {
        if line != END {
            let row = row_of(line)?;
            self.keep();
            self.row = Some(row);
            return Some(Place::Crossover);
        }
        self.keep();
        Some(Place::Ended)
    }

    fn keep(&mut self) {
        let row = self.row.take();
        if !std::mem::take(&mut self.lost) {
            self.rows.extend(row);
        }
    }

    fn crossover(&mut self, line: &str) -> Option<Place> {
        self.row.as_mut()?.crossover = Some(line.strip_prefix("; crossover ")?.to_owned());
        Some(Place::Tool)
    }

    fn tool(&mut self, line: &str) -> Option<Place> {
        let (word, changes) = match line.strip_suffix(" M6") {
            Some(word) => (word, true),
            None => (line, false),
        };
        let reel = reel_of(word.strip_prefix('T')?)?;
        // Without a change the machine goes on with the reel that it has.
        if !changes && self.machine.reel.as_ref() != Some(&reel) {
            return None;
        }
        let row = self.row.as_mut()?;
        row.supply_reel.clone_from(&reel);
        row.reel_change = Some(changes);
        self.machine.reel = Some(reel);
        Some(Place::Start)
    }

    fn start(&mut self, line: &str) -> Option<Place> {
        self.machine.carriage_mm = number(line.strip_prefix("G0 X")?)?;
        Some(Place::Zero)
    }

    fn wind(&mut self, line: &str) -> Option<Place> {
        let words: Vec<&str> = line.strip_prefix("G1 ")?.split(' ').collect();
        let [x, c, f] = words.as_slice() else { return None };
        let to_mm = number(x.strip_prefix('X')?)?;
        let turns = number(c.strip_prefix('C')?)?;
        let speed = number(f.strip_prefix('F')?)?;
        let row = self.row.as_mut()?;
        let from_mm = self.machine.carriage_mm;
        row.direction = if to_mm > from_mm { "first-to-second" } else { "second-to-first" }.to_owned();
        row.rotation = Some(if turns > 0.0 { "cw" } else { "ccw" }.to_owned());
        row.turns = (turns - self.machine.spool_turns).abs();
        row.turns_per_min = Some(speed);
        // The way of the carriage is the turns times the pitch; where it begins is held against the coil.
        let way_mm = (to_mm - from_mm).abs();
        let pitch_mm = crate::units::mm_from_m(row.axial_pitch_m?);
        row.free_m = Some(m_from_mm(to_mm.min(from_mm)));
        let fits = (way_mm - row.turns * pitch_mm).abs() < 5.001e-5 && row.turns > 0.0;
        self.machine.carriage_mm = to_mm;
        self.machine.spool_turns = turns;
        fits.then_some(Place::Layer { may_stop: true })
    }
}

/// A number as it is printed: digits, perhaps a point and further digits, nothing that another reader could take for
/// something else.
fn number(text: &str) -> Option<f64> {
    let value = text.parse::<f64>().ok().filter(|v| v.is_finite())?;
    (value.to_string() == text).then_some(value)
}

fn whole(text: &str) -> Option<i64> {
    let value = text.parse::<i64>().ok()?;
    (value.to_string() == text).then_some(value)
}

/// 1 is A, 2 is B, 11 is C1.
fn reel_of(number: &str) -> Option<String> {
    match whole(number)? {
        1 => Some("A".to_owned()),
        2 => Some("B".to_owned()),
        n if n > 10 => Some(format!("C{}", n - 10)),
        _ => None,
    }
}

fn row_of(line: &str) -> Option<Row> {
    let words: Vec<&str> = line.strip_prefix("; ")?.split(' ').collect();
    if words.len() != 2 * OF_LAYER.len() || !OF_LAYER.iter().zip(words.iter().step_by(2)).all(|(a, b)| a == b) {
        return None;
    }
    let value = |key: &str| OF_LAYER.iter().position(|k| *k == key).map(|i| words[2 * i + 1]);
    Some(Row {
        step: whole(value("step")?)?,
        layer: whole(value("layer")?)?,
        half: value("half")?.to_owned(),
        segment: whole(value("segment")?)?,
        fibre_from_m: number(value("from")?)?,
        fibre_to_m: number(value("to")?)?,
        length_m: number(value("length")?)?,
        radius_m: m_from_mm(number(value("radius")?)?),
        climb: whole(value("climb")?)?,
        cumulative_m: number(value("cumulative")?)?,
        axial_pitch_m: Some(m_from_mm(number(value("pitch")?)?)),
        tension_n: Some(number(value("tension")?)?),
        tension_min_n: Some(number(value("least")?)?),
        tension_max_n: Some(number(value("most")?)?),
        reel_change: Some(false),
        potting: Some(false),
        ..Row::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn program() -> String {
        let layer = |n: usize, reel: &str, from: &str, to: &str, turns: &str, stop: &str| {
            format!(
                "; layer {n} step {n} half A segment {n} from 0 to 12.5 length 12.5 radius 40.0825 climb 0 cumulative 12.5 pitch 0.17 tension 0.1 least 0.09 most 0.11\n\
                 ; crossover \n{reel}\nG0 X{from}\nG92 C0\nG1 X{to} C{turns} F60\n{stop}"
            )
        };
        let head = "; head {}\nG21\nG90\n";
        let first = layer(1, "T1 M6", "0", "8.5", "50", "");
        let second = layer(2, "T1", "8.5", "0", "-50", "M0\n");
        format!("{}\n{head}{first}{second}M30\n", REMARKS.join("\n"))
    }

    fn violations(text: &str) -> (usize, Vec<String>) {
        let mut findings = Findings::default();
        let rows = run(text, &mut findings);
        (rows.len(), findings.violations.into_iter().map(|v| v.field).collect())
    }

    #[test]
    fn a_program_as_it_is_emitted_winds_every_layer() {
        let mut findings = Findings::default();
        let rows = run(&program(), &mut findings);
        assert_eq!(findings.violations, []);
        assert_eq!(rows.len(), 2);
        assert_eq!((rows[0].direction.as_str(), rows[0].rotation.as_deref()), ("first-to-second", Some("cw")));
        assert_eq!((rows[1].turns, rows[1].reel_change, rows[1].potting), (50.0, Some(false), Some(true)));
    }

    #[test]
    fn a_line_more_or_less_or_elsewhere_is_a_violation_by_its_number() {
        let text = program();
        let lines: Vec<&str> = text.lines().collect();
        let joined = |lines: &[&str]| lines.iter().map(|l| format!("{l}\n")).collect::<String>();
        for at in 0..=lines.len() {
            for word in ["M30", "%", "G1 X100 C1 F60", ";py,", "; a remark", "", "G0 X0", "T2 M6", "M0", "G91"] {
                let mut more = lines.clone();
                more.insert(at, word);
                let (_, found) = violations(&joined(&more));
                // After a layer one stop for adhesive may stand; whether it should is seen by the row.
                let may_stop = word == "M0" && (at == 12 || at == lines.len() - 1 || at == lines.len() - 2);
                assert!(may_stop || !found.is_empty(), "{word} before line {}", at + 1);
            }
        }
        for at in 0..lines.len() {
            let mut twice = lines.clone();
            twice.insert(at, lines[at]);
            let (_, found) = violations(&joined(&twice));
            assert!(!found.is_empty(), "{} twice", lines[at]);
            let mut less = lines.clone();
            less.remove(at);
            let (rows, found) = violations(&joined(&less));
            assert!(!found.is_empty() || rows < 2 || lines[at] == "M0", "without {}", lines[at]);
        }
        let moved = text.replace("G0 X0\nG92 C0\n", "G92 C0\nG0 X0\n");
        assert!(!violations(&moved).1.is_empty());
        assert_eq!(violations(text.trim_end()).1, ["the program's end"]);
    }

    #[test]
    fn numbers_that_another_reader_could_read_otherwise_are_no_numbers_of_a_program() {
        for text in ["+1", "1e3", "01", "1.", ".5", "1.50", "inf", "NaN", "0x1", "1_0", " 1", "-0"] {
            assert!(number(text).is_none() || text == "-0", "{text}");
        }
        assert_eq!(number("-12.5"), Some(-12.5));
    }
}
