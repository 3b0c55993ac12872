//! The device and program of a measurement, so that two runs can be compared.

use serde_json::{Value, json};
use softras::Renderer;
use std::path::Path;
use std::process::Command;

/// Device, driver and program of a run.
#[derive(Clone, Debug)]
pub struct Machine {
    pub device: String,
    pub kind: String,
    pub driver: String,
    pub version: &'static str,
    /// The commit of the checkout that contains the program, with a + if files were changed since; none for an installed
    /// program.
    pub commit: Option<String>,
    pub threads: usize,
}

impl Machine {
    /// Describes an open device.
    pub fn of(renderer: &Renderer) -> Self {
        let info = renderer.device_info();
        Self {
            device: info.name.clone(),
            kind: info.kind.to_string(),
            driver: format!("{} {}", info.driver, info.driver_version),
            version: env!("CARGO_PKG_VERSION"),
            commit: commit(),
            threads: std::thread::available_parallelism().map_or(1, usize::from),
        }
    }

    /// The fields that every row carries.
    pub fn json(&self) -> Value {
        json!({
            "device": self.device, "device_kind": self.kind, "driver": self.driver, "version": self.version,
            "commit": self.commit, "host_threads": self.threads,
        })
    }

    /// The lines above the table.
    pub fn lines(&self) -> [String; 2] {
        let commit = self.commit.as_ref().map(|c| format!(", commit {c}")).unwrap_or_default();
        [
            format!("{} ({}, {}), {} host threads", self.device, self.kind, self.driver, self.threads),
            format!("softras {}{commit}", self.version),
        ]
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
