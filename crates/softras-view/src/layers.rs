//! Transparent materials, drawn as a second layer.
//!
//! The model orders by depth, so that a near pane outweighs what lies behind it: it has no glass. Opaque and transparent
//! triangles are therefore rendered as two frames, and in each pixel the nearer one is blended over the other: the front's alpha
//! f and the back's b make f + (1 - f) b. The alpha of the transparent layer is its silhouette times its material's opacity. Of
//! several panes the nearest is drawn.

use crate::{options::Output, solid::solid};
use softras::scene::{Appearance, Background, ColorAggregation, Lights, Outputs};
use softras::{Camera, Frame, Image, Mesh, Renderer, Result, Scene, Settings};

/// The transparent triangles of a mesh.
#[derive(Debug)]
pub struct Glass {
    scene: Scene,
    opacity: Opacity<Box<Scene>>,
}

/// How much a layer hides.
#[derive(Debug)]
enum Opacity<T> {
    /// The same everywhere.
    One(f32),
    /// By triangle: a scene, or a frame, whose grey values are the opacities.
    Several(T),
}

/// A frame of transparent triangles.
#[derive(Debug)]
pub struct Layer {
    frame: Frame,
    opacity: Opacity<Frame>,
}

/// Takes the triangles with an opacity below 1 out of a mesh; `opacity` has one value a triangle, or none at all.
pub fn separate(mesh: Mesh, opacity: &[f32]) -> Result<(Mesh, Option<Glass>)> {
    let (clear, solid): (Vec<usize>, Vec<usize>) = (0..opacity.len()).partition(|&t| opacity[t] < 1.0);
    let Some(&first) = clear.first() else { return Ok((mesh, None)) };
    let glass = mesh.part(&clear)?;
    let opacities = if clear.iter().all(|&t| opacity[t] == opacity[first]) {
        Opacity::One(opacity[first])
    } else {
        let texels = clear.iter().map(|&t| [opacity[t]; 3]).collect();
        let grey = glass.clone().with_appearance(Appearance::Surface { resolution: 1, texels })?;
        Opacity::Several(Box::new(Scene::new(grey).with_lights(Lights::unlit())))
    };
    Ok((mesh.part(&solid)?, Some(Glass { scene: Scene::new(glass), opacity: opacities })))
}

impl Glass {
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
                let outputs = Outputs { color: true, silhouette: true, depth: false, normal: false };
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

/// What multiplies an image's values, as the composite background's model has them.
fn factor(settings: &Settings, output: Output, alpha: f32) -> f32 {
    let blended = output == Output::Color || settings.color == ColorAggregation::Softmax;
    if settings.background == Background::Composite && blended { alpha } else { 1.0 }
}

impl<'a> Surface<'a> {
    fn of(frame: &'a Frame, output: Output, is_solid: bool) -> Result<Self> {
        let silhouette = frame.silhouette()?;
        let alpha = if is_solid { solid(silhouette) } else { silhouette.view(0).to_vec() };
        let depth = frame.depth()?;
        Ok(Self { image: image_of(frame, output)?, depth: depth.view(0), model: silhouette.view(0), alpha })
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

    /// One image of both layers, in the convention of the model's own. `is_solid`: alpha is 1 inside of surfaces. A depth or a
    /// normal is that of the nearer layer where it covers more than half of the pixel. Without a background to blend with,
    /// `transparent`, colours are straight.
    ///
    /// # Errors
    /// [`softras::Error::Settings`] for an image that the frames do not have.
    pub fn over(
        &self,
        opaque: &Frame,
        settings: &Settings,
        output: Output,
        is_solid: bool,
        transparent: bool,
    ) -> Result<Image> {
        let below = Surface::of(opaque, output, is_solid)?;
        let above = Surface::of(&self.frame, output, is_solid)?;
        let opacities = self.opacities(settings)?;
        let channels = below.image.channels;
        let mut image = below.image.clone();
        for (pixel, values) in image.data.chunks_exact_mut(channels).enumerate() {
            let glass = above.alpha[pixel] * opacities[pixel];
            let is_front = above.depth(settings, pixel) < below.depth(settings, pixel);
            let alphas = if is_front { [glass, below.alpha[pixel]] } else { [below.alpha[pixel], glass] };
            let surfaces = if is_front { [&above, &below] } else { [&below, &above] };
            let shares = [alphas[0], (1.0 - alphas[0]) * alphas[1]];
            let alpha = shares[0] + shares[1];
            let shown = surfaces.map(|surface| surface.alpha[pixel]);
            for (channel, value) in values.iter_mut().enumerate() {
                let [front, back] = surfaces.map(|surface| surface.straight(settings, output, pixel, channel));
                let mixed = front * shares[0] + back * shares[1];
                *value = match output {
                    Output::Silhouette => alpha,
                    Output::Color if settings.background == Background::Weighted && transparent => {
                        mixed / alpha.max(f32::MIN_POSITIVE)
                    }
                    Output::Color => mixed + (1.0 - alpha) * settings.background_color[channel] as f32,
                    _ => {
                        let nearer = shown[0] >= 0.5 || shown[1] <= 0.0;
                        factor(settings, output, alpha) * if nearer { front } else { back }
                    }
                };
            }
        }
        Ok(image)
    }
}
