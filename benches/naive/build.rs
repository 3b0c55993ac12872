//! Compiles the baseline's kernel and writes its static into OUT_DIR, with what the library's build script does so with.
#![allow(dead_code)]

#[path = "../../build/compile.rs"]
mod compile;
#[path = "../../build/emit.rs"]
mod emit;
#[path = "../../build/module.rs"]
mod module;
#[path = "../../build/reflect.rs"]
mod reflect;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

fn main() -> ExitCode {
    for watched in ["build.rs", "../../build", "naive.comp"] {
        println!("cargo::rerun-if-changed={watched}");
    }
    let Err(message) = run() else { return ExitCode::SUCCESS };
    for line in message.lines() {
        println!("cargo::error={line}");
    }
    ExitCode::FAILURE
}

fn run() -> Result<(), String> {
    let out = PathBuf::from(std::env::var_os("OUT_DIR").ok_or("OUT_DIR is not set: build with cargo")?);
    let (source, spirv) = (Path::new("naive.comp"), out.join("naive.spv"));
    let compiled = compile::Compiler::find()?.compile(source, &[], Path::new("../../glsl"), &spirv)?;
    let reflection = reflect::reflect(&compiled.words)?;
    let bytes: Vec<u8> = compiled.words.iter().flat_map(|word| word.to_le_bytes()).collect();
    std::fs::write(&spirv, bytes).map_err(|e| format!("{}: {e}", spirv.display()))?;
    let rust = emit::kernel("naive", source, compiled.words.len(), &reflection);
    std::fs::write(out.join("kernel.rs"), rust).map_err(|e| format!("kernel.rs: {e}"))
}
