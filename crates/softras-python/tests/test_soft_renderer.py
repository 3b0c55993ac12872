"""softras.soft_renderer: the official package's interface, and its recorded outputs where they are."""

import os
import subprocess
import sys

import numpy as np
import pytest

import softras

torch = pytest.importorskip("torch", reason="torch is not installed: test.sh --with torch adds it")
import softras.soft_renderer as sr  # noqa: E402
import softras.soft_renderer.functional as srf  # noqa: E402

SCREEN = [
    "tiny_s0.0001_g0.0001",
    "tiny_s0.0001_g0.01",
    "tiny_s0.001_g0.01",
    "tiny_s1e-05_g0.0001",
    "tiny_mode_alpha_sum",
    "tiny_mode_barycentric",
    "tiny_mode_batch2",
    "tiny_mode_nearfar",
    "tiny_mode_no_fill_back",
    "tiny_mode_silhouette_hard_rgb",
    "tiny_mode_surface_R4",
    "sphere_s0.0001_g0.0001",
    "sphere_s0.001_g0.01",
    "spot_s0.0001_g0.0001",
]


def close(ours, theirs, tolerance=2e-4, share=0.995):
    """Whether all but a few values are within a tolerance."""
    ours = ours.detach().numpy() if isinstance(ours, torch.Tensor) else ours
    assert ours.shape == theirs.shape
    within = (np.abs(ours - theirs) <= tolerance).mean()
    assert within >= share, f"{within:.4%} of the values are within {tolerance}"


@pytest.mark.parametrize("name", SCREEN)
def test_the_recorded_images_and_gradients(recorded, name):
    data = np.load(recorded / f"{name}.npz")
    options = {key[4:]: data[key].tolist() for key in data.files if key.startswith("opt_")}
    vertices = torch.from_numpy(data["face_vertices"]).requires_grad_()
    textures = torch.from_numpy(data["textures"]).requires_grad_()
    image = srf.soft_rasterize(vertices, textures, **options)
    close(image, data["soft_colors"])
    image.backward(torch.from_numpy(data["grad_soft_colors"]))
    for ours, key in ((vertices.grad, "grad_face_vertices"), (textures.grad, "grad_textures")):
        theirs = data[key]
        norms = [np.linalg.norm(x.reshape(-1)) for x in (ours.numpy() - theirs, theirs)]
        # Where b0 + b1 = 1, rounding decides which of two cells the official code takes.
        tolerance = 5e-2 if name == "tiny_mode_surface_R4" and key == "grad_textures" else 2e-2
        assert norms[0] < tolerance * norms[1], f"{key} is off by {norms[0] / norms[1]:.3g}"


def test_the_recorded_pipeline(recorded):
    data = np.load(recorded / "pipeline.npz")
    vertices = torch.from_numpy(data["vertices"]).requires_grad_()
    faces = torch.from_numpy(data["faces"])[None]
    eye = srf.get_points_from_angles(*data["eye_angles"].tolist())
    np.testing.assert_allclose(eye, data["eye"], atol=1e-7)
    view = srf.look_at(vertices, torch.tensor(eye, dtype=torch.float64))
    projected = srf.perspective(view, 30)
    mesh = sr.Mesh(vertices, faces)
    lit = sr.Lighting("surface")(sr.Mesh(vertices.detach(), faces)).textures[:, :, 0]
    smooth = sr.Lighting("vertex")(sr.Mesh(vertices.detach(), faces, texture_type="vertex")).textures
    pairs = {
        "look_at": view,
        "perspective30": projected,
        "orthogonal_scale0p7": srf.orthogonal(view, 0.7),
        "surface_normals": mesh.surface_normals,
        "vertex_normals": mesh.vertex_normals,
        "light_surface": lit,
        "light_vertex": smooth,
    }
    for name, ours in pairs.items():
        np.testing.assert_allclose(ours.detach(), data[name], atol=1e-6, err_msg=name)
    projected.backward(torch.from_numpy(data["upstream_projected"]))
    np.testing.assert_allclose(vertices.grad, data["grad_vertices"], atol=1e-6)
    positions = torch.from_numpy(data["loss_vertices"])[None].requires_grad_()
    losses = {"laplacian": sr.LaplacianLoss(positions[0], faces[0]).double(), "flatten": sr.FlattenLoss(faces[0])}
    for name, loss in losses.items():
        value = loss(positions)
        # The official Laplacian is a matrix in single precision.
        np.testing.assert_allclose(value.detach(), data[f"{name}_loss"], rtol=1e-6)
        (gradient,) = torch.autograd.grad(value.sum(), positions)
        np.testing.assert_allclose(gradient, data[f"{name}_grad"], atol=1e-5 * np.abs(data[f"{name}_grad"]).max())


