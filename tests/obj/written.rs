//! Tests of writing meshes: what is written is read back, and files appear whole or not at all.

use super::*;

fn triangle() -> Mesh {
    let positions = vec![[0.1, -0.0, 1e-30], [1.0 / 3.0, 1e20, f32::MIN_POSITIVE], [0.0, 16_777_217.0, 3.0], [5.0; 3]];
    Mesh::new(positions, vec![[0, 1, 2], [2, 1, 0], [3, 1, 2]]).unwrap()
}

#[track_caller]
fn assert_round_trip(mesh: &Mesh) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("the mesh.obj");
    let files = write_obj(mesh, &path).unwrap();
    assert_eq!(files.last().unwrap(), &path);
    let mut found: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
    let mut named = files.clone();
    found.sort();
    named.sort();
    assert_eq!(found, named, "exactly the named files, no temporary ones");
    let loaded = load(&path, &LoadOptions::default()).unwrap();
    assert_eq!(loaded.notes, [""; 0]);
    assert_eq!(&loaded.mesh, mesh);
}

#[test]
fn writing_and_reading_gives_the_mesh_back() {
    let mesh = triangle();
    assert_round_trip(&mesh);
    let colors = vec![[0.1, 0.2, 0.3], [1.0 / 3.0, 0.0, 1.0], [2.0, -1.0, 0.5], [0.0; 3]];
    let textures = vec![
        Texture::new(2, 1, vec![[0.0, 51.0 / 255.0, 1.0], [128.0 / 255.0; 3]], Wrap::Clamp).unwrap(),
        Texture::new(1, 2, vec![[1.0 / 65535.0; 3], [0.0; 3]], Wrap::Repeat).unwrap(),
    ];
    let (uvs, uv_triangles) = (vec![[0.0, 0.1], [-3.5, 0.7], [1.0, 1.0]], vec![[0, 1, 2], [2, 2, 2], [1, 0, 1]]);
    for appearance in [
        Appearance::Uniform([0.1, 0.7, 1.0 / 3.0]),
        Appearance::VertexColors(colors.clone()),
        Appearance::Surface { resolution: 1, texels: colors[..3].to_vec() },
        Appearance::Textured {
            uvs: uvs.clone(),
            uv_triangles: uv_triangles.clone(),
            textures: textures[..1].to_vec(),
            texture_of_triangle: vec![],
        },
        Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle: vec![0, 1, 0] },
    ] {
        assert_round_trip(&mesh.clone().with_appearance(appearance).unwrap());
    }
}

#[test]
fn the_project_s_own_meshes_survive_a_file() {
    for name in softras::internals::shapes::NAMES {
        assert_round_trip(&softras::internals::shapes::by_name(name).unwrap());
    }
}

#[test]
fn a_texture_is_not_named_as_a_picture_of_the_mesh() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fish.obj");
    let files = write_obj(&softras::shapes::fish().unwrap(), &path).unwrap();
    let names = ["fish_texture.png", "fish.mtl", "fish.obj"].map(|name| folder.path().join(name));
    assert_eq!(files, names);
    let mut read = load(&path, &LoadOptions::default()).unwrap().files;
    read.sort();
    assert_eq!(read, [&names[1], &names[2], &names[0]].map(Clone::clone));
}

#[test]
fn what_obj_files_cannot_hold_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.obj");
    let fine = Appearance::Surface { resolution: 2, texels: vec![[0.0; 3]; 12] };
    let error = write_obj(&triangle().with_appearance(fine).unwrap(), &path).unwrap_err();
    assert!(error.to_string().contains("resolution 2"), "{error}");
    let bright = Appearance::Textured {
        uvs: vec![[0.0; 2]],
        uv_triangles: vec![[0; 3]; 3],
        textures: vec![Texture::new(1, 1, vec![[2.0; 3]], Wrap::Repeat).unwrap()],
        texture_of_triangle: vec![],
    };
    let error = write_obj(&triangle().with_appearance(bright).unwrap(), &path).unwrap_err();
    assert!(error.to_string().contains("clamp"), "{error}");
    let error = write_obj(&triangle(), &folder.path().join("no folder/mesh.obj")).unwrap_err();
    assert!(matches!(error, Error::Io { .. }), "{error}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left behind");
}
