//! Atlases: charts that never touch, colours that stay, what is refused, and texels that tell more than vertex colours.

use crate::common::tier;
use crate::meshes::{self, both, grid, moved};
use softras::scene::{Appearance, Background, DirectionalLight, Interpolation, Outputs, Texture, Wrap};
use softras::{Camera, Error, Image, Lights, Mesh, Projection, Renderer, Scene, Settings, shapes};
use softras_check::random::Random;
use softras_fit::{ImageLoss, Schedule, ShapeFit, ShapeOptions, pooled, with_atlas};
use softras_io::Views;
use std::collections::HashMap;

/// The parts of a mesh with one texture.
fn textured(mesh: &Mesh) -> (&[[f32; 2]], &[[u32; 3]], &Texture) {
    match mesh.appearance() {
        Appearance::Textured { uvs, uv_triangles, textures, .. } => (uvs, uv_triangles, &textures[0]),
        other => panic!("not textured: {other:?}"),
    }
}

/// The texels that bilinear filtering reads at a point of a triangle, row 0 at the top, with their weights.
fn footprint(mesh: &Mesh, triangle: usize, b: [f64; 3]) -> [([i64; 2], f64); 4] {
    let (uvs, uv_triangles, texture) = textured(mesh);
    let corners = uv_triangles[triangle].map(|i| uvs[i as usize].map(f64::from));
    let [u, v] = [0, 1].map(|k| (0..3).map(|c| b[c] * corners[c][k]).sum::<f64>());
    let (x, y) = (u * f64::from(texture.width()) - 0.5, (1.0 - v) * f64::from(texture.height()) - 0.5);
    let ([fx, fy], [tx, ty]) = ([x.floor(), y.floor()], [x - x.floor(), y - y.floor()]);
    let at = |right: bool, down: bool| {
        let weight = (if right { tx } else { 1.0 - tx }) * (if down { ty } else { 1.0 - ty });
        ([fx as i64 + i64::from(right), fy as i64 + i64::from(down)], weight)
    };
    [at(false, false), at(true, false), at(false, true), at(true, true)]
}

/// The colour of a textured mesh at a point of a triangle.
fn sampled(mesh: &Mesh, triangle: usize, b: [f64; 3]) -> [f64; 3] {
    let texture = textured(mesh).2;
    let mut color = [0.0; 3];
    for ([column, row], weight) in footprint(mesh, triangle, b) {
        let texel = texture.texels()[row as usize * texture.width() as usize + column as usize];
        (0..3).for_each(|k| color[k] += weight * f64::from(texel[k]));
    }
    color
}

/// Points of a triangle, its edges and corners among them.
fn points(random: &mut Random) -> Vec<[f64; 3]> {
    let mut points = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0 / 3.0; 3]];
    for _ in 0..60 {
        let (a, b) = (random.range(0.0, 1.0), random.range(0.0, 1.0));
        let (a, b) = if a + b > 1.0 { (1.0 - a, 1.0 - b) } else { (a, b) };
        points.extend([[a, b, 1.0 - a - b], [a, 1.0 - a, 0.0], [0.0, a, 1.0 - a], [a, 0.0, 1.0 - a]]);
    }
    points
}

