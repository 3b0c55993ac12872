//! Views of an object: pictures, silhouettes, depths and normals, with their cameras.

mod camera_files;
mod maps;
mod sizes;

pub use maps::Map;

use crate::{Budget, Curve, PictureFile, npy, output, refuse};
use glam::DMat4;
use softras::{Camera, Error, Image, Projection, Result};
use std::{
    borrow::Cow,
    path::{Path, PathBuf},
};

/// Views of an object, with at least one kind of image.
#[derive(Clone, Debug, Default)]
pub struct Views {
    /// One for each view.
    pub cameras: Vec<Camera>,
    /// `[views, height, width, 1]`.
    pub silhouette: Option<Image>,
    /// `[views, height, width, 3]`, linear, over black. A value below 0 says that it is at least its opposite.
    pub color: Option<Image>,
    /// `[views, height, width, 1]`: the view depth, in world units, of the surface that a pixel shows; 0, or what is not finite,
    /// where it is not known. Only pixels that the silhouette covers wholly are compared.
    pub depth: Option<Image>,
    /// `[views, height, width, 3]`: the surface's unit normal in world space; 0, or what is not finite, where it is not known. Only
    /// pixels that the silhouette covers wholly are compared.
    pub normal: Option<Image>,
    /// The pictures' file names, for notes; empty where there are none.
    pub names: Vec<String>,
}

/// Options for reading views.
#[derive(Clone, Debug)]
pub struct ViewsOptions {
    /// The file of cameras; `None`: the first that the folder has of cameras.json, transforms.json, COLMAP's images.txt or images.bin,
    /// cameras.npz, and Middlebury's `_par.txt`.
    pub cameras: Option<PathBuf>,
    /// The vertical angle of view of cameras whose file does not give one, degrees.
    pub fov: f64,
    /// Whether colours are kept.
    pub color: bool,
    /// The folder of depth maps.
    pub depths: Option<PathBuf>,
    /// World units of a step of depth maps in PNG files.
    pub depth_unit: f64,
    /// The folder of normal maps.
    pub normals: Option<PathBuf>,
    /// Allow pictures outside of the folder.
    pub allow_outside: bool,
    /// Bytes of the budget that a pixel takes, including what the caller makes of it later.
    pub bytes_per_pixel: u64,
    /// The most pixels of a picture that take so many bytes. The caller uses no more, and the others take only what reading needs.
    pub most_pixels: u64,
}

impl Default for ViewsOptions {
    fn default() -> Self {
        Self {
            cameras: None,
            fov: 30.0,
            color: true,
            depths: None,
            depth_unit: 0.001,
            normals: None,
            allow_outside: false,
            bytes_per_pixel: 112,
            most_pixels: u64::MAX,
        }
    }
}

impl Views {
    /// Reads a folder of pictures with their cameras: [`Views::open_with`] without options.
    ///
    /// # Errors
    /// Those of [`Views::open_with`].
    pub fn open(folder: impl AsRef<Path>) -> Result<Self> {
        Ok(Self::open_with(folder, &ViewsOptions::default(), &Budget::new(None))?.0)
    }

    /// Reads a folder of PNG and JPEG pictures with a file of their cameras, or a .npy file of images (`[N, 4, H, W]` or `[N, H, W,
    /// 4]`: RGBA, alpha is the silhouette; `[N, H, W]`: silhouettes) with a file of theirs (`[N, 3]`: distance, elevation, azimuth in
    /// degrees of the official data, whose images are mirrored; `[N, 4, 4]`: world to view). The silhouette of a picture without
    /// transparency is every pixel that is not black; in JPEG and WebP pictures, every pixel with a value above 32 of 255. Pixels of the
    /// outline count in part, as they are bright. Returns all files that were read, and notes.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::File`] with the place of what is malformed, does not fit together, or exceeds the budget.
    pub fn open_with(
        path: impl AsRef<Path>,
        options: &ViewsOptions,
        budget: &Budget,
    ) -> Result<(Self, Vec<PathBuf>, Vec<String>)> {
        let path = path.as_ref();
        let (mut files, mut notes) = (vec![path.to_path_buf()], Vec::new());
        files.extend(options.cameras.clone());
        let views = if path.is_dir() {
            folder(options, path, &mut files, &mut notes, budget)?
        } else {
            arrays(options, path, budget)?
        };
        Ok((views, files, notes))
    }

