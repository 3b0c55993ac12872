//! A texture for a mesh without UV coordinates: an image with a chart for each triangle, in the mesh's own colours.
//!
//! The chart of a triangle is a right triangle whose corners are centres of texels. Two of them, one turned by half a turn,
//! share a rectangle of the image, and the rectangles are packed on shelves. All texels that bilinear filtering reads within a
//! triangle belong to its chart alone, and a border of texels that belong to none lies around each chart, so that a coordinate
//! that is rounded outwards reads no other chart either.

mod layout;

use crate::bad;
use crate::shown;
use layout::{Chart, Layout};
use softras::{
    Result,
    scene::{Appearance, Mesh, Texture, Wrap},
};

/// The mesh with UV coordinates and one square texture that shows the colours it has, and the length of the texture's texels.
///
/// Every triangle has a chart of its own, and texels of at most `texel` world units along its edges. Where the image would be
/// wider or higher than `most` texels, all charts have longer texels, the shortest that fit. The length that was used is
/// returned, in world units. A chart has at least one texel along its edges, so that a triangle takes at least 12.5 texels.
///
/// Texels are interpolated between the colours of the triangle's corners, and at its corners they are these colours. Beyond the
/// edges, where filtering reads as well, they go on by the same slope, within the range of the three colours. Charts may be
/// mirrored. Positions, triangles and normals are those of the mesh; the same input gives the same bits.
///
/// [`ShapeFit`](crate::ShapeFit) fits these texels like those of any texture, with
/// [`ShapeOptions::fit_colors`](crate::ShapeOptions::fit_colors); a texel that no view shows keeps its colour.
///
/// # Errors
/// [`softras::Error::Fit`] for a mesh that has no triangles, or surface cells or textures already; for a texel that is not above 0;
/// and where the charts do not fit into the image however long their texels are, which says how large it would have to be.
///
/// ```
/// use softras::{scene::Appearance, shapes};
/// use softras_fit::with_atlas;
///
/// let ball = shapes::icosphere(2)?;
/// let colors = ball.positions().iter().map(|p| p.map(|x| 0.5 + 0.5 * x)).collect();
/// let (painted, texel) = with_atlas(&ball.with_appearance(Appearance::VertexColors(colors))?, 0.02, 1024)?;
/// assert_eq!(texel, 0.02);
/// let Appearance::Textured { textures, .. } = painted.appearance() else { unreachable!() };
/// assert!(textures[0].width() <= 1024);
/// # Ok::<(), softras::Error>(())
/// ```
pub fn with_atlas(mesh: &Mesh, texel: f64, most: u32) -> Result<(Mesh, f64)> {
    if mesh.triangles().is_empty() {
        return bad("an atlas of a mesh without triangles", "give a mesh with at least one");
    }
    if !(texel > 0.0 && texel.is_finite()) {
        return bad(format!("an atlas with texels of {}", shown(texel)), "use a length above 0, in world units");
    }
    let color = corner_colors(mesh)?;
    atlas(mesh, texel, most, |triangle, corners| {
        let colors = corners.map(|corner| color(mesh.triangles()[triangle][corner]));
        move |along: f64, up: f64| between(colors, along, up)
    })
}

/// An atlas with colours from functions: `color(triangle, corners)` makes the function of one chart, from a texel's place, in
/// shares of the chart's two legs, to its colour.
pub fn atlas<F: Fn(f64, f64) -> [f32; 3]>(
    mesh: &Mesh,
    texel: f64,
    most: u32,
    color: impl Fn(usize, [usize; 3]) -> F,
) -> Result<(Mesh, f64)> {
    let Layout { side, texel, charts } = layout::layout(mesh, texel, most)?;
    let mut image = Image { side, texels: vec![[0.0; 3]; side as usize * side as usize] };
    let mut uvs = vec![[0.0; 2]; 3 * charts.len()];
    for (triangle, chart) in &charts {
        let triangle = *triangle as usize;
        image.paint(chart, color(triangle, chart.corners));
        for (corner, place) in chart.corners.into_iter().zip(chart.places()) {
            uvs[3 * triangle + corner] = place.map(|x| ((f64::from(x) + 0.5) / f64::from(side)) as f32);
        }
    }
    let uv_triangles = (0..mesh.triangles().len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let textures = vec![Texture::new(side, side, image.texels, Wrap::Repeat)?];
    let appearance = Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle: Vec::new() };
    Ok((mesh.clone().with_appearance(appearance)?, texel))
}

/// The colour of a vertex, by its index.
pub fn corner_colors(mesh: &Mesh) -> Result<impl Fn(u32) -> [f32; 3]> {
    let (one, each): ([f32; 3], &[[f32; 3]]) = match mesh.appearance() {
        Appearance::Uniform(color) => (*color, &[]),
        Appearance::VertexColors(colors) => ([0.0; 3], colors),
        _ => return bad("an atlas of a mesh with a texture", "give a mesh of one colour or with vertex colours"),
    };
    Ok(move |vertex: u32| each.get(vertex as usize).copied().unwrap_or(one))
}

/// The square image of an atlas, row 0 at the top.
struct Image {
    side: u32,
    texels: Vec<[f32; 3]>,
}

impl Image {
    /// Paints a chart and its border. The border between two charts of a rectangle is painted by the first of them, which fills the
    /// rectangle before the second one is painted.
    fn paint(&mut self, chart: &Chart, color: impl Fn(f64, f64) -> [f32; 3]) {
        let [width, height] = chart.reach();
        for j in -1..=height {
            for i in -1..=width {
                if chart.turned && !chart.reads(i, j) {
                    continue;
                }
                let [column, row] = chart.place(i, j);
                let at = (self.side - 1 - row) as usize * self.side as usize + column as usize;
                let share = |i: i32, leg: u32| f64::from(i) / f64::from(leg);
                self.texels[at] = color(share(i, chart.legs[0]), share(j, chart.legs[1]));
            }
        }
    }
}

/// The colour at shares of the legs from the first corner to the others, within the range of the three.
pub fn between(colors: [[f32; 3]; 3], along: f64, up: f64) -> [f32; 3] {
    [0, 1, 2].map(|k| {
        let [a, b, c] = colors.map(|color| f64::from(color[k]));
        let least = |most: fn(f64, f64) -> f64| most(most(a, b), c);
        (a + along * (b - a) + up * (c - a)).clamp(least(f64::min), least(f64::max)) as f32
    })
}