/// Triangles of all shapes and sizes, each with corners and colours of its own; slivers and points among them.
fn soup(count: u32, seed: u64) -> Mesh {
    let mut random = Random::new(seed);
    let (mut positions, mut colors) = (Vec::new(), Vec::new());
    for t in 0..count {
        let size = 10f64.powf(random.range(-2.0, 0.0));
        let corner = [0; 3].map(|_: i32| [0; 3].map(|_: i32| (size * random.range(-1.0, 1.0)) as f32));
        positions.extend(match t % 8 {
            5 => [corner[0], corner[1], corner[1]],
            6 => [corner[0]; 3],
            7 => [corner[0], corner[1], [0, 1, 2].map(|k| 0.5 * (corner[0][k] + corner[1][k]))],
            _ => corner,
        });
        colors.extend([0; 3].map(|_: i32| [0; 3].map(|_: i32| random.range(0.0, 1.0) as f32)));
    }
    let triangles = (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    Mesh::new(positions, triangles).unwrap().with_appearance(Appearance::VertexColors(colors)).unwrap()
}

fn colors(mesh: &Mesh) -> &[[f32; 3]] {
    match mesh.appearance() {
        Appearance::VertexColors(colors) => colors,
        other => panic!("no vertex colours: {other:?}"),
    }
}

#[test]
fn no_texel_is_read_in_two_triangles() {
    for (count, length, most) in [(1, 0.1, 64), (2, 0.3, 64), (97, 0.05, 1024), (200, 1.0, 4096), (64, 1e-9, 150)] {
        let (painted, _) = with_atlas(&soup(count, 7 + u64::from(count)), length, most).unwrap();
        let texture = textured(&painted).2;
        let side = i64::from(texture.width());
        assert!(side <= i64::from(most) && i64::from(texture.height()) == side);
        let (mut random, mut owner) = (Random::new(3), HashMap::new());
        for triangle in 0..count as usize {
            for b in points(&mut random) {
                // Less is the weight of a coordinate's rounding.
                for (texel, _) in footprint(&painted, triangle, b).into_iter().filter(|(_, weight)| *weight > 1e-4) {
                    assert!(texel.iter().all(|x| (1..side - 1).contains(x)), "{texel:?} is on the border of {side}");
                    let first = *owner.entry(texel).or_insert(triangle);
                    assert_eq!(first, triangle, "texel {texel:?} of {count} triangles with texels of {length}");
                }
            }
        }
        // Nor is a texel of another triangle read a little beyond the edges, but for products of two such small weights.
        for triangle in 0..count as usize {
            for b in points(&mut random).into_iter().filter(|b| b.contains(&0.0)) {
                let beyond = outwards(&painted, triangle, b);
                for (texel, weight) in footprint(&painted, triangle, beyond) {
                    let others = owner.get(&texel).is_some_and(|owner| *owner != triangle);
                    assert!(!others || weight < 1e-3, "triangle {triangle} reads {texel:?} by {weight} beyond {b:?}");
                }
            }
        }
    }
}

/// A point on an edge of a triangle, moved outwards by about a fiftieth of a texel.
fn outwards(mesh: &Mesh, triangle: usize, b: [f64; 3]) -> [f64; 3] {
    let (uvs, uv_triangles, texture) = textured(mesh);
    let corners = uv_triangles[triangle].map(|i| uvs[i as usize]);
    let texels = |k: usize| {
        let most = |of: fn(f32, f32) -> f32| corners.map(|c| c[k]).into_iter().reduce(of).unwrap();
        f64::from(texture.width()) * f64::from(most(f32::max) - most(f32::min))
    };
    let moved = b.map(|x| if x == 0.0 { -0.02 / texels(0).max(texels(1)) } else { x });
    let whole: f64 = moved.iter().sum();
    moved.map(|x| x / whole)
}

#[test]
fn the_colours_are_those_of_the_mesh() {
    let mesh = soup(150, 11);
    let (painted, texel) = with_atlas(&mesh, 0.03, 2048).unwrap();
    assert_eq!(texel, 0.03);
    assert_eq!((painted.positions(), painted.triangles()), (mesh.positions(), mesh.triangles()));
    let mut random = Random::new(1);
    for (triangle, corners) in mesh.triangles().iter().enumerate() {
        let given = corners.map(|v| colors(&mesh)[v as usize].map(f64::from));
        // Beyond the edges texels are limited to the range of the three colours, which shows within the chart's longest side by up
        // to a quarter of the range where the chart has a single texel along its legs.
        for b in points(&mut random) {
            let wanted = [0, 1, 2].map(|k| (0..3).map(|c| b[c] * given[c][k]).sum::<f64>());
            let read = sampled(&painted, triangle, b);
            let off = (0..3).map(|k| (read[k] - wanted[k]).abs()).fold(0.0, f64::max);
            let is_corner = b.contains(&1.0);
            assert!(
                off < if is_corner { 1e-3 } else { 0.26 },
                "triangle {triangle} at {b:?}: {read:?}, not {wanted:?}"
            );
        }
    }
}

#[test]
fn a_slope_of_colours_is_kept_within_rounding() {
    // The charts are so large that away from the edges the filter reads no texel beyond them.
    let mut random = Random::new(4);
    let mesh = shapes::icosphere(2).unwrap();
    let slope = mesh.positions().iter().map(|p| p.map(|x| 0.5 + 0.1 * x)).collect();
    let mesh = mesh.with_appearance(Appearance::VertexColors(slope)).unwrap();
    let (painted, _) = with_atlas(&mesh, 0.02, 4096).unwrap();
    for (triangle, corners) in mesh.triangles().iter().enumerate() {
        let given = corners.map(|v| colors(&mesh)[v as usize].map(f64::from));
        for b in points(&mut random).into_iter().filter(|b| b.iter().all(|share| *share > 0.15)) {
            let read = sampled(&painted, triangle, b);
            for k in 0..3 {
                let wanted = (0..3).map(|c| b[c] * given[c][k]).sum::<f64>();
                assert!((read[k] - wanted).abs() < 1e-5, "triangle {triangle} at {b:?}: {} for {wanted}", read[k]);
            }
        }
    }
    // One colour is that colour.
    let plain = shapes::torus(0.7, 0.3, 9, 5).unwrap().with_appearance(Appearance::Uniform([0.1, 0.7, 0.3])).unwrap();
    let (painted, _) = with_atlas(&plain, 0.1, 512).unwrap();
    let read = sampled(&painted, 3, [0.2, 0.3, 0.5]);
    assert!(read.iter().zip([0.1, 0.7, 0.3]).all(|(read, wanted)| (read - wanted).abs() < 1e-6), "{read:?}");
}

#[test]
fn texels_are_as_short_as_asked_for_or_as_there_is_room_for() {
    let mesh = soup(60, 2);
    for most in [4096, 150, 60] {
        let (painted, texel) = with_atlas(&mesh, 0.005, most).unwrap();
        let (uvs, uv_triangles, texture) = textured(&painted);
        let side = f64::from(texture.width());
        assert_eq!(texel > 0.005, most < 4096, "{texel} in {most}");
        assert!(texture.width() <= most);
        for (corners, uv_corners) in mesh.triangles().iter().zip(uv_triangles) {
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                let [p, q] = [a, b].map(|c: usize| mesh.positions()[corners[c] as usize].map(f64::from));
                let [s, t] = [a, b].map(|c: usize| uvs[uv_corners[c] as usize].map(f64::from));
                let length = (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt();
                let texels = side * (s[0] - t[0]).hypot(s[1] - t[1]);
                assert!(length <= 1.0001 * texel * texels, "an edge of {length} has {texels} texels of {texel}");
            }
        }
    }
}

/// The error's two sentences.
fn refused(mesh: &Mesh, texel: f64, most: u32) -> (String, String) {
    match with_atlas(mesh, texel, most) {
        Err(Error::Fit { what, fix }) => (what, fix),
        other => panic!("not refused: {:?}", other.map(|(_, texel)| texel)),
    }
}

#[test]
fn what_has_no_atlas_is_refused() {
    let ball = shapes::icosphere(1).unwrap();
    for texel in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(refused(&ball, texel, 64).0.contains("texels of"), "{texel}");
    }
    let none = Mesh::new(vec![[0.0; 3]], Vec::new()).unwrap();
    assert!(refused(&none, 0.1, 64).0.contains("without triangles"));
    assert!(refused(&shapes::fish().unwrap(), 0.1, 64).0.contains("with a texture"));
    let (what, fix) = refused(&ball, 0.1, 0);
    assert!(what.contains("80 triangles in 0×0 texels") && fix.contains("36×36"), "{what}: {fix}");
    assert!(refused(&ball, 1e-300, 35).1.contains("36×36"));
    assert_eq!(textured(&with_atlas(&ball, 1e-300, 36).unwrap().0).2.width(), 36);
}

