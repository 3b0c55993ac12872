//! Fuzzes the reader of MTL files with any bytes.
#![no_main]

mod folder;

use libfuzzer_sys::fuzz_target;

const MESH: &[u8] = b"mtllib mesh.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n";

fuzz_target!(|bytes: &[u8]| {
    folder::file("mesh.mtl", bytes);
    let _ = softras_io::load_with(&folder::file("mesh.obj", MESH), &Default::default());
});
