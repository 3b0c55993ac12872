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
    for name in shapes::NAMES {
        assert_round_trip(&shapes::by_name(name).unwrap());
    }
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

/// The shared meshes are too large for the repository; their numbers are those of their README.
#[test]
fn real_meshes_have_their_counts() {
    let folder = Path::new("../shared/meshes");
    if !folder.is_dir() {
        println!("SKIPPED: no ../shared/meshes");
        return;
    }
    for (name, vertices, triangles) in [
        ("spot", 2930, 5856),
        ("bunny", 35947, 69451),
        ("nefertiti", 49971, 99938),
        ("teapot", 3644, 6320),
        ("suzanne", 507, 968),
        ("cow", 2903, 5804),
        ("fandisk", 6475, 12946),
    ] {
        let loaded = load(&folder.join(name).with_extension("obj"), &LoadOptions::default()).unwrap();
        let counts = (loaded.mesh.positions().len(), loaded.mesh.triangles().len());
        assert_eq!(counts, (vertices, triangles), "{name}");
        let Appearance::Textured { uvs, textures, .. } = loaded.mesh.appearance() else { continue };
        assert_eq!((name, uvs.len(), textures.len()), ("spot", 3225, 1));
        assert_eq!(loaded.notes, [""; 0]);
    }
}

#[test]
fn threads_that_write_the_same_files_leave_whole_ones() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.obj");
    let colored = |x| triangle().with_appearance(Appearance::Uniform([x, 0.0, 0.5])).unwrap();
    let meshes = [colored(0.25), colored(0.75)];
    std::thread::scope(|scope| {
        for mesh in &meshes {
            scope.spawn(|| (0..50).for_each(|_| drop(write_obj(mesh, &path).unwrap())));
        }
    });
    let loaded = load(&path, &LoadOptions::default()).unwrap();
    assert!(meshes.contains(&loaded.mesh) && loaded.notes.is_empty(), "{loaded:?}");
    let files = fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(files, 2, "the OBJ file, its MTL file and nothing else");
}

#[test]
fn a_file_that_cannot_be_written_leaves_the_whole_set_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.obj");
    let textured = Appearance::Textured {
        uvs: vec![[0.0; 2]],
        uv_triangles: vec![[0; 3]; 3],
        textures: vec![Texture::new(1, 1, vec![[1.0; 3]], Wrap::Repeat).unwrap()],
        texture_of_triangle: vec![],
    };
    fs::write(&path, "old").unwrap();
    fs::create_dir(folder.path().join("mesh.mtl")).unwrap();
    let error = write_obj(&triangle().with_appearance(textured).unwrap(), &path).unwrap_err();
    assert!(error.to_string().contains("mesh.mtl") && error.to_string().contains("regular file"), "{error}");
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2, "no image without its MTL file");
}

#[test]
fn names_may_be_as_long_as_the_file_system_allows() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(format!("{}.obj", "n".repeat(246)));
    write_obj(&triangle(), &path).unwrap();
    assert_eq!(load(&path, &LoadOptions::default()).unwrap().mesh, triangle());
}

#[cfg(unix)]
mod unix {
    use super::*;
    use std::os::unix::fs::{PermissionsExt, symlink};

    fn mode(path: &Path) -> u32 {
        fs::metadata(path).unwrap().permissions().mode() & 0o7777
    }

    #[test]
    fn a_planted_link_is_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        let victim = folder.path().join("victim");
        fs::write(&victim, "precious").unwrap();
        // A temporary name that could be guessed, as it was once chosen.
        symlink(&victim, folder.path().join(format!(".mesh.obj.{}.tmp", std::process::id()))).unwrap();
        write_obj(&triangle(), &folder.path().join("mesh.obj")).unwrap();
        assert_eq!(fs::read(&victim).unwrap(), b"precious");
    }

    #[test]
    fn a_link_in_place_of_the_file_is_written_through() {
        let folder = tempfile::tempdir().unwrap();
        let elsewhere = tempfile::tempdir().unwrap();
        // To a file that exists, to one that does not yet, and by way of another link.
        for (link, target) in [("a.obj", "old.obj"), ("b.obj", "new.obj"), ("c.obj", "relay.obj")] {
            symlink(elsewhere.path().join(target), folder.path().join(link)).unwrap();
        }
        symlink("last.obj", elsewhere.path().join("relay.obj")).unwrap();
        fs::write(elsewhere.path().join("old.obj"), "old").unwrap();
        for (link, target) in [("a.obj", "old.obj"), ("b.obj", "new.obj"), ("c.obj", "last.obj")] {
            write_obj(&triangle(), &folder.path().join(link)).unwrap();
            assert!(folder.path().join(link).is_symlink(), "{link}");
            let target = elsewhere.path().join(target);
            assert!(!target.is_symlink());
            assert_eq!(load(&target, &LoadOptions::default()).unwrap().mesh, triangle());
        }
        symlink("loop.obj", folder.path().join("loop.obj")).unwrap();
        let error = write_obj(&triangle(), &folder.path().join("loop.obj")).unwrap_err();
        assert!(error.to_string().contains("symbolic links"), "{error}");
    }

    #[test]
    fn permissions_stay_and_new_files_have_the_usual_ones() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.obj");
        for kept in [0o400, 0o640] {
            fs::write(&path, "old").unwrap();
            fs::set_permissions(&path, fs::Permissions::from_mode(kept)).unwrap();
            write_obj(&triangle(), &path).unwrap();
            assert_eq!(mode(&path), kept);
            fs::remove_file(&path).unwrap();
        }
        let usual = folder.path().join("usual");
        fs::write(&usual, "").unwrap();
        write_obj(&triangle(), &path).unwrap();
        assert_eq!(mode(&path), mode(&usual));
    }
}
