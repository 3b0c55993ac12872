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
    let files = save(mesh, &path).unwrap();
    assert_eq!(files.last().unwrap(), &path);
    let mut found: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
    let mut named = files.clone();
    found.sort();
    named.sort();
    assert_eq!(found, named, "exactly the named files, no temporary ones");
    let loaded = load(&path, &RAW).unwrap();
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
    let faded = |i: usize, alpha: f32| textures[i].clone().with_alpha(vec![alpha, 1.0]).unwrap();
    let faded = vec![faded(0, 0.2), faded(0, 1.0 / 65535.0), faded(1, 0.0)];
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
        Appearance::Textured {
            uvs: uvs.clone(),
            uv_triangles: uv_triangles.clone(),
            textures: faded,
            texture_of_triangle: vec![0, 1, 2],
        },
        Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle: vec![0, 1, 0] },
    ] {
        assert_round_trip(&mesh.clone().with_appearance(appearance).unwrap());
    }
}

#[test]
fn a_texture_is_not_named_as_a_picture_of_the_mesh() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fish.obj");
    let files = save(&softras::shapes::fish().unwrap(), &path).unwrap();
    let names = ["fish_texture.png", "fish.mtl", "fish.obj"].map(|name| folder.path().join(name));
    assert_eq!(files, names);
    let mut read = load(&path, &RAW).unwrap().files;
    read.sort();
    assert_eq!(read, [&names[1], &names[2], &names[0]].map(Clone::clone));
}

#[test]
fn what_obj_files_cannot_hold_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.obj");
    let bright = Appearance::Textured {
        uvs: vec![[0.0; 2]],
        uv_triangles: vec![[0; 3]; 3],
        textures: vec![Texture::new(1, 1, vec![[2.0; 3]], Wrap::Repeat).unwrap()],
        texture_of_triangle: vec![],
    };
    let error = save(&triangle().with_appearance(bright).unwrap(), &path).unwrap_err();
    assert!(error.to_string().contains("clamp"), "{error}");
    let error = save(&triangle(), &folder.path().join("no folder/mesh.obj")).unwrap_err();
    assert!(matches!(error, Error::Io { .. }), "{error}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left behind");
}

/// Two writers of one file and a reader: every write succeeds, and what is read is one mesh or the other.
#[test]
fn two_writers_of_one_file_do_not_disturb_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.obj");
    let [large, small] = [softras::shapes::torus(1.0, 0.3, 40, 20), softras::shapes::cube()].map(|mesh| mesh.unwrap());
    let lengths = [&large, &small].map(|mesh| {
        save(mesh, &path).unwrap();
        fs::metadata(&path).unwrap().len()
    });
    std::thread::scope(|scope| {
        let writers = [&large, &small].map(|mesh| {
            let path = &path;
            scope.spawn(move || (0..60).try_for_each(|_| save(mesh, path).map(drop)))
        });
        while !writers.iter().all(|writer| writer.is_finished()) {
            let length = fs::read(&path).unwrap().len() as u64;
            assert!(lengths.contains(&length), "{length} bytes, neither of {lengths:?}");
        }
        writers.into_iter().for_each(|writer| writer.join().unwrap().unwrap());
    });
    let left: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert!(left.iter().all(|name| ["mesh.obj", "mesh.mtl"].contains(&name.to_str().unwrap())), "{left:?}");
}

#[test]
fn names_may_be_as_long_as_the_file_system_allows() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("n".repeat(251) + ".obj");
    save(&triangle(), &path).unwrap();
    assert_eq!(load(&path, &RAW).unwrap().mesh, triangle());
    let error = save(&triangle(), &folder.path().join("n".repeat(252) + ".obj")).unwrap_err();
    assert!(matches!(error, Error::Io { .. }), "{error}");
}

/// Files are written through links, also such as lead nowhere yet, and keep their permissions; what lies beside them under
/// a name that a temporary file might have is left alone.
#[cfg(unix)]
#[test]
fn links_are_written_through_and_permissions_kept() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let (folder, elsewhere) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let victim = elsewhere.path().join("victim");
    fs::write(&victim, "precious").unwrap();
    for name in ["mesh.obj.tmp".into(), format!(".mesh.obj.{}.tmp", std::process::id())] {
        symlink(&victim, folder.path().join(name)).unwrap();
    }
    let (link, target) = (folder.path().join("mesh.obj"), elsewhere.path().join("target.obj"));
    symlink("between.obj", &link).unwrap();
    symlink(&target, folder.path().join("between.obj")).unwrap();
    save(&triangle(), &link).unwrap();
    assert!(link.is_symlink() && target.is_file());
    fs::set_permissions(&target, fs::Permissions::from_mode(0o640)).unwrap();
    save(&triangle(), &link).unwrap();
    assert_eq!(fs::metadata(&target).unwrap().permissions().mode() & 0o7777, 0o640);
    assert_eq!(fs::read_to_string(&victim).unwrap(), "precious");
    let circle = folder.path().join("circle.obj");
    symlink(&circle, &circle).unwrap();
    assert!(save(&triangle(), &circle).unwrap_err().to_string().contains("too many symbolic links"));
}

/// A file that a killed process left is removed. One that another process is still writing is not.
#[test]
fn litter_of_killed_processes_is_removed() {
    let folder = tempfile::tempdir().unwrap();
    let hours_ago = std::time::SystemTime::now() - std::time::Duration::from_secs(2 * 3600);
    for (name, is_old) in [(".softras-old.tmp", true), (".softras-new.tmp", false), ("softras.tmp", true)] {
        let file = fs::File::create(folder.path().join(name)).unwrap();
        if is_old {
            file.set_modified(hours_ago).unwrap();
        }
    }
    save(&triangle(), &folder.path().join("mesh.obj")).unwrap();
    let mut left: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    left.sort();
    assert_eq!(left, [".softras-new.tmp", "mesh.obj", "softras.tmp"]);
}
