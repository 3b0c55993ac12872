//! The memory that the files of a command may take: one budget for all of them, from which it is claimed before it is allocated.

use crate::fault;
use softras::Result;
use std::cell::Cell;
use std::path::Path;

/// Bytes that files of any size may take.
const FREE: u64 = 640 << 20;
/// Bytes that each byte of the files adds: enough for pictures and arrays that are not compressed extremely.
const PER_BYTE: u64 = 128;
/// The most where the machine's memory is not known.
const UNKNOWN: u64 = 8 << 30;

/// The memory that the files of a command may take, and what of it is claimed.
#[derive(Debug)]
pub struct Budget {
    asked: Option<u64>,
    most: Cell<u64>,
    claimed: Cell<u64>,
}

impl Budget {
    /// A budget of `memory` bytes; `None`: 640 MiB and 128 times the files' sizes, but at most half of the machine's memory.
    pub fn new(memory: Option<u64>) -> Self {
        let budget = Self { asked: memory, most: Cell::new(0), claimed: Cell::new(0) };
        budget.set(memory.unwrap_or(FREE));
        budget
    }

    fn set(&self, most: u64) {
        let machine = || machine().map_or(UNKNOWN, |bytes| bytes / 2);
        self.most.set(if self.asked.is_some() { most } else { most.min(machine()) });
    }

    /// Counts a file of `bytes` bytes. This raises the budget, up to half of the machine's memory, unless the user set one.
    pub fn count_file(&self, bytes: u64) {
        if self.asked.is_none() {
            self.set(self.most.get().saturating_add(bytes.saturating_mul(PER_BYTE)));
        }
    }

    /// The bytes that are left of those that the user allowed; `None` where the user did not say how many.
    pub fn left(&self) -> Option<u64> {
        self.asked.map(|_| self.most.get() - self.claimed.get())
    }

    /// Claims bytes for something of a file.
    ///
    /// # Errors
    /// [`softras::Error::File`] when the budget does not have them.
    pub fn claim(&self, path: &Path, what: &str, bytes: u64) -> Result<()> {
        let claimed = self.claimed.get().saturating_add(bytes);
        if claimed > self.most.get() {
            let [bytes, left] = [bytes, self.most.get() - self.claimed.get()].map(mebibytes);
            let what = format!("{what} needs about {bytes} of memory, but only {left} is left for files");
            let fix = format!("allow {}M with --memory, or give less", claimed.div_ceil(1 << 20));
            return Err(fault(path, what, fix));
        }
        self.claimed.set(claimed);
        Ok(())
    }
}

fn mebibytes(bytes: u64) -> String {
    format!("{} MiB", bytes.div_ceil(1 << 20))
}

/// Bytes of this machine's memory, where the system tells.
fn machine() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok().map(|kilobytes| kilobytes << 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_claimed_is_gone() {
        let budget = Budget::new(Some(1000));
        budget.count_file(1 << 30);
        let file = Path::new("a.npz");
        assert!(budget.claim(file, "it", 600).is_ok());
        let refused = budget.claim(file, "key `x`", 401).map_err(|error| error.to_string());
        assert!(
            refused.is_err_and(|text| text.contains("a.npz: key `x` needs about 1 MiB") && text.contains("--memory"))
        );
        assert!(budget.claim(file, "it", 400).is_ok() && budget.claim(file, "it", u64::MAX).is_err());
    }

    #[test]
    fn larger_files_may_take_more() {
        let budget = Budget::new(None);
        let file = Path::new("a.npz");
        assert!(machine().is_none_or(|bytes| bytes > 2 * (FREE + 128 * PER_BYTE)), "a machine of little memory");
        assert!(budget.claim(file, "it", FREE).is_ok() && budget.claim(file, "it", 1).is_err());
        budget.count_file(1);
        assert!(budget.claim(file, "it", PER_BYTE).is_ok() && budget.claim(file, "it", 1).is_err());
    }
}
