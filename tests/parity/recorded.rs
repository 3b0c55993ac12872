//! The recorded outputs of the official kernels, as scenes and settings of softras.

use softras::scene::{
    Appearance, Camera, ColorAggregation, Distance, Faces, FrontFace, Mesh, Parity, Scene, Settings,
    SilhouetteAggregation,
};
use softras::{Image, ImageGradient};
use softras_io::{npy, npz};
use softras_reference::Upstream;
use std::path::{Path, PathBuf};

/// Where the recorded files lie.
pub fn folder() -> PathBuf {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/reference");
    std::env::var_os("SOFTRAS_RECORDED").map_or_else(beside, PathBuf::from)
}

/// An npz file of the folder.
pub struct Archive(pub PathBuf);

impl Archive {
    pub fn open(name: &str) -> Self {
        Self(folder().join(name))
    }

    pub fn array(&self, key: &str) -> npy::Array {
        npz::read(&self.0, key).expect("a recorded array")
    }

    pub fn f64s(&self, key: &str) -> Vec<f64> {
        self.array(key).numbers().expect("numbers").iter().collect()
    }

    pub fn f32s(&self, key: &str) -> Vec<f32> {
        self.f64s(key).into_iter().map(|x| x as f32).collect()
    }

    pub fn json(&self, key: &str) -> serde_json::Value {
        let text = self.array(key).texts().expect("text").next().expect("one text");
        serde_json::from_str(&text).expect("JSON")
    }
}

fn rows<const N: usize>(values: &[f32]) -> Vec<[f32; N]> {
    values.chunks_exact(N).map(|row| row.try_into().unwrap()).collect()
}

/// A recorded case: scene, cameras, settings as the official run had them.
pub struct Case {
    pub name: String,
    pub archive: Archive,
    pub scene: Scene,
    pub cameras: Vec<Camera>,
    pub settings: Settings,
}

impl Case {
    pub fn open(name: &str) -> Self {
        let archive = Archive::open(name);
        let options = archive.json("options");
        let settings = settings(&options, &archive.json("effective_f32_options"));
        let surface = options["texture_type"] == "surface";
        let (shape, vertices) = (archive.array("face_vertices").shape, archive.f32s("face_vertices"));
        let colors = archive.f32s("textures");
        let (vertices, colors) = (vertices.chunks(vertices.len() / shape[0]), colors.chunks(colors.len() / shape[0]));
        let meshes = vertices.zip(colors).map(|(v, c)| soup(v, c, surface)).collect::<Vec<_>>();
        let cameras = vec![Camera::screen(); meshes.len()];
        Self { name: name.into(), archive, scene: Scene::batch(meshes), cameras, settings }
    }

    /// `[B, 4, H, W]` of the official renderer as colour `[B, H, W, 3]` and silhouette `[B, H, W]`.
    pub fn planes(&self, values: &[f64]) -> (Vec<f64>, Vec<f64>) {
        split_planes(values, (self.settings.width * self.settings.height) as usize)
    }

    pub fn official_image(&self) -> (Vec<f64>, Vec<f64>) {
        self.planes(&self.archive.f64s("soft_colors"))
    }

    pub fn is_surface(&self) -> bool {
        matches!(self.scene.meshes[0].appearance(), Appearance::Surface { .. })
    }

    /// The derivatives of a loss by the image, as the kernels take them.
    pub fn image_gradient(&self) -> ImageGradient {
        let (color, silhouette) = self.planes(&self.archive.f64s("grad_soft_colors"));
        let [height, width] = [self.settings.height, self.settings.width].map(|side| side as usize);
        let image = |channels, values: Vec<f64>| {
            let data = values.into_iter().map(|x| x as f32).collect();
            Some(Image { batch: self.cameras.len(), height, width, channels, data })
        };
        ImageGradient { color: image(3, color), silhouette: image(1, silhouette), ..ImageGradient::default() }
    }

    /// The derivatives of a loss by the image, as the reference takes them.
    pub fn upstream(&self) -> Upstream {
        let (color, silhouette) = self.planes(&self.archive.f64s("grad_soft_colors"));
        Upstream { d_color: Some(color), d_silhouette: Some(silhouette), ..Upstream::default() }
    }
}

pub fn split_planes(values: &[f64], pixels: usize) -> (Vec<f64>, Vec<f64>) {
    let (mut color, mut silhouette) = (Vec::new(), Vec::new());
    for view in values.chunks(4 * pixels) {
        color.extend((0..pixels).flat_map(|i| [view[i], view[pixels + i], view[2 * pixels + i]]));
        silhouette.extend_from_slice(&view[3 * pixels..]);
    }
    (color, silhouette)
}

/// Triangles that share no vertex, given on the screen.
pub fn soup(vertices: &[f32], colors: &[f32], surface: bool) -> Mesh {
    let positions = rows::<3>(vertices);
    let faces = positions.len() as u32 / 3;
    let triangles = (0..faces).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    let colors = rows::<3>(colors);
    let appearance = if surface {
        let resolution = ((colors.len() as u32 / faces) as f64).sqrt() as u32;
        Appearance::Surface { resolution, texels: colors }
    } else {
        Appearance::VertexColors(colors)
    };
    Mesh::new(positions, triangles).unwrap().with_appearance(appearance).unwrap()
}

fn settings(options: &serde_json::Value, effective: &serde_json::Value) -> Settings {
    let number = |key: &str| effective[key].as_f64().unwrap();
    let size = options["image_size"].as_u64().unwrap() as u32;
    let back_too = options["fill_back"].as_bool().unwrap();
    Settings {
        width: size,
        height: size,
        sigma: number("sigma_val"),
        gamma: number("gamma_val"),
        epsilon: effective_epsilon(number("eps"), number("gamma_val")),
        // The official threshold is ln(1/τ - 1) rounded to float32.
        tau: 1.0 / (1.0 + number("dist_cutoff").exp()),
        near: number("near"),
        far: number("far"),
        color: match options["aggr_func_rgb"].as_str() {
            Some("softmax") => ColorAggregation::Softmax,
            Some("hard") => ColorAggregation::Hard,
            other => panic!("aggr_func_rgb {other:?}"),
        },
        silhouette: match options["aggr_func_alpha"].as_str() {
            Some("prod") => SilhouetteAggregation::Product,
            Some("sum") => SilhouetteAggregation::Sum,
            Some("hard") => SilhouetteAggregation::Hard,
            other => panic!("aggr_func_alpha {other:?}"),
        },
        distance: match options["dist_func"].as_str() {
            Some("euclidean") => Distance::Euclidean,
            Some("barycentric") => Distance::Barycentric,
            Some("hard") => Distance::Hard,
            other => panic!("dist_func {other:?}"),
        },
        background_color: [0, 1, 2].map(|k| options["background_color"][k].as_f64().unwrap()),
        faces: if back_too { Faces::Both } else { Faces::Front },
        front_face: FrontFace::Clockwise,
        parity: Parity::Official,
        ..Settings::default()
    }
}

/// The official sum starts at exp(ε/γ) with the maximum at ε, and takes that one exponential in float32.
fn effective_epsilon(epsilon: f64, gamma: f64) -> f64 {
    let start = f64::from((epsilon as f32 / gamma as f32).exp());
    (epsilon + gamma * start.ln()) / 2.0
}
