//! `softras completions` and `softras man`: what a shell and `man` know of the command.

use super::{Cli, Failure, help};
use clap::{Args, Command, CommandFactory};
use clap_complete::Shell;
use clap_mangen::roff::{Roff, roman};
use std::io::Write;

/// Print completions of the command for a shell
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  softras completions bash > ~/.local/share/bash-completion/completions/softras
  softras completions zsh > ~/.zfunc/_softras
  softras completions fish > ~/.config/fish/completions/softras.fish")]
pub struct CompletionsArgs {
    /// The shell
    #[arg(value_enum)]
    pub shell: Shell,
}

/// Print the manual page of the command, or of one of its commands
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  softras man render | man -l -
  softras man > ~/.local/share/man/man1/softras.1
  softras man render > ~/.local/share/man/man1/softras-render.1")]
pub struct ManArgs {
    /// One of the commands [default: all of softras]
    pub command: Option<String>,
}

fn print(bytes: &[u8]) -> Result<(), Failure> {
    let mut stdout = std::io::stdout().lock();
    stdout.write_all(bytes).and_then(|()| stdout.flush()).map_err(Failure::of_output)
}

/// Prints completions.
pub fn completions(args: &CompletionsArgs) -> Result<(), Failure> {
    let mut bytes = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "softras", &mut bytes);
    print(&bytes)
}

/// The columns of text on a terminal of 80, of which `man` indents the first seven.
const MAN_WIDTH: usize = 72;

/// Prints a manual page.
pub fn man(args: &ManArgs) -> Result<(), Failure> {
    let mut whole = help::of_width(MAN_WIDTH);
    whole.build();
    let command = match &args.command {
        None => &whole,
        Some(name) => whole.find_subcommand(name).ok_or_else(|| Failure::Usage(format!("no command {name:?}")))?,
    };
    print(&page(command))
}

/// The manual page of a command: the synopsis is the usage of its help, and the texts below the options keep their lines.
fn page(command: &Command) -> Vec<u8> {
    let mut command = command.clone();
    let usage = command.render_usage().to_string();
    let text = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    command = command.override_usage(usage.trim_start_matches("Usage: ").to_owned()).after_help(None::<&str>);
    let man = clap_mangen::Man::new(command).source(concat!("softras ", env!("CARGO_PKG_VERSION")));
    let mut below = Roff::default();
    let (notes, examples) = parted(&text);
    for (heading, lines) in [("EXAMPLES", examples), ("NOTES", notes)] {
        if !lines.is_empty() {
            below.control("SH", [heading]).control("nf", []);
            lines.into_iter().for_each(|line| _ = below.text([roman(line)]));
            below.control("fi", []);
        }
    }
    let mut bytes = Vec::new();
    // Writing to memory cannot fail.
    let _ = man.render(&mut bytes).and_then(|()| below.to_writer(&mut bytes));
    bytes
}

/// The lines of a text, and those of its paragraph of examples without the heading and their indent.
fn parted(text: &str) -> (Vec<&str>, Vec<&str>) {
    let (mut notes, mut examples, mut is_example) = (Vec::new(), Vec::new(), false);
    for line in text.trim().lines() {
        if line == "Examples:" {
            is_example = true;
        } else if is_example && !line.is_empty() {
            examples.push(line.strip_prefix("  ").unwrap_or(line));
        } else if !is_example {
            notes.push(line);
        } else {
            is_example = false;
        }
    }
    while notes.last().is_some_and(|line| line.is_empty()) {
        notes.pop();
    }
    (notes, examples)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn examples_are_parted_from_notes() {
        let text = "A note.\n\nExamples:\n  softras one\n    --more\n\nAnother:\n  its line\n";
        assert_eq!(parted(text), (vec!["A note.", "", "Another:", "  its line"], vec!["softras one", "  --more"]));
        assert_eq!(parted("Examples:\n  softras one"), (vec![], vec!["softras one"]));
    }
}
