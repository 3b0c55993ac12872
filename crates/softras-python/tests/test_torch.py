"""softras.torch: the same bits as the renderer's own gradients, and torch's check of them in double precision."""

import copy
import dataclasses
import gc
import os
import subprocess
import sys

import numpy as np
import pytest

import softras

torch = pytest.importorskip("torch", reason="torch is not installed: test.sh --with torch adds it")
import softras.torch as st  # noqa: E402


@pytest.fixture(scope="module")
def ball():
    sphere = softras.shapes.icosphere(1)
    return torch.tensor(sphere.positions), torch.tensor(sphere.triangles.astype(np.int64))


def leaf(value, dtype=torch.float32):
    return torch.tensor(np.asarray(value), dtype=dtype).requires_grad_()


def test_gradients_are_the_renderers_to_the_bit(bumpy, cameras, settings):
    lights = softras.Lights.official()
    frame = softras.render(bumpy, cameras, settings, lights, save=True)
    random = np.random.default_rng(3)
    upstream = {name: random.standard_normal(getattr(frame, name).shape).astype(np.float32) for name in settings.outputs}
    found = frame.backward(by=("positions", "colors", "lights", "background", "scalars"), **upstream)
    vertices, colors = leaf(bumpy.positions), leaf(bumpy.colors)
    inputs = {
        "background": leaf(settings.background_color, torch.float64),
        "sigma": leaf(settings.sigma, torch.float64),
        "gamma": leaf(settings.gamma, torch.float64),
        "ambient_color": leaf(lights.ambient_color, torch.float64),
        "light_directions": leaf([lights.directional[0].direction], torch.float64),
        "light_intensities": leaf([0.5], torch.float64),
    }
    images = st.render(
        vertices, bumpy.triangles, cameras, colors=colors, settings=settings, lights=lights, **inputs
    )
    rendered = {name: getattr(images, name) for name in settings.outputs}
    for name, image in rendered.items():
        np.testing.assert_array_equal(image.detach().numpy(), getattr(frame, name))
    sum((image * torch.from_numpy(upstream[name])).sum() for name, image in rendered.items()).backward()
    np.testing.assert_array_equal(vertices.grad.numpy(), found.meshes[0].positions)
    np.testing.assert_array_equal(colors.grad.numpy(), found.meshes[0].colors)
    for name, tensor in inputs.items():
        np.testing.assert_array_equal(tensor.grad.numpy(), getattr(found, name), err_msg=name)


SCENES = [
    {},
    {"color": "hard"},
    {"silhouette": "sum"},
    {"distance": "barycentric", "sigma": 2e-2},
    {"background": "composite"},
    {"interpolation": "perspective"},
    {"sigma": 3e-2, "gamma": 0.1},
    {"background_color": (0.2, 0.5, 0.9)},
    {"near": 0.5, "far": 20.0},
    {"outputs": ("silhouette",)},
]


@pytest.mark.parametrize("fields", SCENES, ids=str)
def test_gradcheck(fields):
    random = np.random.default_rng(4)
    # Values that single precision holds, and a tau so small that no fragment leaves the support.
    vertices = random.uniform(-0.7, 0.7, (6, 3)).astype(np.float32).astype(np.float64)
    colors = random.random((6, 3)).astype(np.float32).astype(np.float64)
    faces = torch.tensor([[0, 1, 2], [3, 4, 5]])
    camera = softras.Camera.look_at((0, 0, 3), (0, 0, 0), fov_y=0.8)
    given = {"width": 6, "height": 6, "sigma": 1e-2, "gamma": 0.05, "near": 1.0, "far": 5.0, "tau": 1e-12, **fields}
    settings = softras.Settings(**{"outputs": ("color", "silhouette"), **given})

    def render(vertices, colors):
        images = st.render(vertices, faces, camera, colors=colors, settings=settings)
        return tuple(image for image in images if image is not None)

    tensors = (leaf(vertices, torch.float64), leaf(colors, torch.float64))
    assert torch.autograd.gradcheck(render, tensors, eps=1e-7, atol=1e-6, rtol=1e-4)


@pytest.mark.parametrize("count", [1, 3, 5])
def test_gradcheck_of_features(count):
    random = np.random.default_rng(6)
    vertices = random.uniform(-0.7, 0.7, (6, 3)).astype(np.float32).astype(np.float64)
    colors, features = (random.uniform(-1, 1, (6, n)).astype(np.float32).astype(np.float64) for n in (3, count))
    faces = torch.tensor([[0, 1, 2], [3, 4, 5]])
    view = torch.tensor(softras.Camera.look_at((0, 0, 3), (0, 0, 0), fov_y=0.8).view)
    camera = softras.Camera.look_at((0, 0, 3), (0, 0, 0), fov_y=0.8)
    settings = softras.Settings(width=6, height=6, sigma=1e-2, gamma=0.05, near=1.0, far=5.0, tau=1e-12)
    view = torch.cat([view, torch.tensor([[0.0, 0.0, 0.0, 1.0]])])[None]

    def render(vertices, colors, features, sigma, gamma, twist):
        given = {"views": st.rigid_motion(twist) @ view, "sigma": sigma, "gamma": gamma, "settings": settings}
        images = st.render(vertices, faces, camera, colors=colors, features=features, **given)
        assert images.features.shape == (1, 6, 6, count) and images.depth is None
        return images.color, images.silhouette, images.features

    tensors = [leaf(x, torch.float64) for x in (vertices, colors, features, 1e-2, 0.05, np.zeros(6))]
    assert torch.autograd.gradcheck(render, tensors, eps=1e-7, atol=1e-6, rtol=1e-4)


