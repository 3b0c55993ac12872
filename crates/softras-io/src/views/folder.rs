//! Folders of pictures with a file of their cameras.

use super::{
    Map, Views, ViewsOptions,
    background::Plain,
    camera_files::{self, Entry},
    files::Files,
    masks,
    photograph::{Album, premultiplied, straight},
};
use crate::{Budget, PictureFile, picture_file::is_opaque, refuse};
use image::RgbaImage;
use softras::{Error, Image, Result};
use std::path::{Path, PathBuf};

/// Pixels of the pictures that are looked at for a plain background before all are read, and the most pictures.
const LOOKED_AT: u64 = 24_000_000;
const MOST_LOOKED_AT: usize = 12;
/// Pixels of the pictures that are decoded at once.
const AT_ONCE: u64 = 16_000_000;
/// Bytes of a pixel of the largest picture while it is decoded and cut out, and of one that is kept.
const READ_BYTES: u64 = 24;
const KEPT_BYTES: u64 = 6;

/// A picture that was found, of which the header is read.
struct Found {
    entry: Entry,
    path: PathBuf,
    /// Its size, as its camera has it.
    size: (u32, u32),
    /// Whether it is taken as it is stored.
    is_stored: bool,
    mask: Option<PathBuf>,
    /// Whether the mask counts more than the picture's alpha: it was named, and not only found.
    is_named: bool,
}

impl Found {
    fn open(&self) -> Result<PictureFile> {
        let file = PictureFile::open(&self.path)?;
        Ok(if self.is_stored { file.as_stored() } else { file })
    }

    /// The picture, whose alpha is the silhouette, without its distortion; `None` where nothing tells what is background.
    fn picture(&self, shared: Option<&Plain>, told: &mut Told) -> Result<Option<RgbaImage>> {
        let (file, name) = (self.open()?, &self.entry.file);
        let is_lossy = file.is_lossy;
        let mut picture = file.decode(&self.path)?.into_rgba8();
        let is_opaque = is_opaque(&picture);
        if let Some(path) = self.mask.as_ref().filter(|_| self.is_named || is_opaque) {
            let (mask, note) = masks::read(path, &self.open()?, &picture)?;
            picture.pixels_mut().zip(mask.pixels()).for_each(|(pixel, mask)| pixel.0[3] = mask.0[0]);
            note.into_iter().for_each(|note| told.add(path, note));
            if !self.is_named {
                let folder = path.parent().unwrap_or(Path::new("")).display();
                told.add(name, format!("silhouettes are the masks in {folder}"));
            }
        } else if is_opaque {
            let Some(plain) = Plain::like(&picture, is_lossy, shared) else {
                told.add(name, "no alpha, no mask and no plain background: left out");
                return Ok(None);
            };
            plain.remove(&mut picture);
            plain.told().into_iter().for_each(|note| told.add(name, note));
        } else if masks::lift_alpha(&mut picture) {
            told.add(name, "the alpha is small everywhere: all that is not 0 is object");
        }
        if self.entry.bend.is_some() {
            told.add(name, "the lens distortion is removed");
            picture = straightened(&picture, &self.entry);
        }
        Ok(Some(picture))
    }
}

/// Notes of one kind, of which the first picture's stands for all.
#[derive(Default)]
struct Told(Vec<(String, String, usize)>);

impl Told {
    fn add(&mut self, name: &Path, what: impl Into<String>) {
        let what = what.into();
        match self.0.iter_mut().find(|(_, other, _)| *other == what) {
            Some((_, _, more)) => *more += 1,
            None => self.0.push((name.display().to_string(), what, 0)),
        }
    }

    fn extend(&mut self, others: Self) {
        for (name, what, more) in others.0 {
            match self.0.iter_mut().find(|(_, other, _)| *other == what) {
                Some((_, _, before)) => *before += 1 + more,
                None => self.0.push((name, what, more)),
            }
        }
    }

    fn notes(self) -> impl Iterator<Item = String> {
        self.0.into_iter().map(|(name, what, more)| match more {
            0 => format!("{name}: {what}"),
            more => format!("{name} and {more} more: {what}"),
        })
    }
}

