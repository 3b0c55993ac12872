//! Checkpoints: a SafeTensors file, which is written whole or not at all.
//!
//! It holds the weights by name, the curve of the training as `training.curve` `[steps, 5]`, and the optimiser's state as burn
//! writes it in the bytes `training.optimizer`. Its metadata `softras` says how the network is trained and how far it is.

use crate::config::{Config, Row};
use crate::network::Network;
use crate::weights::{self, numbered};
use crate::{file_error, io_error};
use burn::module::Module;
use burn::optim::{ModuleOptimizer, OptimizerRecord};
use burn::tensor::{Bytes, Device};
use safetensors::{Dtype, SafeTensors, View};
use serde::{Deserialize, Serialize};
use softras::Result;
use softras_io::{input, output};
use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;

/// The most bytes of a file: the official network with its optimiser takes a third of a gigabyte.
const MOST_BYTES: u64 = 1 << 32;
const METADATA: &str = "softras";
const CURVE: &str = "training.curve";
const OPTIMIZER: &str = "training.optimizer";
const FIX: &str = "give a checkpoint that `train` has written";

/// The state of a training that a checkpoint records beside its weights.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Status {
    /// How the network is trained.
    pub config: Config,
    /// Steps taken.
    pub step: usize,
    /// The curve so far.
    #[serde(skip)]
    pub curve: Vec<Row>,
    /// The least loss on validation pictures so far.
    pub best: Option<f32>,
}

/// A tensor as the file holds it.
struct Stored {
    dtype: Dtype,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

impl Stored {
    fn floats(shape: Vec<usize>, values: &[f32]) -> Self {
        Self { dtype: Dtype::F32, shape, bytes: values.iter().flat_map(|x| x.to_le_bytes()).collect() }
    }
}

impl View for Stored {
    fn dtype(&self) -> Dtype {
        self.dtype
    }

    fn shape(&self) -> &[usize] {
        &self.shape
    }

    fn data(&self) -> Cow<'_, [u8]> {
        Cow::Borrowed(&self.bytes)
    }

    fn data_len(&self) -> usize {
        self.bytes.len()
    }
}

/// Writes a checkpoint.
pub fn write(path: &Path, status: &Status, network: &Network, optimizer: &ModuleOptimizer) -> Result<()> {
    let said = serde_json::to_string(status).map_err(|e| io_error(path, e))?;
    let optimizer = optimizer.into_bytes().map_err(|e| io_error(path, e.to_string()))?.to_vec();
    let curve: Vec<f32> = status.curve.iter().flat_map(|row| row.losses).collect();
    // The latest update of the batch norms' running means is among the weights only after `valid` has applied it.
    let weights = weights::list(&network.valid()).into_iter();
    let tensors = weights.map(|weight| (weight.name, Stored::floats(weight.shape, &weight.values))).chain([
        (CURVE.into(), Stored::floats(vec![status.curve.len(), 5], &curve)),
        (OPTIMIZER.into(), Stored { dtype: Dtype::U8, shape: vec![optimizer.len()], bytes: optimizer }),
    ]);
    let metadata = HashMap::from([(METADATA.to_string(), said)]);
    output::write_file(path, &safetensors::serialize(tensors, Some(metadata)).map_err(|e| io_error(path, e))?)
}

/// Reads a checkpoint. Without `resume` the optimiser is left as it is.
pub fn read(
    path: &Path,
    device: &Device,
    resume: Option<ModuleOptimizer>,
) -> Result<(Status, Network, Option<ModuleOptimizer>)> {
    let bytes = input::read(path, MOST_BYTES)?;
    let broken = |what: String| file_error(path, what, FIX);
    let foreign = |e| broken(format!("not a checkpoint ({e})"));
    let (_, header) = SafeTensors::read_metadata(&bytes).map_err(foreign)?;
    let file = SafeTensors::deserialize(&bytes).map_err(foreign)?;
    let said = header.metadata().as_ref().and_then(|metadata| metadata.get(METADATA));
    let said =
        said.ok_or_else(|| broken(format!("not a checkpoint of this program: no {METADATA} in its metadata")))?;
    let mut status: Status = serde_json::from_str(said).map_err(|e| broken(format!("its status is broken ({e})")))?;
    status.config.validate()?;
    status.curve = curve(&file, status.step).map_err(broken)?;
    // Random weights are drawn when they are first needed: only those that fit are allocated.
    let blank = Network::new(status.config.width, status.config.seen_colors(), device)?;
    let loaded = weights::load(blank, &file, device);
    let network = numbered(loaded.map_err(|what| broken(format!("its network does not fit: {what}")))?);
    let Some(optimizer) = resume else { return Ok((status, network, None)) };
    let state = file.tensor(OPTIMIZER).map_err(|e| broken(e.to_string()))?;
    let record = OptimizerRecord::from_bytes(Bytes::from_bytes_vec(state.data().to_vec()));
    let record = record.map_err(|e| broken(format!("its optimiser does not fit ({e})")))?;
    Ok((status, network, Some(optimizer.load_record(record))))
}

