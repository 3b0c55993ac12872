//! The search for all poses that explain a picture: first a grid over all rotations in small images, then fits from the most
//! likely ones in larger images.

use super::descent::{Pose, PoseFit, PoseOptions, of_each, rotations};
use super::picture::{Picture, Place};
use super::target::PoseTarget;
use crate::photographs::cameras::scaled;
use crate::{Schedule, bad, photographs::cameras::reach, points, solid::voxel::is_closed};
use glam::{DMat3, DVec3};
use softras::{
    Image, Renderer, Result,
    scene::{Camera, Faces, Mesh, Scene, Settings},
};

/// Rotations of the grid, some 30 degrees apart.
const GRID: usize = 512;
/// Rotations of the grid that are rendered together.
const BATCH: usize = 64;
/// The longer side of the grid's images, in pixels.
const GRID_SIDE: usize = 32;
/// The rounds of fits: the longest side of their images in pixels, and their share of the steps.
const ROUNDS: [(usize, f64); 4] = [(32, 0.2), (64, 0.3), (128, 0.1), (128, 0.4)];
/// The first of the rounds that refine, and the last.
const REFINING: usize = 2;
const LAST: usize = ROUNDS.len() - 1;
/// The second round takes the best half of the fits: their number divided by this.
const PRUNED: usize = 2;
/// The most fits that the last round takes.
const FINALISTS: usize = 4;
/// How images of the grid are compared: σ, γ, the blur as a fraction of the height, the weight of the silhouette.
const GRID_LOOK: (f64, f64, f64, f64) = (1e-3, 3e-2, 0.04, 0.3);
/// The σ and γ of the comparisons between poses that are fitted.
const SHARP: (f64, f64) = (1e-5, 1e-3);
/// Degrees within which two starts lead to the same pose, and within which two fitted poses are the same.
const APART: [f64; 2] = [20.0, 5.0];
/// Fits whose loss is more than this multiple of the least are not refined.
const HOPELESS: f64 = 4.0;
/// Poses whose loss is at most this multiple of the least are as good as the best.
const AS_GOOD: f64 = 1.5;
/// The step of a translation as a share of the mesh's radius, for a step of one radian.
const TRANSLATION_RATE: f64 = 0.15;

/// A search for the poses of a rigid mesh that explain one picture of it.
///
/// 512 rotations are compared with the picture in small images, moved to where the picture's silhouette lies; the most likely are
/// fitted by [`PoseFit`], half of them in larger images, and the best of those refined. Call [`PoseSearch::step`] until it returns
/// `None`, then [`PoseSearch::found`]. No random numbers are used: the same input gives the same poses.
#[derive(Debug)]
pub struct PoseSearch {
    scene: Scene,
    camera: Camera,
    center: DVec3,
    radius: f64,
    settings: Settings,
    picture: Picture,
    starts: usize,
    steps: usize,
    translates: bool,
    stage: SearchStage,
    /// Poses that were fitted and not refined, with their losses by plain colours.
    hopeless: Vec<Scored>,
}

/// A pose with its loss.
type Scored = (Pose, f64);

#[derive(Debug)]
enum SearchStage {
    /// The rotations of the grid so far with their losses.
    Grid(Vec<Scored>),
    /// Fits from the most likely rotations, or from the pose that is refined.
    Fits(Box<Fits>),
    /// The poses with their losses, the best first.
    Done(Vec<Scored>),
}

#[derive(Debug)]
struct Fits {
    fit: PoseFit,
    target: PoseTarget,
    taken: usize,
    steps: usize,
    round: usize,
}

impl PoseSearch {
    /// A search for the poses of a mesh seen by a camera. `color` is the picture on black, `[1, height, width, 3]`, `silhouette` its
    /// coverage, `[1, height, width, 1]`; `center` is the point that rotations turn about, in world units. Only near, far and tau of
    /// the settings are used. Colours are compared without light.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] for images of other shapes and for a mesh without triangles.
    pub fn new(
        mesh: Mesh,
        camera: Camera,
        center: DVec3,
        settings: Settings,
        color: Image,
        silhouette: Image,
    ) -> Result<Self> {
        let picture = Picture::new(color, silhouette)?;
        let radius = reach(&mesh, center);
        if radius == 0.0 {
            return bad("a mesh without extent", "give one that can be seen");
        }
        let settings = Settings { faces: if is_solid(&mesh)? { Faces::Front } else { Faces::Both }, ..settings };
        let (scene, stage) = (Scene::new(mesh), SearchStage::Grid(Vec::with_capacity(GRID)));
        Ok(Self {
            scene,
            camera,
            center,
            radius,
            settings,
            picture,
            starts: 24,
            steps: 150,
            translates: true,
            stage,
            hopeless: Vec::new(),
        })
    }

