//! Transparent materials, drawn as further layers.
//!
//! The model orders by depth, so that a near pane outweighs what lies behind it: it has no glass. Opaque triangles are therefore
//! rendered as one frame and transparent ones as frames of a layer each, in which none hides another ([`panes`]). Each pixel then
//! blends its surfaces from the nearest to the farthest: the front's alpha f and the alpha b of what lies behind make
//! f + (1 - f) b. The alpha of a layer is its silhouette times its opacity.

use crate::{
    facing::{Sided, all_seen, turned},
    options::Output,
    panes::{MOST, panes},
    solid::solid,
};
use softras::scene::{Appearance, Background, ColorAggregation, Lights, Outputs, Texture};
use softras::{Camera, Frame, Image, Mesh, Renderer, Result, Scene, Settings};

/// Surfaces of two layers whose depths differ by less than this share are in one place, and the nearer one is drawn: it is more than
/// [`turned`] moves back faces, and than two triangles with a common edge differ there.
const ONE_PLACE: f32 = 2e-5;
/// A texture is glass, and not a cut-out with soft edges, if more than this share of the texels that are seen are neither clear nor
/// opaque, to within [`NEARLY`].
const GLASS: f32 = 0.5;
const NEARLY: f32 = 0.05;

/// The transparent triangles of a mesh.
#[derive(Debug)]
pub struct Glass {
    sides: Sided,
    /// The triangles of `sides`, with their opacities as grey values.
    grey: Mesh,
    /// The opacity of each; `None` where a texture has it.
    opacity: Vec<Option<f32>>,
}

/// Transparent triangles of which none hides another from a camera.
#[derive(Debug)]
pub struct Pane {
    scene: Scene,
    opacity: Opacity<Box<Scene>>,
}

/// How much a layer hides.
#[derive(Debug)]
enum Opacity<T> {
    /// One opacity everywhere.
    One(f32),
    /// A scene, or a frame, whose grey values are the opacities.
    Several(T),
}

/// A frame of transparent triangles.
#[derive(Debug)]
pub struct Layer {
    frame: Frame,
    opacity: Opacity<Frame>,
}

/// Whether a texture's alpha is that of glass.
fn is_glass(texture: &Texture) -> bool {
    let count = |least: f32| texture.alpha().map_or(0, |alpha| alpha.iter().filter(|a| **a > least).count());
    let (seen, opaque) = (count(NEARLY), count(1.0 - NEARLY));
    (seen - opaque) as f32 > GLASS * seen as f32
}

/// Takes the transparent triangles out of a mesh: those with an opacity below 1, and those with a texture of glass. Triangles of
/// opacity 0 are nowhere. `opacity` has one value a triangle, or none at all.
pub fn separate(whole: Sided, opacity: &[f32]) -> Result<(Sided, Option<Glass>)> {
    let (textures, texture_of_triangle) = match whole.mesh.appearance() {
        Appearance::Textured { textures, texture_of_triangle, .. } => (&textures[..], &texture_of_triangle[..]),
        _ => (&[][..], &[][..]),
    };
    let glassy: Vec<bool> = textures.iter().map(is_glass).collect();
    let texture_of = |t: usize| texture_of_triangle.get(t).map_or(0, |&texture| texture as usize);
    let is_textured = |t: usize| glassy.get(texture_of(t)).is_some_and(|glassy| *glassy);
    let of = |t: usize| opacity.get(t).copied().unwrap_or(1.0);
    let (clear, solid): (Vec<usize>, Vec<usize>) =
        (0..whole.mesh.triangles().len()).partition(|&t| of(t) < 1.0 || is_textured(t));
    if clear.is_empty() {
        return Ok((whole, None));
    }
    let clear: Vec<usize> = clear.into_iter().filter(|&t| of(t) > 0.0).collect();
    let Sided { mesh, single_sided } = whole.part(&clear)?;
    let glass = Glass {
        grey: grey(mesh.clone(), &glassy, clear.iter().map(|&t| of(t)).collect())?,
        opacity: clear.iter().map(|&t| (!is_textured(t)).then(|| of(t))).collect(),
        sides: Sided { mesh: without_alpha(mesh, &glassy)?, single_sided },
    };
    Ok((whole.part(&solid)?, (!clear.is_empty()).then_some(glass)))
}

/// A mesh whose textures of glass are opaque.
fn without_alpha(mesh: Mesh, glassy: &[bool]) -> Result<Mesh> {
    let mut appearance = mesh.appearance().clone();
    if let Appearance::Textured { textures, .. } = &mut appearance {
        for (texture, _) in textures.iter_mut().zip(glassy).filter(|(_, glassy)| **glassy) {
            *texture = Texture::new(texture.width(), texture.height(), texture.texels().to_vec(), texture.wrap())?;
        }
    }
    mesh.with_appearance(appearance)
}

