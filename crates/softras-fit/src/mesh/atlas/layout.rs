//! Where the charts of an atlas lie, and how many texels they have.

use glam::DVec3;
use softras::{Error, Result, scene::Mesh};

/// Steps of the bisection, over the logarithm of the texels' length, for the shortest texels that fit into an image.
const HALVINGS: usize = 20;
/// Texels of a rectangle along each axis beyond the longer leg of its charts: a border, the one texel more that a leg of n
/// intervals has, and two that keep the long sides of the two charts apart.
const BEYOND_LEGS: u32 = 4;

/// The chart of a triangle: a right triangle of texels. Texel (i, j) lies i along u and j along v from that at the right angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chart {
    /// The triangle's corners: the one at the right angle, the one along u and the one along v.
    pub corners: [usize; 3],
    /// Texels along u and along v between the corners, at least 1.
    pub legs: [u32; 2],
    /// Column and row, from below, of the texel at the right angle.
    pub corner_at: [u32; 2],
    /// Whether the legs go to the left and down; else to the right and up.
    pub turned: bool,
    /// Texels that the rectangle has beyond this chart's own legs.
    spare: [u32; 2],
}

impl Chart {
    /// Column and row, from below, of a texel of the chart.
    pub fn place(&self, i: i32, j: i32) -> [u32; 2] {
        let sign = if self.turned { -1 } else { 1 };
        [self.corner_at[0].saturating_add_signed(sign * i), self.corner_at[1].saturating_add_signed(sign * j)]
    }

    /// The places of the three corners.
    pub fn places(&self) -> [[u32; 2]; 3] {
        let [width, height] = self.legs.map(|leg| leg as i32);
        [self.place(0, 0), self.place(width, 0), self.place(0, height)]
    }

    /// The last texel along u and along v that is painted. The first chart of a rectangle is painted to the end of the
    /// rectangle, the turned one as far as it is read.
    pub fn reach(&self) -> [i32; 2] {
        let beyond = |k: usize| if self.turned { 1 } else { 2 + self.spare[k] };
        [0, 1].map(|k| (self.legs[k] + beyond(k)) as i32)
    }

    /// Whether bilinear filtering within the triangle reads a texel, or the texel lies beside a leg. Filtering reads the four
    /// corners of a square; the one to test is that from (i - 1, j - 1) to (i, j), the nearest to the right angle.
    pub fn reads(&self, i: i32, j: i32) -> bool {
        let [width, height] = self.legs.map(i64::from);
        let [i, j] = [i, j].map(|x| i64::from(x - 1).max(0));
        i * height + j * width < width * height
    }
}

/// An atlas without its colours.
pub struct Layout {
    /// Width and height of the image in texels.
    pub side: u32,
    /// The longest texel, in world units.
    pub texel: f64,
    /// Triangles with their charts, the two of a rectangle one after the other, the one that is turned last.
    pub charts: Vec<(u32, Chart)>,
}

/// Charts with texels of a length, or of the least length with which the image has at most `most` texels along its sides.
///
/// # Errors
/// [`Error::Fit`] where charts with a texel along each leg do not fit.
pub fn layout(mesh: &Mesh, texel: f64, most: u32) -> Result<Layout> {
    let shapes: Vec<Shape> = mesh.triangles().iter().map(|corners| Shape::of(mesh, corners)).collect();
    let wanted = ChartSizes::new(&shapes, texel, most);
    if let Some(side) = wanted.least_side(most) {
        return Ok(Layout { side, texel, charts: wanted.charts(&shapes, side) });
    }
    let (mut short, mut long) = (texel, shapes.iter().map(|shape| shape.legs[0]).fold(texel, f64::max));
    let mut found = ChartSizes::new(&shapes, long, most);
    let Some(mut side) = found.least_side(most) else {
        let needed = ChartSizes::new(&shapes, long, u32::MAX).least_side(u32::MAX).unwrap_or(u32::MAX);
        return Err(Error::Fit {
            what: format!("an atlas of {} triangles in {most}×{most} texels", shapes.len()),
            fix: format!("allow {needed}×{needed}, or use a mesh with fewer triangles"),
        });
    };
    for _ in 0..HALVINGS {
        let middle = short.sqrt() * long.sqrt();
        let tried = ChartSizes::new(&shapes, middle, most);
        match tried.least_side(most) {
            Some(fits) => (found, side, long) = (tried, fits, middle),
            None => short = middle,
        }
    }
    Ok(Layout { side, texel: long, charts: found.charts(&shapes, side) })
}

/// A triangle as its chart needs it.
struct Shape {
    /// The corner opposite to the longest edge, that at the end of the longer leg, and that at the end of the shorter one.
    corners: [usize; 3],
    /// World lengths that the chart's legs stand for, the longer one first.
    legs: [f64; 2],
}

