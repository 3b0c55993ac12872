//! The buffers of a pass that a host may use; all others are its workspace.

use crate::frame::buffers::BufferId;

macro_rules! pass_buffers {
    ($($(#[$doc:meta])* $name:ident,)*) => {
        /// A buffer of a pass that a host may read, write, bind apart or have read back. Pixel (x, y) of a view lies at
        /// `(view * height + y) * width + x`, row 0 at the top.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum PassBuffer {
            $($(#[$doc])* $name,)*
        }

        impl PassBuffer {
            /// Every one.
            pub const ALL: &[Self] = &[$(Self::$name,)*];

            pub(crate) fn id(self) -> BufferId {
                match self {
                    $(Self::$name => BufferId::$name,)*
                }
            }
        }
    };
}

pass_buffers! {
    /// r, g, b in linear light and the silhouette, four floats a pixel; an output.
    Color,
    /// One float a pixel; an output, where colour is not asked for.
    Silhouette,
    /// Σ w z in world units, one float a pixel; an output.
    Depths,
    /// Σ w n in world space and 0, four floats a pixel; an output.
    Normals,
    /// Σ w f of the features, four a texel and zeros behind the last; an output.
    FeatureImage,
    /// dL/dr, dL/dg, dL/db and dL/dsilhouette, four floats a pixel; the host writes it.
    UpstreamColor,
    /// dL/dsilhouette, one float a pixel; the host writes it, where there is no upstream colour.
    UpstreamSilhouette,
    /// dL/ddepth, one float a pixel; the host writes it.
    UpstreamDepths,
    /// dL/dnormal and a float that is not read, four a pixel; the host writes it.
    UpstreamNormals,
    /// dL by the image of features, as that has them; the host writes it.
    UpstreamFeatures,
    /// dL/dx, dL/dy, dL/dz, 0, dL/dr, dL/dg, dL/db, 0 of each placed vertex; an output of gradients.
    VertexGradients,
    /// dL by the features of each vertex, as the image has those of a pixel; an output of gradients.
    FeatureGradients,
    /// Gradients by UVs at the corners of triangles, as [`Pass::decode_gradients`](super::Pass::decode_gradients) reads them.
    CornerGradients,
    /// Gradients by texels in fixed point, as [`Pass::decode_gradients`](super::Pass::decode_gradients) reads them.
    TexelSums,
    /// Gradients by cameras, lights, background and scalars, as [`Pass::decode_gradients`](super::Pass::decode_gradients) reads
    /// them.
    Totals,
    /// r, g, b and alpha of each texel, row 0 at the top; an input ([`Pass::texels`](super::Pass::texels)).
    Texels,
    /// A unit vector for each vertex, three floats; an input ([`Pass::normals`](super::Pass::normals)).
    VertexNormals,
    /// Words of the frame's status; a host reads that at [`PassStatus::WHOLE_OFFSET`](super::builder::PassStatus::WHOLE_OFFSET).
    Status,
}

impl PassBuffer {
    /// Its name in the kernels and in debuggers.
    pub fn name(self) -> &'static str {
        self.id().name()
    }
}

impl std::fmt::Display for PassBuffer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}
