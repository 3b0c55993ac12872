//! Maps of depths and normals beside the views of a fit: a file for each picture, of the picture's name.

use super::Views;
use crate::{
    Budget, PictureFile, input,
    npy::{self, numbers, read_file},
    picture_file::MAX_SIDE,
    refuse,
};
use exr::prelude::{AnyChannel, FlatSamples, MetaData, ReadChannels, ReadLayers, read};
use softras::{Image, Result};
use std::path::{Path, PathBuf};

/// The quantity that a map holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Map {
    /// View depths.
    Depth,
    /// Normals in world space.
    Normal,
}

/// The endings of maps, in the order in which they are looked for.
const ENDINGS: [&str; 3] = ["exr", "npy", "png"];
/// Bytes that a value takes while it is read: as it is in the file, as a sample, and as a number.
const BYTES_PER_VALUE: u64 = 16;
/// The least silhouette of a pixel that the object covers wholly, but for rounding.
const COVERED: f32 = 0.999;
/// Normals shorter than this have no direction, and are taken as not known.
const SHORTEST: f32 = 0.1;

/// The values of one map.
struct Values {
    width: usize,
    height: usize,
    data: Vec<f32>,
}

impl Map {
    fn channels(self) -> usize {
        match self {
            Self::Depth => 1,
            Self::Normal => 3,
        }
    }

