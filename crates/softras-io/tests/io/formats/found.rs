//! Small copies of parts of strangers' files: each was drawn wrong without a note, or refused although it is valid.

use super::*;
use crate::formats::write::little;
use serde_json::Value;

const V: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
const PNG: [[u8; 3]; 2] = [[255, 0, 0], [0, 0, 255]];

/// A picture of one pixel.
fn pixel(color: [u8; 3]) -> Vec<u8> {
    png(&Texture::new(1, 1, vec![color.map(|x| f32::from(x) / 255.0)], Wrap::Repeat).unwrap())
}

/// Reads an OBJ file with its materials, and a red picture beside them.
fn obj(text: &str, mtl: &str) -> softras::Result<Loaded> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("m.mtl"), mtl).unwrap();
    fs::write(folder.path().join("t.png"), pixel(PNG[0])).unwrap();
    read(&folder, "a.obj", text.as_bytes())
}

fn ply_text(head: &str, body: &str) -> softras::Result<Loaded> {
    let folder = tempfile::tempdir().unwrap();
    PNG.iter().zip(["a.png", "b.png"]).for_each(|(c, name)| fs::write(folder.path().join(name), pixel(*c)).unwrap());
    read(&folder, "a.ply", format!("ply\nformat ascii 1.0\n{head}end_header\n{body}").as_bytes())
}

/// A glTF file of a triangle with UVs, normals and a colour at each corner, changed.
fn changed(change: impl FnOnce(&mut Value)) -> softras::Result<Loaded> {
    let mut binary = Vec::new();
    let mut add = |values: &[f32]| {
        let start = binary.len();
        binary.extend(little(values.iter().copied()));
        json!({ "buffer": 0, "byteOffset": start, "byteLength": binary.len() - start })
    };
    let views = [
        add(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
        add(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]),
        add(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        add(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]),
    ];
    let accessor = |view: usize, kind: &str, count: usize| json!({ "bufferView": view, "componentType": 5126, "type": kind, "count": count });
    let image = pixel(PNG[0]);
    let mut root = json!({
        "asset": { "version": "2.0" },
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0, "TEXCOORD_0": 1, "NORMAL": 3 }, "material": 0 }] }],
        "materials": [{ "name": "m" }],
        "accessors": [accessor(0, "VEC3", 3), accessor(1, "VEC2", 3), accessor(2, "VEC3", 3), accessor(3, "VEC3", 3)],
        "bufferViews": views,
        "images": [{ "bufferView": 4 }],
        "textures": [{ "source": 0 }],
    });
    let place = json!({ "buffer": 0, "byteOffset": binary.len(), "byteLength": image.len() });
    root["bufferViews"].as_array_mut().unwrap().push(place);
    binary.extend(&image);
    root["buffers"] = json!([{ "byteLength": binary.len() }]);
    change(&mut root);
    read(&tempfile::tempdir().unwrap(), "a.glb", &glb(&root, &binary))
}

fn primitive(root: &mut Value) -> &mut Value {
    &mut root["meshes"][0]["primitives"][0]
}

fn textured_by(root: &mut Value) {
    root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": 0 });
}

fn colors(loaded: &Loaded) -> Vec<[f32; 3]> {
    match loaded.mesh.appearance() {
        Appearance::Uniform(color) => vec![*color],
        Appearance::VertexColors(colors) => colors.clone(),
        Appearance::Surface { texels, .. } => texels.clone(),
        Appearance::Textured { textures, .. } => {
            textures.iter().flat_map(|texture| texture.texels().to_vec()).collect()
        }
    }
}

/// The colour that a textured mesh shows at each corner of a triangle, at the nearest texel.
fn at_corners(loaded: &Loaded, t: usize) -> [[f32; 3]; 3] {
    let Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle } = loaded.mesh.appearance() else {
        panic!("{loaded:?}")
    };
    let texture = &textures[texture_of_triangle.get(t).copied().unwrap_or_default() as usize];
    uv_triangles[t].map(|uv| {
        let [u, v] = uvs[uv as usize];
        let at = |x: f32, side: u32| ((x * side as f32).floor() as i64).rem_euclid(side.into()) as usize;
        texture.texels()[at(1.0 - v, texture.height()) * texture.width() as usize + at(u, texture.width())]
    })
}

const RGB: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