fn curve(file: &SafeTensors, steps: usize) -> Result<Vec<Row>, String> {
    let view = file.tensor(CURVE).map_err(|e| e.to_string())?;
    if view.dtype() != Dtype::F32 || view.shape() != [steps, 5] {
        return Err(format!("{CURVE} is {:?} of shape {:?} after {steps} steps", view.dtype(), view.shape()));
    }
    let floats: Vec<f32> = view.data().as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect();
    Ok(floats.as_chunks().0.iter().enumerate().map(|(i, &losses)| Row { step: i + 1, losses }).collect())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::config::tests::small;
    use crate::train::Trainer;
    use safetensors::tensor::TensorView;
    use softras::Renderer;
    use std::path::PathBuf;
    use tempfile::TempDir;

    /// A checkpoint of a new network.
    fn written() -> (TempDir, PathBuf, Vec<u8>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.safetensors");
        Trainer::new(small(), Renderer::new().unwrap()).unwrap().save(&path).unwrap();
        let whole = std::fs::read(&path).unwrap();
        (folder, path, whole)
    }

    #[test]
    fn checkpoints_that_are_broken_are_refused() {
        let (_folder, path, whole) = written();
        read(&path, &Device::flex(), None).unwrap();
        let refused = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            read(&path, &Device::flex(), None).err().unwrap().to_string()
        };
        for length in [0, 50, whole.len() / 2, whole.len() - 1] {
            assert!(refused(&whole[..length]).contains("a.safetensors"));
        }
        // A weight that is not finite, of another name or of another shape, in a file that is whole.
        let file = SafeTensors::deserialize(&whole).unwrap();
        let metadata = SafeTensors::read_metadata(&whole).unwrap().1.metadata().clone();
        let name = "center.weight";
        let changed = |named: &str, shape: &[usize], value: f32| {
            let bytes: Vec<u8> = std::iter::repeat_n(value.to_le_bytes(), shape.iter().product()).flatten().collect();
            let other = TensorView::new(Dtype::F32, shape.to_vec(), &bytes).unwrap();
            let tensors = file.tensors().into_iter().filter(|(other, _)| other != name);
            safetensors::serialize(tensors.chain([(named.to_string(), other)]), metadata.clone()).unwrap()
        };
        let shape = file.tensor(name).unwrap().shape().to_vec();
        assert!(refused(&changed(name, &shape, f32::NAN)).contains("center.weight is not finite"));
        assert!(refused(&changed(name, &[5, 3], 0.0)).contains("F32 of shape [5, 3]"));
        assert!(refused(&changed("middle.weight", &shape, 0.0)).contains("center.weight"));
        // The status that the file records must fit the tensors that it has.
        let saying = |from: &str, to: &str| {
            let said = metadata.clone().unwrap().into_iter().map(|(key, text)| {
                assert!(text.contains(from), "{text}");
                (key, text.replace(from, to))
            });
            refused(&safetensors::serialize(file.tensors(), Some(said.collect())).unwrap())
        };
        assert!(saying("\"palette\"", "\"vertices\"").contains("colors.weight"));
        let unknown = saying("\"palette\"", "\"rainbow\"");
        assert!(unknown.contains("its status is broken") && unknown.contains("rainbow"), "{unknown}");
        // A small file cannot ask for the memory of a large network.
        let start = std::time::Instant::now();
        assert!(saying("\"width\":2", "\"width\":256").contains("the network has F32 of shape"));
        assert!(start.elapsed() < std::time::Duration::from_secs(5));
        assert!(refused(&safetensors::serialize(file.tensors(), None).unwrap()).contains("no softras in its metadata"));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_checkpoint_that_cannot_be_written_is_an_error() {
        // Neither takes a file: the error says which.
        let trainer = Trainer::new(small(), Renderer::new().unwrap()).unwrap();
        for path in ["/dev/full", "/proc/softras.safetensors"] {
            let error = trainer.save(Path::new(path)).unwrap_err().to_string();
            assert!(error.contains(path), "{error}");
        }
    }
}
