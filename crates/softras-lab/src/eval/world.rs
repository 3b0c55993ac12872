//! Reads scenes in world space: meshes, cameras, lights, and settings by their names in the library.

use super::keys::{self, set};
use super::{Job, Layout};
use glam::{DMat4, DVec4};
use softras::scene::{Appearance, DirectionalLight, Outputs, Parity};
use softras::{Camera, Error, Lights, Mesh, Projection, Result, Scene, Settings};
use softras_io::npy::Array;
use softras_io::npz::Archive;
use softras_io::text::name as shown;

/// Reads a scene in world space.
///
/// # Errors
/// [`Error::File`] naming the key, what it holds and what was expected.
pub fn read(archive: &Archive, parity: Parity) -> Result<Job> {
    let settings = Settings { parity, ..settings(archive)? };
    let (meshes, origin) = meshes(archive)?;
    let cameras = cameras(archive, meshes.len(), origin)?;
    let lights = lights(archive)?;
    let scene = if meshes.len() == 1 { Scene { meshes, lights } } else { Scene::batch(meshes).with_lights(lights) };
    Ok(Job { scene, cameras, settings, layout: Layout::World })
}

fn settings(archive: &Archive) -> Result<Settings> {
    let mut s = Settings::default();
    for (key, field) in [("width", &mut s.width), ("height", &mut s.height)] {
        if let Some(number) = keys::number(archive, key)? {
            *field = keys::pixels(archive, key, number)?;
        }
    }
    set(&mut s.sigma, keys::number(archive, "sigma")?);
    set(&mut s.gamma, keys::number(archive, "gamma")?);
    set(&mut s.epsilon, keys::number(archive, "epsilon")?);
    set(&mut s.tau, keys::number(archive, "tau")?);
    set(&mut s.support, keys::choice(archive, "support", keys::SUPPORT)?);
    set(&mut s.near, keys::number(archive, "near")?);
    set(&mut s.far, keys::number(archive, "far")?);
    set(&mut s.color, keys::choice(archive, "color", keys::COLOR)?);
    set(&mut s.silhouette, keys::choice(archive, "silhouette", keys::SILHOUETTE)?);
    set(&mut s.distance, keys::choice(archive, "distance", keys::DISTANCE)?);
    set(&mut s.background, keys::choice(archive, "background", keys::BACKGROUND)?);
    set(&mut s.background_color, keys::triple(archive, "background_color")?);
    set(&mut s.faces, keys::choice(archive, "faces", keys::FACES)?);
    set(&mut s.front_face, keys::choice(archive, "front_face", keys::FRONT_FACE)?);
    set(&mut s.interpolation, keys::choice(archive, "interpolation", keys::INTERPOLATION)?);
    set(&mut s.surface_point, keys::choice(archive, "surface_point", keys::SURFACE_POINT)?);
    set(&mut s.outputs, outputs(archive)?);
    Ok(s)
}

/// `outputs`: texts, each one name or several with commas between.
fn outputs(archive: &Archive) -> Result<Option<Outputs>> {
    let key = "outputs";
    let Some(array) = archive.get(key)? else { return Ok(None) };
    let Some(texts) = array.texts() else {
        return Err(archive.fault(key, &format!("is {}", array.dtype()), "texts are expected, as ['color', 'depth']"));
    };
    let mut wanted = Outputs::NOTHING;
    for text in texts {
        for name in text.split(',').map(str::trim) {
            match name {
                "color" => wanted.color = true,
                "silhouette" => wanted.silhouette = true,
                "depth" => wanted.depth = true,
                "normal" => wanted.normal = true,
                _ => {
                    let what = format!("asks for \"{}\"", shown(name));
                    return Err(archive.fault(key, &what, "use color, silhouette, depth, normal"));
                }
            }
        }
    }
    Ok(Some(wanted))
}

/// The meshes, and the origin that their vertices are relative to: 0, unless they lie far from there.
fn meshes(archive: &Archive) -> Result<(Vec<Mesh>, [f64; 3])> {
    let key = "vertices";
    let expected = "expected [V, 3] or [B, V, 3] (or face_vertices for a scene in screen space)";
    let array = archive.require(key, expected)?;
    let (batch, count) = match array.shape[..] {
        [count, 3] => (None, count),
        [batch, count, 3] if batch > 0 => (Some(batch), count),
        _ => return Err(keys::misshapen(archive, key, array, "[V, 3] or [B, V, 3]")),
    };
    let (positions, origin) = placed(archive, key, array)?;
    let triangles = triangles(archive, count)?;
    let entries = batch.unwrap_or(1);
    let colors = colors(archive, batch, count, triangles.len())?;
    let mut meshes = Vec::with_capacity(entries);
    for b in 0..entries {
        let named = |e: Error| archive.fault(key, &format!("entry {b} of the batch: {e}"), "see above");
        let mesh = Mesh::new(positions[b * count..(b + 1) * count].to_vec(), triangles.clone()).map_err(named)?;
        meshes.push(mesh.with_appearance(colors.of_entry(b)).map_err(named)?);
    }
    Ok((meshes, origin))
}

