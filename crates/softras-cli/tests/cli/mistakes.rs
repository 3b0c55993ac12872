//! The messages on mistakes that are made early: names of files, options that contradict each other, empty files and pictures.

use super::{fails, softras, succeeds, words};
use std::fs;
use std::path::Path;

#[test]
fn a_file_is_not_written_under_the_ending_of_another_format() {
    let folder = tempfile::tempdir().unwrap();
    for (line, ending) in [
        ("fit --from a.obj -o o.obj --gif f.png", "gif"),
        ("fit --from a.obj -o o.obj --plot f.gif", "png"),
        ("fit --from a.obj -o o.obj --checkpoint f.bin", "npz"),
        ("grad a.obj --target a.png -o f.jpg", "png"),
        ("stress --cases 0 --map f.png", "svg"),
    ] {
        let arguments = words(line);
        let file = arguments.iter().find(|word| word.starts_with("f.")).unwrap();
        fails(folder.path(), &arguments, 2, &[file, &format!("give a name that ends in .{ending}")]);
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_stress_test_of_nothing_is_not_passed() {
    let folder = tempfile::tempdir().unwrap();
    fails(folder.path(), &["stress", "--cases", "0"], 2, &["--cases 0", "nothing would be tested", "--map"]);
}

#[test]
fn only_fish_and_torus_have_a_detail() {
    let folder = tempfile::tempdir().unwrap();
    let line = ["mesh", "mug", "--detail", "2", "-o", "m.obj"];
    fails(folder.path(), &line, 1, &["a mug has no detail", "fish or torus"]);
    assert!(!folder.path().join("m.obj").exists());
    let told = succeeds(folder.path(), &["mesh", "torus", "--detail", "2", "-o", "m.obj"]);
    assert!(told.contains("8192 vertices, 16384 triangles"), "{told}");
}

#[test]
fn depths_in_the_wrong_order_name_both_options() {
    let folder = tempfile::tempdir().unwrap();
    succeeds(folder.path(), &["render", "cube", "-o", "cube.png", "--size", "16", "--background", "navy"]);
    for command in [
        &["render", "cube", "-o", "a.png", "--size", "16"][..],
        &["grad", "cube", "--target", "cube.png", "-o", "a.png"],
        &["pose", "--mesh", "cube", "--image", "cube.png"],
    ] {
        let both = [command, &["--near", "5", "--far", "2"]].concat();
        fails(folder.path(), &both, 2, &["--near 5 --far 2", "near must be less than far", "leave one out"]);
        let far = [command, &["--far", "0.5"]].concat();
        fails(folder.path(), &far, 2, &["--far 0.5: the mesh begins at depth", "--near as well"]);
    }
}

#[test]
fn an_empty_file_is_said_to_be_empty() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("views")).unwrap();
    for (line, file) in [
        ("render e.obj -o a.png", "e.obj"),
        ("render e.ply -o a.png", "e.ply"),
        ("render e.stl -o a.png", "e.stl"),
        ("render e.glb -o a.png", "e.glb"),
        ("grad cube --target e.png -o a.png", "e.png"),
        ("pose --mesh cube --image e.jpg", "e.jpg"),
        ("fit --views views -o a.obj", "views/cameras.json"),
        ("fit --views views -o a.obj", "views/transforms.json"),
        ("fit --views views -o a.obj", "views/images.txt"),
        ("fit --views e.npy --cameras c.npy -o a.obj", "e.npy"),
        ("fit --from cube --views 1 --size 8 --subdivisions 0 --checkpoint e.npz --resume -o a.obj", "e.npz"),
    ] {
        let path = folder.path().join(file);
        fs::write(&path, "").unwrap();
        fs::write(folder.path().join("views/cameras.txt"), "").unwrap();
        let arguments = words(line);
        fails(folder.path(), &arguments, 1, &["the file is empty"]);
        fs::remove_file(path).unwrap();
    }
}

/// The notes of `softras render` on a mesh of these lines.
fn notes(folder: &Path, mesh: &str, extra: &[&str]) -> String {
    fs::write(folder.join("a.obj"), mesh).unwrap();
    let output = softras(folder, &[&["render", "a.obj", "-o", "a.png", "--size", "16"], extra].concat());
    let errors = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{errors}");
    errors
}

#[test]
fn a_picture_with_nothing_in_it_is_noted() {
    let folder = tempfile::tempdir().unwrap();
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let noted = |mesh: &str, extra: &[&str]| notes(folder.path(), mesh, extra);
    assert_eq!(noted(triangle, &[]), "");
    assert_eq!(noted(triangle, &["--turntable", "3", "-o", "b.png"]).matches("nothing").count(), 0);
    let flat = noted("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", &[]);
    assert!(flat.contains("note: no triangle of the mesh has an area"), "{flat}");
    fs::write(folder.path().join("clear.mtl"), "newmtl clear\nd 0\n").unwrap();
    let clear = noted(&format!("mtllib clear.mtl\nusemtl clear\n{triangle}"), &[]);
    assert!(clear.contains("wholly transparent") && !clear.contains("has an area"), "{clear}");
    let beside = noted(triangle, &["--eye", "9,0,-5", "--look-at", "9,0,0"]);
    assert!(beside.contains("note: nothing") && beside.contains("without --eye, --look-at"), "{beside}");
    let away = noted(triangle, &["--faces", "front", "--azimuth", "0"]);
    let towards = noted(triangle, &["--faces", "front", "--azimuth", "180"]);
    assert!((away + &towards).matches("--faces front").count() == 1);
    // One note tells it.
    for scale in ["1e10", "1e-9"] {
        let mesh = format!("v 0 0 0\nv {scale} 0 0\nv 0 {scale} 0\nf 1 2 3\n");
        fs::write(folder.path().join("a.obj"), mesh).unwrap();
        fails(folder.path(), &["render", "a.obj", "-o", "a.png"], 1, &["units wide", "scale it"]);
    }
    let cut = |near: &str| {
        noted(triangle, &["--eye", "0,0,-4", "--look-at", "0,0,0", "--near", near]).contains("before near")
    };
    assert_eq!([cut("3.9"), cut("4.1")], [false, true]);
    let behind = noted(triangle, &["--eye", "0,0,5", "--look-at", "0,0,9"]);
    assert!(behind.contains("outside the depths") && !behind.contains("nothing"), "{behind}");
}

#[test]
fn a_pose_that_does_not_explain_the_picture_is_doubted() {
    let folder = tempfile::tempdir().unwrap();
    let doubts = |how: &str| {
        let render = format!("render fish -o picture.png --size 48 {how}");
        succeeds(folder.path(), &words(&render));
        // The camera of both is the same, so that there is nothing to turn.
        let pose = "pose --mesh fish --image picture.png --init --no-translation --iterations 20";
        let output = softras(folder.path(), &words(pose));
        assert_eq!(output.status.code(), Some(0));
        assert!(String::from_utf8_lossy(&output.stdout).contains("silhouettes agree by 0."));
        let noted = String::from_utf8(output.stderr).unwrap();
        ["this pose does not explain the picture", "--unlit", "--frame sphere"].iter().all(|part| noted.contains(part))
    };
    let pictures = [("--frame sphere --unlit", false), ("--frame sphere", true), ("--frame box --unlit", true)];
    for (how, is_doubted) in pictures {
        assert_eq!(doubts(how), is_doubted, "{how}");
    }
}