#[test]
fn a_million_triangles_have_an_atlas_where_there_is_room() {
    // The quick tier has a sixteenth of them, in a quarter of the texels along each side.
    let (side, most, count, room) =
        tier((177, 1024, "62658 triangles", "allow 899×899"), (708, 4096, "1002528 triangles", "allow 3596×3596"));
    let mesh = grid(side, |x, y| [x, y, 0.0]);
    let (what, fix) = refused(&mesh, 0.1, most / 2);
    assert!(what.contains(count) && fix.contains(room), "{what}: {fix}");
    let (painted, texel) = with_atlas(&mesh, 0.1, most).unwrap();
    assert!(textured(&painted).2.width() <= most && texel <= 1.0, "{texel}");
}

const VIEWS: u32 = 8;
const PIXELS: u32 = 32;
const FAR: (f64, f64) = (2.0, 6.0);

fn cameras() -> Vec<Camera> {
    let angles = (0..VIEWS).map(|i| [[35.0, -30.0][i as usize % 2], 55.0 * f64::from(i)]);
    meshes::cameras(Projection::Perspective { fov_y: 0.7 }, 4.0, angles)
}

fn settings(sigma: f64, samples: u32) -> Settings {
    Settings {
        width: PIXELS * samples,
        height: PIXELS * samples,
        sigma,
        gamma: 1e-3,
        near: FAR.0,
        far: FAR.1,
        background: Background::Composite,
        interpolation: Interpolation::Perspective,
        outputs: Outputs { color: true, silhouette: true, ..Outputs::NOTHING },
        ..Settings::default()
    }
}

