//! Tests of materials and textures.

use super::*;

#[test]
fn material_colours_become_a_colour_per_face() {
    let obj = format!(
        "mtllib mesh.mtl\n{TRIANGLE}v 1 1 0\nusemtl red\nf 1 2 4 3\nusemtl grey\nf 2 4 3\nusemtl red\nf 3 2 1\n"
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
    assert_note(&loaded.notes, &[":1: ", "gone.mtl", "not found"]);
    assert_eq!(loaded.notes.len(), 1, "{:?}", loaded.notes);
    let loaded = load_with_mtl(&obj.replace("gone", "mesh"), "newmtl blue\nKd 0 0 1\n").unwrap();
    assert_note(&loaded.notes, &[":5: ", "\"red\"", "in no MTL file"]);
    let loaded = load_with_mtl(&obj.replace("gone", "mesh"), "newmtl red\nKd xyz 1 1 1\nd 0.5\n").unwrap();
    assert_note(&loaded.notes, &["mesh.mtl:2", "CIE XYZ"]);
    assert_eq!(loaded.opacity, [0.5]);
    assert_note(&loaded.notes, &[":5: ", "neither Kd nor map_Kd"]);
    // Names in notes are no longer than a line.
    let long = "a".repeat(2000);
    let used = obj.replace("gone", "mesh").replace("red", &long);
    for (mtl, part) in
        [("Ns 3\nnorm n.png", "norm of"), ("newmtl NAME", "defined again"), ("d 0", "wholly transparent")]
    {
        let loaded = load_with_mtl(&used, &format!("newmtl {long}\n{}\n", mtl.replace("NAME", &long))).unwrap();
        assert_note(&loaded.notes, &[part]);
        assert!(loaded.notes.iter().all(|note| note.len() < 400), "{:?}", loaded.notes);
    }
}

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
    let linear = load(folder.path().join("mesh.obj"), &LoadOptions { srgb: true, ..RAW }).unwrap();
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
    assert_note(&loaded.notes, &[":15: ", "no UVs"]);
    assert_note(&loaded.notes, &["lie on others"]);
    assert_eq!(loaded.notes.len(), 2);
}

#[test]
fn jpeg_grey_deep_and_transparent_images_are_read() {
    use image::{DynamicImage, ImageBuffer, ImageFormat::*};
    let write = |image: image::DynamicImage, format| {
        let mut bytes = std::io::Cursor::new(Vec::new());
        image.write_to(&mut bytes, format).unwrap();
        // A name tells the format where the content does not, which is that of TGA alone.
        let name = if format == Tga { "t.tga" } else { "t.png" };
        let mtl = format!("newmtl t\nmap_Kd {name}");
        let files: [(&str, &[u8]); 3] =
            [("mesh.obj", TEXTURED.as_bytes()), ("mesh.mtl", mtl.as_bytes()), (name, bytes.get_ref())];
        let loaded = load_in(&folder(&files)).unwrap();
        let Appearance::Textured { textures, .. } = loaded.mesh.appearance() else { panic!("{:?}", loaded.notes) };
        assert_eq!(loaded.opacity, [0.0; 0]);
        (textures[0].texels()[0], textures[0].alpha().map(|alpha| alpha[0]), loaded.notes)
    };
    let grey = DynamicImage::ImageLuma8(ImageBuffer::from_pixel(3, 2, image::Luma([51])));
    assert_eq!(write(grey.clone(), Png), ([0.2; 3], None, vec![]));
    assert_eq!(write(grey, Tga), ([0.2; 3], None, vec![]));
    let deep = DynamicImage::ImageRgb16(ImageBuffer::from_pixel(3, 2, image::Rgb([1, 0, 65535])));
    assert_eq!(write(deep, Png), ([1.0 / 65535.0, 0.0, 1.0], None, vec![]));
    let glass = DynamicImage::ImageRgba8(ImageBuffer::from_pixel(3, 2, image::Rgba([255, 0, 0, 9])));
    assert_eq!(write(glass, Png), ([1.0, 0.0, 0.0], Some(9.0 / 255.0), vec![]));
    let solid = DynamicImage::ImageRgba8(ImageBuffer::from_pixel(3, 2, image::Rgba([255, 0, 0, 255])));
    assert_eq!(write(solid, Png), ([1.0, 0.0, 0.0], None, vec![]));
    let deep_glass = DynamicImage::ImageLumaA16(ImageBuffer::from_pixel(3, 2, image::LumaA([0, 6553])));
    assert_eq!(write(deep_glass, Png), ([0.0; 3], Some(6553.0 / 65535.0), vec![]));
    let photo = DynamicImage::ImageRgb8(ImageBuffer::from_pixel(8, 8, image::Rgb([128, 128, 128])));
    let (texel, alpha, notes) = write(photo, Jpeg);
    assert!((texel[0] - 128.0 / 255.0).abs() < 0.02 && alpha.is_none() && notes.is_empty());
}