/// A mesh whose grey values are opacities, of triangles and of textures of glass.
fn grey(mesh: Mesh, glassy: &[bool], opacity: Vec<f32>) -> Result<Mesh> {
    let appearance = match mesh.appearance() {
        Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle } if glassy.contains(&true) => {
            let mut greys: Vec<((usize, u32), Texture)> = Vec::new();
            let mut of_triangle = Vec::with_capacity(opacity.len());
            for (t, opacity) in opacity.into_iter().enumerate() {
                let key = (texture_of_triangle.get(t).map_or(0, |&i| i as usize), opacity.to_bits());
                let known = greys.iter().position(|(known, _)| *known == key);
                of_triangle.push(known.unwrap_or(greys.len()) as u32);
                if known.is_none() {
                    let texture = &textures[key.0];
                    let alpha = texture.alpha().filter(|_| glassy[key.0]).unwrap_or(&[]);
                    let texels = alpha.iter().map(|alpha| [alpha * opacity; 3]).collect();
                    greys.push((
                        key,
                        match alpha {
                            [] => Texture::new(1, 1, vec![[opacity; 3]], texture.wrap())?,
                            _ => Texture::new(texture.width(), texture.height(), texels, texture.wrap())?,
                        },
                    ));
                }
            }
            let textures = greys.into_iter().map(|(_, texture)| texture).collect();
            let (uvs, uv_triangles) = (uvs.clone(), uv_triangles.clone());
            Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle: of_triangle }
        }
        _ => Appearance::Surface { resolution: 1, texels: opacity.into_iter().map(|opacity| [opacity; 3]).collect() },
    };
    mesh.with_appearance(appearance)
}

impl Glass {
    /// The triangles of each layer that a camera sees.
    fn layers(&self, camera: &Camera, settings: &Settings) -> Vec<Vec<usize>> {
        let Sided { mesh, single_sided } = &self.sides;
        let seen = all_seen(mesh, single_sided, camera);
        panes(mesh, &seen, camera, (settings.width, settings.height), settings.near)
    }

    /// The number of triangles without a layer of their own: of these, the nearest is drawn.
    pub fn crowded(&self, camera: &Camera, settings: &Settings) -> usize {
        self.layers(camera, settings).get(MOST).map_or(0, Vec::len)
    }

    /// The layers that a camera sees. `turns`: normals point to the viewer.
    ///
    /// # Errors
    /// As [`Mesh::part`].
    pub fn panes(&self, camera: &Camera, settings: &Settings, turns: bool) -> Result<Vec<Pane>> {
        let pane = |triangles: &Vec<usize>| {
            let part = |mesh: &Mesh| {
                mesh.part(triangles).and_then(|part| if turns { turned(&part, camera) } else { Ok(part) })
            };
            let first = self.opacity[triangles[0]];
            let opacity = match first.filter(|_| triangles.iter().all(|&t| self.opacity[t] == first)) {
                Some(opacity) => Opacity::One(opacity),
                None => Opacity::Several(Box::new(Scene::new(part(&self.grey)?).with_lights(Lights::unlit()))),
            };
            Ok(Pane { scene: Scene::new(part(&self.sides.mesh)?), opacity })
        };
        self.layers(camera, settings).iter().map(pane).collect()
    }
}

impl Pane {
    /// Renders the layer.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn shoot(
        &mut self,
        renderer: &mut Renderer,
        camera: &Camera,
        lights: &Lights,
        settings: &Settings,
    ) -> Result<Layer> {
        self.scene.lights = lights.clone();
        let cameras = std::slice::from_ref(camera);
        let opacity = match &self.opacity {
            Opacity::One(opacity) => Opacity::One(*opacity),
            Opacity::Several(scene) => {
                let outputs = Outputs { color: true, silhouette: true, ..Outputs::NOTHING };
                let settings = Settings { outputs, background_color: [0.0; 3], ..settings.clone() };
                Opacity::Several(renderer.render(scene, cameras, &settings)?)
            }
        };
        Ok(Layer { frame: renderer.render(&self.scene, cameras, settings)?, opacity })
    }
}

/// The images of a frame that the blending needs.
struct Surface<'a> {
    image: &'a Image,
    depth: &'a [f32],
    /// The model's silhouette, and what stands for it in the picture.
    model: &'a [f32],
    alpha: Vec<f32>,
    /// How much it hides where it is; `None`: everything.
    opacity: Option<Vec<f32>>,
}

/// The frame's image of an output.
pub fn image_of(frame: &Frame, output: Output) -> Result<&Image> {
    match output {
        Output::Color => frame.color(),
        Output::Silhouette => frame.silhouette(),
        Output::Depth => frame.depth(),
        Output::Normal => frame.normal(),
    }
}

/// The factor that the model with the composite background has put on an image's values.
fn factor(settings: &Settings, output: Output, alpha: f32) -> f32 {
    let blended = output == Output::Color || settings.color == ColorAggregation::Softmax;
    if settings.background == Background::Composite && blended { alpha } else { 1.0 }
}

