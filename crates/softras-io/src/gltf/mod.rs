//! Reads glTF files, as text and binary. The crate gltf-json reads the JSON; what it names is looked up here, because the
//! crate gltf panics on some malformed files and allocates what others claim.

mod accessor;
mod document;
mod image;
mod write;

pub use write::glb;

use crate::{fault, obj::FARTHEST_UV, source::Source, weld::Weld};
use document::Document;
use glam::{DMat3, DMat4, DQuat, DVec3};
use gltf_json as json;
use image::Look;
use json::{
    mesh::{Mode, Semantic},
    validation::Checked,
};
use softras::{
    Result,
    scene::{Appearance, Mesh},
};

/// The most vertices, and the most triangles, where a file draws its meshes several times; without that, the bytes of its
/// buffers are the limit.
const MAX_DRAWN: usize = 1 << 22;
/// What does not change how the triangles are read.
const HARMLESS: [&str; 14] = [
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
];

pub(super) fn read(source: &mut Source, bytes: &[u8]) -> Result<Mesh> {
    let path = source.path;
    let wrong = |what: String| fault(path, what, "export the file again, as .glb without compression");
    let (text, binary) = document::split(bytes).map_err(wrong)?;
    let root = json::Root::from_slice(text).map_err(|error| wrong(format!("malformed glTF: {error}")))?;
    let unknown = root.extensions_required.iter().find(|name| !HARMLESS.contains(&name.as_str()));
    if let Some(name) = unknown {
        return Err(wrong(format!("it needs the extension {name}, which softras does not read")));
    }
    let mut soup = Soup::default();
    let mut document = Document::new(&root, binary);
    soup.add_scene(source, &mut document).map_err(wrong)?;
    let textures = image::textures(source, &mut document, &soup.pieces).map_err(wrong)?;
    source.opacity = soup.opacity();
    soup.mesh(source, textures)
}

/// The triangles of one primitive at one node.
struct Piece {
    material: Option<usize>,
    /// The base colour, without its alpha.
    color: [f32; 3],
    opacity: f32,
    has_uvs: bool,
    /// The end of its triangles in [`Soup::triangles`].
    end: usize,
}

/// All triangles of the scene, with vertices as the file has them.
#[derive(Default)]
struct Soup {
    positions: Vec<[f32; 3]>,
    /// Vertex colours times base colours.
    colors: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    /// Of the vertices up to the last that has one; 0 for vertices without.
    normals: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    pieces: Vec<Piece>,
    has_vertex_colors: bool,
    far_uvs: usize,
}

/// The transform of a node within its parent; `None` where it does nothing.
fn local(node: &json::Node) -> Option<DMat4> {
    if let Some(matrix) = node.matrix {
        return Some(DMat4::from_cols_array(&matrix.map(f64::from))).filter(|matrix| *matrix != DMat4::IDENTITY);
    }
    let triple = |value: [f32; 3]| DVec3::from(value.map(f64::from));
    let scale = node.scale.map_or(DVec3::ONE, triple);
    let rotation = node.rotation.map_or(DQuat::IDENTITY, |q| DQuat::from_array(q.0.map(f64::from)));
    // A quaternion of no length turns nothing.
    let rotation = if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
    let translation = node.translation.map_or(DVec3::ZERO, triple);
    let matrix = DMat4::from_scale_rotation_translation(scale, rotation, translation);
    Some(matrix).filter(|matrix| *matrix != DMat4::IDENTITY)
}

