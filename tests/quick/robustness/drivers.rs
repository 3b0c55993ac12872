//! Drivers' files that are opened without the Vulkan loader.

use crate::common::renderer;
use softras::{Error, Loader, Projection, Renderer, RendererOptions, Scene, Settings, shapes};
use std::path::PathBuf;

/// The files that this process has mapped: its program, the C library, and the drivers once there was a device.
fn mapped() -> Vec<PathBuf> {
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap();
    let mut files: Vec<PathBuf> = maps.lines().filter_map(|line| Some(line[line.find('/')?..].into())).collect();
    files.dedup();
    files
}

#[test]
fn a_drivers_file_renders_the_bits_that_the_loader_does() {
    let draw = |renderer: &mut Renderer| {
        let camera = softras::Camera::from_angles(3.0, 20.0, 45.0, Projection::Perspective { fov_y: 0.8 }).unwrap();
        let settings = Settings { width: 40, height: 32, ..Settings::default() };
        let frame = renderer.render(&Scene::new(shapes::fish().unwrap()), &[camera], &settings).unwrap();
        frame.color().unwrap().data.clone()
    };
    let mut usual = renderer();
    let device = usual.device_info();
    assert_eq!(device.file, None);
    // The machine may have several drivers; that of the usual device has its name in its list.
    let drivers = mapped().into_iter().filter_map(|file| Some((Loader::driver(&file).ok()?, file)));
    let mut of_device = drivers.filter_map(|(loader, file)| {
        let found = loader.devices().ok()?.into_iter().find(|one| one.name == device.name)?;
        assert_eq!(found.file.as_ref(), Some(&file));
        Some(loader)
    });
    let loader = of_device.next_back().expect("the device's driver");
    let options = RendererOptions { loader: Some(loader), device: Some(device.name.clone()), ..Default::default() };
    let mut alone = Renderer::with_options(&options).unwrap();
    assert_eq!(draw(&mut alone), draw(&mut usual));
    let validating = Renderer::with_options(&RendererOptions { validation: true, ..options }).unwrap_err().to_string();
    assert!(validating.contains("validation needs the Vulkan loader"), "{validating}");
}

#[test]
fn a_file_that_is_no_driver_is_an_error_that_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let program = std::env::current_exe().unwrap();
    let library = mapped().into_iter().find(|file| file.to_string_lossy().contains("/libc.so")).unwrap();
    let with = |name: &str, change: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = std::fs::read(&library).unwrap();
        change(&mut bytes);
        std::fs::write(folder.path().join(name), bytes).unwrap();
        folder.path().join(name)
    };
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("notes.txt"), "a driver is needed here, a text is not one").unwrap();
    std::fs::write(path("empty.so"), "").unwrap();
    let name_one = "name the shared library of a Vulkan driver";
    let cases = [
        (path("notes.txt"), "it is no shared library", name_one),
        (path("empty.so"), "it is no shared library", name_one),
        (path("missing.so"), "it cannot be read (", name_one),
        // The type is at 16; 1 is what a compiler writes.
        (with("object.o", &|bytes| bytes[16] = 1), "it is no shared library", name_one),
        (folder.path().to_owned(), "it is no shared library", name_one),
        // The machine's number is at 18; 183 is AArch64, 2 an old SPARC. The class, 32 or 64 bits, is at 4.
        (with("arm.so", &|bytes| bytes[18] ^= 62 ^ 183), "it is for ", name_one),
        (with("i386.so", &|bytes| bytes[18] = 3), "it is for 32-bit x86, this program", name_one),
        (
            with("sparc.so", &|bytes| bytes[18] = 2),
            "it is for another processor (ELF machine 2), this program",
            name_one,
        ),
        (with("word.so", &|bytes| bytes[4] ^= 3), "it is for words of another size", name_one),
        (with("cut.so", &|bytes| bytes.truncate(3000)), "it is cut off: it has 3000 of ", name_one),
        (with("short.so", &|bytes| bytes.truncate(30)), "it is no shared library", name_one),
        (library.clone(), "it has no vk_icdGetInstanceProcAddr", name_one),
        (program, "it cannot be opened (", "install what it needs"),
    ];
    for (file, what, fix) in cases {
        let error = Loader::driver(&file).unwrap_err();
        let text = error.to_string();
        assert!(matches!(&error, Error::File { path, .. } if *path == file), "{error:?}");
        assert!(text.contains(what) && text.contains(fix), "{text}");
    }
    let missing = Loader::driver("no/such/driver.so").unwrap_err();
    assert!(matches!(&missing, Error::File { path, .. } if path.is_absolute()), "{missing:?}");
}
