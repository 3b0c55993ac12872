//! Looks up a fragment's colour and opacity in surface cells and image textures.

use super::parameters::{MeshSlots, Source};
use super::real::{Real, lerp};
use softras::scene::{Appearance, Texture, Wrap};

/// The colour at a point of a triangle: `original` are the barycentrics in the uncut triangle, `uv` its coordinates.
pub fn sample<S: Source>(
    source: &S,
    slots: &MeshSlots,
    appearance: &Appearance,
    triangle: usize,
    original: [S::R; 3],
    uv: [S::R; 2],
    official: bool,
) -> [S::R; 3] {
    match appearance {
        Appearance::Uniform(_) | Appearance::VertexColors(_) => [S::R::one(); 3],
        Appearance::Surface { resolution, texels } => {
            let r = *resolution as usize;
            let cell = surface_cell(*resolution, original.map(Real::value), official);
            let texel = triangle * r * r + cell;
            if texel >= texels.len() {
                // The official lookup may read past the last triangle's cells, where it finds black.
                return [S::R::zero(); 3];
            }
            let color = source.row::<3>(slots.surface.start + 3 * texel);
            // The official backward pass gives gradients to the triangle's own cells only.
            if cell < r * r { color } else { color.map(Real::detach) }
        }
        Appearance::Textured { textures, texture_of_triangle, .. } => {
            let index = texture_of_triangle.get(triangle).map_or(0, |&i| i as usize);
            bilinear(source, slots.textures[index].start, &textures[index], uv)
        }
    }
}

/// The opacity α at texture coordinates of a triangle; `None` where its appearance is opaque.
pub fn opacity<S: Source>(
    source: &S,
    slots: &MeshSlots,
    appearance: &Appearance,
    triangle: usize,
    uv: [S::R; 2],
) -> Option<S::R> {
    let Appearance::Textured { textures, texture_of_triangle, .. } = appearance else { return None };
    let index = texture_of_triangle.get(triangle).map_or(0, |&i| i as usize);
    let range = &slots.alphas[index];
    (!range.is_empty()).then(|| {
        let [alpha] = bilinear(source, range.start, &textures[index], uv);
        alpha
    })
}

/// Whether an appearance has a texture with an alpha.
pub fn has_opacity(appearance: &Appearance) -> bool {
    matches!(appearance, Appearance::Textured { textures, .. } if textures.iter().any(|t| t.alpha().is_some()))
}

/// The cell of a surface texture of R × R cells at barycentrics b.
///
/// The official test (b₀ + b₁) R - x - y ≤ 1 is written with b₂ as b₂ R ≥ R - 1 - x - y. Both are equal in exact
/// arithmetic; but fragments clipped to the edge b₂ = 0 lie exactly on a border between cells, where the first form
/// would depend on rounding.
///
/// At a corner itself (b₀ or b₁ exactly 1) the official lookup reads beyond the row, or beyond the triangle's cells.
pub fn surface_cell(resolution: u32, b: [f64; 3], official: bool) -> usize {
    let size = f64::from(resolution);
    if official && b[0].max(b[1]) == 1.0 {
        return if b[0] == 1.0 { resolution as usize } else { (resolution * resolution) as usize };
    }
    let last = size - 1.0;
    let [x, y] = [b[0], b[1]].map(|b| (b * size).floor().clamp(0.0, last));
    let cell = if b[2] * size >= last - x - y { y * size + x } else { (last - y) * size + last - x };
    cell as usize
}

fn bilinear<S: Source, const N: usize>(source: &S, start: usize, texture: &Texture, [u, v]: [S::R; 2]) -> [S::R; N] {
    let (width, height) = (f64::from(texture.width()), f64::from(texture.height()));
    let x = u.scale(width).shift(-0.5);
    let y = v.scale(-height).shift(height - 0.5);
    let (left, top) = (x.value().floor(), y.value().floor());
    let wrap = |i: f64, size: f64| match texture.wrap() {
        Wrap::Repeat => i.rem_euclid(size),
        Wrap::Clamp => i.clamp(0.0, size - 1.0),
    };
    let texel = |dx: f64, dy: f64| {
        let index = wrap(top + dy, height) * width + wrap(left + dx, width);
        source.row::<N>(start + N * index as usize)
    };
    let (tx, ty) = (x.shift(-left), y.shift(-top));
    lerp(lerp(texel(0.0, 0.0), texel(1.0, 0.0), tx), lerp(texel(0.0, 1.0), texel(1.0, 1.0), tx), ty)
}
