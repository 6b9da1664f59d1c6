//! One type a sink: a text becomes one only by that sink's escape, and what writes to the sink takes nothing else.
//!
//! | type | sink |
//! |---|---|
//! | [`Line`] | one line of a terminal, or a part of it |
//! | [`Block`] | several lines of a terminal, whose line breaks are the program's own |
//! | [`JsonText`] | a JSON document: on a terminal, in a file, in a comment of a machine program |
//! | [`TomlComment`] | what stands behind `#` |
//! | [`CComment`] | what stands between `/*` and `*/` |
//! | [`Cell`] | a cell of a CSV table that a person may open in a spreadsheet |
//! | [`ShellWord`] | one word of a shell's script |
//! | [`Markup`] | a page or picture (HTML, XML), whose text and attributes are quoted already |

use super::{is_unseen, visible};

macro_rules! shown_as_it_is {
    ($($sink:ident),*) => {$(
        impl $sink {
            /// As it may be written.
            pub fn as_str(&self) -> &str {
                &self.0
            }

            /// As it may be written.
            pub fn into_string(self) -> String {
                self.0
            }
        }

        impl std::fmt::Display for $sink {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(&self.0)
            }
        }
    )*};
}

/// One line of a terminal, or a part of it: nothing in it moves the cursor, colours, reverses or begins a new line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line(String);

impl Line {
    /// Control characters and what does not show become visible escapes.
    pub fn of(text: impl std::fmt::Display) -> Self {
        Self(visible(&text.to_string(), &[]))
    }
}

/// Lines of a terminal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Block(String);

impl Block {
    /// A carriage return before a line break goes; alone it would let a line overwrite itself and is written out.
    pub fn of(text: &str) -> Self {
        Self(visible(&text.replace("\r\n", "\n"), &['\n']))
    }
}

/// A JSON document whose strings hold no character that is not seen.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JsonText(String);

impl JsonText {
    /// What a JSON writer made: such characters stand in its strings only, where `\u` may replace any of them.
    pub fn of(json: &str) -> Self {
        Self(escaped_json(json, |c| is_unseen(c) && c != '\n'))
    }

    /// In an element of a page, or behind the mark of a comment: plain ASCII on one line, without a sign that an HTML
    /// reader, a controller or a compiler could take for the end of what it stands in.
    pub fn embedded(json: &str) -> Self {
        Self(escaped_json(json, |c| !c.is_ascii() || is_unseen(c) || "<>&%;()*/\\'@$".contains(c)))
    }
}

/// Of ASCII signs only those that JSON's own syntax does not use outside of strings, and never within another escape.
fn escaped_json(json: &str, hidden: impl Fn(char) -> bool) -> String {
    let mut out = String::with_capacity(json.len());
    let mut after_backslash = false;
    for c in json.chars() {
        let begins_escape = c == '\\' || after_backslash;
        after_backslash = c == '\\' && !after_backslash;
        if hidden(c) && !begins_escape {
            let mut units = [0; 2];
            for unit in c.encode_utf16(&mut units) {
                out.push_str(&format!("\\u{unit:04x}"));
            }
        } else {
            out.push(c);
        }
    }
    out
}

/// What stands behind `#` in a TOML file: one line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TomlComment(String);

impl TomlComment {
    /// Every line a comment of its own.
    pub fn of(text: impl std::fmt::Display) -> Self {
        Self(visible(&text.to_string(), &[]))
    }
}

/// What stands between `/*` and `*/`: ASCII, without a sign that could end the comment, begin another, or be a trigraph.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CComment(String);

impl CComment {
    /// In which no comment can end or begin.
    pub fn of(text: &str) -> Self {
        let mut out = String::with_capacity(text.len());
        for c in text.chars() {
            match c {
                ' '..='~' if !"\\*/?@".contains(c) => out.push(c),
                // A comment's own marks need two signs; a space between them is enough.
                '*' | '/' | '?' if !out.ends_with(['*', '/', '?']) => out.push(c),
                '*' | '/' | '?' => out.extend([' ', c]),
                _ => out.push_str(&format!("<U+{:04X}>", u32::from(c))),
            }
        }
        if out.ends_with(['*', '/']) {
            out.push(' ');
        }
        Self(out)
    }
}

