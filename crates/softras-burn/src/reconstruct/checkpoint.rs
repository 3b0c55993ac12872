//! Checkpoints: a SafeTensors file, which is written whole or not at all.
//!
//! It holds the weights by name, the curve of the training as `training.curve` `[steps, 5]`, and the optimiser's state as burn
//! writes it in the bytes `training.optimizer`. Its metadata `softras` says how the network is trained and how far it is.

use super::config::{Config, Row};
use super::file_fault;
use super::model::Model;
use burn::module::Module;
use burn::optim::{ModuleOptimizer, OptimizerRecord};
use burn::tensor::{Bytes, Device};
use safetensors::{Dtype, SafeTensors, View};
use serde::{Deserialize, Serialize};
use softras::{Error, Result};
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

/// What a checkpoint says of itself.
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
///
/// # Errors
/// [`Error::Io`]; the file is then as it was before.
pub fn write(path: &Path, status: &Status, model: &Model, optimizer: &ModuleOptimizer) -> Result<()> {
    let io = |e: &dyn std::fmt::Display| Error::Io { path: path.into(), source: std::io::Error::other(e.to_string()) };
    let said = serde_json::to_string(status).map_err(|e| io(&e))?;
    let optimizer = optimizer.into_bytes().map_err(|e| io(&e))?.to_vec();
    let curve: Vec<f32> = status.curve.iter().flat_map(Row::losses).collect();
    // The latest update of the batch norms' running means is among the weights only after `valid` has applied it.
    let weights = model.valid().weights().into_iter();
    let tensors = weights.map(|weight| (weight.name, Stored::floats(weight.shape, &weight.values))).chain([
        (CURVE.into(), Stored::floats(vec![status.curve.len(), 5], &curve)),
        (OPTIMIZER.into(), Stored { dtype: Dtype::U8, shape: vec![optimizer.len()], bytes: optimizer }),
    ]);
    let metadata = HashMap::from([(METADATA.to_string(), said)]);
    output::write_file(path, &safetensors::serialize(tensors, Some(metadata)).map_err(|e| io(&e))?)
}

/// Reads a checkpoint. Without `resume` the optimiser is left as it is.
///
/// # Errors
/// [`Error::Io`]; [`Error::File`] for a file that is cut short, of another program, or with weights that are not finite.
pub fn read(
    path: &Path,
    device: &Device,
    resume: Option<ModuleOptimizer>,
) -> Result<(Status, Model, Option<ModuleOptimizer>)> {
    let bytes = input::read(path, MOST_BYTES)?;
    let broken = |what: String| file_fault(path, what, FIX);
    let foreign = |e| broken(format!("not a checkpoint ({e})"));
    let (_, header) = SafeTensors::read_metadata(&bytes).map_err(foreign)?;
    let file = SafeTensors::deserialize(&bytes).map_err(foreign)?;
    let said = header.metadata().as_ref().and_then(|metadata| metadata.get(METADATA));
    let said =
        said.ok_or_else(|| broken(format!("not a checkpoint of this program: no {METADATA} in its metadata")))?;
    let mut status: Status = serde_json::from_str(said).map_err(|e| broken(format!("its status is broken ({e})")))?;
    status.config.validate()?;
    status.curve = curve(&file, status.step).map_err(broken)?;
    let loaded = Model::load(&status.config, &file, device)?;
    let model = loaded.map_err(|what| broken(format!("its network does not fit: {what}")))?;
    let Some(optimizer) = resume else { return Ok((status, model, None)) };
    let state = file.tensor(OPTIMIZER).map_err(|e| broken(e.to_string()))?;
    let record = OptimizerRecord::from_bytes(Bytes::from_bytes_vec(state.data().to_vec()));
    let record = record.map_err(|e| broken(format!("its optimiser does not fit ({e})")))?;
    Ok((status, model, Some(optimizer.load_record(record))))
}

fn curve(file: &SafeTensors, steps: usize) -> Result<Vec<Row>, String> {
    let view = file.tensor(CURVE).map_err(|e| e.to_string())?;
    if view.dtype() != Dtype::F32 || view.shape() != [steps, 5] {
        return Err(format!("{CURVE} is {:?} of shape {:?} after {steps} steps", view.dtype(), view.shape()));
    }
    let floats: Vec<f32> = view.data().as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect();
    Ok(floats.as_chunks().0.iter().enumerate().map(|(i, &losses)| Row::new(i + 1, losses)).collect())
}
