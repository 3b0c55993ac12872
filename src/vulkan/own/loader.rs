//! Where Vulkan's functions come from: the system's loader, an engine's own, or a driver's file without any loader.

use super::super::result::Named;
use crate::{Error, Result};
use ash::vk;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::sync::{Arc, OnceLock};

/// How a machine gets a device.
pub(super) const INSTALL: &str = "install a graphics driver with Vulkan 1.1, or the software device \
    (Debian, Ubuntu: apt install libvulkan1 mesa-vulkan-drivers), or name a driver's file by SOFTRAS_DRIVER";

/// The version of the interface between loader and driver that came with Vulkan 1.1.
const INTERFACE: u32 = 5;

/// The bytes of the header of an ELF file of 64-bit words.
const HEADER: usize = 64;

type Negotiate = unsafe extern "system" fn(*mut u32) -> vk::Result;

/// A Vulkan loader other than the system's: one that is linked in, an engine's own, or a driver's file.
#[derive(Clone, Debug)]
pub struct Loader {
    get_instance_proc_addr: vk::PFN_vkGetInstanceProcAddr,
    /// The driver's file.
    pub(super) file: Option<Arc<Path>>,
}

impl Loader {
    /// By its vkGetInstanceProcAddr.
    ///
    /// # Safety
    /// It is that function. It and all functions that it returns can be called for the rest of the process.
    pub unsafe fn new(get_instance_proc_addr: vk::PFN_vkGetInstanceProcAddr) -> Self {
        Self { get_instance_proc_addr, file: None }
    }

    /// A driver's file, such as Mesa's libvulkan_lvp.so, which takes no loader. Its code runs in this process, and it stays
    /// open until the process ends.
    ///
    /// # Errors
    /// [`Error::File`] for what is missing, is no Vulkan driver for this machine, or is too old.
    pub fn driver(path: impl AsRef<Path>) -> Result<Self> {
        // With a folder in front of it, the system looks nowhere else.
        let path = std::path::absolute(&path).unwrap_or_else(|_| path.as_ref().to_owned());
        let fail =
            |what: String, fix: &str| Err(Error::File { path: path.clone(), line: None, what, fix: fix.to_string() });
        let no_driver =
            "name the shared library of a Vulkan driver for this processor, such as Mesa's libvulkan_lvp.so";
        if let Some(what) = foreign(&path).unwrap_or_else(|e| Some(format!("it cannot be read ({e})"))) {
            return fail(what, no_driver);
        }
        // SAFETY: the user names the file as a driver, as VK_DRIVER_FILES names those that the loader opens.
        let library = match unsafe { libloading::Library::new(&path) } {
            Ok(library) => library,
            Err(e) => {
                return fail(format!("it cannot be opened ({e})"), "install what it needs, or name another driver");
            }
        };
        // SAFETY: the types are those of the interface between loader and driver.
        let functions = unsafe {
            let negotiate = library.get::<Negotiate>(b"vk_icdNegotiateLoaderICDInterfaceVersion\0");
            let get = library.get::<vk::PFN_vkGetInstanceProcAddr>(b"vk_icdGetInstanceProcAddr\0");
            negotiate.map(|symbol| *symbol).and_then(|negotiate| Ok((negotiate, *get?)))
        };
        // Drivers leave threads behind that outlive their library.
        std::mem::forget(library);
        let Ok((negotiate, get_instance_proc_addr)) = functions else {
            return fail("it is no Vulkan driver: it has no vk_icdGetInstanceProcAddr".to_string(), no_driver);
        };
        let loader = Self { get_instance_proc_addr, file: Some(path.as_path().into()) };
        match loader.too_old(negotiate)? {
            Some(what) => fail(what, "name a driver with Vulkan 1.1 or newer"),
            None => Ok(loader),
        }
    }

    /// The driver that SOFTRAS_DRIVER names.
    pub(super) fn by_environment() -> Result<Option<Self>> {
        let file = std::env::var_os("SOFTRAS_DRIVER").filter(|file| !file.is_empty());
        file.map(Self::driver).transpose().map_err(|error| match error {
            Error::File { path, line, what, fix } => {
                Error::File { path, line, what, fix: format!("{fix}, or unset SOFTRAS_DRIVER") }
            }
            other => other,
        })
    }

    pub(super) fn entry(&self) -> ash::Entry {
        let get_instance_proc_addr = self.get_instance_proc_addr;
        // SAFETY: the promise of `new`, which a driver's own function keeps too.
        unsafe { ash::Entry::from_static_fn(ash::StaticFn { get_instance_proc_addr }) }
    }