/// A cell of a CSV table.
///
/// Text that a spreadsheet would take for a formula gets an apostrophe in front, as one types it there; what begins with
/// apostrophes before such a sign gets one more, so that [`Cell::read`] gives every text back.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cell(String);

/// With the full-width forms, which spreadsheets of East Asian languages take for the same.
///
/// # Source
/// OWASP, CSV Injection: characters that begin a formula.
const FORMULA_SIGNS: [char; 11] = ['=', '+', '-', '@', '\t', '\r', '\n', '＝', '＋', '－', '＠'];

fn begins_formula(text: &str) -> bool {
    text.trim_start_matches('\'').starts_with(FORMULA_SIGNS)
}

impl Cell {
    /// A number, or a word of the program's own.
    pub fn plain(value: impl std::fmt::Display) -> Self {
        Self(value.to_string())
    }

    /// Text from outside; a number stays one.
    pub fn text(text: &str) -> Self {
        let is_number = text.trim().parse::<f64>().is_ok_and(f64::is_finite);
        let seen = visible(text, &['\n', '\t']);
        if begins_formula(&seen) && !is_number { Self(format!("'{seen}")) } else { Self(seen) }
    }

    /// Whether [`Cell::text`] leaves a text as it is.
    pub fn leaves(text: &str) -> bool {
        let seen = |c: char| c.is_ascii_graphic() || c == ' ' || c == '\n' || c == '\t' || !is_unseen(c);
        let is_number = || text.trim().parse::<f64>().is_ok_and(f64::is_finite);
        text.chars().all(seen) && (!begins_formula(text) || is_number())
    }

    /// The text that [`Cell::text`] made a cell of.
    pub fn read(cell: &str) -> &str {
        match cell.strip_prefix('\'') {
            Some(text) if begins_formula(text) => text,
            _ => cell,
        }
    }
}

impl AsRef<[u8]> for Cell {
    fn as_ref(&self) -> &[u8] {
        self.0.as_bytes()
    }
}

/// One word of a script for bash: nothing in it is expanded, and it ends where it ends.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ShellWord(String);

impl ShellWord {
    /// Quoted where a shell would read more than the text.
    pub fn of(text: &str) -> Self {
        if text.contains(is_unseen) {
            // Between $' and ' a byte may be written as three octal digits.
            let byte = |b: u8| if b.is_ascii_alphanumeric() { char::from(b).to_string() } else { format!("\\{b:03o}") };
            return Self(format!("$'{}'", text.bytes().map(byte).collect::<String>()));
        }
        Self(format!("'{}'", text.replace('\'', "'\\''")))
    }
}

/// A whole page or picture: its text and attributes were quoted where they were put in; here every character that XML does
/// not have, or that nobody sees, is written out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Markup(String);

impl Markup {
    /// In which no tag or entity can begin.
    pub fn of(quoted: &str) -> Self {
        Self(visible(quoted, &['\n', '\t']))
    }
}

shown_as_it_is!(Line, Block, JsonText, TomlComment, CComment, Cell, ShellWord, Markup);

#[cfg(test)]
mod tests {
    use super::*;

    const HOSTILE: &[&str] = &[
        "\u{1b}]0;x\u{7}",
        "a\nb",
        "a\r\nb",
        "\u{85}\u{2028}\u{2029}",
        "\u{202e}txt",
        "<!--<script>",
        "</script>",
        "*/ int x; /*",
        "/*/",
        "??/",
        "=1+1",
        "＝1+1",
        "'=1",
        "''-x",
        "-1.5",
        "+49 30",
        "\u{fffe}",
        "@rate@",
        "\\",
        "\"",
        "%",
        "M30",
    ];