def test_features_are_colours_of_any_number(bumpy, ball, cameras, settings):
    """Those of 70 channels take three frames, and have the bits of their parts."""
    settings = dataclasses.replace(settings, background_color=(0.0, 0.0, 0.0), outputs=("color", "silhouette"))
    generator = torch.Generator().manual_seed(2)
    shape = (len(bumpy.positions), 70)
    features = torch.rand(shape, generator=generator).requires_grad_()
    vertices = leaf(bumpy.positions)
    given = {"colors": features[:, :3], "settings": settings}
    whole = st.render(vertices, bumpy.triangles, cameras, features=features, **given)
    assert whole.features.shape == (len(cameras), settings.height, settings.width, 70)
    assert torch.equal(whole.features[..., :3], whole.color)
    weights = torch.rand(whole.features.shape, generator=generator)
    (whole.features * weights).sum().backward()
    by_vertices, by_features = vertices.grad.clone(), features.grad.clone()
    vertices.grad = features.grad = None
    for first in (0, 32, 64):
        part = slice(first, first + 32)
        alone = st.render(vertices, bumpy.triangles, cameras, features=features[:, part], **given).features
        assert torch.equal(whole.features[..., part], alone)
        (alone * weights[..., part]).sum().backward()
    torch.testing.assert_close(features.grad, by_features, rtol=1e-5, atol=1e-5)
    torch.testing.assert_close(vertices.grad, by_vertices, rtol=1e-4, atol=1e-3)
    places, faces = ball
    meshes = [places, 0.5 * places]
    stacked = torch.rand(2, len(places), 4, generator=generator)
    both = st.render(torch.stack(meshes), faces, cameras[:1], features=stacked, settings=settings).features
    for i in range(2):
        one = st.render(meshes[i], faces, cameras[:1], features=stacked[i], settings=settings).features
        assert torch.equal(one[0], both[i])
    with pytest.raises(softras.errors.InputError, match="different numbers of features"):
        st.render(meshes, faces, cameras[:1], features=[stacked[0], stacked[1, :, :3]], settings=settings)
    with pytest.raises(softras.errors.MeshError, match="features, expected"):
        st.render(places, faces, cameras[:1], features=stacked[0, 1:], settings=settings)


def test_features_of_a_template_and_mistakes(bumpy, cameras, settings):
    """Both devices take a template's features, and refuse the same arrays."""
    settings = dataclasses.replace(settings, width=10, height=8, outputs="features")
    values = 1000 * np.random.default_rng(2).random((len(bumpy.positions), 4), np.float32)
    mesh = bumpy.with_features(values)
    images = [st.render(leaf(bumpy.positions, kind), mesh, cameras, settings=settings) for kind in (torch.float32, torch.float64)]
    assert images[0].color is None and images[0].features.shape == (2, 8, 10, 4)
    torch.testing.assert_close(images[0].features.double(), images[1].features, rtol=1e-3, atol=1e-2)
    wide = torch.tensor(values).repeat(1, 10)
    whole = st.render(leaf(bumpy.positions), bumpy, cameras, features=wide, settings=settings).features
    assert torch.equal(whole[..., :4], images[0].features)
    for kind in (torch.float32, torch.float64):
        for wrong in (torch.rand(5), torch.rand(len(values), 0), None):
            with pytest.raises(softras.errors.InputError, match="features are asked for"):
                st.render(leaf(bumpy.positions, kind), bumpy.triangles, cameras, features=wrong, settings=settings)
    # Colours have no part in this loss, and textures neither.
    square = softras.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], textures=np.ones((2, 2, 3)), uvs=[[0, 0], [1, 0], [0, 1]])
    uvs = leaf(square.uvs, torch.float64)
    features = leaf(np.ones((3, 2)), torch.float64)
    drawn = st.render(leaf(square.positions, torch.float64), square, cameras[0], uvs=uvs, features=features, settings=settings)
    drawn.features.sum().backward()
    assert (uvs.grad is None or not uvs.grad.any()) and features.grad.abs().sum() > 0
    frame = softras.render(bumpy, cameras, save=True)
    with pytest.raises(softras.errors.BackwardError, match="no features image"):
        frame.backward(features=np.ones((2, 8, 10, 4)))


