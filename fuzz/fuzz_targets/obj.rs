//! Fuzzes the reader of OBJ files with any bytes: the result is a mesh or an error, never a panic.
#![no_main]

mod folder;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let path = folder::file("mesh.obj", bytes);
    if let Ok(loaded) = softras_io::load_with(&path, &Default::default()) {
        let mesh = loaded.mesh;
        assert!(softras::Mesh::new(mesh.positions().to_vec(), mesh.triangles().to_vec()).is_ok());
    }
});