/// Reads pictures with their cameras from a file of them, and adds all these files to those that were read.
pub fn read(
    options: &ViewsOptions,
    path: &Path,
    files: &mut Vec<PathBuf>,
    notes: &mut Vec<String>,
    budget: &Budget,
) -> Result<Views> {
    let (list, entries) = camera_files::read(path, options.cameras.as_deref(), options.fov, notes)?;
    files.push(list.clone());
    let mut told = Told::default();
    let found = found(options, path, &list, entries, &mut told, budget)?;
    files.extend(found.iter().flat_map(|one| [Some(one.path.clone()), one.mask.clone()]).flatten());
    check_maps(options, &list, &found)?;
    let sizes: Vec<(u32, u32)> = found.iter().map(|one| one.size).collect();
    let most = kept_side(options, &sizes);
    claim(options, path, &sizes, most, budget)?;
    let cameras = found.iter().map(|one| one.entry.camera(&list, one.size)).collect::<Result<Vec<_>>>()?;
    for Found { entry, size: (width, height), .. } in found.iter().filter(|one| one.entry.was_turned(one.size)) {
        told.add(
            &entry.file,
            format!("the camera is one of {height}×{width} pixels: was the picture turned after it?"),
        );
    }
    let shared = shared_background(path, &found)?;
    let (count, mut bare, mut album) = (found.len(), 0, Album::default());
    let at_once = at_once(&sizes);
    for (some, cameras) in found.chunks(at_once).zip(cameras.chunks(at_once)) {
        for ((one, camera), (picture, own)) in some.iter().zip(cameras).zip(pictures(some, shared.as_ref())) {
            told.extend(own);
            match picture? {
                Some(picture) => album.add(picture, *camera, Some(one.entry.file.display().to_string()), most),
                None => bare += 1,
            }
        }
    }
    if 2 * bare > count {
        return no_background(path, bare, count, count);
    }
    notes.extend(told.notes());
    let mut views = album.views(options, most.is_some(), notes)?;
    if views.cameras.is_empty() {
        return refuse(&list, "pictures of several sizes, whose borders all cut the object", "crop them to one size");
    }
    let pictures: Vec<PathBuf> = views.names.iter().map(PathBuf::from).collect();
    let (height, width) = views.size()?;
    let mut maps = |map: Map, folder: &Option<PathBuf>| -> Result<Option<Image>> {
        let Some(folder) = folder else { return Ok(None) };
        map.read_all(folder, &pictures, (width, height), options.depth_unit, files, budget).map(Some)
    };
    (views.depth, views.normal) = (maps(Map::Depth, &options.depths)?, maps(Map::Normal, &options.normals)?);
    Ok(views)
}

/// Pictures that are decoded at once: as many as there are cores, unless they are large.
fn at_once(sizes: &[(u32, u32)]) -> usize {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let largest = sizes.iter().map(|size| u64::from(size.0) * u64::from(size.1)).max().unwrap_or(1);
    cores.min((AT_ONCE / largest.max(1)) as usize).max(1)
}