def test_views_and_projections_have_gradients(bumpy, settings):
    twist, eye = torch.full((2, 6), 0.05, dtype=torch.float64), torch.tensor([[0.5, 1.0, 3.2], [2.0, 1.0, -2.4]])
    target, up = torch.zeros(3), torch.tensor([0.0, 1.0, 0.0])
    fov = torch.tensor([0.8, 0.9], dtype=torch.float64)
    camera = softras.Camera.from_angles(3, 0, 0, fov_y=0.8)
    vertices, faces = torch.tensor(bumpy.positions), torch.tensor(bumpy.triangles.astype(np.int64))
    random = np.random.default_rng(5)
    weights = torch.tensor(random.standard_normal((2, settings.height, settings.width)))
    # With so small a tau no fragment enters or leaves a triangle's support.
    soft = softras.Settings(**{**vars(settings), "sigma": 1e-2, "tau": 1e-12, "outputs": ("silhouette",)})

    def loss(twist, eye, fov):
        views = st.rigid_motion(twist) @ st.look_at(eye, target.to(eye), up.to(eye)).to(twist)
        images = st.render(vertices.double(), faces, [camera] * 2, views=views, projections=fov, settings=soft)
        return (images.silhouette * weights).sum()

    tensors = [x.double().requires_grad_() for x in (twist, eye, fov)]
    found = torch.autograd.grad(loss(*tensors), tensors)
    for i, (tensor, gradient) in enumerate(zip(tensors, found)):
        step = torch.tensor(random.standard_normal(tensor.shape))
        moved = [[t.detach() + (h * step if k == i else 0.0) for k, t in enumerate(tensors)] for h in (1e-5, -1e-5)]
        slope = float(loss(*moved[0]) - loss(*moved[1])) / 2e-5
        assert abs(float((gradient * step).sum()) - slope) < 1e-3 * abs(slope) + 1e-3, i


def test_batches_lists_and_templates(ball, cameras, settings):
    vertices, faces = ball
    fish = softras.shapes.fish()
    batch = torch.stack([vertices, 0.5 * vertices]).requires_grad_()
    together = st.render(batch, faces, cameras, settings=settings)
    together.silhouette[1].sum().backward()
    assert not batch.grad[0].any() and batch.grad[1].any()
    listed = [leaf(vertices), leaf(fish.positions)]
    images = st.render(listed, [faces, fish], cameras, settings=settings)
    # Beside a textured mesh other kernels run.
    np.testing.assert_allclose(images.color[0].detach(), together.color[0].detach(), atol=1e-6)
    np.testing.assert_array_equal(images.color[1].detach(), softras.render(fish, cameras[1], settings).color[0])
    images.color.sum().backward()
    assert listed[0].grad.shape == vertices.shape and listed[1].grad.any()


def test_surfaces_and_textures(ball, cameras, settings):
    vertices, faces = ball
    surface = torch.rand(len(faces), 4, 3).requires_grad_()
    st.render(vertices, faces, cameras, surface=surface, settings=settings).color.sum().backward()
    assert surface.grad.any()
    texture, uvs = torch.rand(5, 7, 4).requires_grad_(), torch.rand(len(vertices), 2).requires_grad_()
    images = st.render(vertices, faces, cameras, textures=texture, uvs=uvs, settings=settings)
    images.color.square().sum().backward()
    assert texture.grad[..., :3].any() and texture.grad[..., 3].any() and uvs.grad.any()
    batch = torch.rand(2, 5, 7, 3).requires_grad_()
    pair = torch.stack([vertices, vertices])
    st.render(pair, faces, cameras, textures=batch, uvs=uvs.detach(), settings=settings).color[0].sum().backward()
    assert batch.grad[0].any() and not batch.grad[1].any()


@pytest.fixture(scope="module")
def patched(ball):
    """A ball with two textures, of which triangles show one or the other."""
    vertices, faces = ball
    random = np.random.default_rng(6)
    textures = [random.random(shape, np.float32) for shape in ((5, 7, 4), (3, 4, 3))]
    uvs, chosen = random.random((len(vertices), 2), np.float32), np.arange(len(faces)) % 2
    return softras.Mesh(vertices, faces, uvs=uvs, textures=textures, texture_of_triangle=chosen, wrap="clamp")


def test_several_textures_of_a_mesh(patched, cameras, settings):
    frame = softras.render(patched, cameras, settings, save=True)
    upstream = np.random.default_rng(7).standard_normal(frame.color.shape).astype(np.float32)
    expected = frame.backward(color=upstream, by=("positions", "texels", "uvs")).meshes[0]
    vertices, uvs, faces = leaf(patched.positions), leaf(patched.uvs), torch.tensor(patched.triangles.astype(np.int64))
    # The mesh by its arrays, and as a template of which the texels, or texels and UVs, are tensors.
    whole = {"uvs": uvs, "texture_of_triangle": torch.tensor(patched.texture_of_triangle.astype(np.int64)), "wrap": "clamp"}
    for template, look in ((faces, whole), (patched, {"uvs": uvs}), (patched, {})):
        textures = [leaf(texture) for texture in patched.textures]
        color = st.render(vertices, template, cameras, textures=textures, settings=settings, **look).color
        np.testing.assert_array_equal(color.detach(), frame.color)
        vertices.grad = uvs.grad = None
        color.backward(torch.from_numpy(upstream))
        np.testing.assert_array_equal(vertices.grad, expected.positions)
        np.testing.assert_array_equal(textures[0].grad[..., :3], expected.textures[0])
        np.testing.assert_array_equal(textures[0].grad[..., 3], expected.alphas[0])
        np.testing.assert_array_equal(textures[1].grad, expected.textures[1])
        if "uvs" in look:
            np.testing.assert_array_equal(uvs.grad, expected.uvs)
    mixed = patched.with_look(
        textures=patched.textures, uvs=3 * patched.uvs, texture_of_triangle=patched.texture_of_triangle, wrap=["clamp", "repeat"]
    )
    given = [torch.tensor(texture) for texture in mixed.textures]
    for wrap in (None, mixed.wrap):
        color = st.render(vertices.detach(), mixed, cameras, textures=given, settings=settings, wrap=wrap).color
        np.testing.assert_array_equal(color, softras.render(mixed, cameras, settings).color)
    only_uvs = st.render(vertices.detach(), patched, cameras, uvs=leaf(patched.uvs), settings=settings)
    np.testing.assert_array_equal(only_uvs.color.detach(), frame.color)