    /// The folder beside the pictures that [`Views::save`] writes maps into.
    pub fn folder(self) -> &'static str {
        match self {
            Self::Depth => "depths",
            Self::Normal => "normals",
        }
    }

    /// Reads the maps of all pictures, whose names are given, and adds the files to those that were read.
    pub fn read_all(
        self,
        folder: &Path,
        pictures: &[PathBuf],
        (width, height): (usize, usize),
        unit: f64,
        files: &mut Vec<PathBuf>,
        budget: &Budget,
    ) -> Result<Image> {
        let mut data = Vec::new();
        for picture in pictures {
            let path = self.file(folder, picture)?;
            let values = self.read(&path, unit, budget)?;
            if (values.width, values.height) != (width, height) {
                let what = format!("has {}×{} pixels, its picture {width}×{height}", values.width, values.height);
                return refuse(&path, what, "give it the size of the pictures");
            }
            data.extend(values.data.chunks_exact(self.channels()).flat_map(|pixel| self.known(pixel)));
            files.push(path);
        }
        Ok(Image { batch: pictures.len(), height, width, channels: self.channels(), data })
    }

    /// The map of a picture.
    fn file(self, folder: &Path, picture: &Path) -> Result<PathBuf> {
        let stem = Path::new(picture.file_stem().unwrap_or_default());
        let found =
            ENDINGS.map(|ending| folder.join(stem).with_extension(ending)).into_iter().find(|path| path.exists());
        match found {
            Some(path) => Ok(path),
            None => {
                let what = format!("has no {} of {}", self.folder(), picture.display());
                let fix = format!("name it {}.exr, .npy or .png", stem.display());
                refuse(folder, what, fix)
            }
        }
    }

    fn read(self, path: &Path, unit: f64, budget: &Budget) -> Result<Values> {
        match path.extension().and_then(|ending| ending.to_str()) {
            Some("exr") => self.read_exr(path, budget),
            Some("npy") => self.read_npy(path, budget),
            _ => self.read_png(path, unit, budget),
        }
    }

    fn read_npy(self, path: &Path, budget: &Budget) -> Result<Values> {
        let array = read_file(path, budget)?;
        let (height, width) = match (self, &array.shape[..]) {
            (Self::Depth, &[h, w] | &[h, w, 1]) | (Self::Normal, &[h, w, 3]) => (h, w),
            (_, shape) => {
                let fix = if self == Self::Depth { "use [H, W]" } else { "use [H, W, 3]" };
                return refuse(path, format!("has shape {shape:?}"), fix);
            }
        };
        let values = numbers(path, &array)?;
        Ok(Values { width, height, data: (0..height * width * self.channels()).map(|i| values.at(i) as f32).collect() })
    }

    /// Depths are steps of `unit`; normals lie between -1 (black) and 1 (white), and black in all channels is not known.
    fn read_png(self, path: &Path, unit: f64, budget: &Budget) -> Result<Values> {
        let picture = PictureFile::open(path)?;
        let (width, height) = (picture.width as usize, picture.height as usize);
        budget.count_file(picture.file_bytes);
        self.claim(path, width, height, self.channels(), budget)?;
        let picture = picture.decode(path)?;
        let data = match self {
            Self::Depth if picture.color() != image::ColorType::L16 => {
                return refuse(path, "is no grey picture of 16 bits", "write depths as .exr, .npy, or .png of 16 bits");
            }
            Self::Depth => picture.into_luma16().iter().map(|step| (f64::from(*step) * unit) as f32).collect(),
            Self::Normal => {
                let straight = |x: u16| f32::from(x) / 32767.5 - 1.0;
                let pixel = |p: &image::Rgb<u16>| if p.0 == [0; 3] { [0.0; 3] } else { p.0.map(straight) };
                picture.into_rgb16().pixels().flat_map(pixel).collect()
            }
        };
        Ok(Values { width, height, data })
    }

    fn read_exr(self, path: &Path, budget: &Budget) -> Result<Values> {
        let unreadable = |error: exr::error::Error| {
            refuse(path, format!("is no OpenEXR file that can be read: {error}"), "write it again")
        };
        budget.count_file(input::open(path)?.metadata().map_or(0, |metadata| metadata.len()));
        let meta = match MetaData::read_from_file(path, false) {
            Ok(meta) => meta,
            Err(error) => return unreadable(error),
        };
        for header in &meta.headers {
            self.claim(path, header.layer_size.0, header.layer_size.1, header.channels.list.len(), budget)?;
        }
        let file = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer();
        let layer = match file.all_attributes().non_parallel().from_file(path) {
            Ok(image) => image.layer_data,
            Err(error) => return unreadable(error),
        };
        let (width, height) = (layer.size.0, layer.size.1);
        let columns = self.columns(path, &layer.channel_data.list)?;
        if columns.iter().any(|column| column.len() != width * height) {
            return refuse(path, "has channels with fewer samples than pixels", "write a sample for each pixel");
        }
        let data = (0..width * height).flat_map(|i| columns.iter().map(move |column| column[i])).collect();
        Ok(Values { width, height, data })
    }

    /// The samples of the channels that count: depths are the channel Z, or the only one; normals R, G, B or X, Y, Z.
    fn columns(self, path: &Path, channels: &[AnyChannel<FlatSamples>]) -> Result<Vec<Vec<f32>>> {
        let named = |name: &str| channels.iter().find(|channel| channel.name.eq(name));
        let all = |names: [&str; 3]| names.into_iter().map(named).collect::<Option<Vec<_>>>();
        let wanted = match self {
            Self::Depth => named("Z").or(channels.first().filter(|_| channels.len() == 1)).map(|channel| vec![channel]),
            Self::Normal => all(["R", "G", "B"]).or_else(|| all(["X", "Y", "Z"])),
        };
        let Some(wanted) = wanted else {
            let fix = if self == Self::Depth { "name the depths' channel Z" } else { "name the channels R, G and B" };
            let names: Vec<String> = channels.iter().map(|channel| channel.name.to_string()).collect();
            return refuse(path, format!("has the channels {}", names.join(", ")), fix);
        };
        Ok(wanted.into_iter().map(|channel| channel.sample_data.values_as_f32().collect()).collect())
    }

    /// Claims the memory for reading a map.
    fn claim(self, path: &Path, width: usize, height: usize, channels: usize, budget: &Budget) -> Result<()> {
        if width.min(height) == 0 || width.max(height) > MAX_SIDE as usize {
            return refuse(path, format!("is {width}×{height} pixels"), format!("use 1 to {MAX_SIDE} pixels a side"));
        }
        let values = (width as u64 * height as u64).saturating_mul(channels as u64);
        budget.claim(path, &format!("a map of {width}×{height} pixels"), values.saturating_mul(BYTES_PER_VALUE))
    }

    /// A pixel as it is fitted: 0 where it is not known, and normals of length 1.
    fn known(self, pixel: &[f32]) -> Vec<f32> {
        let finite = pixel.iter().all(|x| x.is_finite());
        match self {
            Self::Depth => vec![if finite { pixel[0].max(0.0) } else { 0.0 }],
            Self::Normal => {
                let length = pixel.iter().map(|x| x * x).sum::<f32>().sqrt();
                let good = finite && length >= SHORTEST && length.is_finite();
                pixel.iter().map(|x| if good { x / length } else { 0.0 }).collect()
            }
        }
    }
}

