//! Splits OBJ and MTL files into statements with line numbers.

use std::borrow::Cow;

/// One statement: a line with its continuations, neither blank nor a comment.
pub(super) struct Statement<'a> {
    /// The line on which it starts, counted from 1.
    pub line: usize,
    body: Cow<'a, str>,
}

impl Statement<'_> {
    /// The first word.
    pub fn keyword(&self) -> &str {
        self.body.split_whitespace().next().unwrap_or_default()
    }

    /// Everything after the first word, trimmed: names may hold spaces.
    pub fn rest(&self) -> &str {
        self.body.split_once(char::is_whitespace).map_or("", |(_, rest)| rest.trim())
    }

    /// [`Statement::rest`] up to a comment. A name that holds ` #` is cut there; `rest` has all of it.
    pub fn name(&self) -> &str {
        before_comment(self.rest())
    }

    /// The words after the first, up to a comment.
    pub fn words(&self) -> impl Iterator<Item = &str> {
        self.body.split_whitespace().skip(1).take_while(|word| !word.starts_with('#'))
    }
}

/// A text up to a word that begins with `#`.
pub(super) fn before_comment(text: &str) -> &str {
    let at = text.match_indices('#').map(|(at, _)| at).find(|&at| text[..at].ends_with(char::is_whitespace));
    at.map_or(text, |at| text[..at].trim_end())
}

/// Whether a line ends in `\`. A comment ends at its line, whatever its last letter.
fn goes_on_after(line: &str) -> bool {
    line.ends_with('\\') && !line.split_whitespace().any(|word| word.starts_with('#'))
}

/// The statements of a text with any line ends, lines that end in `\` joined with the next.
pub(super) fn statements(text: &str) -> impl Iterator<Item = Statement<'_>> {
    let line_end = if text.contains('\n') { '\n' } else { '\r' };
    let mut lines = text.split(line_end).zip(1..);
    std::iter::from_fn(move || {
        let (first, line) = lines.next()?;
        let mut body = Cow::Borrowed(first.trim());
        let mut goes_on = goes_on_after(&body);
        while goes_on {
            let Some((next, _)) = lines.next() else { break };
            goes_on = goes_on_after(next.trim());
            // Appended in place, so that a long chain of continuations takes linear time.
            let mut joined = body.into_owned();
            joined.pop();
            joined.push(' ');
            joined.push_str(next.trim());
            body = Cow::Owned(joined);
        }
        Some(Statement { line, body })
    })
    .filter(|statement| !statement.body.is_empty() && !statement.body.starts_with('#'))
}