def test_texels_have_the_slope_of_the_image(patched, cameras, settings):
    # Colours are linear in the texels of opaque textures.
    vertices = torch.tensor(patched.positions)
    textures, steps = ([torch.rand(4, 4, 3).requires_grad_() for _ in range(2)] for _ in range(2))
    weights = torch.randn(2, settings.height, settings.width, 3)

    def loss(textures):
        return (st.render(vertices, patched, cameras, textures=textures, settings=settings).color * weights).double().sum()

    gradients = torch.autograd.grad(loss(textures), textures)
    with torch.no_grad():
        change = loss([texture + step for texture, step in zip(textures, steps)]) - loss(textures)
        slope = sum((gradient * step).double().sum() for gradient, step in zip(gradients, steps))
    assert abs(float(change - slope)) < 1e-4 * sum(float(gradient.abs().sum()) for gradient in gradients)


def test_meshes_with_different_numbers_of_textures(patched, ball, cameras, settings):
    vertices, faces = ball
    two, one = [leaf(texture) for texture in patched.textures], torch.rand(4, 4, 3).requires_grad_()
    plain = softras.Mesh(vertices, faces, uvs=patched.uvs, textures=one.detach())
    images = st.render([vertices, 0.9 * vertices], [patched, plain], cameras, textures=[two, [one]], settings=settings)
    expected = softras.render([patched, plain.with_positions(0.9 * vertices)], cameras, settings)
    np.testing.assert_array_equal(images.color.detach(), expected.color)
    images.color[0].square().sum().backward()
    assert two[0].grad.any() and two[1].grad.any() and not one.grad.any()
    given = {"uvs": torch.tensor(patched.uvs), "textures": [two, one]}
    given["texture_of_triangle"] = [patched.texture_of_triangle, None]
    stacked = torch.stack([vertices, 0.9 * vertices])
    again = st.render(stacked, faces, cameras, settings=settings, wrap="clamp", **given)
    np.testing.assert_array_equal(again.color[0].detach(), images.color[0].detach())
    with pytest.raises(softras.errors.InputError, match="texture_of_triangle has shape"):
        st.render(stacked, faces, cameras, **{**given, "texture_of_triangle": np.zeros((3, len(faces)), int)})


def test_features_of_any_number_are_interpolated(bumpy, cameras, settings):
    found = st.fragments(torch.tensor(bumpy.positions), bumpy, cameras, settings=settings)
    np.testing.assert_array_equal(found.triangle, softras.fragments(bumpy, cameras, settings).triangle)
    features = torch.cat([torch.tensor(bumpy.colors), torch.rand(len(bumpy.positions), 4)], 1).requires_grad_()
    image = st.interpolate(found, features, bumpy.triangles)
    assert image.shape == (2, settings.height, settings.width, 7) and not image[found.triangle < 0].any()
    hard = dataclasses.replace(settings, color="hard", sigma=1e-12, interpolation="perspective")
    assert (image[..., :3] - torch.tensor(softras.render(bumpy, cameras, hard).color)).abs().max() < 1e-4
    image.sum().backward()
    # Every pixel's weights are 1 in sum.
    assert (features.grad.sum(0) - (found.triangle >= 0).sum()).abs().max() < 1e-2


def test_several_nodes_in_one_graph(ball, cameras, settings):
    vertices, faces = ball
    first, second = leaf(vertices), leaf(0.8 * vertices)

    def loss(a, b):
        one = st.render(a, faces, cameras, settings=settings)
        two = st.render(b, faces, cameras, settings=settings)
        again = st.render(a, faces, cameras[0], settings=settings)
        return (one.silhouette * two.silhouette).sum() + again.color.sum()

    loss(first, second).backward()
    alone = leaf(vertices)
    loss(alone, second.detach()).backward()
    np.testing.assert_array_equal(alone.grad, first.grad)
    assert second.grad.any()


def test_wrong_inputs_are_named(ball, cameras, settings):
    vertices, faces = ball
    cases = [
        ("'colour'", lambda: st.render(vertices, faces, cameras, colour=vertices)),
        ("no Tensor", lambda: st.render(vertices, faces, cameras, sigma=1e-3)),
        ("for 1 meshes", lambda: st.render(vertices, faces, cameras, colors=torch.rand(2, len(vertices), 3))),
        ("for 2 cameras", lambda: st.render(vertices, faces, cameras, views=torch.eye(4).repeat(3, 1, 1))),
    ]
    for text, call in cases:
        with pytest.raises(softras.errors.InputError) as caught:
            call()
        assert text in str(caught.value)
    start = leaf(vertices)
    loss = st.render(start, faces, cameras, settings=settings).color.square().sum()
    (slope,) = torch.autograd.grad(loss, start, create_graph=True)
    with pytest.raises(RuntimeError, match="twice"):
        slope.sum().backward()


