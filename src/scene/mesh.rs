//! A triangle mesh and its appearance: colours, surface cells or textures.

use super::texture::Texture;
use crate::error::{Error, Result};

/// The colours of a mesh, before light.
#[derive(Clone, Debug, PartialEq)]
pub enum Appearance {
    /// One RGB colour for the whole mesh.
    Uniform([f32; 3]),
    /// One RGB colour per vertex, interpolated over the triangle.
    VertexColors(Vec<[f32; 3]>),
    /// The official "surface" texture: `resolution²` RGB cells per triangle, looked up without interpolation:
    /// with (x, y) = ⌊R·b₀⌋, ⌊R·b₁⌋, cell y·R + x in the lower half (R·b₀ - x + R·b₁ - y ≤ 1), else
    /// (R-1-y)·R + R-1-x. Cell `c` of triangle `t` is `texels[t·R² + c]`.
    Surface {
        /// R, cells along an edge; 1 is a colour per face.
        resolution: u32,
        /// `triangles × R²` colours.
        texels: Vec<[f32; 3]>,
    },
    /// Image textures at UV coordinates.
    Textured {
        /// UV coordinates; u to the right, v up, the image in the unit square.
        uvs: Vec<[f32; 2]>,
        /// For each triangle the three indices into `uvs`, so that seams may split a vertex.
        uv_triangles: Vec<[u32; 3]>,
        /// The images.
        textures: Vec<Texture>,
        /// For each triangle its image; empty when there is only one.
        texture_of_triangle: Vec<u32>,
    },
}

/// A triangle mesh in world space: right-handed, y up, triangles counter-clockwise seen from outside.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    appearance: Appearance,
    /// One for each vertex, or none at all.
    normals: Vec<[f32; 3]>,
    /// `channels` for each vertex, or none at all.
    features: Vec<f32>,
    channels: u32,
    /// Whether every vertex belongs to a triangle.
    all_used: bool,
    /// The largest number of triangle corners that share a vertex.
    most_corners: u32,
}

fn mesh_error<T>(what: String, place: String, fix: &str) -> Result<T> {
    Err(Error::Mesh { what, place, fix: fix.into() })
}

fn validate_finite<const N: usize>(values: &[[f32; N]], what: &str, element: &str) -> Result<()> {
    match first_not_finite(values.as_flattened()).map(|at| at / N) {
        Some(i) => mesh_error(
            format!("{what} {:?} is not finite", values[i]),
            format!("{element} {i}"),
            "remove or repair it: every value must be a finite number",
        ),
        None => Ok(()),
    }
}

/// The index of the first value that is infinite or a NaN.
pub(crate) fn first_not_finite(values: &[f32]) -> Option<usize> {
    // Sixteen at a time without a branch, which compilers turn into vector instructions.
    const INFINITE: u32 = 0x7f80_0000;
    let bad = |x: &f32| x.to_bits() & INFINITE == INFINITE;
    let block = values.chunks(16).position(|chunk| chunk.iter().fold(false, |any, x| any | bad(x)))?;
    values[16 * block..].iter().position(bad).map(|at| 16 * block + at)
}

fn validate_colors(colors: &[[f32; 3]], what: &str, element: &str) -> Result<()> {
    validate_finite(colors, what, element)?;
    match colors.iter().position(|c| c.iter().any(|x| x.abs() > Mesh::BRIGHTEST)) {
        Some(i) => mesh_error(
            format!("{what} {:?} is beyond ±{:e}", colors[i], Mesh::BRIGHTEST),
            format!("{element} {i}"),
            "scale colours down: their sums would overflow single precision",
        ),
        None => Ok(()),
    }
}

fn validate_positions(positions: &[[f32; 3]]) -> Result<()> {
    validate_finite(positions, "position", "vertex")?;
    match positions.iter().position(|p| p.iter().any(|x| x.abs() > Mesh::FARTHEST)) {
        Some(i) => mesh_error(
            format!("position {:?} is beyond ±{:e}", positions[i], Mesh::FARTHEST),
            format!("vertex {i}"),
            "scale the scene down: products of its coordinates would overflow single precision",
        ),
        None => Ok(()),
    }
}

