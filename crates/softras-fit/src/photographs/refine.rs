//! Cameras that are refined with the shape before a fit, where silhouettes or colours show that they are off.
//!
//! Each camera gets a rotation about the middle of the object and a translation, both in view space. They are moved together with a
//! mesh by the gradients of the same loss, at half the resolution first. A short trial there tells whether it is worth the time. A motion
//! that all cameras share would move the object and not the views, so that their mean rotation, translation and distance are kept.

use super::{
    cameras::{Sphere, scaled},
    exposure,
    subject::Subject,
    unseen::hard,
};
use crate::{
    ImageLoss, Method, Optimizer, Schedule, ShapeFit, ShapeOptions, evened, pooled,
    solid::hull::wide_hull,
    work::{Stage, Work},
};
use glam::{DMat3, DMat4, DVec3};
use softras::{
    Camera, CameraGradient, Image, Result, Scene, Settings, parts,
    scene::{Appearance, Background, Interpolation},
};
use softras_io::Views;

/// Pixels that the hull may lie within the masks, in the mean along their outlines and beyond what samples leave, where cameras are right.
const AGREED: f64 = 0.2;
/// Refined cameras are taken if at most this share of that distance is left and there are no colours.
const MOST_LEFT: f64 = 0.5;
/// All stages are worth their time if a trial leaves at most this share, or where its colours agree better. Of views whose cameras are off
/// by a degree it leaves less than a half, and two thirds or more of those whose masks are wrong and not their cameras.
const PROMISING: f64 = 0.6;
/// Refined cameras are taken if at most this share of the colours' disagreement is left: of masks as they were given, and of narrowed
/// ones, whose hull is less near to the object.
const MOST_COLORS_LEFT: [f64; 2] = [0.97, 0.88];
/// How much farther the hull may then lie within the masks, pixels.
const FARTHER: f64 = 0.05;
/// Views from which on a hull tells whether cameras are right.
const FEWEST: usize = 6;
/// The views that a trial takes of more. More would tell the same, and take longer.
const MOST_TRIED: usize = 36;
/// Tells whether refined cameras agree better, at half the resolution. The stages are as those below.
const TRIAL: [RefineStage; 2] = [
    RefineStage { shrink: 2, steps: 40, waits: 10, sigma: (3e-4, 1e-4), rate: (0.5, 0.1), edge: 3.0, turns: false },
    RefineStage { shrink: 2, steps: 120, waits: 15, sigma: (1e-4, 1e-5), rate: (0.3, 0.02), edge: 2.0, turns: true },
];
/// The first stage finds where each camera points. The effect of its turn about the object is seen only once the shape and the
/// colours are nearly right, so that turns are left to the second one.
const STAGES: [RefineStage; 2] = [
    RefineStage { shrink: 2, steps: 40, waits: 10, sigma: (3e-4, 1e-4), rate: (0.5, 0.1), edge: 3.0, turns: false },
    RefineStage { shrink: 1, steps: 140, waits: 25, sigma: (1e-4, 1e-5), rate: (0.3, 0.02), edge: 1.5, turns: true },
];
/// The pixels of all views beyond which the second stage is at half the resolution too: it would take longer than the fit.
const MANY_PIXELS: usize = 1_500_000;
/// The smallest side of a picture of fewer pixels.
const LEAST_SIDE: usize = 64;
/// How much larger the hull is that a stage begins with, as a multiple of the disagreement.
const SLACK: f64 = 1.5;
/// Step length of the mesh's vertices, in pixels of the pictures.
const RATE: f64 = 0.7;
/// The weight of the mean square of cameras' motions in pixels, which keeps what the views do not tell.
const PRIOR: f64 = 1e-5;
/// The weight of the loss of colours, and their step length.
const COLOR_WEIGHT: f64 = 5.0;
const COLOR_RATE: f64 = 0.03;

/// The stages for a number of views with this many pixels each.
fn stages(count: usize, pixels: usize) -> [RefineStage; 2] {
    let [first, second] = STAGES;
    let shrink = if count * pixels > MANY_PIXELS { 2 } else { second.shrink };
    [first, RefineStage { shrink, ..second }]
}

/// A part of the refinement.
struct RefineStage {
    /// Pixels of the pictures along a side of its pixels.
    shrink: usize,
    steps: usize,
    /// Steps of the mesh alone, before the cameras move.
    waits: usize,
    /// From the first to the last step.
    sigma: (f64, f64),
    /// Step length of the cameras in pixels of the pictures.
    rate: (f64, f64),
    /// Edges of its first mesh, in its pixels.
    edge: f64,
    /// Whether cameras turn about the object, or only shift.
    turns: bool,
}