    /// The files that [`Views::save`] writes into a folder for so many views with these maps.
    pub fn files(folder: &Path, count: usize, maps: &[Map]) -> Vec<PathBuf> {
        let mut files = camera_files::names(folder, count);
        files.extend(maps::names(folder, maps, &files));
        files
    }

    /// Writes pictures with alpha, their cameras.json, and maps of depths and normals in folders beside them, as
    /// [`Views::open_with`] reads them. Folders are made.
    ///
    /// # Errors
    /// [`Error::Io`]; then no file has changed, unless a rename itself failed. [`Error::File`] without colours and silhouettes.
    pub fn save(&self, folder: &Path) -> Result<()> {
        let (Some(silhouette), Some(color)) = (&self.silhouette, &self.color) else {
            return refuse(folder, "the views have no colours or no silhouettes", "give both");
        };
        let maps =
            [(Map::Depth, &self.depth), (Map::Normal, &self.normal)].into_iter().filter(|(_, map)| map.is_some());
        for folder in [folder.to_path_buf()].into_iter().chain(maps.map(|(map, _)| folder.join(map.folder()))) {
            std::fs::create_dir_all(&folder).map_err(|source| Error::Io { path: folder, source })?;
        }
        let names = camera_files::names(folder, self.cameras.len());
        output::write_files(&camera_files::files(folder, &self.cameras, silhouette, color)?)?;
        output::write_files(&maps::files(folder, self, &names))
    }

    /// Writes a cameras.json for the pictures that the views were read from, undistorted.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::File`] for views that were not read from a folder of pictures; those of [`Views::size`].
    pub fn save_cameras(&self, path: &Path) -> Result<()> {
        let (height, width) = self.size()?;
        if self.names.len() != self.cameras.len() {
            return refuse(path, "the views have no file names", "write the cameras of a folder of pictures");
        }
        output::write_file(path, &camera_files::cameras(&self.names, &self.cameras, (width, height)))
    }

    /// Some of the views.
    ///
    /// # Panics
    /// For a view that there is not.
    pub fn some(&self, views: &[usize]) -> Cow<'_, Self> {
        if views.iter().copied().eq(0..self.cameras.len()) {
            return Cow::Borrowed(self);
        }
        let some = |image: &Option<Image>| image.as_ref().map(|image| image.views(views.iter().copied()));
        Cow::Owned(Self {
            cameras: views.iter().map(|&view| self.cameras[view]).collect(),
            silhouette: some(&self.silhouette),
            color: some(&self.color),
            depth: some(&self.depth),
            normal: some(&self.normal),
            names: views.iter().filter_map(|&view| self.names.get(view).cloned()).collect(),
        })
    }

    /// The name of a view's picture, or the view's number.
    pub fn name(&self, view: usize) -> String {
        self.names.get(view).cloned().unwrap_or_else(|| format!("view {view}"))
    }

    /// Every `stride`-th view.
    pub fn every(&self, stride: usize) -> Self {
        let views: Vec<usize> = (0..self.cameras.len()).step_by(stride.max(1)).collect();
        self.some(&views).into_owned()
    }

    /// Height and width of the images.
    ///
    /// # Errors
    /// [`Error::Fit`] without any image, or when the images do not go with the cameras and each other.
    pub fn size(&self) -> Result<(usize, usize)> {
        let bad = |what: String, fix: String| Err(Error::Fit { what, fix });
        let images = [&self.silhouette, &self.color, &self.depth, &self.normal];
        let named = ["silhouettes", "colors", "depths", "normals"].into_iter().zip(images).zip([1, 3, 1, 3]);
        let given = named.filter_map(|((name, image), channels)| image.as_ref().map(|image| (name, image, channels)));
        let Some((_, first, _)) = given.clone().next() else {
            return bad("views without an image".into(), "give silhouettes, colours, depths or normals".into());
        };
        for (name, image, channels) in given {
            let shape = [image.batch, image.height, image.width, image.channels];
            let right = [self.cameras.len(), first.height, first.width, channels];
            if shape != right || !image.is_whole() {
                let what =
                    format!("{name} of shape {shape:?} with {} values for {} cameras", image.data.len(), right[0]);
                return bad(what, format!("give {name} of shape {right:?}, as large as the other images"));
            }
        }
        Ok((first.height, first.width))
    }
}

