//! The images of a mesh, each once.

use crate::picture_file::BYTES_PER_PIXEL;
use softras::scene::Texture;
use std::{
    collections::{HashMap, hash_map::Entry},
    hash::Hash,
};

/// The most texels of all images of a mesh, 1.5 GiB.
const MAX_TEXELS: u64 = 1 << 27;
/// Texels that images may have whatever the size of their files, 5792² in all, and those that each byte of a file adds: a
/// picture of a few kilobytes may claim, and even hold, a hundred million pixels of one colour.
const FREE_TEXELS: u64 = 1 << 25;
const TEXELS_PER_BYTE: u64 = 16;

/// How many texels the next image of a mesh may have.
#[derive(Clone, Copy)]
pub struct Room {
    /// The most texels of all images.
    most: u64,
    /// Texels of the images before it.
    taken: u64,
    is_asked: bool,
}

impl Room {
    /// The room for the first or only image, where all of them may take `memory` bytes.
    /// If the user asked for that number, the sizes of files do not matter.
    pub fn within(memory: u64, is_asked: bool) -> Self {
        Self { most: MAX_TEXELS.min(memory / BYTES_PER_PIXEL), taken: 0, is_asked }
    }

    /// Counts the texels of an image.
    pub fn take(&mut self, texels: usize) {
        self.taken += texels as u64;
    }

    /// The most texels of an image whose file has `bytes` bytes.
    pub fn texels(self, bytes: u64) -> u64 {
        let by_size = FREE_TEXELS.saturating_sub(self.taken).saturating_add(bytes.saturating_mul(TEXELS_PER_BYTE));
        let left = self.most.saturating_sub(self.taken);
        if self.is_asked { left } else { by_size.min(left) }
    }
}

/// Each image once, in order of first use.
pub struct Textures<K> {
    pub images: Vec<Texture>,
    /// The index of each image; `None` for one that cannot be read.
    by_key: HashMap<K, Option<u32>>,
    room: Room,
}

impl<K: Eq + Hash> Textures<K> {
    pub fn new(room: Room) -> Self {
        Self { images: Vec::new(), by_key: HashMap::new(), room }
    }

    /// Some images that are found by no key.
    pub fn having(images: Vec<Texture>) -> Self {
        Self { images, ..Self::new(Room::within(u64::MAX, false)) }
    }

    /// The index of an image. `make` makes a new one, with at most the texels of the [`Room`] that it gets.
    pub fn find_or(&mut self, key: K, make: impl FnOnce(Room) -> Option<Texture>) -> Option<u32> {
        match self.by_key.entry(key) {
            Entry::Occupied(known) => *known.get(),
            Entry::Vacant(unknown) => {
                let image = make(self.room);
                let index = image.map(|image| {
                    self.room.taken += image.texels().len() as u64;
                    self.images.push(image);
                    self.images.len() as u32 - 1
                });
                *unknown.insert(index)
            }
        }
    }
}
