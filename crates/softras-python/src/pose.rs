//! The rotation and translation of a mesh from one image of it.

use crate::arrays::{image, vector};
use crate::camera::Camera;
use crate::exceptions::{Raise, bad_input};
use crate::mesh::Mesh;
use crate::renderer::Renderer;
use crate::settings;
use pyo3::prelude::*;
use softras::Settings;
use softras::glam::{DMat3, DQuat, DVec3};
use softras_fit::{Pose, PoseSearch};

/// The arguments of a search, all of which `softras.pose` gives.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct PoseArguments<'py> {
    color: Bound<'py, PyAny>,
    silhouette: Bound<'py, PyAny>,
    starts: usize,
    steps: usize,
    translate: bool,
    center: Option<Bound<'py, PyAny>>,
    settings: Option<Bound<'py, PyAny>>,
    start: Option<(Bound<'py, PyAny>, Bound<'py, PyAny>)>,
}

/// Rotation, translation, centre, loss, and how many poses are equally good.
type FoundPose = ([[f64; 3]; 3], [f64; 3], [f64; 3], f64, usize);

/// Near and far around the mesh in any rotation, with room for a translation.
fn depths(mesh: &softras::Mesh, camera: &Camera, center: DVec3) -> (f64, f64) {
    let used = mesh.triangles().iter().flatten().map(|&i| DVec3::from(mesh.positions()[i as usize].map(f64::from)));
    let reach = 1.4 * used.map(|p| p.distance(center)).fold(1e-9, f64::max);
    let depth = camera.camera.to_view(center).z;
    let far = (depth + reach).max(reach);
    ((depth - reach).max(1e-2 * far), far)
}

impl PoseArguments<'_> {
    /// The pose that is refined, if one is given.
    fn start(&self) -> PyResult<Option<Pose>> {
        let Some((rotation, translation)) = &self.start else { return Ok(None) };
        let rows = crate::arrays::matrix::<3, 3>(rotation, "rotation")?;
        let turn = DMat3::from_cols_array_2d(&rows).transpose();
        if !((turn * turn.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-4) && turn.determinant() > 0.0) {
            return Err(bad_input("start's rotation is none", "give an orthogonal matrix of determinant 1"));
        }
        let translation = DVec3::from_array(vector(translation, "translation")?);
        Ok(Some(Pose { rotation: DQuat::from_mat3(&turn), translation }))
    }

    /// The point that rotations turn about.
    fn center(&self, mesh: &Mesh) -> PyResult<DVec3> {
        if let Some(center) = &self.center {
            return vector(center, "center").map(DVec3::from_array);
        }
        let Some((low, high)) = mesh.mesh.bounds() else {
            return Err(bad_input("a mesh without triangles", "give one that can be seen"));
        };
        Ok((DVec3::from(low.map(f64::from)) + DVec3::from(high.map(f64::from))) / 2.0)
    }

    fn search(&self, mesh: &Mesh, camera: &Camera, center: DVec3) -> PyResult<PoseSearch> {
        let color = image(&self.color, "color", 3, "picture")?;
        let silhouette = image(&self.silhouette, "silhouette", 1, "mask")?;
        let mut settings = settings::settings(self.settings.as_ref())?;
        if self.settings.is_none() {
            let (near, far) = depths(&mesh.mesh, camera, center);
            settings = Settings { near, far, ..settings };
        }
        let search = PoseSearch::new(mesh.mesh.clone(), camera.camera, center, settings, color, silhouette).raise()?;
        let search = search.with(self.starts, self.steps);
        let search = if self.translate { search } else { search.without_translation() };
        match self.start()? {
            Some(pose) => search.refining(pose).raise(),
            None => Ok(search),
        }
    }
}

#[pyfunction]
pub fn pose<'py>(
    py: Python<'py>,
    mesh: &Mesh,
    camera: &Camera,
    renderer: &Renderer,
    plan: PoseArguments<'py>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<FoundPose> {
    let center = plan.center(mesh)?;
    let mut search = plan.search(mesh, camera, center)?;
    let mut step = 0;
    while let Some(loss) = renderer.shared.call(py, |renderer| search.step(renderer))? {
        step += 1;
        py.check_signals()?;
        if let Some(progress) = &progress {
            progress.call1((step, loss))?;
        }
    }
    let Some((best, loss)) = search.found().first() else {
        return Err(bad_input("no pose was found", "give a picture that shows the mesh"));
    };
    let rows = DMat3::from_quat(best.rotation).transpose().to_cols_array_2d();
    Ok((rows, best.translation.to_array(), center.to_array(), *loss, search.equally_good()))
}
