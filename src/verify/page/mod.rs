//! A traveller's page: whether it is, piece by piece, the page that its data make.
//!
//! The data are checked against the coil like any other file. Here the whole page is written out again from them, by code
//! of this folder's own: every element with its attributes, every word, every line of the drawing. What the file has is
//! held against that in order, so that a piece more, less or altered is a violation, whatever it is. Style and scripts are
//! told by their SHA-256 from the ones that the program ships ([`Assets`]).

mod drawing;
mod tokens;

use sha2::{Digest, Sha256};

use super::{Assets, Claim, Findings, Row, Shop};
use crate::units::{deg_per_h_from_rad_per_s, mm_from_m};
use tokens::{Kind, Piece, line_and_column, pieces};

const PRINT_AGAIN: &str = "what the page shows is not what its data say: emit the schedule again, do not edit the page";
const NOT_OURS: &str = "the page is not as it was emitted: emit the schedule again, do not edit the page";
/// The short names that a winding may have, and what the shop is asked for.
const WORDS: &str = "Class standard is wound with no captive run, class captive:2 with at most two. Captive: both ends of the fibre on \
    this reel are on the coil already, so the reel must travel around the coil. A crossover over several layers climbs past those between. \
    Windings by their short names: zyl cylindrical winding, sym symmetric winding (Eq. 14), sym-text symmetric winding (as described in \
    words), dip dipole, qua quadrupole, oct octupole, hex 16-pole.";
/// Instead of a trim where the ends have turns of their own.
const OF_ENDS: &str =
    "The pattern says how many turns either end has: wind every step as it stands, and trim neither end.";
const BLANK: &str = "________________";
/// The attributes of a picture may differ by the last bits of their numbers.
const DRAWN_PX: f64 = 1e-6;
/// More differences than this are counted, not listed.
const MOST_LISTED: usize = 20;

/// What must stand at one place of the page.
#[derive(Debug)]
struct Place {
    row: Option<usize>,
    field: &'static str,
    want: Want,
}

#[derive(Debug)]
enum Want {
    Tag(String),
    /// Quoted as in the file.
    Text(String),
    Asset(String),
    /// The data, which are read and checked by themselves.
    Data,
}

impl Want {
    fn admits(&self, piece: &Piece) -> bool {
        match (self, piece.kind) {
            (Want::Tag(tag), Kind::Tag) => tag == piece.raw || same_but_for_rounding(tag, piece.raw),
            (Want::Text(text), Kind::Text) => text == piece.raw,
            (Want::Asset(sha256), Kind::Raw) => *sha256 == sha256_hex(piece.raw),
            (Want::Data, Kind::Raw) => true,
            _ => false,
        }
    }

    fn shown(&self) -> String {
        match self {
            Want::Tag(text) | Want::Text(text) => quoted(text),
            Want::Asset(sha256) => format!("what the program ships, SHA-256 {sha256}"),
            Want::Data => "the data".to_owned(),
        }
    }
}

fn shown(piece: &Piece) -> String {
    match piece.kind {
        Kind::Raw => format!("other content, SHA-256 {}", sha256_hex(piece.raw)),
        Kind::Tag | Kind::Text => quoted(piece.raw),
    }
}

fn quoted(text: &str) -> String {
    const MOST: usize = 120;
    let cut: String = text.chars().take(MOST).collect();
    let more = if cut.len() < text.len() { "…" } else { "" };
    format!("\"{}{more}\"", unescaped(&cut))
}

fn sha256_hex(text: &str) -> String {
    Sha256::digest(text.as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Whether two tags differ in nothing but the last bits of numbers.
fn same_but_for_rounding(a: &str, b: &str) -> bool {
    let is_number = |c: char| c.is_ascii_digit() || c == '.' || c == '-';
    let words = |text: &'_ str| {
        let mut found: Vec<String> = Vec::new();
        for c in text.chars() {
            match found.last_mut() {
                Some(last) if last.starts_with(is_number) == is_number(c) => last.push(c),
                _ => found.push(c.to_string()),
            }
        }
        found
    };
    let (a, b) = (words(a), words(b));
    let near = |a: &str, b: &str| match (a.parse::<f64>(), b.parse::<f64>()) {
        // A number that is written otherwise but is the same is none of ours.
        (Ok(x), Ok(y)) => x != y && (x - y).abs() <= DRAWN_PX,
        _ => false,
    };
    a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| a == b || near(a, b))
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn unescaped(text: &str) -> String {
    text.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"").replace("&amp;", "&")
}

