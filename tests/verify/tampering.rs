//! Whatever is altered in what the program emits for the shop floor, if it changes what is wound or read, it is a violation.
//!
//! Reference: the files themselves. A change that passes must be one that says the same: compared here word by word and
//! number by number, by code that knows nothing of the verification. Free are only the version of the program that wrote
//! the file, the time at which one of several equal maxima was read, and a number's last printed digit.

use coilwright::pattern::classic::Classic;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::forms::{LONG, PAPER, classic, forms, judged, model, shipped, shuffled};

/// What somebody, or something, could put into each form.
fn foreign(form: &str) -> &'static [&'static str] {
    match form.rsplit('.').next().unwrap_or_default() {
        "gcode" => &[
            "M30\n",
            "%\n",
            "M0\n",
            "G1 X100 C5 F60\n",
            "G0 X0\n",
            "G91\n",
            "G20\n",
            "T2 M6\n",
            ";py,os\n",
            "; skip\n",
            "G92 C0\n",
            "M3 S1000\n",
            "(MSG, go on)\n",
            "N10 G1 X0\n",
            "#1=5\n",
            "O100 sub\n",
            "G4 P10\n",
            "\u{2028}M30\n",
            " G1 X1",
            "F600",
        ],
        "html" => &[
            "<script>document.body.innerHTML=''</script>",
            "<img src=x onerror=alert(1)>",
            "<style>td{display:none}</style>",
            "<style>tr:nth-child(3){display:none}</style>",
            "<p>Skip step 3.</p>",
            "<!-- -->",
            "<base href=\"http://x/\">",
            "<iframe srcdoc=\"x\"></iframe>",
            "<meta http-equiv=\"refresh\" content=\"0;url=http://x\">",
            "<link rel=\"stylesheet\" href=\"http://x/s.css\">",
            " style=\"display:none\"",
            " hidden",
            " onclick=\"x()\"",
            " class=\"screen\"",
            "<td>12.500</td>",
            "<tr><td>1</td></tr>",
            "\u{202e}",
            "&#49;",
            "<svg><text>1</text></svg>",
            "<details><summary>",
        ],
        "json" => &[
            "\"note\": \"skip step 3\",",
            "\"step\": 1,",
            "null,",
            "{},",
            "1",
            "\"",
            "]",
            "}",
            "//x\n",
            ",",
            "\"layer\": 2,",
            "-",
            "e5",
            "\"potting\": false,",
            "true",
        ],
        _ => &[
            "# skip layer 3\n",
            "1,1,A,1\n",
            ",",
            "\n1,",
            "\"",
            "=1+1",
            "'",
            "-",
            "0",
            "e5",
            ";",
            ",,,",
            "first-to-second",
            "A",
            "true",
        ],
    }
}

