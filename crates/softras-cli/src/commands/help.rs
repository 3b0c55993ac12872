//! The texts below the options of each command's help, filled to the width of the terminal.

use super::Cli;
use clap::{Command, CommandFactory};

/// The width without a terminal, and the most with one.
const WIDEST: usize = 100;
/// The least width that texts are filled to; narrower terminals break lines themselves.
const NARROWEST: usize = 40;

/// The command, with its texts filled to the width of the terminal.
pub fn command() -> Command {
    let terminal = terminal_size::terminal_size().map_or(WIDEST, |(width, _)| usize::from(width.0));
    of_width(terminal.clamp(NARROWEST, WIDEST))
}

/// The command, with its texts filled to a width.
pub fn of_width(width: usize) -> Command {
    let mut command = Cli::command().term_width(width);
    for sub in command.get_subcommands_mut() {
        if let Some(text) = sub.get_after_help().map(ToString::to_string) {
            *sub = sub.clone().after_help(filled(&text, width));
        }
    }
    command
}

/// A line of the source, with the lines that continue it.
struct Item {
    text: String,
    /// The column at which its continuations begin.
    hang: usize,
    is_paragraph: bool,
}

fn indent_of(line: &str) -> usize {
    line.chars().take_while(|c| *c == ' ').count()
}

/// The column of the description in `name  description`: after the first two spaces behind the indent.
fn description(line: &str) -> Option<usize> {
    let letters: Vec<char> = line.chars().collect();
    let start = indent_of(line);
    let gap = (start..letters.len()).find(|&i| letters[i..].starts_with(&[' ', ' ']))?;
    Some(gap + letters[gap..].iter().take_while(|c| **c == ' ').count())
}

/// Fills a text whose lines were broken by hand. Lines without indent are paragraphs; an indented line is one of its own, and
/// lines that begin below its description continue it.
fn filled(text: &str, width: usize) -> String {
    let mut items: Vec<Item> = Vec::new();
    for line in text.lines() {
        let (indent, column) = (indent_of(line), description(line));
        let is_paragraph = !line.is_empty() && indent == 0 && column.is_none();
        match items.last_mut() {
            Some(last) if is_paragraph && last.is_paragraph && !last.text.ends_with(':') => {
                last.text = format!("{} {line}", last.text);
            }
            Some(last) if indent > 0 && indent == last.hang && column.is_none() => {
                last.text = format!("{} {}", last.text, line.trim_start());
            }
            _ => {
                let hang = column.unwrap_or(if indent > 0 { indent + 4 } else { 0 });
                items.push(Item { text: line.to_string(), hang, is_paragraph });
            }
        }
    }
    items.iter().map(|item| fill(item, width)).collect::<Vec<_>>().join("\n")
}

/// Breaks an item into lines; gaps between words stay as wide as they are.
fn fill(item: &Item, width: usize) -> String {
    let hang = if item.hang > width / 2 { indent_of(&item.text) + 4 } else { item.hang };
    let (mut lines, mut line) = (Vec::new(), String::new());
    let mut rest = item.text.as_str();
    while !rest.is_empty() {
        let word_at = rest.len() - rest.trim_start_matches(' ').len();
        let end = rest[word_at..].find(' ').map_or(rest.len(), |at| word_at + at);
        let (gap, word) = (&rest[..word_at], &rest[word_at..end]);
        let is_first = line.trim().is_empty();
        if !is_first && line.chars().count() + gap.len() + word.chars().count() > width {
            lines.push(std::mem::replace(&mut line, " ".repeat(hang)));
            line += word;
        } else {
            line += gap;
            line += word;
        }
        rest = &rest[end..];
    }
    lines.push(line);
    lines.join("\n")
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    const TEXT: &str = "\
A paragraph whose lines
were broken by hand.

name    its description, which
        goes on below
other   of another

Examples:
  softras one
  softras two";

    #[test]
    fn lines_broken_by_hand_are_filled_to_the_width() {
        let wide = "A paragraph whose lines were broken by hand.\n\nname    its description, which goes on below\n\
                    other   of another\n\nExamples:\n  softras one\n  softras two";
        assert_eq!(filled(TEXT, 80), wide);
        let narrow = "A paragraph whose lines were\nbroken by hand.\n\nname    its description, which\n        goes on below\n\
                      other   of another\n\nExamples:\n  softras one\n  softras two";
        assert_eq!(filled(TEXT, 30), narrow);
    }

    #[test]
    fn no_line_of_any_help_is_wrapped_twice() {
        for width in [72, 80, 100] {
            let mut command = of_width(width);
            command.build();
            for sub in command.get_subcommands_mut() {
                let text = sub.get_after_help().map(ToString::to_string).unwrap_or_default();
                let shown = sub.render_long_help().to_string();
                // What fits is not broken again.
                assert!(shown.contains(text.trim_end()), "{width}: {text}\nin\n{shown}");
                let longest = text.lines().map(|line| line.chars().count()).max().unwrap_or(0);
                assert!(longest <= width, "{width}: {longest} in {text}");
            }
        }
    }
}