impl<'a> Surface<'a> {
    fn of(frame: &'a Frame, opacity: Option<Vec<f32>>, output: Output, is_solid: bool) -> Result<Self> {
        let silhouette = frame.silhouette()?;
        let alpha = if is_solid { solid(silhouette) } else { silhouette.view(0).to_vec() };
        let depth = frame.depth()?;
        Ok(Self { image: image_of(frame, output)?, depth: depth.view(0), model: silhouette.view(0), alpha, opacity })
    }

    /// A value without the background.
    fn straight(&self, settings: &Settings, output: Output, pixel: usize, channel: usize) -> f32 {
        let alpha = self.model[pixel];
        let value = self.image.data[pixel * self.image.channels + channel];
        let ground = if output == Output::Color { settings.background_color[channel] as f32 } else { 0.0 };
        let factor = factor(settings, output, alpha);
        if alpha > 0.0 { (value - (1.0 - factor) * ground) / factor } else { 0.0 }
    }

    fn depth(&self, settings: &Settings, pixel: usize) -> f32 {
        let alpha = self.model[pixel];
        if alpha > 0.0 { self.depth[pixel] / factor(settings, Output::Depth, alpha) } else { f32::INFINITY }
    }

    /// The share of what lies behind that it hides.
    fn hides(&self, pixel: usize) -> f32 {
        self.alpha[pixel] * self.opacity.as_ref().map_or(1.0, |opacity| opacity[pixel])
    }
}

impl Layer {
    /// The layer's frames.
    pub fn frames(&self) -> impl Iterator<Item = &Frame> {
        let others = if let Opacity::Several(frame) = &self.opacity { Some(frame) } else { None };
        std::iter::once(&self.frame).chain(others)
    }

    /// How much it hides where it is, by pixel.
    fn opacities(&self, settings: &Settings) -> Result<Vec<f32>> {
        match &self.opacity {
            Opacity::One(opacity) => Ok(vec![*opacity; self.frame.silhouette()?.data.len()]),
            Opacity::Several(frame) => {
                let (color, alpha) = (frame.color()?, frame.silhouette()?);
                let opacity = |(grey, &alpha): (&[f32], &f32)| {
                    let value = grey[0] / factor(settings, Output::Color, alpha);
                    if alpha > 0.0 { value.clamp(0.0, 1.0) } else { 0.0 }
                };
                Ok(color.data.chunks_exact(3).zip(&alpha.data).map(opacity).collect())
            }
        }
    }
}

/// One image of the opaque frame and all layers, in the convention of the model's own. `is_solid`: alpha is 1 inside of surfaces. A
/// depth or a normal is that of the nearest surface that covers more than half of the pixel. Without a background to blend with,
/// `transparent`, colours are straight.
///
/// # Errors
/// [`softras::Error::Settings`] for an image that the frames do not have.
pub fn blended(
    opaque: &Frame,
    layers: &[Layer],
    settings: &Settings,
    output: Output,
    is_solid: bool,
    transparent: bool,
) -> Result<Image> {
    let mut surfaces = vec![Surface::of(opaque, None, output, is_solid)?];
    for layer in layers {
        surfaces.push(Surface::of(&layer.frame, Some(layer.opacities(settings)?), output, is_solid)?);
    }
    let mut image = surfaces[0].image.clone();
    let (channels, mut here) = (image.channels, Vec::with_capacity(surfaces.len()));
    for (pixel, values) in image.data.chunks_exact_mut(channels).enumerate() {
        here.clear();
        here.extend(surfaces.iter().map(|surface| (surface.depth(settings, pixel), surface)));
        here.retain(|(depth, _)| depth.is_finite());
        here.sort_by(|a, b| a.0.total_cmp(&b.0));
        here.dedup_by(|far, near| {
            far.1.opacity.is_some() && near.1.opacity.is_some() && far.0 - near.0 < ONE_PLACE * near.0
        });
        let alpha = 1.0 - here.iter().map(|(_, surface)| 1.0 - surface.hides(pixel)).product::<f32>();
        let nearest = here.iter().find(|(_, surface)| surface.alpha[pixel] >= 0.5).or(here.first());
        for (channel, value) in values.iter_mut().enumerate() {
            let straight = |surface: &Surface| surface.straight(settings, output, pixel, channel);
            let (mut mixed, mut through) = (0.0, 1.0);
            for (_, surface) in here.iter().filter(|_| output == Output::Color) {
                mixed += through * surface.hides(pixel) * straight(surface);
                through *= 1.0 - surface.hides(pixel);
            }
            *value = match output {
                Output::Silhouette => alpha,
                Output::Color if settings.background == Background::Weighted && transparent => {
                    mixed / alpha.max(f32::MIN_POSITIVE)
                }
                Output::Color => mixed + (1.0 - alpha) * settings.background_color[channel] as f32,
                _ => nearest.map_or(0.0, |(_, surface)| factor(settings, output, alpha) * straight(surface)),
            };
        }
    }
    Ok(image)
}
