//! The `softras` command: parse, run, exit.

mod commands;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{CommandFactory, Parser};
use commands::{Cli, Failure};
use softras_io::text;
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let outcome = match Cli::try_parse() {
        Ok(cli) => commands::run(&cli),
        Err(error) if error.use_stderr() => with_option(error).exit(),
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

/// If `fit` is given a path without an option, adds a tip that names the option.
fn with_option(mut error: clap::Error) -> clap::Error {
    let mut words = std::env::args().skip(1);
    let is_fit = words.find(|word| !word.starts_with('-')).is_some_and(|name| name == "fit");
    let given = match error.get(ContextKind::InvalidArg) {
        Some(ContextValue::String(given)) if is_fit && error.kind() == ErrorKind::UnknownArgument => given.clone(),
        _ => return error,
    };
    let path = Path::new(&given);
    let option =
        if path.is_dir() || path.extension().is_some_and(|ending| ending == "npy") { "--views" } else { "--from" };
    if path.exists() {
        let tip = format!("name it with an option: {option} {given}");
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
    }
    error
}

fn fail(why: &str) -> ExitCode {
    // With stderr closed the exit code has to do.
    let _ = writeln!(std::io::stderr(), "error: {}", text::harmless(why, false));
    ExitCode::FAILURE
}