/// How much views disagree.
#[derive(Clone, Copy)]
struct Disagreement {
    /// How far their hull lies within the silhouettes, pixels in the mean along the outlines, beyond what samples leave.
    masks: f64,
    /// How much the colours of the views differ on the hull; `None` without colours.
    colors: Option<f64>,
}

impl Disagreement {
    /// Whether cameras with this one are to be taken in place of those that were given.
    fn is_better(&self, given: &Self, is_narrowed: bool) -> bool {
        let most = MOST_COLORS_LEFT[usize::from(is_narrowed)];
        match (self.colors, given.colors) {
            (Some(after), Some(before)) => after <= most * before && self.masks <= given.masks + FARTHER,
            _ => self.masks <= MOST_LEFT * given.masks,
        }
    }

    /// Whether all stages are worth their time after a trial.
    fn is_promising(&self, given: &Self) -> bool {
        self.is_better(given, false) || self.masks <= PROMISING * given.masks
    }
}

/// Whether cameras of this many views of so many pixels may be refined at all, and if so the views of all steps, each as dear as one of a
/// fit's first steps: of a trial, and of what follows where it is promising.
pub fn views_of_steps(count: usize, pixels: usize) -> Option<[f64; 2]> {
    let of = |stages: &[RefineStage], count: usize| -> f64 {
        stages.iter().map(|stage| (stage.steps * count) as f64 / (stage.shrink * stage.shrink) as f64).sum()
    };
    (count >= FEWEST).then(|| [of(&TRIAL, count.min(MOST_TRIED)), of(&stages(count, pixels), count)])
}

/// Refines the cameras of views that do not agree, and notes by how much. Their masks may have been narrowed.
pub fn refined(subject: &mut Subject, is_narrowed: bool, work: &mut Work) -> Result<()> {
    let is_rigid = |camera: &Camera| camera.intrinsics((1, 1)).is_some();
    if subject.views.silhouette.is_none()
        || subject.views.cameras.len() < FEWEST
        || !subject.views.cameras.iter().all(is_rigid)
    {
        return Ok(());
    }
    work.begin(Stage::Cameras, TRIAL.iter().chain(&STAGES).map(|stage| stage.steps).sum::<usize>())?;
    let mut some = spread(subject);
    let Some(mut given) = measured(some.as_ref().unwrap_or(subject), work)? else { return Ok(()) };
    if given.beyond_samples.masks < AGREED && given.beyond_samples.colors.is_none() {
        return Ok(());
    }
    let trial = attempt(some.as_mut().unwrap_or(subject), &TRIAL, &given, work)?;
    let mut found = None;
    if trial.is_some_and(|trial| trial.left.is_promising(&given.beyond_samples)) {
        if some.is_some() {
            let Some(of_all) = measured(subject, work)? else { return Ok(()) };
            given = of_all;
        }
        // A trial alone may agree better by chance, as it does for six views whose cameras are right.
        let (height, width) = subject.views.size()?;
        let whole = attempt(subject, &stages(subject.views.cameras.len(), height * width), &given, work)?;
        found = whole.filter(|whole| whole.left.is_better(&given.beyond_samples, is_narrowed));
    }
    let before = given.beyond_samples;
    let Some(Refined { left: best, cameras, moved }) = found else {
        if before.masks >= AGREED {
            let off = before.masks;
            work.notes.push(format!("the hull lies {off:.1} pixels inside the silhouettes; cameras that were refined agree no better, and stay as given"));
        }
        return work.goes_on();
    };
    subject.views.cameras = cameras;
    let colors = best.colors.zip(before.colors);
    let colors = colors.map_or(String::new(), |(after, before)| {
        format!("; their colours differ by {after:.3} on it, before by {before:.3}")
    });
    work.notes.push(format!(
        "the cameras were off and are now refined: the object moved by {moved:.1} pixels (mean), and the hull lies {:.1} pixels inside the \
         silhouettes, before {:.1}{colors}",
        best.masks, before.masks
    ));
    work.goes_on()
}

