//! Times frames for `benches/compare.py`, which builds this file against each of two commits.
//!
//! `frames MESH SIZE MODE VIEWS SIGMA`: MESH is a Wavefront OBJ file, a number of subdivisions of an icosahedron, or `fish`;
//! MODE is `silhouette` or `color+silhouette`. Prints `ready` after two frames that are not timed, then for each line of its
//! input, which holds a number of frames, a line with the wall time and the processors' time of each in milliseconds. As in
//! an optimisation, each frame's vertices differ from the last one's by a millionth. It uses only what the interface of
//! both commits has, so it cannot be part of the workspace.

use softras::scene::{Appearance, Outputs};
use softras::{Camera, Image, ImageGradient, Mesh, Projection, Renderer, Scene, Settings, GradientRequest, shapes};
use std::io::BufRead;
use std::time::Instant;

type Failure = Box<dyn std::error::Error>;

const DISTANCE: f64 = 2.732;
const ELEVATION: f64 = 30.0;
const FOV: f64 = 30.0;
const FILL: f64 = 0.7;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [mesh, size, mode, views, sigma] = &arguments[..] else {
        return Err("usage: frames MESH SIZE MODE VIEWS SIGMA".into());
    };
    let (size, views, color) = (size.parse()?, views.parse()?, mode == "color+silhouette");
    let mut work = Work::new(framed(&mesh_of(mesh)?)?, size, views, color, sigma.parse()?)?;
    work.frame(0)?;
    work.frame(1)?;
    println!("ready");
    for line in std::io::stdin().lock().lines() {
        let frames: usize = line?.trim().parse()?;
        let mut times = Vec::new();
        for frame in 0..frames {
            let (start, processors) = (Instant::now(), processor_time());
            work.frame(frame)?;
            let wall = start.elapsed().as_secs_f64() * 1e3;
            times.push(format!("{wall} {}", processor_time() - processors));
        }
        println!("{}", times.join(" "));
    }
    Ok(())
}

fn mesh_of(name: &str) -> Result<Mesh, Failure> {
    match name.parse() {
        Ok(subdivisions) => Ok(shapes::icosphere(subdivisions)?),
        Err(_) if name == "fish" => Ok(shapes::fish()?),
        Err(_) => triangles_of(&std::fs::read_to_string(name)?),
    }
}

/// The triangles of an OBJ file without polygons: the two commits have readers of different names.
fn triangles_of(text: &str) -> Result<Mesh, Failure> {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for line in text.lines() {
        match line.split_whitespace().collect::<Vec<_>>()[..] {
            ["v", x, y, z, ..] => positions.push([x.parse()?, y.parse()?, z.parse()?]),
            ["f", a, b, c] => {
                let index = |corner: &str| corner.split('/').next().unwrap_or_default().parse::<u32>().map(|i| i - 1);
                triangles.push([index(a)?, index(b)?, index(c)?]);
            }
            _ => {}
        }
    }
    Ok(Mesh::new(positions, triangles)?)
}

/// The mesh as `softras bench` places it: centred, filling [`FILL`] of the image's height.
fn framed(mesh: &Mesh) -> Result<Mesh, Failure> {
    let (low, high) = mesh.bounds().ok_or("a mesh without vertices")?;
    let middle = [0, 1, 2].map(|k| (f64::from(low[k]) + f64::from(high[k])) / 2.0);
    let size = f64::from(high[1]) - f64::from(low[1]);
    let scale = FILL * 2.0 * DISTANCE * (FOV / 2.0).to_radians().tan() / size;
    let place = |p: &[f32; 3]| [0, 1, 2].map(|k| ((f64::from(p[k]) - middle[k]) * scale) as f32);
    let positions: Vec<[f32; 3]> = mesh.positions().iter().map(place).collect();
    let colors = positions.iter().map(|p| p.map(|x| (x + 0.5).clamp(0.0, 1.0))).collect();
    Ok(Mesh::new(positions, mesh.triangles().to_vec())?.with_appearance(Appearance::VertexColors(colors))?)
}

struct Work {
    renderer: Renderer,
    scenes: [Scene; 2],
    cameras: Vec<Camera>,
    settings: Settings,
    upstream: ImageGradient,
    wanted: GradientRequest,
}

impl Work {
    fn new(mesh: Mesh, size: u32, views: u32, color: bool, sigma: f64) -> Result<Self, Failure> {
        let outputs = Outputs { color, silhouette: true, ..Outputs::NOTHING };
        let settings =
            Settings { width: size, height: size, sigma, gamma: 1e-4, save: true, outputs, ..Settings::default() };
        let fov_y = FOV.to_radians();
        let camera = |i: u32| {
            let azimuth = 360.0 * f64::from(i) / f64::from(views);
            Camera::from_angles(DISTANCE, ELEVATION, azimuth, Projection::Perspective { fov_y })
        };
        let cameras = (0..views).map(camera).collect::<Result<Vec<_>, _>>()?;
        let side = size as usize;
        let weights = |channels: usize| {
            let data = (0..views as usize * side * side * channels).map(|i| (i * 7919 % 1000) as f32 / 1000.0 - 0.5);
            Image { batch: views as usize, height: side, width: side, channels, data: data.collect() }
        };
        let upstream = ImageGradient {
            color: color.then(|| weights(3)),
            silhouette: Some(weights(1)),
            depth: None,
            normal: None,
        };
        let mut nudged = mesh.clone();
        nudged.set_positions(mesh.positions().iter().map(|p| p.map(|x| x * (1.0 + 1e-6))).collect())?;
        Ok(Self {
            renderer: Renderer::new()?,
            scenes: [Scene::new(mesh), Scene::new(nudged)],
            cameras,
            settings,
            upstream,
            wanted: GradientRequest { positions: true, colors: color, ..GradientRequest::NOTHING },
        })
    }

    /// One frame, forward and backward.
    fn frame(&mut self, index: usize) -> Result<(), Failure> {
        let frame = self.renderer.render(&self.scenes[index % 2], &self.cameras, &self.settings)?;
        self.renderer.backward(&frame, &self.upstream, &self.wanted)?;
        Ok(())
    }
}

/// Milliseconds that the threads of this process have run so far; NaN where Linux's `/proc` is not there.
fn processor_time() -> f64 {
    let ran = |thread: std::fs::DirEntry| -> Option<f64> {
        let text = std::fs::read_to_string(thread.path().join("schedstat")).ok()?;
        text.split(' ').next()?.parse::<f64>().ok()
    };
    match std::fs::read_dir("/proc/self/task") {
        Ok(threads) => threads.filter_map(|thread| ran(thread.ok()?)).sum::<f64>() * 1e-6,
        Err(_) => f64::NAN,
    }
}
