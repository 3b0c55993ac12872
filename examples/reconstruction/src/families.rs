//! Procedural families of furniture. An object is drawn from a seed, with some twenty parameters; no part is thinner than
//! two voxels of the evaluation, since a smooth sphere cannot learn thinner ones.

use crate::solid::{Section, Solid};
use softras::{Mesh, Result};
use softras_check::random::Random;

/// The longest side of every object.
pub const EXTENT: f64 = 0.9;
/// The least thickness of a part. Before they are scaled to [`EXTENT`] objects are at most 1.17 in size, so this is two voxels.
const LEAST: f64 = 0.085;

/// The names of the families.
pub const NAMES: [&str; 5] = ["bed", "chair", "lamp", "sofa", "table"];

/// An object of a family; `None` for an unknown name.
pub fn object(family: &str, seed: u64) -> Option<Result<Mesh>> {
    let index = NAMES.iter().position(|name| *name == family)?;
    let draw = [bed, chair, lamp, sofa, table][index];
    let mut solid = Solid::default();
    draw(&mut Random::new(seed.wrapping_mul(NAMES.len() as u64).wrapping_add(index as u64)), &mut solid);
    Some(solid.mesh(EXTENT))
}

/// A colour that is neither black nor too bright for light on it.
fn paint(random: &mut Random) -> [f32; 3] {
    [(); 3].map(|()| random.range(0.15, 0.95) as f32)
}

/// Four legs below a rectangle, from the floor to `height`; they may spread outwards and taper.
fn legs(random: &mut Random, solid: &mut Solid, half: [f64; 2], height: f64, color: [f32; 3]) {
    let thick = random.range(LEAST, 0.15) / 2.0;
    let taper = random.range(0.8, 1.0);
    let spread = random.range(0.0, 0.08);
    let sides = random.choose(&[4, 4, 10]);
    for (x, z) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
        let top = [x * (half[0] - thick), z * (half[1] - thick)];
        let foot = [top[0] + x * spread, top[1] + z * spread];
        let low = Section::new(foot, [(thick * taper).max(LEAST / 2.0); 2]);
        solid.prism(sides, (0.0, low), (height, Section::new(top, [thick; 2])), color);
    }
}

/// The support of a seat or a table's top: legs, a pedestal, two panels, or a block.
fn support(random: &mut Random, solid: &mut Solid, half: [f64; 2], height: f64, color: [f32; 3]) {
    match random.below(6) {
        0 => {
            let (post, foot) = (random.range(0.06, 0.12), random.range(0.5, 0.9));
            let (plate, sides) = (random.range(LEAST, 0.12), random.choose(&[4, 6, 14]));
            let reach = half[0].min(half[1]) * foot;
            let section = |half: f64| Section::new([0.0; 2], [half; 2]);
            solid.prism(sides, (0.0, section(reach)), (plate, section(reach * random.range(0.6, 1.0))), color);
            solid.prism(sides, (plate / 2.0, section(post)), (height, section(post * random.range(0.8, 1.3))), color);
        }
        1 => {
            let (thick, depth) = (random.range(LEAST, 0.14), half[1] * random.range(0.7, 1.0));
            for x in [-half[0], half[0] - thick] {
                solid.block([x, 0.0, -depth], [x + thick, height, depth], color);
            }
        }
        2 => {
            let [x, z] = half.map(|half| half * random.range(0.55, 0.95));
            let low = Section::new([0.0; 2], [x * random.range(0.7, 1.1), z]);
            solid.prism(4, (0.0, low), (height, Section::new([0.0; 2], [x, z])), color);
        }
        _ => legs(random, solid, half, height, color),
    }
}