/// What each picture shows, with its notes, each on a thread of its own.
fn pictures(found: &[Found], shared: Option<&Plain>) -> Vec<(Result<Option<RgbaImage>>, Told)> {
    let read = |one: &Found| {
        let mut told = Told::default();
        (one.picture(shared, &mut told), told)
    };
    if let [one] = found {
        return vec![read(one)];
    }
    std::thread::scope(|scope| {
        let threads: Vec<_> = found.iter().map(|one| scope.spawn(move || read(one))).collect();
        let joined = threads.into_iter().map(|thread| thread.join());
        joined.map(|read| read.unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
    })
}

/// The most pixels that are kept along a side of an object; `None` where pictures are kept whole.
pub fn kept_side(options: &ViewsOptions, sizes: &[(u32, u32)]) -> Option<usize> {
    let has_maps = options.depths.is_some() || options.normals.is_some();
    let are_small = sizes.iter().all(|size| *size == sizes[0] && size.0.min(size.1) <= options.crop);
    (options.crop > 0 && !has_maps && !are_small).then_some(options.detail.max(4 * options.crop) as usize)
}

/// Claims the memory for all pictures before the first is decoded.
pub fn claim(
    options: &ViewsOptions,
    path: &Path,
    sizes: &[(u32, u32)],
    most: Option<usize>,
    budget: &Budget,
) -> Result<()> {
    let crop = u64::from(options.crop).pow(2);
    let pixels = || sizes.iter().map(|size| u64::from(size.0) * u64::from(size.1));
    let one = |pixels: u64| match most {
        Some(most) => {
            let fitted = if pixels > 2 * crop { crop } else { pixels };
            fitted * options.bytes_per_pixel + pixels.min((most as u64).pow(2)) * KEPT_BYTES
        }
        None => pixels.saturating_mul(options.bytes_per_pixel),
    };
    let decoded = READ_BYTES * at_once(sizes) as u64 * pixels().max().unwrap_or(0);
    let bytes = pixels().map(one).fold(decoded, u64::saturating_add);
    budget.claim(path, &format!("a fit to {} pictures", sizes.len()), bytes)
}

/// Refuses what goes with maps of depths and normals alone where they are.
fn check_maps(options: &ViewsOptions, list: &Path, found: &[Found]) -> Result<()> {
    if options.depths.is_none() && options.normals.is_none() {
        return Ok(());
    }
    if found.iter().any(|one| one.size != found[0].size) {
        return refuse(list, "pictures of several sizes, beside depths or normals", "use images of one size");
    }
    match found.iter().find(|one| one.entry.bend.is_some()) {
        Some(one) => {
            let what = format!("{}: a camera with distortion, beside depths or normals", one.entry.file.display());
            refuse(list, what, "undistort pictures and maps first")
        }
        None => Ok(()),
    }
}

/// The background that opaque pictures without masks share, where they do. Some of them are looked at before all are read.
///
/// # Errors
/// [`Error::File`] where most of them have no plain background.
fn shared_background(path: &Path, found: &[Found]) -> Result<Option<Plain>> {
    let open: Vec<&Found> = found.iter().filter(|one| one.mask.is_none()).collect();
    let pixels = open.iter().map(|one| u64::from(one.size.0) * u64::from(one.size.1)).max().unwrap_or(1);
    let count = ((LOOKED_AT / pixels.max(1)) as usize).clamp(3, MOST_LOOKED_AT).min(open.len());
    let (mut plains, mut bare) = (Vec::new(), 0);
    for one in (0..count).map(|i| open[i * open.len() / count]) {
        let file = one.open()?;
        let is_lossy = file.is_lossy;
        let picture = file.decode(&one.path)?.into_rgba8();
        if is_opaque(&picture) {
            let plain = Plain::of(&picture, is_lossy);
            bare += usize::from(plain.is_none());
            plains.extend(plain);
        }
    }
    if 2 * open.len() > found.len() && bare > plains.len() {
        return no_background(path, bare, count, found.len());
    }
    Ok(Plain::shared(&plains).cloned())
}

pub fn no_background<T>(path: &Path, bare: usize, of: usize, all: usize) -> Result<T> {
    let looked = if of < all { " that were looked at" } else { "" };
    let what = format!(
        "no background: {bare} of {of} pictures{looked} are all object. They have no alpha, no masks (masks/NAME.png, NAME.jpg.png, \
         --mask-path FOLDER) and no plain background at their borders"
    );
    refuse(
        path,
        what,
        "cut the object out with rembg (rembg p -om images masks) or Segment Anything, and give the masks",
    )
}

/// The pictures that are there, with their sizes and masks.
fn found(
    options: &ViewsOptions,
    path: &Path,
    list: &Path,
    entries: Vec<Entry>,
    told: &mut Told,
    budget: &Budget,
) -> Result<Vec<Found>> {
    let (count, mut files, mut found) = (entries.len(), Files::default(), Vec::with_capacity(entries.len()));
    let mut first_missing = None;
    for mut entry in entries {
        let Some(file) = files.picture(path, &entry.file) else {
            told.add(&entry.file, "not found: left out");
            first_missing.get_or_insert(entry.file);
            continue;
        };
        let picture = path.join(&file);
        check_inside(path, &picture, options.allow_outside)?;
        let header = PictureFile::open(&picture)?;
        budget.count_file(header.file_bytes);
        let is_stored = header.is_turned() && !entry.is_turned(header.stored(), header.turned());
        if header.is_turned() {
            let what = if is_stored { "as stored, not turned" } else { "turned" };
            told.add(&file, format!("{what} as its EXIF orientation says"));
        }
        let size = if is_stored { header.stored() } else { (header.width, header.height) };
        if let Some((width, height)) = entry.scale_to(size) {
            told.add(
                &file,
                format!("its camera, of {width}×{height} pixels, is scaled to the picture's {}×{}", size.0, size.1),
            );
        }
        entry.file = file;
        found.push(Found { entry, path: picture, size, is_stored, mask: None, is_named: false });
    }
    if found.is_empty() {
        let name = first_missing.unwrap_or_default();
        let what = format!("none of its {count} pictures is there: {}, ...", name.display());
        return refuse(list, what, "put the pictures into the folder of views, or its folder images");
    }
    find_masks(options, path, &mut found, &mut files, told)?;
    Ok(found)
}

/// Finds the masks of pictures: those that the file of cameras names, or those of a given folder, or what lies beside the pictures.
fn find_masks(
    options: &ViewsOptions,
    path: &Path,
    found: &mut [Found],
    files: &mut Files,
    told: &mut Told,
) -> Result<()> {
    for one in found.iter_mut() {
        if let Some(name) = one.entry.mask.as_ref().filter(|_| options.masks.is_none()) {
            let mask = path.join(name);
            one.is_named = mask.exists();
            if one.is_named {
                check_inside(path, &mask, options.allow_outside)?;
                one.mask = Some(mask);
                continue;
            }
            told.add(name, "mask not found");
        }
        one.mask = files.mask(path, &one.entry.file, options.masks.as_deref());
        one.is_named = options.masks.is_some();
    }
    if found.iter().any(|one| one.mask.is_some()) {
        if let Some(folder) = &options.masks {
            let what = format!("no mask in {}", folder.display());
            found.iter().filter(|one| one.mask.is_none()).for_each(|one| told.add(&one.entry.file, what.clone()));
        }
        return Ok(());
    }
    let pictures: Vec<&Path> = found.iter().map(|one| one.entry.file.as_path()).collect();
    match (files.masks_in_order(path, &pictures, options.masks.as_deref()), &options.masks) {
        (Some(masks), _) => {
            let what = "masks are paired with pictures in the order of the numbers in their names";
            told.add(&found[0].entry.file, what);
            found.iter_mut().zip(masks).for_each(|(one, mask)| one.mask = Some(mask));
            Ok(())
        }
        (None, Some(folder)) => {
            let fix = "name masks NAME.png or NAME.jpg.png, as their pictures, or give as many masks as pictures";
            refuse(folder, "no mask of any picture", fix)
        }
        (None, None) => Ok(()),
    }
}

/// A distorted picture as a pinhole camera would have taken it, interpolated between the four pixels around each place, with nothing
/// beyond its border.
fn straightened(picture: &RgbaImage, view: &Entry) -> RgbaImage {
    let at = |column: f64, row: f64| -> [f32; 4] {
        let is_inside = row >= 0.0 && column >= 0.0;
        let pixel = picture.get_pixel_checked(column as u32, row as u32).filter(|pixel| is_inside && pixel.0[3] > 0);
        pixel.map_or([0.0; 4], premultiplied)
    };
    RgbaImage::from_fn(picture.width(), picture.height(), |column, row| {
        let [column, row] = view.bent([f64::from(column) + 0.5, f64::from(row) + 0.5]);
        let (column, row) = (column - 0.5, row - 0.5);
        let (left, top) = (column.floor(), row.floor());
        let (along, down) = (column - left, row - top);
        let corners = [at(left, top), at(left + 1.0, top), at(left, top + 1.0), at(left + 1.0, top + 1.0)];
        let weights = [(1.0 - down) * (1.0 - along), (1.0 - down) * along, down * (1.0 - along), down * along];
        straight([0, 1, 2, 3].map(|k| corners.iter().zip(weights).map(|(c, w)| f64::from(c[k]) * w).sum()))
    })
}

/// Refuses pictures outside the folder: a cameras.json of unknown origin must not make softras read other files.
fn check_inside(folder: &Path, file: &Path, allowed: bool) -> Result<()> {
    let real = |path: &Path| path.canonicalize().map_err(|source| Error::Io { path: path.into(), source });
    if allowed || real(file)?.starts_with(real(folder)?) {
        return Ok(());
    }
    refuse(file, "lies outside the folder of views", "move it into the folder, or use --allow-outside")
}
