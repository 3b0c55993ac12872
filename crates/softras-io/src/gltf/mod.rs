//! Reads glTF files, as text and binary.

mod accessor;
mod document;
#[cfg(feature = "packed")]
mod draco;
mod image;
mod json;
#[cfg(feature = "packed")]
mod meshopt;
mod properties;
mod scene;
mod write;

#[cfg(test)]
pub use properties::{PROPERTIES, note_all};
pub use write::glb;

use crate::{
    fault,
    obj::{FAR_UVS, FARTHEST_UV},
    paint::{self, Patch, Sheet},
    polygon,
    source::Source,
    text,
    textures::Textures,
    weld::Weld,
};
use document::Document;
use glam::{DMat3, DMat4, DVec3};
use image::Look;
use scene::Placed;
use serde::Deserialize;
use serde_json::Value;
use softras::{
    Result,
    scene::{Appearance, Mesh, Texture, Wrap},
};
use std::{borrow::Cow, collections::BTreeSet};

/// The most vertices, and the most triangles, where a file draws its meshes several times; without that, the bytes of its
/// buffers are the limit.
const MAX_DRAWN: usize = 1 << 22;
/// The numbers of the modes that draw triangles.
const TRIANGLES: usize = 4;
const STRIP: usize = 5;
const FAN: usize = 6;

/// A fault in a part of the file, and its remedy.
type GltfWrong = crate::Wrong<Cow<'static, str>>;

const AGAIN: &str = "copy or download the file again, with those that it names";
const CONVERT: &str = "convert it: npx gltf-pipeline -i IN.gltf -o OUT.glb";

/// An index of the file that leads nowhere.
fn lacks(what: &str, index: usize, count: usize) -> GltfWrong {
    let fix = "the file contradicts itself: export it again (github.khronos.org/glTF-Validator shows where)";
    (format!("{what} {index} but there are {count}"), fix.into())
}

/// The fault and the remedy that an error tells of a file that this one names.
fn of_error(error: softras::Error) -> GltfWrong {
    match error {
        softras::Error::File { path, what, fix, .. } => (format!("{}: {what}", path.display()), fix.into()),
        other => (other.to_string(), AGAIN.into()),
    }
}

/// The JSON of a file. Where a program wrote numbers that JSON does not have, they are 0, with a note.
fn parsed(source: &mut Source, text: &str) -> Result<Value> {
    let error = match serde_json::from_str(text) {
        Ok(value) => return Ok(value),
        Err(error) => error,
    };
    let mut is_string = false;
    let parts = text.split_inclusive('"').map(|part| {
        let body = part.strip_suffix('"').unwrap_or(part);
        let is_escaped = body.bytes().rev().take_while(|byte| *byte == b'\\').count() % 2 == 1;
        let was_string = is_string;
        is_string = !was_string || is_escaped;
        let mended = || part.replace("-Infinity", "0").replace("Infinity", "0").replace("NaN", "0");
        if was_string { part.into() } else { mended() }
    });
    let mended: String = parts.collect();
    let value = serde_json::from_str(&mended).map_err(|_| {
        let fix = "correct the JSON there, or export the file again";
        fault(source.path, format!("malformed glTF: {error}"), fix)
    })?;
    source.notes.add(None, "numbers that are not finite are taken as 0");
    Ok(value)
}

/// The version that a file says, as text or as a number. Version 1.0 has objects in place of lists, whatever the file says.
fn version(value: &Value) -> String {
    let said = &value["asset"]["version"];
    if ["meshes", "nodes", "scenes"].iter().any(|name| value[name].is_object()) {
        return "1.0".into();
    }
    said.as_f64().map_or(said.as_str().unwrap_or("2.0").into(), |number| format!("{number:.1}"))
}

