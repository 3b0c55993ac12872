//! The parts of a glTF file and the buffers that it names.

use super::json;
use crate::{find::find, source::Source};
use base64::{Engine, engine::general_purpose::STANDARD};
use percent_encoding::percent_decode_str;
use std::{borrow::Cow, collections::HashMap, path::PathBuf, rc::Rc};

/// The JSON and the binary chunk of a file; a file of text is all JSON.
pub(super) fn split(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), String> {
    let Some(rest) = bytes.strip_prefix(b"glTF") else {
        return Ok((bytes.strip_prefix(&[0xef, 0xbb, 0xbf]).unwrap_or(bytes), None));
    };
    let number = |at: usize| rest.get(at..at + 4).map(|n| u32::from_le_bytes([n[0], n[1], n[2], n[3]]));
    match number(0) {
        Some(2) => {}
        Some(version) => return Err(format!("binary glTF of version {version}; version 2 is read")),
        None => return Err("cut off in its header".into()),
    }
    let chunk = |start: usize, kind: &[u8; 4]| -> Result<Option<(&[u8], usize)>, String> {
        let (Some(length), Some(found)) = (number(start), rest.get(start + 4..start + 8)) else { return Ok(None) };
        if found != kind {
            return Ok(None);
        }
        let end = (start + 8).checked_add(length as usize).ok_or("a chunk without end")?;
        let content = rest.get(start + 8..end).ok_or(format!("cut off: a chunk claims {length} bytes"))?;
        Ok(Some((content, end)))
    };
    let Some((text, end)) = chunk(8, b"JSON")? else { return Err("binary glTF without JSON".into()) };
    Ok((text, chunk(end, b"BIN\0")?.map(|(content, _)| content)))
}

/// The JSON with its buffers, which are read when they are first used.
pub(super) struct Document<'a> {
    pub root: &'a json::Root<'a>,
    binary: Option<&'a [u8]>,
    buffers: HashMap<usize, Rc<Cow<'a, [u8]>>>,
    files: HashMap<PathBuf, Rc<Cow<'a, [u8]>>>,
    /// The unpacked bytes of accessors; those of views are in `views`.
    pub unpacked: HashMap<usize, Vec<u8>>,
    views: HashMap<usize, Rc<Cow<'a, [u8]>>>,
    /// The bytes of all buffers and files that were read or unpacked.
    pub held: usize,
}

impl<'a> Document<'a> {
    pub fn new(root: &'a json::Root<'a>, binary: Option<&'a [u8]>) -> Self {
        let held = binary.map_or(0, <[u8]>::len);
        let (buffers, files, unpacked, views) = Default::default();
        Self { root, binary, buffers, files, unpacked, views, held }
    }

    pub fn buffer(&mut self, source: &mut Source, index: usize) -> Result<Rc<Cow<'a, [u8]>>, String> {
        if let Some(known) = self.buffers.get(&index) {
            return Ok(known.clone());
        }
        let count = self.root.buffers.len();
        let buffer = self.root.buffers.get(index).ok_or_else(|| format!("buffer {index} but there are {count}"))?;
        let bytes = match buffer.uri.as_deref() {
            None => Rc::new(Cow::Borrowed(self.binary.ok_or("a buffer without content")?)),
            Some(uri) => match embedded(uri) {
                Some(bytes) => {
                    let bytes = bytes?;
                    self.held += bytes.len();
                    Rc::new(Cow::Owned(bytes))
                }
                None => self.file(source, uri)?,
            },
        };
        self.buffers.insert(index, bytes.clone());
        Ok(bytes)
    }

    /// A file that buffers or images name, read once.
    fn file(&mut self, source: &mut Source, uri: &str) -> Result<Rc<Cow<'a, [u8]>>, String> {
        let name = percent_decode_str(uri).decode_utf8_lossy();
        let (path, note) = find(source.path, source.path, &name, source.options.allow_outside)?;
        if let Some(note) = note {
            source.notes.add(None, note);
        }
        if let Some(known) = self.files.get(&path) {
            return Ok(known.clone());
        }
        let bytes: Rc<Cow<[u8]>> = Rc::new(Cow::Owned(source.read_bytes(&path).map_err(|error| error.to_string())?));
        self.held += bytes.len();
        source.files.push(path.clone());
        self.files.insert(path, bytes.clone());
        Ok(bytes)
    }

    /// The content of a part of a buffer, and its stride, 0 where there is none.
    pub fn view(&mut self, source: &mut Source, index: usize) -> Result<(View<'a>, usize), String> {
        let count = self.root.buffer_views.len();
        let view = self.root.buffer_views.get(index).ok_or_else(|| format!("view {index} but there are {count}"))?;
        if let Some(buffer) = self.views.get(&index).cloned() {
            let end = buffer.len();
            return Ok((View { buffer, start: 0, end }, view.byte_stride.0));
        }
        #[cfg(feature = "packed")]
        if let Some(packed) = view.extensions.get("EXT_meshopt_compression") {
            let bytes = self.unpacked_view(source, packed).map_err(|what| format!("view {index}: meshopt: {what}"))?;
            self.views.insert(index, Rc::new(Cow::Owned(bytes)));
            return self.view(source, index);
        }
        let buffer = self.buffer(source, view.buffer.0)?;
        let start = view.byte_offset.0;
        let end = start.saturating_add(view.byte_length.0);
        if end > buffer.len() {
            return Err(format!("view {index} ends at byte {end} of a buffer of {}", buffer.len()));
        }
        Ok((View { buffer, start, end }, view.byte_stride.0))
    }

    /// The bytes of an image file.
    pub fn image(&mut self, source: &mut Source, index: usize) -> Result<View<'a>, String> {
        let count = self.root.images.len();
        let image = self.root.images.get(index).ok_or_else(|| format!("image {index} but there are {count}"))?;
        let buffer = match (image.buffer_view, image.uri.as_deref()) {
            (Some(view), _) => return Ok(self.view(source, view.0)?.0),
            (None, Some(uri)) => match embedded(uri) {
                Some(bytes) => Rc::new(Cow::Owned(bytes?)),
                None => self.file(source, uri)?,
            },
            (None, None) => return Err(format!("image {index} without content")),
        };
        let end = buffer.len();
        Ok(View { buffer, start: 0, end })
    }
}

/// How a compressed file becomes one that softras reads.
pub(super) const UNPACK: &str = "unpack it: npx @gltf-transform/cli cp IN.glb OUT.glb";

/// A part of a buffer.
pub(super) struct View<'a> {
    buffer: Rc<Cow<'a, [u8]>>,
    start: usize,
    end: usize,
}

impl View<'_> {
    pub fn bytes(&self) -> &[u8] {
        &self.buffer[self.start..self.end]
    }
}

/// The bytes of a `data:` address; `None` for the name of a file.
fn embedded(uri: &str) -> Option<Result<Vec<u8>, String>> {
    let rest = uri.strip_prefix("data:")?;
    let Some((_, text)) = rest.split_once(";base64,") else { return Some(Err("data that is not base64".into())) };
    Some(STANDARD.decode(text).map_err(|error| format!("malformed base64: {error}")))
}
