//! The report of a fit: one page of HTML that loads nothing.

pub mod film;

use crate::{Fitted, finer, pooled, sized};
use base64::{Engine, engine::general_purpose::STANDARD};
use film::picture;
use glam::DVec3;
use softras::{
    Camera, Image, Mesh, Renderer, Result, Scene, Settings, parts,
    scene::{Appearance, Outputs, Texture},
};
use softras_io::{Curve, Picture};

const PAGE: &str = include_str!("report.html");
/// Samples along each side of a pixel.
const SAMPLES: usize = 3;
/// A pixel of the difference that the mesh leaves out, and one that it alone covers.
const MISSED: [u8; 4] = [60, 110, 255, 255];
const COVERED: [u8; 4] = [240, 80, 60, 255];

impl Fitted {
    /// A page of HTML that loads nothing: scores and notes; each view, the mesh in it and their difference, the worst first; the mesh
    /// with the cameras; the texture; the losses.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn report(&self, title: &str, renderer: &mut Renderer) -> Result<String> {
        let masks = &self.scores.masks;
        let mut worst_first: Vec<usize> = (0..masks.len()).collect();
        worst_first.sort_by(|a, b| masks[*a].total_cmp(&masks[*b]));
        let notes: String = self.notes.iter().map(|note| format!("<li>{}</li>\n", escaped(note))).collect();
        let pictures = self.pictures(renderer)?;
        let views: Result<String> = worst_first.iter().map(|&view| self.figure(view, &pictures[view])).collect();
        let textures: Result<String> = match self.mesh.appearance() {
            Appearance::Textured { textures, .. } => textures.iter().map(texture).collect(),
            _ => Ok(String::new()),
        };
        let parts = [
            ("<!--TITLE-->", escaped(title)),
            ("<!--SENTENCE-->", escaped(&self.scores.sentence())),
            ("<!--NOTES-->", format!("<ul>\n{notes}</ul>")),
            ("<!--VIEWS-->", views?),
            ("<!--TEXTURE-->", textures?),
            ("<!--LOSSES-->", curve(&self.losses())),
            ("/*SCENE*/null", self.scene(worst_first.first().copied())),
        ];
        Ok(parts.into_iter().fold(PAGE.to_string(), |page, (mark, part)| page.replace(mark, &part)))
    }

    /// For each view the target, the mesh and their difference, side by side.
    fn pictures(&self, renderer: &mut Renderer) -> Result<Vec<Picture>> {
        let Some(targets) = &self.views.silhouette else { return Ok(Vec::new()) };
        let settings = Settings {
            sigma: 1e-7,
            gamma: 1e-5,
            outputs: Outputs { color: true, silhouette: true, ..Outputs::NOTHING },
            ..sized(&self.settings, self.views.size()?, SAMPLES)
        };
        let scene = Scene::new(self.mesh.clone()).with_lights(self.lights.clone());
        let mut all = Vec::new();
        parts::in_batches(renderer, &scene, &finer(&self.views.cameras, SAMPLES)?, &settings, |views, frame| {
            let [color, alpha] = [pooled(frame.color()?, SAMPLES)?, pooled(frame.silhouette()?, SAMPLES)?];
            for (at, view) in views.enumerate() {
                let target = (self.views.color.as_ref().map(|color| color.view(view)), targets.view(view));
                let shown = (self.views.color.is_some().then(|| color.view(at)), alpha.view(at));
                all.push(side_by_side(target, shown, &alpha));
            }
            Ok(())
        })?;
        Ok(all)
    }

    fn figure(&self, view: usize, picture: &Picture) -> Result<String> {
        let name = escaped(&self.views.name(view));
        let is_held = self.scores.held_out.contains(&view);
        let held = if is_held { " <span class=\"held\">held out</span>" } else { "" };
        let caption = format!("{name}: mask IoU {:.4}{held}", self.scores.masks[view]);
        Ok(format!("<figure>{}<figcaption>{caption}</figcaption></figure>\n", image(picture)?))
    }

    /// The mesh and the cameras for the page's script, as JSON.
    fn scene(&self, worst: Option<usize>) -> String {
        let (positions, triangles) = (self.mesh.positions(), self.mesh.triangles());
        let colors = (0..triangles.len()).map(|triangle| {
            let [r, g, b] = color_of(&self.mesh, triangle).map(byte);
            format!("\"{r:02x}{g:02x}{b:02x}\"")
        });
        let cameras = self.views.cameras.iter().enumerate().map(|(view, camera)| {
            let (axes, is_worst) = (camera.axes().map(|axis| axis.to_array()), worst == Some(view));
            format!("{{\"eye\": {:?}, \"axes\": {axes:?}, \"worst\": {is_worst}}}", eye(camera).to_array())
        });
        let [colors, cameras] = [colors.collect::<Vec<_>>(), cameras.collect()].map(|list| list.join(","));
        format!(
            "{{\"positions\": {positions:?}, \"triangles\": {triangles:?}, \"colors\": [{colors}], \"cameras\": [{cameras}]}}"
        )
    }
}

