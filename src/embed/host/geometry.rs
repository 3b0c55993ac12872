//! A host's geometry as it lies in its own buffers: interleaved vertices, 16- or 32-bit indices, instances.

use crate::constants as c;
use crate::error::{Error, Result};
use crate::frame::plan::MOST_TRIANGLES;

/// One draw of a host, as VkDrawIndexedIndirectCommand has it, and the number of vertices that it reads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Draw {
    /// The vertex that index 0 stands for.
    pub first_vertex: u32,
    /// Vertices: all indices are below it.
    pub vertices: u32,
    /// The first index.
    pub first_index: u32,
    /// Triangles, three indices each.
    pub triangles: u32,
    /// How often it is drawn, each time with the next transform.
    pub instances: u32,
}

/// How the elements of a host's array lie, in bytes; both are multiples of 4.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// From one element to the next.
    pub stride: u32,
    /// From an element's start to what is read or written of it.
    pub offset: u32,
}

/// The size of an index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IndexFormat {
    /// 16 bits.
    Uint16,
    /// 32 bits.
    Uint32,
}

impl IndexFormat {
    pub(crate) fn bits(self) -> u32 {
        match self {
            Self::Uint16 => 16,
            Self::Uint32 => 32,
        }
    }
}

/// The draws that make one mesh of a frame, or a part of one. Its vertices and triangles are those of the draws, in
/// order, each draw repeated for each of its instances.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Geometry {
    draws: Vec<Draw>,
    /// Where it begins in the frame's `positions`, in vertices; 0 unless other geometry or other meshes come before.
    pub first_vertex: u32,
    /// Where it begins in the frame's `indices`, in triangles; 0 likewise.
    pub first_triangle: u32,
    /// Vertices of the same mesh before it; indices count from the mesh's first.
    pub mesh_vertex: u32,
}

/// The most draws and instances together: a kernel's loop over both must end on Mesa before 23, which stops loops after
/// 65535 passes without an error.
const MOST: u64 = 60_000;

impl Geometry {
    /// Geometry at the beginning of the frame's arrays; [`validate`](Self::validate) checks its counts.
    pub fn new(draws: Vec<Draw>) -> Self {
        Self { draws, ..Self::default() }
    }

    /// Refuses more placed vertices or triangles than kernels can count, and more than 60000 draws and instances together.
    pub fn validate(&self) -> Result<()> {
        let draws = &self.draws;
        let sum = |each: fn(&Draw) -> u64| draws.iter().map(each).fold(0u64, u64::saturating_add);
        let limit = |what: &str, needed: u64, unit: &'static str, limit: u64| {
            let (what, limit_name) = (what.to_owned(), "what kernels count to");
            let fix = "spread them over several geometries".into();
            if needed <= limit { Ok(()) } else { Err(Error::Limit { what, needed, unit, limit_name, limit, fix }) }
        };
        limit("a geometry", draws.len() as u64 + sum(|d| d.instances.into()), "draws and instances", MOST)?;
        let elements = i32::MAX as u64;
        let placed = |count: u32, d: &Draw| u64::from(count) * u64::from(d.instances);
        limit("a geometry", 3 * draws.iter().map(|d| placed(d.vertices, d)).sum::<u64>(), "coordinates", elements)?;
        limit("a geometry", draws.iter().map(|d| placed(d.triangles, d)).sum(), "triangles", MOST_TRIANGLES)?;
        let end = |first: u32, count: u64| u64::from(first) + count;
        let last = draws.iter().map(|d| end(d.first_vertex, d.vertices.into())).max().unwrap_or(0);
        limit("a host's vertex buffer", last, "vertices", elements)?;
        let last = draws.iter().map(|d| end(d.first_index, 3 * u64::from(d.triangles))).max().unwrap_or(0);
        limit("a host's index buffer", last, "indices", elements)
    }

    /// The draws.
    pub fn draws(&self) -> &[Draw] {
        &self.draws
    }

    /// Vertices that it places.
    pub fn vertices(&self) -> u32 {
        self.draws.iter().map(|d| d.vertices * d.instances).sum()
    }

    /// Triangles that it places.
    pub fn triangles(&self) -> u32 {
        self.draws.iter().map(|d| d.triangles * d.instances).sum()
    }

    /// Instances, one transform each.
    pub fn instances(&self) -> u32 {
        self.draws.iter().map(|d| d.instances).sum()
    }

    /// The vertices of the host's buffer that draws read: the first, and one behind the last.
    pub fn source_vertices(&self) -> (u32, u32) {
        let drawn = || self.draws.iter().filter(|d| d.instances > 0);
        let first = drawn().map(|d| d.first_vertex).min().unwrap_or(0);
        (first, drawn().map(|d| d.first_vertex + d.vertices).max().unwrap_or(0))
    }

    /// One behind the last index that draws read.
    pub fn source_indices(&self) -> u64 {
        let drawn = self.draws.iter().filter(|d| d.instances > 0);
        drawn.map(|d| u64::from(d.first_index) + 3 * u64::from(d.triangles)).max().unwrap_or(0)
    }

    /// The table of draws as kernels read it: `glsl/common/draws.glsl`.
    pub fn table(&self) -> Vec<[u32; 8]> {
        let (mut vertex, mut instance, mut triangle) = (0, 0, 0);
        let row = |d: &Draw| {
            let row = [vertex, d.vertices, d.first_vertex, instance, triangle, d.triangles, d.first_index, d.instances];
            vertex += d.vertices * d.instances;
            triangle += d.triangles * d.instances;
            instance += d.instances;
            row
        };
        self.draws.iter().map(row).collect()
    }
}