def test_compiled_code_renders(ball, cameras, settings):
    vertices, faces = ball

    def loss(vertices):
        return (2.0 * st.render(2.0 * vertices, faces, cameras, settings=settings).silhouette).sum()

    plain, compiled = leaf(vertices), leaf(vertices)
    loss(plain).backward()
    torch.compile(loss, backend="eager")(compiled).backward()
    np.testing.assert_array_equal(plain.grad, compiled.grad)


def test_arrays_are_exchanged_by_dlpack(bumpy, cameras, settings):
    frame = softras.render(bumpy, cameras, settings)
    tensor = torch.from_dlpack(frame.color)
    assert tensor.data_ptr() == frame.color.ctypes.data


WORKERS = """
import sys, torch, softras, softras.torch as st

class Views(torch.utils.data.Dataset):
    def __len__(self):
        return 4

    def __getitem__(self, i):
        camera = softras.Camera.from_angles(3, 20, 30.0 * i, fov_y=0.8)
        return torch.from_numpy(softras.render(softras.shapes.cube(), camera, softras.Settings(width=16, height=16)).color[0])

if __name__ == "__main__":
    expected = torch.stack([Views()[i] for i in range(4)])
    loader = torch.utils.data.DataLoader(Views(), batch_size=2, num_workers=2, multiprocessing_context=sys.argv[1])
    print(torch.equal(torch.cat(list(loader)), expected))
"""


@pytest.mark.parametrize("method", ["fork", "spawn"] if hasattr(os, "fork") else ["spawn"])
def test_workers_render(method, tmp_path):
    (tmp_path / "workers.py").write_text(WORKERS)
    command = [sys.executable, str(tmp_path / "workers.py"), method]
    result = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert result.stdout.strip() == "True", result.stdout + result.stderr


PARALLEL = """
import sys, torch, torch.distributed as dist, torch.multiprocessing as mp, softras, softras.torch as st
from torch.nn.parallel import DistributedDataParallel

class Shape(torch.nn.Module):
    def __init__(self):
        super().__init__()
        sphere = softras.shapes.icosphere(2)
        self.vertices = torch.nn.Parameter(torch.tensor(sphere.positions))
        self.faces = sphere.triangles
        self.rasterizer = st.Rasterizer(softras.Settings(width=32, height=32, sigma=1e-3, outputs=("silhouette",)))

    def forward(self, cameras):
        return self.rasterizer(self.vertices, self.faces, cameras).silhouette

def curve(model, cameras, target):
    optimizer, losses = torch.optim.SGD(model.parameters(), 0.5), []
    for _ in range(5):
        loss = (model(cameras) - target).square().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.detach())
    return torch.stack(losses)

def views():
    cameras = [softras.Camera.from_angles(3.5, 20, 90.0 * i, fov_y=0.8) for i in range(4)]
    settings = softras.Settings(width=32, height=32, sigma=1e-3)
    return cameras, torch.from_numpy(softras.render(softras.shapes.cube(), cameras, settings).silhouette)

def work(rank, store):
    dist.init_process_group("gloo", init_method=f"file://{store}", rank=rank, world_size=2)
    cameras, target = views()
    part = slice(2 * rank, 2 * rank + 2)
    losses = curve(DistributedDataParallel(Shape()), cameras[part], target[part])
    dist.all_reduce(losses)
    if rank == 0:
        alone = curve(Shape(), cameras, target)
        print((losses / 2 - alone).abs().max().item() < 1e-5 * alone[0].item(), alone[-1].item() < alone[0].item())
    dist.destroy_process_group()

if __name__ == "__main__":
    mp.spawn(work, (sys.argv[1],), 2)
"""


def test_two_processes_are_one_with_twice_the_batch(tmp_path):
    (tmp_path / "parallel.py").write_text(PARALLEL)
    command = [sys.executable, str(tmp_path / "parallel.py"), str(tmp_path / "store")]
    result = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert result.stdout.split() == ["True", "True"], result.stdout + result.stderr


def test_meshes_with_one_camera_or_several_each(bumpy, cameras, settings):
    batch = torch.stack([torch.tensor(bumpy.positions), 0.9 * torch.tensor(bumpy.positions)]).requires_grad_()
    one = st.render(batch, bumpy, cameras[0], settings=settings).silhouette
    np.testing.assert_array_equal(one.detach(), st.render(batch, bumpy, [cameras[0]] * 2, settings=settings).silhouette.detach())
    four = st.render(batch, bumpy, cameras * 2, settings=settings).silhouette
    assert four.shape[0] == 4
    four.sum().backward()
    for i in range(2):
        alone = batch.detach()[i].clone().requires_grad_()
        images = [st.render(alone, bumpy, camera, settings=settings).silhouette for camera in cameras]
        np.testing.assert_array_equal(torch.cat(images).detach(), four[2 * i : 2 * i + 2].detach())
        sum(image.sum() for image in images).backward()
        assert (alone.grad - batch.grad[i]).abs().max() < 1e-5 * alone.grad.abs().max()
    meshes = [bumpy, bumpy.with_positions(batch[1].detach())]
    np.testing.assert_array_equal(softras.render(meshes, cameras * 2, settings).silhouette, four.detach())
    with pytest.raises(softras.errors.SceneError):
        softras.render(meshes, cameras + cameras[:1], settings)