/// Some of an object's many views, spread over all of them; `None` where there are few.
fn spread(subject: &Subject) -> Option<Subject> {
    let (views, count) = (&subject.views, subject.views.cameras.len());
    if count <= MOST_TRIED {
        return None;
    }
    let at = |i: usize| i * count / MOST_TRIED;
    let image = |image: &Option<Image>| image.as_ref().map(|image| image.views((0..MOST_TRIED).map(at)));
    let cameras = (0..MOST_TRIED).map(|i| views.cameras[at(i)]).collect();
    let (silhouette, color) = (image(&views.silhouette), image(&views.color));
    let views = Views { cameras, silhouette, color, ..Views::default() };
    Some(Subject { views, held_out: Vec::new(), truth: None, lights: subject.lights.clone(), ..*subject })
}

/// How much given views disagree.
struct Given {
    /// The part of the disagreement that is not due to samples, and that part of the masks.
    beyond_samples: Disagreement,
    by_samples: f64,
}

/// How much the views of an object disagree with the cameras that it has; `None` without a hull.
fn measured(subject: &Subject, work: &mut Work) -> Result<Option<Given>> {
    let Some((mut before, silhouette)) = disagreement(subject, &subject.views, work)? else { return Ok(None) };
    work.goes_on()?;
    // The silhouettes of a hull agree. Their part that its own hull leaves open is due to samples, as where the object is thin.
    let of_hull = Views { cameras: subject.views.cameras.clone(), silhouette: Some(silhouette), ..Views::default() };
    let by_samples = disagreement(subject, &of_hull, work)?.map_or(0.0, |(of_hull, _)| of_hull.masks);
    before.masks -= by_samples;
    Ok(Some(Given { beyond_samples: before, by_samples }))
}

/// Cameras that were refined.
struct Refined {
    /// How much their views still disagree.
    left: Disagreement,
    cameras: Vec<Camera>,
    /// How far they move the object's rim, pixels.
    moved: f64,
}

/// Refines the cameras of an object, which keeps its own; `None` where no hull is left.
fn attempt(subject: &mut Subject, stages: &[RefineStage], given: &Given, work: &mut Work) -> Result<Option<Refined>> {
    let cameras = subject.views.cameras.clone();
    let mut motions = Motions::new(&cameras, subject.bounds, subject.pixel);
    for stage in stages {
        if !stage.refine(&mut motions, subject, given.beyond_samples.masks.max(AGREED), work)? {
            return Ok(None);
        }
    }
    subject.views.cameras = motions.cameras(&cameras)?;
    let after = disagreement(subject, &subject.views, work);
    let cameras = std::mem::replace(&mut subject.views.cameras, cameras);
    Ok(after?.map(|(mut left, _)| {
        left.masks -= given.by_samples;
        Refined { left, cameras, moved: motions.mean() }
    }))
}

impl RefineStage {
    /// Moves the cameras of an object together with a mesh that begins as its hull, wider by the disagreement in pixels. Whether
    /// there is one.
    fn refine(&self, motions: &mut Motions, subject: &Subject, off: f64, work: &mut Work) -> Result<bool> {
        let given = &subject.views.cameras;
        let mut views = shrunk(&subject.views, self.shrink)?;
        let base = views.cameras.clone();
        views.cameras = motions.cameras(&base)?;
        let (center, side) = subject.cube();
        let (height, width) = views.size()?;
        let resolution = height.min(width).clamp(LEAST_SIDE, 96);
        let slack = SLACK * off * subject.pixel;
        let Ok(Some(start)) = wide_hull(&views, center, side, resolution, slack, &mut || work.goes_on()) else {
            return work.goes_on().map(|()| false);
        };
        let mut start = evened(&start, self.edge * subject.pixel * self.shrink as f64)?;
        if views.color.is_some() {
            let grey = vec![[0.5; 3]; start.positions().len()];
            start = start.with_appearance(Appearance::VertexColors(grey))?;
        }
        let options = ShapeOptions {
            fit_colors: views.color.is_some(),
            color: (ImageLoss::L1, COLOR_WEIGHT),
            ..ShapeOptions::smooth()
        };
        let mut shape = ShapeFit::new(start, subject.lights.clone(), options)?;
        let mut optimizer =
            Optimizer::new(Method::UniformAdam { betas: [0.9, 0.999], epsilon: 1e-12 }, motions.values.len());
        for step in 0..self.steps {
            let at = |range: (f64, f64)| Schedule::from(range).at_step(step, self.steps);
            let settings = Settings { sigma: at(self.sigma), ..settings(subject) };
            views.cameras = motions.cameras(&base)?;
            let by_cameras =
                shape.step_with_cameras(work.renderer, &settings, &views, (RATE * subject.pixel, COLOR_RATE))?;
            if step >= self.waits {
                let gradient = motions.gradient(given, &by_cameras, self.turns);
                optimizer.step(&mut motions.values, &gradient, at(self.rate));
                motions.fix_gauge(given);
            }
            work.step(None)?;
        }
        Ok(true)
    }
}

