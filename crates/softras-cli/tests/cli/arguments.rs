//! Tests of help, exit codes, and the commands without pictures.

use super::command::{PAGES, commands, page};
use super::{fails, softras, succeeds, words};
use std::fs;
use std::process::Command;

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
    let cases: &[(&str, &[&str])] = &[
        ("render a.obj -o a.png --size 0", &["--size", "16384"]),
        ("render a.obj -o a.png --size 12by4", &["--size", "12by4"]),
        ("render a.obj -o a.png --size 10x", &["--size", "\"10x\" is no size"]),
        ("render a.obj -o a.png --up 0,0,0", &["--up", "length"]),
        ("render a.obj -o a.png --eye 1,2", &["--eye", "three are expected"]),
        ("render a.obj -o a.png --light 1,2,3:bright", &["--light", "bright"]),
        ("render a.obj -o a.png --light 0,0,0", &["--light", "0,0,0 has no length", "0,1,0"]),
        ("render a.obj -o a.png --background #12", &["--background", "#rrggbb"]),
        ("render a.obj -o a.png --background bluish", &["--background", "bluish", "#rrggbb, #rgb, r,g,b", "white"]),
        ("render a.obj -o a.png --fov 180", &["--fov", "179"]),
        ("render a.obj -o a.png --sigma -1", &["--sigma"]),
        ("render a.obj -o a.png --sigma 1e-4 --blur 2", &["--sigma", "--blur"]),
        ("render a.obj -o a.png --eye 1,2,3 --azimuth 4", &["--eye", "--azimuth"]),
        ("render a.obj -o a.png --sweep width=1..2", &["--sweep", "sigma=1e-5..1e-2"]),
        ("render a.obj -o a.png --turntable 1", &["--turntable", "2 to 1000"]),
        ("render a.obj -o a.png -o a.png", &["a.png", "twice"]),
        ("render a.obj -o a.png --samples 2 -o a.npy", &["--samples 2", "model's own values"]),
        ("render a.obj -o a.png --size 16000 --samples 2", &["--samples 2", "16384"]),
        ("render a.obj", &["--out"]),
        ("render a.obj -o a.tiff", &["a.tiff", ".png, .exr or .npy", ".gif with --turntable", "Usage: softras render"]),
        ("render a.obj -o a", &["ending"]),
        ("render a.obj -o a.gif", &["a.gif", "--turntable"]),
        ("render a.obj -o a.exr --turntable 4", &["a.exr", ".gif"]),
        ("iou a.obj b.obj --resolution 0", &["--resolution"]),
        ("mesh teapot -o a.obj", &["teapot", "torus"]),
        ("mesh cube -o a.stl", &["a.stl", "ends in .obj"]),
        ("fit --from a.obj -o a.png", &["a.png", "ends in .obj"]),
        ("fit --from a.obj -o o.obj --views-per-step 0", &["--views-per-step"]),
        ("fit -o x.obj", &["give --views or --from", "a folder or a .npy file"]),
        ("fit . -o x.obj", &["unexpected argument '.'", "tip: name it with an option: --views ."]),
        ("-q fit --from a.obj --views many -o out.obj", &["--views", "Usage: softras fit"]),
    ];
    for (line, parts) in cases {
        fails(folder.path(), &words(line), 2, parts);
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn what_cannot_be_done_exits_with_1_and_names_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let broken = "v 0 0 0\nv 1 0 0\nv 0 oops 0\nf 1 2 3\n";
    fs::write(folder.path().join("broken.obj"), broken).unwrap();
    fails(folder.path(), &["render", "none.obj", "-o", "a.png"], 1, &["none.obj"]);
    fails(folder.path(), &["render", "broken.obj", "-o", "a.png"], 1, &["broken.obj:3: no faces", "not a number"]);
    fails(folder.path(), &["render", "broken.obj", "-o", "no/a.png"], 1, &["no", "folder"]);
    fails(folder.path(), &["render", ".", "-o", "a.png"], 1, &["."]);
    fails(folder.path(), &["mesh", "cube", "-o", "no/a.obj"], 1, &["no", "folder"]);
    let device = ["render", "cube", "-o", "a.png", "--device", "a device that nobody has"];
    fails(folder.path(), &device, 1, &["a device that nobody has"]);
    assert!(!folder.path().join("a.png").exists());
}

#[test]
fn devices_are_listed_for_people_and_programs() {
    let folder = tempfile::tempdir().unwrap();
    let json: serde_json::Value = serde_json::from_str(&succeeds(folder.path(), &["devices", "--json"])).unwrap();
    let text = succeeds(folder.path(), &["devices"]);
    for device in json.as_array().unwrap() {
        assert!(text.contains(device["name"].as_str().unwrap()), "{text}");
    }
    // A driver's file takes the place of them all.
    fs::write(folder.path().join("notes.txt"), "no driver").unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_softras"));
    let output = command.current_dir(folder.path()).env("SOFTRAS_DRIVER", "notes.txt").arg("devices").output().unwrap();
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(1), "{error}");
    assert!(error.contains("notes.txt") && error.contains("or unset SOFTRAS_DRIVER"), "{error}");
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
        fails(folder.path(), &words(line), 2, &["overwrite", file]);
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
    refused("convert fish.obj fish.obj", "fish.obj");
    let twice = ["fit", "--from", "fish.obj", "-o", "out.obj", "--json", "a.png", "--plot", "./a.png"];
    fails(folder.path(), &twice, 2, &["a.png", "twice"]);
    assert_eq!(files.map(|file| fs::read(folder.path().join(file)).unwrap()), before);
}

