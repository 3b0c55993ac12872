//! OBJ, MTL and texture files: what is read, what is noted, what is refused with its line, and that writing and reading
//! give the mesh back.
#![cfg(feature = "obj")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use softras::{
    Error, Mesh,
    obj::{LoadOptions, Loaded, load, write_obj},
    scene::{Appearance, Texture, Wrap},
    shapes,
};
use std::{fs, path::Path};
use tempfile::TempDir;

/// A folder with the given files; the OBJ file under test is `mesh.obj`.
fn folder<B: AsRef<[u8]>>(files: &[(&str, B)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        fs::write(folder.path().join(name), content).unwrap();
    }
    folder
}

fn load_in(folder: &TempDir) -> softras::Result<Loaded> {
    load(&folder.path().join("mesh.obj"), &LoadOptions::default())
}

fn load_text(obj: impl AsRef<[u8]>) -> softras::Result<Loaded> {
    load_in(&folder(&[("mesh.obj", obj)]))
}

fn load_with_mtl(obj: &str, mtl: &str) -> softras::Result<Loaded> {
    load_in(&folder(&[("mesh.obj", obj), ("mesh.mtl", mtl)]))
}

/// The mesh of a text that is read without a word.
#[track_caller]
fn quiet(obj: impl AsRef<[u8]>) -> Mesh {
    let loaded = load_text(obj).unwrap();
    assert_eq!(loaded.notes, [""; 0]);
    loaded.mesh
}

#[track_caller]
fn assert_note(notes: &[String], parts: &[&str]) {
    assert!(notes.iter().any(|note| parts.iter().all(|part| note.contains(part))), "{parts:?} in none of {notes:#?}");
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

fn one_pixel_png(color: [u8; 3]) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::RgbImage::from_pixel(1, 1, image::Rgb(color)).write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

#[test]
fn vertices_keep_the_order_of_the_file_across_groups_and_materials() {
    let text = "v 0 0 0\nv 9 9 9\nv 1 0 0\nv 0 1 0\nv 0 0 1\n\
                o first\ng a\nf 5 4 3\no second\nusemtl x\nf 1 3 4\ng third\nf -5 -1 -2\n";
    let mesh = load_text(text).unwrap().mesh;
    assert_eq!(mesh.positions()[1], [9.0; 3], "a vertex that no face uses stays");
    assert_eq!(mesh.positions().len(), 5);
    assert_eq!(mesh.triangles(), [[4, 3, 2], [0, 2, 3], [0, 4, 3]]);
}

#[test]
fn negative_indices_count_back_from_their_own_line_and_faces_may_come_first() {
    let mesh = quiet("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 2 2 2\nf -3 -2 -1\n");
    assert_eq!(mesh.triangles(), [[0, 1, 2], [0, 1, 2], [1, 2, 3]]);
}

#[test]
fn every_way_to_write_a_text_file_reads_the_same() {
    let expected = quiet(format!("{TRIANGLE}f 1 2 3\n"));
    let spellings: [&[u8]; 9] = [
        b"v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n",
        b"v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\r",
        b"\xef\xbb\xbfv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3",
        b"\tv\t0\t0\t0\n  v 1 0 0  \nv 0 1 0\n\nf\t1\t2\t3\t",
        b"v 0 0 \\\n0\nv 1 0 0\nv 0 1 0\nf 1 \\\r\n2 \\\n 3\n",
        b"#comment\nv 0 0 0 # comment\nv 1 0 0 #c\nv 0 1 0\nf 1 2 3 # v 1 2 3\n###\n",
        b"o caf\xe9\nv 0e0 -0 +0\nv 1.0 0. .0\nv 0 10e-1 0\nf 1 2 3\n",
        b"v 0 0 0 1\nv 1 0 0 1.0\nv 0 1 0\nf 1// 2// 3//\n",
        b"s off\nvt 0.5\nvt 0 1 0\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\ng\n",
    ];
    for text in spellings {
        let loaded = load_text(text).unwrap_or_else(|e| panic!("{e}\n{}", String::from_utf8_lossy(text)));
        assert_eq!(loaded.mesh, expected, "{}", String::from_utf8_lossy(text));
    }
}

#[test]
fn polygons_are_cut_in_their_plane() {
    let quad = quiet("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n");
    assert_eq!(quad.triangles(), [[0, 1, 2], [0, 2, 3]]);
    // Concave at vertex 4: a fan from vertex 1 would leave the polygon.
    let arrow = quiet("v 0 0 0\nv 0 4 0\nv 0 4 4\nv 0 2 1\nv 0 0 4\nf 1 2 3 4 5\n");
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| glam::Vec3::from(arrow.positions()[i as usize]));
        (b - a).cross(c - a).x / 2.0
    };
    assert_eq!(arrow.triangles().len(), 3);
    assert!(arrow.triangles().iter().all(|t| area(t) > 0.0));
    assert_eq!(arrow.triangles().iter().map(area).sum::<f32>(), 10.0);
    let bow_tie = load_text("v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 4\n").unwrap();
    assert_eq!(bow_tie.mesh.triangles().len(), 2);
    assert_note(&bow_tie.notes, &["line 5", "cross themselves", "1 in all"]);
}

