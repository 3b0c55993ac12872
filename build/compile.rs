//! GLSL to SPIR-V 1.3 for Vulkan 1.1: with an installed `glslc` or `glslangValidator`, or in process with the
//! `shaderc` crate (feature `shaderc`).

use std::path::Path;

/// A macro and its value.
pub type Macro = (&'static str, &'static str);

/// The SPIR-V and the warnings of one compiled kernel.
pub struct Compiled {
    pub words: Vec<u32>,
    /// Lines to show as warnings, each naming its file and line.
    pub warnings: Vec<String>,
}

/// The error if there is neither a compiler nor packaged SPIR-V.
pub const MISSING: &str = "no GLSL compiler found, and no compiled kernels in glsl/spirv.\n\
    Either install a compiler so that `glslc` or `glslangValidator` is on the PATH or in $VULKAN_SDK/bin \
    (Debian, Ubuntu: apt install glslang-tools; Fedora: dnf install glslang; macOS: brew install glslang; \
    Windows: the Vulkan SDK),\n\
    or build with `--features shaderc`, which compiles its own (needs cmake and a C++ compiler, takes minutes).";

/// A SPIR-V file as words. Files are little endian, which every glslang writes on our hosts.
pub fn words(bytes: &[u8]) -> Vec<u32> {
    bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

#[cfg(not(feature = "shaderc"))]
pub use installed::Compiler;

#[cfg(not(feature = "shaderc"))]
mod installed {
    use super::{Compiled, MISSING, Macro, Path, words};
    use std::path::PathBuf;
    use std::process::Command;

    /// An installed GLSL compiler.
    pub struct Compiler {
        program: PathBuf,
        is_glslc: bool,
    }

    impl Compiler {
        /// The first of `glslc`, `glslangValidator`, `glslang` in $VULKAN_SDK/bin, then on the PATH.
        pub fn find() -> Result<Self, String> {
            let sdk = std::env::var_os("VULKAN_SDK").map(PathBuf::from);
            let path = std::env::var_os("PATH").unwrap_or_default();
            let folders = sdk.iter().flat_map(|sdk| [sdk.join("bin"), sdk.join("Bin")]);
            for folder in folders.chain(std::env::split_paths(&path)) {
                for name in ["glslc", "glslangValidator", "glslang"] {
                    let program = folder.join(name).with_extension(std::env::consts::EXE_EXTENSION);
                    if program.is_file() {
                        return Ok(Self { program, is_glslc: name == "glslc" });
                    }
                }
            }
            Err(MISSING.to_string())
        }

        /// Its name and version, in one line.
        pub fn version(&self) -> Result<String, String> {
            let output = Command::new(&self.program).arg("--version").output();
            let output = output.map_err(|e| format!("{} does not start: {e}", self.program.display()))?;
            let text = String::from_utf8_lossy(&output.stdout).into_owned();
            // glslc names itself, SPIRV-Tools and glslang in a line each, glslang itself only in the first.
            let lines = if self.is_glslc { 3 } else { 1 };
            Ok(text.lines().take(lines).map(str::trim).collect::<Vec<_>>().join(", "))
        }

        /// Compiles `source`, a path relative to the package, with includes from `include`.
        pub fn compile(&self, source: &Path, macros: &[Macro], include: &Path, out: &Path) -> Result<Compiled, String> {
            let mut command = Command::new(&self.program);
            if self.is_glslc {
                command.args(["--target-env=vulkan1.1", "--target-spv=spv1.3", "-fshader-stage=compute", "-O0", "-I"]);
                command.arg(include);
            } else {
                command.args(["--target-env", "vulkan1.1", "--target-env", "spirv1.3", "-V", "-S", "comp", "--quiet"]);
                command.arg(format!("-I{}", include.display()));
            }
            command.args(macros.iter().map(|(name, value)| format!("-D{name}={value}")));
            let output = command.arg("-o").arg(out).arg(source).output();
            let output = output.map_err(|e| format!("{} does not start: {e}", self.program.display()))?;
            let text =
                [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
            let bare = |line: &&str| !line.trim().is_empty() && line.trim() != source.to_string_lossy();
            let lines: Vec<String> = text.lines().filter(bare).map(|line| line.replace("ERROR: ", "")).collect();
            if !output.status.success() {
                return Err(format!("{} does not compile:\n{}", source.display(), lines.join("\n")));
            }
            let bytes = std::fs::read(out).map_err(|e| format!("{}: {e}", out.display()))?;
            Ok(Compiled { words: words(&bytes), warnings: lines })
        }
    }
}

#[cfg(feature = "shaderc")]
pub use in_process::Compiler;

#[cfg(feature = "shaderc")]
mod in_process {
    use super::{Compiled, Macro, Path};
    use shaderc::{
        CompileOptions, EnvVersion, OptimizationLevel, ResolvedInclude, ShaderKind, SpirvVersion, TargetEnv,
    };

    /// The shaderc crate's own glslang.
    pub struct Compiler {
        shaderc: shaderc::Compiler,
    }

    impl Compiler {
        /// Starts shaderc.
        pub fn find() -> Result<Self, String> {
            let shaderc = shaderc::Compiler::new().map_err(|e| format!("shaderc does not start: {e}"))?;
            Ok(Self { shaderc })
        }

        /// Its name, in one line.
        pub fn version(&self) -> Result<String, String> {
            Ok("the shaderc crate".to_string())
        }

        /// Compiles `source`, a path relative to the package, with includes from `include`.
        pub fn compile(
            &self,
            source: &Path,
            macros: &[Macro],
            include: &Path,
            _out: &Path,
        ) -> Result<Compiled, String> {
            let name = source.display().to_string();
            let text = std::fs::read_to_string(source).map_err(|e| format!("{name}: {e}"))?;
            let mut options = CompileOptions::new().map_err(|e| format!("shaderc does not start: {e}"))?;
            options.set_target_env(TargetEnv::Vulkan, EnvVersion::Vulkan1_1 as u32);
            options.set_target_spirv(SpirvVersion::V1_3);
            // Reflection needs the names, which shaderc's optimiser strips.
            options.set_optimization_level(OptimizationLevel::Zero);
            for (name, value) in macros {
                options.add_macro_definition(name, Some(*value));
            }
            options.set_include_callback(move |wanted, _kind, from, _depth| {
                let beside = Path::new(from).parent().unwrap_or(Path::new("")).join(wanted);
                let path = if beside.is_file() { beside } else { include.join(wanted) };
                let content = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
                Ok(ResolvedInclude { resolved_name: path.display().to_string(), content })
            });
            let artifact = self
                .shaderc
                .compile_into_spirv(&text, ShaderKind::Compute, &name, "main", Some(&options))
                .map_err(|e| format!("{name} does not compile:\n{e}"))?;
            let warnings = artifact.get_warning_messages().lines().map(String::from).collect();
            Ok(Compiled { words: artifact.as_binary().to_vec(), warnings })
        }
    }
}