#[test]
fn a_mesh_far_from_0_keeps_its_shape() {
    let far = [500_000.0, 4_649_776.0, -3e6];
    let ball = shapes::icosphere(2).unwrap();
    let text = |to: &dyn Fn(f64, usize) -> f64| -> String {
        let line = |p: &[f32; 3]| format!("v {} {} {}\n", to(p[0].into(), 0), to(p[1].into(), 1), to(p[2].into(), 2));
        let face = |t: &[u32; 3]| format!("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
        ball.positions().iter().map(line).chain(ball.triangles().iter().map(face)).collect()
    };
    let loaded = obj(&text(&|x, k| x + far[k]), "").unwrap();
    assert_eq!((loaded.notes.len(), loaded.origin.map(f64::round)), (0, far));
    for (p, q) in loaded.mesh.positions().iter().zip(ball.positions()) {
        assert!(
            (0..3).all(|k| (f64::from(p[k]) + loaded.origin[k] - far[k] - f64::from(q[k])).abs() < 1e-7),
            "{p:?} {q:?}"
        );
    }
    // In 32 bits it is coarse, which is said; so is a file whose numbers are.
    let placed = loaded.at_place().unwrap();
    assert_note(&placed, "steps of 0.5");
    assert_eq!(placed.origin, [0.0; 3]);
    assert_note(&obj(&text(&|x, k| f64::from((x + far[k]) as f32)), "").unwrap(), "steps of 0.5");
    assert_eq!(obj(&text(&|x, k| x + far[k] * 1e-6), "").unwrap().origin, [0.0; 3]);
    let node = changed(|root| root["nodes"][0]["translation"] = json!([4076138.0, -619000.25, 4853850.0])).unwrap();
    let mut found = node.mesh.positions().to_vec();
    found.sort_by(|a, b| a.partial_cmp(b).unwrap());
    let sides = [[0, 1, 0], [1, 0, 0]].map(|d: [i32; 3]| [0, 1, 2].map(|k| d[k] as f32));
    let from = |p: [f32; 3]| [0, 1, 2].map(|k| p[k] - found[0][k]);
    assert_eq!([from(found[1]), from(found[2])], sides);
}

/// A sphere of 64-bit numbers, 1e7 units away and nearer.
#[test]
fn a_sphere_at_any_place_has_the_silhouette_of_that_at_0() {
    let folder = tempfile::tempdir().unwrap();
    let mut renderer = renderer();
    let ball = shapes::icosphere(2).unwrap().with_appearance(Appearance::Uniform([1.0; 3])).unwrap();
    let mut seen = |mesh: &Mesh| {
        let camera = Camera::from_angles(4.0, 25.0, 40.0, Projection::Perspective { fov_y: 0.6 }).unwrap();
        let settings = Settings { width: 256, height: 256, ..Settings::default() };
        let frame = renderer.render(&Scene::new(mesh.clone()), &[camera], &settings).unwrap();
        frame.silhouette().unwrap().data.iter().map(|alpha| *alpha > 0.5).collect::<Vec<_>>()
    };
    let expected = seen(&ball);
    for origin in [[1e3, -20.0, 7.0], [500_000.0, 4_649_776.0, -3e6], [-1e7, 1e7, 1e7], [0.125, 1e7, -3.3]] {
        let at = |vertex: u32| {
            let place = [0, 1, 2].map(|k| f64::from(ball.positions()[vertex as usize][k]) + origin[k]);
            format!("vertex {} {} {}\n", place[0], place[1], place[2])
        };
        let facet = |corners: &[u32; 3]| {
            format!("facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n", corners.map(at).concat())
        };
        let facets: String = ball.triangles().iter().map(facet).collect();
        fs::write(folder.path().join("a.stl"), format!("solid a\n{facets}endsolid a\n")).unwrap();
        for name in ["a.obj", "a.ply", "a.glb", "a.stl"] {
            let path = folder.path().join(name);
            if name != "a.stl" {
                let options = softras_io::SaveOptions { origin, ..Default::default() };
                softras_io::save_with(&ball, &path, &options).unwrap();
            }
            let loaded = load(&path, &RAW).unwrap().relative_to(origin).unwrap();
            assert_eq!(loaded.notes, [""; 0], "{name} at {origin:?}");
            assert!(seen(&loaded.mesh) == expected, "{name} at {origin:?}");
        }
    }
}

#[test]
fn statements_of_obj_are_read_as_others_read_them() {
    let kept = obj("v 0 0 0\nv 1 0 0\nv 0 1 0\n# C:\\models\\\nf 1 2 3\nf 3 2 1 # C:\\\nf 2 1 3\n", "").unwrap();
    assert_eq!((kept.mesh.triangles().len(), kept.notes.len()), (3, 0));
    let mtl = "newmtl red # first\nKd 1 0 0\nnewmtl green\nKd 0 1 0\n";
    let named = obj(&format!("mtllib m.mtl # materials\n{V}usemtl red # the red one\nf 1 2 3\n"), mtl).unwrap();
    assert_eq!((colors(&named), named.notes.len()), (vec![RGB[0]], 0));
    assert_note(&obj(&format!("{V}f 1/1 2/2 3/3\n"), "").unwrap(), "left out");
    let only = obj(&format!("mtllib m.mtl\n{V}f 1 2 3\n"), "newmtl a\nKd 1 0 0\n").unwrap();
    assert_eq!(colors(&only), [RGB[0]]);
    assert_note(&only, "usemtl");
    assert_note(&obj(&format!("mtllib m.mtl\n{V}f 1 2 3\n"), mtl).unwrap(), "white");
    // Seven numbers: with an alpha behind, or with w before.
    for text in [
        "v 0 0 0 1 0 0 1\nv 1 0 0 0 1 0 1\nv 0 1 0 0 0 1 1\nf 1 2 3\n",
        "v 0 0 0 1 1 0 0\nv 1 0 0 1 0 1 0\nv 0 1 0 1 0 0 1\nf 1 2 3\n",
    ] {
        let loaded = obj(text, "").unwrap();
        assert_eq!((colors(&loaded), loaded.notes.len()), (RGB.to_vec(), 0), "{text}");
    }
    assert_note(&obj("v 0 0 0 1\nv 1 0 0 1 0 0\nv 0 1 0 0 1 0\nf 1 2 3\n", "").unwrap(), "white");
    let placed = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 1 2\nusemtl a\nf 1/1 2/1 3/1\n";
    let placed = obj(placed, "newmtl a\nmap_Kd -s 2 3 1 -o 0.5 0.25 t.png\n").unwrap();
    let Appearance::Textured { uvs, uv_triangles, .. } = placed.mesh.appearance() else { panic!("{placed:?}") };
    assert_eq!((uvs[uv_triangles[0][0] as usize], placed.notes.len()), ([2.5, 6.25], 0));
    let unused = obj(&format!("{V}vt 0 0\nf 1/1 2/1 3/1\n"), "").unwrap();
    assert_eq!(unused.notes, [""; 0]);
}

#[test]
fn vertex_colours_of_obj_are_as_bright_as_those_of_ply() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    let list = "property list uchar int vertex_indices";
    let head = ["x", "y", "z", "red", "green", "blue"].map(|name| format!("property float {name}\n")).concat();
    let head = format!("ply\nformat ascii 1.0\nelement vertex 3\n{head}element face 1\n{list}\nend_header\n");
    let body = ["0 0 0 .5 .5 .5\n", "1 0 0 .5 .5 .5\n", "0 1 0 .5 .5 .5\n"];
    let loaded =
        [head + &body.concat() + "3 0 1 2\n", body.map(|row| format!("v {row}")).concat() + "f 1 2 3\n"].map(|text| {
            fs::write(&path, text).unwrap();
            softras_io::load_with(&path, &softras_io::LoadOptions::default()).unwrap()
        });
    assert!(loaded.iter().all(|found| (colors(found)[0][0] - 0.214_041).abs() < 1e-5), "{loaded:?}");
    softras_io::save(&loaded[1].mesh, &path).unwrap();
    assert!(fs::read_to_string(&path).unwrap().contains(" 0.5 0.5 0.5"));
}

#[test]
fn tr_1_of_all_materials_is_opaque() {
    let text = format!("mtllib m.mtl\n{V}usemtl a\nf 1 2 3\n");
    let opacity = |mtl: &str| {
        let loaded = obj(&text, mtl).unwrap();
        (loaded.opacity, loaded.notes.join(" "))
    };
    let (opaque, notes) = opacity("newmtl a\nKd 1 0 0\nTr 1.0\n");
    assert!(opaque.is_empty() && notes.contains("MeshLab"), "{notes}");
    assert_eq!(opacity("# Converted by Meshlab Group\nnewmtl a\nKd 1 0 0\nTr 1.000000\n"), (vec![], String::new()));
    let (clear, notes) = opacity("newmtl a\nKd 1 0 0\nd 0.0\n");
    assert!(clear == [0.0] && notes.contains("wholly transparent"), "{notes}");
    let (half, _) = opacity("newmtl a\nKd 1 0 0\nTr 1\nnewmtl b\nTr 0\n");
    assert_eq!(half, [0.0]);
}

#[test]
fn vertex_colours_stay_beside_textures() {
    let loaded = changed(|root| {
        textured_by(root);
        let mut second = primitive(root).clone();
        second["attributes"]["COLOR_0"] = json!(2);
        second["material"] = json!(1);
        root["materials"] = json!([root["materials"][0], {}]);
        root["meshes"][0]["primitives"] = json!([root["meshes"][0]["primitives"][0], second]);
    })
    .unwrap();
    assert_eq!((at_corners(&loaded, 0), at_corners(&loaded, 1)), ([RGB[0]; 3], RGB));
    assert!(loaded.notes.len() == 1 && loaded.notes[0].contains("on others of another colour"), "{:?}", loaded.notes);
    // A primitive that has both shows their product: here the texture is red.
    let product = changed(|root| {
        textured_by(root);
        primitive(root)["attributes"]["COLOR_0"] = json!(2);
    })
    .unwrap();
    assert_eq!(at_corners(&product, 0), [RGB[0], [0.0; 3], [0.0; 3]]);
    assert_note(&product, "times a texture");
    let bare = format!(
        "mtllib m.mtl\n{}vt 0 0\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1 2 3\n",
        "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\n"
    );
    let bare = obj(&bare, "newmtl a\nmap_Kd t.png\nnewmtl b\nKd 1 1 1\n").unwrap();
    assert_eq!((at_corners(&bare, 0), at_corners(&bare, 1)), ([RGB[0]; 3], RGB));
}

