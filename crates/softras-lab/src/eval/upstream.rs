//! Reads the gradients of a loss by the images from an archive.

use super::keys;
use super::{Job, Layout};
use softras::{Image, ImageGradient, Result};
use softras_io::npz::Archive;

/// The key of the gradient by `soft_colors`.
const SOFT_COLORS: &str = "grad_soft_colors";

/// Reads the upstream gradients of `--gradient`.
///
/// # Errors
/// [`softras::Error::File`] naming the key when none is there, one is misshapen or not finite, or its image is not
/// among the outputs.
pub fn read(archive: &Archive, job: &Job) -> Result<ImageGradient> {
    match job.layout {
        Layout::Screen => soft_colors(archive, job),
        Layout::World => images(archive, job),
    }
}

/// Batch, height and width of the images.
fn size(job: &Job) -> [usize; 3] {
    [job.cameras.len(), job.settings.height as usize, job.settings.width as usize]
}

/// Splits `[B, 4, H, W]` into a colour and a silhouette.
fn soft_colors(archive: &Archive, job: &Job) -> Result<ImageGradient> {
    let [batch, height, width] = size(job);
    let expected = format!("[{batch}, 4, {height}, {width}]: dL/dsoft_colors");
    let array = archive.require(SOFT_COLORS, &format!("--gradient needs it, in shape {expected}"))?;
    if array.shape != [batch, 4, height, width] {
        return Err(keys::misshapen(archive, SOFT_COLORS, array, &expected));
    }
    let planes = keys::rows::<1>(archive, SOFT_COLORS, array)?;
    let planes = planes.as_flattened();
    let pixels = height * width;
    let (mut color, mut alpha) = (Vec::with_capacity(3 * batch * pixels), Vec::with_capacity(batch * pixels));
    for view in planes.chunks_exact(4 * pixels) {
        color.extend((0..pixels).flat_map(|i| [view[i], view[pixels + i], view[2 * pixels + i]]));
        alpha.extend_from_slice(&view[3 * pixels..]);
    }
    let image = |channels, data| Some(Image { batch, height, width, channels, data });
    Ok(ImageGradient { color: image(3, color), silhouette: image(1, alpha), ..ImageGradient::default() })
}

/// `grad_color`, `grad_silhouette`, `grad_depth`, `grad_normal`, at least one of them.
fn images(archive: &Archive, job: &Job) -> Result<ImageGradient> {
    let outputs = job.settings.outputs;
    let gradient = ImageGradient {
        color: image(archive, job, "grad_color", outputs.color, 3)?,
        silhouette: image(archive, job, "grad_silhouette", outputs.silhouette, 1)?,
        depth: image(archive, job, "grad_depth", outputs.depth, 1)?,
        normal: image(archive, job, "grad_normal", outputs.normal, 3)?,
    };
    if gradient == ImageGradient::default() {
        let what = "missing, and so are grad_silhouette, grad_depth and grad_normal";
        return Err(archive.fault("grad_color", what, "--gradient needs dL/dimage of at least one of the outputs"));
    }
    Ok(gradient)
}

fn image(archive: &Archive, job: &Job, key: &str, rendered: bool, channels: usize) -> Result<Option<Image>> {
    let Some(array) = archive.get(key)? else { return Ok(None) };
    let [batch, height, width] = size(job);
    if !rendered {
        let name = key.trim_start_matches("grad_");
        return Err(archive.fault(
            key,
            &format!("{name} is not among the outputs"),
            &format!("add {name} to `outputs`"),
        ));
    }
    let shape = [&[batch, height, width][..], if channels == 3 { &[3] } else { &[] }].concat();
    if array.shape != shape {
        return Err(keys::misshapen(archive, key, array, &format!("{shape:?}, as its image")));
    }
    let data = keys::rows::<1>(archive, key, array)?.into_flattened();
    Ok(Some(Image { batch, height, width, channels, data }))
}
