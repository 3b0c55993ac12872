//! A pass over a scene of the host's memory, of which only what differs is uploaded.

use crate::common::gradient::random_upstream;
use crate::common::renderer;
use crate::common::scenes::Case;
use crate::host::{
    Host, Planned, assert_silent, engine, error, images, plan_backward, plan_of, rasterizer, run, submit,
};
use softras::embed::PassMesh;
use softras::scene::{Appearance, Shading, Texture, Wrap};
use softras::{Camera, GradientRequest, Lights, Mesh, Projection, Scene, Settings, shapes};

/// A textured mesh and one of vertex colours, each in a view of its own.
fn case() -> Case {
    let textured = shapes::torus(0.8, 0.3, 9, 6).unwrap();
    let uvs = textured.positions().iter().map(|&[x, y, _]| [x, y]).collect();
    let uv_triangles = textured.triangles().to_vec();
    let texels = (0..12).map(|i| [i as f32 / 12.0, 0.5, 1.0 - i as f32 / 12.0]).collect();
    let textures = vec![Texture::new(4, 3, texels, Wrap::Repeat).unwrap()];
    let image = Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle: Vec::new() };
    let ball = shapes::icosphere(1).unwrap();
    let colors = Appearance::VertexColors(ball.positions().iter().map(|p| p.map(|x| 0.5 + 0.4 * x)).collect());
    let normals = ball.positions().to_vec();
    let ball = ball.with_appearance(colors).unwrap().with_normals(normals).unwrap();
    let lights = Lights { shading: Shading::Smooth, ..Lights::official() };
    let scene = Scene::batch(vec![textured.with_appearance(image).unwrap(), ball]).with_lights(lights);
    let camera = |angle| Camera::from_angles(3.5, 20.0, angle, Projection::Perspective { fov_y: 0.8 }).unwrap();
    let settings = Settings { width: 24, height: 20, sigma: 1e-3, save: true, ..Settings::default() };
    let cameras = vec![camera(10.0), camera(50.0)];
    Case { scene, cameras, settings, ..super::geometry::Engines::new().case() }
}

/// Makes another scene of one.
type Change<'a> = &'a dyn Fn(&Scene) -> Scene;

/// The scene with another mesh in one of its places.
fn with(scene: &Scene, place: usize, change: impl FnOnce(&Mesh) -> Mesh) -> Scene {
    let mut meshes = scene.meshes.clone();
    meshes[place] = change(&meshes[place]);
    Scene { meshes, lights: scene.lights.clone() }
}

/// The mesh of normals with other positions and the same normals.
fn moved(mesh: &Mesh, by: impl Fn([f32; 3]) -> [f32; 3]) -> Mesh {
    let mut moved = mesh.clone();
    moved.set_positions(mesh.positions().iter().map(|p| by(*p)).collect()).unwrap();
    moved.with_normals(mesh.normals().to_vec()).unwrap()
}

/// The mesh with its appearance changed in place.
fn painted(mesh: &Mesh, change: impl FnOnce(&mut Appearance)) -> Mesh {
    let mut appearance = mesh.appearance().clone();
    change(&mut appearance);
    mesh.clone().with_appearance(appearance).unwrap()
}

