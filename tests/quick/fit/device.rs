//! Fitting on the device: the same bits as the same method on the host, step for step, and what double precision finds
//! within a tolerance.

use softras::fit::{HostFit, ImageLoss, Method, Parametrization, Regularizer, ShapeFit, ShapeOptions, Step, Targets};
use softras::internals::fit::DeviceFit;
use softras::internals::plan::Capacity;
use softras::scene::{Appearance, Background, Outputs, Support};
use softras::{Camera, Image, Lights, Mesh, Projection, Renderer, Scene, Settings, shapes};

const SIZE: u32 = 24;
const VIEWS: usize = 3;

fn cameras() -> Vec<Camera> {
    let projection = Projection::Perspective { fov_y: 0.7 };
    let one = |i: usize| Camera::from_angles(2.7, 20.0 - 25.0 * i as f64, 110.0 * i as f64, projection).unwrap();
    (0..VIEWS).map(one).collect()
}

fn settings(step: usize) -> Settings {
    Settings {
        sigma: 1e-3 * 0.9f64.powi(step as i32),
        gamma: 1e-2,
        near: 1.0,
        far: 10.0,
        background: Background::Composite,
        ..Settings::default()
    }
}

/// A sphere of half the size, with colours.
fn template(subdivisions: u32) -> Mesh {
    let sphere = shapes::icosphere(subdivisions).unwrap();
    let positions: Vec<[f32; 3]> = sphere.positions().iter().map(|p| p.map(|x| 0.5 * x)).collect();
    let colors = positions.iter().map(|p| p.map(|x| 0.5 + 0.4 * x)).collect();
    let mesh = Mesh::new(positions, sphere.triangles().to_vec()).unwrap();
    mesh.with_appearance(Appearance::VertexColors(colors)).unwrap()
}

/// Hard images of a torus.
fn targets(renderer: &mut Renderer, silhouette: bool, color: bool) -> Targets {
    let torus = shapes::torus(0.5, 0.2, 24, 12).unwrap();
    let outputs = Outputs { color, silhouette, depth: false, normal: false };
    let settings = Settings { width: SIZE, height: SIZE, sigma: 1e-7, outputs, ..settings(0) };
    let cameras = cameras();
    let frame = renderer.render(&Scene::new(torus), &cameras, &settings).unwrap();
    Targets { cameras, silhouette: frame.silhouette().cloned(), color: frame.color().cloned(), ..Targets::default() }
}

fn mask() -> Image {
    let (height, width) = (SIZE as usize, SIZE as usize);
    let data = (0..VIEWS * height * width).map(|i| [1.0, 0.0, 0.25, 2.0, 1.0][i % 5]).collect();
    Image { batch: VIEWS, height, width, channels: 1, data }
}

/// Positions, colours, losses: everything that is to be equal.
#[derive(Clone, Debug)]
struct Course {
    mesh: Mesh,
    steps: Vec<Step>,
    /// Not compared: a matter of the device alone.
    repeated: usize,
}

/// What differs first between two courses.
fn difference(one: &Course, other: &Course) -> Option<String> {
    for (i, (a, b)) in one.steps.iter().zip(&other.steps).enumerate() {
        let values = |s: &Step| [&[s.loss, s.silhouette, s.color][..], &s.regularizers].concat();
        if values(a).iter().zip(&values(b)).any(|(a, b)| a.to_bits() != b.to_bits()) {
            return Some(format!("step {i}: {a:?} or {b:?}"));
        }
    }
    let bits = |mesh: &Mesh| mesh.positions().iter().map(|p| p.map(f32::to_bits)).collect::<Vec<_>>();
    if let Some(i) = bits(&one.mesh).iter().zip(&bits(&other.mesh)).position(|(a, b)| a != b) {
        return Some(format!("vertex {i}: {:?} or {:?}", one.mesh.positions()[i], other.mesh.positions()[i]));
    }
    let same = one.mesh == other.mesh && one.steps.len() == other.steps.len();
    (!same).then(|| "colours or lengths".into())
}

struct Case {
    options: ShapeOptions,
    silhouette: bool,
    color: bool,
    masked: bool,
    rate: f64,
    subdivisions: u32,
}

impl Case {
    fn new(options: ShapeOptions) -> Self {
        Self { options, silhouette: true, color: false, masked: false, rate: 0.01, subdivisions: 2 }
    }

