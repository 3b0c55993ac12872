//! Fuzzes the reader of numpy arrays with any bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;

#[allow(dead_code)] // Parts that only the command uses.
#[path = "../../crates/softras-cli/src/commands/npz/npy.rs"]
mod npy;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(array) = npy::read(bytes) {
        let count: usize = array.shape.iter().product();
        assert!(matches!(&array.values, npy::Values::Numbers(v) if v.len() == count)
            || matches!(&array.values, npy::Values::Texts(v) if v.len() == count));
    }
});
