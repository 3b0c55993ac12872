//! Notes on what a file says and the mesh does not keep.

use softras::{Error, Result};
use std::path::{Path, PathBuf};

/// The most kinds of statements of a mesh file that are noted: a binary file has any number of unknown words.
const MAX_KINDS: usize = 32;
/// The most notes of all files: one in which every line is malformed is told of by the first few.
const MAX_NOTES: usize = 128;

/// What was met and is not kept.
struct Note {
    file: PathBuf,
    /// The first line with it, where the format has lines.
    line: Option<usize>,
    /// How often it was met again.
    more: usize,
    what: String,
}

/// The notes on a mesh file and on the files that it names.
pub struct Notes {
    mesh: PathBuf,
    all: Vec<Note>,
    /// How many more there would be.
    more: usize,
}

impl Notes {
    pub fn new(mesh: &Path) -> Self {
        Self { mesh: mesh.into(), all: Vec::new(), more: 0 }
    }

    /// A note on the mesh file.
    pub fn add(&mut self, line: Option<usize>, what: impl Into<String>) {
        let file = self.mesh.clone();
        self.add_in(&file, line, what);
    }

    /// A note on the mesh file that is not repeated.
    pub fn once(&mut self, what: &str) {
        if !self.all.iter().any(|note| note.what == what) {
            self.add(None, what);
        }
    }

    /// A note on another file.
    pub fn add_in(&mut self, file: &Path, line: Option<usize>, what: impl Into<String>) {
        self.push(Note { file: file.into(), line, more: 0, what: what.into() });
    }

    /// What was ignored in the mesh file.
    pub(super) fn extend(&mut self, ignored: Ignored) {
        for (what, line, times) in ignored.0 {
            self.push(Note { file: self.mesh.clone(), line: Some(line), more: times - 1, what });
        }
    }

    fn push(&mut self, note: Note) {
        if self.all.len() < MAX_NOTES { self.all.push(note) } else { self.more += 1 }
    }

    /// The notes as sentences.
    ///
    /// # Errors
    /// [`Error::File`] for the first note, if they are not allowed.
    pub fn finish(self, strict: bool) -> Result<Vec<String>> {
        let sentence = |note: &Note| {
            let name = note.file.file_name().unwrap_or_default().to_string_lossy();
            let line = note.line.map_or(String::new(), |line| format!(":{line}"));
            let more = if note.more > 0 { format!(" and {} more", note.more) } else { String::new() };
            format!("{name}{line}{more}: {}", note.what)
        };
        match self.all.first() {
            Some(note) if strict => Err(Error::File {
                path: note.file.clone(),
                line: note.line,
                what: note.what.clone(),
                fix: "correct the file, or read it without `strict` (--strict in the command), which draws the rest"
                    .into(),
            }),
            _ => {
                let last = (self.more > 0).then(|| format!("and {} notes more", self.more));
                Ok(self.all.iter().map(sentence).chain(last).collect())
            }
        }
    }
}

/// What was met in the mesh file, each kind once: the text of the note, the first line and the number of times.
#[derive(Default)]
pub(super) struct Ignored(Vec<(String, usize, usize)>);

impl Ignored {
    pub fn add(&mut self, note: impl Into<String>, line: usize) {
        let note = note.into();
        if let Some(entry) = self.0.iter_mut().find(|entry| entry.0 == note) {
            entry.2 += 1;
        } else if self.0.len() < MAX_KINDS {
            self.0.push((note, line, 1));
        }
    }
}
