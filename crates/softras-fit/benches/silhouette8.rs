//! Eight silhouettes of the bunny, 128², fitted by a sphere of 1280 faces in 150 steps: `cargo bench --bench silhouette8`.
//!
//! The task is read from `../shared/silhouette8/task.npz`; another Vulkan rasterizer has published its figures for it.
//! Without that file the benchmark prints a message and ends. Time is the median of steps 21 to 150, each a whole step:
//! eight views forward, loss, backward, regularisers, optimiser. Score is the IoU of the hard masks. Machines are noisy:
//! compare within one run.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use glam::DVec3;
use softras::scene::{Outputs, SilhouetteAggregation};
use softras::{Camera, GradientRequest, Image, ImageGradient, Mesh, Projection, Renderer, Scene, Settings};
use softras_check::measure::time::median;
use softras_fit::{
    CLOSED, ImageLoss, Method, Optimizer, Regularizer, Topology, laplacian_coordinates, mask_iou, soft_target,
};
use softras_io::npz;
use std::path::Path;
use std::time::Instant;

const STEPS: usize = 150;
const SIGMA: f64 = 1e-4;

fn main() {
    let folders = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors();
    let Some(path) = folders.map(|folder| folder.join("shared/silhouette8/task.npz")).find(|path| path.is_file())
    else {
        println!("skipped: there is no shared/silhouette8/task.npz in a folder above");
        return;
    };
    let task = Task::read(&path);
    let mut renderer = Renderer::new().expect("a Vulkan device");
    println!("8 views of 128², {} triangles, on {}", task.topology.triangles().len(), renderer.device_name());
    let soft = soft_target(&task.targets, SIGMA, CLOSED).expect("soft targets");
    for (name, targets) in [("masks", &task.targets), ("targets as soft as a closed surface", &soft)] {
        println!("the task's own regularisers and optimiser, sigma 1e-4, against {name}:");
        let mut times = Times::default();
        let mesh = task.fit(targets, &mut renderer, &mut times);
        let (step, score) = (median(times.step[20..].to_vec()), task.score(&mesh, &mut renderer));
        println!("  step {step:.2} ms (median of steps 21 to {STEPS}); mask IoU {score:.4}");
        let part = |name: &str, values: &[f64]| println!("    {name:<32} {:>7.2} ms", median(values[20..].to_vec()));
        part("forward, wall", &times.forward);
        part("loss", &times.loss);
        part("backward, wall", &times.backward);
        part("regularisers, optimiser", &times.host);
    }
}

#[derive(Default)]
struct Times {
    step: Vec<f64>,
    forward: Vec<f64>,
    loss: Vec<f64>,
    backward: Vec<f64>,
    host: Vec<f64>,
}

struct Task {
    cameras: Vec<Camera>,
    targets: Image,
    start: Mesh,
    topology: Topology,
}

impl Task {
    fn read(path: &Path) -> Self {
        let numbers = |key: &str| -> Vec<f64> {
            npz::read(path, key).expect("an array of the task").numbers().expect("numbers").iter().collect()
        };
        let floats = |key: &str| -> Vec<f32> { numbers(key).into_iter().map(|x| x as f32).collect() };
        let (positions, targets, eyes) = (floats("init_pos"), floats("target_masks"), floats("eye"));
        let faces = numbers("init_faces");
        let projection = Projection::Perspective { fov_y: 45f64.to_radians() };
        let camera = |eye: &[f32]| {
            let eye = DVec3::new(eye[0].into(), eye[1].into(), eye[2].into());
            Camera::look_at(eye, DVec3::ZERO, DVec3::Y, projection).unwrap()
        };
        let triangles: Vec<[u32; 3]> = faces.chunks_exact(3).map(|f| [f[0], f[1], f[2]].map(|i| i as u32)).collect();
        let positions: Vec<[f32; 3]> = positions.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
        Self {
            cameras: eyes.chunks_exact(3).map(camera).collect(),
            targets: Image { batch: 8, height: 128, width: 128, channels: 1, data: targets },
            topology: Topology::new(positions.len(), &triangles).unwrap(),
            start: Mesh::new(positions, triangles).unwrap(),
        }
    }

