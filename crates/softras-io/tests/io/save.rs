//! A mesh that is written in any format is read back: the same triangles in the same places and colours.

use softras::{
    Mesh,
    scene::{Appearance, Texture, Wrap},
    shapes,
};

/// Each corner of each triangle: position and colour. In this form meshes are equal whose vertices are repeated.
fn corners(mesh: &Mesh) -> Vec<([f32; 3], [f32; 3])> {
    let one = |(t, triangle): (usize, &[u32; 3])| {
        [0, 1, 2].map(|k| {
            let vertex = triangle[k] as usize;
            let color = match mesh.appearance() {
                Appearance::Uniform(color) => *color,
                Appearance::VertexColors(colors) => colors[vertex],
                Appearance::Surface { texels, .. } => texels[t],
                Appearance::Textured { uvs, uv_triangles, .. } => {
                    let [u, v] = uvs[uv_triangles[t][k] as usize];
                    [u, v, 0.0]
                }
            };
            (mesh.positions()[vertex], color)
        })
    };
    mesh.triangles().iter().enumerate().flat_map(one).collect()
}

fn nearly_equal(a: &Mesh, b: &Mesh, name: &str) {
    let (a, b) = (corners(a), corners(b));
    assert_eq!(a.len(), b.len(), "{name}");
    for ((p, c), (q, d)) in a.iter().zip(&b) {
        assert_eq!(p, q, "{name}");
        // A byte of sRGB; near white it is the coarsest.
        assert!(c.iter().zip(d).all(|(c, d)| (c - d).abs() < 0.005), "{name}: {c:?} {d:?}");
    }
}

fn meshes() -> Vec<(&'static str, Mesh)> {
    let ball = || shapes::icosphere(1).unwrap();
    let with = |appearance| ball().with_appearance(appearance).unwrap();
    let count = ball().positions().len();
    let colors = |count: usize| (0..count).map(move |i| [i as f32 / count as f32, 0.25, 1.0 - i as f32 / count as f32]);
    vec![
        ("uniform", with(Appearance::Uniform([0.8, 0.1, 0.3]))),
        ("vertices", with(Appearance::VertexColors(colors(count).collect()))),
        ("faces", with(Appearance::Surface { resolution: 1, texels: colors(ball().triangles().len()).collect() })),
        ("texture", shapes::fish().unwrap()),
    ]
}

#[test]
fn a_mesh_comes_back_from_every_format() {
    let folder = tempfile::tempdir().unwrap();
    for (name, mesh) in meshes() {
        for ending in ["obj", "ply", "glb"] {
            let path = folder.path().join(format!("{name}.{ending}"));
            softras_io::save(&mesh, &path).unwrap();
            let options = softras_io::LoadOptions { strict: true, ..Default::default() };
            let read = softras_io::load_with(&path, &options).unwrap().mesh;
            nearly_equal(&read, &mesh, &format!("{name}.{ending}"));
            if let (Appearance::Textured { textures: a, .. }, Appearance::Textured { textures: b, .. }) =
                (read.appearance(), mesh.appearance())
            {
                let texels = a[0].texels().as_flattened().iter().zip(b[0].texels().as_flattened());
                assert!(a[0].wrap() == b[0].wrap() && texels.into_iter().all(|(a, b)| (a - b).abs() < 0.005));
            }
        }
    }
}

#[test]
fn what_a_format_cannot_hold_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let ball = shapes::icosphere(0).unwrap();
    let cells = Appearance::Surface { resolution: 2, texels: vec![[0.5; 3]; 4 * ball.triangles().len()] };
    let cells = ball.clone().with_appearance(cells).unwrap();
    for ending in ["obj", "ply", "glb"] {
        let error = softras_io::save(&cells, folder.path().join(format!("a.{ending}"))).unwrap_err().to_string();
        assert!(error.contains("resolution 2"), "{error}");
    }
    let texture = |wrap| Texture::new(1, 1, vec![[0.5; 3]], wrap).unwrap();
    let two = Appearance::Textured {
        uvs: vec![[0.0; 2]],
        uv_triangles: vec![[0; 3]; 20],
        textures: vec![texture(Wrap::Clamp), texture(Wrap::Repeat)],
        texture_of_triangle: (0..20).map(|t| t % 2).collect(),
    };
    let two = ball.with_appearance(two).unwrap();
    let error = softras_io::save(&two, folder.path().join("a.ply")).unwrap_err().to_string();
    assert!(error.contains("2 textures") && error.contains(".glb"), "{error}");
    softras_io::save(&two, folder.path().join("a.glb")).unwrap();
    assert_eq!(softras_io::load(folder.path().join("a.glb")).unwrap().triangles().len(), 20);
    let error = softras_io::save(&two, folder.path().join("a.stl")).unwrap_err().to_string();
    assert!(error.contains(".obj, .ply or .glb"), "{error}");
}

/// A mesh that was read far from 0 is written there again, with all its digits.
#[test]
fn a_mesh_is_written_where_it_was_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    let corners =
        [[500_000.125, 4_649_776.0, 100.5], [500_001.5, 4_649_776.0, 100.5], [500_000.0, 4_649_777.25, 101.0]];
    let text: String = corners.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    std::fs::write(&path, text + "f 1 2 3\n").unwrap();
    let placed = |loaded: &softras_io::Loaded| {
        let at = |p: &[f32; 3]| [0, 1, 2].map(|k| f64::from(p[k]) + loaded.origin[k]);
        loaded.mesh.positions().iter().map(at).collect::<Vec<_>>()
    };
    let loaded = crate::load(&path, &crate::RAW).unwrap();
    let options = softras_io::SaveOptions { origin: loaded.origin, ..softras_io::SaveOptions::default() };
    for ending in ["obj", "ply", "glb"] {
        let path = folder.path().join(format!("b.{ending}"));
        softras_io::save_with(&loaded.mesh, &path, &options).unwrap();
        let again = crate::load(&path, &crate::RAW).unwrap();
        assert_eq!((placed(&again), again.notes), (corners.to_vec(), vec![]), "{ending}");
    }
    // Relative to a place nearby nothing is lost, so that nothing is noted.
    let near = loaded.clone().relative_to([500_000.0, 4_649_776.0, 100.0]).unwrap();
    assert_eq!((placed(&near), near.mesh.positions()[0], near.notes.len()), (corners.to_vec(), [0.125, 0.0, 0.5], 0));
    assert!(loaded.at_place().unwrap().notes[0].contains("steps of 0.5"));
}