/// Bytes of a pixel that is only read: colour and silhouette, and the depth of the mesh there.
const READ_BYTES: u64 = 24;

/// Claims the memory for so many pixels.
fn claim_pixels(options: &ViewsOptions, budget: &Budget, path: &Path, pixels: u64) -> Result<()> {
    let fitted = pixels.min(options.most_pixels);
    let bytes =
        fitted.saturating_mul(options.bytes_per_pixel).saturating_add((pixels - fitted).saturating_mul(READ_BYTES));
    budget.claim(path, &format!("a fit to {pixels} pixels"), bytes)
}

/// Images and cameras as numpy arrays.
fn arrays(options: &ViewsOptions, path: &Path, budget: &Budget) -> Result<Views> {
    // A missing file is an error of its own, before that of missing cameras.
    std::fs::metadata(path).map_err(|source| Error::Io { path: path.into(), source })?;
    let Some(cameras) = &options.cameras else {
        return refuse(path, "images in a .npy file have no cameras with them", "give the file of their cameras too");
    };
    if options.depths.is_some() || options.normals.is_some() {
        let what = "depth and normal maps are found by picture names, and a .npy file has no names";
        return refuse(path, what, "give a folder of pictures");
    }
    let array = npy::read_file(path, budget)?;
    // The axes of [view, row, column, channel] in the file.
    let (sizes, strides) = match array.shape[..] {
        [n, c @ (1 | 3 | 4), h, w] => ([n, h, w, c], [c * h * w, w, 1, h * w]),
        [n, h, w, c @ (1 | 3 | 4)] => ([n, h, w, c], [h * w * c, w * c, c, 1]),
        [n, h, w] => ([n, h, w, 1], [h * w, w, 1, 0]),
        ref shape => {
            return refuse(path, format!("has shape {shape:?}"), "use [N, 4, H, W], [N, H, W, 4] or [N, H, W]");
        }
    };
    let [batch, height, width, channels] = sizes;
    if sizes.contains(&0) {
        return refuse(path, format!("has shape {:?}", array.shape), "give at least one pixel");
    }
    (0..batch).try_for_each(|_| claim_pixels(options, budget, path, (height * width) as u64))?;
    let values = npy::numbers(path, &array)?;
    let scale = if array.dtype() == "uint8" { 255.0 } else { 1.0 };
    let mut pixels = Pixels::new(options.color);
    for view in 0..batch {
        for row in 0..height {
            for column in 0..width {
                let at = view * strides[0] + row * strides[1] + column * strides[2];
                let channel = |k: usize| values.at(at + k * strides[3]) / scale;
                pixels.push(match channels {
                    1 => [channel(0); 4],
                    3 => rgba([channel(0), channel(1), channel(2)], None),
                    _ => rgba([channel(0), channel(1), channel(2)], Some(channel(3))),
                });
            }
        }
    }
    let cameras = read_cameras(cameras, options.fov, budget)?;
    Ok(pixels.views(cameras, [batch, height, width]))
}

/// The pixels of all views.
struct Pixels {
    silhouette: Vec<f32>,
    color: Option<Vec<f32>>,
}

impl Pixels {
    fn new(color: bool) -> Self {
        Self { silhouette: Vec::new(), color: color.then(Vec::new) }
    }

    fn push(&mut self, [r, g, b, a]: [f64; 4]) {
        self.silhouette.push(a as f32);
        if let Some(color) = &mut self.color {
            color.extend([r as f32, g as f32, b as f32]);
        }
    }

