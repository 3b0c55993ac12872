//! Tests of PLY, STL and glTF files: they render to the same bits as the OBJ file of the same mesh, what they say beside it is
//! read, and malformed ones are refused without a panic and in little memory.

mod found;
mod write;

use crate::common::renderer;
use crate::mutation::mutated;
use crate::{LoadOptions, RAW, load, save};
use serde_json::json;
use softras::{
    Camera, Error, Mesh, Projection, Renderer, Scene, Settings,
    scene::{Appearance, Texture, Wrap},
    shapes,
};
use softras_io::Loaded;
use std::{fs, path::Path};
use tempfile::TempDir;
use write::{Ply, embedded, glb, gltf, ply, png, stl, stl_text};

fn read(folder: &TempDir, name: &str, bytes: &[u8]) -> softras::Result<Loaded> {
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    load(&path, &RAW)
}

#[track_caller]
fn assert_note(loaded: &Loaded, part: &str) {
    assert!(loaded.notes.iter().any(|note| note.contains(part)), "{part:?} in none of {:#?}", loaded.notes);
}

#[track_caller]
fn assert_refused(outcome: softras::Result<Loaded>, words: &[&str]) {
    let error = outcome.map(|loaded| panic!("read: {loaded:?}")).unwrap_err();
    assert!(matches!(error, Error::File { .. }), "{error:?}");
    assert!(words.iter().all(|word| error.to_string().contains(word)), "{words:?} not all in {error}");
}

fn pixels(renderer: &mut Renderer, mesh: &Mesh) -> Vec<u32> {
    let camera = Camera::from_angles(4.0, 25.0, 40.0, Projection::Perspective { fov_y: 0.6 }).unwrap();
    let settings = Settings { width: 64, height: 48, sigma: 1e-4, ..Settings::default() };
    let frame = renderer.render(&Scene::new(mesh.clone()), &[camera], &settings).unwrap();
    let images = [frame.color().unwrap(), frame.silhouette().unwrap()];
    images.iter().flat_map(|image| image.data.iter().map(|x| x.to_bits())).collect()
}

/// A white torus.
fn torus(around: u32, across: u32) -> Mesh {
    shapes::torus(1.0, 0.4, around, across).unwrap().with_appearance(Appearance::Uniform([1.0; 3])).unwrap()
}

/// A sphere with a texture whose UVs are whole 64ths, so that 1 - v is exact.
fn textured() -> Mesh {
    let sphere = shapes::icosphere(2).unwrap();
    let uvs = sphere.positions().iter().map(|p| [0, 2].map(|k| ((p[k] + 1.0) * 32.0).round() / 64.0)).collect();
    let texels = (0..35).map(|i| [i as f32 * 7.0 / 255.0, (255 - i) as f32 / 255.0, 1.0]).collect();
    let textures = vec![Texture::new(7, 5, texels, Wrap::Repeat).unwrap()];
    let uv_triangles = sphere.triangles().to_vec();
    sphere.with_appearance(Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle: vec![] }).unwrap()
}

#[test]
fn charts_of_single_triangles_are_drawn_without_mipmaps() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.glb");
    let filter = |mesh: &Mesh| {
        save(mesh, &path).unwrap();
        let bytes = fs::read(&path).unwrap();
        let text = String::from_utf8_lossy(&bytes);
        text.split_once("minFilter\":").unwrap().1[..4].to_string()
    };
    let whole = textured();
    let Appearance::Textured { uvs, uv_triangles, textures, .. } = whole.appearance().clone() else { panic!() };
    let uvs = uv_triangles.iter().flatten().map(|&uv| uvs[uv as usize]).collect();
    let uv_triangles = (0..uv_triangles.len() as u32).map(|t| [0, 1, 2].map(|k| 3 * t + k)).collect();
    let single = Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle: vec![] };
    assert_eq!(filter(&whole), "9987");
    assert_eq!(filter(&whole.with_appearance(single).unwrap()), "9729");
}

