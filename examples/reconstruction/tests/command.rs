//! The command as a user runs it: data, training that is interrupted and resumed, a mesh of a picture, the table.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

const PROGRAM: &str = env!("CARGO_BIN_EXE_softras-reconstruct");

fn run(folder: &Path, line: &str) -> Output {
    Command::new(PROGRAM).current_dir(folder).args(line.split_whitespace()).output().unwrap()
}

/// The output of a command that succeeds, and its messages on progress.
fn succeeds(folder: &Path, line: &str) -> (String, String) {
    let output = run(folder, line);
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{line}: {told}");
    (String::from_utf8(output.stdout).unwrap(), told)
}

fn fails(folder: &Path, line: &str, expected: &str) {
    let output = run(folder, line);
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(matches!(output.status.code(), Some(1 | 2)), "{line}: {:?} {error}", output.status);
    assert!(error.contains("error:") && !error.contains("panicked"), "{line}: {error}");
    assert!(error.contains(expected), "{line}: {error}");
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
    assert!(curve.starts_with("step,loss,silhouette,color,laplacian,flatten\n1,"), "{curve}");

    let network = "--network whole/best.safetensors";
    let networks = "--network a=whole/best.safetensors --network a=whole/last.safetensors";
    let line = format!("evaluate data {networks} --views 2 --sheet s.png --example p.png");
    let (table, _) = succeeds(folder, &line);
    // A row in the table of solids, and one in that of colours.
    let of_a: Vec<&str> = table.lines().filter(|line| line.contains("| a |")).collect();
    assert!(of_a.len() == 2 && of_a.iter().all(|row| row.contains(" to ")), "{table}");
    assert!(table.contains("| colour error | lamp | sofa | mean |"), "{table}");
    let sheet = softras_io::PictureFile::open(&folder.join("s.png")).unwrap();
    assert_eq!([sheet.width, sheet.height], [6 * 128, 28 + 2 * 128]);

    succeeds(folder, &format!("predict p.png {network} -o mesh.obj --gif turn.gif"));
    assert!(std::fs::read(folder.join("turn.gif")).unwrap().starts_with(b"GIF89a"));
    let mesh = std::fs::read_to_string(folder.join("mesh.obj")).unwrap();
    let vertices: Vec<&str> = mesh.lines().filter(|line| line.starts_with("v ")).collect();
    // A vertex colour follows each position.
    assert!(vertices.len() == 642 && vertices.iter().all(|line| line.split(' ').count() == 7));

    for (line, error) in [
        (&*format!("predict p.png {network} -o mesh.stl"), "mesh.stl"),
        (&format!("predict s.png {network} -o mesh.obj"), "768 by 284"),
        ("predict p.png --network p.png -o mesh.obj", "not a checkpoint"),
        ("evaluate data --sheet s.png", "--network"),
        ("evaluate data --views 25", "25"),
        ("train data -o x --classes ship", "ship_train_images.npz"),
        ("train data -o x --steps 0", "steps = 0"),
        ("data -o x --families ship", "no family \"ship\""),
        ("data -o x --class thing --meshes whole", "no mesh file"),
        ("data -o x --furniture .", "sweethome3d-furniture"),
    ] {
        fails(folder, line, error);
    }
}

/// An archive of furniture: a catalogue and files.
fn archive(path: &Path, files: &[(String, Vec<u8>)]) {
    let mut zip = zip::ZipWriter::new(std::fs::File::create(path).unwrap());
    for (name, bytes) in files {
        zip.start_file(name.as_str(), zip::write::SimpleFileOptions::default()).unwrap();
        std::io::Write::write_all(&mut zip, bytes).unwrap();
    }
    zip.finish().unwrap();
}

#[test]
fn furniture_becomes_sets_and_hostile_archives_stay_inside() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::create_dir_all(folder.join("shop")).unwrap();
    let mut catalogue = String::new();
    let mut piece = |i: usize, name: &str, model: &str| {
        let size = format!("width#{i}=40\ndepth#{i}=80\nheight#{i}=20\n");
        catalogue += &format!("id#{i}=shop#{i:02}\nname#{i}={name}\nmodel#{i}=/{model}\n{size}");
    };
    let mut files = Vec::new();
    let path = folder.join("one.obj");
    for (class, name) in ["Round table", "Sofa", "High cabinet", "Oak chair"].into_iter().enumerate() {
        for i in 10 * class..10 * class + 7 {
            let cube = softras::shapes::cube().unwrap();
            let shifted = cube.positions().iter().map(|[x, y, z]| [*x, y * (1.0 + i as f32), *z]).collect();
            softras_io::save(&softras::Mesh::new(shifted, cube.triangles().to_vec()).unwrap(), &path).unwrap();
            piece(i, name, &format!("{i}/one.obj"));
            files.push((format!("{i}/one.obj"), std::fs::read(&path).unwrap()));
        }
    }
    // One piece repeats the model of another, and the model of one is missing.
    piece(90, "Sofa", "0/one.obj");
    piece(91, "Sofa", "gone/one.obj");
    // A model outside of the archive, where there is such a file.
    piece(93, "Sofa", "../one.obj");
    files.push(("PluginFurnitureCatalog.properties".into(), catalogue.into_bytes()));
    archive(&folder.join("shop/shop.sh3f"), &files);
    let (_, told) = succeeds(folder, "data -o data --furniture shop");
    assert!(told.contains("left out: shop#91") && !told.contains("shop#90") && !told.contains("shop#93"), "{told}");
    for class in ["cabinet", "chair", "sofa", "table"] {
        assert!(told.contains(&format!("{class}: 1 objects for test")), "{told}");
    }
    let (table, _) = succeeds(folder, "evaluate data --views 1");
    assert!(table.contains("| method | cabinet | chair | sofa | table | mean |"));

    // A file beside a model whose name leads out.
    files.push(("0/../../../outside.txt".into(), b"outside".to_vec()));
    archive(&folder.join("shop/shop.sh3f"), &files);
    fails(folder, "data -o other --furniture shop", "leads out of the archive");
    assert!(!folder.join("outside.txt").exists());
    archive(&folder.join("shop/shop.sh3f"), &[("other.txt".into(), b"x".to_vec())]);
    fails(folder, "data -o other --furniture shop", "PluginFurnitureCatalog");
    std::fs::write(folder.join("shop/shop.sh3f"), b"PK").unwrap();
    fails(folder, "data -o other --furniture shop", "not an archive");
}

#[test]
fn meshes_of_a_folder_become_sets() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::create_dir(folder.join("meshes")).unwrap();
    for i in 0..10 {
        softras_io::save(&softras::shapes::cube().unwrap(), folder.join(format!("meshes/{i}.obj"))).unwrap();
    }
    std::fs::write(folder.join("meshes/broken.obj"), "f 1 2 3").unwrap();
    let (_, told) = succeeds(folder, "data -o data --class thing --meshes meshes");
    assert!(told.contains("left out") && told.contains("broken.obj"), "{told}");
    assert!(told.contains("thing: 1 objects for val") && told.contains("thing: 2 objects for test"), "{told}");
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