impl Soup {
    /// Adds the meshes of all nodes of the scene.
    fn add_scene(&mut self, source: &mut Source, document: &mut Document) -> Result<(), String> {
        let root = document.root;
        let scene = root.scene.map_or(0, |scene| scene.value());
        let mut waiting: Vec<(usize, Option<DMat4>)> = match root.scenes.get(scene) {
            Some(scene) => scene.nodes.iter().rev().map(|node| (node.value(), None)).collect(),
            None => {
                let children = root.nodes.iter().flat_map(|node| node.children.iter().flatten());
                let children: std::collections::HashSet<usize> = children.map(|node| node.value()).collect();
                (0..root.nodes.len()).rev().filter(|node| !children.contains(node)).map(|node| (node, None)).collect()
            }
        };
        // Nodes form trees, so that one that comes again is part of a cycle.
        let mut visited = vec![false; root.nodes.len()];
        while let Some((index, parent)) = waiting.pop() {
            let node =
                root.nodes.get(index).ok_or_else(|| format!("node {index} but there are {}", root.nodes.len()))?;
            if std::mem::replace(&mut visited[index], true) {
                continue;
            }
            let place = match (parent, local(node)) {
                (Some(parent), Some(local)) => Some(parent * local),
                (parent, local) => parent.or(local),
            };
            if let Some(mesh) = node.mesh {
                let mesh = mesh.value();
                let of =
                    root.meshes.get(mesh).ok_or_else(|| format!("mesh {mesh} but there are {}", root.meshes.len()))?;
                if node.skin.is_some() || of.primitives.iter().any(|primitive| primitive.targets.is_some()) {
                    source.notes.once("skins and morph targets are not applied");
                }
                for (number, primitive) in of.primitives.iter().enumerate() {
                    let place_of = |what: String| format!("mesh {mesh}, primitive {number}: {what}");
                    self.add(source, document, primitive, place).map_err(place_of)?;
                }
            }
            waiting.extend(node.children.iter().flatten().rev().map(|child| (child.value(), place)));
        }
        Ok(())
    }