fn validate_count(what: &str, got: usize, expected: usize) -> Result<()> {
    if got == expected {
        return Ok(());
    }
    mesh_error(format!("{got} {what}, expected {expected}"), "the whole array".into(), "give exactly that many")
}

fn validate_indices(triangles: &[[u32; 3]], count: usize, what: &str) -> Result<()> {
    for (t, triangle) in triangles.iter().enumerate() {
        if let Some(c) = triangle.iter().position(|&i| i as usize >= count) {
            return mesh_error(
                format!("{what} index {} but there are {count}", triangle[c]),
                format!("triangle {t}, corner {c}"),
                "indices count from 0",
            );
        }
    }
    Ok(())
}

impl Mesh {
    /// The largest coordinate of a vertex in world units: beyond it, rotating, clipping and projecting would overflow
    /// single precision.
    pub const FARTHEST: f32 = 1e25;

    /// The largest value of a colour channel: a pixel sums the weighted colours of all triangles, under all lights, before it
    /// divides by the sum of weights, and that sum must stay finite.
    pub const BRIGHTEST: f32 = super::texture::BRIGHTEST;

    /// The most features of a vertex.
    pub const MOST_FEATURES: u32 = 32;

    /// A white mesh.
    ///
    /// `positions` are `[x, y, z]` in world units, `triangles` index them from 0.
    ///
    /// # Errors
    /// [`Error::Mesh`] for a position that is not finite or beyond ±[`Mesh::FARTHEST`], or an index out of range.
    pub fn new(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> Result<Self> {
        validate_positions(&positions)?;
        validate_indices(&triangles, positions.len(), "vertex")?;
        // Files are read in any memory: this vector may be what no longer fits.
        let mut corners: Vec<u32> = Vec::new();
        corners.try_reserve_exact(positions.len()).map_err(|_| Error::OutOfMemory {
            what: "the corners of each vertex".into(),
            bytes: 4 * positions.len() as u64,
            fix: "use a smaller mesh".into(),
        })?;
        corners.resize(positions.len(), 0);
        triangles.iter().flatten().for_each(|&vertex| corners[vertex as usize] += 1);
        let all_used = corners.iter().all(|&n| n > 0);
        let most_corners = corners.into_iter().max().unwrap_or(0);
        let (appearance, normals) = (Appearance::Uniform([1.0; 3]), Vec::new());
        let features = Vec::new();
        Ok(Self { positions, triangles, appearance, normals, features, channels: 0, all_used, most_corners })
    }

    /// Gives the mesh another appearance.
    ///
    /// # Errors
    /// [`Error::Mesh`] when counts do not fit the mesh, an index is out of range, a value is not finite or a
    /// colour beyond ±[`Mesh::BRIGHTEST`].
    pub fn with_appearance(mut self, appearance: Appearance) -> Result<Self> {
        match &appearance {
            Appearance::Uniform(color) => validate_colors(&[*color], "colour", "uniform colour")?,
            Appearance::VertexColors(colors) => {
                validate_count("vertex colours", colors.len(), self.positions.len())?;
                validate_colors(colors, "colour", "vertex")?;
            }
            Appearance::Surface { resolution, texels } => {
                if !(1..=1024).contains(resolution) {
                    return mesh_error(
                        format!("surface resolution {resolution}"),
                        "appearance".into(),
                        "use 1 to 1024 cells along an edge",
                    );
                }
                let cells = (*resolution as usize).pow(2);
                validate_count("surface texels", texels.len(), self.triangles.len() * cells)?;
                validate_colors(texels, "surface texel", "texel")?;
            }
            Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle } => {
                validate_count("UV triangles", uv_triangles.len(), self.triangles.len())?;
                validate_indices(uv_triangles, uvs.len(), "UV")?;
                validate_finite(uvs, "UV", "UV")?;
                if let Some(i) = uvs.iter().position(|uv| uv.iter().any(|x| x.abs() > 1e4)) {
                    return mesh_error(
                        format!("UV {:?} is beyond ±10000", uvs[i]),
                        format!("UV {i}"),
                        "shift it by whole numbers: the image repeats",
                    );
                }
                if textures.is_empty() {
                    return mesh_error("no texture".into(), "appearance".into(), "give at least one image");
                }
                if !texture_of_triangle.is_empty() {
                    validate_count("texture indices", texture_of_triangle.len(), self.triangles.len())?;
                    let beyond = texture_of_triangle.iter().position(|&i| i as usize >= textures.len());
                    if let Some(t) = beyond {
                        return mesh_error(
                            format!("texture {} but there are {}", texture_of_triangle[t], textures.len()),
                            format!("triangle {t}"),
                            "indices count from 0",
                        );
                    }
                }
            }
        }
        self.appearance = appearance;
        Ok(self)
    }

