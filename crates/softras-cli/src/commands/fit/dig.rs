//! Hollows of a hull that no outline shows, such as a mug's: found by the light in them.
//!
//! A visual hull lies over a hollow like a lid. Of an object of one colour under known lights, the pictures show another light
//! there than the lid has. So regions of the hull that look wrong are pushed inwards, by several depths, and the depth at which
//! the renderings come nearest to the pictures is kept, if it is nearer than the hull. A fit's small steps do not get there: a
//! lid that is bent a little looks no more like a hollow than a flat one does.

use super::begin::color_under_light;
use super::targets::{Views, every};
use crate::commands::{Failure, parts};
use glam::DVec3;
use softras::fit::{Targets, remeshed};
use softras::internals::fit::{Topology, pooled};
use softras::scene::{Appearance, Background, Lights, Outputs, Shading};
use softras::{Camera, Image, ImageGradient, Mesh, Renderer, Result, Scene, Settings, Wanted};

/// Hollows that are looked for.
const MOST_HOLLOWS: usize = 4;
/// Shares of the way to the other side by which a region is pushed, and what is tried around the best of all, short of
/// that side.
const DEPTHS: [f64; 6] = [0.15, 0.3, 0.45, 0.6, 0.75, 0.9];
const FINER: [f64; 4] = [-0.1, -0.05, 0.05, 0.08];
/// Shares of the largest error from which on a vertex belongs to a region.
const LEVELS: [f64; 3] = [0.25, 0.4, 0.6];
/// The error that all but so many in a hundred vertices are below counts as the largest.
const LARGEST: f64 = 0.97;
/// How often the outline of a region is evened out.
const OUTLINE_PASSES: usize = 4;
/// The least length of a region's mean unit normal: a region that is more bent is no lid.
const LEAST_FLATNESS: f64 = 0.75;
/// The least area of a region, as a share of the mesh's.
const LEAST_SHARE: f64 = 0.015;
/// Rings of triangles by which the best region is made larger or smaller, at most.
const MOST_RINGS: usize = 4;
/// Pixels of all pictures together that a vertex must fill for its error to count.
const LEAST_SEEN: f64 = 0.1;
/// A hollow must leave less than this share of the error.
const GAIN: f64 = 0.97;

/// Pixels along the shorter side of the pictures that are compared, at least: a hollow that is worth a push is large.
const PIXELS: usize = 64;
/// The most pictures that are compared.
const VIEWS: usize = 24;

/// The hull with its hollows, and how many there are. `edge` is the length of its edges.
///
/// # Errors
/// As of rendering and remeshing.
pub fn dug(
    hull: Mesh,
    edge: f64,
    targets: &Targets,
    views: &Views,
    renderer: &mut Renderer,
) -> Result<(Mesh, usize), Failure> {
    let Some(mut eye) = Eye::new(targets, views, renderer)? else { return Ok((hull, 0)) };
    let (mut mesh, mut hollows) = (hull, 0);
    while hollows < MOST_HOLLOWS {
        eye.color = color_under_light(&mesh, views, eye.renderer)?;
        let error = eye.error(&mesh)?;
        let Some((deeper, left)) = deeper(&mesh, &mut eye)? else { break };
        if left > GAIN * error {
            break;
        }
        (mesh, hollows) = (remeshed(&deeper, edge)?, hollows + 1);
    }
    Ok((mesh, hollows))
}

/// A push of a region, and the error that it leaves.
struct Push {
    region: Region,
    share: f64,
    error: f64,
}

impl Push {
    fn new(surface: &Surface<'_>, eye: &mut Eye<'_>, region: Region, share: f64) -> Result<Self> {
        let error = eye.error(&surface.pushed(&region, share)?)?;
        Ok(Self { region, share, error })
    }
}

/// The mesh after the best of all pushes, with its error; `None` if no region looks wrong. The triangles around the region are
/// then as long as the push.
fn deeper(mesh: &Mesh, eye: &mut Eye<'_>) -> Result<Option<(Mesh, f64)>, Failure> {
    let surface = Surface::new(mesh)?;
    let errors = surface.smoothed(eye.errors(mesh)?);
    let mut tried: Vec<Region> = Vec::new();
    let mut best: Option<Push> = None;
    for region in LEVELS.iter().flat_map(|level| surface.regions(&errors, *level)) {
        if tried.iter().any(|other| other.is_in == region.is_in) {
            continue;
        }
        for share in DEPTHS {
            let push = Push::new(&surface, eye, region.clone(), share)?;
            if best.as_ref().is_none_or(|best| push.error < best.error) {
                best = Some(push);
            }
        }
        tried.push(region);
    }
    let Some(mut best) = best else { return Ok(None) };
    for share in FINER.map(|step| best.share + step) {
        let push = Push::new(&surface, eye, best.region.clone(), share)?;
        best = if push.error < best.error { push } else { best };
    }
    for grows in [true, false] {
        for _ in 0..MOST_RINGS {
            let push = Push::new(&surface, eye, surface.ringed(&best.region, grows), best.share)?;
            if push.error >= best.error {
                break;
            }
            best = push;
        }
    }
    Ok(Some((surface.pushed(&best.region, best.share)?, best.error)))
}