/// The workgroups of 64 invocations for `count` elements, in rows as [`rows_of`] makes them.
pub(crate) fn linear_groups(count: u32) -> [u32; 3] {
    rows_of(count.div_ceil(c::LINEAR_GROUP))
}

/// Workgroups in rows, since one row may be too long.
pub(crate) fn rows_of(groups: u32) -> [u32; 3] {
    [groups.min(c::FORWARD_ROW), groups.div_ceil(c::FORWARD_ROW), 1]
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn the_table_counts_what_was_placed_before() {
        let draw = |first_vertex, vertices, first_index, triangles, instances| Draw {
            first_vertex,
            vertices,
            first_index,
            triangles,
            instances,
        };
        let geometry = Geometry::new(vec![draw(5, 4, 9, 2, 3), draw(0, 3, 0, 1, 0), draw(0, 3, 0, 1, 2)]);
        let expected = vec![[0, 4, 5, 0, 0, 2, 9, 3], [12, 3, 0, 3, 6, 1, 0, 0], [12, 3, 0, 3, 6, 1, 0, 2]];
        assert_eq!(geometry.table(), expected);
        assert_eq!((geometry.vertices(), geometry.triangles(), geometry.instances()), (18, 8, 5));
        assert_eq!((geometry.source_vertices(), geometry.source_indices()), ((0, 9), 15));
        // A draw without instances reads nothing.
        let hidden = Geometry::new(vec![draw(5, 4, 9, 2, 3), draw(1, 30, 900, 10, 0)]);
        assert_eq!((hidden.source_vertices(), hidden.source_indices()), ((5, 9), 15));
        assert!(matches!(Geometry::new(vec![draw(0, 1, 0, 1, 60_001)]).validate(), Err(Error::Limit { .. })));
        assert!(matches!(Geometry::new(vec![draw(0, u32::MAX, 0, 1, 1)]).validate(), Err(Error::Limit { .. })));
    }

    /// Every count ends where a signed index of 32 bits does, draws and instances at 60000.
    #[test]
    fn geometry_ends_where_indices_do() {
        let fits =
            |draw: Draw| Geometry::new(vec![Draw { instances: draw.instances.max(1), ..draw }]).validate().is_ok();
        let (most, none) = (i32::MAX as u32, Draw::default());
        let triangles = MOST_TRIANGLES as u32;
        for (last, beyond) in [
            (Draw { instances: 59_999, ..none }, Draw { instances: 60_000, ..none }),
            (Draw { vertices: most / 3, ..none }, Draw { vertices: most / 3 + 1, ..none }),
            (
                Draw { vertices: most / 21, instances: 7, ..none },
                Draw { vertices: most / 21 + 1, instances: 7, ..none },
            ),
            (
                Draw { triangles: triangles / 8, instances: 8, ..none },
                Draw { triangles: triangles / 8 + 1, instances: 8, ..none },
            ),
            (
                Draw { first_vertex: most - 4, vertices: 4, ..none },
                Draw { first_vertex: most - 4, vertices: 5, ..none },
            ),
            (
                Draw { first_index: most - 6, triangles: 2, ..none },
                Draw { first_index: most - 5, triangles: 2, ..none },
            ),
        ] {
            assert!(fits(last), "{last:?}");
            assert!(!fits(beyond), "{beyond:?}");
        }
        assert_eq!([IndexFormat::Uint16, IndexFormat::Uint32].map(IndexFormat::bits), [16, 32]);
    }

    #[test]
    fn rows_of_workgroups_cover_every_element() {
        assert_eq!(linear_groups(1), [1, 1, 1]);
        assert_eq!(linear_groups(c::LINEAR_GROUP * c::FORWARD_ROW), [c::FORWARD_ROW, 1, 1]);
        assert_eq!(linear_groups(c::LINEAR_GROUP * c::FORWARD_ROW + 1), [c::FORWARD_ROW, 2, 1]);
    }
}
