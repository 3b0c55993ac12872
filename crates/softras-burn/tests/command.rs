//! The command as a user runs it: data, training that is interrupted and resumed, a mesh of a picture, the table.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

const PROGRAM: &str = env!("CARGO_BIN_EXE_softras-reconstruct");

fn run(folder: &Path, line: &str) -> Output {
    Command::new(PROGRAM).current_dir(folder).args(line.split_whitespace()).output().unwrap()
}

fn succeeds(folder: &Path, line: &str) -> String {
    let output = run(folder, line);
    assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn fails(folder: &Path, line: &str) -> String {
    let output = run(folder, line);
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(matches!(output.status.code(), Some(1 | 2)), "{line}: {:?} {error}", output.status);
    assert!(error.contains("error:") && !error.contains("panicked"), "{line}: {error}");
    error
}

fn make(folder: &Path) {
    succeeds(folder, "data -o data --families lamp,sofa --train 2 --val 1 --test 1");
}

const SMALL: &str = "--width 2 --pairs 2 --every 2";

#[test]
fn from_data_to_a_mesh_and_the_table() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    make(folder);
    succeeds(folder, &format!("train data -o whole --steps 4 {SMALL}"));
    let curve = std::fs::read_to_string(folder.join("whole/curve.csv")).unwrap();
    assert_eq!(curve.lines().count(), 5, "{curve}");

    let network = "--network whole/best.safetensors";
    succeeds(folder, &format!("train data -o solid --voxels --steps 2 {SMALL}"));
    let networks =
        "--network v=solid/best.safetensors --network a=whole/best.safetensors --network a=whole/last.safetensors";
    let table = format!("evaluate data {networks} --views 2 --sheet s.png --example p.png --curves c.svg");
    let table = succeeds(folder, &table);
    assert!(table.contains("| a |") && table.contains("| v |") && table.contains("retrieval by silhouette"), "{table}");
    // A row in the table of solids, and one in that of colours.
    let of_a: Vec<&str> = table.lines().filter(|line| line.contains("| a |")).collect();
    assert!(of_a.len() == 2 && of_a.iter().all(|row| row.contains(" to ")), "{table}");
    assert!(table.contains("| colour error | lamp | sofa | mean |"), "{table}");
    assert_eq!(table.lines().filter(|line| line.contains("| v |")).count(), 1, "{table}");
    let sheet = image::open(folder.join("s.png")).unwrap();
    assert_eq!([sheet.width(), sheet.height()], [6 * 128, 28 + 2 * 128]);
    assert!(std::fs::read_to_string(folder.join("c.svg")).unwrap().contains("IoU of silhouettes"));

    succeeds(folder, &format!("predict p.png {network} -o mesh.obj --gif turn.gif"));
    turns(&folder.join("turn.gif"));
    let mesh = std::fs::read_to_string(folder.join("mesh.obj")).unwrap();
    assert_eq!(mesh.lines().filter(|line| line.starts_with("v ")).count(), 642);
    // A vertex colour follows each position.
    assert!(mesh.lines().filter(|line| line.starts_with("v ")).all(|line| line.split(' ').count() == 7));

    image::RgbaImage::new(32, 64).save(folder.join("narrow.png")).unwrap();
    assert!(fails(folder, &format!("predict narrow.png {network} -o mesh.obj")).contains("32 by 64"));
    assert!(fails(folder, &format!("predict p.png {network} -o mesh.stl")).contains("mesh.stl"));
    assert!(fails(folder, "predict p.png --network p.png -o mesh.obj").contains("not a checkpoint"));
    assert!(fails(folder, "predict p.png --network solid/best.safetensors -o mesh.obj").contains("voxel network"));
    assert!(fails(folder, "evaluate data --network v=solid/best.safetensors --sheet s.png").contains("mesh network"));
    let no_curve = fails(folder, "evaluate data --network v=solid/best.safetensors --curves none.svg");
    assert!(no_curve.contains("solid/best.safetensors: no network has a curve"), "{no_curve}");
    assert!(no_curve.contains("leave --curves out") && !folder.join("none.svg").exists(), "{no_curve}");
    assert!(fails(folder, "train data -o x --classes ship").contains("ship_train_images.npz"));
    assert!(fails(folder, "train data -o x --steps 0").contains("steps = 0"));
    assert!(fails(folder, "data -o x --families ship").contains("no family \"ship\""));
    assert!(fails(folder, "data -o x --shard 2/2").contains("I below N"));
    std::fs::write(folder.join("data/sofa_test_voxels.npz"), b"PK").unwrap();
    assert!(fails(folder, "evaluate data").contains("sofa_test_voxels.npz"));
}

/// The film's left half stays the input, and its right half changes with every frame.
fn turns(path: &Path) {
    let reader = std::io::BufReader::new(std::fs::File::open(path).unwrap());
    let film = image::AnimationDecoder::into_frames(image::codecs::gif::GifDecoder::new(reader).unwrap());
    let frames = film.collect_frames().unwrap();
    assert_eq!(frames.len(), 48);
    let half =
        |frame: &image::Frame, left: u32| image::imageops::crop_imm(frame.buffer(), left, 0, 128, 128).to_image();
    let changed = frames.array_windows().filter(|[a, b]| half(a, 128) != half(b, 128)).count();
    assert!(changed > 40, "{changed}");
    // The palette of each frame is its own, so that colours differ a little.
    let far = |[a, b]: [&image::Frame; 2]| {
        half(a, 0).iter().zip(half(b, 0).iter()).map(|(a, b)| a.abs_diff(*b)).max().unwrap()
    };
    assert!(frames.array_windows().all(|[a, b]| far([a, b]) < 40));
}

