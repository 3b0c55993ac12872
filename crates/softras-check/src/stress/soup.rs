//! Difficult triangles: without area, thin, doubled, coincident, intersecting, huge, on pixel centres and borders.

use crate::random::Random;
use glam::{DQuat, DVec3};
use softras::{Mesh, Result, Settings, shapes};

/// The space that triangles are placed in so that the camera sees some of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// Around the origin of the world.
    World,
    /// In front of a camera at the origin that looks along +z.
    View,
    /// In screen units, z the depth.
    Screen,
}

/// A mesh under construction.
pub(super) struct Soup {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    /// Some triangle is so thin that its f32 barycentrics are inaccurate.
    pub thin: bool,
    /// Some derivative is one-sided: corners coincide, or a pixel's centre lies on an edge.
    pub kinked: bool,
}

impl Soup {
    /// Makes the mesh.
    pub fn mesh(self) -> Result<Mesh> {
        Mesh::new(self.positions, self.triangles)
    }

    /// Adds one of the library's shapes where the camera looks, its vertices moved a little: a surface whose triangles
    /// share their corners, though no two triangles are alike. Some are seen edge-on, as thin triangles.
    pub fn add_surface(&mut self, random: &mut Random, settings: &Settings, place: Place) -> Result<()> {
        let shape = match random.below(4) {
            0 => shapes::fish(),
            1 => shapes::torus(0.7, 0.3, 8 + random.below(50) as u32, 8 + random.below(30) as u32),
            2 => shapes::icosphere(4),
            _ => shapes::icosphere(3),
        }?;
        let corners = plain(random, settings, place);
        let (centre, reach) = match place {
            Place::World => (DVec3::ZERO, DVec3::ONE),
            Place::View => (corners[0], DVec3::new(corners[0].z, corners[0].z, 0.1)),
            Place::Screen => (corners[0], DVec3::new(1.0, 1.0, 0.1)),
        };
        let turn = DQuat::from_axis_angle(random.direction(), random.range(0.0, 6.0));
        let size = random.range(0.3, 1.2);
        self.thin = true;
        let first = self.positions.len() as u32;
        for p in shape.positions() {
            let p = turn * DVec3::from(p.map(f64::from)) * size + random.direction() * 0.002;
            self.positions.push((centre + p * reach).as_vec3().to_array());
        }
        self.triangles.extend(shape.triangles().iter().map(|t| t.map(|i| first + i)));
        Ok(())
    }

    fn push(&mut self, corners: [DVec3; 3]) {
        let first = self.positions.len() as u32;
        self.positions.extend(corners.map(|p| p.as_vec3().to_array()));
        self.triangles.push([first, first + 1, first + 2]);
    }

    fn last(&self) -> Option<[DVec3; 3]> {
        let last = self.triangles.last()?;
        Some(last.map(|i| DVec3::from(self.positions[i as usize].map(f64::from))))
    }
}

/// Draws `count` triangles; tame ones lie between near and far and within a few units.
pub(super) fn soup(random: &mut Random, settings: &Settings, place: Place, count: usize, tame: bool) -> Soup {
    let mut soup = Soup { positions: Vec::new(), triangles: Vec::new(), thin: false, kinked: false };
    // One scale for the whole scene, or one for each triangle.
    let scale = if tame || random.chance(0.6) { 1.0 } else { random.log_range(1e-20, 1e20) };
    let mixed = !tame && random.chance(0.2);
    for _ in 0..count {
        let plain = plain(random, settings, place);
        let corners = match random.below(if tame { 9 } else { 16 }) {
            0 => {
                soup.kinked = true;
                degenerate(random, plain, tame)
            }
            1 => {
                soup.thin = true;
                needle(random, plain, tame)
            }
            // An earlier triangle again, with the same vertices.
            2 if !soup.triangles.is_empty() => {
                let same = soup.triangles[random.below(soup.triangles.len())];
                soup.triangles.push(same);
                continue;
            }
            // In the plane of the last triangle, or through its middle.
            3 => soup.last().map_or(plain, |last| last.map(|p| p + (last[1] - last[0]) * 0.25)),
            4 => soup.last().map_or(plain, |last| piercing(random, last)),
            5 if place == Place::Screen => {
                soup.kinked = true;
                plain.map(|p| on_grid(random, settings, p))
            }
            9 => plain.map(|p| p * random.log_range(1.0, 1e20)),
            10 => plain.map(|p| p * random.log_range(1e-45, 1.0)),
            11 => special_depth(random, settings, plain),
            12 => [plain[0], plain[1], plain[2] * random.log_range(1.0, 1e20)],
            13 => plain.map(|p| DVec3::new(1e-40, p.y, p.z)),
            14 => plain.map(|p| -p),
            _ => plain,
        };
        let scale = if mixed { random.log_range(1e-20, 1e20) } else { scale };
        // Once in a while positions that `Mesh::new` must refuse.
        let limit = DVec3::splat(if random.chance(1e-3) { 1e39 } else { Mesh::FARTHEST.into() });
        soup.push(corners.map(|p| (p * scale).clamp(-limit, limit)));
        soup.thin |= tame && soup.last().is_some_and(|corners| is_thin(corners, place));
    }
    soup
}

