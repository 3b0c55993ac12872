//! The `softras` command: parse, run, exit.

mod commands;

use clap::{CommandFactory, Parser, error::ErrorKind};
use commands::{Cli, Failure};
use softras_io::text;
use std::io::Write;
use std::process::ExitCode;

fn main() -> ExitCode {
    let outcome = match Cli::try_parse() {
        Ok(cli) => commands::run(&cli),
        Err(error) if error.use_stderr() => error.exit(),
        // The help or the version.
        Err(wanted) => wanted.print().and_then(|()| std::io::stdout().flush()).map_err(Failure::of_output),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        // As clap does for what it finds itself: the command's usage on stderr, exit code 2.
        Err(Failure::Usage(what)) => {
            let what = text::harmless(&what, false);
            let mut whole = Cli::command();
            whole.build();
            let name = std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned());
            let name = name.into_iter().find(|word| whole.find_subcommand(word).is_some());
            let command = name.as_ref().and_then(|name| whole.find_subcommand_mut(name));
            command.unwrap_or(&mut Cli::command()).error(ErrorKind::ValueValidation, what).exit()
        }
        Err(Failure::Error(error)) => fail(&error.to_string()),
        Err(Failure::Output(error)) => fail(&format!("standard output: {error}: the results were not all written")),
        Err(Failure::Interrupted) => ExitCode::from(130),
        Err(Failure::Told) => ExitCode::FAILURE,
        // The reader of our output has gone, as `head` does when it has seen enough.
        Err(Failure::Closed) => ExitCode::SUCCESS,
    }
}

fn fail(why: &str) -> ExitCode {
    // With stderr closed the exit code has to do.
    let _ = writeln!(std::io::stderr(), "error: {}", text::harmless(why, false));
    ExitCode::FAILURE
}