#[test]
fn degenerate_triangles_stay() {
    let mesh = quiet(format!("{TRIANGLE}v 2 0 0\nf 1 1 2\nf 1 2 4\n"));
    assert_eq!(mesh.triangles(), [[0, 0, 1], [0, 1, 3]]);
}

#[test]
fn vertex_colours_belong_to_their_vertices() {
    let mesh = quiet("v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 0.25\nf 3 2 1\n");
    let expected = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.25]];
    assert_eq!(mesh.appearance(), &Appearance::VertexColors(expected));
    // tobj would give the third vertex's colour to the first.
    let partly = load_text("v 0 0 0\nv 1 0 0\nv 0 1 0 0 0 1\nf 1 2 3\n").unwrap();
    let expected = vec![[1.0; 3], [1.0; 3], [0.0, 0.0, 1.0]];
    assert_eq!(partly.mesh.appearance(), &Appearance::VertexColors(expected));
    assert_note(&partly.notes, &["line 1 and 1 more", "white"]);
}

#[test]
fn a_fourth_coordinate_divides() {
    let loaded = load_text("v 0 0 0\nv 2 4 6 2\nv 0 1 0\nf 1 2 3\n").unwrap();
    assert_eq!(loaded.mesh.positions()[1], [1.0, 2.0, 3.0]);
    assert_note(&loaded.notes, &["line 2", "w divides"]);
}

#[test]
fn what_is_not_drawn_is_noted_once() {
    let text = format!(
        "{TRIANGLE}vn 0 0 1\nvn 0 1 0\nvt 0 0\nl 1 2\np 1\ncurv 0 1 1 2\nwobble 3\nf 1//1 2//1 3//2\nf 1/1/9 2/1/9 3/1/9\n"
    );
    let notes = load_text(text).unwrap().notes;
    assert_eq!(notes.len(), 6, "{notes:#?}");
    assert_note(&notes, &["line 4 and 1 more", "normals are computed"]);
    assert_note(&notes, &["line 7", "lines"]);
    assert_note(&notes, &["line 8", "points"]);
    assert_note(&notes, &["line 9", "free-form"]);
    assert_note(&notes, &["line 10", "wobble"]);
    assert_note(&notes, &["texture coordinates are not kept"]);
}

