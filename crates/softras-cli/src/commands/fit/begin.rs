//! The mesh that a fit begins with: a sphere, the visual hull of the silhouettes, or the mesh of a file.

use super::args::{FitArgs, Preset};
use super::cameras;
use super::dig::dug;
use super::targets::{self, Views};
use crate::commands::{Failure, note};
use softras::parts;
use softras::scene::{Appearance, Background, Outputs};
use softras::{Mesh, Renderer, Scene, Settings, shapes};
use softras_fit::evened;

/// The sphere's radius as a share of the radius that the cameras see.
const SPHERE: f64 = 0.65;
/// Views from which on a hull is nearer to the object than a sphere is.
const HULL_VIEWS: usize = 6;
/// Samples along the hull's longest side for each pixel along the shorter side of a picture, and the most of them.
const SAMPLES_PER_PIXEL: f64 = 1.0;
const MOST_SAMPLES: usize = 192;
/// The length of a hull's edges in pixels, where `--edge` says nothing.
const HULL_EDGE: f64 = 2.0;

/// A mesh, and whether it is a hull.
pub struct Begin {
    pub mesh: Mesh,
    pub hull: bool,
    /// Whether the mesh has one colour, which is estimated from the pictures before the fit and held.
    pub one_color: bool,
}

/// The mesh that the arguments ask for, placed where the cameras look.
pub fn begin(args: &FitArgs, views: &Views, renderer: &mut Renderer) -> Result<Begin, Failure> {
    let official = args.method.preset == Preset::Official;
    let own = views.template.is_some();
    let (mesh, hull) = match &views.template {
        Some(mesh) => (mesh.clone(), false),
        None => match hull(args, views, renderer)? {
            Some(mesh) => (mesh, true),
            None => (sphere(args, views, official)?, false),
        },
    };
    let mesh = if official { placed(&mesh, |p, _| 0.5 * f64::from(p))? } else { mesh };
    let textured = matches!(mesh.appearance(), Appearance::Textured { .. });
    if textured && !(args.method.subdivide_at.is_empty() && args.method.remesh_at.is_empty()) {
        let what = "--subdivide-at, --remesh-at: the triangles of a textured template stay what they are";
        return Err(Failure::Usage(what.into()));
    }
    if views.keeps_shape(args) && (views.targets.depth.is_some() || views.targets.normal.is_some()) {
        let what = "--texture: of a textured template it fits the texels alone, which depths and normals do not tell: leave out \
                    --also, --depths and --normals, or --texture for --color";
        return Err(Failure::Usage(what.into()));
    }
    let one_color = views.one_color && !own && args.color;
    let appearance = match args.colored() {
        true if textured => mesh.appearance().clone(),
        true if one_color => Appearance::Uniform(color_under_light(&mesh, views, renderer)?),
        true => Appearance::VertexColors(vec![[0.5; 3]; mesh.positions().len()]),
        false => Appearance::Uniform([0.8; 3]),
    };
    Ok(Begin { mesh: mesh.with_appearance(appearance)?, hull, one_color })
}

fn sphere(args: &FitArgs, views: &Views, official: bool) -> Result<Mesh, Failure> {
    let (center, radius) = (views.bounds.center.to_array(), SPHERE * views.bounds.radius);
    let (center, radius) = if official { ([0.0; 3], 1.0) } else { (center, radius) };
    placed(&shapes::icosphere(args.subdivisions.unwrap_or(3))?, |p, k| f64::from(p) * radius + center[k])
}