/// The place of a camera: Rᵀ (0 − t).
fn eye(camera: &Camera) -> DVec3 {
    camera.matrix().inverse().transform_point3(DVec3::ZERO)
}

/// A triangle's colour: the mean of its corners', or the texel at its middle.
fn color_of(mesh: &Mesh, triangle: usize) -> [f32; 3] {
    match mesh.appearance() {
        Appearance::Uniform(color) => *color,
        Appearance::VertexColors(colors) => mean(mesh.triangles()[triangle].map(|v| colors[v as usize])),
        Appearance::Surface { resolution, texels } => texels[triangle * (*resolution as usize).pow(2)],
        Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle } => {
            let texture = &textures[texture_of_triangle.get(triangle).map_or(0, |&at| at as usize)];
            let [u, v] = mean(uv_triangles[triangle].map(|at| uvs[at as usize]));
            let at = |x: f32, side: u32| ((x.rem_euclid(1.0) * side as f32) as u32).min(side - 1) as usize;
            texture.texels()[at(1.0 - v, texture.height()) * texture.width() as usize + at(u, texture.width())]
        }
    }
}

fn mean<const N: usize>(corners: [[f32; N]; 3]) -> [f32; N] {
    std::array::from_fn(|k| corners.iter().map(|corner| corner[k]).sum::<f32>() / 3.0)
}

/// A view's target, what a mesh shows in it, and the difference. Without colours both are silhouettes.
fn side_by_side(target: (Option<&[f32]>, &[f32]), shown: (Option<&[f32]>, &[f32]), size: &Image) -> Picture {
    let shape = (size.height, size.width);
    let [target, mesh] = [target, shown].map(|(color, alpha)| {
        let grey: Vec<f32> = alpha.iter().flat_map(|a| [0.2 * a; 3]).collect();
        (picture(color.unwrap_or(&grey), alpha, shape), alpha)
    });
    let mut all = Picture::filled(3 * size.width, size.height, [0, 0, 0, 255]);
    all.paste(&target.0, 0, 0);
    all.paste(&mesh.0, size.width, 0);
    for pixel in 0..size.width * size.height {
        let [a, b] = [target.0.pixels[pixel], mesh.0.pixels[pixel]];
        let difference = (0..3).map(|k| a[k].abs_diff(b[k])).max().unwrap_or(0);
        let to = (pixel / size.width) * all.width + 2 * size.width + pixel % size.width;
        all.pixels[to] = match (target.1[pixel] > 0.5, mesh.1[pixel] > 0.5) {
            (true, false) => MISSED,
            (false, true) => COVERED,
            _ => [difference, difference, difference, 255],
        };
    }
    all
}

fn byte(linear: f32) -> u8 {
    (Curve::Srgb.encode(f64::from(linear)) * 255.0).round() as u8
}

fn texture(texture: &Texture) -> Result<String> {
    let pixels = texture.texels().iter().map(|[r, g, b]| [byte(*r), byte(*g), byte(*b), 255]).collect();
    let picture = Picture { width: texture.width() as usize, height: texture.height() as usize, pixels };
    Ok(format!("<h2>Texture</h2>\n{}\n", image(&picture)?))
}

/// A picture within the page.
fn image(picture: &Picture) -> Result<String> {
    Ok(format!("<img alt=\"\" src=\"data:image/png;base64,{}\">", STANDARD.encode(picture.png()?)))
}

/// The losses of steps, by their logarithm.
fn curve(losses: &[(usize, f64)]) -> String {
    let positive: Vec<(f64, f64)> = losses.iter().filter(|l| l.1 > 0.0).map(|l| (l.0 as f64, l.1.ln())).collect();
    let (Some(first), Some(last)) = (positive.first(), positive.last()) else { return "<p>No steps.</p>".into() };
    let range = positive.iter().fold((f64::MAX, f64::MIN), |range, l| (range.0.min(l.1), range.1.max(l.1)));
    let x = |step: f64| 900.0 * (step - first.0) / (last.0 - first.0).max(1.0);
    let y = |log: f64| 10.0 + 200.0 * (range.1 - log) / (range.1 - range.0).max(1e-9);
    let points: String = positive.iter().map(|l| format!("{:.1},{:.1} ", x(l.0), y(l.1))).collect();
    let ends = format!("{:.5} at step {}, {:.5} at step {}", first.1.exp(), first.0, last.1.exp(), last.0);
    format!(
        "<p>{ends}; the scale is logarithmic.</p>\n<svg viewBox=\"0 0 900 220\" width=\"900\">\
         <polyline fill=\"none\" stroke=\"#1f64be\" stroke-width=\"2\" points=\"{points}\"/></svg>"
    )
}

/// A text within HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