/// The settings of an object's views before its fit.
pub fn settings(subject: &Subject) -> Settings {
    Settings {
        near: subject.depths.0,
        far: subject.depths.1,
        gamma: 1e-2,
        background: Background::Composite,
        interpolation: Interpolation::Perspective,
        ..Settings::default()
    }
}

/// How much views of an object disagree on their hull, with what samples leave, and its own silhouettes; `None` without a hull.
fn disagreement(subject: &Subject, views: &Views, work: &mut Work) -> Result<Option<(Disagreement, Image)>> {
    let Some(silhouettes) = &views.silhouette else { return Ok(None) };
    let (center, side) = subject.cube();
    let Ok(Some(hull)) = wide_hull(views, center, side, subject.samples()?, 0.0, &mut || work.goes_on()) else {
        return work.goes_on().map(|()| None);
    };
    let colors = match views.color {
        Some(_) => exposure::disagreement(views, &hull, &settings(subject), work.renderer)?,
        None => None,
    };
    let settings = hard(&settings(subject), views.size()?, 1);
    let mut shown = Image { data: Vec::with_capacity(silhouettes.data.len()), ..*silhouettes };
    parts::in_batches(work.renderer, &Scene::new(hull), &views.cameras, &settings, |_, frame| {
        shown.data.extend_from_slice(&frame.silhouette()?.data);
        Ok(())
    })?;
    let (mut open, mut outline) = (0usize, 0usize);
    for view in 0..silhouettes.batch {
        let (target, shown, width) = (silhouettes.view(view), shown.view(view), silhouettes.width);
        let inside = |i: usize| target[i] > 0.5;
        open += (0..target.len()).filter(|&i| inside(i) && shown[i] <= 0.5).count();
        let edges = |step: usize, i: &usize| i + step < target.len() && inside(*i) != inside(i + step);
        outline += (0..target.len()).filter(|i| edges(1, i) || edges(width, i)).count();
    }
    Ok((outline > 0).then(|| (Disagreement { masks: open as f64 / outline as f64, colors }, shown)))
}

/// The views with fewer pixels, where they stay large enough.
fn shrunk(views: &Views, times: usize) -> Result<Views> {
    let (height, width) = views.size()?;
    let is_whole = height.is_multiple_of(times) && width.is_multiple_of(times);
    if times == 1 || !is_whole || height.min(width) / times < LEAST_SIDE {
        return Ok(views.clone());
    }
    let small = |image: &Option<Image>| image.as_ref().map(|image| pooled(image, times)).transpose();
    let small_camera = |camera: &Camera| scaled(camera, [1.0 / times as f64; 2]);
    let cameras = views.cameras.iter().map(small_camera).collect::<Result<Vec<_>>>()?;
    Ok(Views { cameras, silhouette: small(&views.silhouette)?, color: small(&views.color)?, ..Views::default() })
}

/// The motion of each camera, in view space: a rotation about the middle of the object and a translation, both in the pixels that they
/// move the object's rim by.
struct Motions {
    values: Vec<f64>,
    bounds: Sphere,
    pixel: f64,
}

impl Motions {
    fn new(cameras: &[Camera], bounds: Sphere, pixel: f64) -> Self {
        Self { values: vec![0.0; 6 * cameras.len()], bounds, pixel }
    }

    /// The rotation vector, radians, and the translation, world units, of a camera.
    fn of(&self, camera: usize) -> [DVec3; 2] {
        let [turn, shift] = [0, 3].map(|k| DVec3::from_slice(&self.values[6 * camera + k..]));
        [turn * self.pixel / self.bounds.radius, shift * self.pixel]
    }

    fn cameras(&self, given: &[Camera]) -> Result<Vec<Camera>> {
        let moved = |(i, camera): (usize, &Camera)| {
            let ([turn, shift], center) = (self.of(i), camera.to_view(self.bounds.center));
            let rotation = DMat4::from_mat3(DMat3::from_quat(glam::DQuat::from_scaled_axis(turn)));
            let motion = DMat4::from_translation(center + shift) * rotation * DMat4::from_translation(-center);
            Camera::from_affine(motion * camera.matrix(), *camera.projection())
        };
        given.iter().enumerate().map(moved).collect()
    }

