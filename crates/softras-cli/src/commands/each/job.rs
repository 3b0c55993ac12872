//! One job of `softras each`.

use super::super::Failure;
use serde_json::{Value, json};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

/// A command of softras with the words for one entry of the folder.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// The entry's name in the folder.
    pub name: String,
    /// The words after `softras`.
    pub words: Vec<String>,
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

/// Refuses a command that would be the same for all jobs, or write all results into one file.
///
/// # Errors
/// [`Failure::Usage`].
pub fn validate(command: &[String]) -> Result<(), Failure> {
    let varies = |word: &str| PLACES.iter().any(|place| word.contains(place));
    if !command.iter().any(|word| varies(word)) {
        let fix = "write {path} where the mesh's path belongs, as in `-- render {path} -o pictures/{name}.png`";
        return Err(Failure::Usage(format!("the command is the same for every job: {fix}")));
    }
    match outputs(command).find(|output| !varies(output)) {
        Some(output) => {
            let what = format!("every job would write {output:?}");
            Err(Failure::Usage(format!("{what}: put {{name}} into the output's name, as in fitted/{{name}}.obj")))
        }
        None => Ok(()),
    }
}

/// The files that a command is told to write.
fn outputs(command: &[String]) -> impl Iterator<Item = &str> {
    let behind = command.windows(2).filter(|pair| pair[0] == "-o" || pair[0] == "--out").map(|pair| &pair[1][..]);
    behind.chain(command.iter().filter_map(|word| word.strip_prefix("--out=")))
}

impl Job {
    /// The job of an entry.
    ///
    /// # Errors
    /// [`Failure::Usage`] for a name that is not UTF-8.
    pub fn new(path: &Path, command: &[String]) -> Result<Self, Failure> {
        let text = |part: Option<&std::ffi::OsStr>| part.and_then(|part| part.to_str()).map(str::to_owned);
        let (Some(whole), Some(file), Some(name)) = (path.to_str(), text(path.file_name()), text(path.file_stem()))
        else {
            return Err(Failure::Usage(format!("{}: the name is not UTF-8; rename it", path.display())));
        };
        let words = command.iter().map(|word| filled(word, &[whole, &file, &name])).collect();
        Ok(Self { name: file, words })
    }

    /// Runs it to its end. The folders of what it writes are made.
    pub fn run(&self, program: &Path) -> Outcome {
        let start = Instant::now();
        for folder in outputs(&self.words).filter_map(|output| Path::new(output).parent()) {
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
                messages: String::from_utf8_lossy(&ended.stderr).trim_end().into(),
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
        let job = Job::new(Path::new("in/{name}.b.obj"), &words("render {path} -o out/{name}/{file}{name")).unwrap();
        assert_eq!(job.name, "{name}.b.obj");
        assert_eq!(job.words, words("render in/{name}.b.obj -o out/{name}.b/{name}.b.obj{name"));
    }

    #[test]
    fn commands_that_are_one_for_all_are_refused() {
        let refused = |text: &str| match validate(&words(text)) {
            Err(Failure::Usage(what)) => what,
            other => format!("{other:?}"),
        };
        assert!(refused("render a.obj -o b.png").contains("{path}"));
        for command in ["render {path} -o b.png", "fit --from {path} --out b.obj", "fit --from {path} --out=b.obj"] {
            assert!(refused(command).contains("every job would write \"b."), "{command}");
        }
        assert_eq!(refused("iou {path} b.obj"), "Ok(())");
        assert_eq!(refused("render {path} -o {name}.png"), "Ok(())");
    }

    #[test]
    fn what_a_job_prints_is_json_where_it_can_be() {
        let job = Job { name: "a".into(), words: words("iou a b") };
        let line = |output: &str| {
            let outcome = Outcome { status: Some(0), seconds: 1.23456, output: output.into(), messages: "note".into() };
            serde_json::from_str::<Value>(&outcome.line(&job)).unwrap()
        };
        assert_eq!(line("{\"iou\":0.5}")["output"]["iou"], 0.5);
        assert_eq!(line("two words")["output"], "two words");
        assert_eq!((&line("")["seconds"], &line("")["status"]), (&json!(1.235), &json!(0)));
    }
}
