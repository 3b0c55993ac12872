//! Tests of the commands `softras fit` and `iou`.

use super::{fails, softras, succeeds, words};
use serde_json::Value;
use std::io::BufRead;
use std::path::Path;

pub fn json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

#[test]
fn a_shape_is_fitted_to_views_of_a_mesh() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let fit = "fit --from torus --views 6 --size 32 --iterations 40 --subdivisions 2 --color -o out.obj --json log.json \
               --plot loss.png --gif fit.gif";
    let told = succeeds(folder.path(), &words(fit));
    assert!(told.contains("1 part of genus 1") && told.contains("3D IoU"), "{told}");
    let log = json(&at("log.json"));
    let losses = numbers(&log["loss"]);
    assert_eq!(losses.len(), 40);
    assert!(losses[39] < 0.6 * losses[0], "{losses:?}");
    assert_eq!(numbers(&log["final"]["mask_iou"]["per_view"]).len(), 6);
    let mean = log["final"]["mask_iou"]["mean"].as_f64().unwrap();
    assert!(mean > 0.6, "{mean}");
    assert!(log["seconds_per_iteration"].as_f64().unwrap() > 0.0);
    // The mesh that was written is the one that was scored, and it has colours.
    let iou: f64 = succeeds(folder.path(), &["iou", "out.obj", "torus"]).trim().parse().unwrap();
    assert!((iou - log["final"]["iou_3d"].as_f64().unwrap()).abs() < 1e-3, "{iou}");
    let text = std::fs::read_to_string(at("out.obj")).unwrap();
    assert!(
        text.lines().any(|line| line.starts_with("v ") && line.split_whitespace().count() == 7),
        "no vertex colours"
    );
    assert!(std::fs::read(at("loss.png")).unwrap().starts_with(b"\x89PNG"));
    assert!(std::fs::read(at("fit.gif")).unwrap().starts_with(b"GIF89a"));
}

#[test]
fn a_fit_goes_on_where_it_was_left() {
    let folder = tempfile::tempdir().unwrap();
    let fit = |iterations: &str, out: &str, extra: &[&str]| {
        let fit = "fit --from cube --views 3 --size 24 --subdivisions 1 --sigma 1e-3 --rate 0.01 --iterations";
        succeeds(folder.path(), &[&words(fit)[..], &[iterations, "-o", out], extra].concat());
        std::fs::read_to_string(folder.path().join(out)).unwrap()
    };
    let vertices = |text: &str| text.lines().filter(|l| l.starts_with("v ")).map(str::to_owned).collect::<Vec<_>>();
    for (other, count) in [
        (&[][..], 42..=42),
        (&["--remesh-at", "4", "--edge", "3", "--masks"], 80..=140),
        (&["--subdivide-at", "4", "--subdivision", "loop"], 162..=162),
    ] {
        let checkpoint = [other, &["--checkpoint", "fit.npz"]].concat();
        let whole = fit("12", "whole.obj", other);
        let half = fit("6", "half.obj", &checkpoint);
        let resumed = fit("12", "resumed.obj", &[&checkpoint[..], &["--resume"]].concat());
        assert_eq!(vertices(&whole), vertices(&resumed));
        assert_ne!(vertices(&whole), vertices(&half));
        assert!(count.contains(&vertices(&whole).len()), "{} vertices", vertices(&whole).len());
        std::fs::remove_file(folder.path().join("fit.npz")).unwrap();
    }
    fit("6", "half.obj", &["--checkpoint", "fit.npz"]);
    let other = "fit --from cube --views 3 --size 24 --subdivisions 2 -o x.obj --checkpoint fit.npz --resume";
    fails(folder.path(), &words(other), 1, &["saved state of another fit"]);
}