/// What compares a mesh with the pictures.
struct Eye<'a> {
    /// The pictures, with fewer pixels.
    pictures: Image,
    cameras: Vec<Camera>,
    /// Those of the pictures, on the triangles' own normals: mean ones are not those of walls of a single long triangle.
    lights: Lights,
    settings: Settings,
    renderer: &'a mut Renderer,
    /// Of the object.
    color: [f32; 3],
}

impl<'a> Eye<'a> {
    /// `None` without colours.
    fn new(targets: &Targets, views: &Views, renderer: &'a mut Renderer) -> Result<Option<Self>> {
        let Targets { cameras, color: Some(color), .. } = every(targets, targets.cameras.len().div_ceil(VIEWS)) else {
            return Ok(None);
        };
        let side = color.height.min(color.width);
        let divides = |n: &usize| color.height.is_multiple_of(*n) && color.width.is_multiple_of(*n);
        let fewer = (1..=(side / PIXELS).max(1)).rev().find(divides).unwrap_or(1);
        let pictures = pooled(&color, fewer)?;
        let settings = Settings {
            width: pictures.width as u32,
            height: pictures.height as u32,
            near: views.depths.0,
            far: views.depths.1,
            background: Background::Composite,
            outputs: Outputs { color: true, silhouette: false, depth: false, normal: false },
            ..Settings::default()
        };
        let lights = Lights { shading: Shading::Flat, ..views.lights.clone() };
        Ok(Some(Self { pictures, cameras, lights, settings, renderer, color: [1.0; 3] }))
    }

    /// The error of each pixel of a mesh's pictures.
    fn pixels(&mut self, mesh: &Mesh) -> Result<Vec<f32>> {
        let mesh = mesh.clone().with_appearance(Appearance::Uniform(self.color))?;
        let scene = Scene::new(mesh).with_lights(self.lights.clone());
        let mut errors = Vec::new();
        let pictures = &self.pictures;
        parts::in_batches(self.renderer, &scene, &self.cameras, &self.settings, |views, frame| {
            let shown = frame.color().into_iter().flat_map(|image| image.data.chunks_exact(3));
            let pairs = shown.zip(views.flat_map(|view| pictures.view(view).chunks_exact(3)));
            errors.extend(pairs.map(|(a, b)| (0..3).map(|k| (a[k] - b[k]).abs()).sum::<f32>() / 3.0));
            Ok(())
        })?;
        Ok(errors)
    }

    /// The sum of all pixels' errors.
    fn error(&mut self, mesh: &Mesh) -> Result<f64> {
        Ok(self.pixels(mesh)?.iter().map(|error| f64::from(*error)).sum())
    }

    /// Each vertex's mean error over the pixels that show it; 0 where none does.
    fn errors(&mut self, mesh: &Mesh) -> Result<Vec<f64>> {
        let pixels = self.pixels(mesh)?;
        let white = Appearance::VertexColors(vec![[1.0; 3]; mesh.positions().len()]);
        let scene = Scene::new(mesh.clone().with_appearance(white)?).with_lights(Lights::unlit());
        let settings = Settings { save: true, ..self.settings.clone() };
        let Image { height, width, .. } = self.pictures;
        let mut sums = vec![[0.0; 2]; mesh.positions().len()];
        for (camera, errors) in self.cameras.iter().zip(pixels.chunks_exact(height * width)) {
            let frame = self.renderer.render(&scene, std::slice::from_ref(camera), &settings)?;
            // The derivative by a vertex's colour adds up errors in the first channel, and in the second the pixels themselves.
            let data = errors.iter().flat_map(|error| [*error, 1.0, 0.0]).collect();
            let upstream = ImageGradient::color(Image { batch: 1, height, width, channels: 3, data });
            let gradients = self.renderer.backward(&frame, &upstream, &Wanted { colors: true, ..Wanted::NOTHING })?;
            for (sum, [error, seen, _]) in sums.iter_mut().zip(&gradients.meshes[0].colors) {
                sum[0] += f64::from(*error);
                sum[1] += f64::from(*seen);
            }
        }
        Ok(sums.into_iter().map(|[error, seen]| if seen > LEAST_SEEN { error / seen } else { 0.0 }).collect())
    }
}

