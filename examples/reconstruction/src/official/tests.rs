//! Networks of the official PyTorch code, in files that this test writes as `torch.save` does.
#![allow(clippy::unwrap_used)]

use super::{is_named, read};
use crate::network::meshes;
use burn::tensor::Device;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

/// A tensor's shape and values.
type Weight = (Vec<usize>, Vec<f32>);

/// A state of the official `Model` whose first convolution has one channel. Its codes are the same for every picture.
struct State {
    weights: BTreeMap<String, Weight>,
    faces: Vec<[i32; 3]>,
}

const VERTICES: [[f32; 3]; 6] =
    [[1.0, 0.0, 0.0], [-0.9, 0.1, 0.2], [0.1, 0.8, 0.0], [0.0, -1.0, 0.3], [0.2, 0.1, 0.7], [-0.1, 0.3, -1.0]];

fn state() -> State {
    let mut weights = BTreeMap::new();
    let mut add = |name: &str, shape: &[usize], value: &dyn Fn(usize) -> f32| {
        let count = shape.iter().product();
        weights.insert(name.to_string(), (shape.to_vec(), (0..count).map(value).collect::<Vec<f32>>()));
    };
    let wave = |i: usize| ((i * 37 + 11) % 101) as f32 / 101.0 - 0.5;
    for (i, [from, to]) in [[4, 1], [1, 2], [2, 4]].into_iter().enumerate() {
        add(&format!("encoder.conv{}.weight", i + 1), &[to, from, 5, 5], &wave);
        add(&format!("encoder.conv{}.bias", i + 1), &[to], &wave);
        for (field, value) in [("weight", 1.5), ("bias", 0.25), ("running_mean", 0.1), ("running_var", 0.8)] {
            add(&format!("encoder.bn{}.{field}", i + 1), &[to], &|_| value);
        }
    }
    let layers = [("encoder.fc1", 256, 16), ("encoder.fc2", 16, 16), ("encoder.fc3", 16, 8), ("decoder.fc1", 8, 16)];
    for (name, from, to) in layers {
        add(&format!("{name}.weight"), &[to, from], &wave);
        add(&format!("{name}.bias"), &[to], &wave);
    }
    add("decoder.fc2.weight", &[32, 16], &|_| 0.0);
    add("decoder.fc2.bias", &[32], &|i| 2.0 * wave(i));
    for (name, to) in [("decoder.fc_centroid", 3), ("decoder.fc_bias", 3 * VERTICES.len())] {
        add(&format!("{name}.weight"), &[to, 32], &|i| wave(i * i + to));
        add(&format!("{name}.bias"), &[to], &wave);
    }
    add("decoder.vertices_base", &[VERTICES.len(), 3], &|i| VERTICES[i / 3][i % 3]);
    let faces = vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    State { weights, faces }
}

/// The vertices that the official decoder computes from the state's one code: its formulas with single numbers.
fn official_vertices(state: &State) -> Vec<[f64; 3]> {
    let values = |name: &str| state.weights[name].1.iter().map(|x| f64::from(*x)).collect::<Vec<f64>>();
    let code: Vec<f64> = values("decoder.fc2.bias").iter().map(|x| x.max(0.0)).collect();
    let layer = |name: &str| -> Vec<f64> {
        let (rows, bias) = (values(&format!("{name}.weight")), values(&format!("{name}.bias")));
        rows.chunks(32)
            .zip(bias)
            .map(|(row, bias)| row.iter().zip(&code).map(|(w, c)| w * c).sum::<f64>() + bias)
            .collect()
    };
    let center: Vec<f64> = layer("decoder.fc_centroid").iter().map(|x| (0.1 * x).tanh()).collect();
    let offsets = layer("decoder.fc_bias");
    let coordinate = |i: usize, k: usize| {
        let base = 0.5 * f64::from(VERTICES[i][k]);
        let odds = base.abs() / (1.0 - base.abs()) * offsets[3 * i + k].exp();
        let around = if base == 0.0 { 0.0 } else { base.signum() * odds / (1.0 + odds) };
        let room = if around > 0.0 { 1.0 - center[k] } else { 1.0 + center[k] };
        0.5 * (around * room + center[k])
    };
    (0..VERTICES.len()).map(|i| [0, 1, 2].map(|k| coordinate(i, k))).collect()
}

