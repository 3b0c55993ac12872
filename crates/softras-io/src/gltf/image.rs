//! Base colours of glTF files and their textures.

use super::{Piece, document::Document};
use crate::{
    source::Source,
    texture::{self, Decoded},
    textures::{Room, Textures},
};
use gltf_json::{self as json, material::AlphaMode, texture::WrappingMode, validation::Checked};
use image::ImageReader;
use softras::scene::{Texture, Wrap};
use std::io::Cursor;

/// What a material makes of the triangles: their base colour, and how their UVs are placed.
pub(super) struct Look {
    pub color: [f32; 3],
    /// The alpha of the base colour; 1 where the material is not blended.
    pub opacity: f32,
    /// The set of UVs of its texture, if it has one.
    pub uv_set: Option<u32>,
    offset: [f64; 2],
    /// Columns.
    matrix: [[f64; 2]; 2],
}

impl Look {
    /// A UV of the file as one that runs up.
    pub fn transformed(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        if self.offset == [0.0; 2] && self.matrix == [[1.0, 0.0], [0.0, 1.0]] {
            return [u, 1.0 - v];
        }
        let place = |k: usize| self.matrix[0][k] * f64::from(u) + self.matrix[1][k] * f64::from(v) + self.offset[k];
        [place(0) as f32, (1.0 - place(1)) as f32]
    }
}

/// What a material makes of its texture's alpha.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Cut {
    /// It is ignored.
    Opaque,
    /// 1 from a cutoff on, whose bits these are, and else 0.
    Mask(u32),
    /// It is taken as it is.
    Blend,
}

impl Cut {
    fn of(material: &json::Material) -> Self {
        match material.alpha_mode {
            Checked::Valid(AlphaMode::Blend) => Self::Blend,
            Checked::Valid(AlphaMode::Mask) => {
                let cutoff = material.alpha_cutoff.as_ref().map_or(0.5, |cutoff| cutoff.0);
                // The cutoff is of the product with the base colour's alpha.
                let factor = material.pbr_metallic_roughness.base_color_factor.0[3];
                Self::Mask((cutoff / factor.max(f32::MIN_POSITIVE)).to_bits())
            }
            _ => Self::Opaque,
        }
    }

    fn apply(self, alpha: Option<Vec<f32>>) -> Option<Vec<f32>> {
        match self {
            Self::Opaque => None,
            Self::Mask(cutoff) => {
                let cut = |a: f32| if a >= f32::from_bits(cutoff) { 1.0 } else { 0.0 };
                alpha.map(|alpha| alpha.into_iter().map(cut).collect())
            }
            Self::Blend => alpha,
        }
    }
}

/// The look of a material; white without one.
pub(super) fn look(root: &json::Root, material: Option<usize>) -> Result<Look, String> {
    let (offset, matrix) = ([0.0; 2], [[1.0, 0.0], [0.0, 1.0]]);
    let mut look = Look { color: [1.0; 3], opacity: 1.0, uv_set: None, offset, matrix };
    let Some(index) = material else { return Ok(look) };
    let count = root.materials.len();
    let material = root.materials.get(index).ok_or_else(|| format!("material {index} but there are {count}"))?;
    let pbr = &material.pbr_metallic_roughness;
    let [r, g, b, a] = pbr.base_color_factor.0;
    look.color = [r, g, b];
    if Cut::of(material) == Cut::Blend && a.is_finite() {
        look.opacity = a.clamp(0.0, 1.0);
    }
    let Some(info) = &pbr.base_color_texture else { return Ok(look) };
    look.uv_set = Some(info.tex_coord);
    if let Some(transform) = info.extensions.as_ref().and_then(|all| all.texture_transform.as_ref()) {
        let ([sx, sy], angle) = (transform.scale.0.map(f64::from), f64::from(transform.rotation.0));
        let (sin, cos) = angle.sin_cos();
        look.offset = transform.offset.0.map(f64::from);
        look.matrix = [[sx * cos, -sx * sin], [sy * sin, sy * cos]];
        look.uv_set = transform.tex_coord.or(look.uv_set);
    }
    Ok(look)
}