#[test]
fn every_format_renders_to_the_bits_of_its_obj() {
    let folder = tempfile::tempdir().unwrap();
    let mut renderer = renderer();
    let torus = torus(12, 8);
    let colors = torus.positions().iter().map(|p| p.map(|x| x.abs() / 2.0)).collect();
    let colored = torus.clone().with_appearance(Appearance::VertexColors(colors)).unwrap();
    for (mesh, has_color) in [(torus, false), (colored, true), (textured(), true)] {
        save(&mesh, &folder.path().join("mesh.obj")).unwrap();
        let obj = load(folder.path().join("mesh.obj"), &RAW).unwrap();
        let expected = pixels(&mut renderer, &obj.mesh);
        assert!(expected.iter().filter(|x| **x != 0).count() > 1000);
        let name = matches!(mesh.appearance(), Appearance::Textured { .. }).then_some("mesh_texture.png");
        let (root, binary) = gltf(&mesh);
        let mut files = vec![
            ("text.ply", ply(&mesh, Ply::Text, name)),
            ("little.ply", ply(&mesh, Ply::Little, name)),
            ("big.ply", ply(&mesh, Ply::Big, name)),
            ("mesh.glb", glb(&root, &binary)),
            ("embedded.gltf", embedded(root.clone(), &binary)),
        ];
        if !has_color {
            files.extend([("mesh.stl", stl(&mesh)), ("text.stl", stl_text(&mesh))]);
        }
        for (name, bytes) in files {
            let loaded = read(&folder, name, &bytes).unwrap();
            assert_eq!(loaded.mesh.triangles().len(), mesh.triangles().len(), "{name}");
            // Vertices at one position have become one.
            assert_eq!(loaded.mesh.positions().len(), mesh.positions().len(), "{name}");
            assert!(pixels(&mut renderer, &loaded.mesh) == expected, "{name}: other pixels");
            if !name.ends_with("ply") {
                assert_eq!(loaded.notes, [""; 0], "{name}");
            }
        }
    }
}

#[test]
fn other_files_are_refused_by_what_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let formats = "softras reads .obj, .ply, .stl, .gltf and .glb";
    let picture = png(&Texture::new(1, 1, vec![[1.0; 3]], Wrap::Clamp).unwrap());
    assert_refused(read(&folder, "mesh.png", &picture), &["mesh.png", ".png", formats]);
    assert_refused(read(&folder, "mesh", b"v 0 0 0"), &["no ending", formats]);
    assert!(matches!(load(Path::new("none.obj"), &RAW), Err(Error::Io { path, .. }) if path == Path::new("none.obj")));
    assert_refused(load(folder.path(), &RAW), &["not a regular file"]);
    // Content that tells its format counts more than the ending.
    let torus = torus(4, 3);
    assert_eq!(read(&folder, "mesh.txt", &ply(&torus, Ply::Little, None)).unwrap().mesh.triangles().len(), 24);
    let (root, binary) = gltf(&torus);
    assert_eq!(read(&folder, "other.obj", &glb(&root, &binary)).unwrap().mesh.triangles().len(), 24);
}

#[test]
fn nodes_place_and_repeat_meshes() {
    let folder = tempfile::tempdir().unwrap();
    let triangle = Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]]).unwrap();
    let (mut root, binary) = gltf(&triangle);
    root["nodes"] = json!([
        { "translation": [10.0, 0.0, 0.0], "children": [1, 2, 0] },
        { "mesh": 0, "rotation": [0.0, 0.0, 0.5f64.sqrt(), 0.5f64.sqrt()], "scale": [2.0, 2.0, 2.0] },
        { "mesh": 0, "matrix": [-1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 5.0, 1.0] },
        { "mesh": 0 },
    ]);
    root["scenes"] = json!([{ "nodes": [0] }]);
    let mesh = read(&folder, "mesh.glb", &glb(&root, &binary)).unwrap().mesh;
    let expected = [
        [[10.0, 0.0, 0.0], [10.0, 2.0, 0.0], [8.0, 0.0, 0.0]],
        // Mirrored, so that the corners come the other way around.
        [[10.0, 0.0, 5.0], [10.0, 1.0, 5.0], [9.0, 0.0, 5.0]],
    ];
    assert_eq!(mesh.triangles().len(), 2);
    for (triangle, expected) in mesh.triangles().iter().zip(expected) {
        for (&corner, point) in triangle.iter().zip(expected) {
            let found = mesh.positions()[corner as usize];
            assert!(found.iter().zip(point).all(|(a, b)| (a - b).abs() < 1e-5), "{found:?} {point:?}");
        }
    }
    // A file may draw a mesh many times, but not without end.
    let (mut root, binary) = gltf(&shapes::icosphere(7).unwrap());
    let many: Vec<_> = (0..50).map(|_| json!({ "mesh": 0 })).collect();
    root["nodes"] = json!(many);
    root.as_object_mut().unwrap().remove("scenes");
    assert_refused(read(&folder, "mesh.glb", &glb(&root, &binary)), &["repeated meshes"]);
}