/// `map_d` beside a texture of the same size, alone, of another size, and of an image with an alpha channel.
#[test]
fn alpha_maps_give_textures_their_alpha() {
    let png_of = |image: image::DynamicImage| {
        let mut bytes = std::io::Cursor::new(Vec::new());
        image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        bytes.into_inner()
    };
    let grey =
        |width| image::DynamicImage::from(image::GrayImage::from_raw(width, 1, vec![51; width as usize]).unwrap());
    let own = image::DynamicImage::from(image::RgbaImage::from_raw(1, 1, vec![51, 51, 51, 102]).unwrap());
    let read = |mtl: &str, alpha: image::DynamicImage| {
        let files: [(&str, &[u8]); 4] = [
            ("mesh.obj", TEXTURED.as_bytes()),
            ("mesh.mtl", mtl.as_bytes()),
            ("t.png", &one_pixel_png([255, 0, 0])),
            ("a.png", &png_of(alpha)),
        ];
        // sRGB is of colours and never of alpha.
        let options = LoadOptions { srgb: true, ..RAW };
        let folder = folder(&files);
        let loaded = load(folder.path().join("mesh.obj"), &options).unwrap();
        let Appearance::Textured { textures, .. } = loaded.mesh.appearance() else { panic!("{loaded:?}") };
        (textures[0].texels().to_vec(), textures[0].alpha().map(<[f32]>::to_vec), loaded.notes)
    };
    let red = [1.0, 0.0, 0.0];
    let both = "newmtl t\nmap_Kd t.png\nmap_d a.png";
    assert_eq!(read(both, grey(1)), (vec![red], Some(vec![0.2]), vec![]));
    assert_eq!(read(both, own), (vec![red], Some(vec![0.4]), vec![]));
    // A colour of one texel takes any size, a larger one does not.
    assert_eq!(read(both, grey(2)), (vec![red; 2], Some(vec![0.2; 2]), vec![]));
    assert_eq!(read("newmtl t\nKd 1 0 0\nmap_d a.png", grey(2)), (vec![red; 2], Some(vec![0.2; 2]), vec![]));
    let wide = "newmtl t\nmap_Kd a.png\nmap_d t.png";
    let (texels, alpha, notes) = read(wide, grey(2));
    assert_eq!((texels.len(), alpha), (2, None));
    assert_note(&notes, &["mesh.mtl:3", "map_d of 1×1", "2×1", "not used"]);
}

#[test]
fn opacity_is_d_or_1_less_tr() {
    let opacity = |statements: &str| {
        let obj = format!("mtllib mesh.mtl\n{TRIANGLE}usemtl a\nf 1 2 3\nusemtl b\nf 3 2 1\n");
        let mtl = format!("newmtl a\nKd 1 1 1\n{statements}\nnewmtl b\nKd 1 1 1\n");
        let loaded = load_with_mtl(&obj, &mtl).unwrap();
        (loaded.opacity, loaded.notes)
    };
    assert_eq!(opacity("d 0.25"), (vec![0.25, 1.0], vec![]));
    assert_eq!(opacity("Tr 0.25"), (vec![0.75, 1.0], vec![]));
    assert_eq!(opacity("Tr 1\nd -halo 0.5"), (vec![0.5, 1.0], vec![]));
    assert_eq!(opacity("d 1.0\nTr 1.0"), (vec![], vec![]));
    assert_eq!(opacity("d 7"), (vec![], vec![]));
    let (opaque, notes) = opacity("d one half");
    assert_eq!(opaque, [0.0; 0]);
    assert_note(&notes, &["mesh.mtl:3", "malformed `d`"]);
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
    for option in ["-blendu", "-mm"] {
        assert_note(&notes, &["mesh.mtl:2", &format!("option {option} of map_Kd")]);
    }
    assert_eq!(notes.len(), 2);
}

/// As many materials as a megabyte holds are looked up in no time.
#[test]
fn thousands_of_materials_are_found_by_name() {
    use std::fmt::Write;
    let count = 64_000;
    let (mut obj, mut mtl) = (String::from("mtllib mesh.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n"), String::new());
    for i in 0..count {
        writeln!(mtl, "newmtl m{i}\nKd {} 0 1", f64::from(i) / f64::from(count)).unwrap();
        writeln!(obj, "usemtl m{}\nf 1 2 3", count - 1 - i).unwrap();
    }
    let begin = std::time::Instant::now();
    let loaded = load_with_mtl(&obj, &mtl).unwrap();
    assert!(begin.elapsed().as_secs_f64() < 10.0, "{:?}", begin.elapsed());
    let Appearance::Surface { texels, .. } = loaded.mesh.appearance() else { panic!("one colour for all") };
    assert_eq!((texels.len(), texels[0][0], texels[63_999][0]), (64_000, 63_999.0 / 64_000.0, 0.0));
}
