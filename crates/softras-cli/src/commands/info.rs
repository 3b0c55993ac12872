//! `softras info`: what a mesh file holds.

use super::mesh_file::ReadArgs;
use super::outputs::Outputs;
use super::{Failure, say};
use clap::Args;
use serde_json::{Value, json};
use softras::scene::{Appearance, Texture};
use softras_fit::{Topology, is_closed};
use softras_io::{Budget, text};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Tell what a mesh file holds: parts, bounds, colours, textures, notes
#[derive(Args, Debug)]
#[command(after_help = "\
Notes name what is not drawn. With --strict any note is an error.

Examples:
  softras info spot.obj
  softras info scene.glb --json")]
pub struct InfoArgs {
    /// The mesh: .obj, .ply, .stl, .gltf, .glb, or a built-in one: fish
    pub mesh: PathBuf,
    /// Print one JSON object with the same content, and the files and notes
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub read: ReadArgs,
}

pub fn run(args: &InfoArgs) -> Result<(), Failure> {
    let loaded = args.read.read_layers(&args.mesh, true, &Outputs::default(), &Budget::new(args.read.memory))?;
    let mesh = &loaded.mesh;
    let used = || mesh.triangles().iter().flatten().map(|&i| mesh.positions()[i as usize]);
    // With the digits that the file gives.
    let exact = |x: f32| x.to_string().parse().unwrap_or(f64::from(x));
    let end = |pick: fn(f32, f32) -> f32| {
        [0, 1, 2].map(|k| used().map(|p| p[k]).reduce(pick).map_or(0.0, exact) + loaded.origin[k])
    };
    let (low, high) = (end(f32::min), end(f32::max));
    let (parts, closed) = (Topology::of(mesh)?.parts_and_genus().0, is_closed(mesh)?);
    let transparent = loaded.opacity.iter().filter(|opacity| **opacity < 1.0).count();
    let (colors, textures) = match mesh.appearance() {
        Appearance::Uniform(color) => (format!("one, linear {color:?}"), &[][..]),
        Appearance::VertexColors(_) => ("of vertices".into(), &[][..]),
        Appearance::Surface { texels, .. } => {
            let distinct: BTreeSet<_> = texels.iter().map(|texel| texel.map(f32::to_bits)).collect();
            (format!("of triangles, {} different", distinct.len()), &[][..])
        }
        Appearance::Textured { textures, .. } => ("of textures".into(), &textures[..]),
    };
    let count = [mesh.positions().len(), mesh.triangles().len()];
    let normals = !loaded.normals.is_empty();
    if args.json {
        let texture = |texture: &Texture| -> Value {
            json!({ "width": texture.width(), "height": texture.height(), "alpha": texture.alpha().is_some() })
        };
        let textures: Vec<Value> = textures.iter().map(texture).collect();
        let report = json!({
            "vertices": count[0], "triangles": count[1], "parts": parts, "closed": closed, "low": low, "high": high,
            "colors": colors, "textures": textures, "normals": normals, "transparent_triangles": transparent,
            "unlit": loaded.unlit, "materials": loaded.materials, "files": loaded.files, "notes": loaded.notes,
        });
        return say(&report.to_string());
    }
    let closed = if closed { "closed" } else { "not closed" };
    say(&format!("{} vertices, {} triangles, {parts} parts, {closed}", count[0], count[1]))?;
    say(&format!("bounds   {low:?} to {high:?}\ncolours  {colors}"))?;
    for texture in textures {
        let alpha = if texture.alpha().is_some() { " with alpha" } else { "" };
        say(&format!("texture  {}×{}{alpha}", texture.width(), texture.height()))?;
    }
    loaded.materials.iter().try_for_each(|name| say(&format!("material {}", text::name(name))))?;
    let clear = format!("{transparent} transparent triangles");
    let told = [(normals, "normals of the file's own"), (loaded.unlit, "unlit materials"), (transparent > 0, &clear)];
    told.iter().filter(|(holds, _)| *holds).try_for_each(|(_, text)| say(text))
}