/// A mesh with what is asked of it.
struct Surface<'a> {
    mesh: &'a Mesh,
    topology: Topology,
    positions: Vec<DVec3>,
    /// Of each vertex, a third of its triangles' area vectors.
    areas: Vec<DVec3>,
}

/// Vertices that may lie over a hollow.
#[derive(Clone)]
struct Region {
    is_in: Vec<bool>,
    /// The unit normal.
    normal: DVec3,
    /// To the other side of the mesh.
    depth: f64,
}

impl<'a> Surface<'a> {
    fn new(mesh: &'a Mesh) -> Result<Self> {
        let positions: Vec<DVec3> = mesh.positions().iter().map(|p| DVec3::from(p.map(f64::from))).collect();
        let mut areas = vec![DVec3::ZERO; positions.len()];
        for triangle in mesh.triangles() {
            let [a, b, c] = triangle.map(|v| positions[v as usize]);
            triangle.iter().for_each(|v| areas[*v as usize] += (b - a).cross(c - a) / 6.0);
        }
        Ok(Self { mesh, topology: Topology::new(mesh.positions().len(), mesh.triangles())?, positions, areas })
    }

    /// The mean with the neighbours, twice.
    fn smoothed(&self, mut values: Vec<f64>) -> Vec<f64> {
        for _ in 0..2 {
            let mean = |v: usize| {
                let around = self.topology.neighbors(v);
                (values[v] + around.iter().map(|n| values[*n as usize]).sum::<f64>()) / (1 + around.len()) as f64
            };
            values = (0..values.len()).map(mean).collect();
        }
        values
    }

    /// The connected regions where the errors are above a share of the largest, with what they enclose.
    fn regions(&self, errors: &[f64], level: f64) -> Vec<Region> {
        let mut sorted = errors.to_vec();
        sorted.sort_by(f64::total_cmp);
        let largest = sorted.get((LARGEST * sorted.len() as f64) as usize).copied().unwrap_or(0.0);
        let is_wrong: Vec<bool> = errors.iter().map(|error| *error > level * largest).collect();
        let parts = self.parts(|v| is_wrong[v]);
        parts.iter().filter_map(|part| self.region(part)).collect()
    }

    /// The connected sets of vertices of a kind.
    fn parts(&self, is_in: impl Fn(usize) -> bool) -> Vec<Vec<usize>> {
        let mut left: Vec<bool> = (0..self.positions.len()).map(is_in).collect();
        let mut parts = Vec::new();
        for start in 0..left.len() {
            if !std::mem::take(&mut left[start]) {
                continue;
            }
            let (mut part, mut next) = (vec![start], 0);
            while let Some(&v) = part.get(next) {
                next += 1;
                let around = self.topology.neighbors(v).iter().map(|n| *n as usize);
                part.extend(around.filter(|&n| std::mem::take(&mut left[n])));
            }
            parts.push(part);
        }
        parts
    }

    /// The region of a part, unless it is too small or too bent, or nothing is opposite of it.
    fn region(&self, part: &[usize]) -> Option<Region> {
        let mut is_in = vec![false; self.positions.len()];
        part.iter().for_each(|&v| is_in[v] = true);
        // What the part encloses: all that is beside it but the largest.
        let mut beside = self.parts(|v| !is_in[v]);
        beside.sort_by_key(Vec::len);
        beside.pop();
        beside.concat().into_iter().for_each(|v| is_in[v] = true);
        // A ragged outline would become ragged walls.
        let mut share: Vec<f64> = is_in.iter().map(|&is_in| f64::from(u8::from(is_in))).collect();
        for _ in 0..OUTLINE_PASSES {
            share = self.smoothed(share);
        }
        is_in = share.into_iter().map(|share| share > 0.5).collect();
        let inner = || (0..is_in.len()).filter(|&v| is_in[v]);
        let area: f64 = inner().map(|v| self.areas[v].length()).sum();
        let normal: DVec3 = inner().map(|v| self.areas[v]).sum();
        if area < LEAST_SHARE * self.area() || normal.length() < LEAST_FLATNESS * area {
            return None;
        }
        let normal = normal.normalize();
        let center = inner().map(|v| self.positions[v] * self.areas[v].length()).sum::<DVec3>() / area;
        let depth = self.depth(center, normal)?;
        Some(Region { is_in, normal, depth })
    }

    fn area(&self) -> f64 {
        self.areas.iter().map(|area| area.length()).sum()
    }

