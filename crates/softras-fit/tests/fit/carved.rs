//! Meshes cut to silhouettes: holes open, parts come, overlaps go, and what no silhouette speaks against stays.

use crate::common::{renderer, tier};
use crate::meshes::{self, PERSPECTIVE, both, cameras, genus, moved};
use glam::DVec3;
use softras::scene::Appearance;
use softras::{Error, Image, Mesh, Renderer, shapes};
use softras_fit::{Voxels, evened, is_closed, overlap};
use softras_io::Views;

const HEIGHT: u32 = 64;
const WIDTH: u32 = 80;

fn silhouettes(renderer: &mut Renderer, mesh: &Mesh) -> Views {
    let angles = (0..14).map(|i| [f64::from((i * 37) % 150 - 75), 51.0 * f64::from(i)]);
    meshes::silhouettes(renderer, mesh, cameras(PERSPECTIVE, 5.0, angles), (WIDTH, HEIGHT))
}

fn carved(targets: &Views, mesh: &Mesh, missing: Option<&Image>) -> Mesh {
    softras_fit::carved(targets, mesh, missing, [0.0; 3], 3.0, 64).unwrap()
}

/// A voxel of the result is inside where it is inside the ball of radius `radius` and in every silhouette. Voxels within a pixel
/// of an outline or a sample of the ball are left out: the samples are of that size.
fn differs(result: &Mesh, targets: &Views, radius: f64) -> (usize, usize) {
    const N: usize = 40;
    let (low, side) = ([-1.5; 3], 3.0);
    let voxels = Voxels::new(result, low, side, N).unwrap();
    let silhouette = targets.silhouette.as_ref().unwrap();
    let (mut wrong, mut looked_at) = (0, 0);
    for (i, inside) in voxels.inside().iter().enumerate() {
        let p = DVec3::from([i % N, i / N % N, i / N / N].map(|k| (k as f64 + 0.5) * side / N as f64 - 1.5));
        let mut seen = Vec::new();
        for (view, camera) in targets.cameras.iter().enumerate() {
            let [column, row, _] = camera.project(p, (80, 64)).unwrap();
            for (down, right) in (-1..=1).flat_map(|down| (-1..=1).map(move |right| (down, right))) {
                let (row, column) = (row as i64 + down, column as i64 + right);
                let shown = (0..64).contains(&row) && (0..80).contains(&column);
                seen.push((view, shown && silhouette.pixel(view, row as usize, column as usize)[0] > 0.5));
            }
        }
        let by_view: Vec<usize> = seen.chunks(9).map(|view| view.iter().filter(|(_, shown)| *shown).count()).collect();
        let sure_out = by_view.contains(&0) || p.length() > radius + 0.07;
        let sure_in = by_view.iter().all(|count| *count == 9) && p.length() < radius - 0.07;
        looked_at += usize::from(sure_in || sure_out);
        wrong += usize::from(sure_in && !inside || sure_out && *inside);
    }
    (wrong, looked_at)
}

#[test]
fn a_covered_hole_opens_and_all_else_stays() {
    let mut renderer = renderer();
    let torus = shapes::torus(0.8, 0.3, 48, 24).unwrap();
    let targets = silhouettes(&mut renderer, &torus);
    // A ball that reaches half into the torus, and one around it all.
    for radius in tier(vec![0.8f32], vec![0.8, 1.3]) {
        let ball = moved(&shapes::icosphere(4).unwrap(), radius, [0.0; 3]);
        let cut = carved(&targets, &ball, None);
        assert!(is_closed(&cut).unwrap());
        assert_eq!(genus(&cut), (1, Some(1)), "radius {radius}");
        assert_eq!(genus(&evened(&cut, 0.1).unwrap()), (1, Some(1)), "radius {radius}");
        let (wrong, looked_at) = differs(&cut, &targets, f64::from(radius));
        assert!(looked_at > 50_000 && wrong < 10, "radius {radius}: {wrong} of {looked_at}");
        let (wrong, _) = differs(&ball, &targets, f64::from(radius));
        assert!(wrong > 500, "the ball itself would not be told from it: {wrong}");
    }
    // A mesh that lies within its silhouettes keeps its surface but for the samples.
    let (small, within) = (moved(&shapes::icosphere(4).unwrap(), 0.6, [0.0; 3]), shapes::icosphere(3).unwrap());
    let kept = carved(&silhouettes(&mut renderer, &within), &small, None);
    let off = kept.positions().iter().map(|p| (DVec3::from(p.map(f64::from)).length() - 0.6).abs());
    assert!(off.fold(0.0, f64::max) < 0.005);
}