pub(super) fn read(source: &mut Source, bytes: &[u8]) -> Result<Mesh> {
    let path = source.path;
    let wrong = |(what, fix): GltfWrong| fault(path, what, fix);
    let (text, binary) = document::split(bytes).map_err(wrong)?;
    let value = parsed(source, &text::decoded(text::unpadded(text)))?;
    let version = version(&value);
    if !version.starts_with("2.") {
        return Err(fault(path, format!("glTF of version {version:.20}; version 2.0 is read"), CONVERT));
    }
    let root = json::Root::deserialize(&value).map_err(|error| {
        fault(
            path,
            format!("malformed glTF: {error}"),
            "give the property the type that glTF 2.0 says, or export again",
        )
    })?;
    if let Some(name) = root.extensions_required.iter().find(|name| !properties::is_readable(name)) {
        let what = format!("it needs the extension {name}, which softras does not read");
        let is_packed = name.ends_with("compression");
        return Err(fault(path, what, if is_packed { document::UNPACK } else { "export the file without it" }));
    }
    properties::note_all(source, &value);
    let mut soup = Soup::default();
    let mut document = Document::new(&root, binary);
    scene::add_scene(&mut soup, source, &mut document).map_err(wrong)?;
    let (textures, of_piece) = image::textures(source, &mut document, &soup.pieces).map_err(wrong)?;
    soup.note_looks(source, &root);
    (source.opacity, source.single_sided, source.y_is_up) = (soup.opacity(), soup.single_sided(), true);
    soup.mesh(source, textures, &of_piece)
}

/// The triangles of one primitive at one node.
struct Piece {
    material: Option<usize>,
    look: Look,
    /// The colour of all its vertices, white where they differ.
    tint: [f32; 3],
    /// Whether its vertices differ in colour.
    varies: bool,
    /// The least and greatest UVs, if it has any.
    uv_range: Option<[[f32; 2]; 2]>,
    /// The ends of its vertices and triangles in [`Soup`].
    vertices: usize,
    end: usize,
}

impl Piece {
    /// Its colour without a texture, where a vertex has a colour.
    fn color(&self, of_vertex: [f32; 3]) -> [f32; 3] {
        [0, 1, 2].map(|k| self.look.color[k] * of_vertex[k] + self.look.glow[k])
    }
}

/// All triangles of the scene, with vertices as the file has them.
#[derive(Default)]
struct Soup {
    positions: Vec<[f64; 3]>,
    /// Vertex colours with alpha.
    colors: Vec<[f32; 4]>,
    uvs: Vec<[f32; 2]>,
    /// One for each vertex up to the last that has one; 0 for vertices without.
    normals: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    pieces: Vec<Piece>,
    has_vertex_colors: bool,
}

impl Soup {
    /// Adds a primitive, its vertices moved to their place.
    fn add(
        &mut self,
        source: &mut Source,
        document: &mut Document,
        primitive: &json::Primitive,
        weights: &[f64],
        placed: &Placed,
    ) -> Result<(), GltfWrong> {
        let mode = primitive.mode.map_or(TRIANGLES, |mode| mode.0);
        if mode < TRIANGLES {
            source.notes.count(None, "lines and points are not drawn");
            return Ok(());
        }
        if mode > FAN {
            return Err((format!("mode {mode}"), "use the modes 0 to 6".into()));
        }
        let Some(position) = primitive.attribute("POSITION") else {
            source.notes.count(None, "a primitive without positions is not drawn");
            return Ok(());
        };
        let is_packed = primitive.extensions.contains_key("KHR_draco_mesh_compression");
        #[cfg(feature = "packed")]
        document.unpack(source, primitive)?;
        if cfg!(not(feature = "packed"))
            && is_packed
            && document.root.accessors.get(position).is_some_and(|accessor| accessor.buffer_view.is_none())
        {
            return Err(("it is compressed (Draco)".into(), document::UNPACK.into()));
        }
        let start = self.positions.len();
        let mut positions = document.vectors::<3>(source, position)?;
        let count = positions.len();
        let corners = match primitive.indices {
            Some(indices) => document.indices(source, indices.0)?,
            None => (0..count as u32).collect(),
        };
        let most = document.held.max(MAX_DRAWN);
        if self.triangles.len() + corners.len() > most || start + count > most {
            let what = format!("repeated meshes have more than {most} vertices or triangles in all");
            return Err((what, "draw them fewer times, or split the file".into()));
        }
        let places = placed.of_vertices(source, document, primitive, count)?;
        let mirrored = places.first().is_some_and(|place| place.determinant() < 0.0);
        self.triangles.extend(triangles(&corners, mode).filter_map(|[a, b, c]| {
            let [b, c] = if mirrored { [c, b] } else { [b, c] };
            let fits = [a, b, c].iter().all(|&corner| (corner as usize) < count);
            if !fits {
                source.notes.count(None, polygon::STRAYS);
            }
            fits.then(|| [a, b, c].map(|corner| start as u32 + corner))
        }));
        morph(source, document, primitive, "POSITION", weights, &mut positions)?;
        let place_of = |i: usize| if places.len() == 1 { places.first() } else { places.get(i) };
        self.positions.extend(positions.into_iter().enumerate().map(|(i, point)| match place_of(i) {
            Some(place) => place.transform_point3(DVec3::from(point.map(f64::from))).to_array(),
            None => point.map(f64::from),
        }));
        if let Some(normals) = primitive.attribute("NORMAL") {
            let mut normals = document.vectors::<3>(source, normals)?;
            morph(source, document, primitive, "NORMAL", weights, &mut normals)?;
            self.normals.resize(start, [0.0; 3]);
            self.normals.extend(normals.into_iter().take(count).enumerate().map(|(i, normal)| match place_of(i) {
                Some(place) => turned(place, normal),
                None => normal,
            }));
        }
        self.add_look(source, document, primitive, count)
    }

