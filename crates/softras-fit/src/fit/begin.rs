//! The mesh that a fit begins with: a sphere, the visual hull of the silhouettes, or the mesh of a file.

use super::{
    hollows::dug,
    options::{FitOptions, Preset, Template},
};
use crate::{
    bad, evened,
    mesh::specks::{SPECK_EDGES, without_specks},
    photographs::{color::color_under_light, subject::Subject},
    solid::hull::{meshed, samples},
    work::Work,
};
use softras::{
    Mesh, Result,
    scene::Appearance,
    shapes::{self, Samples},
};

/// The sphere's radius as a share of the radius that the cameras see.
const SPHERE: f64 = 0.65;
/// Views from which on a hull is nearer to the object than a sphere is. A hull of fewer has corners that no view sees, and keeps them.
const HULL_VIEWS: usize = 8;
/// Views from which on a sphere has more triangles.
const FINE_SPHERE_VIEWS: usize = 6;
/// The length of a hull's edges in pixels, where no edge is given.
const HULL_EDGE: f64 = 2.0;

/// A mesh, and what is known of it.
pub struct Begin {
    pub mesh: Mesh,
    /// The samples of the views' hull, if it is that.
    pub hull: Option<Samples>,
    /// Whether the mesh has one colour, which is estimated from the pictures before the fit and held.
    pub one_color: bool,
}

/// The mesh that the arguments ask for, placed where the cameras look.
pub fn begin(options: &FitOptions, subject: &Subject, work: &mut Work) -> Result<Begin> {
    let official = options.preset == Preset::Official;
    let own = matches!(options.template, Template::Mesh(_));
    let (mesh, hull) = match &options.template {
        Template::Mesh(mesh) => ((**mesh).clone(), None),
        _ => match hull(options, subject, work)? {
            Some((mesh, samples)) => (mesh, Some(samples)),
            None => (sphere(options, subject, official)?, None),
        },
    };
    let mesh = if official { placed(&mesh, |p, _| 0.5 * f64::from(p))? } else { mesh };
    let textured = matches!(mesh.appearance(), Appearance::Textured { .. });
    if textured && options.has_new_triangles() {
        return bad("other triangles for a textured template", "leave out subdivision and remeshing");
    }
    if options.keeps_shape() && (subject.views.depth.is_some() || subject.views.normal.is_some()) {
        let what = "depths or normals, but only the texels of the textured template are fitted";
        return bad(what, "leave them out, or fit colours in place of a texture");
    }
    let one_color = subject.one_color && !own && options.color;
    let appearance = match options.is_colored() {
        true if textured || own && matches!(mesh.appearance(), Appearance::VertexColors(_)) => {
            mesh.appearance().clone()
        }
        true if one_color => Appearance::Uniform(color_under_light(&mesh, subject, work.renderer)?),
        true => Appearance::VertexColors(vec![[0.5; 3]; mesh.positions().len()]),
        false => Appearance::Uniform([0.8; 3]),
    };
    Ok(Begin { mesh: mesh.with_appearance(appearance)?, hull, one_color })
}

fn sphere(options: &FitOptions, subject: &Subject, official: bool) -> Result<Mesh> {
    let (center, radius) = (subject.bounds.center.to_array(), SPHERE * subject.bounds.radius);
    let (center, radius) = if official { ([0.0; 3], 1.0) } else { (center, radius) };
    let is_fine =
        matches!(options.template, Template::Auto) && options.compared(subject).cameras.len() >= FINE_SPHERE_VIEWS;
    let subdivisions = options.subdivisions.unwrap_or(if is_fine && !official { 4 } else { 3 });
    placed(&shapes::icosphere(subdivisions)?, |p, k| f64::from(p) * radius + center[k])
}

/// Whether a fit of `views` views begins with a hull, if there is one.
pub fn takes_hull(options: &FitOptions, views: usize) -> bool {
    let sphere = options.subdivisions.is_some() || options.preset == Preset::Official || views < HULL_VIEWS;
    match options.template {
        Template::Hull => true,
        Template::Auto => !sphere,
        Template::Sphere | Template::Mesh(_) => false,
    }
}

/// The visual hull where it is asked for, or is likely to be nearer than a sphere; `None` for a sphere.
fn hull(options: &FitOptions, subject: &Subject, work: &mut Work) -> Result<Option<(Mesh, Samples)>> {
    let asked = matches!(options.template, Template::Hull);
    if asked && options.preset == Preset::Official {
        return bad("a hull for the official method, which begins with its sphere", "leave out one of the two");
    }
    let targets = options.compared(subject);
    if !takes_hull(options, targets.cameras.len()) {
        return Ok(None);
    }
    let (center, side) = subject.cube();
    let found = samples(&targets, center, side, subject.samples()?, &mut || work.goes_on());
    match found.and_then(|samples| Ok((meshed(samples.clone(), &targets)?, samples))) {
        Ok((raw, samples)) => {
            let edge = options.edge.map_or(HULL_EDGE, |edge| edge.0) * subject.pixel;
            work.goes_on()?;
            let (raw, specks) = without_specks(raw, edge)?;
            if specks > 0 {
                let pixels = SPECK_EDGES * edge / subject.pixel;
                work.notes.push(format!("{specks} part(s) of the hull smaller than {pixels:.1} pixels are left out"));
            }
            let hull = evened(&raw, edge)?;
            // A hull that was carved by depths has its hollows already.
            let lit = subject.one_color && options.color && !subject.lights.directional.is_empty();
            if !lit || targets.depth.is_some() {
                return Ok(Some((hull, samples)));
            }
            let (mesh, hollows) = dug(hull, edge, &targets, subject, work)?;
            if hollows > 0 {
                work.notes.push(format!("the shading shows {hollows} hollow(s) in the hull: the fit begins with them"));
            }
            Ok(Some((mesh, samples)))
        }
        Err(error) if work.is_stopped() => Err(error),
        Err(error) if !asked => {
            work.notes.push(format!("the fit begins with a sphere, since there is no hull: {error}"));
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

fn placed(mesh: &Mesh, place: impl Fn(f32, usize) -> f64) -> Result<Mesh> {
    let positions = mesh.positions().iter().map(|p| [0, 1, 2].map(|k| place(p[k], k) as f32)).collect();
    Mesh::new(positions, mesh.triangles().to_vec())?.with_appearance(mesh.appearance().clone())
}
