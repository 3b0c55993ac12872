//! Materials of glTF files: base colours, emitted light, and their textures.

use super::{
    GltfWrong, Piece,
    document::Document,
    json::{self, Material, TextureInfo, Transform},
    lacks,
};
use crate::{
    color,
    paint::{Canvas, Edge, on_canvas},
    source::Source,
    texture::{self, Decoded},
    textures::{Room, Textures},
};
use serde::Deserialize;
use softras::scene::Texture;

/// Numbers of glTF's modes of wrapping and filtering.
const CLAMP: usize = 33071;
const MIRROR: usize = 33648;
const NEAREST: usize = 9728;

/// How triangles of a material look.
#[derive(Clone)]
pub(super) struct Look {
    pub color: [f32; 3],
    /// Emitted light.
    pub glow: [f32; 3],
    /// The alpha of the base colour.
    pub alpha: f32,
    pub cut: AlphaMode,
    pub is_unlit: bool,
    pub is_double_sided: bool,
    /// Its texture: that of the base colour, or else that of emitted light.
    pub map: Option<TextureMap>,
}

/// A texture and how UVs are placed in it.
#[derive(Clone)]
pub(super) struct TextureMap {
    info: TextureInfo,
    pub uv_set: usize,
    offset: [f64; 2],
    /// Columns.
    matrix: [[f64; 2]; 2],
    /// Texture of emitted light that is added, at the same UVs.
    glow: Option<usize>,
    /// Whether it is that of emitted light alone.
    is_glow: bool,
}

impl TextureMap {
    /// Whether both take the same UVs to the same places.
    fn is_at(&self, other: &Self) -> bool {
        (self.uv_set, self.offset, self.matrix) == (other.uv_set, other.offset, other.matrix)
    }

    fn of(info: &TextureInfo) -> Self {
        let transform = info.extensions.get("KHR_texture_transform");
        let transform = transform.and_then(|value| Transform::deserialize(value).ok()).unwrap_or_default();
        let ([sx, sy], (sin, cos)) = (transform.scale, transform.rotation.sin_cos());
        Self {
            info: info.clone(),
            uv_set: transform.tex_coord.unwrap_or(info.tex_coord).0,
            offset: transform.offset,
            matrix: [[sx * cos, -sx * sin], [sy * sin, sy * cos]],
            glow: None,
            is_glow: false,
        }
    }

    /// A UV of the file after the map's transform, with v running up.
    pub fn transformed(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        if self.offset == [0.0; 2] && self.matrix == [[1.0, 0.0], [0.0, 1.0]] {
            return [u, 1.0 - v];
        }
        let place = |k: usize| self.matrix[0][k] * f64::from(u) + self.matrix[1][k] * f64::from(v) + self.offset[k];
        [place(0) as f32, (1.0 - place(1)) as f32]
    }
}

/// The way in which a material uses alpha.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum AlphaMode {
    /// It is ignored.
    Opaque,
    /// It becomes 1 if it reaches a cutoff, whose bits these are, and else 0.
    Mask(u32),
    /// It is taken as it is.
    Blend,
}

impl AlphaMode {
    fn of(material: &Material) -> Self {
        match material.alpha_mode.as_str() {
            "BLEND" => Self::Blend,
            "MASK" => Self::Mask((material.alpha_cutoff.unwrap_or(0.5) as f32).to_bits()),
            _ => Self::Opaque,
        }
    }

    /// The alpha that is drawn for the product of the file's alphas.
    pub fn apply(self, alpha: f32) -> f32 {
        match self {
            Self::Opaque => 1.0,
            Self::Mask(cutoff) if alpha >= f32::from_bits(cutoff) => 1.0,
            Self::Mask(_) => 0.0,
            Self::Blend if alpha.is_finite() => alpha.clamp(0.0, 1.0),
            Self::Blend => 1.0,
        }
    }
}