#[test]
fn materials_of_gltf_are_drawn_or_noted() {
    let with = |material: Value| changed(|root| root["materials"][0] = material).unwrap();
    let black = json!({ "baseColorFactor": [0, 0, 0, 1] });
    let emissive = with(json!({ "pbrMetallicRoughness": black, "emissiveFactor": [0, 1, 0] }));
    assert_eq!(colors(&emissive), [RGB[1]]);
    assert_note(&emissive, "emitted light");
    let map = json!({ "index": 0 });
    let lamp = with(json!({ "pbrMetallicRoughness": black, "emissiveFactor": [1, 1, 1], "emissiveTexture": map }));
    assert_eq!(colors(&lamp), [RGB[0]]);
    let unlit = with(json!({ "extensions": { "KHR_materials_unlit": {} } }));
    assert!(unlit.unlit && unlit.notes.is_empty());
    let double = |value: Value| with(json!({ "doubleSided": value })).single_sided;
    assert_eq!(
        [unlit.single_sided.clone(), double(json!(false)), double(json!(true))],
        [vec![true], vec![true], vec![]]
    );
    let glossy = json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": { "diffuseTexture": map } } });
    assert_eq!(colors(&with(glossy)), [RGB[0]]);
    let masked = json!({ "alphaMode": "MASK", "pbrMetallicRoughness": { "baseColorFactor": [1, 0, 0, 0.2] } });
    let masked = with(masked);
    assert_eq!(masked.opacity, [0.0]);
    assert_note(&masked, "wholly transparent");
    // A texture without an alpha of its own leaves the base colour's below the cutoff.
    let covered = json!({ "baseColorFactor": [1, 1, 1, 0.2], "baseColorTexture": map });
    assert_eq!(with(json!({ "alphaMode": "MASK", "pbrMetallicRoughness": covered })).opacity, [0.0]);
    assert_note(&with(json!({ "normalTexture": { "index": 0 } })), "materials[0].normalTexture: normal maps");
    let wood = with(json!({ "name": "wood", "normalTexture": { "index": 0 } }));
    assert_note(&wood, "materials[0] \"wood\".normalTexture: normal maps");
    assert_eq!(wood.materials, ["wood"]);
    // A name is no longer than a line of a note.
    let long = with(json!({ "name": "wood".repeat(1000), "normalTexture": { "index": 0 }, "alphaMode": "MASK",
                            "pbrMetallicRoughness": { "baseColorFactor": [1, 0, 0, 0.2] } }));
    assert!(long.notes.len() > 1 && long.notes.iter().all(|note| note.len() < 400), "{:?}", long.notes);
    assert_note(&with(json!({ "extensions": { "X_new": {} } })), "extension X_new");
    assert_note(&with(json!({ "wobble": 3 })), "materials[0].wobble");
}