    /// Gives each vertex of the mesh a normal, `[x, y, z]` in world space and of any length, which smooth shading takes in
    /// place of the mean of the triangles' normals; `[0, 0, 0]` stands for that mean. An empty vector stands for the
    /// mean everywhere. Normals are kept as unit vectors.
    ///
    /// Gradients do not go through them, and [`set_positions`](Self::set_positions) drops them.
    ///
    /// # Errors
    /// [`Error::Mesh`] for another count than that of the vertices, or a normal that is not finite.
    pub fn with_normals(mut self, normals: Vec<[f32; 3]>) -> Result<Self> {
        if !normals.is_empty() {
            validate_count("normals", normals.len(), self.positions.len())?;
            validate_finite(&normals, "normal", "vertex")?;
        }
        let unit = |n: [f32; 3]| glam::DVec3::from(n.map(f64::from)).normalize_or_zero().as_vec3().to_array();
        self.normals = normals.into_iter().map(unit).collect();
        Ok(self)
    }

    /// Gives each vertex `channels` features, which are interpolated, weighted and summed as vertex colours are, and are not
    /// lit: [`Outputs::features`](crate::scene::Outputs::features) renders them. `features` has those of vertex 0, then those of
    /// vertex 1, and so on. With no channel the mesh has none.
    ///
    /// # Errors
    /// [`Error::Mesh`] for more than [`Mesh::MOST_FEATURES`] channels, for another number of values than vertices × channels, and
    /// for a value that is not finite or beyond ±[`Mesh::BRIGHTEST`].
    pub fn with_features(mut self, channels: u32, features: Vec<f32>) -> Result<Self> {
        if channels > Self::MOST_FEATURES {
            let fix = "render them in several frames: their gradients add up";
            return mesh_error(format!("{channels} features"), "a vertex".into(), fix);
        }
        validate_count("features", features.len(), self.positions.len() * channels as usize)?;
        let bad = |x: &f32| x.is_nan() || x.abs() > Self::BRIGHTEST;
        if let Some(i) = features.iter().position(bad) {
            let (what, channels) = (format!("feature {}", features[i]), channels as usize);
            let place = format!("vertex {}, channel {}", i / channels, i % channels);
            return mesh_error(what, place, &format!("give finite numbers within ±{:e}", Self::BRIGHTEST));
        }
        (self.channels, self.features) = (channels, features);
        Ok(self)
    }

    /// Replaces the vertex positions and keeps triangles and appearance: the step of an optimisation loop. Normals of the
    /// mesh's own would be those of another shape, and are dropped.
    ///
    /// # Errors
    /// [`Error::Mesh`] when the count differs or a position is not finite or beyond ±[`Mesh::FARTHEST`]; the mesh is
    /// then unchanged.
    pub fn set_positions(&mut self, positions: Vec<[f32; 3]>) -> Result<()> {
        validate_count("positions", positions.len(), self.positions.len())?;
        validate_positions(&positions)?;
        self.positions = positions;
        self.normals = Vec::new();
        Ok(())
    }

    /// Vertex positions, `[x, y, z]` in world units.
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// The largest number of triangle corners that share a vertex.
    pub(crate) fn most_corners(&self) -> u32 {
        self.most_corners
    }