def test_functional_gradients_and_bfloat16(ball, cameras, settings):
    vertices, faces = ball

    def loss(vertices):
        return st.render(vertices, faces, cameras, settings=settings).silhouette.square().sum()

    plain, half = leaf(vertices), vertices.bfloat16().requires_grad_()
    loss(plain).backward()
    np.testing.assert_array_equal(torch.func.grad(loss)(vertices), plain.grad)
    loss(half).backward()
    rounded = leaf(half.detach().float())
    loss(rounded).backward()
    assert half.grad.dtype == torch.bfloat16 and torch.equal(half.grad, rounded.grad.bfloat16())


def test_none_means_that_a_loss_does_not_use_an_input(ball, cameras, settings):
    vertices, faces = leaf(ball[0]), ball[1]
    colors = torch.rand(len(vertices), 3).requires_grad_()
    images = st.render(vertices, faces, cameras, colors=2.0 * colors, settings=settings)
    images.silhouette.sum().backward(retain_graph=True)
    assert colors.grad is None and vertices.grad.any()
    # A loss that has converged, and a mask that is empty, have gradients of 0.
    loss = (images.silhouette - images.silhouette.detach()).square().sum() + (0 * images.color).sum()
    found = torch.autograd.grad(loss, (vertices, colors))
    assert [one.shape for one in found] == [vertices.shape, colors.shape] and not any(one.any() for one in found)


def test_nothing_of_a_frame_lives_after_backward(ball, cameras):
    settings = softras.Settings(width=192, height=192, sigma=1e-3)
    vertices, faces = ball

    def loss():
        start = leaf(vertices)
        return start, st.render(start, faces, cameras, settings=settings).silhouette.mean()

    frames = lambda: sum(type(one).__name__ == "Kept" and one.frame is not None for one in gc.get_objects())
    before, losses = frames(), []
    for _ in range(3):
        losses.append(loss()[1])
    assert frames() == before + 3
    for one in losses:
        one.backward()
    assert frames() == before
    start, kept = loss()
    kept.backward(retain_graph=True)
    first = start.grad.clone()
    assert frames() == before + 1
    kept.backward()
    assert torch.equal(start.grad, 2 * first) and frames() == before
    with pytest.raises(RuntimeError, match="second time"):
        kept.backward()
    # Hooks store copies of saved tensors: the frame is rendered again.
    with torch.autograd.graph.saved_tensors_hooks(torch.clone, lambda tensor: tensor):
        start, copied = loss()
    copied.backward()
    assert torch.equal(start.grad, first) and frames() == before


@pytest.mark.parametrize("offset", [1.0, 1e3, 1e6])
def test_distances_are_exact_far_from_the_origin(offset):
    random = torch.Generator().manual_seed(3)
    # Places that single precision holds at every offset.
    a, b = (torch.randint(-64, 64, (300, 3), generator=random) / 16 for _ in range(2))
    near, far = [(a + at).requires_grad_() for at in (0, offset)]
    exact, found = st.chamfer_distance(near, b), st.chamfer_distance(far, b + offset)
    assert torch.equal(found, exact) and st.chamfer_distance(far, far[torch.randperm(300)]) == 0
    for one in (exact, found):
        one.backward()
    torch.testing.assert_close(far.grad, near.grad)
    cube = softras.shapes.cube()
    corners, faces = (torch.tensor(cube.positions) * 16).round() / 16, torch.tensor(cube.triangles.astype(np.int64))
    points = st.sample_surface(corners + offset, faces, 500, torch.Generator().manual_seed(1)) - offset
    expected = st.sample_surface(corners, faces, 500, torch.Generator().manual_seed(1))
    assert (points - expected).abs().max() <= torch.finfo(torch.float32).eps * offset
    for weights in ("uniform", "cotangent"):
        ways = [float(st.laplacian_loss(corners + at, faces, weights)) for at in (0, offset)]
        assert ways[0] == pytest.approx(ways[1], rel=1e-5)
    solids = [softras.Mesh(corners + at, faces) for at in (offset, offset + 0.25)]
    alone = [softras.Mesh(corners + at, faces) for at in (0.0, 0.25)]
    assert softras.iou(*solids, 32) == softras.iou(*alone, 32)


