//! Compiles the engine's shaders to SPIR-V with the installed glslangValidator, glslang or glslc.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

fn main() -> ExitCode {
    println!("cargo::rerun-if-changed=shaders");
    println!("cargo::rerun-if-env-changed=VULKAN_SDK");
    let Err(message) = run() else { return ExitCode::SUCCESS };
    for line in message.lines() {
        println!("cargo::error={line}");
    }
    ExitCode::FAILURE
}

fn run() -> Result<(), String> {
    let out = PathBuf::from(std::env::var_os("OUT_DIR").ok_or("OUT_DIR is not set: build with cargo")?);
    let folder = std::fs::read_dir("shaders").map_err(|e| format!("shaders: {e}"))?;
    for source in folder.flatten().map(|entry| entry.path()) {
        let name = source.file_name().unwrap_or_default().to_string_lossy().into_owned();
        compile(&source, &out.join(format!("{name}.spv")))?;
    }
    Ok(())
}

fn compile(source: &Path, out: &Path) -> Result<(), String> {
    let sdk = std::env::var_os("VULKAN_SDK").map(|sdk| PathBuf::from(sdk).join("bin"));
    for name in ["glslangValidator", "glslang", "glslc"] {
        let mut command = Command::new(sdk.as_ref().map_or_else(|| name.into(), |folder| folder.join(name)));
        match name {
            "glslc" => command.arg("--target-env=vulkan1.1"),
            _ => command.args(["--target-env", "vulkan1.1", "-V", "--quiet"]),
        };
        let Ok(output) = command.arg("-o").arg(out).arg(source).output() else { continue };
        if output.status.success() {
            return Ok(());
        }
        let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
        return Err(format!("{} does not compile:\n{text}", source.display()));
    }
    Err("no GLSL compiler found: install glslang (Debian, Ubuntu: apt install glslang-tools)".into())
}
