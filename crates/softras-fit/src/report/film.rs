//! The animation of a fit, with the target on the left and the mesh on the right.

use crate::{Fitting, photographs::cameras::scaled, pooled, sized};
use softras::{
    Camera, Lights, Mesh, Renderer, Result, Scene, Settings,
    scene::{Background, DirectionalLight, Shading},
};
use softras_io::{Curve, Picture, write_gif};
use std::path::Path;

/// The most frames.
const FRAMES: usize = 32;
/// The height of a frame in pixels: that of the images that are fitted, within these.
const HEIGHTS: [usize; 2] = [128, 256];
const SAMPLES: usize = 2;
/// Hundredths of a second between frames.
const DELAY: u16 = 8;
/// How many times the last frame is repeated.
const LAST: usize = 15;

/// The frames so far.
#[derive(Clone, Debug)]
pub struct Film {
    frames: Vec<Picture>,
    every: usize,
    /// The camera, scaled for frames with SAMPLES along each side of a pixel.
    camera: Option<Camera>,
    target: Picture,
    size: (u32, u32),
    settings: Settings,
    /// The lights of the fit; `None` where it has no colours.
    lights: Option<Lights>,
}

impl Film {
    /// Shows the view in which the target is largest of those that see it from the side or from halfway above, as people see
    /// things, or of all where none does.
    ///
    /// # Errors
    /// None for the cameras of a fit.
    pub fn new(fitting: &Fitting) -> Result<Self> {
        let (t, setup) = (&fitting.subject.views, &fitting.setup);
        let area = |view: &usize| t.silhouette.as_ref().map_or(0.0, |s| s.view(*view).iter().sum::<f32>());
        let view = largest(&t.cameras, area);
        let shape = t.silhouette.as_ref().map_or((1, 1), |s| (s.height, s.width));
        let size = frame_size(shape);
        let target = match (&t.color, &t.silhouette) {
            (Some(color), Some(alpha)) => picture(color.view(view), alpha.view(view), shape),
            (None, Some(alpha)) => {
                let grey: Vec<f32> = alpha.view(view).iter().flat_map(|a| [0.2 * a; 3]).collect();
                picture(&grey, alpha.view(view), shape)
            }
            _ => Picture::filled(1, 1, [255; 4]),
        };
        let times = [size.0 as usize, size.1 as usize].map(|side| (SAMPLES * side) as f64);
        let times = [times[0] / shape.1 as f64, times[1] / shape.0 as f64];
        Ok(Self {
            frames: Vec::new(),
            every: setup.iterations.div_ceil(FRAMES),
            camera: t.cameras.get(view).map(|camera| scaled(camera, times)).transpose()?,
            target: enlarged(&target, size),
            size,
            settings: setup.settings(0),
            lights: setup.given.is_colored().then(|| fitting.subject.lights.clone()),
        })
    }

    /// Whether the mesh of a step is a frame of the animation.
    pub fn shows(&self, step: usize) -> bool {
        step.is_multiple_of(self.every)
    }

    /// Adds a frame of the mesh.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn add(&mut self, mesh: &Mesh, renderer: &mut Renderer) -> Result<()> {
        let Some(camera) = self.camera else { return Ok(()) };
        let settings = Settings {
            sigma: 1e-7,
            gamma: 1e-5,
            background: Background::Composite,
            ..sized(&self.settings, (self.size.1 as usize, self.size.0 as usize), SAMPLES)
        };
        let lights = self.lights.clone().unwrap_or_else(|| lights(&camera));
        let frame = renderer.render(&Scene::new(mesh.clone()).with_lights(lights), &[camera], &settings)?;
        let [color, alpha] = [pooled(frame.color()?, SAMPLES)?, pooled(frame.silhouette()?, SAMPLES)?];
        let shown = picture(&color.data, &alpha.data, (self.size.1 as usize, self.size.0 as usize));
        let mut both = Picture::filled(2 * shown.width, shown.height, [255; 4]);
        both.paste(&self.target, 0, 0);
        both.paste(&shown, shown.width, 0);
        self.frames.push(both);
        Ok(())
    }

    /// Writes the animation, with its last frame held.
    ///
    /// # Errors
    /// [`softras::Error::Io`].
    pub fn write(mut self, path: &Path) -> Result<()> {
        if let Some(last) = self.frames.last().cloned() {
            self.frames.extend(std::iter::repeat_n(last, LAST));
        }
        write_gif(path, &self.frames, DELAY)
    }
}

