//! Tests of help, exit codes, and the commands without pictures.

use super::command::{PAGES, commands, page};
use super::{fails, softras, succeeds};
use softras::scene::Appearance;
use std::fs;

#[test]
fn every_command_has_help_with_examples() {
    let folder = tempfile::tempdir().unwrap();
    let all = succeeds(folder.path(), &["--help"]);
    for command in ["render", "grad", "check", "devices", "mesh"] {
        assert!(all.contains(command), "{all}");
        assert!(succeeds(folder.path(), &[command, "--help"]).contains("Examples:"), "{command}");
    }
    assert_eq!(succeeds(folder.path(), &["--version"]).trim(), concat!("softras ", env!("CARGO_PKG_VERSION")));
    assert_eq!(softras(folder.path(), &[]).status.code(), Some(2));
}

#[test]
fn senseless_arguments_exit_with_2_and_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let render = |extra: &[&str], parts: &[&str]| {
        let arguments = [&["render", "a.obj", "-o", "a.png"], extra].concat();
        fails(folder.path(), &arguments, 2, parts);
    };
    render(&["--size", "0"], &["--size", "16384"]);
    render(&["--size", "12by4"], &["--size", "12by4"]);
    render(&["--size", "10x"], &["--size", "\"10x\" is no size"]);
    render(&["--up", "0,0,0"], &["--up", "length"]);
    render(&["--eye", "1,2"], &["--eye", "three are expected"]);
    render(&["--light", "1,2,3:bright"], &["--light", "bright"]);
    render(&["--background", "#12"], &["--background", "#rrggbb"]);
    render(&["--fov", "180"], &["--fov", "179"]);
    render(&["--sigma", "-1"], &["--sigma"]);
    fails(folder.path(), &["iou", "a.obj", "b.obj", "--resolution", "0"], 2, &["--resolution"]);
    render(&["--sigma", "1e-4", "--blur", "2"], &["--sigma", "--blur"]);
    render(&["--eye", "1,2,3", "--azimuth", "4"], &["--eye", "--azimuth"]);
    render(&["--sweep", "width=1..2"], &["--sweep", "sigma=1e-5..1e-2"]);
    render(&["--turntable", "1"], &["--turntable", "2 to 1000"]);
    render(&["-o", "a.png"], &["a.png", "twice"]);
    render(&["--samples", "2", "-o", "a.npy"], &["--samples 2", "model's own values"]);
    render(&["--size", "16000", "--samples", "2"], &["--samples 2", "16384"]);
    fails(folder.path(), &["render", "a.obj"], 2, &["--out"]);
    fails(
        folder.path(),
        &["render", "a.obj", "-o", "a.tiff"],
        2,
        &["a.tiff", ".png, .exr or .npy", ".gif with --turntable"],
    );
    fails(folder.path(), &["render", "a.obj", "-o", "a"], 2, &["ending"]);
    fails(folder.path(), &["render", "a.obj", "-o", "a.gif"], 2, &["a.gif", "--turntable"]);
    fails(folder.path(), &["render", "a.obj", "-o", "a.exr", "--turntable", "4"], 2, &["a.exr", ".gif"]);
    fails(folder.path(), &["mesh", "teapot", "-o", "a.obj"], 2, &["teapot", "torus"]);
    fails(folder.path(), &["mesh", "cube", "-o", "a.stl"], 2, &["a.stl", "ends in .obj"]);
    fails(folder.path(), &["fit", "--from", "a.obj", "-o", "a.png"], 2, &["a.png", "ends in .obj"]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn what_cannot_be_done_exits_with_1_and_names_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let broken = "v 0 0 0\nv 1 0 0\nv 0 oops 0\nf 1 2 3\n";
    fs::write(folder.path().join("broken.obj"), broken).unwrap();
    fails(folder.path(), &["render", "none.obj", "-o", "a.png"], 1, &["none.obj"]);
    fails(folder.path(), &["render", "broken.obj", "-o", "a.png"], 1, &["broken.obj:3", "oops"]);
    fails(folder.path(), &["render", "broken.obj", "-o", "no/a.png"], 1, &["no", "folder"]);
    fails(folder.path(), &["render", ".", "-o", "a.png"], 1, &["."]);
    fails(folder.path(), &["mesh", "cube", "-o", "no/a.obj"], 1, &["no", "folder"]);
    succeeds(folder.path(), &["mesh", "cube", "-o", "cube.obj"]);
    let device = ["render", "cube.obj", "-o", "a.png", "--device", "a device that nobody has"];
    fails(folder.path(), &device, 1, &["a device that nobody has"]);
    assert!(!folder.path().join("a.png").exists());
}