/// Vertices in 32 bits. Those that lie far from 0 are relative to an origin, so that they keep their digits.
fn placed(archive: &Archive, key: &str, array: &Array) -> Result<(Vec<[f32; 3]>, [f64; 3])> {
    let mut rows = keys::rows::<3>(archive, key, array)?;
    let numbers = archive.numbers(key, array)?;
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for (i, x) in numbers.iter().enumerate() {
        (low[i % 3], high[i % 3]) = (low[i % 3].min(x), high[i % 3].max(x));
    }
    let origin = softras_io::far_origin(low, high);
    if origin != [0.0; 3] {
        rows.iter_mut()
            .enumerate()
            .for_each(|(row, p)| *p = [0, 1, 2].map(|k| (numbers.at(3 * row + k) - origin[k]) as f32));
    }
    Ok((rows, origin))
}

fn triangles(archive: &Archive, count: usize) -> Result<Vec<[u32; 3]>> {
    let key = "triangles";
    let array = archive.require(key, "expected [F, 3], indices from 0")?;
    let [_, 3] = array.shape[..] else { return Err(keys::misshapen(archive, key, array, "[F, 3]")) };
    let numbers = archive.numbers(key, array)?;
    let outside = |i: f64| !(i.fract() == 0.0 && (0.0..count as f64).contains(&i));
    if let Some(at) = numbers.iter().position(outside) {
        let what = format!("triangles[{}, {}] is {:?}", at / 3, at % 3, numbers.at(at));
        return Err(archive.fault(key, &what, &format!("an index from 0 to below {count}, the number of vertices")));
    }
    Ok((0..array.shape[0]).map(|t| [0, 1, 2].map(|i| numbers.at(3 * t + i) as u32)).collect())
}

/// The colours of the meshes of a batch.
struct Colors {
    rows: Vec<[f32; 3]>,
    /// Whether rows are the colours of triangles, else of vertices; `None` for one colour.
    per_triangle: Option<bool>,
    /// The number of rows of an entry, and whether each entry has its own.
    count: usize,
    own: bool,
}

impl Colors {
    fn of_entry(&self, b: usize) -> Appearance {
        let from = if self.own { b * self.count } else { 0 };
        let rows = &self.rows[from..from + self.count];
        match self.per_triangle {
            None => Appearance::Uniform(rows[0]),
            Some(false) => Appearance::VertexColors(rows.to_vec()),
            Some(true) => Appearance::Surface { resolution: 1, texels: rows.to_vec() },
        }
    }
}

/// The `colors`, per mesh, vertex or triangle depending on the shape; white without the key.
fn colors(archive: &Archive, batch: Option<usize>, vertices: usize, faces: usize) -> Result<Colors> {
    let key = "colors";
    let per_triangle = keys::choice(archive, "colors_per", &[("vertex", false), ("triangle", true)])?;
    let Some(array) = archive.get(key)? else {
        return Ok(Colors { rows: vec![[1.0; 3]], per_triangle: None, count: 1, own: false });
    };
    let (count, own) = match (&array.shape[..], batch) {
        ([3], _) => (None, false),
        (&[n, 3], _) => (Some(n), false),
        (&[batch, n, 3], Some(expected)) if batch == expected => (Some(n), true),
        _ => return Err(misfit(archive, array, vertices, faces)),
    };
    let rows = keys::rows::<3>(archive, key, array)?;
    let Some(count) = count else { return Ok(Colors { rows, per_triangle: None, count: 1, own }) };
    let per_triangle = per_triangle.unwrap_or(count != vertices);
    if count != if per_triangle { faces } else { vertices } {
        return Err(misfit(archive, array, vertices, faces));
    }
    Ok(Colors { rows, per_triangle: Some(per_triangle), count, own })
}

fn misfit(archive: &Archive, array: &Array, vertices: usize, faces: usize) -> Error {
    let expected = format!("[3], [{vertices}, 3] (per vertex) or [{faces}, 3] (per triangle)");
    keys::misshapen(archive, "colors", array, &expected)
}