/// The visual hull where it is asked for, or is likely to be nearer than a sphere; `None` for a sphere.
fn hull(args: &FitArgs, views: &Views, renderer: &mut Renderer) -> Result<Option<Mesh>, Failure> {
    let asked = args.template == "hull";
    if asked && args.method.preset == Preset::Official {
        let what = "--template hull: the official method begins with its sphere: leave out one of the two";
        return Err(Failure::Usage(what.into()));
    }
    let targets = targets::fitted(args, &views.targets);
    let few = targets.cameras.len() < HULL_VIEWS;
    let sphere = args.subdivisions.is_some() || args.method.preset == Preset::Official || few;
    if args.template == "sphere" || !asked && sphere {
        return Ok(None);
    }
    let (center, side) = views.cube();
    let size = targets.size()?;
    match targets.visual_hull(center, side, samples(size.0.min(size.1))) {
        Ok(raw) => {
            let edge = args.method.edge.map_or(HULL_EDGE, |edge| edge.0) * cameras::pixel(views.bounds, size);
            let hull = evened(&raw, edge)?;
            // Depths have shown the hollows already.
            let lit = views.one_color && args.color && !views.lights.directional.is_empty();
            if !lit || targets.depth.is_some() {
                return Ok(Some(hull));
            }
            let (mesh, hollows) = dug(hull, edge, &targets, views, renderer)?;
            if hollows > 0 {
                note(&format!("by the light, the hull covers {hollows} hollow(s), which the fit begins with"));
            }
            Ok(Some(mesh))
        }
        Err(error) if !asked => {
            note(&format!("the fit begins with a sphere, since there is no hull: {error}"));
            Ok(None)
        }
        Err(error) => Err(error.into()),
    }
}

/// Samples along the hull's longest side for pictures of so many pixels along the shorter side.
pub fn samples(pixels: usize) -> usize {
    ((SAMPLES_PER_PIXEL * pixels as f64) as usize).clamp(32, MOST_SAMPLES)
}

/// The colour that a mesh needs for its renderings under the lights to be the targets', by least squares over the pixels in
/// the object. It need not be the object's mesh, but one that faces the light alike in the mean.
pub fn color_under_light(mesh: &Mesh, views: &Views, renderer: &mut Renderer) -> Result<[f32; 3], Failure> {
    let targets = &views.targets;
    let (Some(color), Some(silhouette)) = (&targets.color, &targets.silhouette) else { return Ok([0.8; 3]) };
    let (height, width) = targets.size()?;
    let settings = Settings {
        width: width as u32,
        height: height as u32,
        near: views.depths.0,
        far: views.depths.1,
        background: Background::Composite,
        outputs: Outputs { color: true, silhouette: true, depth: false, normal: false },
        ..Settings::default()
    };
    let white = mesh.clone().with_appearance(Appearance::Uniform([1.0; 3]))?;
    let scene = Scene::new(white).with_lights(views.lights.clone());
    let (mut by_light, mut of_light) = ([0.0; 3], [0.0; 3]);
    parts::in_batches(renderer, &scene, &targets.cameras, &settings, |range, frame| {
        let (Some(light), Some(alpha)) = (frame.color(), frame.silhouette()) else { return Ok(()) };
        let targets = range.flat_map(|view| color.view(view).chunks_exact(3).zip(silhouette.view(view)));
        let lights = light.data.chunks_exact(3).zip(&alpha.data);
        for ((target, inside), (light, covered)) in targets.zip(lights) {
            if *inside > 0.99 && *covered > 0.99 {
                for k in 0..3 {
                    by_light[k] += f64::from(target[k]) * f64::from(light[k]);
                    of_light[k] += f64::from(light[k]).powi(2);
                }
            }
        }
        Ok(())
    })?;
    Ok([0, 1, 2].map(|k| if of_light[k] > 0.0 { (by_light[k] / of_light[k]).clamp(0.0, 1.0) as f32 } else { 0.8 }))
}

fn placed(mesh: &Mesh, place: impl Fn(f32, usize) -> f64) -> Result<Mesh, Failure> {
    let positions = mesh.positions().iter().map(|p| [0, 1, 2].map(|k| place(p[k], k) as f32)).collect();
    Ok(Mesh::new(positions, mesh.triangles().to_vec())?.with_appearance(mesh.appearance().clone())?)
}
