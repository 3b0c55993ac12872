//! The options of a fit: the mesh that it begins with, and how it goes on.

use crate::{ImageLoss, Subdivision, photographs::subject::Subject};
use softras::{
    Mesh,
    scene::{Appearance, Faces},
};
use softras_io::Views;

/// By default one of so many views is held out. Where there are fewer, the shape needs all of them.
const HOLDS_OUT: usize = 12;
/// The most views that are held out by default.
const MOST_HELD_OUT: usize = 3;
/// Cameras look from opposite sides if the angle between them exceeds this, and is at most `ASIDE` less than that of any. Those of a
/// ring above the object look down from both sides.
const OPPOSITE: f64 = 100.0 / 180.0 * std::f64::consts::PI;
const ASIDE: f64 = 10.0 / 180.0 * std::f64::consts::PI;
/// The most pixels along a side of crops for a first look.
const QUICK_CROP: usize = 96;

/// The mesh that a fit begins with.
#[derive(Clone, Debug, Default)]
pub enum Template {
    /// A hull from eight views on, and else a sphere.
    #[default]
    Auto,
    /// The largest solid that has the silhouettes, with its holes and parts.
    Hull,
    /// A sphere.
    Sphere,
    /// A mesh, whose triangles stay what they are. If it has a texture, [`FitOptions::texture`] fits only the texels.
    Mesh(Box<Mesh>),
}

/// The set of defaults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preset {
    /// Smoothed parameters, a shrinking sigma, and steps that do not tear the surface.
    #[default]
    Smooth,
    /// A first look: the hull after a few steps, with cameras, masks and topology as they are, in small crops.
    Quick,
    /// The official demo: displacements in logit space, Adam with rate 0.01, sigma 1e-4, the template at half its size.
    Official,
}

impl Preset {
    /// The most pixels along a side of crops, where `given` is asked for.
    pub fn crop(self, given: usize) -> usize {
        match self {
            Self::Smooth => given,
            Self::Quick => given.min(QUICK_CROP),
            Self::Official => 0,
        }
    }
}

/// The method of a fit. Where a field is `None`, the fit chooses by its preset and its template.
#[derive(Clone, Debug)]
pub struct FitOptions {
    /// The mesh to begin with.
    pub template: Template,
    /// Begin with a sphere of this many subdivisions, unless the template is a hull or a mesh. `None`: the template decides whether to
    /// begin with a sphere; it has 3 subdivisions, or 4 with [`Template::Auto`] and six views or more.
    pub subdivisions: Option<u32>,
    /// Fit the colours too: the template's texels where it has a texture, else a colour for each vertex.
    pub color: bool,
    /// Fit a texture of at most this many texels a side. If the template has a texture, only its texels are fitted; else an atlas is made
    /// for the mesh that was found.
    pub texture: Option<u32>,
    /// Do not leave out views that disagree with the others, nor fill holes that only one mask shows.
    pub keep_views: bool,
    /// Do not refine cameras that disagree with the silhouettes. Cameras of views that were rendered of a mesh are never refined.
    pub keep_cameras: bool,
    /// Do not correct the colours of pictures whose exposures differ.
    pub keep_exposure: bool,
    /// The most pixels along a side of the pictures. Larger ones are cropped to the object where that leaves out half of the pixels or
    /// more. 0: no crops. Pictures with depths or normals stay as they are.
    pub crop: usize,
    /// Use every `view_stride`th view.
    pub view_stride: usize,
    /// The number of views that are not fitted and by which the result is judged, spread over all; `None`: one of every twelve, at most
    /// three, and none if they were rendered of a mesh. At least one view is fitted.
    pub hold_out: Option<usize>,
    /// The set of defaults.
    pub preset: Preset,
    /// The number of steps; `None`: 500, 150 from a hull, and 20 of a quick fit.
    pub iterations: Option<usize>,
    /// Step length of the vertices from the first to the last step, world units.
    pub rate: Option<(f64, f64)>,
    /// Step length of the colours.
    pub color_rate: Option<(f64, f64)>,
    /// Softness of edges, screen units².
    pub sigma: Option<(f64, f64)>,
    /// Softness of the depth order, in units of far - near.
    pub gamma: Option<(f64, f64)>,
    /// The loss between silhouettes and their targets.
    pub loss: ImageLoss,
    /// Whether the silhouettes become masks: pixels above ½ become 1, the others 0.
    pub masks: bool,
    /// Triangles to draw.
    pub faces: Faces,
    /// Samples along each side of a pixel of the views.
    pub samples: usize,
    /// Compare this many views in each step, cycling through all of them; 0: all, but twelve in the first 0.6 of the steps from a
    /// hull of 24 or more.
    pub views_per_step: usize,
    /// How strongly steps are smoothed over the surface, λ of (I + λ L)⁻¹; `None`: 5, 2 from a hull of one colour.
    pub smoothing: Option<f64>,
    /// Weight of the Laplacian regularizer.
    pub laplacian: Option<f64>,
    /// Weight of the flatten regularizer.
    pub flatten: Option<f64>,
    /// Weight of the normal consistency regularizer; `None`: 0.
    pub normal_consistency: Option<f64>,
    /// Weight of the loss of colours, relative to that of silhouettes; `None`: 3, and 5 for an object of one colour under light.
    pub color_weight: Option<f64>,
    /// Weight of the loss of depths in units of the object's radius.
    pub depth_weight: f64,
    /// Weight of the loss of normals.
    pub normal_weight: f64,
    /// Steps before which every triangle is divided into four.
    pub subdivide_at: Vec<usize>,
    /// How they are divided.
    pub subdivision: Subdivision,
    /// Steps before which the mesh is remeshed to triangles of even size.
    pub remesh_at: Vec<usize>,
    /// Keep the holes and parts that the mesh begins with. Else, after 0.3 and 0.6 of the steps, a mesh that covers a hole, leaves out a
    /// part or overlaps itself is cut anew to the silhouettes, unless the template is a mesh or the preset is the official one.
    pub keep_topology: bool,
    /// Edge length of a hull and of remeshing in pixels of the views, from the first to the last step; `None`: 1.5, and 2 for a hull.
    pub edge: Option<(f64, f64)>,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            template: Template::Auto,
            subdivisions: None,
            color: false,
            texture: None,
            keep_views: false,
            keep_cameras: false,
            keep_exposure: false,
            crop: 192,
            view_stride: 1,
            hold_out: None,
            preset: Preset::Smooth,
            iterations: None,
            rate: None,
            color_rate: None,
            sigma: None,
            gamma: None,
            loss: ImageLoss::NegativeIou,
            masks: false,
            faces: Faces::Both,
            samples: 1,
            views_per_step: 0,
            smoothing: None,
            laplacian: None,
            flatten: None,
            normal_consistency: None,
            color_weight: None,
            depth_weight: 10.0,
            normal_weight: 0.5,
            subdivide_at: Vec::new(),
            subdivision: Subdivision::Midpoint,
            remesh_at: Vec::new(),
            keep_topology: false,
            edge: None,
        }
    }
}