#[test]
fn each_loss_has_numbers_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let run = |extra: &[&str]| {
        let fit = "fit --from torus --views 3 --size 24 --preset official --iterations 2 -o out.obj \
                   --json log.json";
        let output = softras(folder.path(), &[&words(fit)[..], extra].concat());
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        json(&folder.path().join("log.json"))
    };
    // Other losses, and masks in place of grey outlines, are other numbers.
    let first = |extra: &[&str]| numbers(&run(&[&["--subdivisions", "1"], extra].concat())["silhouette_loss"])[0];
    let losses = [&[][..], &["--masks"], &["--loss", "l1"], &["--loss", "l2"]].map(first);
    let told_apart = |i: usize| losses[..i].iter().all(|other| (other - losses[i]).abs() > 1e-3);
    assert!((1..4).all(told_apart) && losses[3] < losses[2], "{losses:?}");
}

#[test]
fn pictures_and_cameras_are_read_from_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("photos")).unwrap();
    let mut cameras = Vec::new();
    for azimuth in [0, 90, 200] {
        let (file, azimuth) = (format!("{azimuth}.png"), azimuth.to_string());
        let out = format!("photos/{file}");
        let render = ["render", "torus", "--size", "32", "--unlit", "--distance", "4.5", "--elevation", "10"];
        succeeds(folder.path(), &[&render[..], &["--azimuth", &azimuth, "-o", &out]].concat());
        cameras.push(format!("{{\"file\": \"{file}\", \"distance\": 4.5, \"elevation\": 10, \"azimuth\": {azimuth}}}"));
    }
    let list = folder.path().join("photos/cameras.json");
    std::fs::write(&list, format!("[{}]", cameras.join(", "))).unwrap();
    let fit = "fit --views photos --subdivisions 2 -o out.obj --json log.json";
    succeeds(folder.path(), &[&words(fit)[..], &["--iterations", "40"]].concat());
    let log = json(&folder.path().join("log.json"));
    let mean = log["final"]["mask_iou"]["mean"].as_f64().unwrap();
    assert!(mean > 0.6, "{mean}");
    // A picture outside the folder is read only where that is allowed.
    std::fs::rename(folder.path().join("photos/0.png"), folder.path().join("0.png")).unwrap();
    let outside = cameras[0].replace("0.png", "../0.png");
    std::fs::write(&list, format!("[{outside}, {}]", cameras[1])).unwrap();
    let arguments = words(fit);
    fails(folder.path(), &arguments, 1, &["0.png", "outside the folder of views", "--allow-outside"]);
    succeeds(folder.path(), &[&arguments[..], &["--allow-outside", "--iterations", "1"]].concat());
    std::fs::write(&list, "[{\"file\": \"0.png\"}]").unwrap();
    fails(folder.path(), &words(fit), 1, &["camera 0 has no position"]);
    fails(folder.path(), &["fit", "--views", "nothing", "-o", "out.obj"], 1, &["nothing: No such file"]);
    std::fs::write(folder.path().join("views.npy"), "").unwrap();
    fails(folder.path(), &["fit", "--views", "views.npy", "-o", "out.obj"], 2, &["--cameras"]);
}

/// Texels along a side of the cubes' textures.
const TEXELS: u32 = 8;

