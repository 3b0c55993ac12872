//! A mesh's surface as pictures show it: the colours of its points, and how squarely each view sees them.

use super::cameras;
use crate::{
    Topology, doubles, on_all_cores, points, singles, sized,
    solid::hull::{between, depth_at, sample},
};
use glam::DVec3;
use rayon::prelude::*;
use softras::{
    Image, Mesh, Renderer, Result, Scene, Settings, parts,
    scene::{Appearance, Camera, Outputs},
};
use softras_io::{Photograph, Views};

/// The least cosine between a surface's normal and the direction to a camera that counts as seeing the surface.
const LEAST_COSINE: f64 = 0.2;
/// How far a point may lie behind the nearest surface, pixels.
const BEHIND: f64 = 2.0;
/// Neighbouring depths that differ by more than this, in pixels, belong to two surfaces.
const STEP: f64 = 8.0;
/// The least silhouette value of a pixel that shows nothing but the object.
const COVERED: f64 = 0.99;
/// The most depths along a side of a photograph.
const MOST_DEPTHS: u32 = 1024;
/// Rounds in which colours spread to vertices that no view sees.
const ROUNDS: usize = 200;

/// Views, and the depths of a mesh in them.
pub struct Seen<'a>(Vec<SeenView<'a>>);

/// A view.
struct SeenView<'a> {
    views: &'a Views,
    view: usize,
    /// The photograph that the view is a crop of, if colours are those of photographs.
    photograph: Option<&'a Photograph>,
    /// The camera of the picture that colours are taken from.
    camera: Camera,
    eye: DVec3,
    size: (u32, u32),
    /// The depths of the mesh, and the picture's pixels along a side of one of them.
    depths: Image,
    step: f64,
}

impl<'a> Seen<'a> {
    /// The surface of a mesh as views show it.
    pub fn of(mesh: &Mesh, views: &'a Views, settings: &Settings, renderer: &mut Renderer) -> Result<Self> {
        let (height, width) = views.size()?;
        let size = (width as u32, height as u32);
        let sight = |(view, camera): (usize, &Camera)| SeenView::new(views, view, None, *camera, size);
        let mut sights: Vec<SeenView<'_>> = views.cameras.iter().enumerate().map(sight).collect();
        let (scene, settings) = depths_of(mesh, settings)?;
        parts::in_batches(renderer, &scene, &views.cameras, &sized(&settings, (height, width), 1), |some, frame| {
            let depths = frame.depth()?;
            some.clone().zip(0..).for_each(|(view, at)| sights[view].depths = depths.views(at..at + 1));
            Ok(())
        })?;
        Ok(Self(sights))
    }

    /// The surface of a mesh as the photographs of views show it.
    pub fn of_photographs(mesh: &Mesh, views: &'a Views, settings: &Settings, renderer: &mut Renderer) -> Result<Self> {
        let (scene, settings) = depths_of(mesh, settings)?;
        let sight = |(view, photograph): (usize, &'a Photograph)| {
            let (camera, size) = (photograph.camera(&views.cameras[view])?, photograph.size());
            let mut sight = SeenView::new(views, view, Some(photograph), camera, size);
            let step = size.0.max(size.1).div_ceil(MOST_DEPTHS).max(1);
            let size = (size.1.div_ceil(step) as usize, size.0.div_ceil(step) as usize);
            let coarse = cameras::scaled(&camera, [1.0 / f64::from(step); 2])?;
            let frame = renderer.render(&scene, &[coarse], &sized(&settings, size, 1))?;
            (sight.depths, sight.step) = (frame.depth()?.clone(), f64::from(step));
            Ok(sight)
        };
        Ok(Self(views.photographs.iter().enumerate().map(sight).collect::<Result<_>>()?))
    }

    /// The median length of the pictures' pixels at a point.
    pub fn pixel(&self, point: DVec3) -> f64 {
        cameras::pixel(&self.0.iter().map(|sight| sight.camera).collect::<Vec<_>>(), point, (1, 1))
    }

    /// The colour that a view shows of a point, and the cosine between the normal there and the direction to the camera; `None` where
    /// it does not see the point, or shows of its colour only how bright it is at least.
    pub fn by(&self, view: usize, point: DVec3, normal: DVec3) -> Option<(DVec3, f64)> {
        let sight = &self.0[view];
        let (place, cosine) = sight.place(point, normal)?;
        let color = sight.color(place)?;
        color.is_finite().then_some((color, cosine))
    }

    /// Those of some views that see a point, the most squarely first.
    pub fn views(&self, some: &[usize], point: DVec3, normal: DVec3) -> Vec<usize> {
        let cosine = |view: &usize| Some((*view, self.by(*view, point, normal)?.1));
        let mut seen: Vec<(usize, f64)> = some.iter().filter_map(cosine).collect();
        seen.sort_by(|a, b| b.1.total_cmp(&a.1));
        seen.into_iter().map(|(view, _)| view).collect()
    }