impl FitOptions {
    /// Whether the fit is one of the template's texels alone.
    pub(crate) fn keeps_shape(&self) -> bool {
        let Template::Mesh(mesh) = &self.template else { return false };
        self.texture.is_some() && matches!(mesh.appearance(), Appearance::Textured { .. })
    }

    /// The views that are held out of the fit.
    pub(crate) fn held_out(&self, subject: &Subject) -> Vec<usize> {
        let used: Vec<usize> = (0..subject.views.cameras.len()).step_by(self.view_stride.max(1)).collect();
        let default = if subject.truth.is_none() { (used.len() / HOLDS_OUT).min(MOST_HELD_OUT) } else { 0 };
        let count = self.hold_out.unwrap_or(default).min(used.len().saturating_sub(1));
        let cameras = &subject.views.cameras;
        let angle = |one: usize, other: usize| cameras[one].axes()[2].angle_between(cameras[other].axes()[2]);
        // Each with the angle beyond which a camera looks from the opposite side.
        let mut held_out: Vec<(usize, f64)> = Vec::new();
        for i in 0..count {
            let share = &used[i * used.len() / count..(i + 1) * used.len() / count];
            let middle = used[(2 * i + 1) * used.len() / (2 * count)];
            // Views from opposite sides show one outline. The other views tell it only as long as one of the two is fitted.
            let is_opposite = |view: usize| held_out.iter().any(|(other, most)| angle(view, *other) > *most);
            let near =
                share.iter().copied().filter(|view| !is_opposite(*view)).min_by_key(|view| view.abs_diff(middle));
            let view = near.unwrap_or(middle);
            let farthest = used.iter().map(|other| angle(view, *other)).fold(0.0, f64::max);
            held_out.push((view, f64::max(farthest - ASIDE, OPPOSITE)));
        }
        held_out.into_iter().map(|(view, _)| view).collect()
    }

    /// The numbers of the views that are fitted to: every `view_stride`-th that is not held out.
    pub(crate) fn fitted(&self, subject: &Subject) -> Vec<usize> {
        let all = (0..subject.views.cameras.len()).step_by(self.view_stride.max(1));
        all.filter(|view| !subject.held_out.contains(view)).collect()
    }

    /// The views that are compared.
    pub(crate) fn compared(&self, subject: &Subject) -> Views {
        let mut some = subject.views.some(&self.fitted(subject)).into_owned();
        if let Some(silhouette) = some.silhouette.as_mut().filter(|_| self.masks) {
            silhouette.data.iter_mut().for_each(|x| *x = f32::from(*x > 0.5));
        }
        some
    }

    /// Whether the mesh gets other triangles at steps that are given.
    pub(crate) fn has_new_triangles(&self) -> bool {
        !(self.subdivide_at.is_empty() && self.remesh_at.is_empty())
    }

    /// Whether colours are fitted.
    pub fn is_colored(&self) -> bool {
        self.color || self.texture.is_some()
    }
}
