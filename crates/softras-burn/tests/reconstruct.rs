//! Single-view reconstruction in small: data, training that resumes to the bit, and files that are not what they should be.
#![allow(clippy::unwrap_used)]

use burn::tensor::Device;
use softras::Renderer;
use softras_burn::reconstruct::config::{Coloring, Config, Hard, Row};
use softras_burn::reconstruct::data::{self, Set, Shard};
use softras_burn::reconstruct::model::Model;
use softras_burn::reconstruct::network::{Network, meshes};
use softras_burn::reconstruct::train::Trainer;
use softras_burn::reconstruct::{checkpoint, colors, evaluate, families, picture, synthesis};
use softras_fit::is_closed;
use std::path::Path;

fn config() -> Config {
    Config {
        width: 2,
        steps: 6,
        pairs: 2,
        shares: 1,
        rate: 1e-3,
        sigma: 1e-4,
        laplacian: 5e-3,
        flatten: 5e-4,
        color: 1.0,
        coloring: Coloring::Palette,
        hard: None,
        voxels: false,
        seed: 5,
    }
}

/// Two objects of two families.
fn small() -> Set {
    let names = ["sofa", "table"];
    let mut renderer = Renderer::new().unwrap();
    let mut object = |class: usize, seed| {
        let mesh = families::object(names[class], seed).unwrap().unwrap();
        synthesis::object(&mut renderer, class, mesh).unwrap()
    };
    let objects = [(0, 7), (0, 8), (1, 7), (1, 8)].map(|(class, seed)| object(class, seed)).to_vec();
    Set { classes: names.map(String::from).to_vec(), objects }
}

#[test]
fn families_are_closed_and_differ() {
    for name in families::NAMES {
        let draw = |seed| families::object(name, seed).unwrap().unwrap();
        assert_eq!(draw(3), draw(3));
        for seed in 0..20 {
            let mesh = draw(seed);
            assert!(is_closed(&mesh).unwrap(), "{name} {seed}");
            assert_ne!(mesh, draw(seed + 1), "{name} {seed}");
            let (low, high) = mesh.bounds().unwrap();
            let longest = (0..3).map(|k| high[k] - low[k]).fold(0.0, f32::max);
            assert!((f64::from(longest) - families::EXTENT).abs() < 1e-5, "{name} {seed}: {longest}");
        }
    }
    assert!(families::object("ship", 0).is_none());
}

#[test]
fn shards_are_the_set() {
    let folder = tempfile::tempdir().unwrap();
    let names = ["lamp".to_string(), "bed".to_string()];
    let mut renderer = Renderer::new().unwrap();
    let mut make = |to: &str, shard| {
        synthesis::families(&mut renderer, &folder.path().join(to), &names, [3, 1, 1], 9, shard, |_| {}).unwrap();
    };
    make("whole", Shard::WHOLE);
    (0..2).for_each(|index| make("parts", Shard { index, count: 2 }));
    let whole = data::read(&folder.path().join("whole"), "train", &[]).unwrap();
    let parts = data::read(&folder.path().join("parts"), "train", &names).unwrap();
    assert_eq!(whole.classes, ["bed", "lamp"]);
    assert_eq!((whole.objects.len(), parts.objects.len()), (6, 6));
    // Shards hold every second object.
    for (class, name) in names.iter().enumerate() {
        let of = |set: &Set, name: &str| {
            let class = set.classes.iter().position(|n| n == name).unwrap();
            set.objects.iter().filter(|o| o.class == class).cloned().collect::<Vec<_>>()
        };
        let (whole, parts) = (of(&whole, name), of(&parts, name));
        for (i, from) in [0, 2, 1].into_iter().enumerate() {
            assert_eq!(parts[i].pictures, whole[from].pictures, "{class} {i}");
            assert_eq!(parts[i].solid, whole[from].solid, "{class} {i}");
        }
    }
    let missing = data::read(&folder.path().join("whole"), "train", &["ship".into()]).unwrap_err().to_string();
    assert!(missing.contains("ship_train_images.npz") && missing.contains("no such file"), "{missing}");
    std::fs::remove_file(folder.path().join("parts/lamp_train_voxels_1_of_2.npz")).unwrap();
    assert!(data::read(&folder.path().join("parts"), "train", &[]).is_err());
    // Pictures of another size, and solids of another number of objects.
    let npz = |name: &str, shape: &[usize]| {
        let file = std::fs::File::create(folder.path().join("parts").join(name)).unwrap();
        let mut zip = zip::ZipWriter::new(file);
        zip.start_file("arr_0.npy", zip::write::SimpleFileOptions::default()).unwrap();
        let values = vec![0; shape.iter().product()];
        let array = softras_io::npy::write(shape, softras_io::npy::Data::U8(&values));
        std::io::Write::write_all(&mut zip, &array).unwrap();
        zip.finish().unwrap();
    };
    let refused = |images: &[usize]| {
        npz("lamp_val_images.npz", images);
        data::read(&folder.path().join("parts"), "val", &["lamp".into()]).unwrap_err().to_string()
    };
    npz("lamp_val_voxels.npz", &[1, 32, 32, 32]);
    let size = refused(&[1, 24, 4, 32, 32]);
    assert!(size.contains("lamp_val_images.npz") && size.contains("(objects, 24, 4, 64, 64)"), "{size}");
    let count = refused(&[2, 24, 4, 64, 64]);
    assert!(count.contains("lamp_val_voxels.npz") && count.contains("for 2 objects"), "{count}");
    // A file that is cut short.
    let path = folder.path().join("whole/lamp_train_images.npz");
    let bytes = std::fs::read(&path).unwrap();
    for length in [0, 100, bytes.len() / 2, bytes.len() - 1] {
        std::fs::write(&path, &bytes[..length]).unwrap();
        let error = data::read(&folder.path().join("whole"), "train", &[]).unwrap_err().to_string();
        assert!(error.contains("lamp_train_images.npz"), "{length}: {error}");
    }
}

