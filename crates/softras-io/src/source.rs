//! A mesh file that is being read, and what reading one gives.

use crate::{coincident::face_away, fault, input, notes::Notes, placed, textures::Room};
use softras::{
    Mesh, Result,
    scene::{Appearance, Texture},
};
use std::path::{Path, PathBuf};

/// Options for reading a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadOptions {
    /// Decode textures from sRGB to linear. Off, a texel is its value / 255, as in the official renderer.
    pub srgb: bool,
    /// Allow materials and textures outside the mesh's folder. Off, a mesh from elsewhere cannot make softras read
    /// other files.
    pub allow_outside: bool,
    /// Refuse a file of which something is not kept, instead of telling it in [`Loaded::notes`].
    pub strict: bool,
    /// The most bytes of memory that the mesh with its materials and textures may take, counted before they are read; `None`:
    /// what the sizes of the files allow.
    pub memory: Option<u64>,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self { srgb: true, allow_outside: false, strict: false, memory: None }
    }
}

/// A mesh, and notes on what was not kept of its file.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The mesh.
    pub mesh: Mesh,
    /// The normals of each triangle's corners as the file gives them, of any length, 0 where it gives none; empty for files
    /// without. The mesh has one vertex for each of the file's, which may have several normals: [`Mesh::with_normals`] takes
    /// them once its vertices are split, as `softras render` does.
    pub normals: Vec<[[f32; 3]; 3]>,
    /// The opacity of each triangle's material: `d` or 1 less `Tr` of an MTL file, the alpha of a glTF file's base colour; empty
    /// where all are 1. The model has no glass: `softras render` blends these triangles over the others, everything else draws
    /// them opaque. The alpha of textures is in the mesh.
    pub opacity: Vec<f32>,
    /// Whether each triangle is drawn from its front alone: as the materials of a glTF file say unless they are `doubleSided`, and
    /// where one of another colour lies on its back; empty where none is. `softras render` leaves out what it hides, and so does
    /// `softras_view::seen` in other scenes. Everything else draws both sides.
    pub single_sided: Vec<bool>,
    /// Whether all materials of the file say that light does not shade them.
    pub unlit: bool,
    /// Where the mesh's origin lies in the file's coordinates: 0, but for a mesh that lies so far from there that 32-bit numbers
    /// would lose its shape.
    pub origin: [f64; 3],
    /// Whether the format says that y is up, as glTF does.
    pub y_is_up: bool,
    /// The names of the file's materials that triangles have.
    pub materials: Vec<String>,
    /// Notes on parts of the file that are not in the mesh, each with its line.
    pub notes: Vec<String>,
    /// All files that were read: the mesh file first, then its materials and textures.
    pub files: Vec<PathBuf>,
}

impl From<Mesh> for Loaded {
    /// A mesh of no file.
    fn from(mesh: Mesh) -> Self {
        let (normals, opacity, single_sided, unlit, origin, y_is_up) = Default::default();
        let (materials, notes, files) = Default::default();
        Self { mesh, normals, opacity, single_sided, unlit, origin, y_is_up, materials, notes, files }
    }
}

impl Loaded {
    /// The mesh in the file's own coordinates, in 32 bits: with a note on what that loses of a mesh that lies far from 0.
    ///
    /// # Errors
    /// As [`Loaded::relative_to`].
    pub fn at_place(self) -> Result<Self> {
        self.relative_to([0.0; 3])
    }

    /// The mesh relative to an origin in the file's coordinates, such as that of another mesh, with a note if it lies far from there.
    ///
    /// # Errors
    /// [`softras::Error::OutOfMemory`].
    pub fn relative_to(mut self, origin: [f64; 3]) -> Result<Self> {
        let shift = [0, 1, 2].map(|k| self.origin[k] - origin[k]);
        if shift != [0.0; 3] {
            let file = self.files.first().map_or(Path::new("mesh"), PathBuf::as_path);
            let mut positions = input::vector(file, self.mesh.positions().len())?;
            positions.extend(self.mesh.positions().iter().map(|p| placed(*p, shift).map(|x| x as f32)));
            let largest = |all: &[[f32; 3]]| all.as_flattened().iter().fold(0.0f32, |far, x| far.max(x.abs()));
            let far = largest(&positions);
            if f64::from(far) > FAR * f64::from(largest(self.mesh.positions())) {
                let step = (far.log2().floor() - 23.0).exp2();
                let what = format!("coordinates up to {far} are rounded to steps of {step}");
                self.notes.push(format!("{what}: move the mesh nearer to 0"));
            }
            self.mesh.set_positions(positions)?;
            self.origin = origin;
        }
        Ok(self)
    }
}

/// Whether a mesh may have a vertex there.
pub fn is_point(position: &[f64; 3]) -> bool {
    position.iter().all(|x| x.abs() <= f64::from(Mesh::FARTHEST))
}