    fn settings() -> Settings {
        let outputs = Outputs::SILHOUETTE;
        Settings { width: 128, height: 128, near: 0.1, far: 10.0, sigma: SIGMA, outputs, ..Settings::default() }
    }

    fn fit(&self, targets: &Image, renderer: &mut Renderer, times: &mut Times) -> Mesh {
        let settings = Settings { save: true, ..Self::settings() };
        let mut scene = Scene::new(self.start.clone());
        let mut values: Vec<f64> = self.start.positions().as_flattened().iter().map(|&x| f64::from(x)).collect();
        let mut optimizer = Optimizer::new(Method::ADAM, values.len());
        for _ in 0..STEPS {
            let start = Instant::now();
            let mut last = start;
            let mut lap = |into: &mut Vec<f64>| {
                into.push(last.elapsed().as_secs_f64() * 1e3);
                last = Instant::now();
            };
            let frame = renderer.render(&scene, &self.cameras, &settings).expect("a frame");
            lap(&mut times.forward);
            // The task's loss is the sum over views of the mean over pixels.
            let mut loss = ImageLoss::L2.evaluate(frame.silhouette().unwrap(), targets, None).unwrap();
            loss.gradient.data.iter_mut().for_each(|g| *g *= 8.0);
            lap(&mut times.loss);
            let upstream = ImageGradient::silhouette(loss.gradient);
            let gradients = renderer.backward(&frame, &upstream, &GradientRequest::default()).expect("gradients");
            lap(&mut times.backward);
            let gradient = self.regularized(&values, &gradients.meshes[0].positions);
            optimizer.step(&mut values, &gradient, 0.01);
            let positions = values.chunks_exact(3).map(|p| [p[0], p[1], p[2]].map(|x| x as f32)).collect();
            scene.meshes[0].set_positions(positions).expect("finite positions");
            lap(&mut times.host);
            times.step.push(start.elapsed().as_secs_f64() * 1e3);
        }
        scene.meshes.remove(0)
    }

    /// g + 0.15 rms(g)/rms(l) l + 0.4 rms(g)/rms(n) n, with l and n the gradients of the Laplacian and of the normal consistency.
    fn regularized(&self, values: &[f64], gradient: &[[f32; 3]]) -> Vec<f64> {
        let positions: Vec<DVec3> = values.chunks_exact(3).map(DVec3::from_slice).collect();
        let gradient: Vec<DVec3> = gradient.iter().map(|g| DVec3::from(g.map(f64::from))).collect();
        let laplacian = laplacian_coordinates(&self.topology, &positions);
        let mut normals = vec![DVec3::ZERO; positions.len()];
        Regularizer::NormalConsistency.add(&self.topology, &positions, 1.0, &mut normals).unwrap();
        let rms = |v: &[DVec3]| (v.iter().map(|x| x.length_squared()).sum::<f64>() / v.len() as f64).sqrt().max(1e-12);
        let (l, n) = (0.15 * rms(&gradient) / rms(&laplacian), 0.4 * rms(&gradient) / rms(&normals));
        let sum = |i: usize| gradient[i] + l * laplacian[i] + n * normals[i];
        (0..positions.len()).flat_map(|i| sum(i).to_array()).collect()
    }

    /// The mean IoU of the hard masks.
    fn score(&self, mesh: &Mesh, renderer: &mut Renderer) -> f64 {
        let settings = Settings { silhouette: SilhouetteAggregation::Hard, sigma: 1e-7, ..Self::settings() };
        let frame = renderer.render(&Scene::new(mesh.clone()), &self.cameras, &settings).expect("a frame");
        let ious = mask_iou(frame.silhouette().unwrap(), &self.targets).unwrap();
        ious.iter().sum::<f64>() / ious.len() as f64
    }
}
