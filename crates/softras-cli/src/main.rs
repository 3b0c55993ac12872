//! The `softras` command: parse, run, exit.

mod commands;

use clap::{FromArgMatches, error::ErrorKind};
use commands::{Cli, Failure, help};
use std::io::Write;
use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = Cli::from_arg_matches(&help::command().get_matches()).unwrap_or_else(|error| error.exit());
    match commands::run(&cli) {
        Ok(()) => ExitCode::SUCCESS,
        // As clap does for what it finds itself: the command's usage on stderr, exit code 2.
        Err(Failure::Usage(what)) => {
            let mut whole = help::command();
            whole.build();
            let name = std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned());
            let name = name.into_iter().find(|word| whole.find_subcommand(word).is_some());
            let command = name.as_ref().and_then(|name| whole.find_subcommand_mut(name));
            command.unwrap_or(&mut help::command()).error(ErrorKind::ValueValidation, what).exit()
        }
        Err(Failure::Interrupted) => ExitCode::from(130),
        Err(Failure::Error(error)) => {
            // With stderr closed the exit code has to do.
            let _ = writeln!(std::io::stderr(), "error: {error}");
            ExitCode::FAILURE
        }
        Err(Failure::Told) => ExitCode::FAILURE,
        // The reader of our output has gone, as `head` does when it has seen enough.
        Err(Failure::Closed) => ExitCode::SUCCESS,
    }
}