    /// Adds the colours and UVs of a primitive's vertices.
    fn add_look(
        &mut self,
        source: &mut Source,
        document: &mut Document,
        primitive: &json::Primitive,
        count: usize,
    ) -> Result<(), GltfWrong> {
        let material = primitive.material.map(|material| material.0);
        let look = image::look(source, document.root, material)?;
        let colors = primitive.attribute("COLOR_0").map(|index| document.colors(source, index)).transpose()?;
        self.has_vertex_colors |= colors.is_some();
        let start = self.colors.len();
        self.colors.extend(colors.unwrap_or_default().into_iter().take(count));
        self.colors.resize(start + count, [1.0; 4]);
        let rgb = |[r, g, b, _]: [f32; 4]| [r, g, b];
        let first = self.colors.get(start).copied().map_or([1.0; 3], rgb);
        let varies = self.colors[start..].iter().any(|color| rgb(*color) != first);
        let uvs = look.map.as_ref().and_then(|map| primitive.attribute(&format!("TEXCOORD_{}", map.uv_set)));
        let uvs = uvs.map(|index| document.vectors::<2>(source, index)).transpose()?;
        let mut range = [[0.0f32; 2], [1.0; 2]];
        for uv in uvs.iter().flatten().take(count) {
            let uv = look.map.as_ref().map_or(*uv, |map| map.transformed(*uv));
            let fits = uv.iter().all(|x| x.abs() <= FARTHEST_UV);
            if !fits {
                source.notes.count(None, FAR_UVS);
            }
            let uv = if fits { uv } else { [0.0; 2] };
            range = [[0, 1].map(|k| range[0][k].min(uv[k])), [0, 1].map(|k| range[1][k].max(uv[k]))];
            self.uvs.push(uv);
        }
        self.uvs.resize(start + count, [0.0; 2]);
        if look.map.is_some() && uvs.is_none() {
            source.notes.count(None, "a texture whose UVs are missing is not drawn");
        }
        self.pieces.push(Piece {
            material,
            look,
            tint: if varies { [1.0; 3] } else { first },
            varies,
            uv_range: uvs.map(|_| range),
            vertices: self.positions.len(),
            end: self.triangles.len(),
        });
        Ok(())
    }

    /// For each triangle the piece that it belongs to.
    fn piece_of_triangle(&self) -> impl Iterator<Item = usize> {
        let ends = self.pieces.iter().map(|piece| piece.end);
        let starts = std::iter::once(0).chain(ends.clone());
        starts.zip(ends).enumerate().flat_map(|(piece, (start, end))| (start..end).map(move |_| piece))
    }

    /// The opacity of each triangle; empty where all are 1.
    fn opacity(&self) -> Vec<f32> {
        let of = |(t, piece): (usize, usize)| {
            let look = &self.pieces[piece].look;
            let vertices = self.triangles[t].map(|corner| self.colors[corner as usize][3]);
            // A texture's alpha is 1 at most: where the product without it is below a cutoff, that with it is as well.
            look.cut.apply(look.alpha * vertices.iter().sum::<f32>() / 3.0)
        };
        let opacity: Vec<f32> = self.piece_of_triangle().enumerate().map(of).collect();
        if opacity.iter().all(|opacity| *opacity == 1.0) { Vec::new() } else { opacity }
    }