/// An archive of furniture: a catalogue and files.
fn archive(path: &Path, files: &[(&str, &[u8])]) {
    let mut zip = zip::ZipWriter::new(std::fs::File::create(path).unwrap());
    for (name, bytes) in files {
        zip.start_file(*name, zip::write::SimpleFileOptions::default()).unwrap();
        std::io::Write::write_all(&mut zip, bytes).unwrap();
    }
    zip.finish().unwrap();
}

#[test]
fn furniture_becomes_sets_and_hostile_archives_stay_inside() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::create_dir_all(folder.join("shop")).unwrap();
    assert!(fails(folder, "data -o data --furniture shop").contains("sweethome3d-furniture"));
    let piece = |i: usize, name: &str, model: &str| {
        let size = format!("width#{i}=40\ndepth#{i}=80\nheight#{i}=20\n");
        format!("id#{i}=shop#{i:02}\nname#{i}={name}\nmodel#{i}=/{model}\n{size}")
    };
    let mut catalogue = String::new();
    let mut files = Vec::new();
    for (class, name) in ["Round table", "Sofa", "High cabinet", "Oak chair"].into_iter().enumerate() {
        for i in 0..7 {
            let mesh = softras_burn::reconstruct::families::object("sofa", (7 * class + i) as u64).unwrap().unwrap();
            let path = folder.join("one.obj");
            softras_io::save(&mesh, &path).unwrap();
            let number = 10 * class + i;
            catalogue += &piece(number, name, &format!("{number}/one.obj"));
            files.push((format!("{number}/one.obj"), std::fs::read(&path).unwrap()));
        }
    }
    // The same model again, one that is missing, and one beside a file whose name leads out.
    catalogue += &piece(90, "Sofa", "0/one.obj");
    catalogue += &piece(91, "Sofa", "gone/one.obj");
    catalogue += &piece(92, "Sofa", "evil/one.obj");
    files.push(("evil/one.obj".into(), b"v 0 0 0\n".to_vec()));
    files.push(("evil/../../../outside.txt".into(), b"outside".to_vec()));
    // A model outside of the archive, where there is such a file.
    catalogue += &piece(93, "Sofa", "../one.obj");
    files.push(("PluginFurnitureCatalog.properties".into(), catalogue.into_bytes()));
    let named: Vec<(&str, &[u8])> = files.iter().map(|(name, bytes)| (name.as_str(), &bytes[..])).collect();
    archive(&folder.join("shop/shop.sh3f"), &named);
    let output = run(folder, "data -o data --furniture shop");
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{told}");
    assert!(
        told.contains("left out: shop#91") && told.contains("left out: shop#92") && !told.contains("shop#90"),
        "{told}"
    );
    assert!(told.contains("left out: shop#93"), "{told}");
    assert!(told.contains("leads out of the archive") && !folder.join("outside.txt").exists(), "{told}");
    for class in ["cabinet", "chair", "sofa", "table"] {
        assert!(told.contains(&format!("{class}: 1 objects for test")), "{told}");
    }
    assert!(succeeds(folder, "evaluate data --views 1").contains("| method | cabinet | chair | sofa | table | mean |"));
    archive(&folder.join("shop/empty.sh3f"), &[("other.txt", b"x")]);
    assert!(fails(folder, "data -o other --furniture shop").contains("empty.sh3f"));
    std::fs::write(folder.join("shop/empty.sh3f"), b"PK").unwrap();
    assert!(fails(folder, "data -o other --furniture shop").contains("not an archive"));
}

#[test]
fn meshes_of_a_folder_become_sets() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    assert!(fails(folder, "data -o data --class thing --meshes .").contains("no mesh file"));
    std::fs::create_dir(folder.join("meshes")).unwrap();
    for i in 0..10 {
        let mesh = softras_burn::reconstruct::families::object("bed", i).unwrap().unwrap();
        softras_io::save(&mesh, &folder.join(format!("meshes/{i}.obj"))).unwrap();
    }
    std::fs::write(folder.join("meshes/broken.obj"), "f 1 2 3").unwrap();
    let output = run(folder, "data -o data --class thing --meshes meshes");
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && told.contains("left out") && told.contains("broken.obj"), "{told}");
    let table = succeeds(folder, "evaluate data --views 1");
    assert!(table.contains("| method | thing | mean |"), "{table}");
}

#[cfg(unix)]
#[test]
fn ctrl_c_keeps_what_was_learned() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    make(folder);
    let line = format!("train data -o run --steps 100000 {SMALL}");
    let mut command = Command::new(PROGRAM);
    command.current_dir(folder).args(line.split_whitespace()).stderr(std::process::Stdio::null());
    let mut child = command.spawn().unwrap();
    let start = Instant::now();
    while !folder.join("run/curve.csv").exists() {
        assert!(start.elapsed() < Duration::from_secs(120), "no checkpoint was written");
        std::thread::sleep(Duration::from_millis(50));
    }
    let interrupted = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(interrupted.success() && child.wait().unwrap().success());
    let lines = || std::fs::read_to_string(folder.join("run/curve.csv")).unwrap().lines().count();
    let before = lines();
    assert!(before > 2);
    assert!(folder.join("run/best.safetensors").exists());

    // The file system takes no more than 20 KiB a file: the checkpoints that are there stay whole.
    let whole = std::fs::read(folder.join("run/last.safetensors")).unwrap();
    let line = format!("{PROGRAM} train data -o run --every 2 --resume run/last.safetensors");
    let limited = format!("trap '' XFSZ; ulimit -f 20; exec {line}");
    let output = Command::new("bash").current_dir(folder).args(["-c", &limited]).output().unwrap();
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success() && error.contains("last.safetensors"), "{error}");
    assert_eq!(std::fs::read(folder.join("run/last.safetensors")).unwrap(), whole);
    assert_eq!(lines(), before);
}