    /// Vertex indices of each triangle.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The unit normals of the vertices ([`with_normals`](Self::with_normals)), 0 where the triangles decide; empty
    /// if they do everywhere.
    pub fn normals(&self) -> &[[f32; 3]] {
        &self.normals
    }

    /// The features of the vertices ([`with_features`](Self::with_features)), one vertex after the other.
    pub fn features(&self) -> &[f32] {
        &self.features
    }

    /// The features of each vertex.
    pub fn feature_channels(&self) -> u32 {
        self.channels
    }

    /// The appearance of the mesh.
    pub fn appearance(&self) -> &Appearance {
        &self.appearance
    }

    /// Whether a texture has an alpha below 1.
    pub(crate) fn has_opacity(&self) -> bool {
        let Appearance::Textured { textures, .. } = &self.appearance else { return false };
        textures.iter().any(|texture| texture.alpha().is_some())
    }

    /// The smallest and largest corner of the box around the vertices that triangles use; `None` without any.
    pub fn bounds(&self) -> Option<([f32; 3], [f32; 3])> {
        let around = |(low, high): ([f32; 3], [f32; 3]), p: [f32; 3]| {
            let each = |f: fn(f32, f32) -> f32, a: [f32; 3]| [f(a[0], p[0]), f(a[1], p[1]), f(a[2], p[2])];
            (each(f32::min, low), each(f32::max, high))
        };
        let first = self.used_positions().next()?;
        Some(self.used_positions().fold((first, first), around))
    }