#[test]
fn edges_of_textures_are_mirrored_or_mixed() {
    let with = |sampler: Value, image: usize| {
        changed(|root| {
            textured_by(root);
            root["samplers"] = json!([sampler]);
            root["textures"] = json!([{ "source": image, "sampler": 0 }]);
        })
        .unwrap()
    };
    let size = |loaded: &Loaded| {
        let Appearance::Textured { textures, .. } = loaded.mesh.appearance() else { panic!("{loaded:?}") };
        (textures[0].width(), textures[0].height(), textures[0].wrap())
    };
    let mirrored = with(json!({ "wrapS": 33648, "wrapT": 33648 }), 0);
    assert_eq!((size(&mirrored), mirrored.notes.len()), ((2, 2, Wrap::Repeat), 0));
    let mixed = with(json!({ "wrapS": 33071, "wrapT": 10497 }), 0);
    assert_eq!((size(&mixed), mixed.notes.len()), ((3, 1, Wrap::Repeat), 0));
    assert_eq!(at_corners(&mixed, 0), [RGB[0]; 3]);
    // A piece whose UVs reach farther has texels of its own.
    let farther = changed(|root| {
        textured_by(root);
        let mut material = root["materials"][0].clone();
        material["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] =
            json!({ "KHR_texture_transform": { "scale": [1.5, 1.0] } });
        root["materials"].as_array_mut().unwrap().push(material);
        let mut second = primitive(root).clone();
        second["material"] = json!(1);
        root["meshes"][0]["primitives"].as_array_mut().unwrap().push(second);
        root["samplers"] = json!([{ "wrapS": 33071, "wrapT": 10497 }]);
        root["textures"] = json!([{ "source": 0, "sampler": 0 }]);
    });
    let farther = farther.unwrap();
    let Appearance::Textured { textures, .. } = farther.mesh.appearance() else { panic!("{farther:?}") };
    assert_eq!(textures.iter().map(|texture| texture.width()).collect::<Vec<_>>(), [3, 4]);
    assert_note(&with(json!({ "magFilter": 9728 }), 0), "nearest");
    let none = changed(|root| {
        textured_by(root);
        root["textures"] = json!([{ "extensions": { "KHR_texture_basisu": { "source": 0 } } }]);
    });
    assert_note(&none.unwrap(), "KTX2 image that is not read");
    let webp = changed(|root| {
        textured_by(root);
        root["textures"] = json!([{ "extensions": { "EXT_texture_webp": { "source": 0 } } }]);
        root["extensionsRequired"] = json!(["EXT_texture_webp"]);
    });
    assert_eq!(colors(&webp.unwrap()), [RGB[0]]);
}

#[test]
fn valid_gltf_is_not_refused() {
    let count = |loaded: softras::Result<Loaded>| loaded.unwrap().mesh.triangles().len();
    let flat = changed(|root| root["nodes"][0]["scale"] = json!([1, 1, 0])).unwrap();
    assert!(flat.normals[0].iter().flatten().all(|x| x.is_finite()));
    for extras in [json!(3), json!("x"), json!([1]), Value::Null] {
        assert_eq!(count(changed(|root| primitive(root)["extras"] = extras)), 1);
    }
    assert_eq!(count(changed(|root| root["accessors"][0]["count"] = json!(3.0))), 1);
    assert_eq!(count(changed(|root| root["animations"] = json!([{ "channels": [{ "sampler": 0, "target": 7 }] }]))), 1);
    let harmless =
        ["EXT_mesh_features", "KHR_animation_pointer", "KHR_materials_dispersion", "KHR_xmp_json_ld", "CESIUM_RTC"];
    assert_eq!(count(changed(|root| root["extensionsRequired"] = json!(harmless))), 1);
    let packed = changed(|root| root["extensionsRequired"] = json!(["KHR_meshopt_compression"]));
    assert_refused(packed, &["KHR_meshopt", "gltf-transform"]);
    assert_eq!(
        count(changed(|root| root["nodes"] =
            json!([{ "children": [1, 2] }, { "children": [3] }, { "children": [3] }, { "mesh": 0 }]))),
        2
    );
    let cycle = changed(|root| root["nodes"] = json!([{ "mesh": 0, "children": [0] }])).unwrap();
    assert_note(&cycle, "descendant");
    let empty = changed(|root| root["scenes"] = json!([{ "name": "none" }]));
    assert_refused(empty, &["no faces"]);
    let zeros = changed(|root| {
        root["accessors"][3] = json!({ "componentType": 5126, "type": "VEC3", "count": 3 });
    });
    assert_eq!(zeros.unwrap().normals, [[[0.0; 3]; 3]]);
    let old = read(&tempfile::tempdir().unwrap(), "a.gltf", br#"{ "asset": { "version": "1.0" }, "meshes": {} }"#);
    assert_refused(old, &["version 1.0", "2.0"]);
}

#[test]
fn accessors_may_be_sparse_and_meshes_bent() {
    let corner = |loaded: softras::Result<Loaded>| loaded.unwrap().mesh.positions().to_vec();
    let sparse = changed(|root| {
        let values = json!({ "bufferView": 0, "byteOffset": 12 });
        root["accessors"][0]["sparse"] =
            json!({ "count": 1, "indices": { "bufferView": 0, "componentType": 5125 }, "values": values });
    });
    // Vertex 0 becomes a copy of vertex 1.
    assert_eq!(corner(sparse), [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let morphed = changed(|root| {
        primitive(root)["targets"] = json!([{ "POSITION": 3 }]);
        root["meshes"][0]["weights"] = json!([2.0]);
    });
    assert!(corner(morphed).iter().all(|p| p[2] == 2.0));
    let instanced = changed(|root| {
        root["nodes"][0]["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 3 } } });
    });
    assert_eq!(instanced.unwrap().mesh.triangles().len(), 3);
}

#[test]
fn properties_of_ply_in_other_orders_and_types_are_read() {
    let xyz = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
    let list = "property list uchar int vertex_indices\n";
    let points = "0 0 0\n1 0 0\n0 1 0\n";
    let first = ply_text(&format!("element face 1\n{list}{xyz}"), &format!("3 0 1 2\n{points}")).unwrap();
    assert_eq!(first.mesh.triangles(), [[0, 1, 2]]);
    let strips = ply_text(
        &format!("{xyz}element tristrips 1\nproperty list int int vertex_indices\n"),
        &format!("{points}7 0 1 2 -1 2 1 0\n"),
    );
    assert_eq!(strips.unwrap().mesh.triangles(), [[0, 1, 2], [2, 1, 0]]);
    for kind in ["int", "uchar", "short", "float"] {
        let rgb: String = ["red", "green", "blue"].map(|name| format!("property {kind} {name}\n")).concat();
        let text = "0 0 0 255 0 0\n1 0 0 0 255 0\n0 1 0 0 0 255\n3 0 1 2\n";
        assert_eq!(colors(&ply_text(&format!("{xyz}{rgb}element face 1\n{list}"), text).unwrap()), RGB, "{kind}");
    }
    let two = format!(
        "comment TextureFile a.png\ncomment TextureFile b.png\n{xyz}element face 2\n{list}property list uchar float texcoord\nproperty int texnumber\n"
    );
    let two = ply_text(&two, &format!("{points}3 0 1 2 6 0 0 0 0 0 0 0\n3 0 2 1 6 0 0 0 0 0 0 1\n")).unwrap();
    assert_eq!((at_corners(&two, 0), at_corners(&two, 1)), ([RGB[0]; 3], [RGB[2]; 3]));
    assert_eq!(two.notes, [""; 0]);
}

#[test]
fn spellings_of_stl_are_read_with_their_colours() {
    let folder = tempfile::tempdir().unwrap();
    let facet = "facet normal nan nan nan\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
    let texts = [
        (format!("solid facet_plate v2\n{facet}endsolid facet_plate v2\n"), 1),
        (format!("solid p\n{facet}end solid p\n"), 1),
        (format!("# a vertex of a facet\n\n # by hand\nsolid p\n# vertex 1\n{facet}endsolid p\n"), 1),
        (format!("solid p\n{}endsolid p\n", facet.replace("endloop", "end loop")), 1),
        (format!("\u{feff}solid p\n{facet}endsolid\nsolid multifacet B\n{facet}endsolid multifacet B\n"), 2),
        (format!("solid a\n{facet}endsolid a\n").replace('\n', "\r"), 1),
    ];
    for (text, count) in texts {
        let loaded = read(&folder, "a.stl", text.as_bytes()).unwrap();
        assert_eq!((loaded.mesh.triangles().len(), loaded.notes.len()), (count, 0), "{text:?}");
    }
    let torus = torus(3, 3);
    let mut binary = stl(&torus);
    binary[84 + 48..][..2].copy_from_slice(&0xfc00u16.to_le_bytes());
    assert_eq!(colors(&read(&folder, "a.stl", &binary).unwrap())[..2], [RGB[0], [1.0; 3]]);
    binary[..10].copy_from_slice(b"COLOR=\x00\xff\x00\xff");
    binary[84 + 48..][..2].copy_from_slice(&0x7c00u16.to_le_bytes());
    binary[84 + 50 + 48..][..2].copy_from_slice(&0x8000u16.to_le_bytes());
    assert_eq!(colors(&read(&folder, "a.stl", &binary).unwrap())[..2], [RGB[2], RGB[1]]);
}

/// JPEG leaves traces of an edge beside it, which are not the object.
#[test]
fn silhouettes_of_jpeg_pictures_are_those_of_png() {
    let folder = tempfile::tempdir().unwrap();
    let image = image::RgbImage::from_fn(64, 64, |x, y| {
        let is_inside = (f64::from(x) - 31.5).hypot(f64::from(y) - 31.5) < 20.0;
        image::Rgb(if is_inside { [200, 120 + (x % 16) as u8 * 4, 60] } else { [0; 3] })
    });
    let covered = |name: &str| {
        let path = folder.path().join(name);
        image.save(&path).unwrap();
        let budget = softras_io::Budget::new(None);
        let (_, _, pixels, notes) = softras_io::read_picture(&path, &budget, 64).unwrap();
        assert_eq!(!notes.is_empty(), name.ends_with("jpg"));
        pixels.iter().map(|pixel| pixel[3] > 0.0).collect::<Vec<_>>()
    };
    let (png, jpeg) = (covered("a.png"), covered("a.jpg"));
    let both = |f: fn(bool, bool) -> bool| png.iter().zip(&jpeg).filter(|(a, b)| f(**a, **b)).count() as f64;
    let iou = both(|a, b| a && b) / both(|a, b| a || b);
    assert!(iou > 0.97, "{iou}");
}

/// A phone stores a picture as its sensor lay, and says how to turn it.
#[test]
fn pictures_are_turned_as_they_say() {
    use image::ImageEncoder;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.jpg");
    // Bright at the left; orientation 6: to be turned by a quarter clockwise, so that it is bright at the top.
    let is_inside = |x: u32, y: u32| (8..40).contains(&x) && (8..24).contains(&y);
    let value = |x: u32, y: u32| {
        if !is_inside(x, y) {
            0
        } else if x < 24 {
            250
        } else {
            100
        }
    };
    let image = image::RgbImage::from_fn(48, 32, |x, y| image::Rgb([value(x, y); 3]));
    let mut bytes = Vec::new();
    let mut encoder = image::codecs::jpeg::JpegEncoder::new(&mut bytes);
    let exif = [b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0".as_slice(), &[6, 0, 0, 0, 0, 0, 0, 0]].concat();
    encoder.set_exif_metadata(exif).unwrap();
    encoder.write_image(&image, 48, 32, image::ExtendedColorType::Rgb8).unwrap();
    std::fs::write(&path, bytes).unwrap();
    let (width, height, pixels, notes) = softras_io::read_picture(&path, &softras_io::Budget::new(None), 64).unwrap();
    assert_eq!((width, height), (32, 48));
    assert!(pixels[12 * 32 + 16][0] > 0.8 && pixels[36 * 32 + 16][3] == 1.0 && pixels[36 * 32 + 16][0] < 0.2);
    assert!(notes.iter().any(|note| note == "a.jpg: turned as its EXIF orientation says"), "{notes:?}");
}

/// nerfstudio names a mask for each picture, and a lens that bends.
#[test]
fn masks_and_lenses_of_transforms_are_followed() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    image::RgbImage::from_pixel(32, 32, image::Rgb([200; 3])).save(at("a.png")).unwrap();
    let disc = |x: u32, y: u32| (f64::from(x) - 15.5).hypot(f64::from(y) - 15.5) < 10.0;
    std::fs::create_dir(at("masks")).unwrap();
    image::GrayImage::from_fn(32, 32, |x, y| image::Luma([255 * u8::from(disc(x, y))]))
        .save(at("masks/a.png"))
        .unwrap();
    let read = |k1: f64, mask: &str| {
        let text = format!(
            r#"{{"fl_x": 30, "cx": 16, "cy": 16, "k1": {k1}, "frames": [{{"file_path": "a.png", "mask_path": "{mask}",
                "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]]}}]}}"#
        );
        std::fs::write(at("transforms.json"), text).unwrap();
        let (options, budget) = (softras_io::ViewsOptions::default(), softras_io::Budget::new(None));
        let (views, _, notes) = softras_io::Views::open_with(folder.path(), &options, &budget).unwrap();
        (views.silhouette.unwrap().data.iter().map(|x| f64::from(*x)).sum::<f64>(), notes)
    };
    let (straight, notes) = read(0.0, "masks/a.png");
    assert!((straight - 314.0).abs() < 4.0 && notes.is_empty(), "{straight}, {notes:?}");
    // The pinhole's disc of radius r is shown at r (1 + k1 (r / 30)²) = 10: r = 9.05 for k1 = 1.15.
    let (bent, notes) = read(1.15, "masks/a.png");
    assert!((bent - 257.0).abs() < 3.0 && notes == ["a.png: the lens distortion is removed"], "{bent}, {notes:?}");
    let (found, notes) = read(0.0, "masks/b.png");
    assert!(found == straight && notes.len() == 2 && notes[0] == "masks/b.png: mask not found", "{notes:?}");
}

/// A .glb file of a mesh that Draco packed, with the bytes of its data changed.
fn draco(mesh: &Mesh, change: impl FnOnce(&mut Vec<u8>)) -> softras::Result<Loaded> {
    use draco_core::{DataType, EncoderBuffer, EncoderOptions, FaceIndex, GeometryAttributeType, PointIndex};
    let mut packed = draco_core::Mesh::new();
    let mut position = draco_core::PointAttribute::new();
    position.init(GeometryAttributeType::Position, 3, DataType::Float32, false, mesh.positions().len());
    position.buffer_mut().write(0, &little(mesh.positions().as_flattened().iter().copied()));
    packed.add_attribute(position);
    packed.set_num_faces(mesh.triangles().len());
    let corners = |t: &[u32; 3]| t.map(PointIndex);
    mesh.triangles().iter().enumerate().for_each(|(i, t)| packed.set_face(FaceIndex(i as u32), corners(t)));
    let mut encoder = draco_core::MeshEncoder::new();
    encoder.set_mesh(packed);
    let mut out = EncoderBuffer::new();
    encoder.encode(&EncoderOptions::new(), &mut out).unwrap();
    let mut bytes = out.data().to_vec();
    change(&mut bytes);
    let extension = json!({ "bufferView": 0, "attributes": { "POSITION": 0 } });
    let accessor =
        |kind: &str, number: u32, count: usize| json!({ "componentType": number, "type": kind, "count": count });
    let root = json!({
        "asset": { "version": "2.0" }, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
        "extensionsRequired": ["KHR_draco_mesh_compression"],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1,
            "extensions": { "KHR_draco_mesh_compression": extension } }] }],
        "accessors": [accessor("VEC3", 5126, mesh.positions().len()), accessor("SCALAR", 5123, 3 * mesh.triangles().len())],
        "bufferViews": [{ "buffer": 0, "byteLength": bytes.len() }],
        "buffers": [{ "byteLength": bytes.len() }],
    });
    read(&tempfile::tempdir().unwrap(), "a.glb", &glb(&root, &bytes))
}

#[test]
fn draco_meshes_are_unpacked_and_broken_ones_refused() {
    let mesh = torus(12, 7);
    let loaded = draco(&mesh, |_| {}).unwrap();
    assert_eq!((loaded.mesh.triangles().len(), loaded.notes.len()), (mesh.triangles().len(), 0));
    // Draco keeps the triangles, each vertex within a step of its grid.
    let centers = |mesh: &Mesh| {
        let corner = |i: u32| mesh.positions()[i as usize];
        let mut all: Vec<[i32; 3]> = mesh
            .triangles()
            .iter()
            .map(|t| [0, 1, 2].map(|k| (t.iter().map(|i| corner(*i)[k]).sum::<f32>() / 3.0 * 200.0).round() as i32))
            .collect();
        all.sort_unstable();
        all
    };
    let (ours, theirs) = (centers(&loaded.mesh), centers(&mesh));
    let near = ours.iter().filter(|a| theirs.iter().any(|b| (0..3).all(|k| a[k].abs_diff(b[k]) <= 1))).count();
    assert_eq!(near, theirs.len());
    for seed in 0..200usize {
        let (outcome, peak) = crate::peak_of(|| {
            draco(&mesh, |bytes| {
                let at = seed * 7919 % bytes.len();
                bytes[at] ^= 1 << (seed % 8);
                if seed % 5 == 0 {
                    bytes.truncate(at);
                }
            })
        });
        assert!(peak < 64 << 20, "{seed} takes {peak} bytes: {:?}", outcome.err());
    }
}

/// KTX2 images of 8 by 8 pixels, red at the left and blue at the right, as Basis Universal's encoder writes them: UASTC in Zstandard,
/// and ETC1S.
const UASTC: &str = "\
    ab4b5458203230bb0d0a1a0a000000000100000008000000080000000000000000000000010000000100000002000000680000002c000000\
    940000002400000000000000000000000000000000000000b800000000000000230000000000000040000000000000002c00000000000000\
    02002800a601020003030000100000000000000000007f000000000000000000ffffffff1f0000004b545877726974657200426173697320\
    556e6976657273616c20322e3530000028b52ffd2040d5000078f71f00e01f7a001700e0ff1f02e0010300436130f3710d1801\
";
const ETC1S: &str = "\
    ab4b5458203230bb0d0a1a0a000000000100000008000000080000000000000000000000010000000100000001000000680000002c000000\
    9400000024000000b80000000000000082000000000000003a01000000000000010000000000000000000000000000002c00000000000000\
    02002800a301020003030000080000000000000000003f000000000000000000ffffffff1f0000004b545877726974657200426173697320\
    556e6976657273616c20322e35300000020001002a000000050000002b000000000000000000000000000000010000000000000000000000\
    20c044000000000000e2440430110000000000802420004c000800000000200600130000000000000826acaaaaaa0260c044000000000000\
    924a009800100000000040140226020000000000903602c00480000000000022100000\
";

#[test]
fn ktx2_textures_are_drawn() {
    for text in [UASTC, ETC1S] {
        let bytes = from_hex(text);
        let with = |bytes: &[u8]| {
            let uri = base64::Engine::encode(&base64::engine::general_purpose::STANDARD, bytes);
            let drawn = changed(|root| {
                textured_by(root);
                root["images"] = json!([{ "uri": format!("data:image/ktx2;base64,{uri}") }]);
                root["textures"] = json!([{ "extensions": { "KHR_texture_basisu": { "source": 0 } } }]);
                root["extensionsRequired"] = json!(["KHR_texture_basisu"]);
            });
            drawn.unwrap()
        };
        let loaded = with(&bytes);
        let texels = colors(&loaded);
        assert_eq!((texels.len(), loaded.notes.len()), (64, 0));
        let is_near = |a: [f32; 3], b: [f32; 3]| (0..3).all(|k| (a[k] - b[k]).abs() < 0.05);
        assert!(texels.iter().enumerate().all(|(i, texel)| is_near(*texel, RGB[if i % 8 < 4 { 0 } else { 2 }])));
        assert_note(&with(&bytes[..bytes.len() - 20]), "KTX2");
        // A broken file is read or noted; it ends nothing.
        for i in 0..150 {
            let mut broken = bytes.clone();
            broken[i * 7919 % bytes.len()] ^= 1 + (i * 31 % 255) as u8;
            with(&broken);
        }
    }
}

fn from_hex(text: &str) -> Vec<u8> {
    (0..text.len() / 2).map(|i| u8::from_str_radix(&text[2 * i..2 * i + 2], 16).unwrap()).collect()
}

/// Four positions as exponents and mantissas, octahedral normals, two triangles and two turns, as meshoptimizer packs them.
const MESHOPT: &str = "\
    a000000133000000807f000000010c00000040000000010300000020000000000000000000000000000000000000000000000000eb000000eb\
    000000eb000000a0011f0000004794013f000000fe91d9011b00000048013f000000fefd920000000000000000000000000000000000000000\
    000000000000000000000000ff7f00000000e1f000007687566778a986658968980169000000a00130000000c9013000000027000000000120\
    00000000000000000000000000000000000000000000000000000000018000000000fe7f\
";

#[test]
fn meshopt_views_are_unpacked_and_broken_ones_refused() {
    let folder = tempfile::tempdir().unwrap();
    let view = |start: usize, length: usize, count: usize, stride: usize, mode: &str, filter: &str| {
        json!({ "buffer": 1, "byteLength": count * stride, "extensions": { "EXT_meshopt_compression": { "buffer": 0,
            "byteOffset": start, "byteLength": length, "count": count, "byteStride": stride, "mode": mode, "filter": filter } } })
    };
    let root = json!({
        "asset": { "version": "2.0" }, "scenes": [{ "nodes": [0] }], "extensionsRequired": ["EXT_meshopt_compression"],
        "nodes": [{ "mesh": 0, "extensions": { "EXT_mesh_gpu_instancing": { "attributes": { "ROTATION": 3 } } } }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0, "NORMAL": 1 }, "indices": 2 }] }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3" },
            { "bufferView": 1, "componentType": 5122, "normalized": true, "count": 4, "type": "VEC4" },
            { "bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR" },
            { "bufferView": 3, "componentType": 5122, "normalized": true, "count": 2, "type": "VEC4" },
        ],
        "bufferViews": [
            view(0, 61, 4, 12, "ATTRIBUTES", "EXPONENTIAL"), view(64, 66, 4, 8, "ATTRIBUTES", "OCTAHEDRAL"),
            view(132, 19, 6, 2, "TRIANGLES", "NONE"), view(152, 55, 2, 8, "ATTRIBUTES", "QUATERNION"),
        ],
        "buffers": [{ "byteLength": 207 }, { "byteLength": 108, "extensions": { "EXT_meshopt_compression": { "fallback": true } } }],
    });
    let loaded = read(&folder, "a.glb", &glb(&root, &from_hex(MESHOPT))).unwrap();
    // The first turn is by -90 degrees about z, the second by 74 about x.
    let places = [[0.0; 3], [0.0, -2.0, 0.0], [1.0, -2.0, 0.0], [1.0, 0.0, 0.5], [2.0, 0.28, 0.96], [0.0, -0.2, 1.1]];
    let is_near = |a: &[f32; 3], b: &[f32; 3]| (0..3).all(|k| (a[k] - b[k]).abs() < 1e-3);
    assert!(places.iter().all(|place| loaded.mesh.positions().iter().any(|found| is_near(found, place))), "{loaded:?}");
    assert!(loaded.notes.is_empty() && loaded.mesh.triangles().len() == 4);
    assert!(
        is_near(&loaded.normals[0][1], &[0.0, 0.0, -1.0]) && is_near(&loaded.normals[0][2], &[0.0, -0.6, 0.8]),
        "{:?}",
        loaded.normals[0]
    );
    for seed in 0..400usize {
        let mut bytes = from_hex(MESHOPT);
        bytes[seed * 7919 % 207] ^= 1 << (seed % 8);
        let (outcome, peak) = crate::peak_of(|| read(&folder, "a.glb", &glb(&root, &bytes)));
        assert!(peak < 1 << 20, "{seed} takes {peak} bytes: {:?}", outcome.err());
    }
    for (name, value) in
        [("count", json!(1e9)), ("byteStride", json!(6)), ("byteLength", json!(1e18)), ("mode", json!("x"))]
    {
        let mut root = root.clone();
        root["bufferViews"][0]["extensions"]["EXT_meshopt_compression"][name] = value;
        assert_refused(read(&folder, "a.glb", &glb(&root, &from_hex(MESHOPT))), &["meshopt"]);
    }
}

