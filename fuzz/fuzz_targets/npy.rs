//! Fuzzes the reader of numpy arrays with any bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;
use softras_io::npy;


fuzz_target!(|bytes: &[u8]| {
    if let Ok(array) = npy::read(bytes, |_| Ok(())) {
        let count = array.numbers().map(|numbers| numbers.iter().count());
        let count = count.or_else(|| array.texts().map(Iterator::count));
        assert_eq!(count, Some(array.len()));
    }
});
