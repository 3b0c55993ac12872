//! Random mutations of files: bytes that change, vanish or repeat, and numbers and lines that are hard to read.

use softras_check::stress::Random;
use std::path::{Path, PathBuf};

/// The files of a kind in the package's `tests/corpus`, in order.
pub fn corpus(kind: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus").join(kind);
    let mut files: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    assert!(files.len() >= 10, "{}", folder.display());
    files
}

/// `SOFTRAS_CASES` runs more of them.
pub fn cases(usual: u64) -> u64 {
    std::env::var("SOFTRAS_CASES").ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

fn is_number(byte: u8) -> bool {
    byte.is_ascii_digit() || b"+-.eE".contains(&byte)
}

/// The position of a number in the text, searched from a random place.
fn a_number(random: &mut Random, bytes: &[u8]) -> Option<std::ops::Range<usize>> {
    let from = random.below(bytes.len().max(1));
    let start = from + bytes.get(from..)?.iter().position(|b| b.is_ascii_digit())?;
    let end = start + bytes[start..].iter().position(|b| !is_number(*b)).unwrap_or(bytes.len() - start);
    Some(start..end)
}

/// Applies one random mutation to a file.
pub fn mutate(random: &mut Random, bytes: &mut Vec<u8>) {
    let at = random.below(bytes.len().max(1)).min(bytes.len());
    let end = (at + random.log_range(1.0, 300.0) as usize).min(bytes.len());
    match random.below(9) {
        0 if !bytes.is_empty() => bytes[at.min(end - 1)] ^= 1 << random.below(8),
        1 => bytes.truncate(at),
        2 => drop(bytes.drain(at..end)),
        3 => {
            let again = bytes[at..end].to_vec();
            bytes.splice(at..at, again);
        }
        4 => drop(bytes.splice(at..end, (0..end - at).map(|_| random.bits() as u8))),
        5..=7 => {
            let numbers: [&[u8]; 14] = [
                b"0",
                b"-1",
                b"nan",
                b"inf",
                b"-inf",
                b"1e39",
                b"1e-46",
                b"4294967296",
                b"-9223372036854775808",
                b"99999999999999999999",
                b"2147483648",
                b"1/",
                b"//",
                b"0x10",
            ];
            let place = a_number(random, bytes).unwrap_or(at..at);
            bytes.splice(place, random.choose(&numbers).iter().copied());
        }
        _ => {
            let texts: [&[u8]; 14] = [
                b"\nf 1 2 3\n",
                b"\nf 1 1 1\n",
                b"\nf -1 -2 -3 -4 -5\n",
                b"\nmtllib mesh.obj\n",
                b"\nmtllib ../mesh.mtl\n",
                b"\nmap_Kd ../secret.png\n",
                b"\nmap_Kd mesh.mtl\n",
                b"\nmap_Kd inside/../../secret.png\n",
                b"\nKd 0.5\n",
                b"\nmap_Kd -o 1 -s 2 mesh.png\n",
                b"\nv 1 2\n",
                b"\\\n",
                b"\nmtllib mesh.mtl mesh.mtl\n",
                b"\xff\xfe\0",
            ];
            bytes.splice(at..at, random.choose(&texts).iter().copied());
        }
    }
}