const XYZ: &str = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
const FACE: &str = "element face 1\nproperty list uchar int vertex_indices\n";

/// A PLY file of one triangle whose vertices have three more numbers each.
fn ply_with(kind: &str, names: [&str; 3], values: [&str; 3]) -> Loaded {
    let rgb = names.map(|name| format!("property {kind} {name}\n")).concat();
    let rows = ["0 0 0", "1 0 0", "0 1 0"].iter().zip(values).map(|(place, color)| format!("{place} {color}\n"));
    ply_text(&format!("{XYZ}{rgb}{FACE}"), &format!("{}3 0 1 2\n", rows.collect::<String>())).unwrap()
}

/// Rounding and bright light are no bytes.
#[test]
fn colours_are_divided_where_they_are_bytes() {
    let rgb = ["red", "green", "blue"];
    for (kind, values, expected, note) in [
        ("float", ["1.0000002 1 1", "1.0000002 1.0000002 1", "1 1 1.0000002"], [1.000_000_2, 1.0, 1.0], ""),
        ("float", ["4 2 1", "8 8 8", "2 2 2"], [4.0, 2.0, 1.0], ""),
        ("double", ["1.5 3.25 40.5", "200 9 9", "9 9 9"], [1.5, 3.25, 40.5], "brighter than white"),
        ("float", ["51 255 0", "0 0 0", "7 7 7"], [0.2, 1.0, 0.0], "divided by 255"),
        ("float", ["nan 0 0", "0 0 0", "1 0 0"], [1.0; 3], "white"),
        ("uchar", ["51 255 0", "0 0 0", "0 0 0"], [0.2, 1.0, 0.0], ""),
        ("char", ["51 -1 -128", "0 0 0", "0 0 0"], [0.2, 1.0, 128.0 / 255.0], ""),
        ("ushort", ["51 255 0", "0 0 0", "0 0 0"], [0.2, 1.0, 0.0], "divided by 255"),
        ("ushort", ["13107 65535 0", "0 0 0", "0 0 0"], [0.2, 1.0, 0.0], ""),
        ("uint", ["13107 65535 0", "0 0 0", "0 0 0"], [0.2, 1.0, 0.0], ""),
        ("short", ["51 255 0", "0 0 0", "0 0 0"], [0.2, 1.0, 0.0], ""),
    ] {
        let mut all = vec![ply_with(kind, rgb, values)];
        if matches!(kind, "float" | "double") {
            let [a, b, c] = values;
            all.push(obj(&format!("v 0 0 0 {a}\nv 1 0 0 {b}\nv 0 1 0 {c}\nf 1 2 3\n"), "").unwrap());
        }
        for loaded in all {
            assert_eq!(colors(&loaded)[0], expected, "{kind} {values:?}");
            let notes = loaded.notes.join("; ");
            assert!(notes.contains(note) && notes.is_empty() == note.is_empty(), "{kind} {values:?}: {notes:?}");
        }
    }
    let kd = |kd: &str| obj(&format!("mtllib m.mtl\n{V}usemtl a\nf 1 2 3\n"), &format!("newmtl a\nKd {kd}\n")).unwrap();
    assert_eq!(colors(&kd("51 102 255")), [[0.2, 0.4, 1.0]]);
    assert_note(&kd("51 102 255"), "m.mtl:2: Kd up to 255");
    assert_note(&kd("20.5 0 0"), "brighter than white");
    assert_eq!((colors(&kd("1.0000002 2 2")), kd("1 2 2").notes.len()), (vec![[1.000_000_2, 2.0, 2.0]], 0));
    // In glTF, whole numbers are shares also where the file forgets to say so.
    for (kind, one) in [(5121, vec![51u8, 255, 0, 0]), (5123, vec![0x33, 0x33, 0xff, 0xff, 0, 0])] {
        let bytes = one.repeat(3);
        let text = base64::Engine::encode(&base64::engine::general_purpose::STANDARD_NO_PAD, &bytes);
        let whole = changed(|root| {
            root["buffers"]
                .as_array_mut()
                .unwrap()
                .push(json!({ "uri": format!("data:;base64,{text}"), "byteLength": bytes.len() }));
            let view = json!({ "buffer": 1, "byteLength": bytes.len(), "byteStride": one.len() });
            root["bufferViews"].as_array_mut().unwrap().push(view);
            let accessor = json!({ "bufferView": 5, "componentType": kind, "type": "VEC3", "count": 3 });
            root["accessors"].as_array_mut().unwrap().push(accessor);
            primitive(root)["attributes"]["COLOR_0"] = json!(4);
        });
        assert_eq!(colors(&whole.unwrap())[0], [0.2, 1.0, 0.0]);
    }
    let base = json!({ "pbrMetallicRoughness": { "baseColorFactor": [51, 102, 255, 255] } });
    let bytes = changed(|root| root["materials"][0] = base).unwrap();
    assert_eq!((colors(&bytes), bytes.opacity.len()), (vec![[0.2, 0.4, 1.0]], 0));
    assert_note(&bytes, "divided by 255");
}