/// A mesh as all views show it, each pixel the mean of nine.
fn shown(renderer: &mut Renderer, mesh: &Mesh, lights: &Lights) -> Image {
    let scene = Scene::new(mesh.clone()).with_lights(lights.clone());
    let frame = renderer.render(&scene, &cameras(), &settings(1e-7, 3)).unwrap();
    pooled(frame.color().unwrap(), 3).unwrap()
}

/// A cube with a pattern of squares of other colours on every face.
fn checkered() -> Mesh {
    const SIDE: u32 = 10;
    let cube = shapes::cube().unwrap();
    let uvs = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    // The cube's faces are squares of two triangles each, a, b, c and a, c, d.
    let uv_triangles = (0..cube.triangles().len()).map(|t| if t % 2 == 0 { [0, 1, 2] } else { [0, 2, 3] }).collect();
    let texel = |i: u32| match (i % SIDE / 2 + i / SIDE / 2) % 2 {
        0 => [0.9, 0.2, 0.1],
        _ => [0.1, 0.3, 0.8],
    };
    let image = Texture::new(SIDE, SIDE, (0..SIDE * SIDE).map(texel).collect(), Wrap::Clamp).unwrap();
    let texture_of_triangle = Vec::new();
    let appearance = Appearance::Textured { uvs, uv_triangles, textures: vec![image], texture_of_triangle };
    cube.with_appearance(appearance).unwrap()
}

/// The colours of a mesh fitted to targets, and the mean difference of what it shows from what it should.
fn recolored(renderer: &mut Renderer, mesh: &Mesh, lights: &Lights, goal: &Image) -> (Mesh, f64) {
    let options = ShapeOptions {
        fit_positions: false,
        fit_colors: true,
        color: (ImageLoss::L1, 1.0),
        regularizers: vec![],
        ..ShapeOptions::smooth()
    };
    let targets = Views { cameras: cameras(), color: Some(goal.clone()), ..Views::default() };
    let mut fit = ShapeFit::new(mesh.clone(), lights.clone(), options).unwrap();
    let rate = Schedule::Exponential { from: 0.1, to: 0.005 };
    let steps = tier(25, 40);
    for step in 0..steps {
        fit.step(renderer, &settings(1e-6, 1), &targets, 0.0, rate.at_step(step, steps)).unwrap();
    }
    let seen = shown(renderer, fit.mesh(), lights);
    (fit.mesh().clone(), ImageLoss::L1.evaluate(&seen, goal, None).unwrap().value)
}