/// Whether a triangle that has an area has a height, by which barycentrics are divided, of less than a hundredth of its
/// longest edge.
fn is_thin(corners: [DVec3; 3], place: Place) -> bool {
    let [a, b, c] = corners.map(|p| if place == Place::World { p } else { p.with_z(0.0) });
    let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    let area = (b - a).cross(c - a).length();
    area > 1e-9 * longest && area < 1e-2 * longest
}

/// An ordinary triangle where the camera looks.
fn plain(random: &mut Random, settings: &Settings, place: Place) -> [DVec3; 3] {
    let size = random.log_range(0.01, 1.0);
    match place {
        Place::World => {
            let centre = random.direction() * random.range(0.0, 1.3);
            [(); 3].map(|()| centre + size * random.direction())
        }
        Place::View | Place::Screen => {
            let aspect = f64::from(settings.width) / f64::from(settings.height);
            let span = (settings.far - settings.near).clamp(1e-9, 10.0);
            let depth = settings.near + span * random.range(0.1, 0.9);
            let reach = if place == Place::View { depth } else { 1.0 };
            let centre = DVec3::new(random.range(-aspect, aspect), random.range(-1.0, 1.0), 0.0) * reach;
            [(); 3].map(|()| {
                let offset = random.direction() * size;
                let z = depth + span * 0.09 * offset.z;
                DVec3::new(centre.x + offset.x * reach, centre.y + offset.y * reach, z)
            })
        }
    }
}

/// A triangle that is a segment or a point.
fn degenerate(random: &mut Random, [a, b, c]: [DVec3; 3], tame: bool) -> [DVec3; 3] {
    match random.below(if tame { 4 } else { 6 }) {
        0 => [a, a, b],
        1 => [a, b, a],
        2 => [b, a, a],
        3 => [c, c, c],
        4 => [a, (a + b) / 2.0, b],
        _ => [a, b, a + (b - a) * 3.0],
    }
}

fn needle(random: &mut Random, [a, b, c]: [DVec3; 3], tame: bool) -> [DVec3; 3] {
    let thin = random.log_range(if tame { 1e-4 } else { 1e-20 }, 1e-2);
    [a, b, (a + b) / 2.0 + (c - a) * thin]
}

/// A triangle whose corners lie on both sides of another's plane.
fn piercing(random: &mut Random, [a, b, c]: [DVec3; 3]) -> [DVec3; 3] {
    let middle = (a + b + c) / 3.0;
    let normal = (b - a).cross(c - a).try_normalize().unwrap_or(DVec3::Z) * random.range(0.01, 0.1);
    [middle + normal, middle - normal, middle + (a - middle) * random.range(0.2, 0.9)]
}

/// The nearest pixel centre, or a point of the image's border.
fn on_grid(random: &mut Random, settings: &Settings, p: DVec3) -> DVec3 {
    let (width, height) = (f64::from(settings.width), f64::from(settings.height));
    let centre = |x: f64, side: f64| (2.0 * ((x * height + side - 1.0) / 2.0).round() + 1.0 - side) / height;
    match random.below(4) {
        0 => DVec3::new(width / height, p.y, p.z),
        1 => DVec3::new(p.x, -1.0, p.z),
        _ => DVec3::new(centre(p.x, width), centre(p.y, height), p.z),
    }
}

/// Moves corners onto the camera's plane, close to it, onto the near or far plane, or behind the camera.
fn special_depth(random: &mut Random, settings: &Settings, mut corners: [DVec3; 3]) -> [DVec3; 3] {
    for corner in &mut corners[..1 + random.below(3)] {
        let around = if random.chance(0.3) { 1.0 + random.range(-1e-6, 1e-6) } else { 1.0 };
        corner.z = around * random.choose(&[0.0, 1e-40, -1e-40, settings.near, settings.far, -settings.near, 1e-12]);
    }
    corners
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thin_is_what_is_low_and_not_flat() {
        let triangle = |height: f64| [DVec3::ZERO, DVec3::new(0.5, height, 3.0 * height), DVec3::X];
        assert!(is_thin(triangle(5e-3), Place::Screen) && !is_thin(triangle(5e-3), Place::World));
        assert!(!is_thin(triangle(0.0), Place::Screen) && !is_thin(triangle(0.5), Place::Screen));
    }
}