/// Writes a file as `torch.save({'model': state_dict})` does.
fn write(path: &Path, state: &State) {
    let mut zip = zip::ZipWriter::new(std::fs::File::create(path).unwrap());
    let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    let (mut pickle, mut storages) = (b"\x80\x02}".to_vec(), Vec::new());
    text(&mut pickle, "model");
    pickle.extend(b"}(");
    for (name, (shape, values)) in &state.weights {
        text(&mut pickle, name);
        tensor(&mut pickle, "FloatStorage", storages.len(), shape);
        storages.push(values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>());
    }
    text(&mut pickle, "decoder.faces");
    tensor(&mut pickle, "IntStorage", storages.len(), &[state.faces.len(), 3]);
    storages.push(state.faces.as_flattened().iter().flat_map(|i| i.to_le_bytes()).collect());
    pickle.extend(b"us.");
    zip.start_file("checkpoint/data.pkl", options).unwrap();
    zip.write_all(&pickle).unwrap();
    for (i, storage) in storages.iter().enumerate() {
        zip.start_file(format!("checkpoint/data/{i}"), options).unwrap();
        zip.write_all(storage).unwrap();
    }
    zip.start_file("checkpoint/version", options).unwrap();
    zip.write_all(b"3\n").unwrap();
    zip.finish().unwrap();
}

fn text(pickle: &mut Vec<u8>, text: &str) {
    pickle.push(b'X');
    pickle.extend((text.len() as u32).to_le_bytes());
    pickle.extend(text.as_bytes());
}

fn integers(pickle: &mut Vec<u8>, values: impl Iterator<Item = usize>) {
    pickle.push(b'(');
    for value in values {
        pickle.push(b'J');
        pickle.extend((value as u32).to_le_bytes());
    }
    pickle.push(b't');
}

fn tensor(pickle: &mut Vec<u8>, storage: &str, number: usize, shape: &[usize]) {
    pickle.extend(b"ctorch._utils\n_rebuild_tensor_v2\n((");
    text(pickle, "storage");
    pickle.extend(format!("ctorch\n{storage}\n").as_bytes());
    text(pickle, &number.to_string());
    text(pickle, "cpu");
    pickle.push(b'J');
    pickle.extend((shape.iter().product::<usize>() as u32).to_le_bytes());
    pickle.extend(b"tQK\x00");
    integers(pickle, shape.iter().copied());
    integers(pickle, (0..shape.len()).map(|axis| shape[axis + 1..].iter().product()));
    pickle.extend(b"\x89ccollections\nOrderedDict\n)RtR");
}

fn read_state(state: &State) -> Result<softras::Mesh, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint_0250000.pth.tar");
    write(&path, state);
    let device = Device::flex();
    let network = read(&path, &device).map_err(|e| e.to_string())?;
    Ok(meshes(&network, &[&vec![100; 4 * 64 * 64]], &device).unwrap().remove(0))
}

#[test]
fn an_official_network_gives_the_official_vertices_with_x_turned_over() {
    let state = state();
    let mesh = read_state(&state).unwrap();
    let expected = official_vertices(&state);
    let apart = |sign: f64| {
        let pairs = mesh.positions().iter().zip(&expected);
        let of = |(p, e): (&[f32; 3], &[f64; 3])| {
            (0..3).map(|k| (f64::from(p[k]) - if k == 0 { sign } else { 1.0 } * e[k]).abs()).fold(0.0, f64::max)
        };
        pairs.map(of).fold(0.0, f64::max)
    };
    assert!(apart(-1.0) < 1e-6, "{}", apart(-1.0));
    assert!(apart(1.0) > 0.1, "a mirrored network is not seen");
    let faces: Vec<[u32; 3]> = state.faces.iter().map(|f| [f[0], f[2], f[1]].map(|i| i as u32)).collect();
    assert_eq!(mesh.triangles(), faces);
}

#[test]
fn files_of_others_are_refused() {
    let refused = |change: &dyn Fn(&mut State)| {
        let mut state = state();
        change(&mut state);
        read_state(&state).unwrap_err()
    };
    let missing = refused(&|state| drop(state.weights.remove("encoder.fc2.bias")));
    assert!(missing.contains("it has no encoder.fc2.bias"), "{missing}");
    let no_template = refused(&|state| drop(state.weights.remove("decoder.vertices_base")));
    assert!(no_template.contains("decoder.vertices_base"), "{no_template}");
    let shape = refused(&|state| drop(state.weights.insert("decoder.fc1.bias".into(), (vec![3], vec![0.0; 3]))));
    assert!(shape.contains("decoder.fc1.bias is F32 of shape [3], the network has F32 of shape [16]"), "{shape}");
    let nan = refused(&|state| state.weights.get_mut("encoder.conv2.weight").unwrap().1[7] = f32::NAN);
    assert!(nan.contains("not finite"), "{nan}");
    for index in [6, -1] {
        let face = refused(&|state| state.faces[1][2] = index);
        assert!(face.contains("triangle 1"), "{face}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.pth");
    write(&path, &state());
    let bytes = std::fs::read(&path).unwrap();
    for length in [0, 1, 100, bytes.len() / 2, bytes.len() - 30] {
        std::fs::write(&path, &bytes[..length]).unwrap();
        assert!(read(&path, &Device::flex()).is_err(), "{length} of {} bytes", bytes.len());
    }
    assert!(is_named(&path) && is_named(Path::new("checkpoint_0250000.pth.tar")));
    assert!(!is_named(Path::new("best.safetensors")));
}