def test_views_are_rotations(ball, cameras, settings):
    vertices, faces = ball
    zero, y, z = torch.zeros(3), torch.tensor([0.0, 1.0, 0.0]), torch.tensor([0.0, 0.0, 1.0])

    def area(view):
        return st.render(vertices, faces, cameras[0], views=view[None], settings=settings).silhouette.sum()

    for up in (y, torch.tensor([1e-9, 2.0, 0.0])):
        with pytest.raises(softras.errors.CameraError, match="give another up"):
            st.look_at(3.5 * y, zero, up)
    for bad in (torch.zeros(4, 4), torch.diag(torch.tensor([1.0, 1.0, 0.0, 1.0])), torch.diag(torch.tensor([2.0, 2.0, -2.0, 1.0]))):
        with pytest.raises(softras.errors.CameraError):
            area(bad)
    for eye in ([0.0, 3.5, 0.0], [0.0, -3.5, 0.0], [1e-4, 3.5, 0.0]):
        eye = torch.tensor(eye).requires_grad_()
        for up in (z, y) if eye[0] else (z,):
            view = st.look_at(eye, zero, up)
            assert (view[:3, :3] @ view[:3, :3].T - torch.eye(3)).abs().max() < 1e-6
            (slope,) = torch.autograd.grad(area(view), eye)
            # Nearer is larger.
            assert slope.isfinite().all() and slope[1] * eye[1] < 0
    over = softras.Camera.look_at((0, 3.5, 0), (0, 0, 0), (0, 0, 1), fov_y=0.8)
    assert (torch.tensor(over.view)[:, :3] - st.look_at(3.5 * y, zero, z)[:3, :3]).abs().max() < 1e-6
    screen = softras.Camera.screen()
    with pytest.raises(softras.errors.InputError, match="without parameters"):
        st.render(vertices, faces, screen, views=torch.eye(4)[None])
    mirrored = softras.Camera.from_matrix(np.eye(4), fov_y=0.8, mirrored=True)
    assert st.render(vertices + 3 * z, faces, mirrored, projections=torch.tensor([0.8]), settings=settings).silhouette.any()


def test_masks_and_indices_have_their_types(ball):
    vertices, faces = ball
    prediction = torch.rand(2, 8, 8)
    mask = prediction > 0.4
    expected = st.iou_loss(prediction, mask.float())
    for same in (mask, mask.long(), mask.byte(), 255 * mask.byte()):
        assert torch.equal(st.iou_loss(prediction, same), expected)
    for bad in (255 * mask.long(), 255 * mask.float(), -mask.float()):
        with pytest.raises(softras.errors.InputError, match="give bools"):
            st.iou_loss(prediction, bad)
    losses = [
        st.edge_length_loss,
        st.normal_consistency_loss,
        st.laplacian_loss,
        lambda v, f: st.laplacian_loss(v, f, "cotangent"),
        lambda v, f: st.sample_surface(v, f, 3),
    ]
    for loss in losses:
        with pytest.raises(softras.errors.InputError, match="faces.*give indices"):
            loss(vertices, faces.float())
        loss(vertices, faces.numpy().astype(np.uint32))
    for call in (st.normal_consistency_loss, lambda v, f: st.render(v, f, softras.Camera.screen())):
        with pytest.raises(softras.errors.InputError, match="give floats"):
            call(vertices.long(), faces)
    with pytest.raises(softras.errors.InputError, match="meta"):
        st.render(vertices.to("meta"), faces, softras.Camera.screen())


def test_losses_refuse_what_they_would_take_for_something_else(ball):
    vertices, faces = ball
    batch = torch.stack([vertices, 2 * vertices])
    for loss in (st.edge_length_loss, st.normal_consistency_loss, st.flatten_loss, st.laplacian_loss):
        for wrong in ((batch, faces), (vertices, faces[None]), (vertices, faces - 1), (vertices, faces + 1)):
            with pytest.raises(softras.errors.InputError, match="vertices|faces"):
                loss(*wrong)
    assert st.edge_length_loss(vertices, faces[:0]) == 0
    square = torch.zeros(2, 8, 8)
    for other in (square[:, None], square[..., None], square[:1], square[0]):
        with pytest.raises(softras.errors.InputError, match="shapes"):
            st.iou_loss(square, other)
    with pytest.raises(softras.errors.InputError, match="shapes"):
        st.iou_loss(square[0], square[0])
    found = st.fragments(vertices, faces, softras.Camera.from_angles(3.0, 20.0, 0.0, fov_y=0.8))
    with pytest.raises(softras.errors.InputError, match="values.*give floats"):
        st.interpolate(found, (255 * vertices.abs()).byte(), faces)
    for a, b in ((vertices, batch), (batch, batch[:1]), (vertices[:0], vertices), (vertices, vertices[:, :2])):
        with pytest.raises(softras.errors.InputError, match="points of shapes"):
            st.chamfer_distance(a, b)
    with pytest.raises(softras.errors.InputError, match="not finite"):
        st.normal_consistency_loss(vertices / 0, faces)


def test_inputs_of_another_kind_are_refused(ball):
    vertices, faces = ball
    camera = softras.Camera.from_angles(3.0, 20.0, 0.0, fov_y=0.8)
    with pytest.raises(softras.errors.InputError, match="fov_y has 1"):
        st.render(vertices, faces, camera, projections=torch.tensor([[0.8, 0.9]]))
    masked = np.ma.masked_greater(vertices.numpy(), 0.5)
    with pytest.raises(softras.errors.InputError, match="masked values"):
        softras.Mesh(masked, faces.numpy())


def test_a_copy_of_a_module_shares_its_renderer(ball):
    renderer = softras.Renderer()
    module = st.Rasterizer(softras.Settings(width=16, height=16), renderer=renderer)
    assert copy.deepcopy(module).renderer is renderer