    /// Agrees on the interface with a driver, which must come before all other calls. Returns why the driver is too old, if it is.
    fn too_old(&self, negotiate: Negotiate) -> Result<Option<String>> {
        let mut version = INTERFACE;
        // SAFETY: the driver's function, with a number that it may lower.
        let answer = unsafe { negotiate(&mut version) };
        if answer != vk::Result::SUCCESS || version < INTERFACE {
            return Ok(Some(format!("it is too old: it lacks version {INTERFACE} of the interface to Vulkan loaders")));
        }
        // SAFETY: a plain query.
        let vulkan = unsafe { self.entry().try_enumerate_instance_version() }.named("vkEnumerateInstanceVersion")?;
        let is_1_1 = vulkan.is_some_and(|version| version >= vk::API_VERSION_1_1);
        Ok((!is_1_1).then(|| "it is too old: it has Vulkan 1.0 only, softras needs 1.1".to_string()))
    }
}

/// The system's loader, opened once for the process and never closed: drivers leave threads behind that outlive their library.
pub(super) fn system_entry() -> Result<ash::Entry> {
    static ENTRY: OnceLock<ash::Entry> = OnceLock::new();
    if let Some(entry) = ENTRY.get() {
        return Ok(entry.clone());
    }
    // SAFETY: opening the Vulkan loader runs its initialisers, which it is made for.
    let entry = unsafe { ash::Entry::load() }.map_err(|e| Error::NoDevice {
        what: format!("the Vulkan loader cannot be opened ({e})"),
        fix: INSTALL.to_string(),
    })?;
    Ok(ENTRY.get_or_init(|| entry).clone())
}

/// Why this machine cannot open a file, by its first bytes: the C library only says that it does not exist.
fn foreign(path: &Path) -> std::io::Result<Option<String>> {
    let file = header(path)?;
    let Some(own) = std::env::current_exe().and_then(|own| header(&own)).ok().filter(|header| is_elf(header)) else {
        return Ok(None);
    };
    // The type 3 is a shared library, in either order of bytes.
    if !is_elf(&file) || file[16].max(file[17]) != 3 {
        return Ok(Some("it is no shared library".to_string()));
    }
    let machine = |header: &[u8]| u16::from_le_bytes([header[18], header[19]]);
    if machine(&own) != machine(&file) {
        return Ok(Some(format!(
            "it is for {}, this program for {}",
            processor(machine(&file)),
            processor(machine(&own))
        )));
    }
    // The size of a word and the order of bytes.
    if own[4..6] != file[4..6] {
        return Ok(Some("it is for words of another size or byte order than this program's".to_string()));
    }
    // Opening a file that was cut off would end this process. The table of sections is what it ends with.
    let number =
        |at: usize, bytes: usize| file[at..at + bytes].iter().rev().fold(0u64, |all, &b| all << 8 | u64::from(b));
    let end = number(40, 8).saturating_add(number(58, 2) * number(60, 2));
    let size = std::fs::metadata(path).map_or(0, |metadata| metadata.len());
    let is_cut = cfg!(all(target_pointer_width = "64", target_endian = "little")) && size < end;
    Ok(is_cut.then(|| format!("it is cut off: it has {size} of {end} bytes")))
}

/// A file's first bytes; a pipe in its place might never end.
fn header(path: &Path) -> std::io::Result<Vec<u8>> {
    if !std::fs::metadata(path)?.is_file() {
        return Ok(Vec::new());
    }
    let mut bytes = Vec::new();
    File::open(path)?.take(HEADER as u64).read_to_end(&mut bytes)?;
    Ok(bytes)
}

fn is_elf(header: &[u8]) -> bool {
    header.len() == HEADER && header.starts_with(b"\x7fELF")
}

/// A processor by its number in ELF files.
fn processor(number: u16) -> String {
    match number {
        3 => "32-bit x86".to_string(),
        40 => "32-bit ARM".to_string(),
        62 => "x86-64".to_string(),
        183 => "AArch64".to_string(),
        other => format!("another processor (ELF machine {other})"),
    }
}

#[cfg(test)]
mod tests {
    use super::{Loader, Negotiate};
    use ash::vk;
    use std::ffi::c_char;

    unsafe extern "system" fn has_4(version: *mut u32) -> vk::Result {
        // SAFETY: the caller's number.
        unsafe { *version = 4 };
        vk::Result::SUCCESS
    }

    unsafe extern "system" fn refuses(_: *mut u32) -> vk::Result {
        vk::Result::ERROR_INCOMPATIBLE_DRIVER
    }

    unsafe extern "system" fn accepts(_: *mut u32) -> vk::Result {
        vk::Result::SUCCESS
    }

    /// Like a driver of Vulkan 1.0, which has no vkEnumerateInstanceVersion.
    unsafe extern "system" fn nothing(_: vk::Instance, _: *const c_char) -> vk::PFN_vkVoidFunction {
        None
    }

    #[test]
    fn drivers_before_vulkan_1_1_are_too_old() {
        // SAFETY: the function gives nothing to call.
        let loader = unsafe { Loader::new(nothing) };
        let old = |negotiate: Negotiate| loader.too_old(negotiate).ok().flatten().unwrap_or_default();
        assert!(old(has_4).contains("lacks version"), "{}", old(has_4));
        assert!(old(refuses).contains("lacks version"), "{}", old(refuses));
        assert!(old(accepts).contains("Vulkan 1.0 only"), "{}", old(accepts));
    }
}