#[test]
fn names_and_rows_of_ply_are_read_as_programs_write_them() {
    let green = ["0 255 0", "0 255 0", "0 255 0"];
    for names in [["Red", "Green", "Blue"], ["diffuse_red", "diffuse_green", "diffuse_blue"]] {
        let loaded = ply_with("uchar", names, green);
        assert_eq!((colors(&loaded)[0], loaded.notes.len()), (RGB[1], 0), "{names:?}");
    }
    assert_note(&ply_with("uchar", ["ambient_red", "ambient_green", "ambient_blue"], green), "ambient colours");
    assert_note(&ply_with("uchar", ["rgb_0", "rgb_1", "rgb_2"], green), "property \"rgb_0\" is not read");
    let body = "0 0 0 9\n1 0 0 9\n0 1 0 9 9\n\n3 0 1 2 7\n";
    let longer = ply_text(&format!("{XYZ}{FACE}"), body).unwrap();
    assert_eq!(longer.mesh.positions()[1..], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_note(&longer, "4 rows have more numbers");
    assert_refused(ply_text(&format!("{XYZ}{FACE}"), "0 0 0\n1 0\n0 1 0\n3 0 1 2\n"), &["row 2", "fewer numbers"]);
    assert_eq!(ply_text(&format!("{XYZ}{FACE}"), "0 0\n0\n1 0 0\n0 1 0\n3 0 1\n2\0\0\x1a").unwrap().notes, [""; 0]);
    assert_note(&ply_text(&format!("{XYZ}{FACE}"), "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\nmore\n").unwrap(), "4 bytes after");
    let grid = "element range_grid 1\nproperty list uchar int vertex_indices\n";
    assert_refused(ply_text(&format!("{XYZ}{grid}"), "0 0 0\n1 0 0\n0 1 0\n1 0\n"), &["range grids are not drawn"]);
    // A number below 0 is no image: the face has its colour, or is white.
    let faces = "element face 2\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nproperty int texnumber\n";
    let rows = "3 0 1 2 6 0 0 0 0 0 0 -1\n3 0 1 2 6 0 0 0 0 0 0 0\n";
    let bare =
        ply_text(&format!("comment TextureFile a.png\n{XYZ}{faces}"), &format!("0 0 0\n1 0 0\n0 1 0\n{rows}")).unwrap();
    assert_eq!((at_corners(&bare, 0), at_corners(&bare, 1)), ([[1.0; 3]; 3], [RGB[0]; 3]));
    let colored = XYZ.to_string() + "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    let points = "0 0 0 0 255 0\n1 0 0 0 255 0\n0 1 0 0 255 0\n";
    let bare = ply_text(&format!("comment TextureFile a.png\n{colored}{faces}"), &format!("{points}{rows}")).unwrap();
    assert_eq!((at_corners(&bare, 0), at_corners(&bare, 1)), ([RGB[1]; 3], [RGB[0]; 3]));
}

/// Names in Latin-1, composed otherwise, or of any other encoding.
#[test]
fn names_beyond_ascii_are_found() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("café.mtl"), "newmtl m\nmap_Kd ünd.png\n").unwrap();
    fs::write(folder.path().join("u\u{308}nd.png"), pixel(PNG[0])).unwrap();
    let text = format!("mtllib caf\u{e9}.mtl\n{V}vt 0 0\nusemtl m\nf 1/1 2/1 3/1\n");
    let latin = read(&folder, "a.obj", &text.chars().map(|c| c as u8).collect::<Vec<_>>()).unwrap();
    assert_eq!((colors(&latin), latin.notes.len()), (vec![RGB[0]], 1));
    assert_note(&latin, "is taken in its place");
    let head = "ply\nformat ascii 1.0\ncomment TextureFile u\u{308}nd.png\n".to_string();
    let uvs = "property float s\nproperty float t\n";
    let ply = read(
        &folder,
        "a.ply",
        format!("{head}{XYZ}{uvs}{FACE}end_header\n0 0 0 0 0\n1 0 0 0 0\n0 1 0 0 0\n3 0 1 2\n").as_bytes(),
    );
    assert_eq!(colors(&ply.unwrap()), [RGB[0]]);
}

