//! Reads scenes in screen space, the inputs of the official renderer's kernels.

use super::keys::{self, set};
use super::{Job, Layout};
use softras::scene::{Appearance, Faces, FrontFace, Outputs, Parity};
use softras::{Camera, Error, Mesh, Result, Scene, Settings};
use softras_io::npz::Archive;

const VERTICES: &str = "face_vertices";
const TEXTURES: &str = "textures";

/// Keys of files made with the official renderer that are not inputs, and for which no note is printed.
pub const KNOWN: &[&str] = &[
    "soft_colors",
    "grad_soft_colors",
    "grad_face_vertices",
    "grad_textures",
    "aggrs_info",
    "soft_colors_f32",
    "grad_face_vertices_f32",
    "seed",
    "options",
    "effective_f32_options",
    "pairs",
    "note",
    "lib",
];

/// Reads a scene in screen space.
///
/// # Errors
/// [`Error::File`] naming the key, what it holds and what was expected.
pub fn read(archive: &Archive, parity: Parity) -> Result<Job> {
    let settings = settings(archive, parity)?;
    let meshes = meshes(archive)?;
    let cameras = vec![Camera::screen(); meshes.len()];
    Ok(Job { scene: Scene::batch(meshes), cameras, settings, layout: Layout::Screen })
}

fn settings(archive: &Archive, parity: Parity) -> Result<Settings> {
    let mut s = Settings {
        outputs: Outputs { color: true, silhouette: true, depth: false, normal: false },
        parity,
        ..Settings::default()
    };
    if let Some((height, width)) = image_size(archive)? {
        (s.height, s.width) = (height, width);
    }
    set(&mut s.background_color, keys::triple(archive, "opt_background_color")?);
    set(&mut s.near, keys::number(archive, "opt_near")?);
    set(&mut s.far, keys::number(archive, "opt_far")?);
    set(&mut s.epsilon, keys::number(archive, "opt_eps")?);
    set(&mut s.sigma, keys::number(archive, "opt_sigma_val")?);
    set(&mut s.gamma, keys::number(archive, "opt_gamma_val")?);
    set(&mut s.tau, keys::number(archive, "opt_dist_eps")?);
    set(&mut s.distance, keys::choice(archive, "opt_dist_func", keys::DISTANCE)?);
    set(&mut s.color, keys::choice(archive, "opt_aggr_func_rgb", keys::COLOR)?);
    set(&mut s.silhouette, keys::choice(archive, "opt_aggr_func_alpha", keys::SILHOUETTE)?);
    set(&mut s.front_face, keys::choice(archive, "front_face", keys::FRONT_FACE)?);
    if keys::flag(archive, "opt_fill_back")? == Some(false) {
        s.faces = Faces::Front;
    }
    if parity == Parity::Official {
        s.front_face = FrontFace::Clockwise;
        round_as_official(&mut s);
    }
    Ok(s)
}

/// Rounds the options as the official kernels do: they take float32, and the cut-off ln(1 / dist_eps - 1) in place of
/// dist_eps.
fn round_as_official(s: &mut Settings) {
    for value in [&mut s.near, &mut s.far, &mut s.epsilon, &mut s.sigma, &mut s.gamma] {
        *value = f64::from(*value as f32);
    }
    s.tau = 1.0 / (1.0 + f64::from(s.cutoff() as f32).exp());
}

/// A side, or (height, width).
fn image_size(archive: &Archive) -> Result<Option<(u32, u32)>> {
    let key = "opt_image_size";
    let Some(array) = archive.get(key)? else { return Ok(None) };
    let numbers = archive.numbers(key, array)?;
    match numbers.all().map(|[side]| [side; 2]).or(numbers.all()) {
        Some([height, width]) => Ok(Some((keys::pixels(archive, key, height)?, keys::pixels(archive, key, width)?))),
        None => Err(keys::misshapen(archive, key, array, "a number, or (height, width)")),
    }
}

/// One mesh of separate triangles per entry of the batch.
fn meshes(archive: &Archive) -> Result<Vec<Mesh>> {
    let array = archive.require(VERTICES, "expected [B, F, 3, 3]")?;
    let [batch, faces, 3, 3] = array.shape[..] else {
        return Err(keys::misshapen(archive, VERTICES, array, "[B, F, 3, 3]"));
    };
    if batch == 0 {
        return Err(keys::misshapen(archive, VERTICES, array, "at least one entry in the batch"));
    }
    let corners = keys::rows::<3>(archive, VERTICES, array)?;
    let appearances = appearances(archive, batch, faces)?;
    let mut meshes = Vec::with_capacity(batch);
    for (b, appearance) in appearances.into_iter().enumerate() {
        let positions = corners[b * faces * 3..(b + 1) * faces * 3].to_vec();
        let triangles = (0..faces as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
        let named = |e: Error| archive.fault(VERTICES, &format!("entry {b} of the batch: {e}"), "see above");
        let mesh = Mesh::new(positions, triangles).map_err(named)?;
        meshes.push(mesh.with_appearance(appearance).map_err(named)?);
    }
    Ok(meshes)
}

/// The colours of every entry of the batch; white without `textures`.
fn appearances(archive: &Archive, batch: usize, faces: usize) -> Result<Vec<Appearance>> {
    let surface = keys::choice(archive, "opt_texture_type", &[("vertex", false), ("surface", true)])?;
    let Some(array) = archive.get(TEXTURES)? else {
        return Ok(vec![Appearance::Uniform([1.0; 3]); batch]);
    };
    let cells = match array.shape[..] {
        [b, f, cells, 3] if (b, f) == (batch, faces) => cells,
        _ => {
            let expected = format!("[{batch}, {faces}, 3, 3] or [{batch}, {faces}, R², 3], as {VERTICES} has");
            return Err(keys::misshapen(archive, TEXTURES, array, &expected));
        }
    };
    // Three is not a square, so without a type the shape tells the two kinds apart.
    let surface = surface.unwrap_or(cells != 3);
    let resolution = (cells as f64).sqrt() as u32;
    if surface && (cells == 0 || resolution as usize * resolution as usize != cells) {
        let expected = format!("[{batch}, {faces}, R², 3], R a whole number, for opt_texture_type 'surface'");
        return Err(keys::misshapen(archive, TEXTURES, array, &expected));
    }
    if !surface && cells != 3 {
        let expected = format!("[{batch}, {faces}, 3, 3] for opt_texture_type 'vertex'");
        return Err(keys::misshapen(archive, TEXTURES, array, &expected));
    }
    let colors = keys::rows::<3>(archive, TEXTURES, array)?;
    let entry = |b: usize| {
        let colors = colors[b * faces * cells..(b + 1) * faces * cells].to_vec();
        if surface { Appearance::Surface { resolution, texels: colors } } else { Appearance::VertexColors(colors) }
    };
    Ok((0..batch).map(entry).collect())
}