    /// Sets how many of the grid's rotations are fitted (24 unless set, at most 512) and in how many steps (150 unless set): a fifth of
    /// the steps with all rotations, three tenths with the best half in larger images, a tenth with the best of those in still larger
    /// ones, and the others with the best four; at least one of each.
    #[must_use]
    pub fn with(self, starts: usize, steps: usize) -> Self {
        Self { starts: starts.clamp(1, GRID), steps: steps.max(1), ..self }
    }

    /// With the mesh's centre where it is: only the rotation is unknown.
    #[must_use]
    pub fn without_translation(self) -> Self {
        Self { translates: false, ..self }
    }

    /// Refines one pose in small steps, in place of searching.
    ///
    /// # Errors
    /// As [`PoseFit::new`].
    pub fn refining(mut self, pose: Pose) -> Result<Self> {
        let steps = self.steps.saturating_sub(self.steps_of(LAST)).max(1);
        self.stage = self.fits(vec![pose], steps, REFINING)?;
        Ok(self)
    }

    /// Number of calls of [`PoseSearch::step`] that return a loss.
    pub fn step_count(&self) -> usize {
        let after = |round: usize| (round..ROUNDS.len()).map(|round| self.steps_of(round)).sum::<usize>();
        match &self.stage {
            SearchStage::Grid(_) => GRID.div_ceil(BATCH) + after(0),
            SearchStage::Fits(fits) => fits.steps - fits.taken + after(fits.round + 1),
            SearchStage::Done(_) => 0,
        }
    }

    /// Takes one step: renders a batch of the grid, or takes a step of all fits. Returns the least loss of the poses that it compared,
    /// or `None` when the search is over.
    ///
    /// # Errors
    /// As [`Renderer::render`] and [`Renderer::backward`].
    pub fn step(&mut self, renderer: &mut Renderer) -> Result<Option<f64>> {
        let least = |losses: &mut dyn Iterator<Item = f64>| losses.fold(f64::INFINITY, f64::min);
        let loss = match &mut self.stage {
            SearchStage::Done(_) => return Ok(None),
            SearchStage::Grid(scored) => {
                let from = scored.len();
                let batch = self.grid_losses(renderer, from)?;
                let loss = least(&mut batch.iter().map(|(_, loss)| *loss));
                if let SearchStage::Grid(scored) = &mut self.stage {
                    scored.extend(batch);
                }
                loss
            }
            SearchStage::Fits(fits) => {
                fits.taken += 1;
                least(&mut fits.fit.step(renderer, &fits.target)?.into_iter())
            }
        };
        self.advance(renderer)?;
        Ok(Some(loss))
    }

    /// The poses found, each with the mean squared difference of plain colours and silhouettes, the best first: poses less than
    /// five degrees apart count as one. Empty before the last step.
    pub fn found(&self) -> &[(Pose, f64)] {
        match &self.stage {
            SearchStage::Done(found) => found,
            _ => &[],
        }
    }

    /// How many of the poses found are equally good, by the symmetry of the object or because the picture does not decide between
    /// them: their losses are at most 1.5 times the least. Poses that were not fitted may be as good; 0 before the last step.
    pub fn equally_good(&self) -> usize {
        let least = self.found().first().map_or(0.0, |(_, loss)| *loss);
        self.found().iter().take_while(|(_, loss)| *loss <= AS_GOOD * least).count()
    }

    /// Goes to the next stage where one is complete.
    fn advance(&mut self, renderer: &mut Renderer) -> Result<()> {
        let next = match &self.stage {
            SearchStage::Grid(scored) if scored.len() == GRID => {
                let starts = distinct(scored.clone(), APART[0]).into_iter().take(self.starts);
                self.fits(starts.map(|(pose, _)| pose).collect(), self.steps_of(0), 0)?
            }
            SearchStage::Fits(fits) if fits.taken == fits.steps => {
                let found = distinct(Self::compared(fits, renderer)?, APART[1]);
                if fits.round == LAST {
                    SearchStage::Done(distinct([found, std::mem::take(&mut self.hopeless)].concat(), APART[1]))
                } else {
                    let (poses, hopeless) = self.kept(fits, found, renderer)?;
                    self.hopeless.extend(hopeless);
                    self.fits(poses, self.steps_of(fits.round + 1), fits.round + 1)?
                }
            }
            _ => return Ok(()),
        };
        self.stage = next;
        Ok(())
    }