fn cameras(archive: &Archive, meshes: usize, origin: [f64; 3]) -> Result<Vec<Camera>> {
    let key = "view";
    let array = archive.require(key, "expected [4, 4] or [B, 4, 4], world to view, z forward")?;
    let views = match array.shape[..] {
        [4, 4] => 1,
        [views, 4, 4] if views > 0 => views,
        _ => return Err(keys::misshapen(archive, key, array, "[4, 4] or [B, 4, 4]")),
    };
    let batch = views.max(meshes);
    if (views != 1 && views != batch) || (meshes != 1 && meshes != batch) {
        return Err(keys::misshapen(archive, key, array, &format!("[4, 4] or [{meshes}, 4, 4], as vertices has")));
    }
    let numbers = archive.numbers(key, array)?;
    let projections = projections(archive, batch)?;
    let camera = |(b, projection): (usize, Projection)| {
        let m = |i: usize| numbers.at(if views == 1 { i } else { 16 * b + i });
        let row = |i: usize| DVec4::new(m(4 * i), m(4 * i + 1), m(4 * i + 2), m(4 * i + 3));
        let matrix = DMat4::from_cols(row(0), row(1), row(2), row(3)).transpose();
        let named = |e: Error| archive.fault(key, &format!("view {b}: {e}"), "view x right, y up, z forward");
        Camera::from_matrix(matrix * DMat4::from_translation(origin.into()), projection).map_err(named)
    };
    projections.into_iter().enumerate().map(camera).collect()
}

/// One projection per view, from the keys of the one kind of projection that the file must have.
fn projections(archive: &Archive, batch: usize) -> Result<Vec<Projection>> {
    let has = ["fov_y", "half_height", "fx"].map(|key| archive.has(key));
    if has.iter().filter(|h| **h).count() != 1 {
        let what = if has.contains(&true) { "more than one kind of projection" } else { "no projection" };
        return Err(archive.fault("fov_y", what, "give fov_y (radians), or half_height, or fx, fy, cx and cy"));
    }
    let each = |key: &str| per_view(archive, key, batch);
    if has[0] {
        return Ok(each("fov_y")?.into_iter().map(|fov_y| Projection::Perspective { fov_y }).collect());
    }
    if has[1] {
        let wrap = |half_height| Projection::Orthographic { half_height };
        return Ok(each("half_height")?.into_iter().map(wrap).collect());
    }
    let (fx, fy, cx, cy) = (each("fx")?, each("fy")?, each("cx")?, each("cy")?);
    Ok((0..batch).map(|b| Projection::Pinhole { fx: fx[b], fy: fy[b], cx: cx[b], cy: cy[b] }).collect())
}

/// A number for all views, or one for each.
fn per_view(archive: &Archive, key: &str, batch: usize) -> Result<Vec<f64>> {
    let array = archive.require(key, "a number, or one per view, is expected")?;
    let numbers = archive.numbers(key, array)?;
    match numbers.len() {
        1 => Ok(vec![numbers.at(0); batch]),
        n if n == batch => Ok(numbers.iter().collect()),
        _ => Err(keys::misshapen(archive, key, array, &format!("a number or [{batch}]"))),
    }
}

fn lights(archive: &Archive) -> Result<Lights> {
    let mut lights = Lights::unlit();
    set(&mut lights.ambient_color, keys::triple(archive, "ambient_color")?);
    set(&mut lights.ambient_intensity, keys::number(archive, "ambient_intensity")?);
    set(&mut lights.shading, keys::choice(archive, "shading", keys::SHADING)?);
    let directions = triples(archive, "light_directions", None)?.unwrap_or_default();
    let count = directions.len();
    let colors = triples(archive, "light_colors", Some(count))?.unwrap_or_else(|| vec![[1.0; 3]; count]);
    let intensities = match archive.has("light_intensities") {
        true => per_view(archive, "light_intensities", count)?,
        false => vec![1.0; count],
    };
    let all = directions.into_iter().zip(colors).zip(intensities);
    lights.directional =
        all.map(|((direction, color), intensity)| DirectionalLight { direction, color, intensity }).collect();
    Ok(lights)
}

/// `[L, 3]`, or `[3]` for a single one; as many as `count` where it is given.
fn triples(archive: &Archive, key: &str, count: Option<usize>) -> Result<Option<Vec<[f64; 3]>>> {
    let Some(array) = archive.get(key)? else { return Ok(None) };
    let rows = match array.shape[..] {
        [3] => 1,
        [rows, 3] => rows,
        _ => return Err(keys::misshapen(archive, key, array, "[L, 3]")),
    };
    if count.is_some_and(|count| count != rows) {
        return Err(keys::misshapen(archive, key, array, &format!("[{}, 3], as light_directions", count.unwrap_or(0))));
    }
    let numbers = archive.numbers(key, array)?;
    Ok(Some((0..rows).map(|row| [0, 1, 2].map(|i| numbers.at(3 * row + i))).collect()))
}
