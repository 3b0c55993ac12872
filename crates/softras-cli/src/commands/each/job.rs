//! One job of `softras each`.

use super::super::{Failure, help, progress};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

/// A command of softras with the words for one entry of the folder.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// The entry's name in the folder.
    pub name: String,
    /// The words after `softras`.
    pub words: Vec<String>,
    /// What it writes.
    pub outputs: Vec<PathBuf>,
}

/// How a job ended.
#[derive(Debug)]
pub struct Outcome {
    /// `None` if a signal ended it, or if it did not begin.
    status: Option<i32>,
    seconds: f64,
    output: String,
    messages: String,
}

const PLACES: [&str; 3] = ["{path}", "{file}", "{name}"];

/// The arguments, of any command, that name what is written.
const WRITTEN: [&str; 10] =
    ["out", "obj", "json", "plot", "plots", "gif", "checkpoint", "write_views", "landscape", "map"];

/// The files and folders that a command is told to write, with their places. Ends the process, as the command itself would, for
/// words that it does not take.
///
/// # Errors
/// [`Failure::Usage`] for a command that would be the same for all jobs, or write the results of all into one file.
pub fn outputs(command: &[String]) -> Result<Vec<String>, Failure> {
    let varies = |word: &str| PLACES.iter().any(|place| word.contains(place));
    if !command.iter().any(|word| varies(word)) {
        let fix = "write {path} where the mesh's path belongs, as in `-- render {path} -o pictures/{name}.png`";
        return Err(Failure::Usage(format!("the command is the same for every job: {fix}")));
    }
    let words = std::iter::once("softras").chain(command.iter().map(String::as_str));
    let matches = help::command().try_get_matches_from(words).unwrap_or_else(|error| error.exit());
    let Some((_, given)) = matches.subcommand() else { return Ok(Vec::new()) };
    // An argument that another command has, or has as a switch, is none here.
    let paths = WRITTEN.iter().filter_map(|id| given.try_get_many::<PathBuf>(id).ok().flatten()).flatten();
    let outputs: Vec<String> = paths.map(|path| path.to_string_lossy().into_owned()).collect();
    match outputs.iter().find(|output| !varies(output)) {
        Some(output) => {
            let what = format!("every job would write {output:?}");
            Err(Failure::Usage(format!("{what}: put {{name}} into the output's name, as in fitted/{{name}}.obj")))
        }
        None => Ok(outputs),
    }
}

impl Job {
    /// The job of an entry, by a command and its [`outputs`].
    ///
    /// # Errors
    /// [`Failure::Usage`] for a name that is not UTF-8.
    pub fn new(path: &Path, command: &[String], outputs: &[String]) -> Result<Self, Failure> {
        let text = |part: Option<&std::ffi::OsStr>| part.and_then(|part| part.to_str()).map(str::to_owned);
        let (Some(whole), Some(file), Some(name)) = (path.to_str(), text(path.file_name()), text(path.file_stem()))
        else {
            return Err(Failure::Usage(format!("{}: the name is not UTF-8; rename it", path.display())));
        };
        let values = [whole, &file, &name];
        let words = command.iter().map(|word| filled(word, &values)).collect();
        let outputs = outputs.iter().map(|output| filled(output, &values).into()).collect();
        Ok(Self { name: file, words, outputs })
    }

    /// Runs it to its end. The folders of what it writes are made.
    pub fn run(&self, program: &Path) -> Outcome {
        let start = Instant::now();
        for folder in self.outputs.iter().filter_map(|output| output.parent()) {
            // The command says it better if this fails.
            let _ = std::fs::create_dir_all(folder);
        }
        let ended = Command::new(program).args(&self.words).stdin(Stdio::null()).output();
        let seconds = start.elapsed().as_secs_f64();
        match ended {
            Ok(ended) => Outcome {
                status: ended.status.code(),
                seconds,
                output: String::from_utf8_lossy(&ended.stdout).trim_end().into(),
                messages: progress::without_progress(&String::from_utf8_lossy(&ended.stderr)),
            },
            Err(error) => Outcome { status: None, seconds, output: String::new(), messages: error.to_string() },
        }
    }
}