/// Takes out all but some values, unless there are none.
fn pick<T: Copy>(values: &mut Vec<T>, kept: &[usize]) {
    if !values.is_empty() {
        *values = kept.iter().map(|&t| values[t]).collect();
    }
}

/// The largest side of a box, and how far it reaches from 0 along an axis.
fn extent(low: [f64; 3], high: [f64; 3]) -> (f64, f64) {
    let size = [0, 1, 2].map(|k| high[k] - low[k]).into_iter().fold(0.0, f64::max);
    (size, low.iter().chain(&high).fold(0.0f64, |far, x| far.max(x.abs())))
}

/// An origin for what lies in a box so far from 0 that 32-bit numbers would lose its shape; 0 for what lies near.
pub fn far_origin(low: [f64; 3], high: [f64; 3]) -> [f64; 3] {
    let (size, far) = extent(low, high);
    if !(size > 0.0 && far > FAR * size && far.is_finite()) {
        return [0.0; 3];
    }
    // A multiple of a power of two, so that differences are exact.
    let unit = size.log2().floor().exp2();
    [0, 1, 2].map(|k| ((low[k] + high[k]) / 2.0 / unit).round() * unit)
}

/// A mesh file that is being read, with what is known of it besides its content.
pub struct Source<'a> {
    /// The mesh file.
    pub path: &'a Path,
    pub options: &'a LoadOptions,
    pub notes: Notes,
    /// As in [`Loaded`].
    pub files: Vec<PathBuf>,
    pub normals: Vec<[[f32; 3]; 3]>,
    pub opacity: Vec<f32>,
    pub single_sided: Vec<bool>,
    pub unlit: bool,
    pub origin: [f64; 3],
    pub y_is_up: bool,
    pub materials: Vec<String>,
    /// Bytes of memory that the files still to be read may take.
    left: u64,
}

/// Larger files are refused: their lines and vertices would not fit 32-bit numbers.
const MAX_BYTES: u64 = 1 << 32;

/// Bytes of memory that a byte of a mesh or material file takes, at most.
const MEMORY_PER_BYTE: u64 = 24;

/// How many times its size a mesh may lie from 0 before it has an origin of its own.
const FAR: f64 = 8.0;
/// Coordinates whose steps are above this share of a mesh's size are noted as coarse.
const COARSE: f64 = 1e-3;

impl<'a> Source<'a> {
    pub fn new(path: &'a Path, options: &'a LoadOptions) -> Self {
        let left = options.memory.unwrap_or(u64::MAX);
        Self {
            path,
            options,
            notes: Notes::new(path),
            files: vec![path.into()],
            normals: Vec::new(),
            opacity: Vec::new(),
            single_sided: Vec::new(),
            unlit: false,
            origin: [0.0; 3],
            y_is_up: false,
            materials: Vec::new(),
            left,
        }
    }

    /// Reads a file whole, of a size whose content the memory left can hold.
    ///
    /// # Errors
    /// As [`input::open`]; [`Error::File`](softras::Error::File) for a larger file.
    pub fn read_bytes(&mut self, path: &Path) -> Result<Vec<u8>> {
        let bytes = input::open(path)?.metadata().map_or(0, |metadata| metadata.len());
        let needed = bytes.saturating_mul(MEMORY_PER_BYTE);
        if needed > self.left {
            let [needed, left] = [needed, self.left].map(|bytes| bytes.div_ceil(1 << 20));
            let what = format!("takes up to {needed} MiB of memory, and {left} MiB are left");
            return Err(fault(path, what, "allow more memory (--memory in the command), or give smaller files"));
        }
        self.left -= needed;
        input::read(path, MAX_BYTES)
    }

    /// Counts what was unpacked of a file, as if a file of that size had been read.
    ///
    /// # Errors
    /// [`Error::File`](softras::Error::File) for more than the memory left can hold.
    #[cfg(feature = "packed")]
    pub fn unpacked(&mut self, bytes: usize) -> Result<()> {
        let needed = (bytes as u64).saturating_mul(MEMORY_PER_BYTE);
        if needed > self.left {
            let what = format!("unpacked it takes up to {} MiB of memory", needed >> 20);
            return Err(fault(self.path, what, "allow more memory (--memory in the command), or give a smaller file"));
        }
        self.left -= needed;
        Ok(())
    }

    /// Keeps the normals of each triangle's corners, given those of the vertices.
    pub fn keep_normals(&mut self, of_vertex: &[[f32; 3]], triangles: &[[u32; 3]]) {
        if of_vertex.is_empty() {
            return;
        }
        let finite = |normal: &&[f32; 3]| normal.iter().all(|x| x.is_finite());
        let bad = of_vertex.iter().filter(|normal| !finite(normal));
        bad.for_each(|_| self.notes.count(None, "normals that are not finite are not used"));
        let normal = |corner: u32| of_vertex.get(corner as usize).filter(finite).copied().unwrap_or_default();
        self.normals = triangles.iter().map(|triangle| triangle.map(normal)).collect();
    }

