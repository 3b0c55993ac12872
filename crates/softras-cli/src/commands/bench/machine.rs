//! The device and program of a measurement, so that two runs can be compared.

use serde_json::{Value, json};
use softras::Renderer;
use std::path::Path;
use std::process::Command;

/// Device, driver and program of a run.
#[derive(Clone, Debug)]
pub struct Machine {
    pub device: String,
    /// The lines above the table.
    pub lines: [String; 2],
    /// The fields that every row carries.
    pub json: Value,
}

impl Machine {
    /// Describes an open device.
    pub fn of(renderer: &Renderer) -> Self {
        let (info, version, commit) = (renderer.device_info(), env!("CARGO_PKG_VERSION"), commit());
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let (device, kind, driver) =
            (&info.name, info.kind.to_string(), format!("{} {}", info.driver, info.driver_version));
        let json = json!({
            "device": device, "device_kind": kind, "driver": driver, "version": version, "commit": commit,
            "host_threads": threads,
        });
        // That of the checkout that contains the program, with a + if files were changed since.
        let commit = commit.map(|c| format!(", commit {c}")).unwrap_or_default();
        let lines =
            [format!("{device} ({kind}, {driver}), {threads} host threads"), format!("softras {version}{commit}")];
        Self { device: device.clone(), lines, json }
    }
}

/// The checkout's commit, if the program lies in a checkout and git is installed.
fn commit() -> Option<String> {
    let program = std::env::current_exe().ok()?;
    let root = program.ancestors().find(|folder| is_ours(folder))?;
    let git = |arguments: &[&str]| {
        let output = Command::new("git").arg("-C").arg(root).args(arguments).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_string())
    };
    let commit = git(&["rev-parse", "--short=12", "HEAD"])?;
    let changed = git(&["status", "--porcelain", "--untracked-files=no"]).is_some_and(|changes| !changes.is_empty());
    Some(commit + if changed { "+" } else { "" })
}

fn is_ours(folder: &Path) -> bool {
    let manifest = std::fs::read_to_string(folder.join("Cargo.toml"));
    manifest.is_ok_and(|text| text.lines().any(|line| line.trim() == "name = \"softras\""))
}
