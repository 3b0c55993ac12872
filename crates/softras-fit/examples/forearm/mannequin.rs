//! A jointed doll: torso, head, two arms and two legs, each a closed tube in colours of its own.

use super::figure::{Figure, Weights};
use super::skeleton::{Bone, Skeleton};
use softras::glam::DVec3;
use softras::scene::Appearance;
use softras::{Mesh, Result};
use std::f64::consts::TAU;

/// Vertices around a tube.
const AROUND: u32 = 8;
/// Intervals between two given sections of a tube, divided by `FINE` - 1 rings more.
const FINE: usize = 2;
/// A joint bends the tube this far above and below it.
const BEND: f64 = 0.06;

type Color = [f32; 3];

/// A cross-section: height, half the width, half the depth, colour.
type Section = (f64, f64, f64, Color);

/// An upright tube at some x: its sections from top to bottom, and its bones, each with the height below which it moves the tube.
struct Tube<'a> {
    x: f64,
    sections: &'a [Section],
    bones: &'a [(usize, f64)],
}

const TORSO: usize = 0;
const HEAD: usize = 1;
/// The hidden bone; its joint is the elbow.
pub const LEFT_FOREARM: usize = 5;
const SHIRT: Color = [0.08, 0.17, 0.55];
const SKIN: Color = [0.80, 0.50, 0.32];
const TORSO_SECTIONS: [Section; 7] = [
    (0.59, 0.12, 0.08, SHIRT),
    (0.53, 0.31, 0.12, SHIRT),
    (0.38, 0.34, 0.14, SHIRT),
    (0.20, 0.16, 0.12, SHIRT),
    (0.10, 0.16, 0.12, SHIRT),
    (-0.10, 0.32, 0.13, SHIRT),
    (-0.29, 0.24, 0.10, SHIRT),
];
const HEAD_SECTIONS: [Section; 5] = [
    (0.97, 0.07, 0.07, SKIN),
    (0.88, 0.14, 0.14, SKIN),
    (0.76, 0.15, 0.15, SKIN),
    (0.65, 0.09, 0.10, SKIN),
    (0.52, 0.07, 0.07, SKIN),
];
/// How far from the middle arms and legs hang.
const SHOULDER: [f64; 2] = [0.36, 0.44];
const HIP: [f64; 2] = [0.14, -0.18];
const ELBOW: f64 = 0.10;
const KNEE: f64 = -0.58;

/// A doll of 2 units' height that stands upright about the origin and looks towards +z, arms hanging down: 1120
/// triangles, 10 bones of 19 angles. "left" is its own left, at +x.
///
/// Positive angles about the first axis of shoulders and hips (x) swing a limb back, those about the second (z) swing it
/// towards +x; a shoulder's third (y) twists the arm. Elbows and knees bend about x, back for positive angles.
pub fn mannequin() -> Result<Figure> {
    let arm = |sleeve: Color, hand: Color| {
        [
            (0.50, 0.06, 0.06, sleeve),
            (0.40, 0.075, 0.075, sleeve),
            (0.14, 0.06, 0.06, sleeve),
            (0.06, 0.055, 0.055, SKIN),
            (-0.16, 0.05, 0.05, SKIN),
            (-0.24, 0.075, 0.055, hand),
            (-0.36, 0.07, 0.05, hand),
            (-0.41, 0.03, 0.03, hand),
        ]
    };
    let leg = |trousers: Color| {
        [
            (-0.12, 0.09, 0.09, trousers),
            (-0.24, 0.115, 0.11, trousers),
            (-0.56, 0.075, 0.08, trousers),
            (-0.88, 0.055, 0.06, trousers),
            (-0.98, 0.05, 0.06, [0.05, 0.05, 0.05]),
        ]
    };
    let arms = [arm([0.06, 0.42, 0.12], [0.90, 0.70, 0.05]), arm([0.75, 0.22, 0.02], [0.80, 0.02, 0.05])];
    let legs = [leg([0.28, 0.08, 0.35]), leg([0.04, 0.35, 0.40])];
    let mut tubes = vec![
        Tube { x: 0.0, sections: &TORSO_SECTIONS, bones: &[(TORSO, 0.0)] },
        Tube { x: 0.0, sections: &HEAD_SECTIONS, bones: &[(HEAD, 0.0)] },
    ];
    let inside =
        [[(2, 0.0), (3, ELBOW)], [(4, 0.0), (LEFT_FOREARM, ELBOW)], [(6, 0.0), (7, KNEE)], [(8, 0.0), (9, KNEE)]];
    for (side, sign) in [(0, -1.0), (1, 1.0)] {
        tubes.push(Tube { x: sign * SHOULDER[0], sections: &arms[side], bones: &inside[side] });
        tubes.push(Tube { x: sign * HIP[0], sections: &legs[side], bones: &inside[2 + side] });
    }
    let mut parts = Parts::default();
    tubes.iter().for_each(|tube| parts.add(tube));
    let mesh = Mesh::new(parts.positions, parts.triangles)?.with_appearance(Appearance::VertexColors(parts.colors))?;
    Ok(Figure { mesh, skeleton: Skeleton { bones: bones() }, weights: parts.weights })
}