/// Each kind of input, changed after the one before it: the next frame and its gradients are the simple API's, bit by bit. The
/// upload buffer is overwritten each time, so that a copy of what did not change would show.
#[test]
fn a_changed_scene_is_as_if_planned_so() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let mut case = case();
    let upstream = random_upstream(&case, case.settings.outputs);
    let wanted = GradientRequest { texels: true, uvs: true, lights: true, ..GradientRequest::ALL };
    let plan = plan_backward(plan_of(&rasterizer, &case), &upstream, wanted);
    let mut host = Host::whole(&engine, &rasterizer, plan, &upstream);
    let mut simple = renderer();
    let mut expected = |case: &Case| {
        let frame = simple.render_saved(&case.scene, &case.cameras, &case.settings).unwrap();
        let gradients = simple.backward(&frame, &upstream, &wanted).unwrap();
        Planned::of(&frame, gradients)
    };
    let found = |case: &Case, host: &Host| Planned { images: images(case, host), gradients: host.gradients() };
    assert_eq!(found(&case, &host).difference(&expected(&case)), None);

    let recolored = |appearance: &mut Appearance| match appearance {
        Appearance::VertexColors(colors) => colors.iter_mut().for_each(|[r, g, _]| std::mem::swap(r, g)),
        Appearance::Textured { textures, .. } => {
            let texels = textures[0].texels().iter().map(|&[r, g, b]| [b, r, g]).collect();
            textures[0] = textures[0].with_texels(texels).unwrap().with_wrap(Wrap::Clamp);
        }
        other => panic!("{other:?}"),
    };
    let shifted = |appearance: &mut Appearance| {
        let Appearance::Textured { uvs, .. } = appearance else { panic!("it has UVs") };
        uvs.iter_mut().for_each(|uv| uv[0] += 0.1);
    };
    let turned = |mesh: &Mesh| {
        let normals = mesh.normals().iter().map(|&[x, y, z]| [y, z, x]).collect();
        mesh.clone().with_normals(normals).unwrap()
    };
    let changes: [(&str, Change<'_>); 7] = [
        ("nothing", &Scene::clone),
        ("positions", &|scene| with(scene, 1, |mesh| moved(mesh, |[x, y, z]| [1.1 * x, y + 0.1, z]))),
        ("colours", &|scene| with(scene, 1, |mesh| painted(mesh, recolored))),
        ("texels", &|scene| with(scene, 0, |mesh| painted(mesh, recolored))),
        ("UVs", &|scene| with(scene, 0, |mesh| painted(mesh, shifted))),
        ("normals", &|scene| with(scene, 1, turned)),
        ("lights", &|scene| scene.clone().with_lights(Lights { ambient_intensity: 0.9, ..scene.lights.clone() })),
    ];
    for (name, change) in changes {
        let before = expected(&case);
        case.scene = change(&case.scene);
        let changes = host.pass.set_scene(case.scene.clone()).expect(name);
        assert_eq!(changes.is_empty(), ["nothing", "lights"].contains(&name), "{name}");
        let upload = host.memory.upload.bytes_mut();
        upload.fill(0xcd);
        host.pass.write_scene(upload, changes).unwrap();
        host.pass.write_frame(upload).unwrap();
        submit(&engine, |commands| {
            host.pass.record_scene(commands, changes).unwrap();
            host.pass.record_forward(commands).unwrap();
            host.pass.record_backward(commands).unwrap();
        });
        let found = found(&case, &host);
        assert_eq!(found.difference(&expected(&case)), None, "{name}");
        assert_eq!(found.difference(&before).is_none(), name == "nothing", "{name}");
    }
    // A plan that is made of the pass's has the present scene.
    let again = Host::new(&engine, &rasterizer, host.pass.plan().builder()).with_upstream(&upstream);
    run(&engine, &again.pass);
    assert_eq!(found(&case, &again).difference(&expected(&case)), None);
    drop((host, again, rasterizer));
    assert_silent(engine);
}

/// A scene that needs another plan is refused, and the pass stays as it was.
#[test]
fn a_scene_of_another_shape_is_refused() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let case = case();
    let plan = plan_of(&rasterizer, &case);
    let mut host = Host::new(&engine, &rasterizer, plan.clone());
    let unset = host.pass.set_scene(case.scene.clone()).unwrap();
    submit(&engine, |commands| assert!(error(host.pass.record_scene(commands, unset)).contains("record_setup")));
    run(&engine, &host.pass);
    let before = images(&case, &host);
    let ball = &case.scene.meshes[1];
    let mut triangles = ball.triangles().to_vec();
    triangles.swap(0, 1);
    let flipped = Mesh::new(ball.positions().to_vec(), triangles).unwrap();
    let flipped = flipped.with_appearance(ball.appearance().clone()).unwrap();
    let flipped = flipped.with_normals(ball.normals().to_vec()).unwrap();
    let near = |mesh: &Mesh| moved(mesh, |p| p.map(|x| 4.0 * x));
    let light = case.scene.lights.directional[0];
    let more = Lights { directional: vec![light; 2], ..case.scene.lights.clone() };
    let flat = Lights { shading: Shading::Flat, ..case.scene.lights.clone() };
    for (scene, what) in [
        (with(&case.scene, 1, |_| flipped), "triangles, sizes or numbers"),
        (with(&case.scene, 1, |_| shapes::icosphere(2).unwrap()), "triangles, sizes or numbers"),
        (with(&case.scene, 1, near), "crosses the near or the far plane"),
        (case.scene.clone().with_lights(more), "number of lights"),
        (case.scene.clone().with_lights(flat), "shading"),
        (Scene::batch(vec![ball.clone(); 3]), "3 meshes"),
    ] {
        let refused = error(host.pass.set_scene(scene));
        assert!(refused.contains(what), "{refused}");
    }
    run(&engine, &host.pass);
    assert_eq!(images(&case, &host), before);

    let of_meshes = rasterizer.pass(&[PassMesh::new(3, &[0u16, 1, 2])]).cameras(&case.cameras).build().unwrap();
    let memory = crate::host::Memory::new(&engine, &of_meshes);
    let vertices = super::geometry::storage(&engine, &[0; 36]);
    let layout = softras::embed::Layout { stride: 12, offset: 0 };
    let buffers = [softras::embed::MeshBuffers::new(vertices.whole(), layout)];
    let mut pass = rasterizer.bind_pass(of_meshes, memory.refs(), &buffers).unwrap();
    assert!(error(pass.set_scene(case.scene)).contains("no scene"));
    drop((pass, host, memory, vertices, rasterizer));
    assert_silent(engine);
}