    fn fit(&self) -> ShapeFit {
        ShapeFit::new(template(self.subdivisions), Lights::unlit(), self.options.clone()).unwrap()
    }

    fn on_device(&self, renderer: &mut Renderer, steps: usize, settings: fn(usize) -> Settings) -> Course {
        let targets = targets(renderer, self.silhouette, self.color);
        let mask = self.masked.then(mask);
        let mut fit = DeviceFit::new(renderer, self.fit(), &targets, mask.as_ref()).unwrap();
        (0..steps).for_each(|step| fit.step(renderer, &settings(step), self.rate, 0.05).unwrap());
        let found = fit.found(renderer).unwrap();
        let repeated = fit.repeated();
        Course { mesh: fit.shape(renderer).unwrap().mesh().clone(), steps: found, repeated }
    }

    fn on_host(&self, renderer: &mut Renderer, steps: usize, settings: fn(usize) -> Settings) -> Course {
        let targets = targets(renderer, self.silhouette, self.color);
        let mask = self.masked.then(mask);
        let mut fit = HostFit::new(self.fit(), &targets, mask.as_ref()).unwrap();
        let steps = (0..steps).map(|step| fit.step(renderer, &settings(step), self.rate, 0.05).unwrap()).collect();
        Course { mesh: fit.mesh().clone(), steps, repeated: 0 }
    }

    /// In double precision; it knows no mask.
    fn in_f64(&self, renderer: &mut Renderer, steps: usize) -> Course {
        let targets = targets(renderer, self.silhouette, self.color);
        let mut fit = self.fit();
        let step = |step| fit.step(renderer, &settings(step), &targets, self.rate, 0.05).unwrap();
        let steps = (0..steps).map(step).collect();
        Course { mesh: fit.mesh().clone(), steps, repeated: 0 }
    }
}

fn official() -> ShapeOptions {
    ShapeOptions::official()
}

fn smoothed() -> ShapeOptions {
    ShapeOptions {
        parametrization: Parametrization::Smoothed { lambda: 5.0 },
        method: Method::UniformAdam { betas: [0.9, 0.999], epsilon: 1e-8 },
        ..official()
    }
}

/// One case for every kind of anything.
fn cases() -> Vec<(&'static str, Case)> {
    let plain = || ShapeOptions { parametrization: Parametrization::Vertices, method: Method::ADAM, ..official() };
    let all = vec![
        (Regularizer::Laplacian, 0.05),
        (Regularizer::EdgeLength { target: 0.2 }, 0.3),
        (Regularizer::NormalConsistency, 0.01),
        (Regularizer::Flatten, 1e-3),
    ];
    let sgd = Method::Sgd { momentum: 0.8 };
    let l2 = ShapeOptions { silhouette: (ImageLoss::L2, 2.0), regularizers: all, levels: 3, ..plain() };
    let huber = (ImageLoss::Huber { delta: 0.1 }, 1.5);
    let colored = ShapeOptions { color: huber, fit_colors: true, samples: 2, ..smoothed() };
    let l1 = ShapeOptions { color: (ImageLoss::L1, 1.0), regularizers: vec![], levels: 2, fit_colors: true, ..plain() };
    vec![
        ("official", Case::new(official())),
        ("smoothed", Case::new(smoothed())),
        ("smoothed by iteration", Case { subdivisions: 4, ..Case::new(smoothed()) }),
        ("all regularizers, three levels", Case::new(l2)),
        ("masked", Case { masked: true, ..Case::new(ShapeOptions { samples: 3, ..plain() }) }),
        ("sgd on logits", Case { rate: 1.0, ..Case::new(ShapeOptions { method: sgd, ..official() }) }),
        ("uniform on logits", Case::new(ShapeOptions { method: smoothed().method, ..official() })),
        ("silhouette and colour", Case { color: true, ..Case::new(colored) }),
        ("colour alone", Case { color: true, silhouette: false, masked: true, ..Case::new(l1) }),
    ]
}

#[test]
fn device_and_host_agree_to_the_bit() {
    let mut renderer = crate::common::renderer();
    for (name, case) in cases() {
        let (device, host) = (case.on_device(&mut renderer, 4, settings), case.on_host(&mut renderer, 4, settings));
        assert_eq!(difference(&device, &host), None, "{name}");
        assert!(device.mesh != *case.fit().mesh(), "{name}: nothing moved");
    }
}

