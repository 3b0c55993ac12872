//! The settings, lights and wanted gradients of `softras.settings`, read from their fields.

use crate::arrays::{color, vector};
use crate::exceptions::bad_input;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use softras::scene::{
    Background, ColorAggregation, DirectionalLight, Distance, Faces, FrontFace, Interpolation, Outputs, Parity,
    Shading, SilhouetteAggregation, Support, SurfacePoint,
};
use softras::{GradientMode, GradientRequest, Lights, Settings};

/// The value that belongs to a name in a list.
pub fn chosen<T: Clone>(field: &str, name: &str, among: &[(&str, T)]) -> PyResult<T> {
    let found = among.iter().find(|(known, _)| *known == name).map(|(_, value)| value.clone());
    found.ok_or_else(|| {
        let names: Vec<_> = among.iter().map(|(known, _)| format!("{known:?}")).collect();
        bad_input(format!("{field} is {name:?}"), &format!("use one of {}", names.join(", ")))
    })
}

/// The names of [`Faces`].
pub const FACES: [(&str, Faces); 2] = [("both", Faces::Both), ("front", Faces::Front)];

/// The value of the name that a field holds.
fn field<T: Clone>(value: &Bound<'_, PyAny>, field: &str, among: &[(&str, T)]) -> PyResult<T> {
    chosen(field, &value.getattr(field)?.extract::<String>()?, among)
}

/// The names of a tuple or list, or one name.
fn names(value: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
    value.extract::<String>().map(|name| vec![name]).or_else(|_| value.extract())
}

fn number<'py, T: for<'a> FromPyObject<'a, 'py>>(value: &Bound<'py, PyAny>, field: &str) -> PyResult<T> {
    let found = value.getattr(field)?;
    found.extract::<T>().map_err(|_| bad_input(format!("{field} is {found}"), "use a number in its range"))
}

fn outputs(value: &Bound<'_, PyAny>) -> PyResult<Outputs> {
    let mut outputs = Outputs::NOTHING;
    for name in names(value)? {
        match name.as_str() {
            "color" => outputs.color = true,
            "silhouette" => outputs.silhouette = true,
            "depth" => outputs.depth = true,
            "normal" => outputs.normal = true,
            "features" => outputs.features = true,
            _ => {
                let fix = "use color, silhouette, depth, normal and features";
                return Err(bad_input(format!("output {name:?}"), fix));
            }
        }
    }
    Ok(outputs)
}

/// Refuses a dict, which has no fields.
fn with_fields(value: &Bound<'_, PyAny>, class: &str) -> PyResult<()> {
    match value.cast::<PyDict>() {
        Ok(_) => Err(bad_input("settings or lights are a dict", &format!("give softras.{class}(**fields)"))),
        Err(_) => Ok(()),
    }
}

/// The settings of a `softras.Settings`; the defaults for `None`.
pub fn settings(value: Option<&Bound<'_, PyAny>>) -> PyResult<Settings> {
    let Some(value) = value else { return Ok(Settings::default()) };
    with_fields(value, "Settings")?;
    let float = |name: &str| number::<f64>(value, name);
    let size = |name: &str| number::<u32>(value, name);
    Ok(Settings {
        width: size("width")?,
        height: size("height")?,
        sigma: float("sigma")?,
        gamma: float("gamma")?,
        epsilon: float("epsilon")?,
        tau: float("tau")?,
        near: float("near")?,
        far: float("far")?,
        outputs: outputs(&value.getattr("outputs")?)?,
        background_color: color(&value.getattr("background_color")?, "background_color")?,
        support: field(
            value,
            "support",
            &[("probability", Support::Probability), ("guaranteed", Support::Guaranteed)],
        )?,
        color: field(value, "color", &[("softmax", ColorAggregation::Softmax), ("hard", ColorAggregation::Hard)])?,
        silhouette: field(
            value,
            "silhouette",
            &[
                ("product", SilhouetteAggregation::Product),
                ("sum", SilhouetteAggregation::Sum),
                ("hard", SilhouetteAggregation::Hard),
            ],
        )?,
        distance: field(
            value,
            "distance",
            &[("euclidean", Distance::Euclidean), ("barycentric", Distance::Barycentric), ("hard", Distance::Hard)],
        )?,
        background: field(
            value,
            "background",
            &[("weighted", Background::Weighted), ("composite", Background::Composite)],
        )?,
        faces: field(value, "faces", &FACES)?,
        front_face: field(
            value,
            "front_face",
            &[("counter_clockwise", FrontFace::CounterClockwise), ("clockwise", FrontFace::Clockwise)],
        )?,
        interpolation: field(
            value,
            "interpolation",
            &[("affine", Interpolation::Affine), ("perspective", Interpolation::Perspective)],
        )?,
        surface_point: field(
            value,
            "surface_point",
            &[("nearest", SurfacePoint::Nearest), ("clip", SurfacePoint::Clip)],
        )?,
        parity: field(value, "parity", &[("model", Parity::Model), ("official", Parity::Official)])?,
        save: false,
    })
}

/// The lights of a `softras.Lights`; none for `None`, under which colours stay as they are.
pub fn lights(value: Option<&Bound<'_, PyAny>>) -> PyResult<Lights> {
    let Some(value) = value else { return Ok(Lights::unlit()) };
    with_fields(value, "Lights")?;
    let one = |light: Bound<'_, PyAny>| -> PyResult<DirectionalLight> {
        Ok(DirectionalLight {
            direction: vector(&light.getattr("direction")?, "direction")?,
            color: color(&light.getattr("color")?, "color")?,
            intensity: number(&light, "intensity")?,
        })
    };
    let directional = value.getattr("directional")?.try_iter()?.map(|light| one(light?)).collect::<PyResult<_>>()?;
    Ok(Lights {
        ambient_color: color(&value.getattr("ambient_color")?, "ambient_color")?,
        ambient_intensity: number(value, "ambient_intensity")?,
        directional,
        shading: field(value, "shading", &[("flat", Shading::Flat), ("smooth", Shading::Smooth)])?,
    })
}

/// The mode of a gradient by its name.
pub fn gradient_mode(name: &str) -> PyResult<GradientMode> {
    chosen("mode", name, &[("exact", GradientMode::Exact), ("paper", GradientMode::Paper)])
}

/// The inputs to differentiate by.
pub fn wanted(by: &Bound<'_, PyAny>, mode: &str) -> PyResult<GradientRequest> {
    let mut wanted = GradientRequest { mode: gradient_mode(mode)?, ..GradientRequest::NOTHING };
    for name in names(by)? {
        match name.as_str() {
            "positions" => wanted.positions = true,
            "colors" => wanted.colors = true,
            "features" => wanted.features = true,
            "texels" => wanted.texels = true,
            "uvs" => wanted.uvs = true,
            "cameras" => wanted.camera = true,
            "lights" => wanted.lights = true,
            "background" => wanted.background = true,
            "scalars" => wanted.scalars = true,
            _ => {
                let fix = "use positions, colors, features, texels, uvs, cameras, lights, background and scalars";
                return Err(bad_input(format!("a gradient by {name:?}"), fix));
            }
        }
    }
    Ok(wanted)
}