    fn steps_of(&self, round: usize) -> usize {
        ((ROUNDS[round].1 * self.steps as f64).round() as usize).max(1)
    }

    /// The poses that the next round begins with. If that is a round that refines, also the poses that it leaves out, with their losses.
    fn kept(&self, fits: &Fits, mut found: Vec<Scored>, renderer: &mut Renderer) -> Result<(Vec<Pose>, Vec<Scored>)> {
        let poses_of = |found: Vec<Scored>| found.into_iter().map(|(pose, _)| pose).collect();
        match fits.round + 1 {
            REFINING => self.hopeful(fits, found, renderer),
            LAST => {
                let left_out = found.split_off(FINALISTS.min(found.len()));
                Ok((poses_of(found), left_out))
            }
            _ => {
                found.truncate(self.starts.div_ceil(PRUNED));
                Ok((poses_of(found), Vec::new()))
            }
        }
    }

    /// The poses that are worth refining, and the others with their losses.
    fn hopeful(&self, fits: &Fits, found: Vec<Scored>, renderer: &mut Renderer) -> Result<(Vec<Pose>, Vec<Scored>)> {
        let hopeful = found.iter().take_while(|(_, loss)| *loss <= HOPELESS * found[0].1).count().max(1);
        let mut poses: Vec<Pose> = found.into_iter().map(|(pose, _)| pose).collect();
        let left_out = poses.split_off(hopeful);
        let repeated = self.picture.at_most(ROUNDS[fits.round].0).repeated(left_out.len().max(1))?.plain();
        let losses = match left_out.len() {
            0 => Vec::new(),
            _ => fits.fit.losses(renderer, &left_out, SHARP, &repeated)?,
        };
        if self.translates {
            // Gradients find a translation's depth last, and the area of the silhouette gives it at once. Most pictures show the
            // object where the camera looks: no translation is tried as well.
            let mut centered = poses.clone();
            self.center_on_picture(renderer, &fits.fit, &mut centered)?;
            let unmoved: Vec<Pose> = poses.iter().map(|pose| Pose { translation: DVec3::ZERO, ..*pose }).collect();
            poses.extend(centered.into_iter().chain(unmoved));
        }
        Ok((poses, left_out.into_iter().zip(losses).collect()))
    }

    /// The losses of fitted poses: that of the fit after the first round, that of sharp images after the second, and that of sharp
    /// images with plain colours, whose mean squared difference is easier to understand, after those that refine.
    fn compared(fits: &Fits, renderer: &mut Renderer) -> Result<Vec<Scored>> {
        let Fits { fit, target, round, .. } = fits;
        let losses = match *round {
            0 => fit.losses_of_step(renderer, fit.poses(), target)?,
            REFINING.. => fit.losses(renderer, fit.poses(), SHARP, &target.clone().plain())?,
            _ => fit.losses(renderer, fit.poses(), SHARP, target)?,
        };
        Ok(fit.poses().iter().copied().zip(losses).collect())
    }

    /// A fit to the picture with no side longer than `side`. A smaller picture is compared with images of several times its pixels: the
    /// soft edges of an image as small as the picture differ from the picture's, and the fit would move the pose to make up for that.
    fn fit(&self, side: usize, options: PoseOptions, poses: Vec<Pose>) -> Result<(PoseFit, PoseTarget)> {
        let small = self.picture.at_most(side);
        let samples = (side / small.width().max(small.height())).max(1);
        let (width, height) = (small.width() * samples, small.height() * samples);
        let scale = [width as f64 / self.picture.width() as f64, height as f64 / self.picture.height() as f64];
        let settings = Settings { width: width as u32, height: height as u32, ..self.settings.clone() };
        let target = small.repeated(poses.len())?;
        let camera = scaled(&self.camera, scale)?;
        Ok((PoseFit::new(self.scene.clone(), camera, self.center, settings, options, poses)?, target))
    }

    fn options(&self, steps: usize) -> PoseOptions {
        let solid = self.settings.faces == Faces::Front;
        let base = if solid { PoseOptions::default() } else { PoseOptions::both_sides() };
        let translation_rate = if self.translates { TRANSLATION_RATE * self.radius } else { 0.0 };
        PoseOptions { iterations: steps, translation_rate, ..base }
    }

