//! A mesh's colours as parameters of an optimiser.

use softras::{
    GradientRequest, MeshGradients, Result,
    scene::{Appearance, Mesh, Texture},
};

/// The colours or texels of an appearance as one array.
pub fn values(appearance: &Appearance) -> Vec<f64> {
    let flat = |colors: &[[f32; 3]]| colors.as_flattened().iter().map(|&x| f64::from(x)).collect::<Vec<f64>>();
    match appearance {
        Appearance::Uniform(color) => flat(&[*color]),
        Appearance::VertexColors(colors) => flat(colors),
        Appearance::Surface { texels, .. } => flat(texels),
        Appearance::Textured { textures, .. } => textures.iter().flat_map(|t| flat(t.texels())).collect(),
    }
}

/// The mesh with these colours, clamped to [0, 1]. The alpha of textures stays what it is.
pub fn recolored(mesh: &Mesh, values: &[f64]) -> Result<Mesh> {
    let mut colors = values.chunks_exact(3).map(|c| [c[0], c[1], c[2]].map(|x| x.clamp(0.0, 1.0) as f32));
    let mut take = |count: usize| colors.by_ref().take(count).collect::<Vec<[f32; 3]>>();
    let appearance = match mesh.appearance() {
        Appearance::Uniform(old) => Appearance::Uniform(take(1).first().copied().unwrap_or(*old)),
        Appearance::VertexColors(old) => Appearance::VertexColors(take(old.len())),
        Appearance::Surface { resolution, texels } => {
            Appearance::Surface { resolution: *resolution, texels: take(texels.len()) }
        }
        Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle } => {
            let one = |t: &Texture| t.with_texels(take(t.texels().len()));
            Appearance::Textured {
                uvs: uvs.clone(),
                uv_triangles: uv_triangles.clone(),
                textures: textures.iter().map(one).collect::<Result<_>>()?,
                texture_of_triangle: texture_of_triangle.clone(),
            }
        }
    };
    mesh.clone().with_appearance(appearance)
}

/// dL by the values of [`values`].
pub fn gradient(appearance: &Appearance, gradients: &MeshGradients) -> Vec<f64> {
    let flat = |colors: &[[f32; 3]]| colors.as_flattened().iter().map(|&x| f64::from(x)).collect::<Vec<f64>>();
    match appearance {
        Appearance::Uniform(_) | Appearance::VertexColors(_) => flat(&gradients.colors),
        Appearance::Surface { .. } => flat(&gradients.surface_texels),
        Appearance::Textured { .. } => gradients.texture_texels.iter().flat_map(|t| flat(t)).collect(),
    }
}

/// The gradients that the colours of an appearance need.
pub fn wanted(appearance: &Appearance, wanted: GradientRequest) -> GradientRequest {
    match appearance {
        Appearance::Uniform(_) | Appearance::VertexColors(_) => GradientRequest { colors: true, ..wanted },
        Appearance::Surface { .. } | Appearance::Textured { .. } => GradientRequest { texels: true, ..wanted },
    }
}
