//! Hollows of a hull that no outline shows, such as a mug's: found by the light in them.
//!
//! A visual hull lies over a hollow like a lid. If the object has one colour and the lights are known, the hollow is shaded
//! differently in the pictures than the lid. So regions of the hull that look wrong are pushed inwards, by several depths. The push
//! that brings the renderings nearest to the pictures is kept, if they are clearly nearer than the hull's, and then its depth and its
//! outline are moved until the renderings come no nearer. A fit's small steps do not get there: a lid that is bent a little looks no
//! more like a hollow than a flat one does.

mod eye;
mod surface;

use crate::{
    evened,
    photographs::{color::color_under_light, subject::Subject},
    work::Work,
};
use eye::Eye;
use softras::{Mesh, Result};
use softras_io::Views;
use surface::{Region, Surface};

/// The most hollows that are looked for.
const MOST_HOLLOWS: usize = 4;
/// Shares of the way to the other side by which a region is pushed; the steps by which the best of them then changes, one
/// after the other; and the largest of all shares.
const DEPTHS: [f64; 6] = [0.15, 0.3, 0.45, 0.6, 0.75, 0.9];
const FINER: [f64; 3] = [0.06, 0.03, 0.015];
const DEEPEST: f64 = 0.98;
/// Shares of the largest error from which on a vertex belongs to a region.
const LEVELS: [f64; 3] = [0.25, 0.4, 0.6];
/// Rings of triangles by which the best region is made larger or smaller, at most: on all sides at once, then on each side alone.
const MOST_RINGS: usize = 4;
/// A hollow must leave less than this share of the error. This is tested before its outline is moved, since moving the outline
/// lowers the error of a region that is no hollow, too.
const GAIN: f64 = 0.97;

/// The hull with its hollows, and how many there are. `edge` is the length of its edges.
///
/// # Errors
/// Those of rendering and remeshing.
pub fn dug(hull: Mesh, edge: f64, views: &Views, subject: &Subject, work: &mut Work) -> Result<(Mesh, usize)> {
    let Some(mut eye) = Eye::new(views, subject, work)? else { return Ok((hull, 0)) };
    let (mut mesh, mut hollows) = (hull, 0);
    while hollows < MOST_HOLLOWS {
        eye.color = color_under_light(&mesh, subject, eye.work.renderer)?;
        let Some(deeper) = deeper(&mesh, &mut eye)? else { break };
        (mesh, hollows) = (evened(&deeper, edge)?, hollows + 1);
    }
    Ok((mesh, hollows))
}

/// A push of a region, and the error that it leaves.
struct Push {
    region: Region,
    share: f64,
    error: f64,
}

impl Push {
    fn new(surface: &Surface<'_>, eye: &mut Eye, region: Region, share: f64) -> Result<Self> {
        let error = eye.error(&surface.pushed(&region, share)?)?;
        Ok(Self { region, share, error })
    }

    /// The best push around this one: a step deeper or less deep, then of a region larger or smaller as a whole or at a side.
    fn refined(self, surface: &Surface<'_>, eye: &mut Eye, step: f64) -> Result<Self> {
        let mut best = self;
        for share in [best.share - step, (best.share + step).min(DEEPEST)] {
            let push = Self::new(surface, eye, best.region.clone(), share)?;
            best = if push.error < best.error { push } else { best };
        }
        let around = best.region.sides();
        for side in std::iter::once(None).chain(around.iter().map(Some)) {
            for grows in [true, false] {
                for _ in 0..MOST_RINGS {
                    let push = Self::new(surface, eye, surface.ringed(&best.region, grows, side), best.share)?;
                    if push.error >= best.error {
                        break;
                    }
                    best = push;
                }
            }
        }
        Ok(best)
    }
}

/// The mesh after the best of all pushes; `None` if none leaves less than [`GAIN`] of the error. The triangles around the region
/// are then as long as the push.
fn deeper(mesh: &Mesh, eye: &mut Eye) -> Result<Option<Mesh>> {
    let error = eye.error(mesh)?;
    let surface = Surface::new(mesh)?;
    let errors = surface.smoothed(eye.errors(mesh)?);
    let mut tried: Vec<Region> = Vec::new();
    let mut best: Option<Push> = None;
    for region in LEVELS.iter().flat_map(|level| surface.regions(&errors, *level)) {
        if tried.iter().any(|other| other.is_in == region.is_in) {
            continue;
        }
        for share in DEPTHS {
            let push = Push::new(&surface, eye, region.clone(), share)?;
            if best.as_ref().is_none_or(|best| push.error < best.error) {
                best = Some(push);
            }
        }
        tried.push(region);
    }
    let Some(mut best) = best.filter(|best| best.error < GAIN * error) else { return Ok(None) };
    for step in FINER {
        best = best.refined(&surface, eye, step)?;
    }
    Ok(Some(surface.pushed(&best.region, best.share)?))
}
