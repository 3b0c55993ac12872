//! Compiles `glsl/*.comp` to SPIR-V, reflects each module, and writes into OUT_DIR what the library includes:
//! `kernels.rs` (one `Kernel` for each file, or for each of its variants) and `constants.rs` (the constants that both sides share).
//!
//! In a package, and without a GLSL compiler, it takes the SPIR-V of `glsl/spirv`. The variable SOFTRAS_SPIRV chooses otherwise: `write`
//! compiles and replaces that folder, `check` compiles and compares with it, `packaged` never compiles.

#[path = "build/compile.rs"]
mod compile;
#[path = "build/constants.rs"]
mod constants;
#[path = "build/emit.rs"]
mod emit;
#[path = "build/module.rs"]
mod module;
#[path = "build/packaged.rs"]
mod packaged;
#[path = "build/reflect.rs"]
mod reflect;
#[path = "build/variants.rs"]
mod variants;

use packaged::Manifest;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

fn main() -> ExitCode {
    for watched in ["build.rs", "build", "glsl"] {
        println!("cargo::rerun-if-changed={watched}");
    }
    for variable in ["VULKAN_SDK", "SOFTRAS_SPIRV"] {
        println!("cargo::rerun-if-env-changed={variable}");
    }
    let Err(message) = run() else { return ExitCode::SUCCESS };
    for line in message.lines() {
        println!("cargo::error={line}");
    }
    ExitCode::FAILURE
}

fn run() -> Result<(), String> {
    let out = PathBuf::from(std::env::var_os("OUT_DIR").ok_or("OUT_DIR is not set: build with cargo")?);
    let shared = Path::new("glsl/common/constants.glsl");
    let rust = constants::to_rust(&read(shared)?, &shared.display().to_string())?;
    write(&out.join("constants.rs"), &rust)?;

    let modules = match Source::choose()? {
        Source::Compiler(compiler, then) => {
            let modules = compile_all(&compiler, &out)?;
            match then {
                Then::Nothing => {}
                Then::Write => write_packaged(&compiler, &modules)?,
                Then::Check => check_packaged(&compiler, &modules)?,
            }
            modules
        }
        Source::Packaged => read_packaged()?,
    };
    let mut rust = String::new();
    for Module { name, source, words } in &modules {
        let reflection = reflect::reflect(words).map_err(|e| format!("{}: {e}", source.display()))?;
        let spirv = out.join(format!("{name}.spv"));
        std::fs::write(&spirv, bytes(words)).map_err(|e| format!("{}: {e}", spirv.display()))?;
        rust.push_str(&emit::kernel(name, source, words.len(), &reflection));
    }
    let all: String = modules.iter().map(|module| format!("&{}, ", module.name.to_uppercase())).collect();
    _ = writeln!(rust, "/// Every kernel, by name.\npub static ALL: &[&Kernel] = &[{all}];");
    write(&out.join("kernels.rs"), &rust)
}

/// Where the SPIR-V comes from.
enum Source {
    Compiler(compile::Compiler, Then),
    Packaged,
}

/// The use of compiled SPIR-V besides including it: none, to write it to `glsl/spirv`, or to compare it with that folder.
enum Then {
    Nothing,
    Write,
    Check,
}

impl Source {
    fn choose() -> Result<Self, String> {
        let asked = std::env::var("SOFTRAS_SPIRV").unwrap_or_default();
        // Cargo puts this file into packages, whose kernels are the same on every machine.
        let is_package = Path::new("Cargo.toml.orig").is_file();
        let then = match asked.as_str() {
            "" if is_package && cfg!(not(feature = "shaderc")) => return Ok(Self::Packaged),
            "" => Then::Nothing,
            "write" => Then::Write,
            "check" => Then::Check,
            "packaged" => return Ok(Self::Packaged),
            other => return Err(format!("SOFTRAS_SPIRV={other}: it is `write`, `check` or `packaged`")),
        };
        match (compile::Compiler::find(), then) {
            (Ok(compiler), then) => Ok(Self::Compiler(compiler, then)),
            (Err(_), Then::Nothing) if Manifest::read()?.is_some() => Ok(Self::Packaged),
            (Err(missing), _) => Err(missing),
        }
    }
}

