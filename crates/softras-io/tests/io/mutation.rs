//! Tests that randomly mutated OBJ, MTL and PNG files give a valid mesh or an error that names the file, never a panic and
//! never the content of a file outside the mesh's folder.

use crate::mutate::{cases, mutate};
use crate::peak_of;
use crate::{RAW, load, save};
use softras::{
    Error, Mesh,
    scene::{Appearance, Texture, Wrap},
    shapes,
};
use softras_check::stress::Random;
use std::{fs, panic, path::Path};

/// Reading a mesh takes at most this many bytes for each byte of its files, besides [`SLACK`]: a triangle of a few
/// characters is some thirty numbers in memory, most of them twice while they are put together.
const MULTIPLE: usize = 40;
/// Memory that an image decoder sets aside whatever the image, and that other tests of this process allocate meanwhile.
const SLACK: usize = 1 << 20;

/// A colour that only the image outside the mesh's folder has.
const SECRET: [u8; 3] = [250, 3, 77];

/// A mesh with two images, some quads, and a file for each.
fn originals(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let sphere = shapes::icosphere(1).unwrap();
    let uvs = sphere.positions().iter().map(|p| [p[0], p[1]]).collect();
    let texels = |seed: u32| (0..20).map(|i| [((i * 7 + seed) % 11) as f32 / 255.0; 3]).collect();
    let textures = [1, 2].map(|seed| Texture::new(5, 4, texels(seed), Wrap::Repeat).unwrap()).to_vec();
    let appearance = Appearance::Textured {
        uvs,
        uv_triangles: sphere.triangles().to_vec(),
        textures,
        texture_of_triangle: (0..sphere.triangles().len() as u32).map(|t| t % 2).collect(),
    };
    save(&sphere.with_appearance(appearance).unwrap(), &folder.join("mesh.obj")).unwrap();
    let obj = folder.join("mesh.obj");
    let quads = "o two\nusemtl m0\nf -1/-1 -2/-2 -3/-3 -4/-4\ng x\nf 1/1/1 2/2/1 3/3/1 # a comment\nf 4 5 6\\\n 7\n";
    fs::write(&obj, fs::read_to_string(&obj).unwrap() + quads).unwrap();
    let names = ["mesh.obj", "mesh.mtl", "mesh_texture_0.png", "mesh_texture_1.png"];
    names.map(|name| (name.to_string(), fs::read(folder.join(name)).unwrap())).to_vec()
}

/// Checks that a mesh is valid and contains no texture from outside the folder.
fn validate(mesh: &Mesh) -> Result<(), String> {
    let sound = Mesh::new(mesh.positions().to_vec(), mesh.triangles().to_vec())
        .and_then(|again| again.with_appearance(mesh.appearance().clone()));
    sound.map_err(|error| error.to_string())?;
    let Appearance::Textured { textures, .. } = mesh.appearance() else { return Ok(()) };
    let secret = |texel: &[f32; 3]| texel.map(|x| (x * 255.0).round() as u8) == SECRET;
    if textures.iter().any(|texture| texture.texels().iter().any(secret)) {
        return Err("a texture from outside the mesh's folder".into());
    }
    Ok(())
}