fn chair(random: &mut Random, solid: &mut Solid) {
    let [seat_color, frame, back_color] = [(); 3].map(|()| paint(random));
    let half = [random.range(0.22, 0.34), random.range(0.22, 0.32)];
    let (height, thick) = (random.range(0.28, 0.48), random.range(LEAST, 0.16));
    support(random, solid, half, height, frame);
    solid.block([-half[0], height, -half[1]], [half[0], height + thick, half[1]], seat_color);
    let (rise, back) = (random.range(0.25, 0.6), random.range(LEAST, 0.13) / 2.0);
    let (tilt, narrow) = (random.range(0.0, 0.14), random.range(0.7, 1.05));
    let foot = [0.0, half[1] - back];
    let top = [0.0, foot[1] + tilt];
    let low = Section::new(foot, [half[0], back]);
    let high = Section::new(top, [half[0] * narrow, back]);
    let start = height + thick / 2.0;
    solid.prism(4, (start, low), (start + rise, high), back_color);
    if random.chance(0.4) {
        let (up, wide) = (random.range(0.14, 0.26), random.range(LEAST, 0.12));
        for x in [-half[0], half[0] - wide] {
            let at = height + thick + up;
            solid.block([x, start, -half[1]], [x + wide, at, half[1]], frame);
        }
    }
}

fn table(random: &mut Random, solid: &mut Solid) {
    let [top_color, frame] = [(); 2].map(|()| paint(random));
    let half = [random.range(0.3, 0.5), random.range(0.22, 0.42)];
    let (height, thick) = (random.range(0.25, 0.6), random.range(LEAST, 0.15));
    support(random, solid, half.map(|half| half * 0.92), height, frame);
    let sides = random.choose(&[4, 4, 8, 24]);
    let section = Section::new([0.0; 2], half);
    let rim = Section::new([0.0; 2], half.map(|half| half * random.range(0.85, 1.0)));
    solid.prism(sides, (height, rim), (height + thick, section), top_color);
    if random.chance(0.35) {
        let (at, share) = (height * random.range(0.25, 0.5), random.range(0.6, 0.85));
        let [x, z] = half.map(|half| half * share);
        solid.block([-x, at, -z], [x, at + LEAST, z], frame);
    }
    if random.chance(0.3) {
        let (drop, [x, z]) = (random.range(LEAST, 0.18), half.map(|half| half * 0.8));
        solid.block([-x, height - drop, -z], [x, height, z], top_color);
    }
}

fn sofa(random: &mut Random, solid: &mut Solid) {
    let [fabric, frame, cushion] = [(); 3].map(|()| paint(random));
    let half = [random.range(0.36, 0.5), random.range(0.18, 0.26)];
    let (lift, seat) = (random.range(0.0, 0.1), random.range(0.13, 0.22));
    if lift > 0.04 {
        legs(random, solid, half, LEAST + lift, frame);
    }
    let low = if lift > 0.04 { LEAST + lift } else { 0.0 };
    solid.block([-half[0], low, -half[1]], [half[0], low + seat, half[1]], fabric);
    let (rise, back, tilt) = (random.range(0.14, 0.34), random.range(0.1, 0.16) / 2.0, random.range(0.0, 0.08));
    let foot = Section::new([0.0, half[1] - back], [half[0], back]);
    let top = Section::new([0.0, half[1] - back + tilt], [half[0] * random.range(0.85, 1.0), back]);
    solid.prism(4, (low, foot), (low + seat + rise, top), fabric);
    let (arm, up) = (random.range(LEAST, 0.15), random.range(0.05, 0.2));
    let arms = random.below(4);
    for (side, x) in [-half[0], half[0] - arm].into_iter().enumerate() {
        if arms != side {
            solid.block([x, low, -half[1]], [x + arm, low + seat + up, half[1]], fabric);
        }
    }
    if random.chance(0.3) {
        let (reach, wide) = (random.range(0.15, 0.32), random.range(0.2, 0.32));
        let x = if random.chance(0.5) { -half[0] } else { half[0] - wide };
        solid.block([x, low, -half[1] - reach], [x + wide, low + seat, -half[1] + 0.02], fabric);
    }
    let (plump, front) = (random.range(0.02, 0.07), half[1] * random.range(0.8, 1.0));
    let [from, to] = [-half[0] + arm, half[0] - arm];
    solid.block([from, low + seat - 0.05, -front], [to, low + seat + plump, half[1] - back], cushion);
}