def test_the_recorded_demo(recorded):
    data = np.load(recorded / "spot_demo_render.npz")
    mesh = sr.Mesh.from_obj(str(recorded.parent / "meshes" / "spot.obj"), load_texture=True, texture_res=5)
    close(mesh.textures, data["textures_unlit_u16"] / 65535.0, 2e-4)
    renderer = sr.SoftRenderer(camera_mode="look_at")
    renderer.transform.set_eyes_from_angles(2.732, 30, 0)
    image = renderer.render_mesh(mesh)
    close(mesh.face_vertices, data["face_vertices"], 1e-5)
    close(image, data["image"])


def test_the_recorded_curve_of_the_deform_demo(recorded):
    folder = recorded.parent / "deform"
    images = torch.from_numpy(np.load(folder / "views.npy")[::5, 3].astype(np.float32) / 255.0)
    cameras = torch.from_numpy(np.load(folder / "cameras.npy")[::5].astype(np.float32))
    losses = np.loadtxt(folder / "official_loss_f64.csv", delimiter=",", skiprows=1)[:, 1]
    mesh = sr.Mesh.from_obj(folder / "sphere_1352.obj")
    start, faces = 0.5 * mesh.vertices, mesh.faces
    moved, center = torch.zeros_like(start).requires_grad_(), torch.zeros(1, 1, 3).requires_grad_()
    laplacian, flatten = sr.LaplacianLoss(start[0], faces[0]), sr.FlattenLoss(faces[0])
    renderer = sr.SoftRenderer(
        image_size=64, sigma_val=1e-4, aggr_func_rgb="hard", camera_mode="look_at", viewing_angle=15
    )
    renderer.transform.set_eyes_from_angles(*cameras.unbind(1))
    optimizer = torch.optim.Adam([moved, center], 0.01, betas=(0.5, 0.99))
    for step in range(15):
        size = torch.sigmoid(torch.logit(start.abs()) + moved)
        shift = torch.tanh(center)
        vertices = size * start.sign() * (1 - start.sign() * shift) + shift
        alpha = renderer(vertices.expand(len(images), -1, -1), faces)[:, 3]
        product = alpha * images
        iou = product.sum((1, 2)) / ((alpha + images - product).sum((1, 2)) + 1e-6)
        loss = 1 - iou.mean() + 0.03 * laplacian(vertices).mean() + 0.0003 * flatten(vertices).mean()
        assert abs(loss.item() - losses[step]) < 1e-3, step
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert losses[0] - loss.item() > 0.02


def sphere(texture_type="surface", batch=1):
    ball = softras.shapes.icosphere(2)
    vertices = torch.tensor(ball.positions).repeat(batch, 1, 1)
    faces = torch.tensor(ball.triangles.astype(np.int32)).repeat(batch, 1, 1)
    return sr.Mesh(vertices, faces, texture_res=2, texture_type=texture_type)


@pytest.mark.parametrize("camera", [{"camera_mode": "look_at"}, {"camera_mode": "look", "perspective": False}])
def test_a_batch_is_rendered_and_learns(camera):
    mesh = sphere("vertex", 2)
    start = mesh.vertices.clone().requires_grad_()
    renderer = sr.SoftRenderer(image_size=32, sigma_val=1e-3, anti_aliasing=True, **camera)
    images = renderer(start, mesh.faces, mesh.textures, texture_type="vertex")
    assert images.shape == (2, 4, 32, 32) and images[:, 3].max() > 0.9
    images[0].sum().backward()
    assert start.grad[0].any() and not start.grad[1].any()


def test_a_projection_is_that_of_the_library():
    vertices = torch.rand(2, 5, 3) + torch.tensor([0.0, 0.0, 2.0])
    matrices = torch.tensor([[[60.0, 0, 32, 0], [0, 60, 32, 0], [0, 0, 1, 0]]]).repeat(2, 1, 1)
    found = sr.Projection(matrices, orig_size=64)(vertices)
    x = (60 * vertices[..., 0] + 32 * vertices[..., 2]) / (vertices[..., 2] + 1e-5)
    np.testing.assert_allclose(found[..., 0], 2 * (x - 32) / 64, atol=1e-6)
    with pytest.raises(ValueError, match="eyes"):
        sr.Transform("projection", matrices).set_eyes([0, 0, 1])


