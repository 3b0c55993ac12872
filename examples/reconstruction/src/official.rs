//! Networks of the official PyTorch code: the file `checkpoint_*.pth.tar` that its examples/recon/train.py writes.
//!
//! It holds the state of the class `Model` under the key `model`: the encoder's and the decoder's layers, and the template
//! that the decoder moves. The official objects are this crate's with x mirrored (see [`crate::camera`]), so the network read
//! here is the official one with the x of the template and of the centre negated.

use crate::network::Network;
use crate::template::Template;
use crate::{file_error, io_error, weights};
use burn::tensor::Device;
use pytorch_reader::{DType, PytorchReader};
use softras::{Mesh, Result};
use softras_io::input;
use std::path::Path;

/// The most bytes of a file: the official one with its optimiser takes some 300 MB.
const MOST_BYTES: u64 = 1 << 32;
const KEY: &str = "model";
const VERTICES: &str = "decoder.vertices_base";
const FACES: &str = "decoder.faces";
const FIX: &str = "give a checkpoint_*.pth.tar that the official examples/recon/train.py has written";

/// Whether a file is named as PyTorch's are.
pub fn is_named(path: &Path) -> bool {
    path.extension().is_some_and(|end| ["pth", "pt", "tar"].iter().any(|name| end.eq_ignore_ascii_case(name)))
}

/// Reads a network.
pub fn read(path: &Path, device: &Device) -> Result<Network> {
    let broken = |what: String| file_error(path, what, FIX);
    let size = input::open(path)?.metadata().map_err(|e| io_error(path, e))?.len();
    if size > MOST_BYTES {
        return Err(broken(format!("{size} bytes; at most {MOST_BYTES} are read")));
    }
    let reader = PytorchReader::with_top_level_key(path, KEY);
    let state = State(reader.map_err(|e| broken(format!("no PyTorch file with a `{KEY}` in it ({e})")))?);
    let width = state.0.get("encoder.conv1.weight").and_then(|weight| weight.shape().first().copied());
    let width = width.ok_or_else(|| broken("it has no encoder.conv1.weight".into()))?;
    let template = state.template().map_err(broken)??;
    let network = Network::of_template(width, None, Template::official(template), device)?;
    weights::load(network, &state, device).map_err(broken)
}

/// The weights of a file, which PyTorch calls a `state_dict`.
struct State(PytorchReader);

impl State {
    /// The values of a tensor, as single words in the file's order.
    fn words(&self, name: &str, dtypes: &[DType], shape: &[usize]) -> Result<Vec<[u8; 4]>, String> {
        let tensor = self.0.get(name).ok_or_else(|| format!("it has no {name}"))?;
        if !dtypes.contains(&tensor.dtype()) || tensor.shape() != shape {
            let found = format!("{:?} of shape {:?}", tensor.dtype(), tensor.shape());
            return Err(format!("{name} is {found}, the network has {:?} of shape {shape:?}", dtypes[0]));
        }
        let bytes = tensor.read().map_err(|e| format!("{name} cannot be read ({e})"))?;
        Ok(match tensor.dtype() {
            // Indices. One that exceeds 32 bits is too large for any mesh, and so is its replacement.
            DType::I64 => {
                let narrow = |bytes: &[u8; 8]| u32::try_from(i64::from_le_bytes(*bytes)).unwrap_or(u32::MAX);
                bytes.as_chunks().0.iter().map(|bytes| narrow(bytes).to_le_bytes()).collect()
            }
            _ => bytes.as_chunks().0.to_vec(),
        })
    }

    fn floats(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, String> {
        Ok(self.words(name, &[DType::F32], shape)?.into_iter().map(f32::from_le_bytes).collect())
    }

    /// The template with its x negated. The inner error is one of the mesh, the outer one of the file.
    fn template(&self) -> Result<Result<Mesh>, String> {
        let rows = |name: &str| match self.0.get(name).map(pytorch_reader::Tensor::shape) {
            Some([rows, 3]) => Ok(*rows),
            _ => Err(format!("it has no {name} of three columns")),
        };
        let positions = self.floats(VERTICES, &[rows(VERTICES)?, 3])?;
        let faces = self.words(FACES, &[DType::I32, DType::I64], &[rows(FACES)?, 3])?;
        let positions = positions.as_chunks().0.iter().map(|&[x, y, z]| [-x, y, z]).collect();
        let faces: Vec<u32> = faces.into_iter().map(u32::from_le_bytes).collect();
        Ok(Mesh::new(positions, faces.as_chunks().0.iter().map(|&[a, b, c]| [a, c, b]).collect()))
    }
}

/// The official name of a weight.
fn official_name(name: &str) -> Option<String> {
    let parts: Vec<&str> = name.split('.').collect();
    let number = |text: &str| text.parse::<usize>().ok().map(|i| i + 1);
    Some(match parts[..] {
        ["trunk", "convolutions", i, field] => format!("encoder.conv{}.{field}", number(i)?),
        ["trunk", "norms", i, field] => {
            let field = match field {
                "gamma" => "weight",
                "beta" => "bias",
                running => running,
            };
            format!("encoder.bn{}.{field}", number(i)?)
        }
        ["trunk", "layers", i, field] => match number(i)? {
            i @ 1..=3 => format!("encoder.fc{i}.{field}"),
            i => format!("decoder.fc{}.{field}", i - 3),
        },
        ["center", field] => format!("decoder.fc_centroid.{field}"),
        ["offsets", field] => format!("decoder.fc_bias.{field}"),
        _ => return None,
    })
}

impl weights::Source for State {
    fn values(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, String> {
        let official = official_name(name).ok_or_else(|| format!("no official network has {name}"))?;
        // PyTorch's full layers have a row for each output, burn's a column.
        let mut values = match *shape {
            [inputs, outputs] => {
                let rows = self.floats(&official, &[outputs, inputs])?;
                (0..inputs * outputs).map(|i| rows[i % outputs * inputs + i / outputs]).collect()
            }
            _ => self.floats(&official, shape)?,
        };
        if name.starts_with("center.") {
            values.iter_mut().step_by(3).for_each(|x| *x = -*x);
        }
        Ok(values)
    }
}

#[cfg(test)]
mod tests;