    fn views(self, cameras: Vec<Camera>, [batch, height, width]: [usize; 3]) -> Views {
        let image = |channels: usize, data: Vec<f32>| Image { batch, height, width, channels, data };
        let color = self.color.map(|color| image(3, color));
        Views { cameras, silhouette: Some(image(1, self.silhouette)), color, ..Views::default() }
    }
}

/// Linear colour over black, and the silhouette; without alpha, the silhouette is every pixel that is not black.
fn rgba(bytes: [f64; 3], alpha: Option<f64>) -> [f64; 4] {
    let a = alpha.unwrap_or_else(|| f64::from(u8::from(bytes.iter().any(|byte| *byte > 0.0))));
    let [r, g, b] = bytes.map(|byte| a * Curve::Srgb.decode(byte));
    [r, g, b, a]
}

/// Reads pictures with their cameras from a file of them, and adds all these files to those that were read. Pictures of several sizes
/// get empty columns at the right and empty rows below.
fn folder(
    options: &ViewsOptions,
    path: &Path,
    files: &mut Vec<PathBuf>,
    notes: &mut Vec<String>,
    budget: &Budget,
) -> Result<Views> {
    let (list, mut views) = camera_files::read(path, options.cameras.as_deref(), options.fov)?;
    files.push(list.clone());
    // All pictures are counted before the first is decoded.
    let sizes = counted(options, path, &mut views, files, notes, budget)?;
    let whole = sizes.iter().fold((0, 0), |(width, height), size| (size.0.max(width), size.1.max(height)));
    let pixels = u64::from(whole.0) * u64::from(whole.1);
    views.iter().try_for_each(|view| claim_pixels(options, budget, &path.join(&view.file), pixels))?;
    let has_maps = options.depths.is_some() || options.normals.is_some();
    if sizes.iter().any(|size| *size != whole) {
        if has_maps {
            return refuse(&list, "pictures of several sizes, beside depths or normals", "use images of one size");
        }
        notes.push(format!("pictures of several sizes: all become {}×{}, empty beyond their own", whole.0, whole.1));
    }
    if let Some(view) = views.iter().find(|view| view.bend.is_some()) {
        if has_maps {
            let what = format!("{}: a camera with distortion, beside depths or normals", view.file.display());
            return refuse(&list, what, "undistort pictures and maps first");
        }
        notes.push(format!("{} and others: the lens distortion is removed", view.file.display()));
    }
    let camera = |(view, size): (&camera_files::Entry, _)| sizes::widened(&view.camera(&list, size)?, size, whole);
    let all = views.iter().zip(sizes.iter().copied()).map(camera).collect::<Result<Vec<_>>>()?;
    let (mut pixels, mut cameras, mut pictures) = (Pixels::new(options.color), Vec::new(), Vec::new());
    let mut kinds = [None, None];
    for ((view, size), camera) in views.into_iter().zip(sizes).zip(all) {
        let (picture, noted) = picture_of(&view, path, size)?;
        // One note of a kind is enough for all pictures.
        kinds.iter_mut().zip(noted).for_each(|(kind, note)| *kind = kind.take().or(note));
        if sizes::is_cut(&picture, size, whole) {
            let what = "left out: its right or lower border cuts the object, and other pictures are larger";
            notes.push(format!("{}: {what}", view.file.display()));
            continue;
        }
        sizes::padded(&picture, size, whole).for_each(|pixel| pixels.push(pixel));
        cameras.push(camera);
        pictures.push(view.file);
    }
    if cameras.is_empty() {
        return refuse(&list, "pictures of several sizes, whose borders all cut the object", "crop them to one size");
    }
    notes.extend(kinds.into_iter().flatten());
    let (width, height) = (whole.0 as usize, whole.1 as usize);
    let mut made = pixels.views(cameras, [pictures.len(), height, width]);
    made.names = pictures.iter().map(|picture| picture.display().to_string()).collect();
    let mut maps = |map: Map, folder: &Option<PathBuf>| -> Result<Option<Image>> {
        let Some(folder) = folder else { return Ok(None) };
        map.read_all(folder, &pictures, (width, height), options.depth_unit, files, budget).map(Some)
    };
    (made.depth, made.normal) = (maps(Map::Depth, &options.depths)?, maps(Map::Normal, &options.normals)?);
    Ok(made)
}