/// Writes cubes with a texture on every face, one of a pattern and one of grey, and one without: painted.obj, grey.obj and
/// plain.obj.
fn write_cubes(folder: &Path) {
    let corner = |i: usize| [i & 1, i >> 1 & 1, i >> 2 & 1].map(|bit| if bit == 1 { 1.0 } else { -1.0 });
    let vertices: String = (0..8)
        .map(|i| {
            let [x, y, z] = corner(i);
            format!("v {x} {y} {z}\n")
        })
        .collect();
    let (mut obj, mut plain) = (format!("{vertices}vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\n"), vertices);
    for ring in [[2, 4, 8, 6], [1, 5, 7, 3], [3, 7, 8, 4], [1, 2, 6, 5], [5, 6, 8, 7], [1, 3, 4, 2]] {
        obj += &format!("f {}/1 {}/2 {}/3 {}/4\n", ring[0], ring[1], ring[2], ring[3]);
        plain += &format!("f {} {} {} {}\n", ring[0], ring[1], ring[2], ring[3]);
    }
    let at = |name: String| folder.join(name);
    let paint = |name: &str, color: &dyn Fn(u32, u32) -> [u8; 3]| {
        let image = image::RgbImage::from_fn(TEXELS, TEXELS, |x, y| image::Rgb(color(x, y)));
        image.save(at(format!("{name}.png"))).unwrap();
        std::fs::write(at(format!("{name}.mtl")), format!("newmtl m\nmap_Kd {name}.png\n")).unwrap();
        std::fs::write(at(format!("{name}.obj")), format!("mtllib {name}.mtl\n{obj}")).unwrap();
    };
    let painted =
        |x: u32, y: u32| [(30 * x) as u8, if x / 2 % 2 == y / 2 % 2 { 210 } else { 60 }, (250 - 25 * y) as u8];
    paint("painted", &painted);
    paint("grey", &|_, _| [120; 3]);
    std::fs::write(at("plain.obj".into()), plain).unwrap();
}

/// The mean difference of two pictures, in 255ths.
fn difference(folder: &Path, a: &str, b: &str) -> f64 {
    let [a, b] = [a, b].map(|name| image::open(folder.join(name)).unwrap().into_rgb8());
    let sum: u32 = a.as_raw().iter().zip(b.as_raw()).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
    f64::from(sum) / a.as_raw().len() as f64
}

/// Renders NAME.obj to NAME_seen.png.
fn look(folder: &Path, name: &str) {
    let look = format!("render {name}.obj -o {name}_seen.png --size 64 --unlit --azimuth 40 --elevation 25");
    succeeds(folder, &words(&look));
}

#[test]
fn a_texture_is_fitted_and_rendered() {
    let folder = tempfile::tempdir().unwrap();
    write_cubes(folder.path());
    let fit = "fit --from painted.obj --template grey.obj --texture --views 6 --size 48 --iterations 80 -o found.obj";
    succeeds(folder.path(), &words(fit));
    // Texture, silhouette and picture: all are those of the mesh that the views were made from.
    let difference = |a: &str, b: &str| difference(folder.path(), a, b);
    let (found, before) = (difference("found_texture.png", "painted.png"), difference("grey.png", "painted.png"));
    assert!(found < 8.0 && before > 50.0, "{found} of {before} before, in 255");
    ["painted", "found", "grey"].iter().for_each(|name| look(folder.path(), name));
    let seen = difference("found_seen.png", "painted_seen.png");
    assert!(seen < 0.2 * difference("grey_seen.png", "painted_seen.png"), "{seen}");
    let depths = "fit --from painted.obj --template grey.obj --texture --also depth -o x.obj --views 2";
    fails(folder.path(), &words(depths), 2, &["--texture", "only texels", "--color"]);
}

#[test]
fn a_texture_is_made_for_a_mesh_that_has_none() {
    let folder = tempfile::tempdir().unwrap();
    write_cubes(folder.path());
    let fit = "fit --from painted.obj --template plain.obj --texture --views 8 --size 48 --iterations 30 --rate 1e-5 \
               -o found.obj --json log.json";
    let told = succeeds(folder.path(), &words(fit));
    assert!(told.contains("8 vertices, 12 triangles") && told.contains("colour error"), "{told}");
    let log = json(&folder.path().join("log.json"));
    assert_eq!((numbers(&log["loss"]).len(), numbers(&log["texture"]["color_loss"]).len()), (30, 100));
    let [by_vertices, error] =
        ["color_error_by_vertices", "color_error"].map(|key| log["texture"][key].as_f64().unwrap());
    assert_eq!(log["final"]["color_error"].as_f64(), Some(error));
    assert!(error < 0.25 * by_vertices && by_vertices > 0.05, "{error} with a texture, {by_vertices} by vertices");
    // The written mesh is read again with its texture, and shows the pattern.
    ["painted", "found", "grey"].iter().for_each(|name| look(folder.path(), name));
    let difference = |a: &str| difference(folder.path(), a, "painted_seen.png");
    let (seen, grey) = (difference("found_seen.png"), difference("grey_seen.png"));
    assert!(seen < 0.25 * grey, "{seen} with the texture, {grey} with grey");
    let side = f64::from(image::image_dimensions(folder.path().join("found_texture.png")).unwrap().0);
    assert_eq!(log["texture"]["side"].as_f64(), Some(side));
    // Where there is no room for a chart of each triangle, the mesh with vertex colours is kept.
    let small = "fit --from painted.obj --subdivisions 3 --texture --texture-size 64 --views 4 --size 24 --iterations 2 -o x.obj";
    let wanted = ["1280 triangles in 64×64", "allow 13", "best mesh before the error"];
    fails(folder.path(), &words(small), 1, &wanted);
    let text = std::fs::read_to_string(folder.path().join("x.obj")).unwrap();
    assert!(text.lines().any(|line| line.starts_with("v ") && line.split(' ').count() == 7), "no vertex colours");
}