    /// Whether each triangle is drawn from its front alone; empty where none is.
    fn single_sided(&self) -> Vec<bool> {
        let is_single: Vec<bool> =
            self.piece_of_triangle().map(|piece| !self.pieces[piece].look.is_double_sided).collect();
        if is_single.contains(&true) { is_single } else { Vec::new() }
    }

    /// Lists the names of the materials, and notes what can be known only when all pieces have been read.
    fn note_looks(&self, source: &mut Source, root: &json::Root) {
        let used: BTreeSet<usize> = self.pieces.iter().filter_map(|piece| piece.material).collect();
        source.materials = used.iter().map(|&index| root.materials[index].name.clone()).collect();
        let is_drawn = |piece: &&Piece| piece.end > 0;
        let unlit = self.pieces.iter().filter(is_drawn).filter(|piece| piece.look.is_unlit).count();
        source.unlit = unlit > 0 && unlit == self.pieces.len();
        if unlit > 0 && !source.unlit {
            source.notes.add(None, "unlit materials are lit like the others: --unlit draws all colours without light");
        }
        let clear = |piece: &Piece| piece.look.cut.apply(piece.look.alpha) == 0.0;
        if let Some(piece) = self.pieces.iter().find(|piece| clear(piece)) {
            let material = piece.material.and_then(|index| root.materials.get(index));
            let name: String = material.map_or("", |material| &material.name).chars().take(40).collect();
            source.notes.add(
                None,
                format!("material \"{}\" is wholly transparent: its triangles are invisible", text::name(&name)),
            );
        }
        let is_mixed = |(t, piece): (usize, usize)| {
            let [a, b, c] = self.triangles[t].map(|corner| self.colors[corner as usize][3]);
            (a, a) != (b, c) && self.pieces[piece].look.cut != image::AlphaMode::Opaque
        };
        if self.piece_of_triangle().enumerate().any(is_mixed) {
            source.notes.add(None, "the alpha of vertex colours is averaged over each triangle");
        }
    }

    /// The mesh, with one vertex at each position (and colour, if vertices have colours).
    fn mesh(mut self, source: &mut Source, textures: Vec<Texture>, of_piece: &[image::PieceImage]) -> Result<Mesh> {
        source.keep_normals(&self.normals, &self.triangles);
        let positions = source.placed(&self.positions, &self.triangles)?;
        let is_textured = !textures.is_empty();
        let by_color = !is_textured && self.has_vertex_colors;
        let mut starts = Vec::with_capacity(self.positions.len());
        for (index, piece) in self.pieces.iter().enumerate() {
            starts.resize(piece.vertices, index);
        }
        let mut weld = Weld::new();
        let mut colors = Vec::new();
        let mut vertex = |&corner: &u32| {
            let corner = corner as usize;
            let color = || {
                let [r, g, b, _] = self.colors[corner];
                self.pieces[starts[corner]].color([r, g, b])
            };
            let color = if by_color { color() } else { [0.0; 3] };
            let (index, is_new) = weld.vertex(positions[corner], color.map(f32::to_bits));
            if by_color && is_new {
                colors.push(color);
            }
            index
        };
        let triangles: Vec<[u32; 3]> =
            self.triangles.iter().map(|[a, b, c]| [vertex(a), vertex(b), vertex(c)]).collect();
        let appearance = if is_textured {
            self.textured(source, textures, of_piece)?
        } else if by_color {
            Appearance::VertexColors(colors)
        } else {
            let plain = |piece: &Piece| piece.color(piece.tint);
            let first = self.pieces.first().map_or([1.0; 3], plain);
            if self.pieces.iter().all(|piece| plain(piece) == first) {
                Appearance::Uniform(first)
            } else {
                let texels = self.piece_of_triangle().map(|piece| plain(&self.pieces[piece])).collect();
                Appearance::Surface { resolution: 1, texels }
            }
        };
        source.mesh(weld.positions, triangles, appearance, |_| None)
    }

