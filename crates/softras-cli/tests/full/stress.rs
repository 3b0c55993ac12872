//! Tests of `softras stress`.

use crate::command::{fails, succeeds};

/// The short form of what `--load 72000 --jobs 12 --renderers 6` does at length: renderers of several threads give the same
/// bits frame by frame, memory stays as it is once all kernels are compiled, and it ends.
#[test]
fn threads_with_several_renderers_each_give_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let load = ["stress", "--cases", "0", "--load", "600", "--jobs", "5", "--renderers", "2"];
    let told = succeeds(folder.path(), &load);
    for part in ["600 frames of 5 threads with 2 renderers each", "the same bits", "12 frames of each", ": flat"] {
        assert!(told.contains(part), "no {part:?} in {told}");
    }
    fails(folder.path(), &["stress", "--cases", "0", "--renderers", "2"], 2, &["--load"]);
    // A test of nothing is not passed.
    fails(folder.path(), &["stress", "--cases", "0"], 2, &["--cases 0", "nothing would be tested", "--map"]);
}