/// `segments` is none where the rows are no winding: then only that is said.
pub(super) fn check(claim: &Claim, assets: &Assets, html: &str, segments: Option<&[usize]>, findings: &mut Findings) {
    let Some(segments) = segments else { return };
    let mut page = Expected { places: Vec::new(), assets };
    page.write(claim, segments);
    let places = page.places;
    let found = pieces(html);
    findings.checks += places.len();
    let same_kind = |place: &Place, piece: &Piece| {
        matches!(
            (&place.want, piece.kind),
            (Want::Tag(_), Kind::Tag) | (Want::Text(_), Kind::Text) | (Want::Asset(_) | Want::Data, Kind::Raw)
        )
    };
    if places.len() == found.len() && places.iter().zip(&found).all(|(place, piece)| same_kind(place, piece)) {
        let altered = places.iter().zip(&found).filter(|(place, piece)| !place.want.admits(piece));
        for (place, piece) in altered.take(MOST_LISTED) {
            let (field, remedy) = match place.want {
                Want::Text(_) => (format!("{} on the page", place.field), PRINT_AGAIN),
                _ => (at(html, piece), NOT_OURS),
            };
            findings.add(place.row, &field, place.want.shown(), shown(piece), remedy);
        }
        return;
    }
    // A piece more or less: what is equal before and after it is left out.
    let before = places.iter().zip(&found).take_while(|(place, piece)| place.want.admits(piece)).count();
    let most = places.len().min(found.len()) - before;
    let ends = places.iter().rev().zip(found.iter().rev()).take(most);
    let after = ends.take_while(|(place, piece)| place.want.admits(piece)).count();
    let missing = &places[before..places.len() - after];
    let surplus = &found[before..found.len() - after];
    let expected = |from: &[Place]| match from {
        [] => "nothing here".to_owned(),
        [first] => first.want.shown(),
        [first, rest @ ..] => format!("{} and {} pieces more", first.want.shown(), rest.len()),
    };
    for piece in surplus.iter().take(MOST_LISTED) {
        findings.add(None, &at(html, piece), expected(missing), shown(piece), NOT_OURS);
    }
    if surplus.is_empty() {
        findings.add(None, "the page", expected(missing), "nothing".to_owned(), NOT_OURS);
    }
    if surplus.len() > MOST_LISTED {
        let more = format!("{} pieces more", surplus.len() - MOST_LISTED);
        findings.add(None, "the page", expected(missing), more, NOT_OURS);
    }
}

fn at(html: &str, piece: &Piece) -> String {
    let (line, column) = line_and_column(html, piece.offset);
    format!("line {line}, character {column} of the page")
}

/// The page as it should be, as far as it is written.
struct Expected<'a> {
    places: Vec<Place>,
    assets: &'a Assets,
}