    /// The mesh with the triangles of these indices only, in this order, and only the vertices that they use.
    ///
    /// # Panics
    /// For an index out of range.
    ///
    /// # Errors
    /// As [`Mesh::with_appearance`].
    pub fn part(&self, kept: &[usize]) -> Result<Self> {
        let mut vertices: Vec<u32> = kept.iter().flat_map(|&t| self.triangles()[t]).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let place = |v: u32| vertices.partition_point(|&other| other < v) as u32;
        let triangles = kept.iter().map(|&t| self.triangles()[t].map(place)).collect();
        let positions = vertices.iter().map(|&v| self.positions()[v as usize]).collect();
        let appearance = match self.appearance() {
            Appearance::Uniform(color) => Appearance::Uniform(*color),
            Appearance::VertexColors(colors) => {
                Appearance::VertexColors(vertices.iter().map(|&v| colors[v as usize]).collect())
            }
            Appearance::Surface { resolution, texels } => {
                let cells = (*resolution as usize).pow(2);
                let of = |t: &usize| texels[t * cells..(t + 1) * cells].to_vec();
                Appearance::Surface { resolution: *resolution, texels: kept.iter().flat_map(of).collect() }
            }
            Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle } => Appearance::Textured {
                uvs: uvs.clone(),
                uv_triangles: kept.iter().map(|&t| uv_triangles[t]).collect(),
                textures: textures.clone(),
                texture_of_triangle: kept.iter().filter_map(|&t| texture_of_triangle.get(t).copied()).collect(),
            },
        };
        let normals = if self.normals().is_empty() { &[] } else { &vertices[..] };
        let normals = normals.iter().map(|&v| self.normals()[v as usize]).collect();
        let channels = self.channels as usize;
        let of = |&v: &u32| &self.features[v as usize * channels..][..channels];
        let features = vertices.iter().flat_map(of).copied().collect();
        let part = Self::new(positions, triangles)?.with_appearance(appearance)?.with_normals(normals)?;
        part.with_features(self.channels, features)
    }

    /// The positions that triangles use, some of them more than once.
    pub(crate) fn used_positions(&self) -> impl Iterator<Item = [f32; 3]> {
        let all = if self.all_used { &self.positions[..] } else { &[] };
        let triangles = if self.all_used { &[] } else { &self.triangles[..] };
        all.iter().copied().chain(triangles.iter().flatten().map(|&i| self.positions[i as usize]))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn values_that_are_not_finite_are_found() {
        let mut values = vec![f32::MAX; 100];
        assert_eq!(first_not_finite(&values), None);
        for (at, value) in [(99, f32::NAN), (50, f32::NEG_INFINITY), (16, f32::INFINITY), (0, -f32::NAN)] {
            values[at] = value;
            assert_eq!(first_not_finite(&values), Some(at));
        }
        assert_eq!(first_not_finite(&[]), None);
    }

    #[test]
    fn vertices_that_no_triangle_uses_are_out_of_bounds() {
        let corners = vec![[0.0, 1.0, 2.0], [1.0, -1.0, 3.0], [-2.0, 0.0, 0.0]];
        let around = Some(([-2.0, -1.0, 0.0], [1.0, 1.0, 3.0]));
        let mesh = Mesh::new(corners.clone(), vec![[0, 1, 2]]);
        assert_eq!(mesh.ok().and_then(|m| m.bounds()), around);
        let with_another = [corners, vec![[9.0; 3]]].concat();
        assert_eq!(Mesh::new(with_another.clone(), vec![[2, 0, 1]]).ok().and_then(|m| m.bounds()), around);
        assert_eq!(Mesh::new(with_another, Vec::new()).ok().and_then(|m| m.bounds()), None);
    }

    #[test]
    fn normals_are_validated_and_kept_as_unit_vectors() {
        let mesh = Mesh::new(vec![[0.0; 3]; 3], vec![[0, 1, 2]]).unwrap();
        let given = |normals: &[[f32; 3]]| mesh.clone().with_normals(normals.to_vec());
        let normals = given(&[[0.0, 0.0, 3e38], [0.0; 3], [1e-40, 0.0, 0.0]]).map(|mesh| mesh.normals().to_vec());
        assert_eq!(normals.ok(), Some(vec![[0.0, 0.0, 1.0], [0.0; 3], [1.0, 0.0, 0.0]]));
        assert_eq!(given(&[]).ok().as_ref(), Some(&mesh));
        let told = |normals: &[[f32; 3]]| given(normals).map_err(|error| error.to_string());
        assert!(told(&[[1.0; 3]; 2]).is_err_and(|text| text.contains("2 normals, expected 3")));
        let bad = [[1.0; 3], [f32::NAN; 3], [1.0; 3]];
        assert!(told(&bad).is_err_and(|text| text.contains("vertex 1")));
        // Moving the vertices drops the normals, which would be those of another shape.
        let mut moved = given(&[[1.0; 3]; 3]).unwrap();
        assert!(moved.set_positions(vec![[1.0; 3]; 3]).is_ok() && moved.normals().is_empty());
    }

    #[test]
    fn the_most_corners_of_a_vertex_are_counted() {
        let most = |triangles: &[[u32; 3]]| Mesh::new(vec![[0.0; 3]; 6], triangles.to_vec()).map(|m| m.most_corners());
        assert_eq!([most(&[]).ok(), most(&[[1, 2, 3]]).ok()], [Some(0), Some(1)]);
        assert_eq!(most(&[[0, 1, 2], [2, 1, 3], [4, 2, 2], [5, 4, 3]]).ok(), Some(4));
    }

    #[test]
    fn a_part_keeps_what_its_triangles_are_made_of() -> Result<()> {
        let positions = (0..6).map(|i| [i as f32, 0.0, 1.0]).collect();
        let mesh = Mesh::new(positions, vec![[0, 1, 2], [5, 3, 1]])?;
        let colors = (0..6).map(|i| [i as f32; 3]).collect();
        let normals = (0..6).map(|i| [0.0, i as f32, 0.0]).collect();
        let mesh = mesh.with_appearance(Appearance::VertexColors(colors))?.with_normals(normals)?;
        let part = mesh.part(&[1])?;
        assert_eq!(part.normals(), [[0.0, 1.0, 0.0]; 3]);
        assert_eq!(part.triangles(), [[2, 1, 0]]);
        assert_eq!(part.positions(), [[1.0, 0.0, 1.0], [3.0, 0.0, 1.0], [5.0, 0.0, 1.0]]);
        assert_eq!(*part.appearance(), Appearance::VertexColors(vec![[1.0; 3], [3.0; 3], [5.0; 3]]));
        Ok(())
    }
}