def test_exact_gradients_are_a_switch():
    def gradient(**switch):
        mesh = sphere()
        corners = srf.look_at(mesh.vertices, (0.0, 0.5, -2.7))
        corners = srf.face_vertices(srf.perspective(corners), mesh.faces).detach().requires_grad_()
        textures = torch.rand(1, mesh.num_faces, 4, 3, generator=torch.Generator().manual_seed(1))
        srf.soft_rasterize(corners, textures, 32, sigma_val=1e-3, gamma_val=1e-2, **switch)[:, :3].sum().backward()
        return corners.grad

    official, exact = gradient(), gradient(exact_gradients=True)
    assert official.any() and (official - exact).abs().max() > 0.01 * official.abs().max()


def test_the_hard_renderer_renders():
    image = sr.Renderer(image_size=16, camera_mode="look_at")(sphere())
    assert image.shape == (1, 4, 16, 16) and image[0, 3, 8, 8] == 1.0 and image[0, 3, 0, 0] == 0.0


def test_meshes_change_and_come_back():
    mesh = sphere()
    faces, vertices = mesh.faces, mesh.vertices
    mesh.fill_back_()
    assert mesh.num_faces == 2 * faces.shape[1] and mesh.textures.shape[1] == mesh.num_faces
    mesh.vertices = 2 * mesh.vertices
    mesh.reset_()
    assert mesh.faces is faces and mesh.vertices is vertices and "faces" in repr(mesh)


def test_files_keep_textures(tmp_path):
    mesh = sphere()
    mesh.textures = torch.rand(1, mesh.num_faces, 4, 3)
    path = str(tmp_path / "mesh.obj")
    mesh.save_obj(path, save_texture=True, texture_res_out=64)
    again = sr.Mesh.from_obj(path, load_texture=True, texture_res=2)
    np.testing.assert_allclose(again.vertices, mesh.vertices)
    # Bytes, and one sample in the middle of each cell.
    assert ((again.textures - mesh.textures).abs() < 0.01).float().mean() > 0.95
    colors = torch.rand(mesh.num_vertices, 3)
    srf.save_obj(path, mesh.vertices[0], mesh.faces[0], colors, texture_type="vertex")
    vertices, faces, found = srf.load_obj(path, True, True, texture_type="vertex")
    np.testing.assert_allclose(found, colors, atol=1e-6)
    assert faces.dtype == torch.int32 and abs(float(vertices.abs().max()) - 1.0) < 0.2
    srf.save_voxel(path, torch.ones(2, 2, 2))
    assert (tmp_path / "mesh.obj").read_text().count("\nv ") + (tmp_path / "mesh.obj").read_text().startswith("v ") == 8


def test_voxels_are_solid():
    cube = softras.shapes.cube()
    mesh = sr.Mesh(cube.positions * [0.5, 0.25, 0.25], cube.triangles.astype(np.int32))
    voxels = mesh.voxelize(32)[0]
    # 0.6 and 0.3 of the grid, and the voxels that the surface touches.
    spans = [int(voxels.amax(axes).sum()) for axes in ((1, 2), (0, 2), (0, 1))]
    assert voxels.dtype == torch.int32 and voxels[16, 16, 16] == 1 and voxels[0, 0, 0] == 0
    assert 19 <= spans[0] <= 21 and 9 <= spans[1] <= 12 and spans[1] == spans[2]
    assert int(voxels.sum()) == spans[0] * spans[1] * spans[2]
    with pytest.raises(softras.Error, match="finite"):
        sr.functional.voxelization(torch.full((1, 1, 3, 3), float("nan")), 8)


