//! The SPIR-V in `glsl/spirv`, with which the library builds where no GLSL compiler is installed.
//!
//! The folder has one `.spv` for each kernel and `MANIFEST`: a hash of what they were compiled from, and the compiler.
//! `SOFTRAS_SPIRV=write cargo check` writes it, `SOFTRAS_SPIRV=check` compares it with what the installed compiler makes.

use super::{read, write};
use std::path::{Path, PathBuf};

const FOLDER: &str = "glsl/spirv";

/// The content of `MANIFEST`.
pub struct Manifest {
    /// The hash of the sources.
    sources: String,
    /// The compiler's name and version.
    compiler: String,
}

impl Manifest {
    /// The manifest of today's sources, compiled by `compiler`.
    pub fn of(compiler: &str) -> Result<Self, String> {
        Ok(Self { sources: hash_of_sources()?, compiler: compiler.to_string() })
    }

    /// Reads it; `None` if the folder does not exist.
    pub fn read() -> Result<Option<Self>, String> {
        let path = Path::new(FOLDER).join("MANIFEST");
        if !path.is_file() {
            return Ok(None);
        }
        let text = read(&path)?;
        let field = |name: &str| {
            let value = text.lines().find_map(|line| line.strip_prefix(name));
            value.map(|value| value.trim().to_string()).ok_or(format!("{}: no line `{name}`", path.display()))
        };
        Ok(Some(Self { sources: field("sources ")?, compiler: field("compiler ")? }))
    }

    pub fn write(&self) -> Result<(), String> {
        let Self { sources, compiler } = self;
        let text = format!("Written by `SOFTRAS_SPIRV=write cargo check`.\nsources {sources}\ncompiler {compiler}\n");
        write(&Path::new(FOLDER).join("MANIFEST"), &text)
    }

    /// An error where the GLSL has changed since.
    pub fn validate_sources(&self) -> Result<(), String> {
        if self.sources == hash_of_sources()? {
            return Ok(());
        }
        Err(format!("{FOLDER} is stale: the files of glsl/ have changed since it was compiled.\n{REWRITE}"))
    }

    /// Whether the same compiler wrote both, so that the same sources give the same bytes.
    pub fn same_compiler(&self, other: &Self) -> bool {
        self.compiler == other.compiler
    }

    /// The compiler.
    pub fn compiler(&self) -> &str {
        &self.compiler
    }
}

/// How to bring the folder up to date.
pub const REWRITE: &str =
    "Run `SOFTRAS_SPIRV=write cargo check` with a GLSL compiler installed, and commit glsl/spirv.";

/// A kernel's file in the folder.
pub fn path(kernel: &str) -> PathBuf {
    Path::new(FOLDER).join(format!("{kernel}.spv"))
}

/// Empties the folder, so that no kernel stays that has no source any more.
pub fn clear() -> Result<(), String> {
    let failed = |e: std::io::Error| format!("{FOLDER}: {e}");
    if Path::new(FOLDER).is_dir() {
        std::fs::remove_dir_all(FOLDER).map_err(failed)?;
    }
    std::fs::create_dir_all(FOLDER).map_err(failed)
}

/// The FNV-1a hash of every GLSL file and of the table of variants, each with its path, whatever the line endings.
fn hash_of_sources() -> Result<String, String> {
    // The macros of the variants decide the SPIR-V too.
    let mut files = vec![PathBuf::from("build/variants.rs")];
    collect(Path::new("glsl"), &mut files)?;
    files.sort();
    let mut hash = 0xcbf2_9ce4_8422_2325u64;
    for file in files {
        let path = file.to_string_lossy().replace('\\', "/");
        let text = read(&file)?.replace('\r', "");
        for byte in path.bytes().chain([0]).chain(text.bytes()).chain([0]) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    Ok(format!("{hash:016x}"))
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> Result<(), String> {
    let entries = std::fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    for path in entries.flatten().map(|entry| entry.path()) {
        if path.is_dir() {
            collect(&path, files)?;
        } else if path.extension().is_some_and(|e| e == "comp" || e == "glsl") {
            files.push(path);
        }
    }
    Ok(())
}
