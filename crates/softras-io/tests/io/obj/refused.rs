//! Tests that malformed files are refused with the line at fault.

use super::*;

/// A malformed text, the line at fault and words of the message.
type Refused = (&'static str, Option<usize>, &'static [&'static str]);

#[track_caller]
fn assert_refused(error: Error, name: &str, line: Option<usize>, words: &[&str]) {
    let Error::File { path, line: at, what, fix } = &error else { panic!("not Error::File: {error:?}") };
    assert_eq!(*at, line, "{error}");
    assert_eq!(path.file_name().unwrap(), name, "{error}");
    assert!(words.iter().all(|word| what.contains(word)), "{words:?} not all in {what:?}");
    assert!(fix.len() > 5, "{error}");
    let place = line.map_or(format!("{name}: "), |line| format!("{name}:{line}: "));
    assert!(error.to_string().contains(&place), "{error}");
}

#[test]
fn malformed_meshes_are_refused_with_their_line() {
    const V: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n";
    let cases: &[Refused] = &[
        ("", None, &["empty"]),
        ("# nothing", None, &["not an OBJ file"]),
        ("V", None, &["no faces", "3 vertices"]),
        ("V f 1 2", Some(5), &["no faces", "3 vertices"]),
        ("V f 1 2 4", Some(5), &["no faces", "no vertices of the file"]),
        ("V v 1 2 1,5\nf 1 2 4", Some(5), &["no faces", "not a number"]),
    ];
    for (text, line, words) in cases {
        let text = text.replace("V ", V).replace('V', V);
        let error = load_text(&text).err().unwrap_or_else(|| panic!("taken: {text}"));
        assert_refused(error, "mesh.obj", *line, words);
    }
    // The first note is on a line of another file.
    let files = [("mesh.obj", format!("mtllib mesh.mtl\n{V}")), ("mesh.mtl", "newmtl t\nKd 1 0".into())];
    assert_refused(load_in(&folder(&files)).unwrap_err(), "mesh.obj", None, &["no faces", "malformed colour"]);
    let mut comb = String::new();
    (0..3000).for_each(|i| comb += &format!("v {} {i} 0\n", if i == 0 { 2 } else { i % 2 }));
    comb += "f";
    (1..=3000).for_each(|i| comb += &format!(" {i}"));
    assert_refused(load_text(comb).unwrap_err(), "mesh.obj", Some(3001), &["concave", "3000"]);
    assert_refused(load_text(one_pixel_png([0; 3])).unwrap_err(), "mesh.obj", None, &["not an OBJ file"]);
}

/// Reads a mesh of which something can be left out: with a note on it, or an error where the options are strict.
#[track_caller]
fn assert_left_out(folder: &TempDir, name: &str, line: Option<usize>, words: &[&str]) -> Loaded {
    let loaded = load_in(folder).unwrap();
    assert_note(&loaded.notes, words);
    let options = LoadOptions { strict: true, ..RAW };
    assert_refused(load(folder.path().join("mesh.obj"), &options).unwrap_err(), name, line, words);
    loaded
}

#[test]
fn what_can_be_left_out_of_a_mesh_is_left_out() {
    const V: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n";
    let cases: &[Refused] = &[
        ("f", Some(6), &["fewer than three corners"]),
        ("f 1/1\nf 2/1", Some(6), &["fewer than three corners"]),
        ("f 1/1 2/1", Some(6), &["fewer than three corners"]),
        ("f 1 2\n", Some(6), &["fewer than three corners"]),
        ("l 1 2\n", Some(6), &["lines"]),
        ("f 0 1 2\nf 1 2 4\nf 1 2 -4\nf a b c\nf 1.0 2 3\nf 1,2,3\nf /1 2 3\nf 1/1/1/1 2 3", Some(6), &["no vertices"]),
        ("f 1 2 99999999999999999999", Some(6), &["no vertices"]),
        ("f 1 2 9223372036854775807\nf 1 2 -9223372036854775808", Some(6), &["no vertices"]),
        ("f 1 2 \\\n 7", Some(6), &["no vertices"]),
        ("v 1 2 x\nv 1 2\nv\nv 1 2 1,5\nv 1 2 3 x\nf 1 2 4", Some(6), &["not a number"]),
        ("v 1 2 3 4 5\nv 1 2 3 4 5 6 7 8", Some(6), &["x, y and z alone"]),
        ("vt nan 0", Some(6), &["±10000"]),
        ("vt\nvt x 0", Some(6), &["±10000"]),
        ("vt 1 2 3 4", Some(6), &["third texture coordinate"]),
        ("vt 0 1e5", Some(6), &["±10000"]),
        ("mtllib gone.mtl", Some(6), &["gone.mtl", "not found"]),
        ("mtllib ../outside.mtl", Some(6), &["outside"]),
        (
            "v 0 0 nan\nv -inf 0 0\nv 0 1e30 0\nv 1.#QNAN 0 0\nv 1 2 3 0\nf 1 2 4\nf 1 2 3 5\nf 1 6 3\nf 3 7 1\nf 8 1 2",
            Some(11),
            &["6 triangles", "no finite point"],
        ),
    ];
    for (text, line, words) in cases {
        let loaded = assert_left_out(&folder(&[("mesh.obj", format!("{V}{text}"))]), "mesh.obj", *line, words);
        assert_eq!(loaded.mesh.triangles(), [[0, 1, 2]], "{text}");
    }
    // A face keeps its place without the UVs and normals that the file lacks.
    for (corners, what) in [
        ("1/0 2/0 3/0", "texture coordinates"),
        ("1/1 2/2 3/-9223372036854775808", "texture coordinates"),
        ("1//1 2//x 3//-1", "normals"),
    ] {
        let loaded = load_text(format!("{}f {corners}\n", &V[..V.len() - 14])).unwrap();
        assert_note(&loaded.notes, &[what, "the file lacks"]);
        assert_eq!(loaded.mesh.triangles(), [[0, 1, 2]], "{corners}");
    }
    let loaded = load_text(format!("{V}v 1 1 0 0 0 x\n")).unwrap();
    assert_note(&loaded.notes, &["no finite numbers are white"]);
    // A point that no face names is no matter; its place is that of another, so that it is in no bounds.
    let loaded = load_text(format!("{V}v nan 0 0\n")).unwrap();
    assert_eq!((loaded.mesh.positions()[3], loaded.notes.len()), ([0.0; 3], 0));
    // A triangle that is left out takes its opacity, normals and colour with it.
    let text = format!(
        "v nan 0 0\n{}",
        TEXTURED.replace("f 1/1 2/2 3/3", "vn 0 0 1\nf 1/1/1 2/1/1 3/1/1\nusemtl u\nf 2/2/1 3/3/1 4/1/1")
    );
    let files: [(&str, &[u8]); 2] =
        [("mesh.obj", text.as_bytes()), ("mesh.mtl", b"newmtl t\nd 0.5\nnewmtl u\nKd 1 0 0\nd 0.25\n")];
    let loaded = load_in(&folder(&files)).unwrap();
    assert_eq!((loaded.opacity, loaded.normals), (vec![0.25], vec![[[0.0, 0.0, 1.0]; 3]]));
    assert_eq!(loaded.mesh.appearance(), &Appearance::Surface { resolution: 1, texels: vec![[1.0, 0.0, 0.0]] });
    // The faces after one that is left out have their own corners and UVs.
    let text = format!("{TEXTURED}f 1/1\nf 3/3 2/2\nf 2/2 3/3 1/1\nf 1/1 2 3/1");
    let png = one_pixel_png([0; 3]);
    let files: [(&str, &[u8]); 3] =
        [("mesh.obj", text.as_bytes()), ("mesh.mtl", b"newmtl t\nmap_Kd t.png"), ("t.png", &png)];
    let loaded = assert_left_out(&folder(&files), "mesh.obj", Some(10), &["fewer than three corners"]);
    assert_note(&loaded.notes, &[":13: ", "at only some corners"]);
    assert_eq!(loaded.mesh.triangles(), [[0, 1, 2], [1, 2, 0], [0, 1, 2]]);
    let Appearance::Textured { uv_triangles, .. } = loaded.mesh.appearance() else { panic!("{loaded:?}") };
    assert_eq!(uv_triangles, &[[0, 1, 2], [1, 2, 0], [0, 0, 0]]);
}

#[test]
fn what_can_be_left_out_of_materials_is_left_out() {
    let cases: &[Refused] = &[
        ("Kd 1 0 0", Some(1), &["Kd before any material"]),
        ("newmtl t\nKd 1 0", Some(2), &["malformed colour"]),
        ("newmtl t\nKd", Some(2), &["malformed colour"]),
        ("newmtl t\nKd 1 1e38 1", Some(2), &["malformed colour"]),
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
        let folder = folder(&[("mesh.obj", TEXTURED), ("mesh.mtl", mtl)]);
        let loaded = assert_left_out(&folder, "mesh.mtl", *line, words);
        assert_eq!(loaded.mesh.appearance(), &Appearance::Uniform([1.0; 3]), "{mtl}");
    }
    // A texture that is not there leaves its material's Kd.
    let loaded = load_with_mtl(TEXTURED, "newmtl t\nKd 0.1 0.2 0.3\nmap_Kd gone.png").unwrap();
    assert_eq!(loaded.mesh.appearance(), &Appearance::Uniform([0.1, 0.2, 0.3]));
    assert_note(&loaded.notes, &["mesh.mtl:3", "gone.png not found", "Kd"]);
}

#[test]
fn files_of_another_computer_are_found_by_their_name() {
    let png = one_pixel_png([0, 255, 0]);
    for name in ["/Users/somebody/T.PNG", "K:\\images\\t.png", "../t.png", "gone/t.png", "T.png"] {
        let mtl = format!("newmtl t\nmap_Kd {name}");
        let obj = TEXTURED.replace("mesh.mtl", "C:\\work\\MESH.mtl");
        let files: [(&str, &[u8]); 3] = [("mesh.obj", obj.as_bytes()), ("mesh.mtl", mtl.as_bytes()), ("t.png", &png)];
        let loaded = assert_left_out(&folder(&files), "mesh.obj", Some(1), &["MESH.mtl", "in its place"]);
        assert_note(&loaded.notes, &["mesh.mtl:2", "t.png is taken in its place"]);
        let Appearance::Textured { textures, .. } = loaded.mesh.appearance() else { panic!("{name}: {loaded:?}") };
        assert_eq!(textures[0].texels(), [[0.0, 1.0, 0.0]], "{name}");
        assert_eq!(loaded.files.len(), 3);
    }
}

#[test]
fn a_file_of_malformed_lines_is_told_of_briefly() {
    let loaded = load_with_mtl(TEXTURED, &"Kd\n".repeat(100_000)).unwrap();
    assert!(loaded.notes.len() < 200, "{}", loaded.notes.len());
    assert_note(&loaded.notes, &["notes more"]);
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
    let untouched = |loaded: &Loaded, words: &[&str]| {
        assert_note(&loaded.notes, words);
        assert_eq!(loaded.mesh.appearance(), &Appearance::Uniform([1.0; 3]));
    };
    untouched(&load(&path, &RAW).unwrap(), &[":1: ", "outside"]);
    let options = LoadOptions { allow_outside: true, ..RAW };
    let loaded = load(&path, &options).unwrap();
    assert!(matches!(loaded.mesh.appearance(), Appearance::Textured { .. }));
    // A link leads outside as well as a path does.
    #[cfg(unix)]
    {
        fs::write(&path, TEXTURED).unwrap();
        fs::write(inner.join("mesh.mtl"), "newmtl t\nmap_Kd link.png\n").unwrap();
        std::os::unix::fs::symlink(root.path().join("t.png"), inner.join("link.png")).unwrap();
        untouched(&load(&path, &RAW).unwrap(), &["mesh.mtl:2", "outside"]);
    }
}

/// The mesh, then its materials, then its textures, each from what the others left.
#[test]
fn files_are_counted_against_one_memory() {
    let image = image::DynamicImage::new_rgb8(16, 16);
    let mut png = std::io::Cursor::new(Vec::new());
    image.write_to(&mut png, image::ImageFormat::Png).unwrap();
    let mtl = "newmtl t\nKd 0 0 1\nmap_Kd t.png\n";
    let folder =
        folder(&[("mesh.obj", TEXTURED.as_bytes()), ("mesh.mtl", mtl.as_bytes()), ("t.png", png.get_ref().as_slice())]);
    let within = |memory: usize| {
        let options = LoadOptions { memory: Some(memory as u64), ..RAW };
        load(folder.path().join("mesh.obj"), &options)
    };
    let (obj, mtl, texels) = (24 * TEXTURED.len(), 24 * mtl.len(), 24 * 16 * 16);
    assert_refused(within(obj - 1).unwrap_err(), "mesh.obj", None, &["MiB of memory"]);
    let white = within(obj).unwrap();
    assert_note(&white.notes, &["mesh.mtl", "of memory", "white"]);
    let blue = within(obj + mtl + texels - 1).unwrap();
    assert_note(&blue.notes, &["t.png", "16×16", "Kd"]);
    assert_eq!(
        [white, blue].map(|loaded| loaded.mesh.appearance().clone()),
        [[1.0; 3], [0.0, 0.0, 1.0]].map(Appearance::Uniform)
    );
    let whole = within(obj + mtl + texels).unwrap();
    assert!(whole.notes.is_empty() && matches!(whole.mesh.appearance(), Appearance::Textured { .. }), "{whole:?}");
}

/// A picture of a few kilobytes may hold a hundred million pixels of one colour.
#[test]
fn textures_that_are_large_out_of_proportion_are_left_out() {
    let obj = "mtllib mesh.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n";
    for (side, is_drawn) in [(5000, true), (8192, false)] {
        let mut png = std::io::Cursor::new(Vec::new());
        image::GrayImage::new(side, side).write_to(&mut png, image::ImageFormat::Png).unwrap();
        let [mtl, png] = [&b"newmtl m\nmap_Kd a.png\n"[..], &png.into_inner()];
        let loaded = load_in(&folder(&[("mesh.obj", obj.as_bytes()), ("mesh.mtl", mtl), ("a.png", png)])).unwrap();
        let told = loaded.notes.join("; ");
        assert_eq!(matches!(loaded.mesh.appearance(), Appearance::Textured { .. }), is_drawn, "{told}");
        assert!(is_drawn || ["mesh.mtl:2", "8192×8192", "scale"].iter().all(|part| told.contains(part)), "{told}");
    }
}