#[test]
fn own_meshes_come_back_from_their_files() {
    let folder = tempfile::tempdir().unwrap();
    for name in softras::shapes::NAMES {
        let file = format!("{name}.obj");
        let said = succeeds(folder.path(), &["mesh", name, "-o", &file]);
        let expected = softras::shapes::by_name(name).unwrap();
        assert!(said.contains(&format!("{} triangles", expected.triangles().len())), "{said}");
        // The fish's texels are those of its picture, vertex colours are linear light.
        let srgb = matches!(expected.appearance(), Appearance::VertexColors(_));
        let options = softras_io::LoadOptions { srgb, ..Default::default() };
        let loaded = softras_io::load_with(folder.path().join(file), &options).unwrap().mesh;
        match (loaded.appearance(), expected.appearance()) {
            (Appearance::VertexColors(read), Appearance::VertexColors(made)) => {
                assert_eq!((loaded.positions(), loaded.triangles()), (expected.positions(), expected.triangles()));
                let off = read.as_flattened().iter().zip(made.as_flattened()).map(|(a, b)| (a - b).abs());
                assert!(off.fold(0.0, f32::max) < 1e-6, "{name}");
            }
            _ => assert_eq!(loaded, expected, "{name}"),
        }
    }
}

#[test]
fn devices_are_listed_for_people_and_programs() {
    let folder = tempfile::tempdir().unwrap();
    let json: serde_json::Value = serde_json::from_str(&succeeds(folder.path(), &["devices", "--json"])).unwrap();
    let text = succeeds(folder.path(), &["devices"]);
    for device in json.as_array().unwrap() {
        assert!(text.contains(device["name"].as_str().unwrap()), "{text}");
    }
}

#[test]
fn no_command_overwrites_what_it_reads() {
    let folder = tempfile::tempdir().unwrap();
    succeeds(folder.path(), &["mesh", "fish", "-o", "fish.obj"]);
    let files = ["fish.obj", "fish.mtl", "fish_texture.png"];
    let before = files.map(|file| fs::read(folder.path().join(file)).unwrap());
    // The picture of a mesh gets its own name, and the texture stays.
    for _ in 0..2 {
        succeeds(folder.path(), &["render", "fish.obj", "-o", "fish.png", "--size", "16"]);
    }
    let refused = |line: &str, file: &str| {
        fails(folder.path(), &line.split_whitespace().collect::<Vec<_>>(), 2, &["overwrite", file]);
    };
    refused("render fish.obj -o fish_texture.png", "fish_texture.png");
    fs::create_dir(folder.path().join("sub")).unwrap();
    refused("render fish.obj -o ./sub/../fish_texture.png", "fish_texture.png");
    refused("grad fish.obj --target fish.png -o fish.png", "fish.png");
    refused("grad fish.obj --target fish.png -o fish_texture.png", "fish_texture.png");
    refused("fit --from fish.obj --views 1 --size 8 -o fish.obj", "fish.obj");
    refused("fit --from fish.obj --views 1 --size 8 -o out.obj --plot fish_texture.png", "fish_texture.png");
    refused("fit --from fish.obj --template fish.obj --views 1 --size 8 -o out.obj --json fish.mtl", "fish.mtl");
    refused("pose --mesh fish.obj --image fish.png -o fish.obj", "fish.obj");
    refused("bench fish.obj --json fish.mtl", "fish.mtl");
    let twice = ["fit", "--from", "fish.obj", "-o", "out.obj", "--json", "a.png", "--plot", "./a.png"];
    fails(folder.path(), &twice, 2, &["a.png", "twice"]);
    assert_eq!(files.map(|file| fs::read(folder.path().join(file)).unwrap()), before);
}