    fn add(
        &mut self,
        source: &mut Source,
        document: &mut Document,
        primitive: &json::mesh::Primitive,
        place: Option<DMat4>,
    ) -> Result<(), String> {
        let mode = match primitive.mode {
            Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => mode,
            Checked::Valid(_) => {
                source.notes.once("lines and points are not drawn");
                return Ok(());
            }
            Checked::Invalid => return Err("an unknown mode".into()),
        };
        let attribute = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).map(|index| index.value());
        let Some(positions) = attribute(Semantic::Positions) else {
            source.notes.once("a primitive without positions is not drawn");
            return Ok(());
        };
        let start = self.positions.len();
        let positions = document.vectors::<3>(source, positions)?;
        let count = positions.len();
        let corners = match primitive.indices {
            Some(indices) => document.indices(source, indices.value())?,
            None => (0..count as u32).collect(),
        };
        let most = document.held.max(MAX_DRAWN);
        if self.triangles.len() + corners.len() > most || start + count > most {
            return Err(format!("over {most} vertices or triangles in all, by drawing meshes several times"));
        }
        if let Some(corner) = corners.iter().find(|&&corner| corner as usize >= count) {
            return Err(format!("vertex index {corner} but there are {count}"));
        }
        let mirrored = place.is_some_and(|place| place.determinant() < 0.0);
        self.triangles.extend(triangles(&corners, mode).map(|[a, b, c]| {
            let [b, c] = if mirrored { [c, b] } else { [b, c] };
            [a, b, c].map(|corner| start as u32 + corner)
        }));
        self.positions.extend(positions.into_iter().map(|point| match place {
            Some(place) => place.project_point3(DVec3::from(point.map(f64::from))).as_vec3().to_array(),
            None => point,
        }));
        if let Some(normals) = attribute(Semantic::Normals) {
            let turn = place.map(|place| DMat3::from_mat4(place).inverse().transpose());
            let normals = document.vectors::<3>(source, normals)?.into_iter().take(count);
            self.normals.resize(start, [0.0; 3]);
            self.normals.extend(normals.map(|normal| match turn {
                Some(turn) => (turn * DVec3::from(normal.map(f64::from))).as_vec3().to_array(),
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
        primitive: &json::mesh::Primitive,
        count: usize,
    ) -> Result<(), String> {
        let attribute = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).map(|index| index.value());
        let material = primitive.material.map(|material| material.value());
        let look = image::look(document.root, material)?;
        let colors = attribute(Semantic::Colors(0)).map(|index| document.vectors::<3>(source, index)).transpose()?;
        self.has_vertex_colors |= colors.is_some();
        let colors = colors.unwrap_or_default().into_iter().chain(std::iter::repeat([1.0; 3])).take(count);
        self.colors.extend(colors.map(|color| [0, 1, 2].map(|k| color[k] * look.color[k])));
        let uvs = look.uv_set.and_then(|set| attribute(Semantic::TexCoords(set)));
        let uvs = uvs.map(|index| document.vectors::<2>(source, index)).transpose()?;
        let has_uvs = uvs.is_some();
        let uvs = uvs.unwrap_or_default().into_iter().map(|uv| look.transformed(uv));
        for uv in uvs.chain(std::iter::repeat([0.0; 2])).take(count) {
            let fits = uv.iter().all(|x| x.abs() <= FARTHEST_UV);
            self.far_uvs += usize::from(!fits);
            self.uvs.push(if fits { uv } else { [0.0; 2] });
        }
        let Look { color, opacity, .. } = look;
        self.pieces.push(Piece { material, color, opacity, has_uvs, end: self.triangles.len() });
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
        if self.pieces.iter().all(|piece| piece.opacity == 1.0) {
            return Vec::new();
        }
        self.piece_of_triangle().map(|piece| self.pieces[piece].opacity).collect()
    }

    /// The mesh, with one vertex at each position (and colour, if vertices have colours).
    fn mesh(self, source: &mut Source, textures: Option<image::Textured>) -> Result<Mesh> {
        if self.far_uvs > 0 {
            let note = format!("texture coordinates that are not within ±{FARTHEST_UV} are taken as 0");
            source.notes.add(None, format!("{note} ({} in all)", self.far_uvs));
        }
        if textures.is_some() && self.has_vertex_colors {
            source.notes.add(None, "vertex colours are not used: the materials have textures");
        }
        source.keep_normals(&self.normals, &self.triangles);
        let by_color = textures.is_none() && self.has_vertex_colors;
        let mut weld = Weld::new();
        let mut colors = Vec::new();
        let mut vertex = |&corner: &u32| {
            let corner = corner as usize;
            let color = self.colors[corner];
            let key = if by_color { color.map(f32::to_bits) } else { [0; 3] };
            let (index, is_new) = weld.vertex(self.positions[corner], key);
            if by_color && is_new {
                colors.push(color);
            }
            index
        };
        let triangles: Vec<[u32; 3]> =
            self.triangles.iter().map(|[a, b, c]| [vertex(a), vertex(b), vertex(c)]).collect();
        let appearance = if let Some(image::Textured { images, of_piece }) = textures {
            let texture_of_triangle = match images.len() {
                1 => Vec::new(),
                _ => self.piece_of_triangle().map(|piece| of_piece[piece]).collect(),
            };
            Appearance::Textured { uvs: self.uvs, uv_triangles: self.triangles, textures: images, texture_of_triangle }
        } else if by_color {
            Appearance::VertexColors(colors)
        } else {
            let first = self.pieces.first().map_or([1.0; 3], |piece| piece.color);
            if self.pieces.iter().all(|piece| piece.color == first) {
                Appearance::Uniform(first)
            } else {
                let texels = self.piece_of_triangle().map(|piece| self.pieces[piece].color).collect();
                Appearance::Surface { resolution: 1, texels }
            }
        };
        Mesh::new(weld.positions, triangles)?.with_appearance(appearance)
    }
}

/// The triangles of a list, a strip or a fan of corners.
fn triangles(corners: &[u32], mode: Mode) -> impl Iterator<Item = [u32; 3]> {
    let count = if mode == Mode::Triangles { corners.len() / 3 } else { corners.len().saturating_sub(2) };
    (0..count).map(move |i| match mode {
        Mode::TriangleStrip if i % 2 == 1 => [corners[i + 1], corners[i], corners[i + 2]],
        Mode::TriangleStrip => [corners[i], corners[i + 1], corners[i + 2]],
        Mode::TriangleFan => [corners[0], corners[i + 1], corners[i + 2]],
        _ => [corners[3 * i], corners[3 * i + 1], corners[3 * i + 2]],
    })
}