    /// The mesh of positions as [`Source::placed`] gives them. Triangles with a corner that is no point of a mesh are left out with a
    /// note, at the line of the first; vertices that no triangle uses may be anywhere. Triangles that lie on each other and face
    /// opposite ways are single-sided from here on; another note counts those of several colours that face the same way.
    ///
    /// # Errors
    /// Those of [`Mesh::new`] and [`Mesh::with_appearance`].
    pub fn mesh(
        &mut self,
        mut positions: Vec<[f32; 3]>,
        mut triangles: Vec<[u32; 3]>,
        mut appearance: Appearance,
        line: impl Fn(usize) -> Option<usize>,
    ) -> Result<Mesh> {
        let is_good: Vec<bool> = positions.iter().map(|p| is_point(&p.map(f64::from))).collect();
        if is_good.contains(&false) {
            let fits = |t: &usize| triangles[*t].iter().all(|&corner| is_good.get(corner as usize) != Some(&false));
            let kept: Vec<usize> = (0..triangles.len()).filter(fits).collect();
            if let Some(first) = (0..triangles.len()).find(|t| !fits(t)) {
                let what = format!(
                    "{} triangles have a corner that is no finite point: left out",
                    triangles.len() - kept.len()
                );
                self.notes.add(line(first), what);
                pick(&mut self.normals, &kept);
                pick(&mut self.opacity, &kept);
                pick(&mut self.single_sided, &kept);
                match &mut appearance {
                    Appearance::Surface { texels, .. } => pick(texels, &kept),
                    Appearance::Textured { uv_triangles, texture_of_triangle, .. } => {
                        pick(uv_triangles, &kept);
                        pick(texture_of_triangle, &kept);
                    }
                    Appearance::Uniform(_) | Appearance::VertexColors(_) => {}
                }
                pick(&mut triangles, &kept);
            }
            let place = is_good.iter().position(|good| *good).map_or([0.0; 3], |first| positions[first]);
            positions.iter_mut().zip(is_good).filter(|(_, good)| !good).for_each(|(p, _)| *p = place);
        }
        let mesh = Mesh::new(positions, triangles)?.with_appearance(appearance)?;
        let same_way = face_away(self.path, &mesh, &mut self.single_sided)?;
        if same_way > 0 {
            let lie = if same_way == 1 { "triangle lies" } else { "triangles lie" };
            let what = format!("{same_way} {lie} on others of another colour: one of the two is seen, or both mixed");
            self.notes.add(None, what);
        }
        Ok(mesh)
    }

    /// Positions as 32-bit numbers. Those of a mesh that lies far from 0 are relative to its origin, which is kept; where the file's
    /// own numbers are too coarse there, that is noted.
    ///
    /// # Errors
    /// [`softras::Error::OutOfMemory`].
    pub fn placed(&mut self, positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> Result<Vec<[f32; 3]>> {
        input::room_for(&self.path.display().to_string(), 12 * positions.len() as u64)?;
        let corners = || triangles.iter().flatten();
        let used = || corners().filter_map(|&corner| positions.get(corner as usize)).filter(|p| is_point(p));
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for p in used() {
            for k in 0..3 {
                low[k] = if p[k] < low[k] { p[k] } else { low[k] };
                high[k] = if p[k] > high[k] { p[k] } else { high[k] };
            }
        }
        self.origin = far_origin(low, high);
        if self.origin != [0.0; 3] {
            let (size, far) = extent(low, high);
            let step = (far.log2().floor() - 23.0).exp2();
            if step > COARSE * size && used().flatten().all(|x| f64::from(*x as f32) == *x) {
                let what = format!("coordinates near {far} have steps of {step}, coarse for a mesh {size:.3} wide");
                self.notes.add(None, format!("{what}: write them with more digits"));
            }
        }
        let origin = self.origin;
        Ok(positions.iter().map(|p| [0, 1, 2].map(|k| (p[k] - origin[k]) as f32)).collect())
    }

    /// How many texels the mesh's first image may have.
    pub fn room(&self) -> Room {
        Room::within(self.left, self.options.memory.is_some())
    }

    /// # Errors
    /// [`Error::File`](softras::Error::File) for the first note, if the options are strict.
    pub fn loaded(mut self, mesh: Mesh) -> Result<Loaded> {
        let is_clear = |texture: &Texture| texture.alpha().is_some_and(|alpha| alpha.iter().all(|a| *a == 0.0));
        if let Appearance::Textured { textures, .. } = mesh.appearance()
            && textures.iter().any(is_clear)
        {
            self.notes.add(None, "a texture is wholly transparent (alpha 0): its triangles are invisible");
        }
        let notes = self.notes.finish(self.options.strict)?;
        let Self { normals, opacity, single_sided, unlit, origin, y_is_up, materials, files, .. } = self;
        Ok(Loaded { mesh, normals, opacity, single_sided, unlit, origin, y_is_up, materials, notes, files })
    }
}