/// Trains for so many steps more.
fn steps(trainer: &mut Trainer, set: &Set, count: usize) -> Vec<Row> {
    (0..count).map(|_| trainer.step(set).unwrap()).collect()
}

/// All weights of a network in training, through a checkpoint.
fn weights(trainer: &Trainer, path: &Path) -> Vec<f32> {
    trainer.save(path).unwrap();
    let weights = checkpoint::read(path, &Device::flex(), None).unwrap().1.weights();
    assert!(weights.len() > 20);
    weights.into_iter().flat_map(|weight| weight.values).collect()
}

#[test]
fn training_resumes_to_the_bit_and_learns() {
    let (set, folder) = (small(), tempfile::tempdir().unwrap());
    let mut whole = Trainer::new(config(), Renderer::new().unwrap()).unwrap();
    let curve = steps(&mut whole, &set, 6);
    assert!(whole.is_done());
    assert!(curve[5].loss < curve[0].loss, "{curve:?}");

    let mut part = Trainer::new(config(), Renderer::new().unwrap()).unwrap();
    let first = steps(&mut part, &set, 3);
    part.save(&folder.path().join("half")).unwrap();
    let mut resumed = Trainer::resume(&folder.path().join("half"), Renderer::new().unwrap()).unwrap();
    let second = steps(&mut resumed, &set, 3);
    assert_eq!([first, second].concat(), curve);
    assert_eq!(resumed.status().curve, curve);
    let path = folder.path().join("whole");
    assert_eq!(weights(&whole, &path), weights(&resumed, &path));
    let (loss, is_best) = resumed.validate(&set).unwrap();
    assert!(loss.is_finite() && is_best);
    // The seed decides the first weights.
    let first = |seed| weights(&Trainer::new(Config { seed, ..config() }, Renderer::new().unwrap()).unwrap(), &path);
    assert_eq!(first(5), first(5));
    assert_ne!(first(5), first(6));
}

#[test]
fn hard_images_and_silhouettes_alone_learn_as_well() {
    let set = small();
    for (hard, color) in [(Some(Hard::Edge), 1.0), (None, 0.0)] {
        let config = Config { hard, color, steps: 12, rate: 3e-3, ..config() };
        let mut trainer = Trainer::new(config, Renderer::new().unwrap()).unwrap();
        let curve = steps(&mut trainer, &set, 12);
        let mean = |rows: &[Row]| rows.iter().map(|row| row.silhouette).sum::<f32>() / rows.len() as f32;
        assert!(mean(&curve[9..]) < mean(&curve[..3]), "{hard:?} {color}: {curve:?}");
        assert_eq!(curve.iter().all(|row| row.color == 0.0), color == 0.0);
    }
}

