//! Subdivision: four triangles from each, at the middle of the edges or by Loop's scheme.

use crate::meshes::{genus, grid, point, points, topology};
use glam::{DMat3, DVec3};
use softras::scene::{Appearance, Texture, Wrap};
use softras::{Error, Mesh, shapes};
use softras_fit::{Subdivision, is_closed};

fn divided(mesh: &Mesh, times: usize) -> Mesh {
    (0..times).fold(mesh.clone(), |mesh, _| Subdivision::Loop.of(&mesh).unwrap())
}

fn mapped(mesh: &Mesh, map: impl Fn(DVec3) -> DVec3) -> Mesh {
    crate::meshes::mapped(mesh, |p| map(DVec3::from(p.map(f64::from))).as_vec3().to_array())
}

fn octahedron() -> Mesh {
    let positions =
        [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    let quarter = |z: u32, turned: bool| {
        [[0, 2], [2, 1], [1, 3], [3, 0]].map(|[a, b]| if turned { [b, a, z] } else { [a, b, z] })
    };
    Mesh::new(positions.to_vec(), [quarter(4, false), quarter(5, true)].concat()).unwrap()
}

/// The largest angle between the normals of two triangles that share an edge.
fn sharpest(mesh: &Mesh) -> f64 {
    let normal = |t: u32| {
        let [a, b, c] = mesh.triangles()[t as usize].map(|v| point(mesh, v));
        (b - a).cross(c - a)
    };
    let angle = |triangles: [u32; 2]| normal(triangles[0]).angle_between(normal(triangles[1]));
    topology(mesh).flaps().iter().map(|flap| angle(flap.triangles)).fold(0.0, f64::max)
}

#[test]
fn what_was_closed_stays_closed_with_its_handles() {
    for (mesh, handles) in [(shapes::icosphere(1).unwrap(), 0), (shapes::torus(0.7, 0.3, 9, 7).unwrap(), 1)] {
        for subdivision in [Subdivision::Midpoint, Subdivision::Loop] {
            let finer = subdivision.of(&mesh).unwrap();
            assert_eq!(finer.triangles().len(), 4 * mesh.triangles().len());
            assert_eq!(genus(&finer), (1, Some(handles)));
            assert!(is_closed(&finer).unwrap());
        }
    }
}

/// The weights by hand, vertex by vertex: of the octahedron's corners 5/8 and 3/32 each, of edges 3/8 and 1/8.
#[test]
fn the_weights_are_those_of_the_scheme() {
    let finer = divided(&octahedron(), 1);
    assert_eq!(finer.positions()[0], [0.625, 0.0, 0.0]);
    let edge = topology(&octahedron()).edge(0, 2).unwrap();
    assert_eq!(finer.positions()[6 + edge], [0.375, 0.375, 0.0]);
    // A tetrahedron's corners have three neighbours: 7/16 and 3/16 each.
    let corners = vec![[16.0, 0.0, 0.0], [0.0, 16.0, 0.0], [0.0, 0.0, 16.0], [0.0; 3]];
    let tetrahedron = Mesh::new(corners, vec![[0, 1, 2], [1, 0, 3], [2, 1, 3], [0, 2, 3]]).unwrap();
    assert_eq!(divided(&tetrahedron, 1).positions()[0], [7.0, 3.0, 3.0]);
    // A boundary of three triangles around a vertex: 6/8 and 1/8 each, and middles between.
    let fan = Mesh::new(vec![[0.0; 3], [8.0, 0.0, 0.0], [8.0, 8.0, 0.0], [0.0, 8.0, 3.0]], vec![[0, 1, 2], [0, 2, 3]])
        .unwrap();
    let finer = divided(&fan, 1);
    assert_eq!(finer.positions()[0], [1.0, 1.0, 0.375]);
    let edge = topology(&fan).edge(0, 1).unwrap();
    assert_eq!(finer.positions()[4 + edge], [4.0, 0.0, 0.0]);
    // Three triangles at an edge: its ends stay, and so does a vertex of no triangle.
    let book = vec![[0.0; 3], [0.0, 0.0, 8.0], [8.0, 0.0, 0.0], [0.0, 8.0, 0.0], [-8.0, 0.0, 0.0], [5.0; 3]];
    let book = Mesh::new(book, vec![[0, 1, 2], [0, 1, 3], [0, 1, 4]]).unwrap();
    let finer = divided(&book, 1);
    assert_eq!([0, 1, 5].map(|v| finer.positions()[v]), [[0.0; 3], [0.0, 0.0, 8.0], [5.0; 3]]);
    assert_eq!(finer.positions()[6], [0.0, 0.0, 4.0]);
}

#[test]
fn an_affine_map_commutes() {
    // Where all weights and coordinates are small fractions of powers of two, to the bit.
    let matrix = DMat3::from_cols_array(&[2.0, 0.5, -1.0, 0.0, -3.0, 0.25, 1.0, 1.0, 4.0]);
    let map = |p: DVec3| matrix * p + DVec3::new(5.0, -0.125, 9.0);
    let [before, after] = [divided(&mapped(&octahedron(), map), 2), mapped(&divided(&octahedron(), 2), map)];
    assert_eq!(before, after);
    // Else to the rounding of single precision, whose unit is 6e-8 of a coordinate of at most 11.
    let sphere = shapes::icosphere(1).unwrap();
    let [before, after] = [divided(&mapped(&sphere, map), 2), mapped(&divided(&sphere, 2), map)];
    let far = points(&before).into_iter().zip(points(&after)).map(|(a, b)| a.distance(b));
    assert!(far.fold(0.0, f64::max) < 5e-6);
}

#[test]
fn a_boundary_keeps_to_itself_and_a_flat_mesh_stays_flat() {
    // Bumps within do not move the boundary, which stays on its plane.
    let inner = |x: f32| x > 0.0 && x < 4.0;
    let bumps = grid(4, |x, y| [x, y, if inner(x) && inner(y) { 0.7 + x * y } else { 0.7 }]);
    let flat = grid(4, |x, y| [x, y, 0.7]);
    let [of_bumps, of_flat] = [&bumps, &flat].map(|mesh| divided(mesh, 2));
    let topology = topology(&of_flat);
    let alone = |edge: usize| !topology.flaps().iter().any(|flap| flap.edge == topology.edges()[edge]);
    let boundary: Vec<u32> =
        (0..topology.edges().len()).filter(|e| alone(*e)).flat_map(|e| topology.edges()[e]).collect();
    assert_eq!(boundary.len(), 2 * 4 * 4 * 4);
    boundary.iter().for_each(|&v| assert_eq!(point(&of_bumps, v), point(&of_flat, v)));
    assert!(of_flat.positions().iter().all(|p| p[2] == 0.7), "a flat mesh stays on its plane to the bit");
    // Where six even triangles meet, the vertices stay where they are, and those of edges are their middles.
    let [once, middles] = [Subdivision::Loop, Subdivision::Midpoint].map(|s| s.of(&flat).unwrap());
    for (v, (a, b)) in once.positions().iter().zip(middles.positions()).enumerate() {
        let deep = b[..2].iter().all(|x| (1.0..=3.0).contains(x));
        assert!(!deep || a == b, "vertex {v}: {a:?}, not {b:?}");
    }
}

#[test]
fn the_limit_of_an_icosahedron_is_smooth() {
    let icosahedron = shapes::icosphere(0).unwrap();
    let angles: Vec<f64> = (0..=5).map(|times| sharpest(&divided(&icosahedron, times))).collect();
    // Angles at edges go to 0 with the edges' lengths where a surface has one normal everywhere, by half where six triangles
    // meet and by 0.55 around five; at a crease they would stay.
    for pair in angles.windows(2) {
        assert!(pair[1] < 0.65 * pair[0], "{angles:?}");
    }
    let kept = Subdivision::Midpoint.of(&icosahedron).unwrap();
    assert!((sharpest(&kept) - angles[0]).abs() < 1e-5);
    // All symmetries stay, so that the five-fold vertices are alike, and nothing lies outside.
    let finest = divided(&icosahedron, 5);
    let radii: Vec<f64> = (0..12).map(|v| point(&finest, v).length()).collect();
    assert!(angles[5] < 0.56 * angles[4], "{angles:?}");
    assert!(radii.iter().all(|r| (r - radii[0]).abs() < 1e-6 && *r < 1.0), "{radii:?}");
}

#[test]
fn colours_go_with_the_positions_and_textures_with_their_edges() {
    let mesh = octahedron();
    let colors: Vec<[f32; 3]> = mesh.positions().iter().map(|p| p.map(|x| 0.5 + 0.5 * x)).collect();
    let colored = mesh.clone().with_appearance(Appearance::VertexColors(colors)).unwrap();
    let finer = divided(&colored, 1);
    let Appearance::VertexColors(colors) = finer.appearance() else { panic!("the colours are gone") };
    let expected: Vec<[f32; 3]> = finer.positions().iter().map(|p| p.map(|x| 0.5 + 0.5 * x)).collect();
    assert_eq!(*colors, expected);
    // Two charts with a seam between them keep it.
    let image = Texture::new(1, 1, vec![[1.0; 3]], Wrap::Repeat).unwrap();
    let square = grid(1, |x, y| [x, y, 0.0]);
    let uvs = vec![[0.0, 0.0], [0.5, 0.0], [0.5, 0.5], [0.75, 0.75], [1.0, 1.0], [0.75, 1.0]];
    let textured = Appearance::Textured {
        uvs,
        uv_triangles: vec![[0, 1, 2], [3, 4, 5]],
        textures: vec![image.clone(), image],
        texture_of_triangle: vec![1, 0],
    };
    for subdivision in [Subdivision::Midpoint, Subdivision::Loop] {
        let finer = subdivision.of(&square.clone().with_appearance(textured.clone()).unwrap()).unwrap();
        let Appearance::Textured { uvs, uv_triangles, texture_of_triangle, .. } = finer.appearance() else { panic!() };
        assert_eq!((uvs.len(), texture_of_triangle[..] == [1, 1, 1, 1, 0, 0, 0, 0]), (12, true));
        let at = |t: usize| uv_triangles[t].map(|i| uvs[i as usize]);
        assert_eq!(at(3), [[0.25, 0.0], [0.5, 0.25], [0.25, 0.25]], "the inner triangle of the first");
        assert_eq!(at(4), [[0.75, 0.75], [0.875, 0.875], [0.75, 0.875]], "that at the second's first corner");
    }
    let cells = Subdivision::Loop.of(&shapes::cube().unwrap());
    assert!(matches!(cells, Err(Error::Fit { .. })), "surface cells");
}