@pytest.mark.parametrize("loss", ["edges", "normals", "flat", "uniform", "cotangent", "chamfer"])
def test_losses_have_their_gradients(loss):
    ball = softras.shapes.icosphere(0)
    generator = torch.Generator().manual_seed(5)
    noise, target = (torch.rand(12, 3, dtype=torch.float64, generator=generator) for _ in range(2))
    vertices = (torch.tensor(ball.positions, dtype=torch.float64) + 0.3 * noise).requires_grad_()
    faces = torch.tensor(ball.triangles.astype(np.int64))

    def chamfer(vertices):
        return st.chamfer_distance(st.sample_surface(vertices, faces, 40, torch.Generator().manual_seed(1)), target)

    losses = {
        "edges": lambda x: st.edge_length_loss(x, faces, 0.7),
        "normals": lambda x: st.normal_consistency_loss(x, faces),
        "flat": lambda x: st.flatten_loss(x, faces),
        "uniform": lambda x: st.laplacian_loss(x, faces),
        "cotangent": lambda x: st.laplacian_loss(x, faces, "cotangent"),
        "chamfer": chamfer,
    }
    assert losses[loss](vertices) > 0.0 and torch.autograd.gradcheck(losses[loss], (vertices,))


def test_losses_by_hand():
    # A square of two triangles, and what a flat grid has: cotangents make a mean of neighbours that is the vertex itself.
    square = torch.tensor([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    faces = torch.tensor([[0, 1, 2], [0, 2, 3]])
    assert abs(st.edge_length_loss(square, faces) - 6 / 5) < 1e-6 and st.normal_consistency_loss(square, faces) < 1e-6
    fan = torch.cat([square, torch.tensor([[0.7, 0.4, 0.0]])])
    around = torch.tensor([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    moved = fan.clone().requires_grad_()
    still = torch.autograd.grad(st.laplacian_loss(moved, around, "cotangent"), moved)[0]
    assert still.isfinite().all() and st.laplacian_loss(fan, around) > st.laplacian_loss(square, faces) * 0
    points = st.sample_surface(fan, around, 4000, torch.Generator().manual_seed(1))
    assert (points.mean(0) - torch.tensor([0.5, 0.5, 0.0])).abs().max() < 0.02 and points[:, 2].abs().max() == 0.0
    # PyTorch3D, too, counts every pair of three faces at an edge.
    book = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0.5, 0, 1]])
    pages = torch.tensor([[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    assert abs(st.normal_consistency_loss(book, pages) - 2) < 1e-6
    ball = softras.shapes.icosphere(1)
    vertices, triangles = torch.tensor(ball.positions), torch.tensor(ball.triangles.astype(np.int64))
    sizes = [float(st.laplacian_loss(vertices * at, triangles, "cotangent")) / at**2 for at in (1.0, 1e-6)]
    assert sizes[0] == pytest.approx(sizes[1], rel=1e-4)
    assert abs(st.chamfer_distance(square, square + torch.tensor([0.0, 0, 0.1])) - 0.02) < 1e-6
    with pytest.raises(softras.errors.InputError, match="area"):
        st.sample_surface(torch.zeros(3, 3), faces[:1], 10)
    with pytest.raises(softras.errors.InputError, match="uniform"):
        st.laplacian_loss(square, faces, "cot")


def test_losses_of_batches_and_means(ball):
    """The numbers of PyTorch3D, whose definitions these are: a mean over pairs of faces, and one of lengths."""
    vertices, faces = ball
    pairs = 3 * len(faces) // 2
    total = st.normal_consistency_loss(vertices, faces)
    torch.testing.assert_close(st.normal_consistency_loss(vertices, faces, reduction="mean"), total / pairs)
    edges = torch.cat([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    means = torch.zeros_like(vertices).index_add(0, edges[:, 0], vertices[edges[:, 1]])
    counts = torch.zeros(len(vertices)).index_add(0, edges[:, 0], torch.ones(len(edges)))
    lengths = (means / counts[:, None] - vertices).norm(dim=1)
    torch.testing.assert_close(st.laplacian_loss(vertices, faces, reduction="mean"), lengths.mean())
    with pytest.raises(softras.errors.InputError, match="use sum or mean"):
        st.laplacian_loss(vertices, faces, reduction="max")

    both = torch.stack([vertices, 2 * vertices])
    points = st.sample_surface(both, faces, 500, torch.Generator().manual_seed(3))
    assert points.shape == (2, 500, 3) and (points[1].norm(dim=1) > points[0].norm(dim=1).max()).all()
    each = torch.stack([faces, faces.flip(0)])
    assert st.sample_surface(both, each, 7).shape == (2, 7, 3)
    target = torch.rand(2, 40, 3)
    alone = [st.chamfer_distance(a, b) for a, b in zip(points, target)]
    torch.testing.assert_close(st.chamfer_distance(points, target), (alone[0] + alone[1]) / 2)
    with pytest.raises(softras.errors.InputError, match="points of shapes"):
        st.chamfer_distance(points, target[0])
    with pytest.raises(softras.errors.InputError, match="faces of 1 meshes"):
        st.sample_surface(both, each[:1], 7)