    /// Textures for all pieces: images, one texel for a colour, and a texture that is made for vertices of different colours.
    fn textured(
        &mut self,
        source: &mut Source,
        images: Vec<Texture>,
        of_piece: &[image::PieceImage],
    ) -> Result<Appearance> {
        let mut start = 0;
        for (piece, canvas) in self.pieces.iter().zip(of_piece) {
            if let Some((_, canvas)) = canvas {
                self.uvs[start..piece.vertices].iter_mut().for_each(|uv| *uv = canvas.place(*uv));
            }
            start = piece.vertices;
        }
        let pieces: Vec<usize> = self.piece_of_triangle().collect();
        let varying: Vec<usize> = (0..pieces.len()).filter(|&t| self.pieces[pieces[t]].varies).collect();
        let patch = |&t: &usize| {
            let (piece, corners) = (&self.pieces[pieces[t]], self.triangles[t].map(|corner| corner as usize));
            let image =
                of_piece[pieces[t]].map(|(index, _)| (&images[index as usize], corners.map(|corner| self.uvs[corner])));
            let rgb = corners.map(|corner| [self.colors[corner][0], self.colors[corner][1], self.colors[corner][2]]);
            Patch { colors: if image.is_some() { rgb } else { rgb.map(|color| piece.color(color)) }, image }
        };
        let patches: Vec<Patch> = varying.iter().map(patch).collect();
        if patches.iter().any(|patch| patch.image.is_some()) {
            source.notes.count(None, "vertex colours times a texture are drawn as a new texture");
        }
        let most = source.room().texels(0).max(4 * patches.len() as u64);
        let made = if patches.is_empty() { None } else { Some(paint::patches(&patches, most)) };
        let made = made.transpose().map_err(|what| fault(source.path, what, "remove its vertex colours"))?;
        drop(patches);
        let mut textures = Textures::having(images);
        let mut plain = Vec::with_capacity(self.pieces.len());
        for (piece, image) in self.pieces.iter().zip(of_piece) {
            let color = piece.color(piece.tint);
            let one = |_| Texture::new(1, 1, vec![color], Wrap::Repeat).ok();
            let index = image.map(|(index, _)| index);
            let index = index.or_else(|| textures.find_or(color.map(|x| (x + 0.0).to_bits()), one));
            plain.push(index.ok_or_else(|| fault(source.path, "a base colour that is not finite", "correct it"))?);
        }
        let texture_of_triangle = pieces.iter().map(|&piece| plain[piece]).collect();
        let uvs = std::mem::take(&mut self.uvs);
        let mut sheet =
            Sheet { uvs, uv_triangles: self.triangles.clone(), textures: textures.images, texture_of_triangle };
        if let Some(made) = made {
            sheet.add(varying, made);
        }
        Ok(sheet.appearance())
    }
}

/// A normal under a transform. A singular transform may make it 0, and then the triangles decide.
fn turned(place: &DMat4, normal: [f32; 3]) -> [f32; 3] {
    let columns = DMat3::from_mat4(*place);
    // The cofactors are the inverse's transpose times the determinant, and exist for a singular matrix, too.
    let [x, y, z] = [columns.x_axis, columns.y_axis, columns.z_axis];
    let cofactors = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
    let determinant = columns.determinant();
    let scale = if determinant == 0.0 { 1.0 } else { determinant };
    (cofactors * DVec3::from(normal.map(f64::from)) / scale).as_vec3().to_array()
}

/// Adds the morph targets of an attribute by their weights.
fn morph(
    source: &mut Source,
    document: &mut Document,
    primitive: &json::Primitive,
    name: &str,
    weights: &[f64],
    values: &mut [[f32; 3]],
) -> Result<(), GltfWrong> {
    for (target, weight) in primitive.targets.iter().zip(weights).filter(|(_, weight)| **weight != 0.0) {
        let Some(offsets) = target.get(name) else { continue };
        for (value, offset) in values.iter_mut().zip(document.vectors::<3>(source, offsets.0)?) {
            *value = [0, 1, 2].map(|k| value[k] + *weight as f32 * offset[k]);
        }
    }
    Ok(())
}

/// The triangles of a list, a strip or a fan of corners.
fn triangles(corners: &[u32], mode: usize) -> impl Iterator<Item = [u32; 3]> {
    let count = if mode == TRIANGLES { corners.len() / 3 } else { corners.len().saturating_sub(2) };
    (0..count).map(move |i| match mode {
        STRIP if i % 2 == 1 => [corners[i + 1], corners[i], corners[i + 2]],
        STRIP => [corners[i], corners[i + 1], corners[i + 2]],
        FAN => [corners[0], corners[i + 1], corners[i + 2]],
        _ => [corners[3 * i], corners[3 * i + 1], corners[3 * i + 2]],
    })
}