/// The text, altered in one way at one place.
fn tampered(form: &str, text: &str, random: &mut ChaCha8Rng) -> (String, &'static str) {
    let starts: Vec<usize> = match form.ends_with("html") {
        // Nearly all of a page is one line: its pieces are its elements.
        true => text.match_indices('<').map(|(i, _)| i).chain([text.len()]).collect(),
        false => std::iter::once(0).chain(text.match_indices('\n').map(|(i, _)| i + 1)).collect(),
    };
    let place = |random: &mut ChaCha8Rng| random.random_range(0..starts.len() - 1);
    let piece = |i: usize| starts[i]..starts[i + 1];
    let mut at = random.random_range(0..text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    let cut = |span: std::ops::Range<usize>, new: &str| format!("{}{new}{}", &text[..span.start], &text[span.end..]);
    let (i, j) = (place(random), place(random));
    match random.random_range(0..12) {
        0 => (cut(piece(i), ""), "a piece less"),
        1 => (cut(starts[i]..starts[i], &text[piece(i)]), "a piece twice"),
        2 => (cut(starts[i]..starts[i], &text[piece(j)]), "a piece of elsewhere"),
        3 => {
            let (low, high) = (i.min(j), i.max(j));
            let swapped = format!("{}{}", &text[piece(high)], &text[starts[low + 1].min(starts[high])..starts[high]]);
            let first = if low == high { "" } else { &text[piece(low)] };
            (cut(starts[low]..starts[high + 1], &format!("{swapped}{first}")), "two pieces exchanged")
        }
        4 => {
            let many = (i + random.random_range(1..9usize)).min(starts.len() - 1);
            (cut(starts[i]..starts[i], &text[starts[i]..starts[many]]), "several pieces twice")
        }
        5 => (text[..at].to_owned(), "the end cut off"),
        6 | 7 => {
            let words = foreign(form);
            let word = words[random.random_range(0..words.len())];
            let place = if random.random_range(0..2) == 0 { starts[i] } else { at };
            (cut(place..place, word), "something foreign")
        }
        8 => {
            let c = char::from(random.random_range(32..127u8));
            let end = at + text[at..].chars().next().map_or(0, char::len_utf8);
            (cut(at..end, &c.to_string()), "another character")
        }
        _ => {
            let fields = fields(text);
            let span = fields[random.random_range(0..fields.len())].clone();
            let new = altered(&text[span.clone()], random);
            (cut(span, &new), "a field altered")
        }
    }
}

/// The words and numbers of a text.
fn fields(text: &str) -> Vec<std::ops::Range<usize>> {
    let mut found: Vec<std::ops::Range<usize>> = Vec::new();
    for (i, c) in text.char_indices().filter(|(_, c)| c.is_alphanumeric() || "._+-".contains(*c)) {
        match found.last_mut() {
            Some(last) if last.end == i => last.end = i + c.len_utf8(),
            _ => found.push(i..i + c.len_utf8()),
        }
    }
    found
}

/// One character of a field becomes another one, goes, or is doubled.
fn altered(field: &str, random: &mut ChaCha8Rng) -> String {
    let mut characters: Vec<char> = field.chars().collect();
    let at = random.random_range(0..characters.len());
    let old = characters[at];
    match random.random_range(0..4) {
        0 => drop(characters.remove(at)),
        1 => characters.insert(at, old),
        _ if old.is_ascii_digit() => {
            let digit = old.to_digit(10).unwrap();
            characters[at] = char::from_digit((digit + random.random_range(1..10)) % 10, 10).unwrap();
        }
        _ => characters[at] = if old == 'x' { 'y' } else { 'x' },
    }
    characters.into_iter().collect()
}

/// Whether two texts say the same to whoever reads them: the same words in the same order, the same numbers to their last
/// printed digit; but for what is free.
fn say_the_same(a: &str, b: &str) -> bool {
    let (a, b) = (words(&without_free(a)), words(&without_free(b)));
    a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| a == b || same_number(a, b))
}

fn without_free(text: &str) -> String {
    let mut text = text.to_owned();
    for key in ["program", "worst_time_s"] {
        let quoted = format!("\"{key}\":");
        if let Some(from) = text.find(&quoted) {
            let end = text[from..].find([',', '\n']).map_or(text.len(), |i| from + i);
            text.replace_range(from..end, "");
        }
    }
    text
}

fn words(text: &str) -> Vec<String> {
    let of_number = |c: char| c.is_ascii_digit() || c == '.';
    let mut found: Vec<String> = Vec::new();
    let mut after_space = true;
    for c in text.chars() {
        if c.is_whitespace() {
            after_space = true;
            continue;
        }
        match found.last_mut() {
            Some(last) if !after_space && of_number(c) && last.ends_with(of_number) => last.push(c),
            _ => found.push(c.to_string()),
        }
        after_space = false;
    }
    found
}

fn same_number(old: &str, new: &str) -> bool {
    let decimals = old.split_once('.').map_or(0, |(_, digits)| digits.len() as i32);
    match (old.parse::<f64>(), new.parse::<f64>()) {
        (Ok(old), Ok(new)) => old == new || (decimals > 0 && (old - new).abs() <= 1.001 * 10f64.powi(-decimals)),
        _ => false,
    }
}

#[test]
#[ignore = "long: --include-ignored"]
fn of_two_hundred_changes_of_each_form_each_that_changes_what_is_wound_or_read_is_a_violation() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut counts: std::collections::BTreeMap<&str, [usize; 3]> = std::collections::BTreeMap::new();
    let mut unnoticed = Vec::new();
    for (text, named, changes) in [
        (PAPER, classic(Classic::Qua, 16).unwrap(), 110),
        (PAPER, shuffled(16, 3), 70),
        (LONG, classic(Classic::Oct, 40).unwrap(), 12),
        (LONG, shipped("searched-standard-40"), 12),
    ] {
        let file = model(text);
        for (form, whole) in forms(&file, &named) {
            assert_eq!(judged(&file, &whole).unwrap().violations, [], "{form}");
            for _ in 0..changes {
                let (changed, how) = tampered(form, &whole, &mut random);
                let count: &mut [usize; 3] = counts.entry(form).or_default();
                match judged(&file, &changed) {
                    None => count[0] += 1,
                    Some(found) if !found.violations.is_empty() => count[1] += 1,
                    Some(_) if say_the_same(&whole, &changed) => count[2] += 1,
                    Some(_) => unnoticed.push(format!("{form}: {how}: {}", difference(&whole, &changed))),
                }
            }
        }
    }
    let mut total = 0;
    for (form, [refused, violations, harmless]) in &counts {
        println!("{form:15} {refused:4} refused as no schedule, {violations:4} violations, {harmless:4} say the same");
        let of_form = refused + violations + harmless;
        assert!(of_form >= 200, "{form}");
        total += of_form;
    }
    println!("{total} changes, {} unnoticed", unnoticed.len());
    assert_eq!(unnoticed, Vec::<String>::new());
}