    /// The colour of a point by those of some views that see it most squarely; `None` where none sees it.
    pub fn color(&self, some: &[usize], point: DVec3, normal: DVec3) -> Option<DVec3> {
        let seen = some.iter().filter_map(|view| self.by(*view, point, normal));
        // A high power selects views, and blends those that are nearly equal.
        let weighted = seen.map(|(color, cosine)| (cosine.powi(8) * color, cosine.powi(8)));
        let (sum, weight) = weighted.reduce(|a, b| (a.0 + b.0, a.1 + b.1))?;
        Some(sum / weight)
    }

    /// The mesh with the colours that some views show of its vertices.
    pub fn painted(&self, mesh: Mesh, some: &[usize]) -> Result<Mesh> {
        let Appearance::VertexColors(colors) = mesh.appearance() else { return Ok(mesh) };
        let surface = points(&mesh).into_par_iter().zip(normals(&mesh)).zip(colors);
        let one = |((point, normal), color): ((DVec3, DVec3), &[f32; 3])| {
            self.color(some, point, normal).map_or(*color, |shown| shown.as_vec3().to_array())
        };
        let colors = on_all_cores(|| surface.map(one).collect());
        mesh.with_appearance(Appearance::VertexColors(colors))
    }

    /// The mesh where each vertex that none of some views sees has the mean colour of its neighbours. A part of which no vertex is seen
    /// keeps its colours.
    pub fn spread(&self, mesh: Mesh, some: &[usize]) -> Result<Mesh> {
        let Appearance::VertexColors(colors) = mesh.appearance() else { return Ok(mesh) };
        let (topology, mut colors) = (Topology::of(&mesh)?, doubles(colors));
        let is_seen = |(point, normal)| some.iter().any(|view| self.0[*view].place(point, normal).is_some());
        let surface = points(&mesh).into_par_iter().zip(normals(&mesh));
        let seen: Vec<bool> = on_all_cores(|| surface.map(is_seen).collect());
        let mut known = seen.clone();
        for _ in 0..ROUNDS {
            let (before, reached) = (colors.clone(), known.clone());
            for vertex in (0..seen.len()).filter(|vertex| !seen[*vertex]) {
                let around = topology.neighbors(vertex).iter().map(|n| *n as usize).filter(|n| reached[*n]);
                let (sum, count) = around.fold((DVec3::ZERO, 0usize), |(sum, count), n| (sum + before[n], count + 1));
                if count > 0 {
                    (colors[vertex], known[vertex]) = (sum / count as f64, true);
                }
            }
        }
        mesh.with_appearance(Appearance::VertexColors(singles(&colors)))
    }
}

/// A mesh and settings whose depths are those of its surface.
fn depths_of(mesh: &Mesh, settings: &Settings) -> Result<(Scene, Settings)> {
    let outputs = Outputs { depth: true, ..Outputs::NOTHING };
    let scene = Scene::new(mesh.clone().with_appearance(Appearance::Uniform([1.0; 3]))?);
    Ok((scene, Settings { outputs, sigma: 1e-7, gamma: 1e-5, ..settings.clone() }))
}

impl<'a> SeenView<'a> {
    fn new(
        views: &'a Views,
        view: usize,
        photograph: Option<&'a Photograph>,
        camera: Camera,
        size: (u32, u32),
    ) -> Self {
        let eye = camera.matrix().inverse().transform_point3(DVec3::ZERO);
        let depths = Image { batch: 0, height: 0, width: 0, channels: 1, data: Vec::new() };
        Self { views, view, photograph, camera, eye, size, depths, step: 1.0 }
    }

    /// The column and the row where the view sees a point, and the cosine; `None` where something is before it or the picture's border or
    /// outline is near.
    fn place(&self, point: DVec3, normal: DVec3) -> Option<((f64, f64), f64)> {
        let cosine = normal.dot((self.eye - point).normalize_or_zero());
        if cosine < LEAST_COSINE {
            return None;
        }
        let [column, row, depth] = self.camera.project(point, self.size)?;
        let pixel = self.step * self.pixel(point, depth);
        let nearest = depth_at(&self.depths, 0, column / self.step, row / self.step, STEP * pixel)?;
        let is_inside = self.silhouette((column, row)) >= COVERED && self.is_object(point);
        (is_inside && depth - nearest <= BEHIND * pixel / cosine).then_some(((column, row), cosine))
    }

    /// The length of a pixel at a point.
    fn pixel(&self, point: DVec3, depth: f64) -> f64 {
        let right = self.camera.axes()[0].normalize_or_zero();
        let step = 1e-3 * depth;
        let column = |point: DVec3| self.camera.project(point, self.size).map(|place| place[0]);
        let columns = column(point + step * right).zip(column(point)).map_or(0.0, |(a, b)| (a - b).abs());
        if columns > 0.0 { step / columns } else { 0.0 }
    }