#[test]
fn normals_stay_with_their_corners() {
    let folder = tempfile::tempdir().unwrap();
    let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float nx\nproperty float x\nproperty float y\n\
        property float z\nproperty float ny\nproperty float nz\nelement face 2\nproperty list uchar int vertex_indices\n\
        end_header\n0 0 0 0 0 1\n0 1 0 0 1 0\n2 0 1 0 0 0\nnan 1 1 0 0 1\n3 0 1 2\n3 2 1 3\n";
    let loaded = read(&folder, "mesh.ply", text.as_bytes()).unwrap();
    let [z, y, x] = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [2.0, 0.0, 0.0]];
    assert_eq!(loaded.normals[0], [z, y, x]);
    // One that is not finite is left to the triangles.
    assert_eq!(loaded.normals[1..], [[x, y, [0.0; 3]]]);
    assert_note(&loaded, "not finite");

    // Positions serve as normals; a node that scales by 2 along x halves theirs.
    let mesh = torus(5, 4);
    let (mut root, binary) = gltf(&mesh);
    let attributes = &mut root["meshes"][0]["primitives"][0]["attributes"];
    attributes["NORMAL"] = attributes["POSITION"].clone();
    root["nodes"] = json!([{ "mesh": 0, "scale": [2.0, 1.0, 1.0] }]);
    let loaded = read(&folder, "mesh.glb", &glb(&root, &binary)).unwrap();
    assert_eq!((loaded.normals.len(), loaded.notes.len()), (mesh.triangles().len(), 0));
    for (normals, triangle) in loaded.normals.iter().zip(loaded.mesh.triangles()) {
        for (normal, &corner) in normals.iter().zip(triangle) {
            let [x, y, z] = loaded.mesh.positions()[corner as usize];
            assert_eq!(*normal, [x / 4.0, y, z]);
        }
    }
    // However often they are drawn.
    root["nodes"] = json!(vec![json!({ "mesh": 0 }); 200]);
    let loaded = read(&folder, "mesh.glb", &glb(&root, &binary)).unwrap();
    assert_eq!((loaded.normals.len(), loaded.notes.len()), (200 * mesh.triangles().len(), 0));
}

#[test]
fn colours_of_bytes_and_of_faces_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let head = "ply\rformat ascii 1.0\rcomment \u{e9}\relement vertex 4\r";
    let head = head.replace('\r', "\n");
    let points = "0 0 0 255 0 51\n1 0 0 0 0 0\n1 1 0 0 0 0\n0 1 0 0 0 0\n";
    let xyz = "property float x\nproperty double y\nproperty float z\n";
    let rgb = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    let faces = "element face 3\nproperty list uchar uint vertex_index\nend_header\n";
    let text = format!("{head}{xyz}{rgb}{faces}{points}4 0 1 2 3\n2 0 1\n3 0 1 2");
    let loaded = read(&folder, "mesh.ply", text.as_bytes()).unwrap();
    assert_eq!(loaded.mesh.triangles(), [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
    assert_note(&loaded, "fewer than three corners");
    let Appearance::VertexColors(colors) = loaded.mesh.appearance() else { panic!("{loaded:?}") };
    assert_eq!(colors[0], [1.0, 0.0, 0.2]);
    // As the bytes of pictures are read.
    let options = LoadOptions { srgb: true, ..RAW };
    let linear = load(folder.path().join("mesh.ply"), &options).unwrap();
    let Appearance::VertexColors(colors) = linear.mesh.appearance() else { panic!("{linear:?}") };
    assert!((colors[0][2] - 0.033_104_77).abs() < 1e-6);
    let strict = LoadOptions { strict: true, ..RAW };
    assert_refused(load(folder.path().join("mesh.ply"), &strict), &["fewer than three"]);
    let face_colors = "element face 1\nproperty list uchar uint vertex_index\n".to_owned() + rgb + "end_header\n";
    let text = format!("{head}{xyz}{face_colors}0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 0 255 0");
    let mesh = read(&folder, "mesh.ply", text.as_bytes()).unwrap().mesh;
    assert_eq!(mesh.appearance(), &Appearance::Surface { resolution: 1, texels: vec![[0.0, 1.0, 0.0]] });
}

#[test]
fn materials_of_gltf_tint_their_textures_and_repeat_them() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = textured();
    let Appearance::Textured { textures, .. } = mesh.appearance() else { panic!() };
    let (mut root, binary) = gltf(&mesh);
    fs::write(folder.path().join("a texture.png"), png(&textures[0])).unwrap();
    root["images"] = json!([{ "uri": "a%20texture.png" }]);
    root["textures"] = json!([{ "source": 0, "sampler": 0 }]);
    root["samplers"] = json!([{ "wrapS": 33071, "wrapT": 33071 }]);
    root["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = json!([0.5, 1.0, 1.0, 1.0]);
    let loaded = read(&folder, "mesh.glb", &glb(&root, &binary)).unwrap();
    assert_eq!(loaded.files.len(), 2);
    let Appearance::Textured { textures: found, .. } = loaded.mesh.appearance() else { panic!("{loaded:?}") };
    assert_eq!(found[0].wrap(), Wrap::Clamp);
    assert_eq!(found[0].texels()[3], [textures[0].texels()[3][0] * 0.5, textures[0].texels()[3][1], 1.0]);
    // A file of the same name in the folder replaces one outside. If there is none, or it is no picture, nothing is drawn.
    for (uri, note) in [("../a texture.png", "in its place"), ("/etc/hostname", "outside"), ("mesh.glb", "texture 0")] {
        root["images"] = json!([{ "uri": uri }]);
        assert_note(&read(&folder, "mesh.glb", &glb(&root, &binary)).unwrap(), note);
    }
}

/// The texture's alpha counts where the material says so, and the base colour's own is the triangles'.
#[test]
fn materials_of_gltf_mask_or_blend() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = textured();
    let Appearance::Textured { uvs, uv_triangles, textures, .. } = mesh.appearance().clone() else { panic!() };
    let alpha: Vec<f32> = (0..textures[0].texels().len()).map(|i| (i % 4) as f32 / 5.0).collect();
    let textures = vec![textures[0].clone().with_alpha(alpha.clone()).unwrap()];
    let faded = Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle: vec![] };
    let (mut root, binary) = gltf(&mesh.clone().with_appearance(faded).unwrap());
    let mut read_as = |mode: &str| {
        root["materials"][0]["alphaMode"] = json!(mode);
        root["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = json!([1.0, 1.0, 1.0, 0.5]);
        root["materials"][0]["alphaCutoff"] = json!(0.15);
        let loaded = read(&folder, "mesh.glb", &glb(&root, &binary)).unwrap();
        assert_eq!(loaded.notes, [""; 0], "{mode}");
        let Appearance::Textured { textures, .. } = loaded.mesh.appearance() else { panic!("{loaded:?}") };
        (textures[0].alpha().map(<[f32]>::to_vec), loaded.opacity)
    };
    assert_eq!(read_as("OPAQUE"), (None, vec![]));
    // 0.15 of the product with 0.5.
    let masked = alpha.iter().map(|a| if *a >= 0.3 { 1.0 } else { 0.0 }).collect();
    assert_eq!(read_as("MASK"), (Some(masked), vec![]));
    assert_eq!(read_as("BLEND"), (Some(alpha), vec![0.5; mesh.triangles().len()]));
}

