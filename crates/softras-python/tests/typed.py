"""Uses every public function of softras, for `mypy --strict`; test_types.py says what it must name."""

import numpy as np

import softras

cube, ball, ring = softras.shapes.cube(), softras.shapes.icosphere(1), softras.shapes.torus()
fish = softras.shapes.fish().with_normals(None).with_look(colors=[0.5, 0.5, 0.5]).with_positions(softras.shapes.fish().positions)
camera = softras.Camera.from_angles(3.0, 20.0, 30.0, fov_y=0.8)
cameras = [camera, softras.Camera.look_at((0, 0, 3), (0, 0, 0), fov_y=0.8), softras.Camera.screen()]
lights = softras.Lights(directional=(softras.DirectionalLight(),), shading="smooth")
settings = softras.Settings.official(width=32, height=32).with_depths_of(cube, camera).with_blur_pixels(2.0)
renderer: softras.Renderer = softras.default_renderer()
devices: list[softras.Device] = softras.devices()


def everything(folder: str) -> None:
    frame: softras.Frame = softras.render(cube, camera, settings, lights, save=True, renderer=renderer)
    found: softras.Gradients = softras.backward(frame, by="positions", silhouette=np.ones_like(frame.silhouette))
    one: softras.MeshGradients = found.meshes[0]
    print(one.positions.shape, settings.blur_pixels(), settings.cutoff())
    fragments: softras.Fragments = softras.fragments([cube, ball], [camera, camera], settings)
    checks: list[softras.Check] = softras.check()
    print(fragments.triangle.max(), fragments.depth.max(), [check.name for check in checks])
    views = softras.Views([camera], silhouette=frame.silhouette, color=frame.color)
    fitted: softras.Fitted = softras.fit(views, color=True, steps=3, progress=print)
    deformed: softras.FitResult = softras.fit(ball, camera, silhouette=frame.silhouette, steps=3, progress=True)
    again: softras.FitResult = softras.deform(ball, camera, silhouette=frame.silhouette, steps=3)
    print(fitted.measures, deformed.losses, again.mesh.bounds, fitted.notes)
    pose: softras.Pose = softras.pose(cube, camera, frame.color, frame.silhouette, starts=1, steps=3)
    print(pose.applied(cube), pose.degrees_to(np.eye(3)))
    picture: softras.Picture = softras.view(cube, size=(32, 24), background=(1, 1, 1))
    picture.save(folder + "/cube.exr")
    fish.save(folder + "/fish.glb")
    mesh: softras.Mesh = softras.remesh(softras.load(folder + "/fish.glb"), 0.2)
    soft = softras.blurred_mask(frame.silhouette, 1e-4)
    print(softras.iou(mesh, ring), softras.is_closed(mesh), softras.mask_iou(soft, frame.silhouette))
    print(softras.voxelize(mesh, 8, (-1, -1, -1), 2.0).sum(), softras.reference.render(cube, camera, settings).keys())
    print(softras.reference.gradient(cube, camera, settings, silhouette=frame.silhouette).sigma)
    try:
        softras.load_views(folder)
    except softras.errors.FileError as error:
        caught: softras.Error = error
        print(caught)