    /// The stage of a round of fits. σ is small in all of them, since a soft outline is wider than the picture's and the best pose
    /// for it is far away: at σ = 2e-3 the first round left starts 10 degrees off at 40 and more. The blur reaches far instead, on
    /// both images alike. The rounds that refine take small steps with little blur, so as not to leave their poses.
    fn fits(&self, poses: Vec<Pose>, steps: usize, round: usize) -> Result<SearchStage> {
        let by = |from, to| Schedule::Exponential { from, to };
        // The two first rounds share one schedule, and so do the two last.
        let begun = if round < REFINING { 1.0 / 3.0 } else { 1.0 / 4.0 };
        let part = |from, to| match round {
            0 | REFINING => by(from, by(from, to).at(begun)),
            _ => by(by(from, to).at(begun), to),
        };
        let options = match round {
            REFINING.. => PoseOptions {
                sigma: part(1e-4, 1e-5),
                gamma: part(1e-1, 3e-2),
                blur: part(0.05, 0.005),
                silhouette: part(0.3, 1.0),
                rate: part(0.05, 0.002),
                ..self.options(steps)
            },
            _ => PoseOptions {
                sigma: part(3e-4, 3e-5),
                blur: part(0.06, 0.01),
                silhouette: part(0.1, 1.0),
                rate: part(0.05, 0.01),
                ..self.options(steps)
            },
        };
        let (fit, target) = self.fit(ROUNDS[round].0, options, poses)?;
        Ok(SearchStage::Fits(Box::new(Fits { fit, target, taken: 0, steps, round })))
    }

    /// The next rotations of the grid, moved to where the picture shows the object, with their losses.
    fn grid_losses(&self, renderer: &mut Renderer, from: usize) -> Result<Vec<Scored>> {
        let mut poses: Vec<Pose> = rotations(GRID)[from..(from + BATCH).min(GRID)]
            .iter()
            .map(|rotation| Pose { rotation: *rotation, ..Pose::IDENTITY })
            .collect();
        let (sigma, gamma, blur, silhouette) = GRID_LOOK;
        let constant = Schedule::Constant;
        let options = PoseOptions {
            sigma: constant(sigma),
            gamma: constant(gamma),
            blur: constant(blur),
            silhouette: constant(silhouette),
            ..self.options(1)
        };
        let (fit, target) = self.fit(GRID_SIDE, options, poses.clone())?;
        if self.translates {
            self.center_on_picture(renderer, &fit, &mut poses)?;
        }
        let losses = fit.losses_of_step(renderer, &poses, &target)?;
        Ok(poses.into_iter().zip(losses).collect())
    }

    /// Moves poses so that the silhouette of each, as sharp as at the end of a fit, has the centre and the area of the picture's.
    fn center_on_picture(&self, renderer: &mut Renderer, fit: &PoseFit, poses: &mut [Pose]) -> Result<()> {
        let settings = Settings { sigma: SHARP.0, gamma: SHARP.1, save: false, ..fit.settings_at(0) };
        let places = of_each(poses.len(), &mut { fit.at_once }, |part| {
            let frame = fit.frame(renderer, &poses[part.clone()], &settings)?;
            let silhouette = frame.silhouette()?;
            Ok((0..part.len()).map(|i| Place::of(silhouette, i)).collect())
        })?;
        let size = [settings.width as usize, settings.height as usize];
        let Some(goal) = self.picture.place() else { return Ok(()) };
        let view = fit.camera.matrix();
        for (pose, place) in poses.iter_mut().zip(places) {
            let depth = view.transform_point3(self.center + pose.translation).z;
            let way =
                place.map_or(DVec3::ZERO, |place| place.way_to(&goal, &fit.camera, size.map(|n| n as f64), depth));
            let to = pose.translation + DMat3::from_mat4(view).transpose() * way;
            pose.translation = to.clamp_length_max(self.radius);
        }
        Ok(())
    }
}

/// The poses in order of their losses, without those within `degrees` of a better one.
fn distinct(mut poses: Vec<Scored>, degrees: f64) -> Vec<Scored> {
    poses.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut kept: Vec<Scored> = Vec::new();
    for (pose, loss) in poses {
        if kept.iter().all(|(other, _)| pose.degrees_to(other) > degrees) {
            kept.push((pose, loss));
        }
    }
    kept
}

/// Whether a mesh is closed and its triangles face outwards, so that none is seen from behind.
fn is_solid(mesh: &Mesh) -> Result<bool> {
    let points = points(mesh);
    let corners = mesh.triangles().iter().map(|t| t.map(|v| points[v as usize]));
    let volume: f64 = corners.map(|[a, b, c]| a.dot(b.cross(c))).sum();
    Ok(is_closed(mesh)? && volume > 0.0)
}
