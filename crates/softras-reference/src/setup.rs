//! Computes the pieces that a view's pixels visit from its mesh: transform, light, clip at the near plane, project.

use super::geometry::doubled_area;
use super::light::{Lamps, corner_normals, tint};
use super::parameters::{Parameters, Source};
use super::project::Lens;
use super::real::{Real, lerp};
use softras::scene::{Appearance, Camera, Faces, FrontFace, Mesh, Parity, Projection, Scene, Settings};

/// The data of a triangle's corner.
#[derive(Clone, Copy, Debug)]
pub struct Corner<R> {
    /// x, y on the screen.
    pub screen: [R; 2],
    /// View depth.
    pub z: R,
    /// Light, times the corner's colour where colours are the mesh's or its vertices'.
    pub tint: [R; 3],
    /// Texture coordinates; 0 where there are none.
    pub uv: [R; 2],
    /// Barycentrics in the uncut triangle.
    pub original: [R; 3],
    /// World-space normal; 0 where neither lights nor outputs need it.
    pub normal: [R; 3],
}

impl<R: Real> Corner<R> {
    /// Numbers in a corner.
    pub const SCALARS: usize = 14;

    /// All numbers, in declaration order.
    pub fn scalars(&self) -> [R; 14] {
        let ([sx, sy], [r, g, b], [u, v]) = (self.screen, self.tint, self.uv);
        let ([a0, a1, a2], [nx, ny, nz]) = (self.original, self.normal);
        [sx, sy, self.z, r, g, b, u, v, a0, a1, a2, nx, ny, nz]
    }

    /// The inverse of [`Corner::scalars`].
    pub fn from_scalars([sx, sy, z, r, g, b, u, v, a0, a1, a2, nx, ny, nz]: [R; 14]) -> Self {
        Self { screen: [sx, sy], z, tint: [r, g, b], uv: [u, v], original: [a0, a1, a2], normal: [nx, ny, nz] }
    }
}

/// A triangle, or a part of one that lies beyond the near plane.
#[derive(Clone, Copy, Debug)]
pub struct Piece<R> {
    /// The mesh's triangle that it belongs to.
    pub triangle: usize,
    /// Its corners.
    pub corners: [Corner<R>; 3],
    /// Whether it faces the camera; a piece without area does.
    pub front: bool,
    /// Whether depth is linear on the screen, since the camera is orthographic.
    pub parallel: bool,
}

impl<R: Real> Piece<R> {
    /// Numbers in a piece.
    pub const SCALARS: usize = 3 * Corner::<R>::SCALARS;

    /// Its corners on the screen.
    pub fn screen(&self) -> [[R; 2]; 3] {
        self.corners.map(|c| c.screen)
    }

    /// This piece in other numbers; `f` gets each number and its index among the piece's [`Piece::SCALARS`].
    pub fn map<T: Real>(&self, mut f: impl FnMut(R, usize) -> T) -> Piece<T> {
        let corners = std::array::from_fn(|k| {
            let scalars = self.corners[k].scalars();
            Corner::from_scalars(std::array::from_fn(|i| f(scalars[i], k * Corner::<R>::SCALARS + i)))
        });
        Piece { triangle: self.triangle, corners, front: self.front, parallel: self.parallel }
    }
}

/// A corner before projection.
#[derive(Clone, Copy)]
struct Vertex<R> {
    view: [R; 3],
    corner: Corner<R>,
}

/// The inputs of one view's pieces.
struct Setup<'a, R> {
    mesh: &'a Mesh,
    settings: &'a Settings,
    lens: Lens<'a, R>,
    lamps: Lamps<R>,
    world: Vec<[R; 3]>,
    /// Normals of each triangle's corners; empty where neither lights nor outputs need them.
    normals: Vec<[[R; 3]; 3]>,
    on_screen: bool,
    parallel: bool,
}

/// The pieces of the mesh that `view` sees, in triangle order.
pub fn pieces<S: Source>(
    scene: &Scene,
    cameras: &[Camera],
    settings: &Settings,
    parameters: &Parameters,
    view: usize,
    source: &S,
) -> Vec<Piece<S::R>> {
    let mesh_index = scene.mesh_of_view(view);
    let mesh = &scene.meshes[mesh_index];
    let slots = &parameters.layout().meshes[mesh_index];
    let world: Vec<[S::R; 3]> = slots.positions.clone().step_by(3).map(|slot| source.row(slot)).collect();
    let lamps = Lamps::load(parameters, source);
    let need_normals = lamps.need_normals() || settings.outputs.normal;
    let normals = if need_normals { corner_normals(mesh, &world, scene.lights.shading) } else { Vec::new() };
    let lens = Lens::load(&cameras[view], settings, parameters, view, source);
    let on_screen = matches!(cameras[view].projection(), Projection::Screen);
    let parallel =
        settings.parity == Parity::Model && matches!(cameras[view].projection(), Projection::Orthographic { .. });
    let setup = Setup { mesh, settings, lens, lamps, world, normals, on_screen, parallel };
    let colors: Vec<[S::R; 3]> = slots.colors.clone().step_by(3).map(|slot| source.row(slot)).collect();
    let uvs: Vec<[S::R; 2]> = slots.uvs.clone().step_by(2).map(|slot| source.row(slot)).collect();
    (0..mesh.triangles().len()).flat_map(|triangle| setup.triangle(triangle, &colors, &uvs)).collect()
}