/// A word with the path, the file and the name in their places; what is put there is not searched again.
fn filled(word: &str, values: &[&str; 3]) -> String {
    let (mut made, mut rest) = (String::new(), word);
    while let Some((at, which)) = (0..3).filter_map(|i| Some((rest.find(PLACES[i])?, i))).min() {
        made += &rest[..at];
        made += values[which];
        rest = &rest[at + PLACES[which].len()..];
    }
    made + rest
}

impl Outcome {
    /// Whether the job did what it was asked for.
    pub fn is_good(&self) -> bool {
        self.status == Some(0)
    }

    /// The line of JSON.
    pub fn line(&self, job: &Job) -> String {
        let output = serde_json::from_str(&self.output).unwrap_or_else(|_| Value::from(&self.output[..]));
        let seconds = (1e3 * self.seconds).round() / 1e3;
        json!({
            "job": job.name, "command": job.words, "status": self.status, "seconds": seconds, "output": output,
            "messages": self.messages,
        })
        .to_string()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn words(text: &str) -> Vec<String> {
        text.split(' ').map(str::to_owned).collect()
    }

    #[test]
    fn places_are_filled_once() {
        let command = words("render {path} -o out/{name}/{file}{name");
        let job = Job::new(Path::new("in/{name}.b.obj"), &command, &words("out/{name}/{file}")).unwrap();
        assert_eq!(job.name, "{name}.b.obj");
        assert_eq!(job.words, words("render in/{name}.b.obj -o out/{name}.b/{name}.b.obj{name"));
        assert_eq!(job.outputs, [Path::new("out/{name}.b/{name}.b.obj")]);
    }

    #[test]
    fn commands_that_are_one_for_all_are_refused() {
        let refused = |text: &str| match outputs(&words(text)) {
            Err(Failure::Usage(what)) => what,
            other => format!("{other:?}"),
        };
        assert!(refused("render a.obj -o b.png").contains("{path}"));
        for line in [
            "render {path} -o b.png",
            "render {path} -ob.png",
            "render {path} -o {name}.png -o b.png",
            "fit --from {path} --out=b.obj",
            "fit --from {path} -o {name}.obj --gif b.gif",
            "fit --from {path} -o {name}.obj --json b.json",
            "bench {path} --plots b.plots",
        ] {
            assert!(refused(line).contains("every job would write \"b."), "{line}");
        }
        assert_eq!(refused("iou {path} b.obj --json"), "Ok([])");
        assert_eq!(refused("render {path} -o {name}.png"), "Ok([\"{name}.png\"])");
    }

    #[test]
    fn every_path_that_a_command_takes_is_read_or_written() {
        const READ: [&str; 14] = [
            "mesh",
            "cameras",
            "from",
            "benchmark",
            "target_image",
            "a",
            "b",
            "scene",
            "image",
            "folder",
            "log",
            "views",
            "depths",
            "normals",
        ];
        for command in help::command().get_subcommands() {
            for argument in command.get_arguments() {
                let id = argument.get_id().as_str();
                let is_path = argument.get_value_parser().type_id() == std::any::TypeId::of::<PathBuf>();
                assert!(!is_path || READ.contains(&id) || WRITTEN.contains(&id), "{} {id}", command.get_name());
            }
        }
    }

    #[test]
    fn what_a_job_prints_is_json_where_it_can_be() {
        let job = Job { name: "a".into(), words: words("iou a b"), outputs: Vec::new() };
        let line = |output: &str| {
            let outcome = Outcome { status: Some(0), seconds: 1.23456, output: output.into(), messages: "note".into() };
            serde_json::from_str::<Value>(&outcome.line(&job)).unwrap()
        };
        assert_eq!(line("{\"iou\":0.5}")["output"]["iou"], 0.5);
        assert_eq!(line("two words")["output"], "two words");
        assert_eq!((&line("")["seconds"], &line("")["status"]), (&json!(1.235), &json!(0)));
    }
}