/// Around the first difference.
fn difference(a: &str, b: &str) -> String {
    let at = a.chars().zip(b.chars()).take_while(|(a, b)| a == b).count();
    let around = |text: &str| text.chars().skip(at.saturating_sub(20)).take(80).collect::<String>();
    format!("{:?} became {:?}", around(a), around(b))
}

/// The attacks that once passed.
#[test]
fn a_foreign_command_script_picture_or_style_is_named_by_its_line() {
    let file = model(PAPER);
    let all = forms(&file, &classic(Classic::Qua, 16).unwrap());
    let text = |name: &str| all.iter().find(|(form, _)| *form == name).unwrap().1.clone();
    let program = text("program.gcode");
    let (before_4, _) = program.split_once("; layer 4 ").unwrap();
    let (before_3, _) = program.split_once("; layer 3 ").unwrap();
    let third = &before_4[before_3.len()..];
    let moves = &third[third.find("T").unwrap()..];
    for inserted in ["M30\n", "%\n", moves, "G1 X5 C9 F60\n", ";py,import os\n"] {
        let changed = format!("{before_4}{inserted}{}", &program[before_4.len()..]);
        let found = judged(&file, &changed).unwrap();
        // An end before its time is one; what follows it does not belong.
        let line = before_4.lines().count() + 1 + usize::from(inserted == "M30\n");
        assert!(
            found.violations.iter().any(|v| v.field == format!("line {line}")),
            "{inserted}: {:?}",
            found.violations
        );
    }
    let page = text("traveller.html");
    for (at, inserted) in [
        ("</main>", "<script>for(const c of document.querySelectorAll('td'))c.textContent='0'</script>"),
        ("<h2>Steps", "<img src=x onerror=alert(1)>"),
        ("<h2>Steps", "<style>tbody tr:nth-child(3){display:none}</style>"),
        ("<h2>Release", "<p>Skip step 3.</p>"),
    ] {
        let found = judged(&file, &page.replacen(at, &format!("{inserted}{at}"), 1)).unwrap();
        assert!(found.violations.iter().any(|v| v.field.starts_with("line ")), "{inserted}: {:?}", found.violations);
    }
    for (old, new) in [
        ("script-src", "script-src 'unsafe-inline'"),
        ("tr.best td", "tr td"),
        ("const SHOWN_BELOW", "var SHOWN_BELOW"),
    ] {
        assert!(page.contains(old), "{old}");
        assert_eq!(judged(&file, &page.replacen(old, new, 1)).unwrap().violations.len(), 1, "{old}");
    }
}

#[test]
fn a_page_whose_visible_table_was_altered_is_caught_though_its_data_are_right() {
    let file = model(PAPER);
    let (_, page) = forms(&file, &classic(Classic::Qua, 16).unwrap()).swap_remove(4);
    for (seen, altered, field) in [
        ("<td>12.500</td>", "<td>12.600</td>", "length_m on the page"),
        ("first → second", "second → first", "direction on the page"),
        ("UV acrylate", "epoxy", "Adhesive on the page"),
        ("0.120 (", "0.150 (", "tension_n on the page"),
        ("reel A</text>", "reel B</text>", "a reel's name on the page"),
    ] {
        assert!(page.contains(seen), "{seen}");
        let found = judged(&file, &page.replacen(seen, altered, 1)).unwrap();
        let fields: Vec<&str> = found.violations.iter().map(|v| v.field.as_str()).collect();
        assert_eq!(fields, [field], "{seen}");
    }
    let found = judged(&file, &page.replacen("<h2>Release", "<p>Skip step 3.</p><h2>Release", 1)).unwrap();
    assert!(found.violations.iter().any(|v| v.field.contains("of the page")), "{:?}", found.violations);
}
