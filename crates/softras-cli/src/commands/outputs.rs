//! Keeps commands from overwriting what they read.

use super::Failure;
use softras_io::output;
use std::path::{Path, PathBuf};

/// The files that a command will write, known before it begins to work.
#[derive(Debug, Default)]
pub struct Outputs(Vec<Written>);

#[derive(Debug)]
struct Written {
    /// The path as the user gave it.
    given: PathBuf,
    /// Its place on the disk, whatever links lead there.
    real: PathBuf,
    /// Whether it is a mesh, which is written with its materials and textures beside it.
    is_mesh: bool,
}

impl Written {
    /// Whether writing this may replace the file at a real path.
    fn replaces(&self, real: &Path) -> bool {
        self.real == real || (self.is_mesh && self.real.parent() == real.parent() && self.has_beside(real))
    }

    /// Whether a file in the mesh's folder has the name of its materials or of one of its textures.
    fn has_beside(&self, real: &Path) -> bool {
        let stem = self.real.file_stem().unwrap_or_default().to_string_lossy();
        let name = real.file_name().unwrap_or_default().to_string_lossy();
        let number = name.strip_prefix(&format!("{stem}_texture")).and_then(|rest| rest.strip_suffix(".png"));
        let is_number = |text: &str| text.strip_prefix('_').is_some_and(|n| n.chars().all(|c| c.is_ascii_digit()));
        name == format!("{stem}.mtl") || number.is_some_and(|number| number.is_empty() || is_number(number))
    }
}

impl Outputs {
    /// Checks that all of these can be written, and that no two are one file.
    pub fn new<'a>(
        files: impl IntoIterator<Item = &'a PathBuf>,
        mesh: impl IntoIterator<Item = &'a PathBuf>,
    ) -> Result<Self, Failure> {
        let files = files.into_iter().map(|path| (path, false));
        let mut all: Vec<Written> = Vec::new();
        for (path, is_mesh) in files.chain(mesh.into_iter().map(|path| (path, true))) {
            output::check_writable(path)?;
            let has = |ending: &&str| path.extension().is_some_and(|own| own.eq_ignore_ascii_case(ending));
            if is_mesh && !["obj", "ply", "glb"].iter().any(has) {
                let what = "not a name of a mesh file to write: give a name that ends in .obj, .ply or .glb";
                return Err(Failure::Usage(format!("{}: {what}", path.display())));
            }
            let one = Written { given: path.clone(), real: real(path), is_mesh };
            if all.iter().any(|other| other.replaces(&one.real) || one.replaces(&other.real)) {
                return Err(Failure::Usage(format!(
                    "{}: would be written twice: give each file a name of its own",
                    path.display()
                )));
            }
            all.push(one);
        }
        Ok(Self(all))
    }

    /// Refuses to go on where one of the files is an input as well.
    pub fn spare<P: AsRef<Path>>(&self, inputs: impl IntoIterator<Item = P>) -> Result<(), Failure> {
        for input in inputs {
            let input = input.as_ref();
            if let Some(output) = self.0.iter().find(|output| output.replaces(&real(input))) {
                let (output, input) = (output.given.display(), input.display());
                let what = format!("{output}: would overwrite {input}, which this command reads: give another name");
                return Err(Failure::Usage(what));
            }
        }
        Ok(())
    }
}

/// The path without links and `..`, of a file that may not exist yet.
fn real(path: &Path) -> PathBuf {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let of_folder = || folder.canonicalize().map(|folder| folder.join(path.file_name().unwrap_or_default()));
    path.canonicalize().or_else(|_| of_folder()).unwrap_or_else(|_| path.into())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_replaces_its_materials_and_textures_alone() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let outputs = Outputs::new([&at("a.json")], [&at("out.obj")]).unwrap();
        for name in ["a.json", "out.obj", "out.mtl", "out_texture.png", "out_texture_12.png"] {
            assert!(outputs.spare([at(name)]).is_err(), "{name}");
        }
        for name in ["b.json", "out.png", "out_texture_x.png", "out_texture.jpg", "sub/out.mtl"] {
            assert!(outputs.spare([at(name)]).is_ok(), "{name}");
        }
        assert!(Outputs::new([&at("a.png"), &at("./a.png")], []).is_err());
        assert!(Outputs::new([&at("a_texture.png")], [&at("a.obj")]).is_err());
        assert!(Outputs::new([], [&at("a.OBJ")]).is_ok() && Outputs::new([], [&at("a.glb")]).is_ok());
        for name in ["a.stl", "a.obj.png", "obj"] {
            assert!(Outputs::new([], [&at(name)]).is_err(), "{name}");
        }
    }
}