/// The sizes of the pictures. Adds pictures and masks to the files; a mask that is not there is forgotten, with a note.
fn counted(
    options: &ViewsOptions,
    path: &Path,
    views: &mut [camera_files::Entry],
    files: &mut Vec<PathBuf>,
    notes: &mut Vec<String>,
    budget: &Budget,
) -> Result<Vec<(u32, u32)>> {
    let mut sizes = Vec::with_capacity(views.len());
    let mut missing = None;
    for view in views {
        let file = path.join(&view.file);
        check_inside(path, &file, options.allow_outside)?;
        let picture = PictureFile::open(&file)?;
        files.push(file.clone());
        sizes.push((picture.width, picture.height));
        budget.count_file(picture.file_bytes);
        if let Some(name) = view.mask.take_if(|mask| !path.join(mask).exists()) {
            missing.get_or_insert_with(|| format!("{}: not found: silhouettes come from the pictures", name.display()));
        }
        if let Some(mask) = view.mask.as_ref().map(|mask| path.join(mask)) {
            check_inside(path, &mask, options.allow_outside)?;
            files.push(mask);
        }
    }
    notes.extend(missing);
    Ok(sizes)
}

/// The pixels of a view's picture, with its mask and without its distortion, and notes.
fn picture_of(view: &camera_files::Entry, folder: &Path, size: (u32, u32)) -> Result<(Vec<[f64; 4]>, Noted)> {
    let (mut picture, noted) = pixels_of(&folder.join(&view.file))?;
    if let Some(mask) = &view.mask {
        masked(&mut picture, &folder.join(mask), size)?;
    }
    if view.bend.is_some() {
        picture = straightened(&picture, view, size.0 as usize);
    }
    Ok((picture, noted))
}

/// Takes the silhouette of a picture from its mask, white inside.
fn masked(picture: &mut [[f64; 4]], path: &Path, size: (u32, u32)) -> Result<()> {
    let mask = PictureFile::open(path)?;
    if (mask.width, mask.height) != size {
        let what = format!("is {}×{} pixels, and its picture {}×{}", mask.width, mask.height, size.0, size.1);
        return refuse(path, what, "give a mask of the picture's size");
    }
    let mask = mask.decode(path)?.into_luma8();
    for (pixel, mask) in picture.iter_mut().zip(mask.pixels()) {
        let (alpha, own) = (f64::from(mask.0[0]) / 255.0, pixel[3]);
        // Colours lie over black already.
        let scale = if own > 0.0 { alpha / own } else { 0.0 };
        *pixel = [scale * pixel[0], scale * pixel[1], scale * pixel[2], alpha];
    }
    Ok(())
}

/// A distorted picture as a pinhole camera would have taken it, interpolated between the four pixels around each place, with nothing
/// beyond its border.
fn straightened(picture: &[[f64; 4]], view: &camera_files::Entry, width: usize) -> Vec<[f64; 4]> {
    let height = picture.len() / width;
    let at = |row: f64, column: f64| -> [f64; 4] {
        let is_inside = row >= 0.0 && column >= 0.0 && row < height as f64 && column < width as f64;
        if is_inside { picture[row as usize * width + column as usize] } else { [0.0; 4] }
    };
    let straight = |i: usize| {
        let [column, row] = view.bent([(i % width) as f64 + 0.5, (i / width) as f64 + 0.5]);
        let (column, row) = (column - 0.5, row - 0.5);
        let (left, top) = (column.floor(), row.floor());
        let (along, down) = (column - left, row - top);
        let corners = [at(top, left), at(top, left + 1.0), at(top + 1.0, left), at(top + 1.0, left + 1.0)];
        let weights = [(1.0 - down) * (1.0 - along), (1.0 - down) * along, down * (1.0 - along), down * along];
        std::array::from_fn(|k| corners.iter().zip(weights).map(|(corner, weight)| corner[k] * weight).sum())
    };
    (0..picture.len()).map(straight).collect()
}

