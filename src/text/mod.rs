//! Text that comes from outside: what a name may hold, and how any text enters each kind of file.
//!
//! A name is refused where it is read if it holds what cannot be seen ([`name_fault`]). Whatever else comes in — a path, a
//! cell, a line of a file that is none of ours — reaches a file or a terminal only through the type of that sink
//! ([`sink`]), which has no other constructor than its own escape.

pub(crate) mod number;
pub mod sink;

/// The most characters that a name may have: no drawing number, part or pattern is longer.
pub(crate) const MOST_NAME_CHARACTERS: usize = 200;

/// What a name may be, in words for messages.
pub(crate) const NAME_RULE: &str = "1 to 200 letters, digits, signs and inner spaces, none of which is invisible (no control, line \
                             break, direction mark or zero-width character)";

/// The same as a regular expression of JSON Schema: neither end is white space, no character is unseen.
pub(crate) const NAME_PATTERN: &str = "^(?!\\s)[^\\u0000-\\u001f\\u007f-\\u009f\\u00ad\\u061c\\u180e\\u200b\\u200e\\u200f\\u2028-\\u202e\\u2060-\\u206f\\ufeff\\ufff9-\\ufffb\\ufffe\\uffff]{1,200}(?<!\\s)$";

/// Whether a character is not seen where it stands: controls (C0, DEL, C1), line and paragraph separators, marks of
/// direction and other format characters, noncharacters.
///
/// The joiners U+200C and U+200D belong to the spelling of names in several scripts and are no such characters.
pub fn is_unseen(c: char) -> bool {
    let code = u32::from(c);
    c.is_control()
        || matches!(code,
            0x00AD | 0x0600..=0x0605 | 0x061C | 0x06DD | 0x070F | 0x0890..=0x0891 | 0x08E2 | 0x180E
            | 0x200B | 0x200E..=0x200F | 0x2028..=0x202E | 0x2060..=0x206F | 0xFEFF | 0xFFF9..=0xFFFB
            | 0x110BD | 0x110CD | 0x13430..=0x1343F | 0x1BCA0..=0x1BCA3 | 0x1D173..=0x1D17A
            | 0xE0000..=0xE007F | 0xFDD0..=0xFDEF)
        || code & 0xFFFE == 0xFFFE
}

/// Why a text is no name: a message without a subject, such as "must not begin or end with white space"; none if it is one.
pub fn name_fault(text: &str) -> Option<String> {
    if text.trim().is_empty() {
        return Some(format!("must not be {}: expected {NAME_RULE}", if text.is_empty() { "empty" } else { "blank" }));
    }
    if let Some(fault) = unseen_fault(text) {
        return Some(fault);
    }
    if text.trim() != text {
        return Some(format!("must not begin or end with white space: expected {NAME_RULE}"));
    }
    let characters = text.chars().count();
    (characters > MOST_NAME_CHARACTERS).then(|| {
        format!("must have at most {MOST_NAME_CHARACTERS} characters, found {characters}: expected {NAME_RULE}")
    })
}

/// As [`name_fault`], of words that may be left empty.
pub(crate) fn words_fault(text: &str) -> Option<String> {
    if text.is_empty() { None } else { name_fault(text) }
}

/// Only what [`name_fault`] says of characters that are not seen.
pub(crate) fn unseen_fault(text: &str) -> Option<String> {
    let (place, c) = text.chars().enumerate().find(|(_, c)| is_unseen(*c))?;
    Some(format!(
        "must not hold the invisible character U+{:04X} (character {} of it): expected {NAME_RULE}",
        u32::from(c),
        place + 1
    ))
}

/// The text with every character that is not seen written out, as `\n` or `\u{1b}`; `kept` stays as it is.
pub(crate) fn visible(text: &str, kept: &[char]) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if !is_unseen(c) || kept.contains(&c) {
            out.push(c);
        } else {
            out.extend(c.escape_default());
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_what_can_be_seen_and_nothing_else() {
        for name in ["coil", "A", "24 × 50", "Spule \"Ä\" <1>", "=1+1", "खगोल‍", "/* @rate@ */", "👩‍🔬", "a\u{a0}b"]
        {
            assert_eq!(name_fault(name), None, "{name}");
        }
        let long = "x".repeat(MOST_NAME_CHARACTERS + 1);
        let bad = ["", " ", " a", "a ", "a\tb", "a\nb", "\u{1b}[2J", "a\u{7f}", "a\u{85}b", "a\u{2028}b", "\u{202e}a"];
        let further = ["a\u{fffe}", "a\u{0}b", "\u{feff}a", "a\u{200b}", "a\u{2066}b", "a\u{a0}", long.as_str()];
        for name in bad.into_iter().chain(further) {
            assert!(name_fault(name).is_some(), "{name:?}");
        }
        assert_eq!(words_fault(""), None);
        assert!(words_fault(" ").is_some());
    }

    #[test]
    fn what_is_not_seen_is_written_out() {
        assert_eq!(visible("a\u{1b}[2J\r\nb\u{202e}\u{9b}", &['\n']), "a\\u{1b}[2J\\r\nb\\u{202e}\\u{9b}");
        assert_eq!(visible("ein Weg µ", &[]), "ein Weg µ");
    }
}
