//! Meshes that a format cannot hold, and the places where one is written. `generated` tests that what is written is read back.

use softras::{
    scene::{Appearance, Texture, Wrap},
    shapes,
};

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
    for ending in ["obj", "ply", "glb"] {
        let path = folder.path().join(format!("a.{ending}"));
        let (files, notes) = softras_io::Loaded::from(two.clone()).encode(&path).unwrap();
        softras_io::output::write_files(&files).unwrap();
        let read = softras_io::load(&path).unwrap();
        let Appearance::Textured { textures, .. } = read.appearance() else { panic!("{read:?}") };
        assert_eq!((read.triangles().len(), textures.len()), (20, 2));
        let lost =
            if ending == "ply" { vec!["PLY files do not say that a texture is clamped: it repeats"] } else { vec![] };
        assert_eq!(notes, [vec!["textures are rounded to 256 steps from 0 to 1"], lost].concat());
    }
    let error = softras_io::save(&two, folder.path().join("a.stl")).unwrap_err().to_string();
    assert!(error.contains(".obj, .ply or .glb"), "{error}");
}

/// Bytes hold no colour above 1, and a PLY file one normal for each vertex.
#[test]
fn what_a_format_changes_is_noted() {
    let folder = tempfile::tempdir().unwrap();
    let encoded = |text: &str, file: &str| {
        let path = folder.path().join("a.obj");
        std::fs::write(&path, text).unwrap();
        softras_io::load_with(&path, &softras_io::LoadOptions::default())
            .unwrap()
            .encode(folder.path().join(file))
            .unwrap()
            .1
    };
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\nvn 0 0 1\nvn 1 0 0\n";
    let [smooth, creased] = ["1", "2"].map(|n| format!("{corners}f 1//1 2//1 3//1\nf 2//{n} 4//{n} 3//{n}\n"));
    assert_eq!(encoded(&smooth, "b.ply"), [""; 0]);
    assert_eq!(encoded(&creased, "b.glb"), [""; 0]);
    assert!(encoded(&creased, "b.ply")[0].contains("several normals is written once for each"));
    let ball = shapes::icosphere(1).unwrap();
    let bright = Appearance::VertexColors(vec![[1.5, 1.0, 0.0]; ball.positions().len()]);
    let bright = softras_io::Loaded::from(ball.with_appearance(bright).unwrap());
    assert_eq!(bright.encode(folder.path().join("b.ply")).unwrap().1, ["colours below 0 or above 1 are cut off"]);
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