/// Refuses pictures outside the folder: a cameras.json of unknown origin must not make softras read other files.
fn check_inside(folder: &Path, file: &Path, allowed: bool) -> Result<()> {
    let real = |path: &Path| path.canonicalize().map_err(|source| Error::Io { path: path.into(), source });
    if allowed || real(file)?.starts_with(real(folder)?) {
        return Ok(());
    }
    refuse(file, "lies outside the folder of views", "move it into the folder, or use --allow-outside")
}

/// Notes on how a silhouette was found, and that a picture was turned.
type Noted = [Option<String>; 2];

/// The pixels of a picture file, linear colour over black and alpha, and the notes of [`PictureFile::decode_object`].
fn pixels_of(path: &Path) -> Result<(Vec<[f64; 4]>, Noted)> {
    let (picture, silhouette, notes) = PictureFile::open(path)?.decode_object(path)?;
    let one = |(pixel, alpha): (&image::Rgba<u8>, f64)| {
        let [r, g, b, a] = pixel.0.map(|byte| f64::from(byte) / 255.0);
        let [red, green, blue, _] = rgba([r, g, b], Some(a));
        [red, green, blue, alpha]
    };
    Ok((picture.pixels().zip(silhouette).map(one).collect(), notes))
}

/// Width, height, pixels, and notes.
type Pixelated = (usize, usize, Vec<[f64; 4]>, Vec<String>);

/// Width, height and pixels of a picture file, linear colour over black and alpha; each takes `bytes_per_pixel` of the budget. The alpha
/// of a picture without transparency is found as by [`Views::open_with`], with a note.
///
/// # Errors
/// [`Error::Io`]; [`Error::File`] for what is no picture or larger than the budget.
pub fn read_picture(path: &Path, budget: &Budget, bytes_per_pixel: u64) -> Result<Pixelated> {
    let picture = PictureFile::open(path)?;
    let (width, height) = (picture.width as usize, picture.height as usize);
    budget.count_file(picture.file_bytes);
    let what = format!("a picture of {width}×{height} pixels");
    budget.claim(path, &what, picture.pixels().saturating_mul(bytes_per_pixel))?;
    let (pixels, notes) = pixels_of(path)?;
    Ok((width, height, pixels, notes.into_iter().flatten().collect()))
}

/// Reads cameras from a numpy array: the angles of the official data, or matrices.
fn read_cameras(path: &Path, fov: f64, budget: &Budget) -> Result<Vec<Camera>> {
    let array = npy::read_file(path, budget)?;
    let values = npy::numbers(path, &array)?;
    let row = |at: usize, i: usize| values.at(at + i);
    match array.shape[..] {
        [n, 3] => (0..n).map(|c| official([0, 1, 2].map(|i| row(3 * c, i)), fov)).collect(),
        [n, 4, 4] => {
            let matrix = |c: usize| DMat4::from_cols_array(&std::array::from_fn(|i| row(16 * c, i))).transpose();
            if let Some(c) = (0..n).find(|&c| matrix(c).determinant() > 0.0) {
                let what =
                    format!("the matrix of camera {c} mirrors: y points down as OpenCV's, or z backward as OpenGL's");
                let fix = "give x right, y up and z forward: negate row 1 (OpenCV) or row 2 (OpenGL); rows from 0";
                return refuse(path, what, fix);
            }
            (0..n).map(|c| Camera::from_matrix(matrix(c), perspective(fov))).collect()
        }
        ref shape => {
            refuse(path, format!("has shape {shape:?}"), "use [N, 3] (distance, elevation, azimuth) or [N, 4, 4]")
        }
    }
}

/// A camera of the official renderer, whose images are mirrored.
fn official([distance, elevation, azimuth]: [f64; 3], fov: f64) -> Result<Camera> {
    let straight = Camera::from_angles(distance, elevation, azimuth, perspective(fov))?;
    let [right, up, forward] = *straight.view();
    let rows = [right.map(|x| -x), up, forward, [0.0, 0.0, 0.0, 1.0]];
    Camera::from_matrix(DMat4::from_cols_array_2d(&rows).transpose(), perspective(fov))
}

fn perspective(fov: f64) -> Projection {
    Projection::Perspective { fov_y: fov.to_radians() }
}