#[test]
fn material_colours_become_a_colour_per_face() {
    let obj = format!(
        "mtllib mesh.mtl\n{TRIANGLE}v 1 1 0\nusemtl red\nf 1 2 4 3\nusemtl grey\nf 1 2 3\nusemtl red\nf 3 2 1\n"
    );
    let loaded = load_with_mtl(&obj, "newmtl grey\nKa 0 0 0\nKd 0.5\nillum 2\nnewmtl red\nKd 1 0 0\n").unwrap();
    let (red, grey) = ([1.0, 0.0, 0.0], [0.5; 3]);
    let expected = Appearance::Surface { resolution: 1, texels: vec![red, red, grey, red] };
    assert_eq!(loaded.mesh.appearance(), &expected);
    assert_eq!(loaded.notes, [""; 0]);
    let uniform = load_with_mtl(&obj.replace("grey", "red"), "newmtl red\r\nKd 1 0 0\r\n").unwrap();
    assert_eq!(uniform.mesh.appearance(), &Appearance::Uniform(red));
}

#[test]
fn usemtl_may_come_before_mtllib_and_names_may_hold_spaces() {
    let obj = format!("usemtl dark  red\n{TRIANGLE}f 1 2 3\nmtllib\tother.mtl mesh.mtl\n");
    let files = [("mesh.obj", obj.as_str()), ("mesh.mtl", "newmtl dark  red\nKd .5 0 0\n"), ("other.mtl", "")];
    let loaded = load_in(&folder(&files)).unwrap();
    assert_eq!(loaded.mesh.appearance(), &Appearance::Uniform([0.5, 0.0, 0.0]));
    let spaced = folder(&[
        ("mesh.obj", format!("mtllib my file.mtl\n{TRIANGLE}usemtl a\nf 1 2 3").as_str()),
        ("my file.mtl", "newmtl a\nKd 1 0 0"),
    ]);
    assert_eq!(load_in(&spaced).unwrap().mesh.appearance(), &Appearance::Uniform([1.0, 0.0, 0.0]));
}

#[test]
fn missing_materials_are_white_and_noted() {
    let white = Appearance::Uniform([1.0; 3]);
    let obj = format!("mtllib gone.mtl\n{TRIANGLE}usemtl red\nf 1 2 3\n");
    let loaded = load_text(&obj).unwrap();
    assert_eq!(loaded.mesh.appearance(), &white);
    assert_note(&loaded.notes, &["line 1", "gone.mtl", "not found"]);
    assert_note(&loaded.notes, &["line 5", "\"red\"", "white"]);
    let loaded = load_with_mtl(&obj.replace("gone", "mesh"), "newmtl blue\nKd 0 0 1\n").unwrap();
    assert_note(&loaded.notes, &["line 5", "\"red\"", "in no MTL file"]);
    let loaded = load_with_mtl(&obj.replace("gone", "mesh"), "newmtl red\nKd xyz 1 1 1\nd 0.5\n").unwrap();
    assert_note(&loaded.notes, &["mesh.mtl:2", "CIE XYZ"]);
    assert_note(&loaded.notes, &["mesh.mtl:3", "transparency"]);
    assert_note(&loaded.notes, &["line 5", "neither Kd nor map_Kd"]);
}

const TEXTURED: &str = "mtllib mesh.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl t\nf 1/1 2/2 3/3\n";

#[test]
fn textures_keep_their_rows_values_and_corners() {
    let mut image = image::RgbImage::new(2, 2);
    for (i, pixel) in image.pixels_mut().enumerate() {
        pixel.0 = [i as u8 * 51, 0, 255];
    }
    let obj = TEXTURED.replace("f 1/1 2/2 3/3", "f 1/3 2/1 3/2\nf 3/1 2/1 1/1");
    let folder = folder(&[
        ("mesh.obj", obj.as_str()),
        ("mesh.mtl", "newmtl t\nKd 0.1 0.2 0.3\nmap_Kd -clamp on my image.png\n"),
    ]);
    // PNG content under any name.
    image.save_with_format(folder.path().join("my image.png"), image::ImageFormat::Png).unwrap();
    let loaded = load_in(&folder).unwrap();
    assert_eq!(loaded.notes, [""; 0]);
    let texels: Vec<_> = (0..4).map(|i| [(i * 51) as f32 / 255.0, 0.0, 1.0]).collect();
    let expected = Appearance::Textured {
        uvs: vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
        uv_triangles: vec![[2, 0, 1], [0, 0, 0]],
        textures: vec![Texture::new(2, 2, texels, Wrap::Clamp).unwrap()],
        texture_of_triangle: vec![],
    };
    assert_eq!(loaded.mesh.appearance(), &expected);
    let linear = load(&folder.path().join("mesh.obj"), &LoadOptions { srgb: true, ..LoadOptions::default() }).unwrap();
    let Appearance::Textured { textures, .. } = linear.mesh.appearance() else { panic!() };
    assert!((textures[0].texels()[1][0] - 0.033_104_77).abs() < 1e-6);
    assert_eq!(textures[0].texels()[1][1..], [0.0, 1.0]);
}