#[test]
fn a_mesh_of_one_colour_is_fitted_under_light() {
    let folder = tempfile::tempdir().unwrap();
    let torus = softras::shapes::torus(1.0, 0.4, 24, 12).unwrap();
    let white = torus.with_appearance(softras::scene::Appearance::Uniform([1.0; 3])).unwrap();
    softras_io::save(&white, folder.path().join("torus.obj")).unwrap();
    let run = |extra: &[&str]| {
        let fit = "fit --from torus.obj --views 3 --size 24 --iterations 1 --subdivisions 2 --color -o out.obj \
                   --json log.json";
        let output = softras(folder.path(), &[&words(fit)[..], extra].concat());
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        let error = json(&folder.path().join("log.json"))["final"]["color_error"].as_f64().unwrap();
        (String::from_utf8(output.stderr).unwrap(), error)
    };
    let (said, lit) = run(&[]);
    assert!(said.contains("one colour") && said.contains("--shading none"), "{said}");
    // Colours without light are others.
    let (said, flat) = run(&["--shading", "none"]);
    assert!(!said.contains("one colour") && (flat - lit).abs() > 0.1, "{said} {flat} {lit}");
    fails(folder.path(), &["fit", "--from", "torus.obj", "--shading", "flat", "-o", "o.obj"], 2, &["--color"]);
}

#[test]
fn missing_cameras_show_what_they_look_like() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("photos")).unwrap();
    let parts = ["photos/cameras.json", "not found", "\"azimuth\": 45", "\"eye\""];
    fails(folder.path(), &["fit", "--views", "photos", "-o", "out.obj"], 1, &parts);
}

/// Sends what Ctrl-C sends, by the shell's own command: a bare Debian has no program for it.
#[cfg(unix)]
fn interrupt(child: &std::process::Child) {
    let kill = format!("kill -INT {}", child.id());
    assert!(std::process::Command::new("sh").args(["-c", &kill]).status().unwrap().success());
}

#[cfg(unix)]
#[test]
fn an_interrupted_fit_writes_its_best_and_exits_with_130() {
    let folder = tempfile::tempdir().unwrap();
    let fit =
        "fit --from torus --views 3 --size 24 --subdivisions 2 --iterations 1000000 -o out.obj --checkpoint a.npz";
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_softras"))
        .current_dir(folder.path())
        .args(fit.split_whitespace())
        .spawn()
        .unwrap();
    // The checkpoint is written after 100 steps.
    while !folder.path().join("a.npz").exists() {
        assert!(child.try_wait().unwrap().is_none(), "ended by itself");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    interrupt(&child);
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert!(std::fs::read_to_string(folder.path().join("out.obj")).unwrap().lines().any(|line| line.starts_with("f ")));
}

#[cfg(unix)]
#[test]
fn a_fit_can_be_interrupted_before_its_first_step() {
    let folder = tempfile::tempdir().unwrap();
    succeeds(folder.path(), &["mesh", "mug", "-o", "mug.obj"]);
    // The search for hollows takes long.
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_softras"))
        .current_dir(folder.path())
        .args("fit --from mug.obj --views 24 --size 64 --color -o out.obj".split_whitespace())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = std::io::BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.any(|line| line.starts_with("progress: hull")));
    interrupt(&child);
    assert!(lines.any(|line| line.contains("interrupted before the first step")));
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert!(!folder.path().join("out.obj").exists());
}