/// Changes one of the files at a time, `likely` ones more often, and reads `mesh`, or else the file itself: a valid mesh or an
/// error that names a file of the folder, in at most `multiple` bytes for each byte of the files, besides [`SLACK`].
pub fn mutated(folder: &Path, files: &[(String, Vec<u8>)], likely: &[usize], mesh: Option<&str>, multiple: usize) {
    for (name, bytes) in files {
        fs::write(folder.join(name), bytes).unwrap();
    }
    let (mut read, mut refused) = (0, 0);
    for seed in 0..cases(1000) {
        let random = &mut Random::new(seed);
        let (name, original) = &files[random.choose(likely)];
        let mut bytes = original.clone();
        (0..random.choose(&[1, 1, 2, 5])).for_each(|_| mutate(random, &mut bytes));
        fs::write(folder.join(name), &bytes).unwrap();
        let others = if mesh.is_some() { files.iter().map(|(_, bytes)| bytes.len()).sum::<usize>() } else { 0 };
        let size = others.saturating_sub(original.len()) + bytes.len();
        // Colours as they are in the file, so that the secret one is known again.
        let load = || load(folder.join(mesh.unwrap_or(name)), &RAW);
        let (outcome, peak) = peak_of(|| panic::catch_unwind(load));
        assert!(peak <= SLACK + multiple * size, "seed {seed}, {name}: {peak} bytes for files of {size}");
        match outcome.unwrap_or_else(|_| panic!("seed {seed}, {name}: a panic")) {
            Ok(loaded) => {
                validate(&loaded.mesh).unwrap_or_else(|what| panic!("seed {seed}, {name}: {what}"));
                read += 1;
            }
            Err(Error::File { path, .. }) => {
                assert!(path.starts_with(folder), "seed {seed}: {}", path.display());
                refused += 1;
            }
            Err(other) => panic!("seed {seed}, {name}: neither read nor refused as a file: {other}"),
        }
        fs::write(folder.join(name), original).unwrap();
    }
    assert!(read > 30 && refused > 30, "{read} read, {refused} refused");
}

#[test]
fn mutated_meshes_are_read_or_refused() {
    let parent = tempfile::tempdir().unwrap();
    let folder = parent.path().join("inside");
    fs::create_dir(&folder).unwrap();
    image::RgbImage::from_pixel(1, 1, image::Rgb(SECRET)).save(parent.path().join("secret.png")).unwrap();
    // The OBJ file in most cases, else one of the others.
    mutated(&folder, &originals(&folder), &[0, 0, 0, 1, 1, 2], Some("mesh.obj"), MULTIPLE);
}

/// Files of a megabyte that say little, often: time and memory grow as the file does.
#[test]
fn long_files_take_no_more_than_their_size() {
    let folder = tempfile::tempdir().unwrap();
    let (obj, mtl) = (folder.path().join("mesh.obj"), folder.path().join("mesh.mtl"));
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let times = |text: &str, count: usize| text.repeat(count);
    let materials: String = (0..60_000).map(|i| format!("newmtl m{i}\nKd 1 0 0\n")).collect();
    let uses: String = (0..60_000).map(|i| format!("usemtl m{i}\nf 1 2 3\n")).collect();
    fs::write(&mtl, materials).unwrap();
    let texts = [
        ("continuations", format!("{triangle}f 1 2 3 {}\n", times("\\\n", 500_000))),
        ("the same library", format!("{triangle}{}", times("mtllib mesh.mtl\n", 60_000))),
        ("many materials", format!("mtllib mesh.mtl\n{triangle}{uses}")),
        ("unknown words", format!("{triangle}{}", times("what is this\n", 80_000))),
        ("one polygon", format!("{triangle}f{}\n", times(" 1 2 3", 160_000))),
        ("one number", format!("{triangle}v {} 0 0\n", times("1", 1_000_000))),
        ("triangles", format!("{triangle}{}", times("f 1 2 3\n", 120_000))),
        ("vertices", format!("{triangle}{}", times("v 1 2 3\n", 120_000))),
        ("missing libraries", format!("{triangle}{}", times("mtllib a b c\n", 4_000))),
    ];
    for (name, text) in texts {
        fs::write(&obj, &text).unwrap();
        let size = text.len() + fs::metadata(&mtl).unwrap().len() as usize;
        let start = std::time::Instant::now();
        let (outcome, peak) = peak_of(|| load(&obj, &RAW));
        let seconds = start.elapsed().as_secs_f64();
        println!("{name}: {:.1} times {size} bytes, {seconds:.2} s, {}", peak as f64 / size as f64, outcome.is_ok());
        assert!(peak <= SLACK + MULTIPLE * size, "{name}: {peak} bytes for files of {size}");
        assert!(seconds < 30.0, "{name}: {seconds} s");
    }
}