#[test]
fn texels_show_what_vertex_colours_cannot() {
    let mut renderer = crate::common::renderer();
    let goal = checkered();
    let light = DirectionalLight { direction: [0.3, 0.8, 0.5], color: [1.0; 3], intensity: 0.6 };
    let lit = Lights { ambient_intensity: 0.4, directional: vec![light], ..Lights::unlit() };
    for lights in tier(vec![lit.clone()], vec![Lights::unlit(), lit]) {
        let target = shown(&mut renderer, &goal, &lights);
        let grey = vec![[0.5; 3]; goal.positions().len()];
        let plain = goal.clone().with_appearance(Appearance::VertexColors(grey)).unwrap();
        let (by_vertex, coarse) = recolored(&mut renderer, &plain, &lights, &target);
        let (start, _) = with_atlas(&by_vertex, 0.08, 512).unwrap();
        let before = ImageLoss::L1.evaluate(&shown(&mut renderer, &start, &lights), &target, None).unwrap().value;
        assert!((before - coarse).abs() < 0.02 * coarse, "the atlas shows other colours: {before}, not {coarse}");
        let (by_texel, fine) = recolored(&mut renderer, &start, &lights, &target);
        assert!(fine < 0.25 * coarse, "{fine} by texels, {coarse} by vertices");
        // The texels are what the surface reflects, not what it shows: without light it has the goal's colours.
        let bare = shown(&mut renderer, &goal, &Lights::unlit());
        let albedo = shown(&mut renderer, &by_texel, &Lights::unlit());
        let off = ImageLoss::L1.evaluate(&albedo, &bare, None).unwrap().value;
        assert!(off < 0.5 * coarse, "{off} without light, {coarse} by vertices");
        if lights == Lights::unlit() {
            let (again, _) = recolored(&mut renderer, &start, &lights, &target);
            assert!(again == by_texel, "the same input gives other texels");
        }
    }
}

#[test]
fn what_no_view_sees_keeps_its_colour() {
    let mut renderer = crate::common::renderer();
    // A small ball within a large one.
    let ball = shapes::icosphere(2).unwrap();
    let mesh = both(&ball, &moved(&ball, 0.3, [0.0; 3]));
    let count = ball.positions().len() as u32;
    let colors = (0..2 * count).map(|v| if v < count { [0.5; 3] } else { [0.2, 0.6, 0.4] }).collect();
    let mesh = mesh.with_appearance(Appearance::VertexColors(colors)).unwrap();
    let (start, _) = with_atlas(&mesh, 0.1, 1024).unwrap();
    let red = ball.clone().with_appearance(Appearance::Uniform([0.9, 0.1, 0.1])).unwrap();
    let unlit = Lights::unlit();
    let target = shown(&mut renderer, &red, &unlit);
    let (found, _) = recolored(&mut renderer, &start, &unlit, &target);
    let centre = |triangle: usize| sampled(&found, triangle, [1.0 / 3.0; 3]);
    let count = ball.triangles().len();
    let [red, green] = [0, 1].map(|k| (0..count).map(|t| centre(t)[k]).sum::<f64>() / count as f64);
    assert!(red > 0.75 && green < 0.25, "the outside became {red}, {green}");
    for triangle in count..2 * count {
        let inside = centre(triangle);
        assert!(inside.iter().zip([0.2, 0.6, 0.4]).all(|(x, kept)| (x - kept).abs() < 1e-6), "{inside:?}");
    }
}