impl Expected<'_> {
    /// Tags without text between them.
    fn tags(&mut self, tags: &str) {
        let all = tags.split_inclusive('>').map(|tag| Want::Tag(tag.to_owned()));
        self.places.extend(all.map(|want| Place { row: None, field: "markup", want }));
    }

    fn text(&mut self, row: Option<usize>, field: &'static str, text: &str) {
        if !text.is_empty() {
            self.places.push(Place { row, field, want: Want::Text(escaped(text)) });
        }
    }

    fn asset(&mut self, field: &'static str, sha256: &str) {
        self.places.push(Place { row: None, field, want: Want::Asset(sha256.to_owned()) });
    }

    /// An element that holds text only; `open` is its start tag.
    fn element(&mut self, row: Option<usize>, field: &'static str, open: &str, text: &str) {
        self.tags(open);
        self.text(row, field, text);
        let name: String = open.chars().skip(1).take_while(char::is_ascii_alphanumeric).collect();
        self.tags(&format!("</{name}>"));
    }

    fn style_of_drawing(&mut self) {
        self.tags("<style>");
        let sha256 = self.assets.drawing_style_sha256.clone();
        self.asset("the drawing's style", &sha256);
        self.tags("</style>");
    }

    fn write(&mut self, claim: &Claim, segments: &[usize]) {
        let title = format!("Winding traveller: {}", claim.model.as_deref().unwrap_or_default());
        let policy = escaped(&self.assets.policy);
        self.tags(&format!(
            "<!DOCTYPE html><html lang=\"en\"><head><meta charset=\"utf-8\">\
             <meta http-equiv=\"Content-Security-Policy\" content=\"{policy}\">\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
             <meta name=\"color-scheme\" content=\"light dark\">"
        ));
        self.element(None, "the title", "<title>", &title);
        self.tags("<link rel=\"icon\" href=\"data:,\"><style>");
        let sha256 = self.assets.style_sha256.clone();
        self.asset("the style", &sha256);
        self.tags("</style></head><body><main>");
        self.element(None, "the title", "<h1>", &title);
        self.element(None, "what is to be wound", "<p class=\"big\">", &summary(claim));
        self.cross_section(claim, segments);
        self.facts(claim);
        self.element(None, "a heading", "<h2>", "Supply reels");
        self.reels(claim);
        self.start(claim);
        self.element(None, "a heading", "<h2>", "Steps");
        self.steps(claim);
        self.element(None, "a heading", "<h2>", "Release");
        self.signatures();
        self.element(None, "a heading", "<h2>", "What these words mean");
        self.element(None, "an explanation", "<p>", WORDS);
        self.tags("<script type=\"application/json\" id=\"coilwright-data\">");
        self.places.push(Place { row: None, field: "the data", want: Want::Data });
        self.tags("</script></main><script>");
        let sha256 = self.assets.script_sha256.clone();
        self.asset("the script", &sha256);
        self.tags("</script></body></html>");
    }

    fn cross_section(&mut self, claim: &Claim, segments: &[usize]) {
        self.tags("<figure><div class=\"zoom\" tabindex=\"0\" role=\"group\" aria-label=\"picture\">");
        let title = format!("{}, {} layers", claim.pattern.as_deref().unwrap_or_default(), segments.len());
        let reels = listed_reels(claim);
        let of_layer: Vec<usize> = claim.rows.iter().map(|row| reel_of(&reels, row)).collect();
        drawing::draw(self, &title, segments, &reels, &of_layer);
        self.tags("</div>");
        let caption = "The pack from the spool outwards, coloured by reel; numbers at the left count layers, at the right segments of the fibre.";
        self.element(None, "a heading", "<figcaption>", caption);
        self.tags("</figure>");
    }

    fn facts(&mut self, claim: &Claim) {
        self.tags("<dl class=\"facts\">");
        for (name, text) in facts(claim) {
            self.element(None, "a heading", "<dt>", name);
            self.element(None, name, "<dd>", &text);
        }
        self.tags("</dl>");
    }

    fn table(&mut self, header: &[(&str, &'static str)]) {
        self.tags("<div class=\"scroll\"><table><thead><tr>");
        for (class, name) in header {
            self.element(None, "a heading", &cell("th", class), name);
        }
        self.tags("</tr></thead><tbody>");
    }

    fn reels(&mut self, claim: &Claim) {
        self.table(&[
            ("word", "Reel"),
            ("", "Load"),
            ("", "To be wound"),
            ("", "Fibre from"),
            ("", "Fibre to"),
            ("word", "Prepare"),
            ("", "Loaded, measured"),
        ]);
        for (place, reel) in claim.supply.iter().flatten().enumerate() {
            self.tags("<tr><td class=\"word\">");
            self.element(None, "a reel's name", &format!("<b class=\"reel r{}\">", place % 8), &reel.name);
            self.text(None, "a reel's name", if reel.captive { " (captive)" } else { "" });
            self.tags("</td><td class=\"keep\">");
            self.element(None, "a reel's load", "<b>", &metres(reel.load_m.unwrap_or(reel.to_m - reel.from_m)));
            self.tags("</td>");
            for (field, value_m) in [
                ("a reel's length", reel.to_m - reel.from_m),
                ("where a reel begins", reel.from_m),
                ("where a reel ends", reel.to_m),
            ] {
                self.element(None, field, &cell("td", "keep"), &metres(value_m));
            }
            let field = "when a reel is prepared";
            self.tags("<td class=\"word\">");
            let before = format!("before step {}", reel.prepared_before_step);
            let from = reel.taken_from.as_ref().map(|from| format!("spool over from reel {from} "));
            self.text(None, field, &format!("{}{before}", from.unwrap_or_default()));
            self.tags("</td><td class=\"fill\"></td></tr>");
        }
        self.tags("</tbody></table></div>");
    }

    fn start(&mut self, claim: &Claim) {
        let field = "where to start";
        self.tags("<p>");
        self.text(None, field, "Start: mark the fibre at ");
        self.element(None, field, "<b>", &metres(claim.start_mark_m.unwrap_or(0.0)));
        let fix = " from end A (without the allowance) and fix the mark at the first flange. ";
        let trim_m = claim.expected_trim_m.unwrap_or(0.0);
        if claim.end_turns[0].is_some() {
            self.text(None, field, &format!("{fix}{OF_ENDS}"));
        } else if trim_m.abs() < 5e-4 {
            self.text(None, field, &format!("{fix}The halves are of equal length: no trim is expected."));
        } else {
            self.text(None, field, &format!("{fix}Expected trim: "));
            self.element(None, field, "<b>", &metres(trim_m.abs()));
            let end = if trim_m > 0.0 { "A" } else { "B" };
            let why = "for the joint of the halves to be the middle of the fibre.";
            self.text(None, field, &format!(" from end {end} {why}"));
        }
        self.tags("</p>");
    }

    fn steps(&mut self, claim: &Claim) {
        self.table(&[
            ("", "Layer"),
            ("word", "Reel"),
            ("word", "Half, segment"),
            ("word", "Direction"),
            ("word", "Spool"),
            ("", "Turns"),
            ("", "Length [m]"),
            ("", "From reel [m]"),
            ("", "A less B [m]"),
            ("", "Radius [mm]"),
            ("", "Tension [N]"),
            ("word long", "Crossover"),
            ("word", "Then"),
            ("", "Measured [m]"),
            ("", "✓"),
        ]);
        let reels = listed_reels(claim);
        for (i, row) in claim.rows.iter().enumerate() {
            self.step(i + 1, row, reel_of(&reels, row));
        }
        self.tags("</tbody></table></div>");
    }

    fn step(&mut self, number: usize, row: &Row, reel: usize) {
        let here = Some(number);
        self.tags("<tr>");
        self.element(here, "layer", "<td>", &row.layer.to_string());
        self.tags("<td class=\"word\">");
        self.element(here, "supply_reel", &format!("<b class=\"reel r{}\">", reel % 8), &row.supply_reel);
        self.text(here, "supply_reel", if row.reel_change == Some(true) { " (change)" } else { "" });
        self.tags("</td>");
        let limits = match (row.tension_min_n, row.tension_max_n) {
            (Some(least), Some(most)) => format!(" ({least:.3}–{most:.3})"),
            _ => String::new(),
        };
        for (field, class, text) in [
            ("half and segment", "word", format!("{} {}", row.half, row.segment)),
            ("direction", "word keep", row.direction.replace("-to-", " → ")),
            ("rotation", "word", row.rotation.clone().unwrap_or_default()),
            ("turns", "", format!("{:.2}", row.turns)),
            ("length_m", "", format!("{:.3}", row.length_m)),
            ("cumulative_m", "", format!("{:.3}", row.cumulative_m)),
            ("balance_m", "", format!("{:.3}", row.balance_m.unwrap_or(0.0)).replace('-', "−")),
            ("radius_mm", "", format!("{:.4}", mm_from_m(row.radius_m))),
            ("tension_n", "", row.tension_n.map_or(String::new(), |t| format!("{t:.3}{limits}"))),
            ("crossover", "word", row.crossover.clone().unwrap_or_default()),
            ("potting", "word", if row.potting == Some(true) { "apply adhesive".to_owned() } else { String::new() }),
            ("what was measured", "fill", String::new()),
            ("check box", "", "☐".to_owned()),
        ] {
            self.element(here, field, &cell("td", class), &text);
        }
        self.tags("</tr>");
    }

    fn signatures(&mut self) {
        self.table(&[("word", "Role"), ("word", "Name"), ("word", "Date"), ("word", "Signature")]);
        for role in ["Wound by", "Potted by", "Inspected by", "Released by"] {
            self.tags("<tr>");
            self.element(None, "a heading", &cell("td", "word"), role);
            self.tags("<td class=\"fill\"></td><td class=\"fill\"></td><td class=\"fill\"></td></tr>");
        }
        self.tags("</tbody></table></div>");
    }
}

fn cell(element: &str, class: &str) -> String {
    if class.is_empty() { format!("<{element}>") } else { format!("<{element} class=\"{class}\">") }
}

fn listed_reels(claim: &Claim) -> Vec<String> {
    claim.supply.iter().flatten().map(|reel| reel.name.clone()).collect()
}

fn reel_of(listed: &[String], row: &Row) -> usize {
    listed.iter().position(|name| *name == row.supply_reel).unwrap_or(0)
}

/// What is to be wound, in a sentence.
fn summary(claim: &Claim) -> String {
    let layers = claim.segments.as_ref().map_or(0, Vec::len);
    let reels = claim.supply.as_ref().map_or(0, Vec::len);
    let (s, length) = (if reels == 1 { "" } else { "s" }, metres(claim.length_m.unwrap_or(0.0)));
    format!(
        "Wind {length} of fibre in {layers} layers as {} from {reels} reel{s}, from the spool outwards.",
        claim.pattern.as_deref().unwrap_or_default()
    )
}

fn metres(value_m: f64) -> String {
    format!("{value_m:.3} m")
}

/// The head of the page: names and what is said of them.
fn facts(claim: &Claim) -> Vec<(&'static str, String)> {
    let word = |name: &str| {
        let words = claim.shop.as_ref().map_or(&[][..], |shop: &Shop| &shop.words);
        match words.iter().find(|(key, _)| *key == name) {
            Some((_, text)) if !text.is_empty() => text.clone(),
            _ => BLANK.to_owned(),
        }
    };
    let layers = claim.segments.as_ref().map_or(0, Vec::len);
    let worst = deg_per_h_from_rad_per_s(claim.worst_rate_rad_per_s.unwrap_or(0.0));
    // As the data have it, without the last bits of the conversion.
    let worst: f64 = format!("{worst:.6}").parse().unwrap_or(worst);
    let (middle_m, layer) = (claim.midpoint_m.unwrap_or(0.0), claim.midpoint_layer.unwrap_or(0));
    vec![
        ("Part number", word("part_number")),
        ("Revision", word("revision")),
        ("Spool", word("spool")),
        ("Adhesive", word("adhesive")),
        ("Cure", word("cure")),
        ("Winding pattern", format!("{} ({layers} layers)", claim.pattern.as_deref().unwrap_or_default())),
        (
            "Windability",
            format!(
                "class {}, up to {} reels, crossovers over up to {} layers",
                claim.class.as_deref().unwrap_or_default(),
                claim.reels.unwrap_or(0),
                claim.max_climb.unwrap_or(0)
            ),
        ),
        ("Fibre", claim.fibre.clone().unwrap_or_default()),
        ("Fibre length", metres(claim.length_m.unwrap_or(0.0))),
        ("Fibre's middle", format!("{} from end A, in layer {layer}", metres(middle_m))),
        (
            "Predicted worst rate error",
            format!("{worst:.4} °/h (profile {})", claim.worst_profile.as_deref().unwrap_or_default()),
        ),
        ("Model file, SHA-256", claim.model_sha256.clone().unwrap_or_default()),
        ("Made by", claim.program.clone().unwrap_or_default()),
        ("Fibre lot", BLANK.to_owned()),
        ("Spool serial number", BLANK.to_owned()),
        ("Adhesive lot", BLANK.to_owned()),
        ("Work order", BLANK.to_owned()),
    ]
}