#[test]
fn a_voxel_network_learns_solids_and_resumes() {
    let (set, folder) = (small(), tempfile::tempdir().unwrap());
    let config = Config { voxels: true, steps: 20, rate: 3e-3, width: 4, ..config() };
    let mut trainer = Trainer::new(config.clone(), Renderer::new().unwrap()).unwrap();
    let curve = steps(&mut trainer, &set, 20);
    assert!(curve[19].loss < 0.7 * curve[0].loss, "{curve:?}");
    let mut part = Trainer::new(config, Renderer::new().unwrap()).unwrap();
    steps(&mut part, &set, 7);
    part.save(&folder.path().join("part")).unwrap();
    let mut resumed = Trainer::resume(&folder.path().join("part"), Renderer::new().unwrap()).unwrap();
    assert_eq!(steps(&mut resumed, &set, 13), curve[7..]);
    let path = folder.path().join("whole");
    assert_eq!(weights(&trainer, &path), weights(&resumed, &path));
}

#[test]
fn the_table_has_every_row() {
    let (set, device) = (small(), Device::flex());
    let network = Network::new(2, Some(Coloring::Palette), &device).unwrap();
    let table = evaluate::table(&set, &set, &[("new".into(), Model::Mesh(network))], 2, &device).unwrap();
    let names: Vec<&str> = table.rows.iter().map(|row| row.name.as_str()).collect();
    assert_eq!(names.len(), 6, "{names:?}");
    // The test set is the training set here, so that the nearest training shape is the shape itself.
    for row in &table.rows {
        let (least, most) = match row.name.as_str() {
            "new" | "mean shape" | "mean shape of the family" => (0.05, 0.95),
            _ => (1.0, 1.0),
        };
        assert!((least..=most).contains(&row.mean()), "{}: {}", row.name, row.mean());
    }
    assert!(table.to_string().lines().count() == 8);
}

#[test]
fn the_table_of_colors_has_every_row() {
    let (set, device) = (small(), Device::flex());
    let network = |coloring| Model::Mesh(Network::new(2, coloring, &device).unwrap());
    let networks = [("new", network(Some(Coloring::Palette))), ("shape", network(None))];
    let networks = networks.map(|(name, network)| (name.to_string(), network));
    let table = colors::table(&mut Renderer::new().unwrap(), &set, &set, &networks, 2, &device).unwrap();
    let rows: Vec<(&str, f64)> = table.rows.iter().map(|row| (row.name.as_str(), row.mean())).collect();
    let names: Vec<&str> = rows.iter().map(|(name, _)| *name).collect();
    assert_eq!(names, ["mean colour of the picture", "retrieval by picture", "new"]);
    // The nearest training picture is the picture itself. A new palette gives colours of the picture, too.
    let [painted, nearest, new] = [0, 1, 2].map(|i| rows[i].1);
    assert!(nearest == 0.0 && painted > 0.01 && new > 0.01 && new < 2.0 * painted, "{rows:?}");
    assert!(colors::table(&mut Renderer::new().unwrap(), &set, &set, &[], 25, &device).is_err());
}

#[test]
fn checkpoints_that_are_broken_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.safetensors");
    Trainer::new(config(), Renderer::new().unwrap()).unwrap().save(&path).unwrap();
    let whole = std::fs::read(&path).unwrap();
    let refused = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        checkpoint::read(&path, &Device::flex(), None).err().unwrap().to_string()
    };
    for length in [0, 50, whole.len() / 2, whole.len() - 1] {
        assert!(refused(&whole[..length]).contains("a.safetensors"));
    }
    // A weight that is not finite, of another name or of another shape, in a file that is whole.
    let file = safetensors::SafeTensors::deserialize(&whole).unwrap();
    let metadata = safetensors::SafeTensors::read_metadata(&whole).unwrap().1.metadata().clone();
    let name = "center.weight";
    let changed = |named: &str, shape: &[usize], value: f32| {
        let bytes: Vec<u8> = std::iter::repeat_n(value.to_le_bytes(), shape.iter().product()).flatten().collect();
        let other = safetensors::tensor::TensorView::new(safetensors::Dtype::F32, shape.to_vec(), &bytes).unwrap();
        let tensors = file.tensors().into_iter().filter(|(other, _)| other != name);
        safetensors::serialize(tensors.chain([(named.to_string(), other)]), metadata.clone()).unwrap()
    };
    let shape = file.tensor(name).unwrap().shape().to_vec();
    assert!(refused(&changed(name, &shape, f32::NAN)).contains("center.weight is not finite"));
    assert!(refused(&changed(name, &[5, 3], 0.0)).contains("F32 of shape [5, 3]"));
    assert!(refused(&changed("middle.weight", &shape, 0.0)).contains("center.weight"));
    let foreign = safetensors::serialize(file.tensors(), None).unwrap();
    assert!(refused(&foreign).contains("no softras in its metadata"));
    std::fs::write(&path, changed(name, &shape, 0.0)).unwrap();
    checkpoint::read(&path, &Device::flex(), None).unwrap();
    // A small file cannot ask for the memory of a large network.
    let claim =
        metadata.map(|said| said.into_iter().map(|(k, v)| (k, v.replace("\"width\":2", "\"width\":256"))).collect());
    let large = safetensors::serialize(file.tensors(), claim).unwrap();
    let start = std::time::Instant::now();
    assert!(refused(&large).contains("the network has F32 of shape"));
    assert!(start.elapsed() < std::time::Duration::from_secs(5));
    assert!(Trainer::new(Config { width: 0, ..config() }, Renderer::new().unwrap()).is_err());
    assert!(Trainer::new(Config { rate: f64::NAN, ..config() }, Renderer::new().unwrap()).is_err());
}

