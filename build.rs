//! Compiles `glsl/*.comp` to SPIR-V, reflects each module, and writes into OUT_DIR what the library includes:
//! `kernels.rs` (one `Kernel` for each file) and `constants.rs` (the constants both sides share).

#[path = "build/compile.rs"]
mod compile;
#[path = "build/constants.rs"]
mod constants;
#[path = "build/reflect.rs"]
mod reflect;

use reflect::{Member, Reflection};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

fn main() -> ExitCode {
    for watched in ["build.rs", "build", "glsl", "benches/naive"] {
        println!("cargo::rerun-if-changed={watched}");
    }
    println!("cargo::rerun-if-env-changed=VULKAN_SDK");
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

    let compiler = compile::Compiler::find()?;
    kernels(&compiler, Path::new("glsl"), &out, "kernels.rs")?;
    // What only the benches run; the library does not contain it.
    let benches = Path::new("benches/naive");
    if benches.is_dir() { kernels(&compiler, benches, &out, "bench_kernels.rs") } else { Ok(()) }
}

/// Compiles a folder's kernels and writes their statics into a file of Rust.
fn kernels(compiler: &compile::Compiler, folder: &Path, out: &Path, file: &str) -> Result<(), String> {
    let mut kernels = String::new();
    let mut names = Vec::new();
    for source in sources(folder)? {
        let name = source.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let spirv = out.join(format!("{name}.spv"));
        let compiled = compiler.compile(&source, Path::new("glsl"), &spirv)?;
        for line in &compiled.warnings {
            println!("cargo::warning={line}");
        }
        let bytes: Vec<u8> = compiled.words.iter().flat_map(|w| w.to_le_bytes()).collect();
        std::fs::write(&spirv, bytes).map_err(|e| format!("{}: {e}", spirv.display()))?;
        let reflection = reflect::reflect(&compiled.words).map_err(|e| format!("{}: {e}", source.display()))?;
        kernels.push_str(&kernel(&name, &source, compiled.words.len(), &reflection));
        names.push(name.to_uppercase());
    }
    let all: String = names.iter().map(|name| format!("&{name}, ")).collect();
    _ = writeln!(kernels, "/// Every kernel, by name.\npub static ALL: &[&Kernel] = &[{all}];");
    write(&out.join(file), &kernels)
}

fn read(path: &Path) -> Result<String, String> {
    std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    std::fs::write(path, text).map_err(|e| format!("{}: {e}", path.display()))
}

/// The kernels, sorted so that the output does not depend on the file system.
fn sources(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let entries = std::fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut found: Vec<PathBuf> =
        entries.flatten().map(|e| e.path()).filter(|p| p.extension().is_some_and(|e| e == "comp")).collect();
    found.sort();
    Ok(found)
}

/// A kernel's static as Rust source.
fn kernel(name: &str, source: &Path, words: usize, r: &Reflection) -> String {
    let push_bytes = r.push_members.iter().map(|m| m.offset + m.size).max().unwrap_or(0).next_multiple_of(4);
    let mut rust = format!("/// `{}`.\npub static {}: Kernel = {{\n", source.display(), name.to_uppercase());
    rust.push_str("let data = KernelData {\n");
    let spirv = format!("{{ static WORDS: [u32; {words}] = words(include_bytes!(\"{name}.spv\")); &WORDS }}");
    _ = writeln!(rust, "    name: {name:?},\n    spirv: {spirv},");
    _ = writeln!(rust, "    local_size: {:?},\n    local_size_ids: {:?},", r.local_size, r.local_size_ids);
    _ = writeln!(rust, "    capabilities: &{:?},\n    shared_bytes: {},", r.capabilities, r.shared_bytes);
    rust.push_str("    bindings: &[\n");
    for b in &r.bindings {
        let (name, kind) = (&b.name, b.kind);
        _ = writeln!(
            rust,
            "        Binding {{ name: {name:?}, binding: {}, kind: BindingKind::{kind}, readonly: {} }},",
            b.binding, b.readonly
        );
    }
    _ = writeln!(rust, "    ],\n    push_constant_bytes: {push_bytes},");
    _ = writeln!(rust, "    push_members: {},\n    specialization: &[", members(&r.push_members));
    for s in &r.specialization {
        let (name, id, default) = (&s.name, s.id, &s.default);
        _ = writeln!(rust, "        Specialization {{ name: {name:?}, id: {id}, default: SpecValue::{default} }},");
    }
    rust.push_str("    ],\n    structs: &[\n");
    for s in &r.structs {
        let (name, size, stride) = (&s.name, s.size, s.stride);
        let members = members(&s.members);
        _ = writeln!(rust, "        Struct {{ name: {name:?}, size: {size}, stride: {stride}, members: {members} }},");
    }
    rust.push_str("    ],\n};\n// SAFETY: the GLSL compiler wrote the SPIR-V, and build.rs read the other fields out of it.\n");
    rust.push_str("unsafe { Kernel::new(data) }\n};\n");
    rust
}

fn members(members: &[Member]) -> String {
    let mut rust = String::from("&[");
    for m in members {
        let (name, offset, size, stride) = (&m.name, m.offset, m.size, m.stride);
        _ = write!(rust, "Member {{ name: {name:?}, offset: {offset}, size: {size}, stride: {stride} }}, ");
    }
    rust.push(']');
    rust
}
