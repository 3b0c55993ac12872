//! The `softras` command: parse, run, exit.

mod commands;

use clap::{CommandFactory, Parser, error::ErrorKind};
use commands::{Cli, Failure};
use std::io::Write;
use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = Cli::parse();
    match commands::run(&cli) {
        Ok(()) => ExitCode::SUCCESS,
        // As clap does for what it finds itself: usage on stderr, exit code 2.
        Err(Failure::Usage(what)) => Cli::command().error(ErrorKind::ValueValidation, what).exit(),
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