/// One kernel as SPIR-V.
struct Module {
    name: String,
    source: PathBuf,
    words: Vec<u32>,
}

fn compile_all(compiler: &compile::Compiler, out: &Path) -> Result<Vec<Module>, String> {
    let compile = |(name, source, macros): Kernel| {
        let compiled = compiler.compile(&source, macros, Path::new("glsl"), &out.join(format!("{name}.spv")))?;
        for line in &compiled.warnings {
            println!("cargo::warning={line}");
        }
        Ok(Module { name, source, words: compiled.words })
    };
    sources()?.into_iter().map(compile).collect()
}

fn read_packaged() -> Result<Vec<Module>, String> {
    let manifest = Manifest::read()?.ok_or(compile::MISSING)?;
    manifest.validate_sources()?;
    let read = |(name, source, _): Kernel| {
        let path = packaged::path(&name);
        let bytes = std::fs::read(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(Module { name, source, words: compile::words(&bytes) })
    };
    sources()?.into_iter().map(read).collect()
}

fn write_packaged(compiler: &compile::Compiler, modules: &[Module]) -> Result<(), String> {
    packaged::clear()?;
    for module in modules {
        let path = packaged::path(&module.name);
        std::fs::write(&path, bytes(&module.words)).map_err(|e| format!("{}: {e}", path.display()))?;
    }
    Manifest::of(&compiler.version()?)?.write()
}

/// Compares with the packaged SPIR-V: byte for byte if the same compiler made both, else by the interfaces.
fn check_packaged(compiler: &compile::Compiler, modules: &[Module]) -> Result<(), String> {
    let current = Manifest::of(&compiler.version()?)?;
    let packaged = Manifest::read()?.ok_or(format!("there is no glsl/spirv. {}", packaged::REWRITE))?;
    packaged.validate_sources()?;
    let same_compiler = packaged.same_compiler(&current);
    for (module, other) in modules.iter().zip(read_packaged()?) {
        let interface = |words: &[u32]| reflect::reflect(words).map(|r| emit::kernel("", Path::new(""), 0, &r));
        let same = if same_compiler {
            module.words == other.words
        } else {
            interface(&module.words)? == interface(&other.words)?
        };
        if !same {
            let path = packaged::path(&module.name);
            return Err(format!("{} is not what glsl/ compiles to. {}", path.display(), packaged::REWRITE));
        }
    }
    if !same_compiler {
        let (theirs, ours) = (packaged.compiler(), current.compiler());
        println!(
            "cargo::warning=glsl/spirv was compared by sources and interfaces only: it is of {theirs}, here is {ours}"
        );
    }
    Ok(())
}

/// A kernel's name, file and macros.
type Kernel = (String, PathBuf, &'static [compile::Macro]);

/// Every kernel, sorted so that the output does not depend on the file system.
fn sources() -> Result<Vec<Kernel>, String> {
    let entries = std::fs::read_dir("glsl").map_err(|e| format!("glsl: {e}"))?;
    let files = entries.flatten().map(|e| e.path()).filter(|p| p.extension().is_some_and(|e| e == "comp"));
    let mut found = Vec::new();
    for path in files {
        let file = path.file_stem().unwrap_or_default().to_string_lossy();
        for (suffix, macros) in variants::variants_of(&file) {
            found.push((format!("{file}{suffix}"), path.clone(), *macros));
        }
    }
    found.sort();
    Ok(found)
}

/// Words as a file has them.
fn bytes(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

fn read(path: &Path) -> Result<String, String> {
    std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    std::fs::write(path, text).map_err(|e| format!("{}: {e}", path.display()))
}
