//! `softras completions` and `softras man`: what a shell and `man` know of the command.

use super::{Cli, Failure};
use clap::{Args, CommandFactory};
use clap_complete::Shell;
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
  softras man > ~/.local/share/man/man1/softras.1
  softras man render | man -l -")]
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
    let mut bytes = Vec::new();
    // Writing to memory cannot fail.
    let _ = clap_mangen::Man::new(command.clone()).render(&mut bytes);
    print(&bytes)
}
