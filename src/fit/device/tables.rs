//! The constant tables of a fit that the kernels read: connectivity, targets, weights.

use crate::constants as c;
use crate::error::Result;
use crate::fit::bad;
use crate::fit::shape::ShapeFit;
use crate::fit::topology::Topology;
use crate::image::Image;

/// The tables that the kernels read, written once.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tables {
    /// vertices + 1 offsets into this array, then the neighbours.
    pub neighbors: Vec<u32>,
    pub flaps: Vec<[u32; 4]>,
    /// vertices + 1 offsets into this array, then the flap corners of each vertex as 4 × flap + corner.
    pub flap_corners: Vec<u32>,
    /// The targets of all levels: one value a pixel, or four with colours.
    pub targets: Vec<f32>,
    /// The weights of all levels; empty without weights.
    pub weights: Vec<f32>,
    /// (1 - |v|) / |v| with v's sign; empty but for the logit parametrisation.
    pub logit_template: Vec<[f32; 4]>,
    /// (I + λ L)⁻¹, row by row; empty but for [`super::smoother::Smoother::Dense`].
    pub inverse: Vec<f32>,
}

/// The table `logit_template` of a fit in logit space.
pub fn logit_template(fit: &ShapeFit) -> Result<Vec<[f32; 4]>> {
    let Some(template) = fit.logit_template() else { return bad("no template", "use the logit parametrisation") };
    let odds = |v: f64| if v == 0.0 { 0.0 } else { ((1.0 - v.abs()) / v.abs()).copysign(v) as f32 };
    Ok(template.iter().map(|v| [odds(v.x), odds(v.y), odds(v.z), 0.0]).collect())
}

impl Tables {
    /// The tables of a mesh, without targets.
    pub fn of(topology: &Topology) -> Self {
        let vertices = topology.vertices();
        let mut corners = vec![Vec::new(); vertices];
        let mut flaps = Vec::with_capacity(topology.flaps().len());
        for (f, flap) in topology.flaps().iter().enumerate() {
            let [a, b] = flap.edge;
            let along = |t: u32| {
                let [i, j, k] = topology.triangles()[t as usize];
                [[i, j], [j, k], [k, i]].contains(&[a, b])
            };
            let bit = |on: bool, bit: u32| if on { bit } else { 0 };
            let bits = bit(flap.official, c::FLAP_OFFICIAL)
                | bit(along(flap.triangles[0]), c::FLAP_FIRST_ALONG)
                | bit(along(flap.triangles[1]), c::FLAP_SECOND_ALONG);
            let vertices = [a, b, flap.opposite[0], flap.opposite[1]];
            for (corner, &v) in vertices.iter().enumerate() {
                corners[v as usize].push(4 * f as u32 + corner as u32);
            }
            flaps.push([a | bits, b, vertices[2], vertices[3]]);
        }
        let neighbors: Vec<Vec<u32>> = (0..vertices).map(|i| topology.neighbors(i).to_vec()).collect();
        Self { neighbors: rows(&neighbors), flaps, flap_corners: rows(&corners), ..Self::default() }
    }

    /// Number of target pixels appended so far.
    pub fn target_pixels(&self, has_color: bool) -> u32 {
        (self.targets.len() / if has_color { 4 } else { 1 }) as u32
    }

    /// Appends the targets of one level.
    pub fn push_targets(&mut self, silhouette: Option<&Image>, color: Option<&Image>) {
        match color {
            Some(color) => {
                for (i, rgb) in color.data.chunks_exact(3).enumerate() {
                    self.targets.extend(rgb);
                    self.targets.push(silhouette.map_or(0.0, |s| s.data[i]));
                }
            }
            None => self.targets.extend(silhouette.iter().flat_map(|s| &s.data)),
        }
    }
}

/// Rows of different lengths as one array: the index where each row begins, the end of the last, then the rows.
fn rows(rows: &[Vec<u32>]) -> Vec<u32> {
    let mut next = rows.len() as u32 + 1;
    let mut flat = vec![next];
    for row in rows {
        next += row.len() as u32;
        flat.push(next);
    }
    flat.extend(rows.iter().flatten());
    flat
}
