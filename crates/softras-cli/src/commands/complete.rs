//! `softras completions` and `softras man`: completions for shells, and manual pages.

use super::{Cli, Failure};
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

/// Prints a manual page.
pub fn man(args: &ManArgs) -> Result<(), Failure> {
    let mut whole = Cli::command();
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
    let (notes, examples) = text.split_once("Examples:\n").unwrap_or((&text, ""));
    command = command.override_usage(usage.trim_start_matches("Usage: ").to_owned()).after_help(None::<&str>);
    let man = clap_mangen::Man::new(command).source(concat!("softras ", env!("CARGO_PKG_VERSION")));
    let mut below = Roff::default();
    for (heading, text) in [("EXAMPLES", examples), ("NOTES", notes.trim_end())] {
        if !text.is_empty() {
            below.control("SH", [heading]).control("nf", []);
            text.lines().for_each(|line| _ = below.text([roman(line.trim_start())]));
            below.control("fi", []);
        }
    }
    let mut bytes = Vec::new();
    // Writing to memory cannot fail.
    let _ = man.render(&mut bytes).and_then(|()| below.to_writer(&mut bytes));
    bytes
}