#[test]
fn depths_and_normals_are_fitted_too() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let run = |command: &str| succeeds(folder.path(), &words(command));
    let refused = |command: &str, parts: &[&str]| fails(folder.path(), &words(command), 1, parts);
    let common = "--iterations 20 --json log.json -o out.obj";
    let told = run(&format!("fit --from mug --views 8 --size 40 --also depth,normal --write-views seen {common}"));
    assert!(told.contains("genus 1"), "{told}");
    let read = "fit --views seen --depths seen/depths --normals seen/normals";
    run(&format!("{read} {common}"));
    let log = json(&at("log.json"));
    for name in ["depth_loss", "normal_loss"] {
        let losses = numbers(&log[name]);
        assert!(losses[0] > 0.0 && losses[19] < 0.9 * losses[0], "{name}: {losses:?}");
    }
    // With depths the fit begins with the mug's hollow, which no outline shows.
    let iou = |out: &str| succeeds(folder.path(), &["iou", out, "mug"]).trim().parse::<f64>().unwrap();
    run("fit --views seen --iterations 20 -o outlines.obj --save-cameras kept.json");
    let kept = std::fs::read_to_string(folder.path().join("kept.json")).unwrap();
    assert!(kept.lines().count() == 10 && kept.contains("view_007.png") && kept.contains("intrinsics"), "{kept}");
    assert!(iou("out.obj") > iou("outlines.obj") + 0.1, "{} {}", iou("out.obj"), iou("outlines.obj"));
    // The other formats: what render writes, and pictures of 16 bits.
    run("render mug -o view_000.exr --output depth,normal --size 40");
    for (map, name) in [("depth", "depths"), ("normal", "normals")] {
        std::fs::remove_file(at(&format!("seen/{name}/view_000.npy"))).unwrap();
        std::fs::rename(at(&format!("view_000_{map}.exr")), at(&format!("seen/{name}/view_000.exr"))).unwrap();
    }
    run(&format!("{read} --template sphere --subdivisions 1 --iterations 1 -o out.obj"));
    std::fs::remove_file(at("seen/depths/view_000.exr")).unwrap();
    image::GrayImage::new(40, 40).save(at("seen/depths/view_000.png")).unwrap();
    refused(&format!("{read} -o out.obj"), &["no grey picture of 16 bits"]);
    image::ImageBuffer::<image::Luma<u16>, _>::from_pixel(40, 40, image::Luma([4000]))
        .save(at("seen/depths/view_000.png"))
        .unwrap();
    run(&format!("{read} --template sphere --subdivisions 1 --iterations 1 -o out.obj"));
    // Depth maps that do not belong to the pictures are refused.
    image::ImageBuffer::<image::Luma<u16>, _>::new(30, 40).save(at("seen/depths/view_000.png")).unwrap();
    refused(&format!("{read} -o out.obj"), &["30×40 pixels, its picture 40×40"]);
    std::fs::remove_file(at("seen/depths/view_000.png")).unwrap();
    refused(&format!("{read} -o out.obj"), &["has no depths of view_000.png", "name it view_000.exr"]);
    std::fs::write(at("seen/depths/view_000.exr"), b"\x76\x2f\x31\x01 and no more").unwrap();
    refused(&format!("{read} -o out.obj"), &["view_000.exr", "OpenEXR"]);
    std::fs::copy(at("seen/normals/view_000.exr"), at("seen/depths/view_000.exr")).unwrap();
    refused(&format!("{read} -o out.obj"), &["has the channels B, G, R", "name the depths' channel Z"]);
}