#[test]
fn every_command_reads_every_format_and_names_them() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let points = [[-1.0f32, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
    let obj: String = points.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    fs::write(at("mesh.obj"), obj + "f 1 2 3\n").unwrap();
    let rows: String = points.iter().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect();
    let head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
    let ply = format!("{head}element face 1\nproperty list uchar int vertex_indices\nend_header\n{rows}3 0 1 2\n");
    fs::write(at("mesh.ply"), ply).unwrap();
    let corners: String = points.iter().map(|[x, y, z]| format!("vertex {x} {y} {z}\n")).collect();
    let stl = format!("solid a\nfacet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\nendsolid a\n");
    fs::write(at("mesh.stl"), stl).unwrap();
    let picture = |mesh: &str| {
        succeeds(folder.path(), &["render", mesh, "-o", "picture.png", "--size", "16", "--strict"]);
        fs::read(at("picture.png")).unwrap()
    };
    let expected = picture("mesh.obj");
    assert!(picture("mesh.ply") == expected && picture("mesh.stl") == expected);
    succeeds(folder.path(), &["bench", "mesh.stl", "--quick", "--size", "8", "--modes", "silhouette"]);
    succeeds(folder.path(), &["iou", "mesh.stl", "mesh.ply", "--resolution", "2"]);
    succeeds(folder.path(), &["grad", "mesh.ply", "--target", "picture.png", "-o", "grad.png"]);
    let fit = "fit --from mesh.stl --template mesh.ply --views 1 --size 8 --iterations 1 -o out.obj";
    succeeds(folder.path(), &fit.split_whitespace().collect::<Vec<_>>());
    let formats = "softras reads .obj, .ply, .stl, .gltf and .glb";
    fails(folder.path(), &["render", "picture.png", "-o", "a.png"], 1, &["picture.png", formats]);
    // A note is an error where that is asked for.
    fs::write(at("line.obj"), fs::read_to_string(at("mesh.obj")).unwrap() + "f 1 2\n").unwrap();
    let noted = softras(folder.path(), &["render", "line.obj", "-o", "a.png", "--size", "16"]);
    assert!(String::from_utf8_lossy(&noted.stderr).contains("note: line.obj:5: faces of fewer than three corners"));
    fails(folder.path(), &["render", "line.obj", "-o", "a.png", "--strict"], 1, &["line.obj:5", "fewer than three"]);
}

#[test]
fn usage_errors_show_the_usage_of_their_command() {
    let folder = tempfile::tempdir().unwrap();
    let line = ["render", "a.obj", "-o", "a.tiff"];
    fails(folder.path(), &line, 2, &["a.tiff", "Usage: softras render [OPTIONS]"]);
    let line = ["-q", "fit", "--from", "a.obj", "--views", "many", "-o", "out.obj"];
    fails(folder.path(), &line, 2, &["--views", "Usage: softras fit"]);
}

#[test]
fn shells_and_man_know_the_command() {
    let folder = tempfile::tempdir().unwrap();
    for (shell, part) in [("bash", "_softras()"), ("zsh", "#compdef softras"), ("fish", "complete -c softras")] {
        let script = succeeds(folder.path(), &["completions", shell]);
        assert!(script.contains(part) && script.contains("allow-outside"), "{shell}");
    }
    let page = succeeds(folder.path(), &["man"]);
    assert!(page.contains(".TH softras 1") && page.contains("softras\\-render"), "{page}");
    let page = succeeds(folder.path(), &["man", "render"]);
    assert!(page.contains("azimuth") && page.contains("softras 0."), "{page}");
    // The synopsis is the usage of the help, and not a list of all options; examples keep their lines.
    let synopsis = page.split(".SH SYNOPSIS\n").nth(1).unwrap().lines().next().unwrap();
    assert_eq!(synopsis, "\\fBsoftras render\\fR [OPTIONS] \\-\\-out <FILE> <MESH>");
    let examples = page.split(".SH EXAMPLES\n.nf\n").nth(1).unwrap();
    assert!(examples.starts_with("softras render ") && examples.contains("\nsoftras render "), "{examples}");
    fails(folder.path(), &["man", "nothing"], 2, &["nothing", "Usage: softras man"]);
}

#[test]
fn quiet_is_quiet_and_verbose_tells_more() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nl 1 2\n").unwrap();
    let errors = |extra: &[&str]| {
        let output = softras(folder.path(), &[&["render", "a.obj", "-o", "a.png", "--size", "8"], extra].concat());
        assert_eq!(output.status.code(), Some(0));
        String::from_utf8(output.stderr).unwrap()
    };
    assert!(errors(&[]).contains("note: a.obj:5"));
    assert_eq!(errors(&["--quiet"]), "");
    let told = errors(&["-v"]);
    let parts = ["read a.obj", "3 vertices, 1 triangles", "device: ", " seconds"];
    assert!(parts.iter().all(|part| told.contains(part)), "{told}");
    fails(folder.path(), &["-q", "render", "none.obj", "-o", "a.png"], 1, &["none.obj"]);
}

#[test]
fn a_missing_driver_is_named_with_its_package() {
    let folder = tempfile::tempdir().unwrap();
    succeeds(folder.path(), &["mesh", "cube", "-o", "cube.obj"]);
    for device in [&[][..], &["--device", "3"]] {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_softras"))
            .current_dir(folder.path())
            .args([&["render", "cube.obj", "-o", "a.png"], device].concat())
            .env("VK_DRIVER_FILES", "/nowhere.json")
            .env("VK_ICD_FILENAMES", "/nowhere.json")
            .output()
            .unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{errors}");
        assert!(errors.contains("no Vulkan driver") && errors.contains("mesa-vulkan-drivers"), "{errors}");
    }
}

/// The full tier runs them.
#[test]
fn the_commands_of_the_pages_are_understood() {
    let folder = tempfile::tempdir().unwrap();
    let commands: Vec<String> = PAGES.iter().flat_map(|name| commands(&page(name))).collect();
    assert!(commands.len() >= 20, "{commands:?}");
    for command in commands {
        let arguments: Vec<&str> = command.split_whitespace().skip(1).chain(["--help"]).collect();
        assert!(succeeds(folder.path(), &arguments).contains("Usage:"), "{command}");
        fails(folder.path(), &[&arguments[..1], &["--no-such-option", "--help"]].concat(), 2, &["--no-such-option"]);
    }
}