#[test]
fn faces_without_a_texture_get_an_image_of_their_colour() {
    let obj = format!("{TEXTURED}usemtl red\nf 1 2 3\nusemtl u\nf 1/1 2/2 3/3\nusemtl t\nf 3 2 1\nf 3/3 2/2 1/1\n");
    let files: [(&str, &[u8]); 4] = [
        ("mesh.obj", obj.as_bytes()),
        ("mesh.mtl", b"newmtl t\nmap_Kd a.png\nnewmtl red\nKd 1 0 0\nnewmtl u\nmap_Kd b.png\n"),
        ("a.png", &one_pixel_png([0, 255, 0])),
        ("b.png", &one_pixel_png([0, 0, 255])),
    ];
    let loaded = load_in(&folder(&files)).unwrap();
    let Appearance::Textured { uv_triangles, textures, texture_of_triangle, .. } = loaded.mesh.appearance() else {
        panic!("{loaded:?}")
    };
    let colors: Vec<_> = textures.iter().map(|t| t.texels()[0]).collect();
    assert_eq!(colors, [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0]]);
    assert_eq!(texture_of_triangle, &[0, 1, 2, 3, 0]);
    assert_eq!(uv_triangles[4], [2, 1, 0]);
    assert_note(&loaded.notes, &["line 15", "no UVs", "1 in all"]);
    assert_eq!(loaded.notes.len(), 1);
}

#[test]
fn jpeg_grey_deep_and_transparent_images_are_read() {
    let write = |image: image::DynamicImage, format| {
        let mut bytes = std::io::Cursor::new(Vec::new());
        image.write_to(&mut bytes, format).unwrap();
        let files: [(&str, &[u8]); 3] =
            [("mesh.obj", TEXTURED.as_bytes()), ("mesh.mtl", b"newmtl t\nmap_Kd t.png"), ("t.png", bytes.get_ref())];
        let loaded = load_in(&folder(&files)).unwrap();
        let Appearance::Textured { textures, .. } = loaded.mesh.appearance() else { panic!() };
        (textures[0].texels()[0], loaded.notes)
    };
    use image::{DynamicImage, ImageBuffer, ImageFormat::*};
    let grey = DynamicImage::ImageLuma8(ImageBuffer::from_pixel(3, 2, image::Luma([51])));
    assert_eq!(write(grey, Png), ([0.2; 3], vec![]));
    let deep = DynamicImage::ImageRgb16(ImageBuffer::from_pixel(3, 2, image::Rgb([1, 0, 65535])));
    assert_eq!(write(deep, Png), ([1.0 / 65535.0, 0.0, 1.0], vec![]));
    let glass = DynamicImage::ImageRgba8(ImageBuffer::from_pixel(3, 2, image::Rgba([255, 0, 0, 9])));
    let (texel, notes) = write(glass, Png);
    assert_eq!(texel, [1.0, 0.0, 0.0]);
    assert_note(&notes, &["transparency"]);
    let photo = DynamicImage::ImageRgb8(ImageBuffer::from_pixel(8, 8, image::Rgb([128, 128, 128])));
    let (texel, notes) = write(photo, Jpeg);
    assert!((texel[0] - 128.0 / 255.0).abs() < 0.02 && notes.is_empty());
}