fn lamp(random: &mut Random, solid: &mut Solid) {
    let [foot_color, pole, shade] = [(); 3].map(|()| paint(random));
    let sides = random.choose(&[4, 6, 16]);
    let (wide, flat) = (random.range(0.12, 0.26), random.range(LEAST, 0.2));
    let section = |center: [f64; 2], half: f64| Section::new(center, [half; 2]);
    let narrow = wide * random.range(0.45, 1.0);
    solid.prism(sides, (0.0, section([0.0; 2], wide)), (flat, section([0.0; 2], narrow)), foot_color);
    let (thick, height) = (random.range(LEAST / 2.0, 0.075), random.range(0.2, 0.6));
    let lean = [random.range(-0.14, 0.14), random.range(-0.14, 0.14)];
    let bulge = random.range(1.0, 1.8);
    let middle = flat + height * random.range(0.3, 0.6);
    let halfway = lean.map(|x| x * (middle - flat) / height);
    let round = random.choose(&[4, 12]);
    solid.prism(round, (flat / 2.0, section([0.0; 2], thick)), (middle, section(halfway, thick * bulge)), pole);
    solid.prism(round, (middle, section(halfway, thick * bulge)), (flat + height, section(lean, thick)), pole);
    let (broad, tall) = (random.range(0.16, 0.34), random.range(0.16, 0.4));
    let above = broad * random.range(0.35, 1.1);
    let faces = random.choose(&[4, 8, 18]);
    let low = flat + height - tall * random.range(0.1, 0.5);
    solid.prism(faces, (low, section(lean, broad)), (low + tall, section(lean, above)), shade);
}

fn bed(random: &mut Random, solid: &mut Solid) {
    let [frame, sheet, pillow] = [(); 3].map(|()| paint(random));
    let half = [random.range(0.22, 0.4), random.range(0.4, 0.52)];
    let (lift, base) = (random.range(LEAST, 0.2), random.range(LEAST, 0.14));
    if random.chance(0.6) {
        legs(random, solid, half, lift, frame);
    } else {
        let [x, z] = half.map(|half| half * random.range(0.75, 1.0));
        solid.block([-x, 0.0, -z], [x, lift, z], frame);
    }
    solid.block([-half[0], lift, -half[1]], [half[0], lift + base, half[1]], frame);
    let (soft, inset) = (random.range(0.06, 0.16), random.range(0.9, 1.0));
    let level = lift + base + soft;
    solid.block([-half[0] * inset, lift, -half[1] * inset], [half[0] * inset, level, half[1] * inset], sheet);
    let (head, thick) = (random.range(0.12, 0.45), random.range(LEAST, 0.12));
    solid.block([-half[0], 0.0, half[1] - thick], [half[0], level + head, half[1]], frame);
    if random.chance(0.6) {
        let up = random.range(0.03, 0.25);
        solid.block([-half[0], 0.0, -half[1]], [half[0], level + up, -half[1] + thick], frame);
    }
    let (count, plump) = (1 + random.below(2), random.range(0.05, 0.1));
    let (length, gap) = (random.range(0.14, 0.22), 0.03);
    let wide = (2.0 * half[0] * inset - gap * (count as f64 + 1.0)) / count as f64;
    for i in 0..count {
        let x = -half[0] * inset + gap + i as f64 * (wide + gap);
        let z = half[1] - thick - length;
        solid.block([x, level - 0.04, z], [x + wide, level + plump, z + length], pillow);
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use softras_fit::is_closed;

    #[test]
    fn families_are_closed_and_differ() {
        for name in NAMES {
            let draw = |seed| object(name, seed).unwrap().unwrap();
            assert_eq!(draw(3), draw(3));
            for seed in 0..20 {
                let mesh = draw(seed);
                assert!(is_closed(&mesh).unwrap(), "{name} {seed}");
                assert_ne!(mesh, draw(seed + 1), "{name} {seed}");
                let (low, high) = mesh.bounds().unwrap();
                let longest = (0..3).map(|k| high[k] - low[k]).fold(0.0, f32::max);
                assert!((f64::from(longest) - EXTENT).abs() < 1e-5, "{name} {seed}: {longest}");
            }
        }
        assert!(object("ship", 0).is_none());
    }
}
