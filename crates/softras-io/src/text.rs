//! The text and the numbers of files, and text for the terminal, in which characters from files and names cannot control it.

use crate::input;
use softras::Result;
use std::{borrow::Cow, path::Path, str::FromStr};

const MARK: char = '\u{feff}';

/// Bytes as text: UTF-8, or else Latin-1, in which old programs write names.
pub(crate) fn decoded(bytes: &[u8]) -> Cow<'_, str> {
    std::str::from_utf8(bytes).map_or_else(|_| bytes.iter().map(|&byte| char::from(byte)).collect(), Cow::Borrowed)
}

/// Bytes without a mark of UTF-8 before them.
pub(crate) fn unmarked(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(&[0xef, 0xbb, 0xbf]).unwrap_or(bytes)
}

/// Bytes without spaces, NUL and the end of a DOS text behind them.
pub(crate) fn unpadded(bytes: &[u8]) -> &[u8] {
    let is_padding = |byte: &&u8| byte.is_ascii_whitespace() || matches!(byte, 0 | 0x1a);
    &bytes[..bytes.len() - bytes.iter().rev().take_while(is_padding).count()]
}

/// The text of a file in UTF-8, in UTF-16 with its mark, or in Latin-1, without the mark and the padding behind the text.
pub(crate) fn whole(path: &Path, bytes: Vec<u8>) -> Result<String> {
    let wide = |pair: fn([u8; 2]) -> u16| {
        String::from_utf16_lossy(&bytes.as_chunks().0.iter().map(|b| pair(*b)).collect::<Vec<_>>())
    };
    let room = || input::room_for(&path.display().to_string(), 3 * bytes.len() as u64);
    let mut text = match bytes[..] {
        [0xff, 0xfe, ..] => room().map(|()| wide(u16::from_le_bytes))?,
        [0xfe, 0xff, ..] => room().map(|()| wide(u16::from_be_bytes))?,
        _ => match String::from_utf8(bytes) {
            Ok(text) => text,
            Err(error) => {
                let bytes = error.into_bytes();
                input::room_for(&path.display().to_string(), 2 * bytes.len() as u64)?;
                decoded(&bytes).into_owned()
            }
        },
    };
    // NUL, and the end of a text under DOS.
    text.truncate(text.trim_end_matches(|c: char| c.is_whitespace() || matches!(c, '\0' | '\x1a')).len());
    if text.starts_with(MARK) {
        text.drain(..MARK.len_utf8());
    }
    Ok(text)
}

/// A number of a text, which may be infinite or none (`nan`, `-nan(ind)`, `1.#QNAN`).
pub(crate) fn number<T: FromStr + From<f32>>(word: &str) -> Option<T> {
    let is_none = || {
        let word = word.trim_start_matches(['+', '-']);
        word.starts_with("1.#") || word.get(..3).is_some_and(|start| start.eq_ignore_ascii_case("nan"))
    };
    word.parse().ok().or_else(|| is_none().then_some(T::from(f32::NAN)))
}

/// The most characters of a name that is shown.
const LONGEST_NAME: usize = 80;

/// Whether a terminal may take the character for an order: control characters, and marks that change the direction of text.
fn is_order(c: char) -> bool {
    c.is_control() || matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// The text with every such character replaced by an escape, which is one in JSON as well. Tabs stay, and line ends if `lines` is true.
pub fn harmless(text: &str, lines: bool) -> Cow<'_, str> {
    let is_kept = |c: char| !is_order(c) || c == '\t' || (lines && c == '\n');
    if text.chars().all(is_kept) {
        return text.into();
    }
    let mut shown = String::with_capacity(text.len() + 8);
    for c in text.chars() {
        match is_kept(c) {
            true => shown.push(c),
            false => shown.push_str(&format!("\\u{:04x}", u32::from(c))),
        }
    }
    shown.into()
}

/// A name as it is shown in a message: harmless, and not longer than a line.
pub fn name(name: &str) -> String {
    let mut shown = harmless(name, false).into_owned();
    if let Some((end, _)) = shown.char_indices().nth(LONGEST_NAME) {
        shown.truncate(end);
        shown.push('…');
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_to_the_terminal_become_their_numbers() {
        assert_eq!(harmless("a\x1b[31mb\n\u{9b}c\u{202e}d\t", false), "a\\u001b[31mb\\u000a\\u009bc\\u202ed\t");
        assert_eq!(harmless("two\nlines, σ = 1e-4 [µm]", true), "two\nlines, σ = 1e-4 [µm]");
        assert_eq!(name(&"é".repeat(100)), "é".repeat(80) + "…");
        assert_eq!(name("short"), "short");
    }
}