/// The look of a material; white without one.
pub(super) fn look(source: &mut Source, root: &json::Root, index: Option<usize>) -> Result<Look, GltfWrong> {
    let white = Material::default();
    let all = &root.materials;
    let material = match index {
        Some(index) => all.get(index).ok_or_else(|| lacks("material", index, all.len()))?,
        None => &white,
    };
    let extension = |name: &str| material.extensions.get(name);
    let diffuse = extension("KHR_materials_pbrSpecularGlossiness").and_then(|value| json::Pbr::deserialize(value).ok());
    let pbr = diffuse.as_ref().unwrap_or(&material.pbr_metallic_roughness);
    let [r, g, b, mut alpha] = pbr.base_color_factor.unwrap_or([1.0; 4]).map(|x| x as f32);
    let mut base = [r, g, b];
    if color::are_bytes(base.into_iter()) {
        source.notes.count(None, "base colours up to 255 are divided by 255");
        (base, alpha) = (base.map(|x| x / 255.0), alpha / 255.0);
    }
    let is_unlit = extension("KHR_materials_unlit").is_some();
    let strength = extension("KHR_materials_emissive_strength").and_then(|value| value["emissiveStrength"].as_f64());
    let glow = material.emissive_factor.map(|x| (x * strength.unwrap_or(1.0)) as f32);
    let mut glow = if is_unlit { [0.0; 3] } else { glow };
    for (color, usual) in [(&mut base, [1.0; 3]), (&mut glow, [0.0; 3])] {
        if !color::is_color(color) {
            source.notes.count(None, "colours of materials that are out of range are not used");
            *color = usual;
        }
    }
    let mut map = pbr.base_color_texture.as_ref().map(TextureMap::of);
    if glow != [0.0; 3] {
        source.notes.count(None, "emitted light is drawn as a colour that is shaded: --unlit shows it as it is");
        let emitted = material.emissive_texture.as_ref().map(TextureMap::of);
        match (&mut map, emitted) {
            (_, None) => {}
            (None, Some(emitted)) => map = Some(TextureMap { is_glow: true, ..emitted }),
            (Some(map), Some(emitted)) if map.is_at(&emitted) => map.glow = Some(emitted.info.index.0),
            (Some(_), Some(_)) => {
                source
                    .notes
                    .count(None, "a texture of emitted light at other UVs than that of the base colour is not drawn");
                glow = [0.0; 3];
            }
        }
    }
    let is_double_sided = material.double_sided;
    Ok(Look { color: base, glow, alpha, cut: AlphaMode::of(material), is_unlit, is_double_sided, map })
}

/// A piece's texture, by its number, and the place of its UVs there.
pub(super) type PieceImage = Option<(u32, Canvas)>;

/// The key by which equal textures are found: their numbers, and the bits of alpha and of the colours that they are multiplied with.
#[derive(PartialEq, Eq, Hash)]
struct TextureKey([usize; 3], AlphaMode, Vec<u32>);

/// The textures of all pieces, each once; a piece whose image cannot be read has none.
pub(super) fn textures(
    source: &mut Source,
    document: &mut Document,
    pieces: &[Piece],
) -> Result<(Vec<Texture>, Vec<PieceImage>), GltfWrong> {
    let mut textures = Textures::new(source.room());
    let mut canvases: Vec<Canvas> = Vec::new();
    let mut of_piece = Vec::with_capacity(pieces.len());
    for Piece { look, tint, uv_range, .. } in pieces {
        let (Some(map), Some(range)) = (&look.map, uv_range) else {
            of_piece.push(None);
            continue;
        };
        let (number, edges) = placed(source, document, map)?;
        let color = [0, 1, 2].map(|k| look.color[k] * tint[k]);
        // Where the image is clamped along one axis and repeats along the other, the texels depend on the range of the UVs.
        let reach = if edges[0] == edges[1] { &[][..] } else { range.as_flattened() };
        let bits =
            color.iter().chain(&look.glow).chain([&look.alpha]).chain(reach).map(|x| (x + 0.0).to_bits()).collect();
        let key = TextureKey([number, map.glow.map_or(0, |glow| glow + 1), map.is_glow.into()], look.cut, bits);
        let index = textures.find_or(key, |room| {
            let read = painted(source, document, map, number, look, color, room).and_then(|decoded| {
                let (texture, canvas) = on_canvas(decoded, edges, *range, &mut source.notes)?;
                canvases.push(canvas);
                Ok(texture)
            });
            read.map_err(|what| source.notes.add(None, format!("texture {number}: {what}: not drawn"))).ok()
        });
        of_piece.push(index.map(|index| (index, canvases[index as usize])));
    }
    Ok((textures.images, of_piece))
}