impl Shape {
    fn of(mesh: &Mesh, triangle: &[u32; 3]) -> Self {
        let points = triangle.map(|vertex| DVec3::from(mesh.positions()[vertex as usize].map(f64::from)));
        let opposite = [0, 1, 2].map(|corner| points[(corner + 1) % 3].distance(points[(corner + 2) % 3]));
        let mut corners = [0, 1, 2];
        // The corner opposite to an edge of length x; the sort is stable, so that equal edges stay in order.
        corners.sort_by(|&a, &b| opposite[b].total_cmp(&opposite[a]));
        let [longest, second, third] = corners;
        // The second longest edge goes from the right angle to the corner opposite to the shortest one.
        let legs = [opposite[second], opposite[third]];
        let across = legs[0].hypot(legs[1]);
        // The chart's long side must not have fewer texels than the edge, which is longer in an obtuse triangle.
        let stretch = if across > 0.0 { (opposite[longest] / across).max(1.0) } else { 1.0 };
        Self { corners: [longest, third, second], legs: legs.map(|leg| leg * stretch) }
    }
}

/// The charts for a texel's length: their legs, and their order.
struct ChartSizes {
    /// Texels along the longer leg and along the shorter one of each triangle's chart.
    legs: Vec<[u32; 2]>,
    /// The triangles by falling height, then by falling width. The first and the second share a rectangle, and so on.
    order: Vec<u32>,
}

impl ChartSizes {
    /// Legs are cut to `most` texels, which is still too long for an image of that size.
    fn new(shapes: &[Shape], texel: f64, most: u32) -> Self {
        let whole = |leg: f64| (leg / texel).ceil().clamp(1.0, f64::from(most.max(1))) as u32;
        let legs: Vec<[u32; 2]> = shapes.iter().map(|shape| shape.legs.map(whole)).collect();
        let mut order: Vec<u32> = (0..shapes.len() as u32).collect();
        order.sort_unstable_by_key(|&t| {
            let [long, short] = legs[t as usize];
            (std::cmp::Reverse((short, long)), t)
        });
        Self { legs, order }
    }

    /// Width and height of every rectangle.
    fn sizes(&self) -> impl Iterator<Item = [u64; 2]> {
        self.order.chunks(2).map(|pair| {
            let most = |k: usize| pair.iter().map(|&t| u64::from(self.legs[t as usize][k])).max().unwrap_or(1);
            [0, 1].map(|k| most(k) + u64::from(BEYOND_LEGS))
        })
    }

    /// The lower left texel of every rectangle in an image of this side, on shelves from the lowest row on; stops where the image
    /// is full. The last column and row of the image are a border.
    fn places(&self, side: u32) -> impl Iterator<Item = [u64; 2]> {
        let within = u64::from(side.saturating_sub(1));
        let (mut shelf, mut height, mut column) = (0, 0, 0);
        self.sizes().map_while(move |size| {
            if column + size[0] > within {
                (shelf, column, height) = (shelf + height, 0, 0);
            }
            // The first rectangle of a shelf is its highest.
            height = height.max(size[1]);
            let place = [column, shelf];
            column += size[0];
            (column <= within && shelf + height <= within).then_some(place)
        })
    }

    fn fit(&self, side: u32) -> bool {
        self.places(side).count() == self.order.len().div_ceil(2)
    }

    /// The side of an image with room for all charts, at most 2 % above the least; `None` where one of `most` has no room.
    fn least_side(&self, most: u32) -> Option<u32> {
        if !self.fit(most) {
            return None;
        }
        let texels: u64 = self.sizes().map(|[width, height]| width * height).sum();
        let mut side = u32::try_from(texels.isqrt()).unwrap_or(most).min(most);
        while side < most && !self.fit(side) {
            side = side.saturating_add(side / 64 + 1).min(most);
        }
        Some(side)
    }

    /// The charts in an image of a side that fits.
    fn charts(&self, shapes: &[Shape], side: u32) -> Vec<(u32, Chart)> {
        let cells = self.order.chunks(2).zip(self.places(side)).zip(self.sizes());
        let one = |((pair, place), size): ((&[u32], [u64; 2]), [u64; 2])| {
            let charts = pair.iter().zip([false, true]).map(move |(&triangle, turned)| {
                let legs = self.legs[triangle as usize];
                let corner = |k: usize| if turned { place[k] + size[k] - 1 } else { place[k] + 1 } as u32;
                let spare = [0, 1].map(|k| size[k] as u32 - BEYOND_LEGS - legs[k]);
                let corners = shapes[triangle as usize].corners;
                (triangle, Chart { corners, legs, corner_at: [corner(0), corner(1)], turned, spare })
            });
            charts.collect::<Vec<_>>()
        };
        cells.flat_map(one).collect()
    }
}
