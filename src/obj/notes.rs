//! Notes on what a file says and the mesh does not keep: each kind once, with its first line and its count.

/// The most kinds of notes: a binary file has any number of unknown words, and the first few tell enough.
const MAX_NOTES: usize = 32;

/// What was met and is not kept: the text of the note, the first line and the number of times.
#[derive(Default)]
pub(super) struct Ignored(Vec<(String, usize, usize)>);

impl Ignored {
    pub fn add(&mut self, note: impl Into<String>, line: usize) {
        let note = note.into();
        if let Some(entry) = self.0.iter_mut().find(|entry| entry.0 == note) {
            entry.2 += 1;
        } else if self.0.len() < MAX_NOTES {
            self.0.push((note, line, 1));
        }
    }

    pub fn notes(self) -> impl Iterator<Item = String> {
        self.0.into_iter().map(|(note, line, times)| match times {
            1 => format!("line {line}: {note}"),
            _ => format!("line {line} and {} more: {note}", times - 1),
        })
    }
}
