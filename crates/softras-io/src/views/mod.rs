//! Views of an object: pictures, silhouettes, depths and normals, with their cameras.

mod arrays;
mod background;
mod camera_files;
mod files;
mod folder;
mod kept;
mod maps;
mod masks;
mod parts;
mod photograph;
mod shadow;
mod surface;

pub(crate) use background::Plain;
pub use maps::Map;
pub use photograph::Photograph;

use crate::{Budget, PictureFile, output, picture_file::is_opaque, refuse};
use softras::{Camera, Error, Image, Result};
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
    /// The pictures that the images are crops of; empty where they are no crops.
    pub photographs: Vec<Photograph>,
}

/// Options for reading views.
#[derive(Clone, Debug)]
pub struct ViewsOptions {
    /// The file of cameras; `None`: the first that the folder has of cameras.json, transforms.json, transforms_train.json, COLMAP's
    /// images.txt or images.bin, cameras.npz, and Middlebury's `_par.txt`.
    pub cameras: Option<PathBuf>,
    /// The folder of masks, named as the pictures; `None`: the masks that a file of cameras names or that lie beside the pictures.
    pub masks: Option<PathBuf>,
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
    /// The most pixels along a side of crops around the object. Pictures of more pixels are cropped where that leaves out half of them,
    /// and where they have several sizes, but not beside maps. 0: none is cropped.
    pub crop: u32,
    /// The most pixels along an object's side that [`Views::photographs`] keep. 0: only their sizes and lenses are kept.
    pub detail: u32,
}

impl Default for ViewsOptions {
    fn default() -> Self {
        Self {
            cameras: None,
            masks: None,
            fov: 30.0,
            color: true,
            depths: None,
            depth_unit: 0.001,
            normals: None,
            allow_outside: false,
            bytes_per_pixel: 112,
            crop: 0,
            detail: 0,
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

    /// Reads a folder of pictures with a file of their cameras, which may be given in place of the folder, or a .npy file of images (`[N, 4, H, W]` or `[N, H, W, 4]`: RGBA, alpha
    /// is the silhouette; `[N, H, W]`: silhouettes) with a file of theirs (`[N, 3]`: distance, elevation, azimuth in degrees of the
    /// official data, whose images are mirrored; `[N, 4, 4]`: world to view). The silhouette of a picture is the first that there is of a
    /// mask that is named, its alpha, a mask that lies beside it, and what stands out of a plain background of any colour. Pixels of the
    /// outline count in part. Returns all files that were read, and notes.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::File`] with the place of what is malformed, does not fit together, or exceeds the budget, and where nothing
    /// tells the objects from their background.
    pub fn open_with(
        path: impl AsRef<Path>,
        options: &ViewsOptions,
        budget: &Budget,
    ) -> Result<(Self, Vec<PathBuf>, Vec<String>)> {
        let path = path.as_ref();
        if let Some(folder) = camera_files::folder_of(path).filter(|_| path.is_file() && options.cameras.is_none()) {
            let folder = if folder == Path::new("") { Path::new(".") } else { folder };
            let options = ViewsOptions { cameras: Some(path.to_path_buf()), ..options.clone() };
            return Self::open_with(folder, &options, budget);
        }
        let (mut files, mut notes) = (vec![path.to_path_buf()], Vec::new());
        files.extend(options.cameras.clone());
        let views = if path.is_dir() {
            folder::read(options, path, &mut files, &mut notes, budget)?
        } else {
            arrays::read(options, path, &mut notes, budget)?
        };
        Ok((views, files, notes))
    }

    /// The files that [`Views::save`] writes into a folder for `count` views with these maps.
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
        let of_photograph = |(camera, photograph): (&Camera, &Photograph)| photograph.whole_camera(camera);
        let cameras = match self.photographs.is_empty() {
            true => self.cameras.clone(),
            false => self.cameras.iter().zip(&self.photographs).map(of_photograph).collect::<Result<_>>()?,
        };
        output::write_file(path, &camera_files::cameras(&self.names, &cameras, (width, height)))
    }

    /// Crops of the views around the object with at most `most` pixels a side, with their photographs and a note, where the views have
    /// more, no maps, and lose half of their pixels.
    ///
    /// # Errors
    /// Those of [`Views::size`].
    pub fn cropped(&self, most: usize) -> Result<Option<(Self, String)>> {
        photograph::cropped(self, most)
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
            photographs: views.iter().filter_map(|&view| self.photographs.get(view).cloned()).collect(),
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

/// Width, height, pixels, and notes.
type Pixelated = (usize, usize, Vec<[f64; 4]>, Vec<String>);

/// Width, height and pixels of a picture file, linear colour over black and alpha; each takes `bytes_per_pixel` of the budget. The alpha
/// of an opaque picture is what stands out of its plain background, with a note.
///
/// # Errors
/// [`Error::Io`]; [`Error::File`] for what is no picture, is larger than the budget, or shows nothing but object.
pub fn read_picture(path: &Path, budget: &Budget, bytes_per_pixel: u64) -> Result<Pixelated> {
    let picture = PictureFile::open(path)?;
    let (width, height) = (picture.width as usize, picture.height as usize);
    budget.count_file(picture.file_bytes);
    let what = format!("a picture of {width}×{height} pixels");
    budget.claim(path, &what, picture.pixels().saturating_mul(bytes_per_pixel))?;
    let (picture, notes) = picture.decode_object(path)?;
    if is_opaque(&picture) {
        return refuse(
            path,
            "is all object, without alpha or a plain background",
            "cut the object out, to a PNG with alpha",
        );
    }
    let pixels = picture.pixels().map(|pixel| photograph::premultiplied(pixel).map(f64::from)).collect();
    Ok((width, height, pixels, notes))
}