/// The files of maps that [`Views::save`] writes for pictures of these names.
pub fn names(folder: &Path, maps: &[Map], pictures: &[PathBuf]) -> Vec<PathBuf> {
    let pictures = || pictures.iter().filter(|path| path.extension().is_some_and(|ending| ending == "png"));
    maps.iter().flat_map(|map| pictures().map(|path| place(folder, *map, path))).collect()
}

/// The contents of these files.
pub fn files(folder: &Path, views: &Views, pictures: &[PathBuf]) -> Vec<(PathBuf, Vec<u8>)> {
    let mut written = Vec::new();
    for (map, image) in [(Map::Depth, &views.depth), (Map::Normal, &views.normal)] {
        let Some(image) = image else { continue };
        for (view, picture) in pictures.iter().take(image.batch).enumerate() {
            let shape = [image.height, image.width, image.channels];
            let shape = if map == Map::Depth { &shape[..2] } else { &shape[..] };
            // A pixel that the object covers in part is a mean of the surface and of nothing.
            let covered = views.silhouette.iter().flat_map(|silhouette| silhouette.view(view)).map(|a| *a >= COVERED);
            let pixels = image.view(view).chunks_exact(image.channels).zip(covered);
            let values: Vec<f32> =
                pixels.flat_map(|(pixel, covered)| pixel.iter().map(move |x| if covered { *x } else { 0.0 })).collect();
            written.push((place(folder, map, picture), npy::write(shape, npy::Data::F32(&values))));
        }
    }
    written
}

fn place(folder: &Path, map: Map, picture: &Path) -> PathBuf {
    let name = Path::new(picture.file_stem().unwrap_or_default()).with_extension("npy");
    folder.join(map.folder()).join(name)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    use exr::prelude::{SpecificChannels, WritableImage};
    use softras_check::random::Random;

    #[test]
    fn no_damaged_map_is_more_than_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let budget = || Budget::new(Some(64 << 20));
        let mut file = std::io::Cursor::new(Vec::new());
        let pixels = SpecificChannels::build().with_channel("Z").with_pixel_fn(|at| ((at.0 + 9 * at.1) as f32,));
        let image = exr::prelude::Image::from_channels((9, 7), pixels);
        image.write().non_parallel().to_buffered(&mut file).unwrap();
        let exr = file.into_inner();
        let numbers: Vec<f32> = (0..63).map(|i| i as f32).collect();
        let mut png = std::io::Cursor::new(Vec::new());
        image::ImageBuffer::<image::Luma<u16>, _>::from_fn(9, 7, |x, y| image::Luma([(x + 9 * y) as u16]))
            .write_to(&mut png, image::ImageFormat::Png)
            .unwrap();
        let mut random = Random::new(7);
        for (name, good) in
            [("a.exr", exr), ("a.npy", npy::write(&[7, 9], npy::Data::F32(&numbers))), ("a.png", png.into_inner())]
        {
            let path = folder.path().join(name);
            std::fs::write(&path, &good).unwrap();
            let values = Map::Depth.read(&path, 1.0, &budget()).unwrap();
            assert_eq!((values.width, values.height, &values.data), (9, 7, &numbers), "{name}");
            for _ in 0..400 {
                let mut bytes = good.clone();
                for _ in 0..1 + random.below(3) {
                    let at = random.below(bytes.len());
                    bytes[at] = random.below(256) as u8;
                }
                bytes.truncate(if random.below(4) == 0 { random.below(bytes.len()) } else { bytes.len() });
                std::fs::write(&path, &bytes).unwrap();
                if let Ok(values) = Map::Depth.read(&path, 1.0, &budget()) {
                    assert_eq!(values.data.len(), values.width * values.height);
                }
            }
        }
    }
}
