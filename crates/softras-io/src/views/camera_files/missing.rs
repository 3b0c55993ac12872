//! What a folder without a file of cameras has instead, for the error that says so.

use super::{NAMES, candidates};
use softras::Result;
use std::path::Path;

/// The remedy, which shows the form of a cameras.json.
pub(super) const FORMAT: &str = "write it, as [{\"file\": \"0.png\", \"distance\": 3, \"elevation\": 20, \"azimuth\": 45}, \
    {\"file\": \"1.png\", \"eye\": [0, 1, 3], \"fov\": 30}, {\"file\": \"2.png\", \"intrinsics\": [[fx, 0, cx], [0, fy, cy], \
    [0, 0, 1]], \"world_to_camera\": [4 rows of 4]}], or give a transforms.json (NeRF) or the files of a COLMAP model \
    (docs/cameras.md)";

/// Files of cameras that are not read, and who writes them.
const OTHERS: [(&str, &str); 10] = [
    ("cameras.sfm", "Meshroom"),
    ("sfm.json", "Meshroom"),
    ("sfm_data.json", "OpenMVG"),
    ("bundle.out", "Bundler"),
    ("bundle.rd.out", "Bundler"),
    ("cameras.xml", "Metashape"),
    ("reconstruction.json", "OpenSfM"),
    ("cameras.bin", "COLMAP, without images.bin"),
    ("cameras.txt", "COLMAP, without images.txt"),
    ("camera_parameters.txt", "another program"),
];

/// Refuses a folder, in which there is no file of cameras.
pub(super) fn refuse<T>(folder: &Path) -> Result<T> {
    let mut what = String::from("not found");
    let files = std::fs::read_dir(folder).into_iter().flatten();
    let names = files.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let known = |name: &String| {
        let by = OTHERS.iter().find(|(other, _)| name.eq_ignore_ascii_case(other)).map(|(_, by)| *by);
        let by = by.or_else(|| name.to_lowercase().ends_with(".mat").then_some("MATLAB"))?;
        Some(format!("{name} ({by})"))
    };
    if let Some(other) = names.filter_map(|name| known(&name)).min() {
        what += &format!("; {other} is not read");
    }
    let real = folder.canonicalize().unwrap_or_default();
    let above = real.ancestors().skip(1).take(2).find_map(|above| Some((above, candidates(above).into_iter().next()?)));
    let fix = above.map_or(FORMAT.to_owned(), |(above, file)| {
        let name = file.file_name().unwrap_or_default();
        format!("give the folder that has {}: {}", name.display(), above.display())
    });
    crate::refuse(&folder.join(NAMES[0]), what, fix)
}