def test_losses_by_hand():
    corners = torch.tensor([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]]).requires_grad_()
    faces = torch.tensor([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    laplacian = sr.LaplacianLoss(corners[0], faces)(corners)
    means = torch.stack([corners[0, [j for j in range(4) if j != i]].mean(0) for i in range(4)])
    np.testing.assert_allclose(laplacian.detach(), [(corners[0] - means).square().sum().item()], rtol=1e-6)
    flat = sr.FlattenLoss(faces, average=True)(corners)
    flat.backward()
    # Three right angles, cos θ = 0, and three of cos θ = 1/√3.
    assert flat.shape == () and abs(flat.item() - (3 + 3 * (1 + 3**-0.5) ** 2)) < 1e-3 and corners.grad.any()
    with pytest.raises(ValueError, match="closed"):
        sr.FlattenLoss(faces[:1])


TRIANGLE = torch.tensor([[[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.0, 0.5, 0.0]]])
FACE = torch.tensor([[[0, 1, 2]]]).int()


def seen(**settings):
    renderer = sr.SoftRenderer(image_size=16, camera_mode="look_at", **settings)
    renderer.transform.set_eyes_from_angles(2.7, 30, 0)
    return renderer


def test_the_sharpest_sigma_comes_in_single_precision():
    images = seen(sigma_val=1e-12).render_mesh(sr.Mesh(TRIANGLE, FACE))
    assert images.shape == (1, 4, 16, 16) and images.is_contiguous() and images.view(1, -1).shape == (1, 1024)


def test_tensors_of_a_graph_are_taken_as_numbers():
    vertices = TRIANGLE.clone().requires_grad_()
    renderer, known = seen(), seen(near=2.0, far=4.0, sigma_val=1e-4)
    renderer.rasterizer.near, renderer.rasterizer.far = vertices.max() * 4.0, vertices.max() * 8.0
    renderer.set_sigma(vertices.sum() * 0 + 1e-4)
    images = renderer.render_mesh(sr.Mesh(vertices, FACE))
    assert torch.equal(images, known.render_mesh(sr.Mesh(vertices, FACE)))
    images.sum().backward()
    assert vertices.grad.any()


@pytest.mark.parametrize("near", [0, -0.7])
def test_a_near_plane_behind_the_eye_weighs_as_in_the_official_code(near):
    vertices = torch.cat((TRIANGLE, TRIANGLE + torch.tensor([0.1, 0.1, 0.02])), 1)
    faces = torch.tensor([[[0, 1, 2], [3, 4, 5]]]).int()
    colors = torch.tensor([[[[1.0, 0, 0]], [[0, 1.0, 0]]]])
    # 1 - ζ is (z - near) / (far - near): a smaller gamma by a larger near has the same weights.
    with pytest.warns(UserWarning, match="near = "):
        images = seen(near=near, gamma_val=1e-3, eps=0.3).render_mesh(sr.Mesh(vertices, faces, colors))
    factor = (100 - near) / (100 - 1e-3)
    known = seen(near=1e-3, gamma_val=1e-3 * factor, eps=0.3 * factor).render_mesh(sr.Mesh(vertices, faces, colors))
    assert (images - known).abs().max() < 1e-4 and images[0, :2].amax((1, 2)).min() > 0.1


def test_reset_takes_the_textures_that_a_program_set():
    mesh = sr.Mesh(TRIANGLE, FACE, texture_type="vertex")
    mesh._textures = mesh._origin_textures = torch.zeros(1, 3, 3)
    mesh.textures = torch.ones(1, 3, 3)
    mesh.reset_()
    assert mesh.textures.max() == 0.0


ON_THE_CPU = """
import concurrent.futures, threading, torch, softras.soft_renderer
softras.soft_renderer.install()
calls = [
    lambda: torch.zeros(2, device="cuda"), lambda: torch.zeros(2).to(0), lambda: torch.zeros(2, device=0),
    lambda: torch.zeros(2).to(device=0), lambda: torch.zeros(2, device=torch.device("cuda", 0)), lambda: torch.zeros(2).cuda(0),
    lambda: torch.zeros(2).type("torch.cuda.FloatTensor"), lambda: torch.zeros(2).type(torch.cuda.HalfTensor),
    lambda: torch.zeros(2).pin_memory(), lambda: torch.zeros(2, pin_memory=True), lambda: torch.nn.Linear(2, 2).to(0).weight,
    lambda: torch.nn.Linear(2, 2, device="cuda:0").weight,
    lambda: torch.rand(2, generator=torch.Generator(device="cuda").manual_seed(1), device="cuda"),
]
def work(found):
    with torch.cuda.device(torch.cuda.current_device()):
        found.extend(call().device.type for call in calls)
    return found
here, there = work([]), []
thread = threading.Thread(target=work, args=(there,))
thread.start()
thread.join()
with concurrent.futures.ThreadPoolExecutor(1) as pool:
    pooled = pool.submit(work, []).result()
print(here == there == pooled == ["cpu"] * len(calls), isinstance(torch.Generator("cuda"), torch.Generator))
"""


def test_the_cpu_is_found_by_threads_numbers_and_types():
    hidden = {**os.environ, "CUDA_VISIBLE_DEVICES": ""}
    result = subprocess.run([sys.executable, "-c", ON_THE_CPU], env=hidden, capture_output=True, text=True, timeout=120)
    assert result.stdout.split() == ["True", "True"], result.stdout + result.stderr


def test_integers_are_refused_and_gradients_of_zero_are_zeros():
    with pytest.raises(softras.errors.InputError, match="vertices: .* give floats"):
        sr.Mesh(TRIANGLE.long(), FACE)
    with pytest.raises(softras.errors.InputError, match="textures: .* give floats"):
        sr.Mesh(TRIANGLE.numpy(), FACE, np.ones((1, 1, 1, 3), np.uint8))
    with pytest.raises(softras.errors.InputError, match="faces"):
        sr.Mesh(TRIANGLE, FACE.numpy().astype(float))
    vertices, textures = TRIANGLE.clone().requires_grad_(), torch.ones(1, 1, 1, 3, requires_grad=True)
    images = seen().render_mesh(sr.Mesh(vertices, FACE, textures))
    (images[:, 3] * 0).sum().backward()
    assert not vertices.grad.any() and not textures.grad.any()
    above = seen()
    above.transform.set_eyes_from_angles(np.float32(2.7), np.int64(90), 0)
    assert above.render_mesh(sr.Mesh(torch.tensor([[[-0.5, 0, -0.5], [0.5, 0, -0.5], [0.0, 0, 0.5]]]), FACE))[0, 3].sum() > 5
    with pytest.raises(softras.errors.CameraError, match="give another up"):
        srf.look_at(TRIANGLE, (0, 3, 0), up=(0, 1, 0))


def test_modules_run_without_a_gpu(tmp_path):
    (tmp_path / "pkg").mkdir()
    (tmp_path / "pkg" / "main.py").write_text(
        "import sys, torch, soft_renderer.functional.voxels, soft_renderer as sr\n"
        "torch.cuda.set_device(0)\n"
        "a = torch.zeros(3, device='cuda:0') + torch.zeros(3).to(torch.device('cuda')) + torch.cuda.FloatTensor(3).fill_(1)\n"
        "print(a.sum().item(), torch.nn.Linear(2, 2).to('cuda').weight.device, sys.argv[1:], __name__)\n"
    )
    command = [sys.executable, "-m", "softras.soft_renderer", "-m", "pkg.main", "x"]
    hidden = {**os.environ, "CUDA_VISIBLE_DEVICES": ""}
    result = subprocess.run(command, env=hidden, capture_output=True, text=True, timeout=120, cwd=tmp_path)
    assert result.stdout.strip() == "3.0 cpu ['x'] __main__", result.stdout + result.stderr


def test_the_fork_of_umr_returns_faces_and_places(monkeypatch):
    monkeypatch.setattr(sr.SoftRasterizer, "returns_info", True)
    # Two faces on the left and on the right, and a third behind the second.
    corners = torch.tensor([[-0.8, -0.4], [-0.2, -0.4], [-0.5, 0.4], [0.2, -0.4], [0.8, -0.4], [0.5, 0.4]])
    depths = torch.tensor([2.0, 2.0, 2.0, 2.5, 2.5, 2.5, 3.0, 3.0, 3.0])
    vertices = torch.cat([torch.cat([corners, corners[3:]]), depths[:, None]], 1)[None]
    mesh = sr.Mesh(vertices, torch.arange(9).reshape(1, 3, 3).int())
    images, places, info = sr.SoftRasterizer(image_size=32, fill_back=True)(mesh)
    assert images.shape == (1, 4, 32, 32) and places.shape == (1, 3, 2) and info.shape == (1, 2, 32, 32)
    assert info[0, 1, 16, 8] == 0 and info[0, 1, 16, 24] == 1 and info[0, 1, 0, 0] == -1
    assert abs(info[0, 0, 16, 8] - 2.0) < 1e-5 and info[0, 0, 0, 0] == 1e7
    # A triangle's middle, a third of its height above its base: y is down here.
    assert (places[0, :2] - torch.tensor([[-0.5, 0.133], [0.5, 0.133]])).abs().max() < 0.03
    _, places, info = sr.SoftRasterizer(image_size=32, aggr_func_rgb="hard", fill_back=True)(mesh)
    assert not places.any() and set(info[0, 1].unique().tolist()) == {-1.0, 0.0, 1.0}


class Doubled(torch.autograd.Function):
    """A program's own function, which sees the images without their being read first."""

    @staticmethod
    def forward(ctx, images):
        return 2 * images

    @staticmethod
    def backward(ctx, upstream):
        return 2 * upstream


def test_colours_are_rendered_when_they_are_read(monkeypatch):
    """At once they are rendered only where those of the last images were read; values and gradients are the same."""
    colors, start = torch.rand(1, 1, 1, 3), TRIANGLE + torch.tensor([0.0, 0.0, 3.0])
    rendered, render = [], softras._scene.render
    seen = lambda scene, arrays, save, colored=True: rendered.append(not colored) or render(scene, arrays, save, colored)
    monkeypatch.setattr(softras._scene, "render", seen)
    rasterizer = sr.SoftRasterizer(image_size=16, sigma_val=1e-3, fill_back=True)

    def step(loss):
        vertices, textures = start.clone().requires_grad_(), colors.clone().requires_grad_()
        images = rasterizer(sr.Mesh(vertices, FACE, textures))
        outline = (images[:, 3] * images[:, 3:].square()).sum()
        # The images are those of the vertices as they were.
        vertices.data.mul_(2.0)
        value = outline if loss is None else outline + loss(images)
        value.backward()
        return value, vertices.grad, textures.grad

    def square(images):
        return torch.stack([images, images]).square().sum()

    assert not step(None)[2].any() and rendered == [True]
    late = step(square)
    assert rendered == [True, True, False] and rasterizer.colors_are_read
    at_once = step(square)
    assert rendered == [True, True, False, False] and late[2].any()
    assert all(torch.equal(a, b) for a, b in zip(late, at_once))
    rasterizer.colors_are_read = False
    own = step(lambda images: Doubled.apply(images).square().sum() / 2)
    assert torch.equal(own[2], late[2]) and rendered[-2:] == [True, False]


def test_compiled_code_and_functional_gradients():
    rasterizer, start = sr.SoftRasterizer(image_size=16, sigma_val=1e-3, fill_back=True), TRIANGLE + torch.tensor([0.0, 0.0, 3.0])

    def loss(vertices):
        images = rasterizer(sr.Mesh(vertices, FACE))
        return images[:, 3].mean() + images[:, :3].square().sum()

    for function in (loss, torch.compile(loss, backend="eager")):
        vertices = start.clone().requires_grad_()
        function(vertices).backward()
        assert torch.equal(vertices.grad, torch.func.grad(loss)(start)) and vertices.grad.any()


def test_images_need_not_be_square():
    mesh = sr.Mesh(TRIANGLE, FACE)
    wide = seen(image_height=16, image_width=32).render_mesh(mesh)
    mesh.reset_()
    square = seen().render_mesh(mesh)
    assert wide.shape == (1, 4, 16, 32) and (wide[..., 8:24] - square).abs().max() < 1e-5
    mesh.reset_()
    images, places, info = srf.soft_rasterize(mesh.face_vertices, mesh.face_textures, (8, 12)), *srf.rasterize_info(
        mesh.face_vertices, (8, 12)
    )
    assert images.shape == (1, 4, 8, 12) and info.shape == (1, 2, 8, 12) and places.shape == (1, 1, 2)


def test_many_cells_are_refused_with_a_fix(monkeypatch):
    def full(*arguments, **names):
        raise softras.errors.LimitError("buffer `texels` needs 9 bytes, the device's limit is 8")

    monkeypatch.setattr(softras.torch, "_rendered", full)
    with pytest.raises(softras.errors.LimitError, match="1 × 1 faces with 1 cells each: use a smaller texture_res"):
        sr.SoftRasterizer(image_size=8)(sr.Mesh(TRIANGLE, FACE))


def test_cells_are_samples_of_the_texture(tmp_path):
    ramp = np.linspace(0, 1, 9, dtype=np.float32)
    texture = np.stack(np.broadcast_arrays(ramp, ramp[::-1, None], 0.5), -1)
    uvs = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
    softras.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], textures=texture, uvs=uvs).save(tmp_path / "ramp.obj", srgb=False)
    cells = sr.Mesh.from_obj(tmp_path / "ramp.obj", load_texture=True, texture_res=2).textures[0, 0]
    # b = ((x + 1/3) / 2, (y + 1/3) / 2) below the diagonal; UVs are (b1, 1 - b0 - b1), and the texture shows them.
    shares = torch.tensor([[1 / 6, 1 / 6], [4 / 6, 1 / 6], [1 / 6, 4 / 6], [1 / 3, 1 / 3]])
    expected = torch.stack([shares[:, 1], 1 - shares.sum(1), torch.full((4,), 0.5)], 1)
    assert (cells - expected).abs().max() < 0.01