    /// The gradient by the values, with that of the prior; 0 by the rotations unless cameras turn.
    fn gradient(&self, given: &[Camera], by_cameras: &[CameraGradient], turns: bool) -> Vec<f64> {
        let one = |(i, by): (usize, &CameraGradient)| {
            let [shift, turn] = [0, 3].map(|k| DVec3::from_slice(&by.twist[k..]));
            let center = given[i].to_view(self.bounds.center) + self.of(i)[1];
            let turn = (turn - center.cross(shift)) * self.pixel / self.bounds.radius;
            [if turns { turn } else { DVec3::ZERO }, shift * self.pixel].map(|v| v.to_array())
        };
        let gradients = by_cameras.iter().enumerate().flat_map(one).flatten();
        let prior = PRIOR / given.len() as f64;
        gradients.zip(&self.values).map(|(gradient, value)| gradient + prior * value).collect()
    }

    /// Takes away what all cameras do alike: their mean rotation and translation in the world, and the change of distance in common.
    fn fix_gauge(&mut self, given: &[Camera]) {
        let to_view = |camera: &Camera| DMat3::from_mat4(camera.matrix());
        let sights: Vec<DVec3> = given.iter().map(|camera| camera.to_view(self.bounds.center)).collect();
        let along: f64 =
            sights.iter().zip(self.values.chunks_exact(6)).map(|(s, v)| s.dot(DVec3::from_slice(&v[3..]))).sum();
        let nearer = along / sights.iter().map(|sight| sight.length_squared()).sum::<f64>();
        let (mut turn, mut shift) = (DVec3::ZERO, DVec3::ZERO);
        for ((camera, sight), value) in given.iter().zip(&sights).zip(self.values.chunks_exact_mut(6)) {
            (0..3).for_each(|k| value[3 + k] -= nearer * sight[k]);
            let axes = to_view(camera);
            // View space is left-handed.
            turn += axes.determinant() * (axes.transpose() * DVec3::from_slice(value));
            shift += axes.transpose() * DVec3::from_slice(&value[3..]);
        }
        let count = given.len() as f64;
        for (camera, value) in given.iter().zip(self.values.chunks_exact_mut(6)) {
            let axes = to_view(camera);
            let (turn, shift) = (axes.determinant() * (axes * turn) / count, axes * shift / count);
            (0..3).for_each(|k| {
                value[k] -= turn[k];
                value[3 + k] -= shift[k];
            });
        }
    }

    /// How far the cameras move the object's rim, in the mean, pixels.
    fn mean(&self) -> f64 {
        let squares: f64 = self.values.iter().map(|x| x * x).sum();
        (squares / (self.values.len() / 6).max(1) as f64).sqrt()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use softras::Projection;

    #[test]
    fn a_trial_of_many_views_takes_some_from_all_around() {
        let subject = |count: usize| {
            let camera = |i: usize| {
                let angle = std::f64::consts::TAU * i as f64 / count as f64;
                let eye = DVec3::new(4.0 * angle.cos(), 1.0, 4.0 * angle.sin());
                Camera::look_at(eye, DVec3::ZERO, DVec3::Y, Projection::Perspective { fov_y: 0.6 }).unwrap()
            };
            // The picture of a view tells which it is.
            let data = (0..count).flat_map(|i| [i as f32 / count as f32; 4]).collect();
            let silhouette = Some(Image { batch: count, height: 2, width: 2, channels: 1, data });
            let views = Views { cameras: (0..count).map(camera).collect(), silhouette, ..Views::default() };
            Subject::of(views).unwrap()
        };
        assert!(spread(&subject(MOST_TRIED)).is_none());
        let (all, some) = (subject(100), spread(&subject(100)).unwrap());
        let shown = some.views.silhouette.unwrap();
        let numbers: Vec<usize> = (0..MOST_TRIED).map(|i| (shown.view(i)[0] * 100.0).round() as usize).collect();
        assert!(numbers[0] == 0 && numbers.windows(2).all(|pair| (2..=3).contains(&(pair[1] - pair[0]))));
        assert!(numbers[MOST_TRIED - 1] >= 97, "{numbers:?}");
        assert!(numbers.iter().zip(&some.views.cameras).all(|(&i, camera)| *camera == all.views.cameras[i]));
        assert_eq!((some.bounds, some.pixel), (all.bounds, all.pixel));
    }
}