#[test]
fn unhonoured_texture_options_are_noted() {
    let files: [(&str, &[u8]); 3] = [
        ("mesh.obj", TEXTURED.as_bytes()),
        ("mesh.mtl", b"newmtl t\nmap_Kd -s 2 2 -blendu on -mm 0 1 -clamp off sub\\..\\t.png\n"),
        ("t.png", &one_pixel_png([9, 9, 9])),
    ];
    let folder = folder(&files);
    fs::create_dir(folder.path().join("sub")).unwrap();
    let notes = load_in(&folder).unwrap().notes;
    for option in ["-s", "-blendu", "-mm"] {
        assert_note(&notes, &["mesh.mtl:2", &format!("option {option} of map_Kd")]);
    }
    assert_eq!(notes.len(), 3);
}

/// A malformed text, the line at fault and words of the message.
type Refused = (&'static str, Option<usize>, &'static [&'static str]);

#[track_caller]
fn assert_refused(error: Error, name: &str, line: Option<usize>, words: &[&str]) {
    let Error::File { path, line: at, what, mend } = &error else { panic!("not Error::File: {error:?}") };
    assert_eq!(*at, line, "{error}");
    assert_eq!(path.file_name().unwrap(), name, "{error}");
    assert!(words.iter().all(|word| what.contains(word)), "{words:?} not all in {what:?}");
    assert!(mend.len() > 5, "{error}");
    let place = line.map_or(format!("{name}: "), |line| format!("{name}:{line}: "));
    assert!(error.to_string().contains(&place), "{error}");
}

#[test]
fn malformed_meshes_are_refused_with_their_line() {
    const V: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n";
    let cases: &[Refused] = &[
        ("", None, &["no faces", "0 vertices"]),
        ("V", None, &["no faces", "3 vertices"]),
        ("V f", Some(5), &["face of 0 corners"]),
        ("V f 1", Some(5), &["face of 1 corners"]),
        ("V f 1 2", Some(5), &["face of 2 corners"]),
        ("V f 0 1 2", Some(5), &["vertex index 0"]),
        ("V \n\nf 1 2 4", Some(7), &["vertex index 4", "there are 3"]),
        ("V f 1 2 3\nf 1 2 -4", Some(6), &["vertex index -4", "there are 3 before it"]),
        ("f -1 -2 -3\nV", Some(1), &["vertex index -1", "0 before it"]),
        ("V f a b c", Some(5), &["\"a\"", "whole number"]),
        ("V f 1.0 2 3", Some(5), &["\"1.0\""]),
        ("V f 1,2,3", Some(5), &["\"1,2,3\""]),
        ("V f 1 2 99999999999999999999", Some(5), &["99999999999999999999"]),
        ("V f 1 2 9223372036854775807", Some(5), &["there are 3"]),
        ("V f 1/1 2/1 3/9223372036854775807", Some(5), &["texture coordinate index", "there are 1"]),
        ("V f 1/1 2/1 3/-9223372036854775808", Some(5), &["texture coordinate index"]),
        ("V f 1/0 2/1 3/1", Some(5), &["texture coordinate index 0"]),
        ("V f 1/2 2/1 3/1", Some(5), &["texture coordinate index 2", "there are 1"]),
        ("V f 1/1 2 3/1", Some(5), &["some corners"]),
        ("V f 1/1/1/1 2 3", Some(5), &["more than three"]),
        ("V f 1//x 2 3", Some(5), &["normal index \"x\""]),
        ("V f /1 2 3", Some(5), &["vertex index \"\""]),
        ("V v 1 2\nf 1 2 3", Some(5), &["vertex of 2 numbers"]),
        ("V v\nf 1 2 3", Some(5), &["vertex of 0 numbers"]),
        ("V v 1 2 3 4 5\nf 1 2 3", Some(5), &["vertex of 5 numbers"]),
        ("V v 1 2 3 4 5 6 7\nf 1 2 3", Some(5), &["vertex of 7 numbers"]),
        ("V v 1 2 x\nf 1 2 3", Some(5), &["position parse error", "v 1 2 x"]),
        ("V v 1 2 1,5\nf 1 2 3", Some(5), &["position parse error"]),
        ("V v 1 2 nan\nf 1 2 3", Some(5), &["NaN", "not finite"]),
        ("V # c\nv 1 -inf 0\nf 1 2 3", Some(6), &["-inf", "not finite"]),
        ("V v 1 1e39 0\nf 1 2 3", Some(5), &["not finite"]),
        ("V v 1 2 3 0\nf 1 2 3", Some(5), &["zero"]),
        ("V v 1 2 3 0 0 x\nf 1 2 3", Some(5), &["vertex colour \"x\""]),
        ("V v 1 2 3 0 0 inf\nf 1 2 3", Some(5), &["vertex colour \"inf\""]),
        ("V vt\nf 1 2 3", Some(5), &["texture coordinate of 0"]),
        ("V vt 1 2 3 4\nf 1 2 3", Some(5), &["texture coordinate of 4"]),
        ("V vt x 0\nf 1 2 3", Some(5), &["texcoord parse error"]),
        ("V vt nan 0\nf 1 2 3", Some(5), &["±10000"]),
        ("V vt 0 1e5\nf 1 2 3", Some(5), &["±10000"]),
        ("V f 1 2 \\\n 7", Some(5), &["vertex index 7"]),
    ];
    for (text, line, words) in cases {
        let text = text.replace("V ", V).replace('V', V);
        let error = load_text(&text).err().unwrap_or_else(|| panic!("taken: {text}"));
        assert_refused(error, "mesh.obj", *line, words);
    }
    let mut comb = String::new();
    (0..3000).for_each(|i| comb += &format!("v {} {i} 0\n", if i == 0 { 2 } else { i % 2 }));
    comb += "f";
    (1..=3000).for_each(|i| comb += &format!(" {i}"));
    assert_refused(load_text(comb).unwrap_err(), "mesh.obj", Some(3001), &["concave", "3000"]);
    assert_refused(load_text(b"\xff\xfev\0 \0").unwrap_err(), "mesh.obj", None, &["UTF-16"]);
    assert_refused(load_text(one_pixel_png([0; 3])).unwrap_err(), "mesh.obj", None, &["no faces"]);
}

#[test]
fn malformed_materials_are_refused_with_their_line() {
    let cases: &[Refused] = &[
        ("Kd 1 0 0", Some(1), &["Kd before any material"]),
        ("newmtl t\nKd 1 0", Some(2), &["malformed colour"]),
        ("newmtl t\nKd", Some(2), &["malformed colour"]),
        ("newmtl t\nKd a b c", Some(2), &["a b c"]),
        ("newmtl t\nKd 1 nan 1", Some(2), &["nan"]),
        ("newmtl", Some(1), &["without a name"]),
        ("newmtl t\nmap_Kd", Some(2), &["without a file"]),
        ("newmtl t\nmap_Kd -s 1 1 1", Some(2), &["without a file"]),
        ("newmtl t\nmap_Kd -wobble 1 t.png", Some(2), &["-wobble"]),
        ("newmtl t\nmap_Kd -clamp maybe t.png", Some(2), &["-clamp maybe"]),
        ("newmtl t\nmap_Kd gone.png", Some(2), &["gone.png", "not found"]),
        ("newmtl t\n\nmap_Kd mesh.obj", Some(3), &["mesh.obj"]),
        ("newmtl t\nmap_Kd ../../../etc/hostname", Some(2), &["outside"]),
        ("newmtl t\nmap_Kd /etc/hostname", Some(2), &["outside"]),
        ("newmtl t\nmap_Kd ../no such file", Some(2), &["outside"]),
    ];
    for (mtl, line, words) in cases {
        let error = load_with_mtl(TEXTURED, mtl).err().unwrap_or_else(|| panic!("taken: {mtl}"));
        assert_refused(error, "mesh.mtl", *line, words);
    }
}

#[test]
fn broken_and_huge_images_are_refused() {
    let whole = one_pixel_png([1, 2, 3]);
    let mut huge = whole.clone();
    // The width in the IHDR chunk, which its checksum (here mended) covers.
    huge[16..20].copy_from_slice(&20_000u32.to_be_bytes());
    let crc = crc32(&huge[12..29]);
    huge[29..33].copy_from_slice(&crc.to_be_bytes());
    for (png, words) in [(&whole[..whole.len() / 2], "end of file"), (&huge[..], "limit"), (b"", "end of file")] {
        let files: [(&str, &[u8]); 3] =
            [("mesh.obj", TEXTURED.as_bytes()), ("mesh.mtl", b"newmtl t\nmap_Kd t.png"), ("t.png", png)];
        let error = load_in(&folder(&files)).unwrap_err();
        assert_refused(error, "mesh.mtl", Some(2), &["t.png", words]);
    }
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| if c & 1 == 1 { (c >> 1) ^ 0xedb8_8320 } else { c >> 1 })
    })
}

