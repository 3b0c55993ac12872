//! The rotation and translation of a mesh from one image of it.

use crate::arrays::{image, vector};
use crate::camera::Camera;
use crate::exceptions::{Raise, bad_input};
use crate::mesh::Mesh;
use crate::renderer::Renderer;
use crate::settings;
use pyo3::prelude::*;
use softras::fit::{Pose, PoseFit, PoseOptions, PoseTarget, Schedule, rotations};
use softras::glam::{DMat3, DQuat, DVec3};
use softras::internals::fit::is_closed;
use softras::scene::Faces;
use softras::{Image, Scene, Settings};

/// σ and γ of the final comparison of poses.
const SHARP: (f64, f64) = (1e-5, 1e-3);
/// The step length of a translation as a share of the mesh's radius, for one radian of rotation.
const SHIFT: f64 = 0.15;

/// The arguments of a search, all of which `softras.pose` gives.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Plan<'py> {
    color: Bound<'py, PyAny>,
    silhouette: Bound<'py, PyAny>,
    starts: usize,
    steps: usize,
    translate: bool,
    center: Option<Bound<'py, PyAny>>,
    settings: Option<Bound<'py, PyAny>>,
    start: Option<(Bound<'py, PyAny>, Bound<'py, PyAny>)>,
}

/// Rotation, translation, centre and loss.
type Found = ([[f64; 3]; 3], [f64; 3], [f64; 3], f64);

/// The image of one view, once for each pose.
fn repeated(value: &Bound<'_, PyAny>, name: &str, channels: usize, count: usize) -> PyResult<Image> {
    let one = image(value, name, channels)?;
    if one.batch != 1 {
        return Err(bad_input(format!("{name} has {} views", one.batch), "a pose is found from one"));
    }
    Ok(Image { batch: count, data: one.data.repeat(count), ..one })
}

/// The options that refine a pose: small steps and little blur, which do not lead away from it.
fn refining(options: PoseOptions) -> PoseOptions {
    PoseOptions {
        sigma: Schedule::Exponential { from: 5e-4, to: 1e-5 },
        gamma: Schedule::Exponential { from: 1e-1, to: 3e-2 },
        blur: Schedule::Exponential { from: 0.05, to: 0.005 },
        silhouette: Schedule::Exponential { from: 0.3, to: 1.0 },
        rate: Schedule::Exponential { from: 0.03, to: 0.002 },
        ..options
    }
}

/// Whether the mesh is closed and its triangles face outwards.
fn is_solid(mesh: &softras::Mesh) -> softras::Result<bool> {
    let corner = |i: u32| DVec3::from(mesh.positions()[i as usize].map(f64::from));
    let volume: f64 = mesh.triangles().iter().map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2])))).sum();
    Ok(is_closed(mesh)? && volume > 0.0)
}

/// Near and far around the mesh in any rotation, with room for a translation.
fn depths(mesh: &softras::Mesh, camera: &Camera, center: DVec3) -> (f64, f64) {
    let used = mesh.triangles().iter().flatten().map(|&i| DVec3::from(mesh.positions()[i as usize].map(f64::from)));
    let reach = 1.4 * used.map(|p| p.distance(center)).fold(1e-9, f64::max);
    let [x, y, z, shift] = camera.camera.view()[2];
    let depth = DVec3::new(x, y, z).dot(center) + shift;
    let far = (depth + reach).max(reach);
    ((depth - reach).max(1e-2 * far), far)
}

impl Plan<'_> {
    fn poses(&self) -> PyResult<Vec<Pose>> {
        let Some((rotation, translation)) = &self.start else {
            let all = rotations(self.starts.clamp(1, 1024));
            return Ok(all.into_iter().map(|rotation| Pose { rotation, ..Pose::IDENTITY }).collect());
        };
        let rows = crate::arrays::matrix::<3, 3>(rotation, "rotation")?;
        let turn = DMat3::from_cols_array_2d(&rows).transpose();
        if !((turn * turn.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-4) && turn.determinant() > 0.0) {
            return Err(bad_input("start's rotation is none", "give an orthogonal matrix of determinant 1"));
        }
        let translation = DVec3::from_array(vector(translation, "translation")?);
        Ok(vec![Pose { rotation: DQuat::from_mat3(&turn), translation }])
    }

    /// The fit and its targets.
    fn fit(&self, mesh: &Mesh, camera: &Camera) -> PyResult<(PoseFit, PoseTarget, DVec3)> {
        let Some((low, high)) = mesh.mesh.bounds() else {
            return Err(bad_input("a mesh without triangles", "give one that can be seen"));
        };
        let [low, high] = [low, high].map(|corner| DVec3::from(corner.map(f64::from)));
        let given = self.center.as_ref().map(|center| vector(center, "center").map(DVec3::from_array));
        let center = given.unwrap_or(Ok((low + high) / 2.0))?;
        let poses = self.poses()?;
        let color = repeated(&self.color, "color", 3, poses.len())?;
        let silhouette = repeated(&self.silhouette, "silhouette", 1, poses.len())?;
        let (solid, scene) = (is_solid(&mesh.mesh).raise()?, Scene::new(mesh.mesh.clone()));
        let mut settings = settings::settings(self.settings.as_ref())?;
        if self.settings.is_none() {
            let faces = if solid { Faces::Front } else { Faces::Both };
            let (near, far) = depths(&mesh.mesh, camera, center);
            settings = Settings { faces, near, far, ..settings };
        }
        (settings.width, settings.height) = (color.width as u32, color.height as u32);
        let base = if solid { PoseOptions::default() } else { PoseOptions::both_sides() };
        let shift = if self.translate { SHIFT * (high - low).length() / 2.0 } else { 0.0 };
        let options = PoseOptions { iterations: self.steps, translation_rate: shift, ..base };
        let options = if self.start.is_some() { refining(options) } else { options };
        let target = PoseTarget::new(color, silhouette).raise()?;
        let fit = PoseFit::new(scene, camera.camera, center, settings, options, poses).raise()?;
        Ok((fit, target, center))
    }
}

#[pyfunction]
pub fn pose<'py>(
    py: Python<'py>,
    mesh: &Mesh,
    camera: &Camera,
    renderer: &Renderer,
    plan: Plan<'py>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Found> {
    let (mut fit, target, center) = plan.fit(mesh, camera)?;
    let shared = &renderer.shared;
    for step in 0..plan.steps {
        let losses = shared.call(py, |renderer| fit.step(renderer, &target))?;
        py.check_signals()?;
        if let Some(progress) = &progress {
            progress.call1((step + 1, losses.into_iter().fold(f64::INFINITY, f64::min)))?;
        }
    }
    // The reported loss is that of plain colours, which is easier to interpret.
    let plain = target.plain();
    let losses = shared.call(py, |renderer| fit.losses(renderer, fit.poses(), SHARP, &plain))?;
    let best = fit.poses().iter().zip(losses).min_by(|a, b| a.1.total_cmp(&b.1));
    let Some((best, loss)) = best else { return Err(bad_input("no pose to start from", "give at least one")) };
    let rows = DMat3::from_quat(best.rotation).transpose().to_cols_array_2d();
    Ok((rows, best.translation.to_array(), center.to_array(), loss))
}
