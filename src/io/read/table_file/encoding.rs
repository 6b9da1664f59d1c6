//! Texts that are not in UTF-8: what Windows programs write.
//!
//! UTF-16 is told by its mark of byte order. A text with bytes that are no UTF-8, few of them and no control characters, is taken as
//! Windows-1252, as which °C and °/h come out right of any western code page.

use std::io::{self, Read};

/// How a text is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Utf16 { is_big_endian: bool },
    Western,
}

/// Windows-1252 from 0x80 to 0x9F; the rest is as in Unicode.
const WESTERN: [char; 32] = [
    '€', '\u{fffd}', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\u{fffd}', 'Ž', '\u{fffd}', '\u{fffd}',
    '‘', '’', '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\u{fffd}', 'ž', 'Ÿ',
];
/// Of a text, beyond ASCII; more than this is no table of numbers.
const MOST_FOREIGN: f64 = 0.1;

impl Encoding {
    /// None of UTF-8, and of what is no text.
    pub(super) fn of(head: &[u8]) -> Option<Self> {
        match head {
            [0xff, 0xfe, ..] => return Some(Encoding::Utf16 { is_big_endian: false }),
            [0xfe, 0xff, ..] => return Some(Encoding::Utf16 { is_big_endian: true }),
            _ => {}
        }
        let error = std::str::from_utf8(head).err()?;
        // A character may be cut off where the head ends.
        error.error_len()?;
        let is_control = |byte: &u8| *byte < b' ' && !matches!(byte, b'\t' | b'\n' | b'\r');
        let foreign = head.iter().filter(|byte| **byte >= 0x80).count();
        let is_text = !head.iter().any(is_control) && (foreign as f64) < MOST_FOREIGN * head.len() as f64;
        is_text.then_some(Encoding::Western)
    }

    pub(super) fn remark(self) -> String {
        let name = match self {
            Encoding::Utf16 { .. } => "UTF-16",
            Encoding::Western => "Windows-1252, because it is no UTF-8",
        };
        format!("the text is read as {name}")
    }
}

/// The same text in UTF-8.
pub(super) struct Decoded<R> {
    inner: R,
    encoding: Encoding,
    raw: Vec<u8>,
    text: String,
    taken: usize,
}

const BLOCK_BYTES: u64 = 1 << 16;

impl<R: Read> Decoded<R> {
    pub(super) fn new(inner: R, encoding: Encoding) -> Self {
        Self { inner, encoding, raw: Vec::new(), text: String::new(), taken: 0 }
    }

    /// Whether there was more.
    fn fill(&mut self) -> io::Result<bool> {
        let read = (&mut self.inner).take(BLOCK_BYTES).read_to_end(&mut self.raw)?;
        let is_end = read == 0;
        (self.taken, self.text) = (0, String::new());
        let used = match self.encoding {
            Encoding::Western => {
                let character = |byte: &u8| match byte {
                    0x80..=0x9f => WESTERN[usize::from(byte - 0x80)],
                    other => char::from(*other),
                };
                self.text.extend(self.raw.iter().map(character));
                self.raw.len()
            }
            Encoding::Utf16 { is_big_endian } => {
                let unit = |pair: &[u8]| match is_big_endian {
                    true => u16::from_be_bytes([pair[0], pair[1]]),
                    false => u16::from_le_bytes([pair[0], pair[1]]),
                };
                let mut units: Vec<u16> = self.raw.chunks_exact(2).map(unit).collect();
                // The second half of a character may not be there yet.
                if !is_end && units.last().is_some_and(|last| (0xd800..0xdc00).contains(last)) {
                    units.pop();
                }
                let characters = char::decode_utf16(units.iter().copied());
                self.text.extend(characters.map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)));
                2 * units.len()
            }
        };
        self.raw.drain(..used);
        Ok(!is_end)
    }
}

impl<R: Read> Read for Decoded<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.taken == self.text.len() {
            if !self.fill()? && self.text.is_empty() {
                return Ok(0);
            }
        }
        let left = &self.text.as_bytes()[self.taken..];
        let count = left.len().min(buffer.len());
        buffer[..count].copy_from_slice(&left[..count]);
        self.taken += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_windows_programs_come_out_as_they_were_meant() {
        let text = "Zeit [s];T [°C];Ω [°/h] 🌡\r\n0;20,5;€\n";
        let western: Vec<u8> =
            text.replace(['Ω', '🌡'], "w").chars().map(|c| if c == '€' { 0x80 } else { c as u8 }).collect();
        let units: Vec<u16> = "\u{feff}".encode_utf16().chain(text.encode_utf16()).collect();
        let little: Vec<u8> = units.iter().flat_map(|u| u.to_le_bytes()).collect();
        let big: Vec<u8> = units.iter().flat_map(|u| u.to_be_bytes()).collect();
        for (bytes, expected) in [
            (western, text.replace(['Ω', '🌡'], "w")),
            (little, format!("\u{feff}{text}")),
            (big, format!("\u{feff}{text}")),
        ] {
            let encoding = Encoding::of(&bytes).unwrap();
            // However the input comes.
            let mut found = String::new();
            let pieces = io::BufReader::with_capacity(3, bytes.as_slice());
            Decoded::new(pieces, encoding).read_to_string(&mut found).unwrap();
            assert_eq!(found, expected);
        }
        for other in [text.as_bytes(), b"\x89HDF\r\n\x1a\n\xff\xff", b"", &[0xff; 40]] {
            assert_eq!(Encoding::of(other), None);
        }
    }
}