#[test]
fn malformed_files_say_what_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let torus = torus(4, 3);
    let binary = stl(&torus);
    assert_refused(read(&folder, "a.stl", &binary[..binary.len() - 60]), &["cut off", "24 triangles", "holds 22"]);
    assert_refused(
        read(&folder, "a.stl", b"solid x\nfacet normal 0 0 1\nvertex 0 0 one\n"),
        &["cut off within a facet"],
    );
    assert_refused(read(&folder, "a.stl", b"solid x\nendsolid x\n"), &["no faces"]);
    assert_refused(read(&folder, "a.stl", b""), &["empty"]);
    assert_refused(read(&folder, "a.stl", b"STL"), &["neither"]);
    assert_note(&read(&folder, "a.stl", &[&binary[..], b"more"].concat()).unwrap(), "4 bytes after");
    let text = String::from_utf8(ply(&torus, Ply::Text, None)).unwrap();
    assert_refused(read(&folder, "a.ply", &text.as_bytes()[..300]), &["cut off", "download"]);
    assert_refused(read(&folder, "a.ply", &text.as_bytes()[..100]), &["end_header"]);
    let huge = text.replace("element vertex 12", "element vertex 99999999999999");
    assert_refused(read(&folder, "a.ply", huge.as_bytes()), &["cut off", "99999999999999"]);
    assert_refused(read(&folder, "a.ply", text.replace("float x", "float w").as_bytes()), &["no x, y and z"]);
    let cloud = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n";
    assert_refused(read(&folder, "a.ply", cloud.as_bytes()), &["no faces (1 vertices): its points are not drawn"]);
    let empty = cloud.replace("vertex 1", "vertex 0").replace("1 2 3", "");
    assert_refused(read(&folder, "a.ply", empty.as_bytes()), &["no faces and no vertices"]);
    let empty_rows = cloud.replace("end_header", "element none 9999999999999999\nend_header");
    assert_refused(read(&folder, "a.ply", empty_rows.as_bytes()), &["no faces"]);
    let (root, binary) = gltf(&torus);
    let cases: &[(&str, serde_json::Value, &[&str])] = &[
        ("/accessors/0/count", json!(1u64 << 40), &["accessor 0", "more than its view"]),
        ("/accessors/0/bufferView", json!(99), &["view 99"]),
        ("/accessors/0/type", json!("SCALAR"), &["1 components"]),
        ("/bufferViews/0/byteOffset", json!(u64::MAX), &["view 0 ends"]),
        ("/bufferViews/0/buffer", json!(5), &["buffer 5"]),
        ("/meshes/0/primitives/0/attributes/POSITION", json!(7), &["accessor 7"]),
        ("/meshes/0/primitives/0/material", json!(7), &["material 7"]),
        ("/nodes/0/mesh", json!(3), &["mesh 3 but there are 1"]),
        ("/accessors/1/componentType", json!(5126), &["unsigned whole"]),
        ("/nodes/0/mesh", json!("a"), &["malformed glTF"]),
        ("/nodes", json!({ "a": {} }), &["version 1.0", "gltf-pipeline"]),
        ("/asset/version", json!(1), &["version 1.0", "gltf-pipeline"]),
        ("/nodes", json!([]), &["no faces and no vertices"]),
    ];
    for (place, value, words) in cases {
        let mut root = root.clone();
        *root.pointer_mut(place).unwrap_or_else(|| panic!("{place}")) = value.clone();
        assert_refused(read(&folder, "a.glb", &glb(&root, &binary)), words);
    }
    let whole = glb(&root, &binary);
    assert_refused(read(&folder, "a.glb", &whole[..whole.len() - 5]), &["cut off"]);
    assert_refused(read(&folder, "a.glb", &whole[..10]), &["without JSON"]);
    assert_refused(read(&folder, "a.gltf", b"{"), &["malformed glTF"]);
}

