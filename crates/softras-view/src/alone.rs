//! Transparency and single-sided materials are no part of a mesh: pictures for people draw them, a renderer of the mesh alone does not.

use crate::crease::{area, edges, welded};
use glam::DVec3;
use softras::{Error, Mesh, Result};
use softras_io::Loaded;

const OPAQUE: (&str, &str) = (
    "transparent materials are drawn opaque: `softras render` alone blends them",
    "set their d to 1 and their Tr to 0",
);
const BOTH_SIDES: (&str, &str) = (
    "single-sided materials are drawn from both sides: `softras render` alone leaves out their backs",
    "make them doubleSided",
);

/// A mesh file for a use that draws its mesh alone, with notes on what that leaves out.
///
/// # Errors
/// [`Error::File`] in place of a note if that is `strict`.
pub fn alone(mut loaded: Loaded, strict: bool) -> Result<Loaded> {
    let lost = [(OPAQUE, !loaded.opacity.is_empty()), (BOTH_SIDES, shows_backs(&loaded.mesh, &loaded.single_sided))];
    for ((what, fix), _) in lost.into_iter().filter(|(_, is_lost)| *is_lost) {
        if strict {
            let (path, fix) =
                (loaded.files.first().cloned().unwrap_or_default(), format!("{fix}, or leave strict (--strict) out"));
            return Err(Error::File { path, line: None, what: what.into(), fix });
        }
        loaded.notes.push(what.into());
    }
    Ok(loaded)
}

/// Whether the backs of single-sided triangles may be seen from outside: not if the mesh is closed and its fronts are outside.
fn shows_backs(mesh: &Mesh, single_sided: &[bool]) -> bool {
    if !single_sided.contains(&true) {
        return false;
    }
    let edges = edges(&welded(mesh));
    let is_closed =
        edges.chunk_by(|a, b| a.ends == b.ends).all(|all| 2 * all.iter().filter(|e| e.is_rising).count() == all.len());
    let corner = |triangle: &[u32; 3]| DVec3::from(mesh.positions()[triangle[0] as usize].map(f64::from));
    let volume: f64 = mesh.triangles().iter().map(|triangle| corner(triangle).dot(area(mesh, *triangle))).sum();
    !(is_closed && volume > 0.0)
}