fn bones() -> Vec<Bone> {
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let bone = |parent, at: f64, [from, to]: [f64; 2], axes: &[DVec3]| Bone {
        parent,
        head: DVec3::new(at, from, 0.0),
        tail: DVec3::new(at, to, 0.0),
        axes: axes.to_vec(),
    };
    let [shoulder, hip] = [SHOULDER, HIP];
    // Torso and head; right and left upper arm and forearm; right and left thigh and shin.
    vec![
        bone(None, 0.0, [-0.15, 0.5], &[x, y, z]),
        bone(Some(TORSO), 0.0, [0.55, 0.95], &[x, z]),
        bone(Some(TORSO), -shoulder[0], [shoulder[1], ELBOW], &[x, z, y]),
        bone(Some(2), -shoulder[0], [ELBOW, -0.41], &[x]),
        bone(Some(TORSO), shoulder[0], [shoulder[1], ELBOW], &[x, z, y]),
        bone(Some(4), shoulder[0], [ELBOW, -0.41], &[x]),
        bone(Some(TORSO), -hip[0], [hip[1], KNEE], &[x, z]),
        bone(Some(6), -hip[0], [KNEE, -0.95], &[x]),
        bone(Some(TORSO), hip[0], [hip[1], KNEE], &[x, z]),
        bone(Some(8), hip[0], [KNEE, -0.95], &[x]),
    ]
}

#[derive(Default)]
struct Parts {
    positions: Vec<[f32; 3]>,
    colors: Vec<Color>,
    weights: Vec<Weights>,
    triangles: Vec<[u32; 3]>,
}

impl Parts {
    fn add(&mut self, tube: &Tube<'_>) {
        let rings = rings(tube.sections);
        let (Some(&top), Some(&bottom)) = (rings.first(), rings.last()) else { return };
        let first = self.positions.len() as u32;
        // A pole closes each end. It lies beyond the end's section by half of that section's half depth.
        self.vertex(tube, DVec3::new(tube.x, top.0 + 0.5 * top.2, 0.0), top.3);
        for &(height, width, depth, color) in &rings {
            for j in 0..AROUND {
                let (sin, cos) = (TAU * f64::from(j) / f64::from(AROUND)).sin_cos();
                self.vertex(tube, DVec3::new(tube.x + width * cos, height, depth * sin), color);
            }
        }
        self.vertex(tube, DVec3::new(tube.x, bottom.0 - 0.5 * bottom.2, 0.0), bottom.3);
        let last = self.positions.len() as u32 - 1;
        let at = |ring: u32, j: u32| first + 1 + ring * AROUND + j % AROUND;
        let rings = rings.len() as u32;
        for j in 0..AROUND {
            self.triangles.push([first, at(0, j + 1), at(0, j)]);
            for ring in 0..rings - 1 {
                let [a, b, c, d] = [at(ring, j), at(ring, j + 1), at(ring + 1, j + 1), at(ring + 1, j)];
                self.triangles.extend([[a, b, c], [a, c, d]]);
            }
            self.triangles.push([last, at(rings - 1, j), at(rings - 1, j + 1)]);
        }
    }

    fn vertex(&mut self, tube: &Tube<'_>, position: DVec3, color: Color) {
        self.positions.push(position.as_vec3().to_array());
        self.colors.push(color);
        self.weights.push(match *tube.bones {
            [(above, _), (below, joint), ..] => {
                let t = ((joint + BEND - position.y) / (2.0 * BEND)).clamp(0.0, 1.0);
                let share = t * t * (3.0 - 2.0 * t);
                vec![(above, 1.0 - share), (below, share)]
            }
            [(bone, _)] => vec![(bone, 1.0)],
            [] => Vec::new(),
        });
    }
}

/// The sections and [`FINE`] - 1 between any two.
fn rings(sections: &[Section]) -> Vec<Section> {
    let between = |pair: &[Section]| {
        let (a, b) = (pair[0], pair[1]);
        (0..FINE).map(move |i| {
            let t = i as f64 / FINE as f64;
            let mix = |a: f64, b: f64| a + t * (b - a);
            let color = if t < 0.5 { a.3 } else { b.3 };
            (mix(a.0, b.0), mix(a.1, b.1), mix(a.2, b.2), color)
        })
    };
    sections.windows(2).flat_map(between).chain(sections.last().copied()).collect()
}