#[test]
fn a_part_that_is_left_out_comes_as_the_hull_has_it() {
    let mut renderer = renderer();
    let ball = shapes::icosphere(3).unwrap();
    let (left, right) = (moved(&ball, 0.4, [-0.6, 0.2, 0.0]), moved(&ball, 0.3, [0.7, -0.3, 0.2]));
    let mut targets = silhouettes(&mut renderer, &both(&left, &right));
    let marks = silhouettes(&mut renderer, &right).silhouette.unwrap();
    // One view in which the parts are beside each other is enough.
    let only = |view: usize| {
        let mut marks = marks.clone();
        let pixels = (HEIGHT * WIDTH) as usize;
        marks.data.iter_mut().enumerate().filter(|(i, _)| i / pixels != view).for_each(|(_, x)| *x = 0.0);
        marks
    };
    let alone = carved(&targets, &left, None);
    assert_eq!(genus(&alone), (1, Some(0)));
    assert_eq!(carved(&targets, &left, Some(&only(usize::MAX))), alone, "nothing is marked");
    let hull = softras_fit::visual_hull(&targets, [0.0; 3], 3.0, 64).unwrap();
    let found = carved(&targets, &left, Some(&only(0)));
    assert_eq!(genus(&found), (2, Some(0)));
    let of_right = |mesh: &Mesh| mesh.positions().iter().filter(|p| p[0] > 0.3).copied().collect::<Vec<_>>();
    assert_eq!(of_right(&found), of_right(&hull), "the hull's own vertices");
    let mut few = marks.clone();
    few.batch -= 1;
    few.data.truncate(few.batch * (HEIGHT * WIDTH) as usize);
    let refused = |targets: &Views, mesh: &Mesh, marks: Option<&Image>| {
        matches!(softras_fit::carved(targets, mesh, marks, [0.0; 3], 3.0, 64), Err(Error::Fit { .. }))
    };
    assert!(refused(&targets, &left, Some(&few)), "marks of fewer views");
    assert!(refused(&targets, &moved(&ball, 0.1, [0.0, 1.2, 0.0]), None), "nothing is left");
    targets.silhouette = None;
    assert!(refused(&targets, &left, None), "no silhouettes");
}

#[test]
fn parts_that_overlap_become_one_in_their_colours() {
    let ball = shapes::icosphere(4).unwrap();
    let two = both(&moved(&ball, 0.6, [-0.3, 0.0, 0.0]), &moved(&ball, 0.6, [0.3, 0.0, 0.0]));
    let colors = two.positions().iter().map(|p| if p[0] < 0.0 { [1.0, 0.0, 0.0] } else { [0.0, 0.0, 1.0] }).collect();
    let two = two.with_appearance(Appearance::VertexColors(colors)).unwrap();
    // Two balls of radius r whose centres are r apart have 5/27 of their union in common.
    let twice = overlap(&two, 96).unwrap();
    assert!((twice - 5.0 / 27.0).abs() < 0.01, "{twice}");
    let targets = silhouettes(&mut renderer(), &two);
    let one = carved(&targets, &two, None);
    assert_eq!((genus(&two), genus(&one)), ((2, Some(0)), (1, Some(0))));
    assert_eq!(overlap(&one, 96).unwrap(), 0.0);
    let Appearance::VertexColors(colors) = one.appearance() else { panic!("the colours are gone") };
    for (p, color) in one.positions().iter().zip(colors) {
        let expected = if p[0] < 0.0 { [1.0, 0.0, 0.0] } else { [0.0, 0.0, 1.0] };
        assert!(p[0].abs() < 0.1 || *color == expected, "{color:?} at {p:?}");
    }
    // A mesh that is inside out is wrong everywhere, an open one nowhere that can be told.
    let turned = Mesh::new(ball.positions().to_vec(), ball.triangles().iter().map(|&[a, b, c]| [a, c, b]).collect());
    assert_eq!((overlap(&ball, 32).unwrap(), overlap(&turned.unwrap(), 32).unwrap()), (0.0, 1.0));
    assert!(overlap(&ball, 0).is_err());
}
