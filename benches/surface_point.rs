//! Where a triangle is sampled outside itself: `cargo bench --bench surface_point`.
//!
//! For both surface points it measures, over the pixels of a picture that are no outline, the share whose depth differs
//! from a hard renderer's by more than 5 % of the range, and the error of colour against a hard renderer of 16 times
//! the samples. Then how rough the gradient is, and the time of forward and backward, nearest over clip.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod subject;

use softras::scene::{ColorAggregation, Interpolation, Outputs, SurfacePoint};
use softras::{Camera, GradientRequest, Mesh, Projection, Renderer, Scene, Settings, shapes};
use softras_check::measure::subject::{DISTANCE, FOV, camera, framed, scene, settings};
use softras_check::measure::time::{median, times, upstream};
use softras_check::measure::{Mode, needles};

const SIZE: u32 = 256;
/// The share of the range of depths from which a depth is wrong.
const WRONG: f32 = 0.05;
/// Steps of the path along which gradients are compared, and its length in pixels.
const STEPS: u32 = 64;
const PATH: f32 = 4.0;

fn main() {
    let mut renderer = Renderer::new().expect("a Vulkan device");
    let mut meshes: Vec<(String, Mesh)> = Vec::new();
    for name in ["spot", "bunny", "fandisk"] {
        let (found, mesh) = subject::mesh(name);
        if found == name {
            meshes.push((found, mesh));
        }
    }
    meshes.push(("fish".into(), shapes::fish().expect("a mesh")));
    meshes.extend(needles::kinds().expect("meshes").map(|(name, mesh)| (name.to_string(), mesh)));
    println!("{:>10} {:^17} {:^17} {:^17} {:>9}", "", "wrong depth", "error of color", "roughness", "time");
    println!(
        "{:>10} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>9}",
        "", "clip", "nearest", "clip", "nearest", "clip", "nearest", "ratio"
    );
    for (name, mesh) in &meshes {
        let view = view_of(name);
        let of = |surface_point| Settings { surface_point, ..picture() };
        let both = [of(SurfacePoint::Clip), of(SurfacePoint::Nearest)];
        let errors = both.each_ref().map(|s| errors(&mut renderer, mesh, &view, s));
        let rough = both.each_ref().map(|s| roughness(&mut renderer, mesh, &view, s));
        let scene = scene(mesh).expect("a scene");
        let ratios = (0..7).map(|_| {
            let [clip, nearest] = [SurfacePoint::Clip, SurfacePoint::Nearest].map(|surface_point| {
                let s = Mode::ColorSilhouette.of(&Settings { surface_point, ..settings(SIZE) });
                times(&mut renderer, &scene, &[view], &s, Mode::ColorSilhouette, 8).expect("frames").frame
            });
            nearest / clip
        });
        let ratio = median(ratios.collect());
        println!(
            "{name:>10} {:>8.4} {:>8.4} {:>8.4} {:>8.4} {:>8.3} {:>8.3} {ratio:>9.2}",
            errors[0][0], errors[1][0], errors[0][1], errors[1][1], rough[0], rough[1]
        );
    }
}

/// Seen from the front, the needle's far end lies beside the plate.
fn view_of(name: &str) -> Camera {
    let front = || Camera::from_angles(DISTANCE, 0.0, 0.0, Projection::Perspective { fov_y: FOV.to_radians() });
    if name == "sliver" { front() } else { camera(30.0) }.expect("a camera")
}

/// A picture: a triangle reaches one and a half pixels beyond its edges.
fn picture() -> Settings {
    let s = Settings { near: 1.0, far: 5.0, gamma: 3e-6, interpolation: Interpolation::Perspective, ..settings(SIZE) };
    Settings { outputs: Outputs { normal: false, ..Outputs::ALL }, ..s }.with_blur_pixels(1.5)
}

/// The share of wrong depths, and the root of the mean squared error of colour.
fn errors(renderer: &mut Renderer, mesh: &Mesh, view: &Camera, soft: &Settings) -> [f64; 2] {
    let scene = scene(mesh).expect("a scene");
    let hard = Settings { color: ColorAggregation::Hard, ..soft.clone() };
    let fine = Settings { width: 4 * SIZE, height: 4 * SIZE, ..hard.clone() };
    let [soft, hard, fine] = [soft, &hard, &fine].map(|s| renderer.render(&scene, &[*view], s).expect("a frame"));
    let (size, depths) = (SIZE as usize, hard.depth().expect("depths"));
    let depth = |row: usize, column: usize| depths.pixel(0, row, column)[0];
    let seen = || depths.data.iter().copied().filter(|z| *z > 0.0);
    let range = seen().fold(0.0, f32::max) - seen().fold(f32::INFINITY, f32::min);
    let (mut count, mut wrong, mut squares) = (0.0, 0.0, 0.0);
    for at in 0..size * size {
        let (row, column) = (at / size, at % size);
        let around = |x: usize| x.saturating_sub(2)..(x + 3).min(size);
        let near = || around(row).flat_map(|r| around(column).map(move |c| depth(r, c)));
        let least = near().fold(f32::INFINITY, f32::min);
        if least <= 0.0 || near().fold(0.0, f32::max) - least > WRONG * range {
            continue;
        }
        let z = soft.depth().expect("depths").pixel(0, row, column)[0];
        count += 1.0;
        wrong += f64::from(u8::from((z - depth(row, column)).abs() > WRONG * range));
        for k in 0..3 {
            let sample = |i: usize| fine.color().expect("colors").pixel(0, 4 * row + i / 4, 4 * column + i % 4)[k];
            let exact = (0..16).map(sample).sum::<f32>() / 16.0;
            squares += f64::from(soft.color().expect("colors").pixel(0, row, column)[k] - exact).powi(2);
        }
    }
    [wrong / count, (squares / (3.0 * count)).sqrt()]
}

/// How far a gradient by positions turns from step to step where the mesh moves sideways, as a share of its length.
fn roughness(renderer: &mut Renderer, mesh: &Mesh, view: &Camera, soft: &Settings) -> f64 {
    let soft = Settings { save: true, outputs: Mode::ColorSilhouette.outputs(), ..soft.clone() };
    let (upstream, mesh) = (upstream(Mode::ColorSilhouette, 1, &soft), framed(mesh).expect("a mesh"));
    let (mut last, mut turns) = (Vec::<f64>::new(), Vec::new());
    for step in 0..=STEPS {
        let along = PATH * 1.4 / SIZE as f32 * step as f32 / STEPS as f32;
        let mut moved = mesh.clone();
        let positions = mesh.positions().iter().map(|p| [p[0] + along, p[1], p[2]]).collect();
        moved.set_positions(positions).expect("finite positions");
        let frame = renderer.render(&Scene::new(moved), &[*view], &soft).expect("a frame");
        let gradients = renderer.backward(&frame, &upstream, &GradientRequest::default()).expect("gradients");
        let by = &gradients.meshes[0].positions;
        let now: Vec<f64> = by.iter().flatten().map(|x| f64::from(*x)).collect();
        let length = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        if !last.is_empty() {
            let turn: Vec<f64> = now.iter().zip(&last).map(|(a, b)| a - b).collect();
            turns.push(length(&turn) / length(&now));
        }
        last = now;
    }
    median(turns)
}