#[test]
fn a_difference_of_one_bit_is_seen() {
    let mut renderer = crate::common::renderer();
    let course = Case::new(official()).on_host(&mut renderer, 1, settings);
    assert_eq!(difference(&course, &course.clone()), None);
    let mut moved = course.clone();
    let mut positions = moved.mesh.positions().to_vec();
    positions[17][1] = positions[17][1].next_up();
    moved.mesh.set_positions(positions).unwrap();
    assert!(difference(&course, &moved).is_some_and(|d| d.contains("vertex 17")));
    let mut other = course.clone();
    other.steps[0].regularizers[1] = other.steps[0].regularizers[1].next_up();
    assert!(difference(&course, &other).is_some_and(|d| d.contains("step 0")));
}

#[test]
fn double_precision_finds_the_same() {
    let mut renderer = crate::common::renderer();
    for (name, case) in cases() {
        if case.masked {
            continue;
        }
        let (device, double) = (case.on_device(&mut renderer, 3, settings), case.in_f64(&mut renderer, 3));
        // The iteration solves to 1 %, and that of a step.
        let (loss, position) = if case.subdivisions > 2 { (2e-3, 2e-3) } else { (2e-5, 2e-4) };
        for (a, b) in device.steps.iter().zip(&double.steps) {
            assert!((a.loss - b.loss).abs() < loss * b.loss, "{name}: {a:?} or {b:?}");
            assert_eq!(a.regularizers.len(), b.regularizers.len());
            for (a, b) in a.regularizers.iter().zip(&b.regularizers) {
                assert!((a - b).abs() < loss * (b.abs() + 1e-3), "{name}: {a} or {b}");
            }
        }
        let first = (&device.steps[0], &double.steps[0]);
        assert!((first.0.loss - first.1.loss).abs() < 3e-6 * first.1.loss, "{name}: {first:?}");
        let pairs = device.mesh.positions().iter().zip(double.mesh.positions());
        let moved: f32 = pairs.flat_map(|(a, b)| [0, 1, 2].map(|k| (a[k] - b[k]).abs())).fold(0.0, f32::max);
        assert!(moved < position, "{name}: vertices differ by {moved}");
    }
}

/// Steps whose frames have room for their lists, and steps whose frames have none, until those settle.
#[test]
fn a_fit_does_not_depend_on_the_room_for_lists() {
    let mut renderer = crate::common::renderer();
    let blurred = |step: usize| Settings { sigma: if step < 100 { 3e-2 } else { 1e-4 }, ..settings(0) };
    let case = Case { color: true, ..Case::new(official()) };
    let targets = targets(&mut renderer, true, true);
    let course = |capacity: Option<Capacity>| {
        let mut fit = DeviceFit::new(&renderer, case.fit(), &targets, None).unwrap();
        for step in 0..200 {
            if let Some(capacity) = capacity {
                fit.set_capacity(capacity);
            }
            fit.step(&renderer, &blurred(step), case.rate, 0.05).unwrap();
        }
        let steps = fit.found(&renderer).unwrap();
        let repeated = fit.repeated();
        Course { mesh: fit.shape(&renderer).unwrap().mesh().clone(), steps, repeated }
    };
    let whole = course(Some(Capacity { coarse: 1 << 16, list: 1 << 20, cells: 1 << 12 }));
    assert_eq!(whole.steps.len(), 200);
    for (coarse, list, cells) in [(1, 1, 1), (1 << 16, 300, 3)] {
        let short = course(Some(Capacity { coarse, list, cells }));
        assert_eq!((difference(&whole, &short), short.repeated), (None, 0), "{coarse}, {list}, {cells}");
    }
}

#[test]
fn a_step_that_was_not_planned_for_is_done_again() {
    let mut renderer = crate::common::renderer();
    // Out of the box and the ball that the frame was planned for: near lies close to the mesh.
    let tight = |_: usize| Settings { near: 1.8, far: 4.0, ..settings(0) };
    let plain = ShapeOptions { parametrization: Parametrization::Vertices, method: Method::ADAM, ..official() };
    let case = Case { rate: 0.06, ..Case::new(plain) };
    let (device, host) = (case.on_device(&mut renderer, 8, tight), case.on_host(&mut renderer, 8, tight));
    assert_eq!((device.steps.len(), difference(&device, &host)), (8, None));
    assert!(device.repeated > 0, "no vertex left the box");
}