/// The view of the largest area among those from the side or from halfway above, or among all where none is.
fn largest(cameras: &[Camera], area: impl Fn(&usize) -> f32) -> usize {
    // The height to which the camera looks: 0 for a level one, -1 for one that looks straight down.
    let usual = |view: &usize| (-0.75..=0.05).contains(&cameras[*view].axes()[2].y);
    let most = |views: &mut dyn Iterator<Item = usize>| views.max_by(|a, b| area(a).total_cmp(&area(b)));
    most(&mut (0..cameras.len()).filter(usual)).or_else(|| most(&mut (0..cameras.len()))).unwrap_or(0)
}

/// Width and height of the frames for images of `rows` rows and `columns` columns.
fn frame_size((rows, columns): (usize, usize)) -> (u32, u32) {
    let height = rows.clamp(HEIGHTS[0], HEIGHTS[1]);
    ((height * columns / rows.max(1)).max(1) as u32, height as u32)
}

/// A light from the camera's upper left, and a little ambient light.
fn lights(camera: &Camera) -> Lights {
    let [right, up, forward] = camera.axes();
    let direction = (-0.5 * right + 0.7 * up - 0.7 * forward).to_array();
    Lights {
        ambient_color: [1.0; 3],
        ambient_intensity: 0.15,
        directional: vec![DirectionalLight { direction, color: [1.0; 3], intensity: 0.7 }],
        shading: Shading::Flat,
    }
}

/// The linear value of the ground, a grey on which white and black both show.
const GROUND: f32 = 0.4;

/// The picture of premultiplied linear colours over the ground.
pub fn picture(color: &[f32], alpha: &[f32], (height, width): (usize, usize)) -> Picture {
    let byte = |c: f32, a: f32| (Curve::Srgb.encode(f64::from(c.abs() + (1.0 - a) * GROUND)) * 255.0).round() as u8;
    let pixel = |(c, &a): (&[f32], &f32)| [byte(c[0], a), byte(c[1], a), byte(c[2], a), 255];
    Picture { width, height, pixels: color.chunks_exact(3).zip(alpha).map(pixel).collect() }
}

/// Enlarges a picture by repeating pixels.
fn enlarged(picture: &Picture, (width, height): (u32, u32)) -> Picture {
    let (width, height) = (width as usize, height as usize);
    let at = |i: usize| {
        let (row, column) = (i / width * picture.height / height, i % width * picture.width / width);
        picture.pixels[row * picture.width + column]
    };
    Picture { width, height, pixels: (0..width * height).map(at).collect() }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::{frame_size, largest};
    use softras::{Camera, Projection};

    #[test]
    fn the_film_looks_from_the_side_or_halfway_above_where_a_view_does() {
        let projection = Projection::Perspective { fov_y: 0.5 };
        let camera = |elevation| Camera::from_angles(3.0, elevation, 20.0, projection).unwrap();
        let areas = |view: &usize| [9.0, 1.0, 2.0, 8.0][*view];
        let chosen = |elevations: [f64; 4]| largest(&elevations.map(camera), areas);
        assert_eq!(chosen([-40.0, 0.0, 30.0, 80.0]), 2);
        assert_eq!(chosen([-40.0, -30.0, -20.0, 80.0]), 0);
        assert_eq!(largest(&[], areas), 0);
    }

    #[test]
    fn frames_are_as_large_as_the_images_within_limits() {
        assert_eq!(frame_size((64, 64)), (128, 128));
        assert_eq!(frame_size((160, 200)), (200, 160));
        assert_eq!(frame_size((512, 1024)), (512, 256));
        assert_eq!(frame_size((0, 0)), (1, 128));
    }
}