    #[test]
    fn no_sink_lets_a_line_break_or_an_unseen_character_through_but_its_own() {
        for text in HOSTILE {
            for out in [Line::of(text).0, TomlComment::of(text).0, CComment::of(text).0, ShellWord::of(text).0] {
                assert!(!out.contains(is_unseen), "{out:?}");
            }
            assert!(!Block::of(text).0.contains(|c| is_unseen(c) && c != '\n'));
            assert!(!Markup::of(text).0.contains(|c| is_unseen(c) && c != '\n'));
        }
    }

    #[test]
    fn a_word_of_a_shell_is_one_and_the_same_text() {
        for text in HOSTILE.iter().chain(&["it's", "$(id) `id` ${HOME}", "a b; c"]) {
            let script = format!("printf %s {}", ShellWord::of(text));
            let out = std::process::Command::new("bash").args(["-c", &script]).output();
            // Where there is no bash nothing is to be shown.
            if let Ok(out) = out {
                assert_eq!(String::from_utf8_lossy(&out.stdout), *text, "{script}");
            }
        }
    }

    #[test]
    fn a_c_comment_neither_ends_nor_begins_another_nor_has_a_trigraph() {
        for text in HOSTILE {
            let whole = format!("/* {}*/", CComment::of(text));
            assert_eq!((whole.matches("/*").count(), whole.matches("*/").count()), (1, 1), "{whole}");
            assert!(!whole.contains("??") && whole.is_ascii() && !whole.contains('@'), "{whole}");
        }
    }

    #[test]
    fn json_is_the_same_document_in_every_form() {
        for text in HOSTILE {
            let json = format!("{{\"a\\\\\": [1, {}]}}", quoted(text));
            for form in [JsonText::of(&json), JsonText::embedded(&json)] {
                assert!(!form.0.contains(is_unseen), "{form}");
                let value = unquoted(form.as_str());
                assert_eq!(value, *text, "{form}");
            }
            let embedded = JsonText::embedded(&json);
            assert!(!embedded.0.contains(['<', '>', '%', ';', '(']) && embedded.0.is_ascii());
        }
    }

    /// As a JSON writer quotes it: only what it must.
    fn quoted(text: &str) -> String {
        let escaped = |c: char| match c {
            '"' | '\\' => format!("\\{c}"),
            '\n' => "\\n".to_owned(),
            '\r' => "\\r".to_owned(),
            c if u32::from(c) < 32 => format!("\\u{:04x}", u32::from(c)),
            c => c.to_string(),
        };
        format!("\"{}\"", text.chars().map(escaped).collect::<String>())
    }

    /// The last string of a document, its escapes resolved.
    fn unquoted(json: &str) -> String {
        let inner = &json[json.find("[1, \"").unwrap() + 5..json.len() - 3];
        let mut units: Vec<u16> = Vec::new();
        let mut rest = inner.chars();
        while let Some(c) = rest.next() {
            match (c, c == '\\') {
                (_, true) => match rest.next().unwrap() {
                    'u' => {
                        let digits: String = rest.by_ref().take(4).collect();
                        units.push(u16::from_str_radix(&digits, 16).unwrap());
                    }
                    'n' => units.push(10),
                    'r' => units.push(13),
                    other => units.extend(other.to_string().encode_utf16()),
                },
                (c, false) => units.extend(c.to_string().encode_utf16()),
            }
        }
        String::from_utf16(&units).unwrap()
    }

    #[test]
    fn a_cell_that_could_be_a_formula_is_text_in_a_spreadsheet_and_the_same_text_here() {
        for text in HOSTILE.iter().filter(|t| !t.contains(|c| is_unseen(c) && c != '\n')) {
            let cell = Cell::text(text);
            assert_eq!(Cell::read(cell.as_str()), *text);
            assert_eq!(Cell::leaves(text), cell.as_str() == *text);
            let is_number = text.parse::<f64>().is_ok();
            assert!(is_number || !cell.as_str().starts_with(FORMULA_SIGNS), "{cell}");
        }
        assert_eq!(Cell::text("-1.5").as_str(), "-1.5");
        assert_eq!(Cell::text("\n=x").as_str(), "'\n=x");
        assert_eq!(Cell::text("\tx").as_str(), "'\tx");
        assert_eq!(Cell::read("'tis"), "'tis");
    }
}