impl<R: Real> Setup<'_, R> {
    fn triangle(&self, triangle: usize, colors: &[[R; 3]], uvs: &[[R; 2]]) -> Vec<Piece<R>> {
        let vertices = self.vertices(triangle, colors, uvs);
        let corners = match self.settings.parity {
            Parity::Official => vertices.map(|v| v.corner).to_vec(),
            Parity::Model => self.cut(&vertices),
        };
        let fan = (2..corners.len()).map(|k| [corners[0], corners[k - 1], corners[k]]);
        fan.filter_map(|corners| self.piece(triangle, corners)).collect()
    }

    /// A triangle's corners in view space with their attributes.
    fn vertices(&self, triangle: usize, colors: &[[R; 3]], uvs: &[[R; 2]]) -> [Vertex<R>; 3] {
        let indices = self.mesh.triangles()[triangle].map(|v| v as usize);
        let normals = self.normals.get(triangle).copied().unwrap_or([[R::zero(); 3]; 3]);
        let own = match self.mesh.appearance() {
            Appearance::Uniform(_) => [colors[0]; 3],
            Appearance::VertexColors(_) => indices.map(|v| colors[v]),
            Appearance::Surface { .. } | Appearance::Textured { .. } => [[R::one(); 3]; 3],
        };
        let tints = tint(&self.lamps, normals, own);
        let uv = match self.mesh.appearance() {
            Appearance::Textured { uv_triangles, .. } => uv_triangles[triangle].map(|v| uvs[v as usize]),
            _ => [[R::zero(); 2]; 3],
        };
        std::array::from_fn(|k| {
            let world = self.world[indices[k]];
            let view = self.lens.to_view(world);
            // Positions given on the screen are used directly: multiplying by z and dividing again would round.
            let screen = if self.on_screen { [world[0], world[1]] } else { self.lens.to_screen(view) };
            let mut original = [R::zero(); 3];
            original[k] = R::one();
            Vertex {
                view,
                corner: Corner { screen, z: view[2], tint: tints[k], uv: uv[k], original, normal: normals[k] },
            }
        })
    }

    /// Sutherland-Hodgman clipping against z ≥ near. The polygon has 0, 3 or 4 corners and begins with corner 0 if that
    /// is left.
    fn cut(&self, vertices: &[Vertex<R>; 3]) -> Vec<Corner<R>> {
        let near = self.settings.near;
        let inside = vertices.map(|v| v.view[2].value() >= near);
        let mut polygon = Vec::with_capacity(4);
        for k in 0..3 {
            let next = (k + 1) % 3;
            if inside[k] {
                polygon.push(vertices[k].corner);
            }
            if inside[k] != inside[next] {
                polygon.push(self.cut_edge(&vertices[k], &vertices[next]));
            }
        }
        polygon
    }

    /// The point where the edge from a to b crosses the near plane; its attributes are linear in view space.
    fn cut_edge(&self, a: &Vertex<R>, b: &Vertex<R>) -> Corner<R> {
        let near = R::constant(self.settings.near);
        let t = (near - a.view[2]) / (b.view[2] - a.view[2]);
        let [x, y, _] = lerp(a.view, b.view, t);
        let carried = lerp(a.corner.scalars(), b.corner.scalars(), t);
        Corner { screen: self.lens.to_screen([x, y, near]), z: near, ..Corner::from_scalars(carried) }
    }

    /// `None` for a piece that is not drawn: its coordinates overflow, or it is a culled back face.
    fn piece(&self, triangle: usize, corners: [Corner<R>; 3]) -> Option<Piece<R>> {
        let finite = |c: &Corner<R>| c.screen.iter().chain([&c.z]).all(|x| x.value().is_finite());
        if !corners.iter().all(finite) {
            return None;
        }
        let area = doubled_area(&corners.map(|c| c.screen)).map(Real::value);
        let front = match self.settings.front_face {
            FrontFace::CounterClockwise => area.is_none_or(|a| a > 0.0),
            FrontFace::Clockwise => area.is_none_or(|a| a < 0.0),
        };
        let dropped = self.settings.faces == Faces::Front && self.settings.parity == Parity::Model && !front;
        (!dropped).then_some(Piece { triangle, corners, front, parallel: self.parallel })
    }
}
