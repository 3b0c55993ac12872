//! Where pictures and masks lie: under names that may differ in case, ending or folder from those that a file of cameras gives.

use std::{
    collections::{BTreeMap, HashMap},
    path::{Path, PathBuf},
};

/// The endings of pictures, in lower case.
const ENDINGS: [&str; 9] = ["png", "jpg", "jpeg", "webp", "ppm", "pgm", "bmp", "tif", "tiff"];
/// The folders below a folder of views that may have its pictures.
const PICTURES: [&str; 4] = ["", "images", "image", "rgb"];
/// The folders beside pictures that may have their masks.
const MASKS: [&str; 4] = ["masks", "mask", "silhouettes", "silhouette"];
/// How the stem of a mask that lies beside its picture ends.
const MARKS: [&str; 2] = ["_mask", ".mask"];
/// How the stem of a map ends that lies beside its picture.
const MAPS: [&str; 3] = ["_depth", "_normal", "_normals"];

/// The pictures of folders, each folder listed once.
#[derive(Default)]
pub struct Files(HashMap<PathBuf, BTreeMap<String, PathBuf>>);

impl Files {
    /// The pictures of a folder by their stems in lower case; of several with one stem the first by name.
    fn of(&mut self, folder: &Path) -> &BTreeMap<String, PathBuf> {
        self.0.entry(folder.into()).or_insert_with(|| {
            let listed = std::fs::read_dir(folder).into_iter().flatten();
            let mut paths: Vec<PathBuf> = listed.filter_map(|entry| Some(entry.ok()?.path())).collect();
            paths.retain(|path| is_picture(path) && path.is_file());
            paths.sort_by(|a, b| b.cmp(a));
            paths.into_iter().map(|path| (stem(&path), path)).collect()
        })
    }

    fn named(&mut self, folder: &Path, stems: &[String]) -> Option<PathBuf> {
        let pictures = self.of(folder);
        stems.iter().find_map(|stem| pictures.get(stem).cloned())
    }

    /// The picture that a file of cameras names: as it is named, below a folder of pictures, or, wherever it was named, in one of these.
    /// Case and ending may differ. Its path is relative to the folder of views.
    pub fn picture(&mut self, folder: &Path, name: &Path) -> Option<PathBuf> {
        // Files from Windows separate folders by backslashes.
        let name = PathBuf::from(name.to_string_lossy().replace('\\', "/"));
        let last = Path::new(name.file_name()?);
        let stems = if is_picture(last) { vec![stem(last)] } else { vec![lower(last), stem(last)] };
        let places = [name.as_path(), last].into_iter().flat_map(|name| PICTURES.map(|below| (below, name)));
        let mut found = places.filter_map(|(below, name)| {
            let path = folder.join(below).join(name);
            if path.exists() { Some(path) } else { self.named(path.parent()?, &stems) }
        });
        found.next().map(|path| path.strip_prefix(folder).map(Path::to_path_buf).unwrap_or(path))
    }

    /// The pictures of a folder of views that no file names, in the order of the numbers in their names, relative to it.
    pub fn pictures(&mut self, folder: &Path) -> Vec<PathBuf> {
        for below in PICTURES {
            let all = self.of(&folder.join(below));
            let is_other =
                |stem: &str| MARKS.iter().chain(&MAPS).any(|mark| stem.ends_with(mark)) || is_picture(Path::new(stem));
            let mut pictures: Vec<PathBuf> =
                all.iter().filter(|(stem, _)| !is_other(stem)).map(|(_, path)| path.clone()).collect();
            if !pictures.is_empty() {
                pictures.sort_by_cached_key(|path| numbered(path));
                return pictures.iter().filter_map(|path| Some(Path::new(below).join(path.file_name()?))).collect();
            }
        }
        Vec::new()
    }

    /// The mask of a picture: in the given folder, or in one of the folders of masks beside the picture, its folder or the folder of
    /// views; under its name, its whole name as COLMAP has it, or its name with a mark.
    pub fn mask(&mut self, folder: &Path, picture: &Path, given: Option<&Path>) -> Option<PathBuf> {
        let below = picture.parent().unwrap_or(Path::new(""));
        let (own, path) = (stem(picture), folder.join(below));
        let mut stems = vec![lower(Path::new(picture.file_name()?))];
        stems.extend(MARKS.map(|mark| own.clone() + mark));
        let beside = stems.clone();
        stems.push(own);
        if let Some(given) = given {
            return self.named(&given.join(below), &stems).or_else(|| self.named(given, &stems));
        }
        // Beside a folder of pictures, but not beside any folder: its neighbour's pictures may have the same names.
        let is_of_pictures = |path: &PathBuf| {
            let real = path.canonicalize().unwrap_or_default();
            PICTURES.iter().skip(1).any(|name| real.file_name().is_some_and(|own| own.eq_ignore_ascii_case(name)))
        };
        let beyond = (is_of_pictures(&path)).then(|| path.join(".."));
        let parents = [path.clone(), folder.to_path_buf()].into_iter().chain(beyond);
        let places = parents.flat_map(|parent| MASKS.map(|name| parent.join(name)));
        let places = places.flat_map(|masks| [masks.join(below), masks]);
        let mut found = places.filter_map(|masks| self.named(&masks, &stems));
        found.next().or_else(|| self.named(&path, &beside))
    }

    /// The masks of pictures that all lie in one folder: as many as they are, in the given folder, or in a folder of masks beside theirs or
    /// in it, in the order of the numbers in their names.
    pub fn masks_in_order(&mut self, folder: &Path, pictures: &[&Path], given: Option<&Path>) -> Option<Vec<PathBuf>> {
        let own = pictures.first()?.parent()?;
        if pictures.iter().any(|picture| picture.parent() != Some(own)) {
            return None;
        }
        let mut order: Vec<usize> = (0..pictures.len()).collect();
        order.sort_by_cached_key(|at| numbered(pictures[*at]));
        let beside =
            [folder.join(own), folder.to_path_buf()].into_iter().flat_map(|at| MASKS.map(|name| at.join(name)));
        let places: Vec<PathBuf> = given.map_or_else(|| beside.collect(), |given| vec![given.to_path_buf()]);
        let mut masks = places.into_iter().map(|masks| self.of(&masks).values().cloned().collect::<Vec<_>>());
        let mut masks = masks.find(|masks| masks.len() == pictures.len())?;
        masks.sort_by_cached_key(|path| numbered(path));
        let mut of = vec![PathBuf::new(); pictures.len()];
        order.into_iter().zip(masks).for_each(|(at, mask)| of[at] = mask);
        Some(of)
    }
}

/// Whether a name ends as those of pictures.
pub fn is_picture(path: &Path) -> bool {
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    ENDINGS.contains(&&ending[..])
}

/// The key of the order in which people number files: runs of digits count as numbers, so that `image_2` comes before `image_10`.
fn numbered(path: &Path) -> (Vec<(String, usize, String)>, PathBuf) {
    let name = lower(path);
    let (mut parts, mut rest) = (Vec::new(), &name[..]);
    while !rest.is_empty() {
        let (text, behind) = rest.split_at(rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len()));
        let (digits, behind) = behind.split_at(behind.find(|c: char| !c.is_ascii_digit()).unwrap_or(behind.len()));
        let digits = digits.trim_start_matches('0');
        parts.push((text.to_owned(), digits.len(), digits.to_owned()));
        rest = behind;
    }
    (parts, path.to_path_buf())
}

fn lower(path: &Path) -> String {
    path.to_string_lossy().to_lowercase()
}

fn stem(path: &Path) -> String {
    lower(Path::new(path.file_stem().unwrap_or_default()))
}
