//! A part of an image as an image of its own.

use super::{Camera, Distance, Parity, Projection, Settings};
use crate::error::{Error, Result};
use glam::{DMat4, DVec4};
use std::ops::Range;

impl Settings {
    /// The camera and the settings that render some columns and rows of this image as an image of their own, for images
    /// larger than a device holds. The pixels are those of the whole up to the rounding of single precision: triangles
    /// that reach beyond the part are placed relative to a pixel within it.
    ///
    /// Screen units are half an image's height, so sigma is multiplied by (image height / part height)².
    ///
    /// # Errors
    /// [`Error::Settings`] for a part that is empty or reaches beyond the image, and for official parity with the barycentric
    /// distance, which measures in the units of the whole image; [`Error::Camera`] for [`Projection::Official`] and
    /// [`Projection::Screen`], whose images cannot be shifted.
    pub fn cropped(&self, camera: &Camera, columns: Range<u32>, rows: Range<u32>) -> Result<(Camera, Self)> {
        let reaches = |part: &Range<u32>, whole: u32| part.is_empty() || part.end > whole;
        if reaches(&columns, self.width) || reaches(&rows, self.height) {
            let (value, whole) = (format!("columns {columns:?}, rows {rows:?}"), (self.width, self.height));
            let fix = format!("use some within the image's {} columns and {} rows", whole.0, whole.1);
            return Err(Error::Settings { field: "cropped", value, fix });
        }
        let part = Self { width: columns.end - columns.start, height: rows.end - rows.start, ..self.clone() };
        let sigma = match (self.distance, self.parity) {
            (Distance::Barycentric, Parity::Official) => {
                let fix = "official parity cuts barycentric distances by the whole image's box: render it whole".into();
                return Err(Error::Settings { field: "distance", value: "barycentric".into(), fix });
            }
            // Barycentrics have no unit.
            (Distance::Barycentric, _) => self.sigma,
            _ => self.sigma * (f64::from(self.height) / f64::from(part.height)).powi(2),
        };
        let camera = shifted(camera, [self, &part], [columns.start, rows.start].map(f64::from))?;
        Ok((camera, Self { sigma, ..part }))
    }
}

/// The camera of a part of an image that begins at a column and a row.
fn shifted(camera: &Camera, [whole, part]: [&Settings; 2], [column, row]: [f64; 2]) -> Result<Camera> {
    let [width, height] = [whole.width, whole.height].map(f64::from);
    let [part_width, part_height] = [part.width, part.height].map(f64::from);
    let [x, y, z] = camera.view().map(DVec4::from);
    let with = |rows: [DVec4; 3], projection: Projection| {
        let view = DMat4::from_cols(rows[0], rows[1], rows[2], DVec4::W).transpose();
        Camera::from_affine(view, projection)
    };
    if let Some([fx, fy, cx, cy]) = camera.intrinsics((whole.width, whole.height)) {
        return with([x, y, z], Projection::Pinhole { fx, fy, cx: cx - column, cy: cy - row });
    }
    match *camera.projection() {
        Projection::Orthographic { half_height } => {
            // From the centre of the part to that of the image, in screen units of the part.
            let right = (width - part_width - 2.0 * column) / part_height;
            let up = (2.0 * row + part_height - height) / part_height;
            let half_height = half_height * part_height / height;
            let moved = |axis: DVec4, by: f64| axis + DVec4::W * (by * half_height);
            with([moved(x, right), moved(y, up), z], Projection::Orthographic { half_height })
        }
        _ => Err(Error::Camera {
            field: "projection",
            value: format!("{:?}", camera.projection()),
            fix: "use a camera whose image can be shifted: a perspective, pinhole or orthographic one".into(),
        }),
    }
}