#[test]
fn checkpoints_before_palettes_give_vertices_colors_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("before.safetensors");
    let config = Config { coloring: Coloring::Vertices, ..config() };
    let expected = weights(&Trainer::new(config, Renderer::new().unwrap()).unwrap(), &path);
    let whole = std::fs::read(&path).unwrap();
    let file = safetensors::SafeTensors::deserialize(&whole).unwrap();
    let said = safetensors::SafeTensors::read_metadata(&whole).unwrap().1.metadata().clone().unwrap();
    let write = |from: &str, to: &str| {
        let said = said.iter().map(|(key, text)| (key.clone(), text.replace(from, to))).collect();
        std::fs::write(&path, safetensors::serialize(file.tensors(), Some(said)).unwrap()).unwrap();
        checkpoint::read(&path, &Device::flex(), None)
    };
    let read = write("\"coloring\":\"vertices\",", "").unwrap();
    assert_eq!(read.0.config.coloring, Coloring::Vertices);
    assert_eq!(read.1.weights().into_iter().flat_map(|weight| weight.values).collect::<Vec<f32>>(), expected);
    // What it says must be what it has.
    let error = write("\"coloring\":\"vertices\"", "\"coloring\":\"palette\"").err().unwrap().to_string();
    assert!(error.contains("before.safetensors") && error.contains("palette.queries"), "{error}");
    let error = write("\"coloring\":\"vertices\"", "\"coloring\":\"rainbow\"").err().unwrap().to_string();
    assert!(error.contains("its status is broken") && error.contains("rainbow"), "{error}");
}

#[test]
fn pictures_go_in_and_out() {
    let (set, folder) = (small(), tempfile::tempdir().unwrap());
    let path = folder.path().join("picture.png");
    let given = set.objects[0].picture(4);
    picture::write(&path, given).unwrap();
    let read = picture::read(&path).unwrap();
    // Colours are kept apart from alpha in the file, which rounds them.
    let differ = read.iter().zip(given).filter(|(a, b)| a.abs_diff(**b) > 1).count();
    assert_eq!(differ, 0);
    let device = Device::flex();
    let network = Network::new(2, Some(Coloring::Palette), &device).unwrap();
    assert_eq!(meshes(&network, &[&read], &device).unwrap()[0].positions().len(), 642);

    let save = |image: image::DynamicImage| {
        image.save(&path).unwrap();
        picture::read(&path).unwrap_err().to_string()
    };
    assert!(save(image::DynamicImage::new_rgba8(65, 64)).contains("65 by 64"));
    assert!(save(image::DynamicImage::new_rgb8(64, 64)).contains("no alpha"));
    std::fs::write(&path, b"not a picture").unwrap();
    assert!(picture::read(&path).unwrap_err().to_string().contains("picture.png"));
}

#[cfg(target_os = "linux")]
#[test]
fn a_checkpoint_that_cannot_be_written_is_an_error() {
    // Neither takes a file: the error says which.
    let trainer = Trainer::new(config(), Renderer::new().unwrap()).unwrap();
    let error = trainer.save(Path::new("/dev/full")).unwrap_err().to_string();
    assert!(error.contains("/dev/full"), "{error}");
    let error = trainer.save(Path::new("/proc/softras.safetensors")).unwrap_err().to_string();
    assert!(error.contains("/proc/softras.safetensors"), "{error}");
}
