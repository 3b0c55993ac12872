//! Checkpoints: the network, the optimiser and the curve in one archive, which is written whole or not at all.

use super::file_error;
use super::network::Network;
use super::train::{Config, Row};
use burn::module::Module;
use burn::optim::{ModuleOptimizer, OptimizerRecord};
use burn::store::{ModuleRecord, RecordError};
use burn::tensor::{Bytes, Device};
use serde::{Deserialize, Serialize};
use softras::internals::files;
use softras::{Error, Result};
use std::io::{Cursor, Read, Write};
use std::path::Path;

/// The most bytes of an entry: the official network with its optimiser takes a third of a gigabyte.
const MOST_BYTES: u64 = 1 << 32;

/// What a checkpoint says of itself.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Status {
    /// How the network is trained.
    pub config: Config,
    /// Steps taken.
    pub step: usize,
    /// The curve so far.
    pub curve: Vec<Row>,
    /// The least loss on validation pictures so far.
    pub best: Option<f32>,
}

/// Writes a checkpoint.
///
/// # Errors
/// [`Error::Io`]; the file is then as it was before.
pub fn write(path: &Path, status: &Status, network: &Network, optimizer: &ModuleOptimizer) -> Result<()> {
    let io = |e: &dyn std::fmt::Display| Error::Io { path: path.into(), source: std::io::Error::other(e.to_string()) };
    let record = |e: RecordError| io(&e);
    let status = serde_json::to_vec(status).map_err(|e| io(&e))?;
    // The latest update of the batch norms' running means is in the record only after `valid` has applied it.
    let network = network.valid().into_record().into_bytes().map_err(record)?;
    let optimizer = optimizer.into_bytes().map_err(record)?;
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for (name, bytes) in [("status.json", &status[..]), ("network", &network[..]), ("optimizer", &optimizer[..])] {
        zip.start_file(name, options).map_err(|e| io(&e))?;
        zip.write_all(bytes).map_err(|e| io(&e))?;
    }
    files::write_file(path, zip.finish().map_err(|e| io(&e))?.get_ref())
}

/// Reads a checkpoint. Without `resume` the optimiser is left as it is.
///
/// # Errors
/// [`Error::Io`]; [`Error::File`] for a file that is cut short, of another program, or with weights that are not finite.
pub fn read(
    path: &Path,
    device: &Device,
    resume: Option<ModuleOptimizer>,
) -> Result<(Status, Network, Option<ModuleOptimizer>)> {
    let fix = "give a checkpoint that `train` has written";
    let mut zip = zip::ZipArchive::new(std::io::BufReader::new(files::open(path)?))
        .or_else(|e| file_error(path, format!("not a checkpoint ({e})"), fix))?;
    let mut entry = |name: &str| {
        let mut bytes = Vec::new();
        let entry = zip.by_name(name).or_else(|e| file_error(path, format!("no {name} in it ({e})"), fix))?;
        let read = entry.take(MOST_BYTES).read_to_end(&mut bytes);
        read.or_else(|e| file_error(path, format!("its {name} is broken ({e})"), fix))?;
        Ok::<_, Error>(bytes)
    };
    let parsed = serde_json::from_slice(&entry("status.json")?);
    let status: Status = parsed.or_else(|e| file_error(path, format!("its status is broken ({e})"), fix))?;
    status.config.validate()?;
    let broken = |what: &str, e: RecordError| Error::File {
        path: path.into(),
        line: None,
        what: format!("its {what} does not fit ({e})"),
        fix: fix.into(),
    };
    let empty = Network::new(status.config.width, status.config.color > 0.0, status.config.seed, device)?;
    let record = ModuleRecord::from_bytes(Bytes::from_bytes_vec(entry("network")?));
    let network = record.and_then(|record| empty.try_load_record(record)).map_err(|e| broken("network", e))?;
    if !network.is_finite() {
        return file_error(path, "a weight of its network is not finite", "train anew, with a smaller rate");
    }
    let Some(optimizer) = resume else { return Ok((status, network, None)) };
    let record = OptimizerRecord::from_bytes(Bytes::from_bytes_vec(entry("optimizer")?));
    let optimizer = record.map(|record| optimizer.load_record(record)).map_err(|e| broken("optimizer", e))?;
    Ok((status, network, Some(optimizer)))
}