    /// A channel of the picture at a place.
    fn channel(&self, k: usize, place: (f64, f64)) -> Option<f64> {
        // A value below 0 is only a bound, and so is a mean with it.
        let known = |value: f32| if value < 0.0 { f64::NAN } else { f64::from(value) };
        let size = (self.size.0 as usize, self.size.1 as usize);
        if let Some(photograph) = self.photograph {
            return Some(between(size, place, |row, column| known(photograph.pixel(column as u32, row as u32)[k])));
        }
        let (image, channel) =
            if k < 3 { (self.views.color.as_ref()?, k) } else { (self.views.silhouette.as_ref()?, 0) };
        Some(between(size, place, |row, column| known(image.pixel(self.view, row, column)[channel])))
    }

    fn color(&self, place: (f64, f64)) -> Option<DVec3> {
        Some(DVec3::new(self.channel(0, place)?, self.channel(1, place)?, self.channel(2, place)?))
    }

    fn silhouette(&self, place: (f64, f64)) -> f64 {
        self.channel(3, place).unwrap_or(1.0)
    }

    /// Whether the view's mask has the point where its photograph's may not: masks were mended and narrowed in the views alone.
    fn is_object(&self, point: DVec3) -> bool {
        let Some(mask) = self.views.silhouette.as_ref().filter(|_| self.photograph.is_some()) else { return true };
        let place = self.views.cameras[self.view].project(point, (mask.width as u32, mask.height as u32));
        place.is_some_and(|[column, row, _]| sample(mask, self.view, 0, column, row) > 0.5)
    }
}

/// For each vertex, a third of the area vectors of the triangles around it.
pub fn areas(mesh: &Mesh) -> Vec<DVec3> {
    let points = points(mesh);
    let mut areas = vec![DVec3::ZERO; points.len()];
    for corners in mesh.triangles() {
        let [a, b, c] = corners.map(|corner| points[corner as usize]);
        corners.iter().for_each(|corner| areas[*corner as usize] += (b - a).cross(c - a) / 6.0);
    }
    areas
}

/// The unit normals of a mesh's vertices, by the areas of the triangles around them.
pub fn normals(mesh: &Mesh) -> Vec<DVec3> {
    areas(mesh).into_iter().map(DVec3::normalize_or_zero).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::panic)]
mod tests {
    use super::*;
    use softras::{Projection, RendererOptions};

    #[test]
    fn a_bound_is_no_colour_and_mixes_with_none() {
        // A square that is larger than the picture, with a vertex in each half of it.
        let places = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-0.5, 0.0], [0.5, 0.0]];
        let places = places.map(|[x, y]| [x, y, 0.0]).to_vec();
        let triangles = vec![[0, 1, 5], [0, 5, 4], [1, 2, 5], [2, 3, 4], [2, 4, 5], [3, 0, 4]];
        let mesh = Mesh::new(places, triangles).unwrap();
        let eye = DVec3::new(0.0, 0.0, 4.0);
        let camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Y, Projection::Perspective { fov_y: 0.4 }).unwrap();
        // White in the left half of the picture, known in the right one.
        let data = (0..16 * 16).flat_map(|i| [if i % 16 < 8 { -0.7 } else { 0.9 }; 3]).collect();
        let color = Some(Image { batch: 1, height: 16, width: 16, channels: 3, data });
        let views = Views { cameras: vec![camera], color, ..Views::default() };
        let mut renderer = Renderer::with_options(&RendererOptions::default()).unwrap();
        let settings = Settings { near: 1.0, far: 10.0, ..Settings::default() };
        let seen = Seen::of(&mesh, &views, &settings, &mut renderer).unwrap();
        let shown = |x: f64| seen.by(0, DVec3::new(x, 0.03, 0.0), DVec3::Z).map(|(color, _)| color.x as f32);
        assert_eq!([-0.6, -0.03, 0.03, 0.6].map(shown), [None, None, None, Some(0.9)]);
        // The vertex in the white half is seen, and keeps its colour.
        let colors = Appearance::VertexColors(vec![[0.0; 3], [0.0; 3], [0.0; 3], [0.0; 3], [0.7; 3], [0.2; 3]]);
        let mesh = seen.spread(mesh.with_appearance(colors).unwrap(), &[0]).unwrap();
        let Appearance::VertexColors(colors) = mesh.appearance() else { panic!("no colours") };
        assert_eq!(colors[4..], [[0.7; 3], [0.2; 3]]);
        assert!(colors[..4].iter().all(|color| color[0] > 0.1), "{colors:?}");
    }
}
