//! The images of a mesh, each once.

use crate::scene::Texture;
use std::{
    collections::{HashMap, hash_map::Entry},
    hash::Hash,
};

/// The most texels of all images of a mesh, 1.5 GiB: an image of a few kilobytes may claim more than that.
pub(crate) const MAX_TEXELS: u64 = 1 << 27;

/// Each image once, in order of first use.
pub(crate) struct Textures<K> {
    pub images: Vec<Texture>,
    /// The index of each image; `None` for one that cannot be read.
    by_key: HashMap<K, Option<u32>>,
    /// The texels of all images.
    texels: u64,
}

impl<K: Eq + Hash> Textures<K> {
    pub fn new() -> Self {
        Self { images: Vec::new(), by_key: HashMap::new(), texels: 0 }
    }

    /// The index of an image; a new one is made, with at most so many texels as are given to `make`.
    pub fn find_or(&mut self, key: K, make: impl FnOnce(u64) -> Option<Texture>) -> Option<u32> {
        match self.by_key.entry(key) {
            Entry::Occupied(known) => *known.get(),
            Entry::Vacant(unknown) => {
                let image = make(MAX_TEXELS.saturating_sub(self.texels));
                let index = image.map(|image| {
                    self.texels += image.texels().len() as u64;
                    self.images.push(image);
                    self.images.len() as u32 - 1
                });
                *unknown.insert(index)
            }
        }
    }
}
