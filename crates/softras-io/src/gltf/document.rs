//! The parts of a glTF file and the buffers that it names.

use super::{AGAIN, CONVERT, GltfWrong, json, lacks, of_error};
use crate::{find::find, source::Source, text, within};
use base64::{
    Engine,
    alphabet::STANDARD,
    engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig},
};
use percent_encoding::percent_decode_str;
use std::{borrow::Cow, collections::HashMap, path::PathBuf, rc::Rc};

/// The JSON and the binary chunk of a file; a file of text is all JSON. Chunks of other kinds are passed over, and the last one may
/// lack its padding.
pub(super) fn split(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), GltfWrong> {
    let Some(rest) = bytes.strip_prefix(b"glTF") else { return Ok((text::unmarked(bytes), None)) };
    let number = |at: usize| rest.get(at..at + 4).map(|n| u32::from_le_bytes([n[0], n[1], n[2], n[3]]));
    match number(0) {
        Some(2) => {}
        Some(version) => return Err((format!("binary glTF of version {version}; version 2 is read"), CONVERT.into())),
        None => return Err(("cut off in its header".into(), AGAIN.into())),
    }
    let (mut json, mut binary, mut at) = (None, None, 8);
    while let (Some(length), Some(kind)) = (number(at), rest.get(at + 4..at + 8)) {
        let (start, end) = (at + 8, (at + 8).saturating_add(length as usize));
        let place = match kind {
            b"JSON" => &mut json,
            b"BIN\0" => &mut binary,
            _ if end > rest.len() => break,
            _ => &mut None,
        };
        if end > rest.len() + 3 {
            return Err((format!("cut off: a chunk claims {length} bytes"), AGAIN.into()));
        }
        place.get_or_insert(&rest[start..end.min(rest.len())]);
        // Some programs do not count the padding.
        at = if rest.get(end + 4..end + 8) == Some(b"BIN\0") { end } else { end.next_multiple_of(4) };
    }
    let json = json.ok_or_else(|| ("binary glTF without JSON".into(), AGAIN.into()))?;
    Ok((text::unmarked(json), binary))
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

    pub fn buffer(&mut self, source: &mut Source, index: usize) -> Result<Rc<Cow<'a, [u8]>>, GltfWrong> {
        if let Some(known) = self.buffers.get(&index) {
            return Ok(known.clone());
        }
        let all = &self.root.buffers;
        let buffer = all.get(index).ok_or_else(|| lacks("buffer", index, all.len()))?;
        let empty = || ("a buffer without content".into(), "give it a uri, or the file a BIN chunk".into());
        let bytes = match buffer.uri.as_deref() {
            None => Rc::new(Cow::Borrowed(self.binary.ok_or_else(empty)?)),
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
    fn file(&mut self, source: &mut Source, uri: &str) -> Result<Rc<Cow<'a, [u8]>>, GltfWrong> {
        let bytes: Vec<u8> = percent_decode_str(uri).collect();
        let beside = |what| (what, "copy it beside the file, or export a .glb, which holds all".into());
        let found = find(source.path, source.path, &text::decoded(&bytes), source.options.allow_outside);
        let (path, note) = found.map_err(beside)?;
        if let Some(note) = note {
            source.notes.add(None, note);
        }
        if let Some(known) = self.files.get(&path) {
            return Ok(known.clone());
        }
        let bytes: Rc<Cow<[u8]>> = Rc::new(Cow::Owned(source.read_bytes(&path).map_err(of_error)?));
        self.held += bytes.len();
        source.files.push(path.clone());
        self.files.insert(path, bytes.clone());
        Ok(bytes)
    }

    /// The bytes of buffer view `index`, and its stride: 0 where the file gives none.
    pub fn view(&mut self, source: &mut Source, index: usize) -> Result<(View<'a>, usize), GltfWrong> {
        let all = &self.root.buffer_views;
        let view = all.get(index).ok_or_else(|| lacks("view", index, all.len()))?;
        if let Some(buffer) = self.views.get(&index).cloned() {
            let end = buffer.len();
            return Ok((View { buffer, start: 0, end }, view.byte_stride.0));
        }
        #[cfg(feature = "packed")]
        if let Some(packed) = view.extensions.get("EXT_meshopt_compression") {
            let bytes = self.unpacked_view(source, packed).map_err(within(format!("view {index}: meshopt")))?;
            self.views.insert(index, Rc::new(Cow::Owned(bytes)));
            return self.view(source, index);
        }
        let buffer = self.buffer(source, view.buffer.0)?;
        let start = view.byte_offset.0;
        let end = start.saturating_add(view.byte_length.0);
        if end > buffer.len() {
            return Err((format!("view {index} ends at byte {end} of a buffer of {}", buffer.len()), AGAIN.into()));
        }
        Ok((View { buffer, start, end }, view.byte_stride.0))
    }

    /// The bytes of an image file.
    pub fn image(&mut self, source: &mut Source, index: usize) -> Result<View<'a>, GltfWrong> {
        let all = &self.root.images;
        let image = all.get(index).ok_or_else(|| lacks("image", index, all.len()))?;
        let buffer = match (image.buffer_view, image.uri.as_deref()) {
            (Some(view), _) => return Ok(self.view(source, view.0)?.0),
            (None, Some(uri)) => match embedded(uri) {
                Some(bytes) => Rc::new(Cow::Owned(bytes?)),
                None => self.file(source, uri)?,
            },
            (None, None) => return Err((format!("image {index} without content"), "give it a uri".into())),
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

/// The bytes of a `data:` address, in base64 with or without padding and line ends, or percent-encoded; `None` for the name of a file.
fn embedded(uri: &str) -> Option<Result<Vec<u8>, GltfWrong>> {
    let config = GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
    let config = config.with_decode_allow_trailing_bits(true);
    let (kind, data) = uri.strip_prefix("data:")?.split_once(',').unwrap_or_default();
    let bytes: Vec<u8> = percent_decode_str(data).collect();
    if !kind.ends_with(";base64") {
        return Some(Ok(bytes));
    }
    let letters: Vec<u8> = bytes.into_iter().filter(|byte| !byte.is_ascii_whitespace()).collect();
    let wrong = |error| (format!("malformed base64: {error}"), AGAIN.into());
    Some(GeneralPurpose::new(&STANDARD, config).decode(letters).map_err(wrong))
}
