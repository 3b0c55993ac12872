//! A full file system: every command that writes a file ends with an error that names the file, and leaves the old file as it was.
//!
//! The file system is one of memory in a name space of its own, for which Linux wants root or user name spaces; where neither is
//! allowed the test says so and tests nothing.

use super::command::tier;
use super::succeeds;
use std::io::{self, Write};
use std::{fs, path::Path, process::Command};

const OLD: &str = "the old file";

/// Mounts a file system on the folder `full`, puts the old file into it, fills it, runs the command, and prints the old file and
/// what else lies there.
const SCRIPT: &str = r#"
    mount -t tmpfs -o size=64k none full || exit 99
    printf '%s' 'the old file' > "full/$1"
    file=$1
    shift
    dd if=/dev/zero of=full/filler bs=4096 2>/dev/null
    "$@"
    code=$?
    cat "full/$file"
    ls -A full | grep -vxF -e filler -e "$file"
    exit $code
"#;

/// A shell in a name space for mounts, as root or as the user whom a user name space takes for root.
fn shell(folder: &Path, user_space: &[&str], script: &str, arguments: &[&str]) -> Command {
    let mut command = Command::new("unshare");
    command.current_dir(folder).args(user_space).args(["--mount", "sh", "-c", script, "sh"]).args(arguments);
    command
}

/// The options of `unshare` with which a file system can be mounted here.
fn user_space(folder: &Path) -> Option<&'static [&'static str]> {
    let choices: [&[&str]; 2] = [&[], &["--map-root-user"]];
    choices.into_iter().find(|choice| {
        let done = shell(folder, choice, "mount -t tmpfs none full", &[]).output();
        done.is_ok_and(|output| output.status.success())
    })
}

#[test]
fn a_full_file_system_keeps_the_old_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::create_dir(path.join("full")).unwrap();
    let Some(user_space) = user_space(path) else {
        // Past the capture of a test's output, so that it is seen.
        _ = writeln!(io::stderr(), "not tested: no file system can be mounted here");
        return;
    };
    succeeds(path, &["render", "cube", "-o", "target.png", "--size", "16"]);
    let fit = "fit --from cube --views 2 --size 8 --subdivisions 0 --iterations 1";
    let each = [
        ("fish.obj", "mesh fish -o full/fish.obj".into()),
        ("cube.png", "render cube -o full/cube.png --size 16".into()),
        ("turn.gif", "render cube -o full/turn.gif --turntable 2 --size 16".into()),
        ("depth.npy", "render cube -o full/depth.npy --output depth --size 16".into()),
        ("shape.obj", format!("{fit} -o full/shape.obj")),
        ("state.npz", format!("{fit} -o shape.obj --checkpoint full/state.npz")),
        ("log.json", format!("{fit} -o shape.obj --json full/log.json")),
        ("loss.png", format!("{fit} -o shape.obj --plot full/loss.png")),
        ("fit.gif", format!("{fit} -o shape.obj --gif full/fit.gif")),
        ("grad.png", "grad cube --target target.png -o full/grad.png".into()),
        ("turned.obj", "pose --mesh cube --image target.png --starts 1 --iterations 1 -o full/turned.obj".into()),
    ];
    // The first two in the quick tier.
    let quick = |(i, _): &(usize, _)| tier(*i < 2, true);
    for (_, (file, line)) in each.into_iter().enumerate().filter(quick) {
        let arguments: Vec<&str> =
            [file, env!("CARGO_BIN_EXE_softras")].into_iter().chain(line.split_whitespace()).collect();
        let output = shell(path, user_space, SCRIPT, &arguments).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "softras {line}: {said}");
        assert!(said.contains("full/") && said.contains("No space left"), "softras {line}: {said}");
        let left = String::from_utf8_lossy(&output.stdout);
        assert!(left.ends_with(OLD), "softras {line} leaves behind: {left}");
    }
}