#[test]
fn stl_files_without_colours_are_not_black() {
    let folder = tempfile::tempdir().unwrap();
    let with = |color: &[u8], words: [u16; 2]| {
        let mut binary = stl(&torus(3, 3));
        binary[..color.len()].copy_from_slice(color);
        let count = torus(3, 3).triangles().len();
        (0..count)
            .for_each(|t| binary[84 + 50 * t + 48..][..2].copy_from_slice(&words[usize::from(t == 0)].to_le_bytes()));
        colors(&read(&folder, "a.stl", &binary).unwrap())
    };
    let grey = [127.0 / 255.0; 3];
    assert_eq!(with(b"COLOR=\x7f\x7f\x7f\xff MATERIAL=", [0, 0]), [grey]);
    assert_eq!(with(b"COLOR=\x7f\x7f\x7f\xff MATERIAL=", [0x8000, 0x8000]), [grey]);
    assert_eq!(with(b"COLOR=\0\0\0\0", [0, 0]), [[1.0; 3]]);
    assert_eq!(with(b"", [0x8000, 0x8000]), [[1.0; 3]]);
    assert_eq!(with(b"COLOR=\x7f\x7f\x7f\xff", [0, 0x1f])[..2], [RGB[0], [0.0; 3]]);
}

#[test]
fn stl_text_flows_and_may_have_padding_and_bad_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let facet = "facet normal 0 0 1 outer loop vertex 0 0 0 vertex 1 0 0 vertex 0 1 0 endloop endfacet";
    let count = |text: &str| {
        let loaded = read(&folder, "a.stl", text.as_bytes()).unwrap();
        (loaded.mesh.triangles().len(), loaded.notes.join("; "))
    };
    assert_eq!(
        count(&format!("solid my facet {facet} endsolid my facet solid b {facet} endsolid b")),
        (2, String::new())
    );
    assert_eq!(
        count(&format!("solid a\n{}\nendsolid a\n\0\0", facet.replace(" vertex", "\nvertex"))),
        (1, String::new())
    );
    assert!(count(&format!("solid a\n{facet}\nendsolid a\n\0junk")).1.contains("4 bytes after the end"));
    let (left, notes) = count(&format!("solid a\n{facet}\n{}\nendsolid a\n", facet.replace("1 0 0", "1 -nan(ind) 0")));
    assert!(left == 1 && notes.contains("1 triangles have a corner that is no finite point"), "{notes}");
    let mut binary = stl(&torus(3, 3));
    binary[84 + 12..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let loaded = read(&folder, "b.stl", &binary).unwrap();
    assert_eq!(loaded.mesh.triangles().len(), torus(3, 3).triangles().len() - 1);
    assert_note(&loaded, "no finite point");
}

