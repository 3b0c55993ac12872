//! Updates of the tables from a scene with the same layout, which report the tables that differ.

use super::{MeshTables, feature_texels, kind_of, opaque, rgba};
use crate::frame::buffers::BufferId;
use crate::scene::{Appearance, Scene};

/// A set of a frame's inputs: those whose bytes differ from the last frame's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[must_use]
pub struct InputChanges(u64);

const _: () = assert!(BufferId::ALL.len() <= u64::BITS as usize, "one bit for each buffer");

impl InputChanges {
    /// Every input.
    #[cfg(any(test, feature = "renderer"))]
    pub(crate) const ALL: Self = Self(u64::MAX);

    /// Whether no input differs.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The inputs of either set: of two changes, one after the other.
    pub fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether an input is in the set.
    pub(crate) fn has(self, id: BufferId) -> bool {
        self.0 & Self::bit(id) != 0
    }

    /// Adds an input if `differs`.
    pub(crate) fn note(&mut self, id: BufferId, differs: bool) {
        self.0 |= if differs { Self::bit(id) } else { 0 };
    }

    /// The inputs that are not in the other set.
    #[cfg(feature = "renderer")]
    pub(crate) fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    fn bit(id: BufferId) -> u64 {
        1 << id as u32
    }
}

/// Copies `from` to `to`, and returns whether any bit differed.
pub(crate) fn overwrite<T: bytemuck::NoUninit>(to: &mut [T], from: &[T]) -> bool {
    let differs = bytemuck::cast_slice::<T, u8>(to) != bytemuck::cast_slice::<T, u8>(from);
    if differs {
        to.copy_from_slice(from);
    }
    differs
}

fn overwrite_texels(to: &mut [[f32; 4]], from: impl Iterator<Item = [f32; 4]>) -> bool {
    let mut differs = false;
    for (to, from) in to.iter_mut().zip(from) {
        differs |= to.map(f32::to_bits) != from.map(f32::to_bits);
        *to = from;
    }
    differs
}

impl MeshTables {
    /// Whether a scene whose meshes have the same shapes as those laid out has the same triangles as well.
    pub(crate) fn has_triangles_of(&self, scene: &Scene) -> bool {
        let mut rest = &self.indices[..];
        scene.meshes.iter().all(|mesh| {
            let triangles = mesh.triangles().as_flattened();
            let (own, others) = rest.split_at(triangles.len());
            rest = others;
            own == triangles
        })
    }

    /// Takes over the values of a scene whose meshes have the same shapes and triangles as those laid out, and returns the tables
    /// that differed.
    pub(crate) fn update(&mut self, scene: &Scene) -> InputChanges {
        let mut changes = InputChanges::default();
        let (mut image, mut feature) = (0, 0);
        for (m, mesh) in scene.meshes.iter().enumerate() {
            let layout = self.layouts[m];
            let vertices = layout.vertex_range();
            let positions = &mut self.positions[3 * vertices.start..3 * vertices.end];
            changes.note(BufferId::Positions, overwrite(positions, mesh.positions().as_flattened()));
            let normals = mesh.normals().as_flattened();
            let own = if normals.is_empty() { 0..0 } else { 3 * vertices.start..3 * vertices.end };
            changes.note(BufferId::VertexNormals, overwrite(&mut self.normals[own], normals));
            let features = &mut self.features[feature..];
            changes.note(BufferId::Features, overwrite_texels(features, feature_texels(mesh)));
            feature += layout.vertices as usize * mesh.feature_channels().div_ceil(4) as usize;
            let colors = match mesh.appearance() {
                Appearance::Uniform(color) => &color[..],
                Appearance::VertexColors(colors) => colors.as_flattened(),
                _ => &[],
            };
            let first = layout.color as usize;
            changes.note(BufferId::Colors, overwrite(&mut self.colors[first..first + colors.len()], colors));
            changes = changes.or(self.update_texture(mesh.appearance(), m, &mut image));
        }
        changes
    }

    /// Takes over a mesh's texture and returns the tables that differed. `image` counts the images of all meshes so far.
    fn update_texture(&mut self, appearance: &Appearance, mesh: usize, image: &mut usize) -> InputChanges {
        let mut changes = InputChanges::default();
        let layout = self.layouts[mesh];
        let ranges = layout.texel_ranges(&self.shapes[mesh]);
        match appearance {
            Appearance::Uniform(_) | Appearance::VertexColors(_) => {}
            Appearance::Surface { texels, .. } => {
                for range in ranges {
                    changes.note(BufferId::Texels, overwrite_texels(&mut self.texels[range], opaque(texels)));
                }
            }
            Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle } => {
                let (at, uvs) = (layout.uv as usize, uvs.as_flattened());
                changes.note(BufferId::Uvs, overwrite(&mut self.uvs[at..at + uvs.len()], uvs));
                let (at, indices) = (layout.uv_index as usize, uv_triangles.as_flattened());
                changes.note(BufferId::UvIndices, overwrite(&mut self.uv_indices[at..at + indices.len()], indices));
                let first = layout.first_texture;
                let at = if texture_of_triangle.is_empty() { 0 } else { layout.texture as usize };
                for (name, texture) in self.triangle_textures[at..].iter_mut().zip(texture_of_triangle) {
                    changes.note(BufferId::TriangleTextures, *name != first + texture);
                    *name = first + texture;
                }
                let entries = &mut self.textures[first as usize..];
                for ((texture, range), entry) in textures.iter().zip(ranges).zip(entries) {
                    changes.note(BufferId::Textures, entry[3] != kind_of(texture));
                    entry[3] = kind_of(texture);
                    let known = &mut self.images[*image];
                    if !known.shares_texels(texture) {
                        changes.note(BufferId::Texels, overwrite_texels(&mut self.texels[range], rgba(texture)));
                        *known = texture.clone();
                    }
                    *image += 1;
                }
            }
        }
        changes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_a_set_of_buffers() {
        use BufferId::{Indices, Positions};
        let mut changes = InputChanges::default();
        changes.note(Positions, false);
        assert!(changes.is_empty());
        changes.note(Positions, true);
        assert!(changes.has(Positions) && !changes.has(Indices));
        assert!(BufferId::ALL.into_iter().all(|id| InputChanges::ALL.has(id)));
        assert_eq!(InputChanges::ALL.without(changes).or(changes), InputChanges::ALL);
    }

    #[test]
    fn zeros_of_either_sign_differ() {
        let mut values = [0.0f32, 1.0];
        assert!(!overwrite(&mut values, &[0.0, 1.0]));
        assert!(overwrite(&mut values, &[-0.0, 1.0]));
        assert!(overwrite_texels(&mut [[0.0; 4]], [[0.0, -0.0, 0.0, 0.0]].into_iter()));
        assert!(!overwrite_texels(&mut [[0.0; 4]], [[0.0; 4]].into_iter()));
    }
}