/// One bad number loses the triangles that need it, in each format.
#[test]
fn what_is_wrong_in_a_file_is_left_out_alone() {
    let folder = tempfile::tempdir().unwrap();
    let torus = torus(4, 3);
    let text = String::from_utf8(ply(&torus, Ply::Text, None)).unwrap();
    let facets = String::from_utf8(stl_text(&torus)).unwrap();
    let (mut root, binary) = gltf(&torus);
    let with = |from: &str, to: &str| facets.replacen(from, to, 1).into_bytes();
    root["accessors"][0]["count"] = json!(root["accessors"][0]["count"].as_u64().unwrap() - 1);
    let whole = torus.triangles().len();
    let last = torus.triangles().iter().filter(|t| t.contains(&(torus.positions().len() as u32 - 1))).count();
    let cases = [
        ("a.ply", text.replacen(" 7 3 0 ", " 7 3 12 ", 1).into_bytes(), "no vertices of the file", whole - 1),
        ("a.ply", text.replacen(" 7 3 0 ", " 7 3 -1 ", 1).into_bytes(), "no vertices of the file", whole - 1),
        ("a.ply", text.replacen(" 7 3 0 ", " 7 3 zero ", 1).into_bytes(), "words are not numbers", whole - 1),
        ("a.stl", with("VERTEX ", "VERTEX x"), "not three numbers", whole - 1),
        ("a.stl", with("VERTEX ", "vertex 1 2 3\nVERTEX "), "other than three vertices", whole - 1),
        ("a.stl", with("endloop", "endloop here"), "words that STL does not have", whole),
        ("a.glb", glb(&root, &binary), "no vertices of the file", whole - last),
    ];
    for (name, bytes, note, count) in cases {
        let loaded = read(&folder, name, &bytes).unwrap();
        assert_note(&loaded, note);
        assert_eq!(loaded.mesh.triangles().len(), count, "{name}: {note}");
    }
}

#[test]
fn mutated_files_are_read_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (torus, mesh) = (torus(5, 4), textured());
    let (root, binary) = gltf(&torus);
    let (with_image, its_binary) = gltf(&mesh);
    let files = [
        ("a.ply", ply(&torus, Ply::Text, None)),
        ("b.ply", ply(&torus, Ply::Little, Some("none.png"))),
        ("a.stl", stl(&torus)),
        ("b.stl", stl_text(&torus)),
        ("a.glb", glb(&root, &binary)),
        ("b.glb", glb(&with_image, &its_binary)),
        ("a.gltf", embedded(root, &binary)),
    ];
    let files = files.map(|(name, bytes)| (name.to_string(), bytes));
    // Each is a mesh by itself, of some 60 bytes for each of its file.
    mutated(folder.path(), &files, &[0, 1, 2, 3, 4, 5, 6], None, 60);
}
