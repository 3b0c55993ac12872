//! Text for the terminal, in which characters from files and names cannot control it.

use std::borrow::Cow;

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
