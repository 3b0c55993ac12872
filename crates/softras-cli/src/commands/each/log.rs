//! The log of `softras each`, from which a run that was ended goes on.

use super::super::{Failure, note};
use super::job::Job;
use serde_json::Value;
use std::collections::HashSet;
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

/// How a line begins: serde_json sorts the keys.
const START: &[u8] = b"{\"command\":[";

/// A file with a line for each job that ended.
pub struct Log {
    path: PathBuf,
    file: File,
    /// The commands of the jobs that succeeded.
    done: HashSet<Vec<String>>,
}

impl Log {
    /// Opens the file, or makes it, and reads what is done.
    ///
    /// # Errors
    /// [`softras::Error::Io`]; [`softras::Error::Scene`] for a file that is no such log.
    pub fn open(path: &Path) -> Result<Self, Failure> {
        let refused = |source| softras::Error::Io { path: path.into(), source };
        if path.exists() && !path.is_file() {
            let what = format!("{}: the log is no plain file", path.display());
            return Err(softras::Error::Scene { what, fix: "name a file that can be read again".into() }.into());
        }
        let file = OpenOptions::new().read(true).append(true).create(true).open(path).map_err(refused)?;
        let mut done = HashSet::new();
        let mut reader = BufReader::new(&file);
        let (mut line, mut number, mut whole) = (Vec::new(), 0, 0);
        while reader.read_until(b'\n', &mut line).map_err(refused)? > 0 {
            number += 1;
            if !line.ends_with(b"\n") {
                // The last line of a run that was killed, or a file that is none of ours.
                if !line.starts_with(&START[..START.len().min(line.len())]) {
                    return Err(not_ours(path, number));
                }
                note(&format!("{}: its last line was cut off, and is left out", path.display()));
                break;
            }
            let entry = serde_json::from_slice::<Value>(&line).ok().filter(|entry| entry["command"].is_array());
            done.extend(succeeded(&entry.ok_or_else(|| not_ours(path, number))?));
            whole += line.len() as u64;
            line.clear();
        }
        if !line.is_empty() {
            file.set_len(whole).map_err(refused)?;
        }
        Ok(Self { path: path.into(), file, done })
    }

    /// Whether the job has succeeded before.
    pub fn has(&self, job: &Job) -> bool {
        self.done.contains(&job.words)
    }

    /// Adds a line.
    ///
    /// # Errors
    /// [`softras::Error::Io`].
    pub fn add(&mut self, line: &str) -> Result<(), Failure> {
        // One call, so that the lines of several processes do not mix.
        let written = self.file.write_all(format!("{line}\n").as_bytes());
        written.map_err(|source| softras::Error::Io { path: self.path.clone(), source }.into())
    }
}

/// The command of a job that ended well.
fn succeeded(entry: &Value) -> Option<Vec<String>> {
    let words = entry["command"].as_array().filter(|_| entry["status"] == 0)?;
    words.iter().map(|word| word.as_str().map(str::to_owned)).collect()
}

fn not_ours(path: &Path, line: usize) -> Failure {
    let what = format!("{}, line {line}: this is no line of a log of `softras each`", path.display());
    softras::Error::Scene { what, fix: "give a new file to --log; nothing was written into this one".into() }.into()
}