#[test]
fn files_outside_the_folder_are_read_only_on_request() {
    let root = tempfile::tempdir().unwrap();
    let inner = root.path().join("inner");
    fs::create_dir(&inner).unwrap();
    fs::write(root.path().join("t.png"), one_pixel_png([255, 0, 0])).unwrap();
    fs::write(root.path().join("mesh.mtl"), "newmtl t\nmap_Kd t.png\n").unwrap();
    fs::write(inner.join("mesh.obj"), TEXTURED.replace("mesh.mtl", "../mesh.mtl")).unwrap();
    let path = inner.join("mesh.obj");
    let error = load(&path, &LoadOptions::default()).unwrap_err();
    assert_refused(error, "mesh.obj", Some(1), &["outside"]);
    let options = LoadOptions { allow_outside: true, ..LoadOptions::default() };
    let loaded = load(&path, &options).unwrap();
    assert!(matches!(loaded.mesh.appearance(), Appearance::Textured { .. }));
    // A link leads outside as well as a path does.
    #[cfg(unix)]
    {
        fs::write(&path, TEXTURED).unwrap();
        fs::write(inner.join("mesh.mtl"), "newmtl t\nmap_Kd link.png\n").unwrap();
        std::os::unix::fs::symlink(root.path().join("t.png"), inner.join("link.png")).unwrap();
        assert_refused(load(&path, &LoadOptions::default()).unwrap_err(), "mesh.mtl", Some(2), &["outside"]);
    }
}

