//! A rendered frame as a node of burn's graph keeps it: its packed images, and the gradients back to its inputs.

use crate::twist;
use softras::scene::Appearance;
use softras::{Error, Frame, GradientRequest, Gradients, Image, ImageGradient, Mesh, MeshGradients, Renderer, Result};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The state that clones of a renderer share.
#[derive(Debug)]
pub(crate) struct Shared {
    pub renderer: Mutex<Renderer>,
    /// The first error of a backward pass, which burn's own backward cannot return.
    pub fault: Mutex<Option<Error>>,
}

pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The inputs in the order of the operation's arguments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    Positions,
    Colors,
    Texels,
    Cameras,
}

impl Role {
    pub const ALL: [Self; 4] = [Self::Positions, Self::Colors, Self::Texels, Self::Cameras];

    pub fn columns(self) -> usize {
        if self == Self::Cameras { 6 } else { 3 }
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Positions => "positions",
            Self::Colors => "colors",
            Self::Texels => "texels",
            Self::Cameras => "cameras",
        }
    }

    /// How many rows of this input a mesh has.
    pub fn rows_of(self, mesh: &Mesh) -> usize {
        match (self, mesh.appearance()) {
            (Self::Positions, _) => mesh.positions().len(),
            (Self::Colors, Appearance::Uniform(_)) => 1,
            (Self::Colors, Appearance::VertexColors(colors)) => colors.len(),
            (Self::Texels, Appearance::Surface { texels, .. }) => texels.len(),
            _ => 0,
        }
    }
}

/// A rendered frame with what its backward pass needs.
#[derive(Debug)]
pub(crate) struct Rendered {
    pub shared: Arc<Shared>,
    pub frame: Frame,
    /// The rows of each input.
    pub rows: [usize; 4],
    /// The cameras' motions, where a tensor gives them.
    pub twists: Option<Vec<[f64; 6]>>,
}

impl Rendered {
    fn parts(&self) -> impl Iterator<Item = &Image> {
        self.frame.images().map(|(_, image)| image)
    }

    /// All images, the channels of one pixel after one another, and the shape `[views, height, width, channels]`.
    pub fn images(&self) -> (Vec<f32>, [usize; 4]) {
        let total = self.parts().map(|image| image.channels).sum();
        let (mut data, mut shape, mut from) = (Vec::new(), [0; 4], 0);
        for image in self.parts() {
            shape = [image.batch, image.height, image.width, total];
            data.resize(shape.iter().product(), 0.0);
            for (to, values) in data.chunks_exact_mut(total).zip(image.data.chunks_exact(image.channels)) {
                to[from..from + image.channels].copy_from_slice(values);
            }
            from += image.channels;
        }
        (data, shape)
    }

    /// The upstream gradient of each image; one that is zero everywhere is left out, as of an image that no loss uses.
    fn unpacked(&self, packed: &[f32]) -> ImageGradient {
        let total: usize = self.parts().map(|image| image.channels).sum();
        let mut from = 0;
        let mut next = |image: softras::Result<&Image>| {
            let image = image.ok()?;
            let range = from..from + image.channels;
            from = range.end;
            let data: Vec<f32> =
                packed.chunks_exact(total).flat_map(|pixel| pixel[range.clone()].iter().copied()).collect();
            let Image { batch, height, width, channels, .. } = *image;
            data.iter().any(|x| *x != 0.0).then_some(Image { batch, height, width, channels, data })
        };
        let frame = &self.frame;
        let (color, silhouette) = (next(frame.color()), next(frame.silhouette()));
        let (depth, normal) = (next(frame.depth()), next(frame.normal()));
        ImageGradient { color, silhouette, depth, normal, features: next(frame.features()) }
    }

    /// The gradients by the wanted inputs, from the one by the packed images. After an error, which is kept, they are NaN.
    pub fn pull_back(&self, upstream: Option<Vec<f32>>, wanted: [bool; 4]) -> [Vec<f32>; 4] {
        match self.differentiated(upstream, wanted) {
            Ok(gradients) => Role::ALL.map(|role| self.flattened(&gradients, role)),
            Err(error) => {
                lock(&self.shared.fault).get_or_insert(error);
                Role::ALL.map(|role| vec![f32::NAN; self.rows[role as usize] * role.columns()])
            }
        }
    }

    /// The renderer's gradients; none where no image has an upstream gradient.
    fn differentiated(
        &self,
        upstream: Option<Vec<f32>>,
        [positions, colors, texels, camera]: [bool; 4],
    ) -> Result<Gradients> {
        let Some(upstream) = upstream else {
            return Err(Error::Backward {
                what: "the upstream gradient cannot be read".into(),
                fix: "use 32-bit floats on a device that works".into(),
            });
        };
        let upstream = self.unpacked(&upstream);
        if upstream == ImageGradient::default() {
            return Ok(Gradients::default());
        }
        let wanted = GradientRequest { positions, colors, texels, camera, ..GradientRequest::NOTHING };
        lock(&self.shared.renderer).backward(&self.frame, &upstream, &wanted)
    }

    /// The rows of one input's gradient, zeros where it is not there.
    fn flattened(&self, gradients: &Gradients, role: Role) -> Vec<f32> {
        let values =
            |of: fn(&MeshGradients) -> &[[f32; 3]]| gradients.meshes.iter().flat_map(of).flatten().copied().collect();
        let mut flat: Vec<f32> = match role {
            Role::Positions => values(|mesh| &mesh.positions),
            Role::Colors => values(|mesh| &mesh.colors),
            Role::Texels => values(|mesh| &mesh.surface_texels),
            Role::Cameras => {
                let cameras = gradients.cameras.iter().zip(self.twists.iter().flatten());
                cameras.flat_map(|(camera, &at)| twist::pull_back(at, camera.twist).map(|x| x as f32)).collect()
            }
        };
        flat.resize(self.rows[role as usize] * role.columns(), 0.0);
        flat
    }
}
