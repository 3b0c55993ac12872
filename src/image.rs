//! Float images in host memory: what a frame returns, and what fits compare it with.

/// A batch of float images: `data[((b · height + row) · width + column) · channels + channel]`, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Number of views.
    pub batch: usize,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Values per pixel: 3 for colour and normals, 1 for silhouette and depth.
    pub channels: usize,
    /// `batch × height × width × channels` values.
    pub data: Vec<f32>,
}

impl Image {
    /// Whether it has at least one value, and as many values as its shape says.
    pub fn is_whole(&self) -> bool {
        let shape = [self.batch, self.height, self.width, self.channels];
        let count = shape.iter().try_fold(1usize, |count, &side| count.checked_mul(side));
        count == Some(self.data.len()) && !self.data.is_empty()
    }

    /// Some of the views.
    ///
    /// # Panics
    /// For a view that is not below `batch`.
    pub fn views(&self, views: impl ExactSizeIterator<Item = usize>) -> Self {
        let (batch, size) = (views.len(), self.height * self.width * self.channels);
        let mut data = Vec::with_capacity(batch * size);
        views.for_each(|view| data.extend_from_slice(self.view(view)));
        Self { batch, data, ..*self }
    }

    /// The `channels` values of one pixel.
    ///
    /// # Panics
    /// For coordinates outside the image's shape.
    pub fn pixel(&self, view: usize, row: usize, column: usize) -> &[f32] {
        let start = ((view * self.height + row) * self.width + column) * self.channels;
        &self.data[start..start + self.channels]
    }

    /// The values of one view, `height × width × channels`.
    ///
    /// # Panics
    /// For a view that is not below `batch`.
    pub fn view(&self, view: usize) -> &[f32] {
        let size = self.height * self.width * self.channels;
        &self.data[view * size..(view + 1) * size]
    }
}