/// The number of a map's texture, and its wrap modes along u and v.
fn placed(source: &mut Source, document: &Document, map: &TextureMap) -> Result<(usize, [Edge; 2]), GltfWrong> {
    let root = document.root;
    let index = map.info.index.0;
    let texture = root.textures.get(index).ok_or_else(|| lacks("texture", index, root.textures.len()))?;
    let sampler = texture.sampler.and_then(|sampler| root.samplers.get(sampler.0));
    let mode = |mode: Option<json::Whole>| match mode.map(|mode| mode.0) {
        Some(CLAMP) => Edge::Clamp,
        Some(MIRROR) => Edge::Mirror,
        _ => Edge::Repeat,
    };
    if sampler.is_some_and(|sampler| sampler.mag_filter == Some(json::Whole(NEAREST))) {
        source.notes.count(None, "textures are drawn smoothly, not by the nearest texel");
    }
    let edges = sampler.map_or([Edge::Repeat; 2], |sampler| [mode(sampler.wrap_s), mode(sampler.wrap_t)]);
    Ok((index, edges))
}

/// The texture of a map times its colours, with the alpha that shows.
fn painted(
    source: &mut Source,
    document: &mut Document,
    map: &TextureMap,
    number: usize,
    look: &Look,
    color: [f32; 3],
    room: Room,
) -> Result<Decoded, String> {
    let mut decoded = read(source, document, number, room)?;
    let glow = map.glow.map(|glow| read(source, document, glow, room)).transpose()?;
    let (width, height) = (decoded.width as usize, decoded.height as usize);
    let (times, plus) = if map.is_glow { (look.glow, color) } else { (color, look.glow) };
    let plain = times == [1.0; 3] && plus == [0.0; 3];
    for (i, texel) in decoded.texels.iter_mut().enumerate().filter(|_| !plain) {
        let emitted = glow.as_ref().map_or([1.0; 3], |glow| {
            let (row, column) = (i / width * glow.height as usize / height, i % width * glow.width as usize / width);
            glow.texels[row * glow.width as usize + column]
        });
        *texel = [0, 1, 2].map(|k| texel[k] * times[k] + plus[k] * emitted[k]);
    }
    decoded.alpha = match (look.cut, decoded.alpha.filter(|_| !map.is_glow)) {
        (AlphaMode::Opaque, _) | (_, None) => None,
        // The material's own alpha is in the opacity of its triangles.
        (AlphaMode::Blend, alpha) => alpha,
        (cut, Some(alpha)) => Some(alpha.into_iter().map(|a| cut.apply(a * look.alpha)).collect()),
    };
    Ok(decoded)
}

fn read(source: &mut Source, document: &mut Document, index: usize, room: Room) -> Result<Decoded, String> {
    let root = document.root;
    let said = |(what, fix): GltfWrong| format!("{what} ({fix})");
    let texture = root.textures.get(index).ok_or_else(|| format!("there are {} textures", root.textures.len()))?;
    let webp = texture.extensions.get("EXT_texture_webp").and_then(|value| value["source"].as_u64());
    let image = match (texture.source, webp) {
        (Some(image), _) => image.0,
        (None, Some(image)) => image as usize,
        (None, None) => {
            let basis = texture.extensions.get("KHR_texture_basisu").and_then(|value| value["source"].as_u64());
            let file = document.image(source, basis.ok_or("it names no image that is read")? as usize).map_err(said)?;
            return texture::decode_basis(file.bytes(), source.options.srgb, room);
        }
    };
    let file = document.image(source, image).map_err(said)?;
    texture::decode_bytes(file.bytes(), source.options.srgb, room)
}