#[test]
fn unreadable_files_name_themselves() {
    let folder = tempfile::tempdir().unwrap();
    let error = load(&folder.path().join("none.obj"), &LoadOptions::default()).unwrap_err();
    assert!(matches!(error, Error::Io { .. }) && error.to_string().contains("none.obj"), "{error}");
    let error = load(folder.path(), &LoadOptions::default()).unwrap_err();
    assert!(error.to_string().contains("not a regular file"), "{error}");
}

/// Every prefix of a file, and the file with each byte changed: an answer, whatever it is, and never a panic.
#[test]
fn cut_and_garbled_files_never_panic() {
    let text = format!("{TEXTURED}v 1 1 1 2\nf 1/-1/2 -2/1/1 3/2/1 4/1/1\nl 1 2\n");
    let folder = folder(&[("mesh.mtl", "newmtl t\nKd 0.5\n")]);
    let path = folder.path().join("mesh.obj");
    let try_load = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        if let Err(error) = load(&path, &LoadOptions::default()) {
            assert!(error.to_string().len() > 20);
        }
    };
    for i in 0..text.len() {
        try_load(&text.as_bytes()[..i]);
        for byte in *b"-/0 9\n\\#\xff" {
            let mut garbled = text.clone().into_bytes();
            garbled[i] = byte;
            try_load(&garbled);
        }
    }
}

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
    let folder = ["../shared/meshes", "/work/shared/meshes"].map(Path::new).into_iter().find(|folder| folder.is_dir());
    let Some(folder) = folder else {
        println!("SKIPPED: no ../shared/meshes");
        return;
    };
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