    /// The region with the ring of vertices around it, or without its own outermost ring.
    fn ringed(&self, region: &Region, grows: bool) -> Region {
        let near_other = |v: usize| self.topology.neighbors(v).iter().any(|n| region.is_in[*n as usize] == grows);
        let is_in =
            (0..region.is_in.len()).map(|v| if region.is_in[v] == grows { grows } else { near_other(v) == grows });
        Region { is_in: is_in.collect(), ..*region }
    }

    /// How far it is from a point of the surface against its normal to where the mesh ends.
    fn depth(&self, from: DVec3, normal: DVec3) -> Option<f64> {
        let hit = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|v| self.positions[v as usize]);
            let area = (b - a).cross(c - a);
            // Where a ray against the normal leaves the solid.
            let toward = -normal.dot(area);
            let along = (a - from).dot(area) / toward;
            let at = from - along * normal;
            let inside = [(a, b), (b, c), (c, a)].iter().all(|(p, q)| (*q - *p).cross(at - *p).dot(area) >= 0.0);
            (toward > 0.0 && along > 0.0 && inside).then_some(along)
        };
        self.mesh.triangles().iter().filter_map(hit).min_by(f64::total_cmp)
    }

    /// The mesh with a region pushed inwards, by a share of the way to the other side.
    fn pushed(&self, region: &Region, share: f64) -> Result<Mesh> {
        let push =
            |(v, p): (usize, &DVec3)| if region.is_in[v] { *p - share * region.depth * region.normal } else { *p };
        let positions = self.positions.iter().enumerate().map(push).map(|p| p.as_vec3().to_array()).collect();
        Mesh::new(positions, self.mesh.triangles().to_vec())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use softras::shapes;

    const HEIGHT: f64 = 1.4;

    /// A box, and which of its vertices lie within its upper side, away from its edges.
    fn block() -> Result<(Mesh, Vec<bool>)> {
        let sphere = shapes::icosphere(4)?;
        let side = (0.5 * HEIGHT) as f32;
        let positions = sphere.positions().iter().map(|p| p.map(|x| (1.3 * x).clamp(-side, side))).collect();
        let block = Mesh::new(positions, sphere.triangles().to_vec())?;
        let on_lid = |p: &[f32; 3]| p[1] == side && p[0].abs() < 0.5 && p[2].abs() < 0.5;
        let is_in = block.positions().iter().map(on_lid).collect();
        Ok((block, is_in))
    }

    #[test]
    fn a_lid_is_found_and_pushed_to_the_other_side() -> Result<()> {
        let (block, is_in) = block()?;
        let surface = Surface::new(&block)?;
        // What looks right in the middle of a lid belongs to it.
        let middle = |p: &[f32; 3]| p[0].abs() < 0.1 && p[2].abs() < 0.1;
        let looks_wrong = is_in.iter().zip(block.positions()).map(|(&is_in, p)| is_in && !middle(p));
        let errors: Vec<f64> = looks_wrong.map(|wrong| if wrong { 1.0 } else { 0.1 }).collect();
        let regions = surface.regions(&errors, 0.5);
        assert_eq!(regions.len(), 1);
        let region = &regions[0];
        // Its corners are rounded.
        let is_off = region.is_in.iter().zip(&is_in).filter(|(a, b)| a != b).count();
        let all = is_in.iter().filter(|is_in| **is_in).count();
        assert!(is_off < all / 5, "{is_off} of {all}");
        assert!(region.normal.distance(DVec3::Y) < 1e-3, "{}", region.normal);
        assert!((region.depth - HEIGHT).abs() < 1e-6, "{}", region.depth);
        let pushed = surface.pushed(region, 0.25)?;
        for ((from, to), is_in) in block.positions().iter().zip(pushed.positions()).zip(&region.is_in) {
            let sunk = if *is_in { 0.25 * HEIGHT } else { 0.0 };
            assert!((f64::from(from[1] - to[1]) - sunk).abs() < 1e-6 && (from[0] - to[0]).abs() < 1e-6);
        }
        let all = surface.ringed(region, true);
        let count = |region: &Region| region.is_in.iter().filter(|is_in| **is_in).count();
        assert!(count(&all) > count(region) && count(&surface.ringed(region, false)) < count(region));
        Ok(())
    }

    #[test]
    fn what_is_no_lid_is_left_alone() -> Result<()> {
        let (block, is_in) = block()?;
        let surface = Surface::new(&block)?;
        // All around, a single vertex, and nothing.
        let one = is_in.iter().position(|is_in| *is_in);
        for errors in [vec![1.0; is_in.len()], (0..is_in.len()).map(|v| f64::from(Some(v) == one)).collect()] {
            assert!(surface.regions(&errors, 0.5).is_empty());
        }
        assert!(surface.regions(&vec![0.0; is_in.len()], 0.5).is_empty());
        Ok(())
    }
}