#[test]
fn a_fit_is_put_aside_and_taken_up_with_the_same_bits() {
    let mut renderer = crate::common::renderer();
    for options in [official(), smoothed()] {
        let case = Case::new(options);
        let whole = case.on_device(&mut renderer, 6, settings);
        let targets = targets(&mut renderer, true, false);
        let mut first = DeviceFit::new(&renderer, case.fit(), &targets, None).unwrap();
        (0..3).for_each(|step| first.step(&renderer, &settings(step), case.rate, 0.0).unwrap());
        let state = first.shape(&renderer).unwrap().state();
        let mut fit = case.fit();
        fit.restore(state).unwrap();
        let mut second = DeviceFit::new(&renderer, fit, &targets, None).unwrap();
        (3..6).for_each(|step| second.step(&renderer, &settings(step), case.rate, 0.0).unwrap());
        let steps = [first.found(&renderer).unwrap(), second.found(&renderer).unwrap()].concat();
        let mesh = second.shape(&renderer).unwrap().mesh().clone();
        assert_eq!(
            difference(&whole, &Course { mesh, steps, repeated: 0 }),
            None,
            "{:?}",
            case.options.parametrization
        );
    }
}

#[test]
fn the_best_mesh_is_kept() {
    let mut renderer = crate::common::renderer();
    // Far too long a step: the loss rises and falls.
    let case = Case { rate: 0.5, ..Case::new(official()) };
    let targets = targets(&mut renderer, true, false);
    let mut fit = DeviceFit::new(&renderer, case.fit(), &targets, None).unwrap();
    assert!(fit.best(&renderer).unwrap().is_none());
    (0..12).for_each(|_| fit.step(&renderer, &settings(0), case.rate, 0.0).unwrap());
    let found = fit.found(&renderer).unwrap();
    let least = found.iter().map(|s| s.loss).fold(f64::INFINITY, f64::min);
    let (mesh, step) = fit.best(&renderer).unwrap().unwrap();
    assert_eq!(found[step].loss, least);
    // Its loss is that of the step that found it.
    let mut again = HostFit::new(
        ShapeFit::new(
            mesh,
            Lights::unlit(),
            ShapeOptions { parametrization: Parametrization::Vertices, ..case.options.clone() },
        )
        .unwrap(),
        &targets,
        None,
    )
    .unwrap();
    let loss = again.step(&mut renderer, &settings(0), 0.0, 0.0).unwrap().loss;
    assert_eq!(loss.to_bits(), least.to_bits());
}

#[test]
fn what_the_device_cannot_do_is_said() {
    let renderer = crate::common::renderer();
    let with = |options: ShapeOptions| ShapeFit::new(template(4), Lights::unlit(), options).unwrap();
    assert_eq!(DeviceFit::unsupported(&with(official())), None);
    let reason = |options: ShapeOptions| DeviceFit::unsupported(&with(options)).unwrap();
    assert!(reason(ShapeOptions { fit_positions: false, ..official() }).contains("moves no vertices"));
    let twice = vec![(Regularizer::Laplacian, 1.0), (Regularizer::Laplacian, 2.0)];
    assert!(reason(ShapeOptions { regularizers: twice, ..official() }).contains("twice"));
    let stiff = Parametrization::Smoothed { lambda: 1e4 };
    assert!(reason(ShapeOptions { parametrization: stiff, ..official() }).contains("host's exact"));
    let black = |channels: usize| Image {
        batch: VIEWS,
        height: SIZE as usize,
        width: SIZE as usize,
        channels,
        data: vec![0.0; VIEWS * (SIZE * SIZE) as usize * channels],
    };
    let targets = Targets { cameras: cameras(), silhouette: Some(black(1)), ..Targets::default() };
    let refused = |weights: Image| DeviceFit::new(&renderer, with(official()), &targets, Some(&weights)).err();
    assert!(refused(black(1)).unwrap().to_string().contains("all 0"));
    assert!(refused(black(3)).unwrap().to_string().contains("one weight a pixel"));
    let mut fit = DeviceFit::new(&renderer, with(official()), &targets, None).unwrap();
    let guaranteed = Settings { support: Support::Guaranteed, ..settings(0) };
    assert!(fit.step(&renderer, &guaranteed, 0.01, 0.0).is_err_and(|e| e.to_string().contains("guaranteed")));
    let other = crate::common::renderer();
    assert!(fit.step(&other, &settings(0), 0.01, 0.0).is_err_and(|e| e.to_string().contains("another renderer")));
}