/// Whatever a download leaves in the place of a file, mesh or picture, says so.
#[test]
fn what_stands_in_for_a_file_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 84\n";
    let page = "\u{feff}\n<!DOCTYPE html>\n<html><head></head></html>\n";
    for (text, words) in [(pointer, ["Git LFS pointer", "git lfs pull"]), (page, ["a web page", "download"])] {
        for ending in ["obj", "ply", "stl", "gltf", "glb", "txt"] {
            assert_refused(read(&folder, &format!("a.{ending}"), text.as_bytes()), &words);
        }
        let at = |name: &str| folder.path().join(name);
        let budget = softras_io::Budget::new(None);
        for name in ["t.png", "transforms.json", "m.mtl", "b.bin", "images.txt", "cameras.txt"] {
            fs::write(at(name), text).unwrap();
        }
        let said =
            |error: softras::Error| assert!(words.iter().all(|word| error.to_string().contains(word)), "{error}");
        said(softras_io::read_picture(&at("t.png"), &budget, 64).unwrap_err());
        for cameras in ["transforms.json", "images.txt"] {
            let options = softras_io::ViewsOptions { cameras: Some(at(cameras)), ..Default::default() };
            said(softras_io::Views::open_with(folder.path(), &options, &budget).map(drop).unwrap_err());
        }
        let text = format!("mtllib m.mtl\nmtllib n.mtl\n{V}vt 0 0\nusemtl a\nf 1/1 2/1 3/1\n");
        fs::write(at("n.mtl"), "newmtl a\nmap_Kd t.png\n").unwrap();
        let loaded = read(&folder, "a.obj", text.as_bytes()).unwrap();
        assert_note(&loaded, words[0]);
        assert!(loaded.notes.iter().filter(|note| note.contains(words[0])).count() == 2, "{:?}", loaded.notes);
        let (mut root, _) = gltf(&torus(3, 3));
        root["buffers"][0]["uri"] = json!("b.bin");
        assert_refused(read(&folder, "a.gltf", root.to_string().as_bytes()), &words);
    }
    assert_refused(read(&folder, "a.obj", b"PK\x03\x04rest"), &["ZIP", "unpack"]);
}

/// An error says what to do about itself.
#[test]
fn remedies_of_gltf_are_those_of_the_error() {
    for (place, value, words) in [
        ("/buffers/0/uri", json!("gone.bin"), ["gone.bin not found", "copy it beside"]),
        ("/meshes/0/primitives/0/material", json!(9), ["material 9 but there are 1", "glTF-Validator"]),
        ("/accessors/0/type", json!("VEC2"), ["2 components", "VEC3 for positions"]),
        ("/accessors/0/componentType", json!(5130), ["componentType 5130", "5126"]),
        ("/asset/version", json!("1.0"), ["version 1.0", "gltf-pipeline"]),
        ("/extensionsRequired", json!(["X_new"]), ["X_new", "without it"]),
        ("/meshes", json!(3), ["malformed", "type"]),
    ] {
        let change = |root: &mut Value| {
            let (parent, name) = place.rsplit_once('/').unwrap();
            root.pointer_mut(parent).unwrap()[name] = value;
        };
        assert_refused(changed(change), &words);
    }
    let points = changed(|root| primitive(root)["mode"] = json!(0));
    assert_refused(points, &["no faces", "points are not drawn"]);
}

/// Padding, chunks and numbers that programs write beside the letter of the specification.
#[test]
fn gltf_files_may_be_padded_and_hold_nan() {
    let folder = tempfile::tempdir().unwrap();
    let (root, binary) = gltf(&torus(3, 3));
    let triangles = |name: &str, bytes: &[u8]| read(&folder, name, bytes).unwrap().mesh.triangles().len();
    let plain = glb(&root, &binary);
    let length = u32::from_le_bytes(plain[12..16].try_into().unwrap()) as usize;
    let mut json_chunk = plain[20..20 + length].to_vec();
    json_chunk.truncate(json_chunk.trim_ascii_end().len());
    json_chunk.resize(length + 8, 0);
    let mut padded =
        [&plain[..12], &(length as u32 + 8).to_le_bytes(), b"JSON", &json_chunk, b"\x04\0\0\0XTRA1234"].concat();
    padded.extend(&plain[20 + length..]);
    assert_eq!(triangles("a.glb", &[padded, b"behind".to_vec()].concat()), 18);
    assert_eq!(
        triangles("b.gltf", &[&b"\xef\xbb\xbf"[..], &embedded(root.clone(), &binary), b"\r\n\0\0"].concat()),
        18
    );
    let text = String::from_utf8(embedded(root.clone(), &binary)).unwrap();
    let nan = text.replacen("\"min\":[", "\"extras\":\"a NaN \\\" NaN\",\"min\":[NaN,-Infinity,", 1);
    assert_note(&read(&folder, "c.gltf", nan.as_bytes()).unwrap(), "not finite");
    let place = |k: usize| 4 * k;
    let mut bad = binary.clone();
    bad[place(0)..place(1)].copy_from_slice(&f32::NAN.to_le_bytes());
    let loaded = read(&folder, "d.glb", &glb(&root, &bad)).unwrap();
    assert!(loaded.mesh.triangles().len() < 18 && loaded.notes.len() == 1, "{:?}", loaded.notes);
    assert_note(&loaded, "no finite point");
}

/// A 4×4 image that is clamped along u and repeats along v, over five tiles and over a thousand.
#[test]
fn a_clamped_side_goes_on_for_several_tiles() {
    let with = |reach: f64| {
        changed(|root| {
            textured_by(root);
            root["samplers"] = json!([{ "wrapS": 33071, "wrapT": 10497 }]);
            root["textures"] = json!([{ "source": 0, "sampler": 0 }]);
            let transform = json!({ "KHR_texture_transform": { "scale": [reach, 1], "offset": [-2, 0] } });
            root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] = transform;
        })
        .unwrap()
    };
    let five = with(5.0);
    assert_eq!((at_corners(&five, 0), five.notes.len()), ([RGB[0]; 3], 0));
    let far = with(9000.0);
    assert_eq!(colors(&far), [RGB[0]]);
    assert_note(&far, "clamped along one side");
}

#[test]
fn notes_say_what_is_so() {
    let blend = json!({ "alphaMode": "BLEND", "extensions": { "KHR_materials_transmission": {} } });
    let glass = changed(|root| root["materials"][0] = blend).unwrap();
    assert!(glass.notes.iter().any(|note| note.contains("glass") && !note.contains("BLEND")), "{:?}", glass.notes);
    let colored = "mtllib m.mtl\nv 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n";
    let unknown = obj(colored, "newmtl b\n").unwrap();
    assert_eq!(colors(&unknown)[0], RGB[0]);
    assert_note(&unknown, "in the vertices' colours");
    let alpha =
        obj(&format!("mtllib m.mtl\n{V}vt 0 0\nusemtl a\nf 1/1 2/1 3/1\n"), "newmtl a\nmap_Kd t.png\nmap_d gone.png\n");
    assert_note(&alpha.unwrap(), "gone.png not found: drawn opaque");
    let even = changed(|root| {
        root["accessors"][2] = json!({ "componentType": 5126, "type": "VEC4", "count": 3 });
        root["materials"][0] = json!({ "alphaMode": "BLEND" });
        primitive(root)["attributes"]["COLOR_0"] = json!(2);
    });
    assert!(even.unwrap().notes.iter().all(|note| !note.contains("averaged")));
}

/// A sheet whose front is red and whose back is blue, with vertices of their own.
#[test]
fn each_side_of_a_sheet_is_seen_from_its_own() {
    let mtl = "newmtl a\nKd 1 0 0\nnewmtl b\nKd 0 0 1\n";
    let read = |second: &str| {
        let text = format!("mtllib m.mtl\n{V}{V}usemtl a\nf 1 2 3\n{second}\n");
        let loaded = obj(&text, mtl).unwrap();
        (loaded.single_sided, loaded.notes.join("; "))
    };
    assert_eq!(read("usemtl b\nf 6 5 4\nf 1 2 2"), (vec![true, true, false], String::new()));
    assert_eq!(read("f 4 5 6\nf 3 2 1\nusemtl b\nv 1 1 1\nf 1 2 7\nf 1 1 2"), (vec![], String::new()));
    assert!(read("usemtl b\nf 5 6 4").1.contains("1 triangle lies on others of another colour"));
}
