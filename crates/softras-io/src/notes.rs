//! Notes on what a file says and the mesh does not keep.

use softras::{Error, Result};
use std::path::{Path, PathBuf};

/// The most notes of all files: if every line is malformed, the first few are enough.
const MAX_NOTES: usize = 128;
/// The most of those that are counted: a binary file has any number of unknown words.
const MAX_COUNTED: usize = MAX_NOTES / 2;

/// A part of a file that was met and is not kept as it stands.
struct Note {
    /// `None` for the mesh file.
    file: Option<PathBuf>,
    /// The first line with it, where the format has lines.
    line: Option<usize>,
    times: usize,
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
        self.push(MAX_NOTES, Note { file: None, line, times: 1, what: what.into() });
    }

    /// A note on the mesh file that stands for all of the same text, with the first line and their number.
    pub fn count(&mut self, line: impl Into<Option<usize>>, what: &str) {
        match self.all.iter_mut().find(|note| note.what == what && note.file.is_none()) {
            Some(note) => note.times += 1,
            None => self.push(MAX_COUNTED, Note { file: None, line: line.into(), times: 1, what: what.into() }),
        }
    }

    /// A note on another file.
    pub fn add_in(&mut self, file: &Path, line: Option<usize>, what: impl Into<String>) {
        self.push(MAX_NOTES, Note { file: Some(file.into()), line, times: 1, what: what.into() });
    }

    /// The line of the first note if it is of the mesh file, and the texts of the first notes.
    pub fn reasons(&self, most: usize) -> (Option<usize>, String) {
        let texts: Vec<&str> = self.all.iter().take(most).map(|note| note.what.as_str()).collect();
        let first = self.all.first().filter(|note| note.file.is_none());
        (first.and_then(|note| note.line), texts.join("; "))
    }

    fn push(&mut self, most: usize, note: Note) {
        if self.all.len() < most { self.all.push(note) } else { self.more += 1 }
    }

    /// The notes as sentences.
    ///
    /// # Errors
    /// [`Error::File`] for the first note, if they are not allowed.
    pub fn finish(self, strict: bool) -> Result<Vec<String>> {
        let path = |note: &Note| note.file.as_ref().unwrap_or(&self.mesh).clone();
        let sentence = |note: &Note| {
            let name = path(note).file_name().unwrap_or_default().to_string_lossy().into_owned();
            match note {
                Note { line: Some(line), times: 1, what, .. } => format!("{name}:{line}: {what}"),
                Note { line: Some(line), times, what, .. } => format!("{name}:{line} and {} more: {what}", times - 1),
                Note { times: 1, what, .. } => format!("{name}: {what}"),
                Note { times, what, .. } => format!("{name}: {what} ({times} in all)"),
            }
        };
        match self.all.first() {
            Some(note) if strict => Err(Error::File {
                path: path(note),
                line: note.line,
                what: note.what.clone(),
                fix: "correct the file, or leave out `strict` (--strict in the command) to draw the rest".into(),
            }),
            _ => {
                let last = (self.more > 0).then(|| format!("and {} notes more", self.more));
                Ok(self.all.iter().map(sentence).chain(last).collect())
            }
        }
    }
}