/// The textures of all pieces.
pub(super) struct Textured {
    pub images: Vec<Texture>,
    /// An index into `images`.
    pub of_piece: Vec<u32>,
}

/// What makes two textures the same: the image, how it repeats, what becomes of its alpha, and the bits of the colour that it is
/// multiplied with.
#[derive(PartialEq, Eq, Hash)]
struct Key(Option<(usize, Wrap, Cut)>, [u32; 3]);

/// The textures; pieces without one get a 1×1 image of their colour. `None` where no image can be read.
pub(super) fn textures(
    source: &mut Source,
    document: &mut Document,
    pieces: &[Piece],
) -> Result<Option<Textured>, String> {
    let root = document.root;
    let mut textures = Textures::new(source.room());
    let mut any_image = false;
    let mut of_piece = Vec::with_capacity(pieces.len());
    for piece in pieces {
        let material = piece.material.and_then(|index| root.materials.get(index)).filter(|_| piece.has_uvs);
        let info = material.and_then(|material| material.pbr_metallic_roughness.base_color_texture.as_ref());
        let tint = piece.color.map(|x| (x + 0.0).to_bits());
        let mut index = None;
        if let (Some(info), Some(material)) = (info, material) {
            let (image, wrap) = image_of(source, root, info.index.value())?;
            let cut = Cut::of(material);
            index = textures.find_or(Key(Some((image, wrap, cut)), tint), |room| {
                read(source, document, image, room)
                    .map(|decoded| Decoded { alpha: cut.apply(decoded.alpha), ..decoded })
                    .and_then(|decoded| tinted(decoded, piece.color, wrap))
                    .map_err(|what| source.notes.add(None, format!("texture {image}: {what}: not drawn")))
                    .ok()
            });
        }
        any_image |= index.is_some();
        let plain = |_| Texture::new(1, 1, vec![piece.color], Wrap::Repeat).ok();
        let index = index.or_else(|| textures.find_or(Key(None, tint), plain));
        of_piece.push(index.ok_or("a base colour that is not finite")?);
    }
    Ok(any_image.then_some(Textured { images: textures.images, of_piece }))
}

/// The image of a texture, and how it repeats.
fn image_of(source: &mut Source, root: &json::Root, index: usize) -> Result<(usize, Wrap), String> {
    let count = root.textures.len();
    let texture = root.textures.get(index).ok_or_else(|| format!("texture {index} but there are {count}"))?;
    let sampler = texture.sampler.and_then(|sampler| root.samplers.get(sampler.value()));
    let clamps = |mode: &Checked<WrappingMode>| matches!(mode, Checked::Valid(WrappingMode::ClampToEdge));
    let Some(sampler) = sampler else { return Ok((texture.source.value(), Wrap::Repeat)) };
    let modes = [&sampler.wrap_s, &sampler.wrap_t];
    let mirrors = |mode: &Checked<WrappingMode>| matches!(mode, Checked::Valid(WrappingMode::MirroredRepeat));
    if modes.into_iter().any(mirrors) || clamps(modes[0]) != clamps(modes[1]) {
        source.notes.once("textures repeat or end at their edges alike in both directions, and are not mirrored");
    }
    let wrap = if modes.into_iter().all(clamps) { Wrap::Clamp } else { Wrap::Repeat };
    Ok((texture.source.value(), wrap))
}

fn read(source: &mut Source, document: &mut Document, image: usize, room: Room) -> Result<Decoded, String> {
    let file = document.image(source, image)?;
    texture::decode(ImageReader::new(Cursor::new(file.bytes())), source.options.srgb, room)
}

/// The image times a colour.
fn tinted(mut decoded: Decoded, color: [f32; 3], wrap: Wrap) -> Result<Texture, String> {
    if color != [1.0; 3] {
        decoded.texels.iter_mut().for_each(|texel| *texel = [0, 1, 2].map(|k| texel[k] * color[k]));
    }
    decoded.texture(wrap).map_err(|error| error.to_string())
}