#[test]
fn every_command_reads_every_format_and_names_them() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let points = [[-1.0f32, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
    let mesh = softras::Mesh::new(points.to_vec(), vec![[0, 1, 2]]).unwrap();
    ["mesh.obj", "mesh.ply"].iter().for_each(|name| drop(softras_io::save(&mesh, at(name)).unwrap()));
    let corners: String = points.iter().map(|[x, y, z]| format!("vertex {x} {y} {z}\n")).collect();
    let stl = format!("solid a\nfacet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\nendsolid a\n");
    fs::write(at("mesh.stl"), stl).unwrap();
    let picture = |mesh: &str| {
        succeeds(folder.path(), &["render", mesh, "-o", "picture.png", "--size", "16", "--strict"]);
        fs::read(at("picture.png")).unwrap()
    };
    let expected = picture("mesh.obj");
    assert!(picture("mesh.ply") == expected && picture("mesh.stl") == expected);
    assert_eq!(succeeds(folder.path(), &["convert", "mesh.stl", "out.glb", "--strict"]), "out.glb: 1 triangles\n");
    assert!(picture("out.glb") == expected);
    fs::write(at("glass.obj"), "mtllib glass.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n").unwrap();
    fs::write(at("glass.mtl"), "newmtl a\nKd 1 0 0\nd 0.5\n").unwrap();
    fails(
        folder.path(),
        &["convert", "glass.obj", "pane.ply", "--strict"],
        1,
        &["pane.ply: PLY files hold no opacity", "--strict"],
    );
    assert!(!at("pane.ply").exists());
    succeeds(folder.path(), &["convert", "glass.obj", "pane.ply"]);
    succeeds(folder.path(), &["bench", "mesh.stl", "--quick", "--size", "8", "--modes", "silhouette"]);
    succeeds(folder.path(), &["iou", "mesh.stl", "mesh.ply", "--resolution", "2"]);
    let info = succeeds(folder.path(), &["info", "mesh.stl"]);
    assert!(info.starts_with("3 vertices, 1 triangles, 1 parts, not closed\nbounds   [-1.0, -1.0, 0.0] to"), "{info}");
    assert_eq!(info.lines().nth(2), Some("colours  one, linear [1.0, 1.0, 1.0]"));
    succeeds(folder.path(), &["mesh", "fish", "-o", "fish.obj"]);
    let report = succeeds(folder.path(), &["info", "fish.obj", "--json"]);
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert!(report["closed"] == true && report["parts"] == 1 && report["files"][1] == "fish.mtl", "{report}");
    assert_eq!(report["materials"], serde_json::json!(["m0"]));
    assert!(report["colors"] == "of textures" && report["textures"][0]["alpha"] == false, "{report}");
    succeeds(folder.path(), &["grad", "mesh.ply", "--target", "picture.png", "-o", "grad.png"]);
    let fit = "fit --from mesh.stl --template mesh.ply --views 1 --size 8 --iterations 1 -o out.obj";
    succeeds(folder.path(), &words(fit));
    let formats = "softras reads .obj, .ply, .stl, .gltf and .glb";
    fails(folder.path(), &["render", "picture.png", "-o", "a.png"], 1, &["picture.png", formats]);
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
    for device in [&[][..], &["--device", "3"]] {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_softras"))
            .current_dir(folder.path())
            .args([&["render", "cube", "-o", "a.png"], device].concat())
            .env("VK_DRIVER_FILES", "/nowhere.json")
            .env("VK_ICD_FILENAMES", "/nowhere.json")
            .output()
            .unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{errors}");
        assert!(errors.contains("no Vulkan driver") && errors.contains("mesa-vulkan-drivers"), "{errors}");
    }
}

/// Where a file has the name, the file is meant.
#[test]
fn a_built_in_mesh_is_taken_by_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let picture = |mesh: &str, more: &[&str]| {
        let output = softras(folder.path(), &[&["render", mesh, "-o", "fish.png", "--size", "16"], more].concat());
        assert_eq!(output.status.code(), Some(0), "{mesh}");
        (fs::read(folder.path().join("fish.png")).unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    let (made, raw) = (picture("fish", &[]), picture("fish", &["--raw"]));
    assert!(made.1.is_empty() && made.0 != raw.0);
    succeeds(folder.path(), &["mesh", "fish", "-o", "fish.obj"]);
    assert!(picture("fish.obj", &[]) == made && picture("fish.obj", &["--raw"]) == raw);
    let noted = picture("fish", &["--strict"]);
    assert_eq!((noted.0, &noted.1[..]), (made.0, "note: fish is the built-in mesh, not fish.obj\n"));
    let near = ["neither a file nor a built-in mesh", "did you mean fish.obj or the built-in fish?", "double-torus"];
    for line in ["render fsh -o a.png", "iou fish fsh", "info fsh", "fit --from fsh --write-views views -o o.obj"] {
        fails(folder.path(), &words(line), 1, &near);
    }
    fails(folder.path(), &words("fit --from fish --template fsh -o o.obj"), 2, &[&near[..], &["auto, hull"]].concat());
    assert!(!folder.path().join("views").exists());
    fs::rename(folder.path().join("fish.png"), folder.path().join("cube")).unwrap();
    fails(folder.path(), &["info", "cube"], 1, &["cube: no ending tells its format"]);
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
