"""Fragments and antialiasing for shaders of one's own: the renderer's images, and gradients as exact."""

import dataclasses

import numpy as np
import pytest

import softras

torch = pytest.importorskip("torch", reason="torch is not installed: test.sh --with torch adds it")
import softras.torch as st  # noqa: E402

PROJECTIONS = [{"fov_y": 0.8}, {"half_height": 1.2}, {"pinhole": (50.0, 40.0, 19.0, 17.5)}]


def faces_of(mesh):
    return torch.tensor(mesh.triangles.astype(np.int64))


@pytest.fixture(scope="module")
def soft(settings):
    return dataclasses.replace(settings, sigma=3e-3, gamma=3e-2, background_color=(0.0, 0.0, 0.0), outputs=("color",))


@pytest.mark.parametrize("projection", PROJECTIONS, ids=str)
@pytest.mark.parametrize("background", ["weighted", "composite"])
@pytest.mark.parametrize("interpolation", ["affine", "perspective"])
def test_weights_of_all_fragments_give_the_image(bumpy, soft, projection, background, interpolation):
    settings = dataclasses.replace(soft, background=background, interpolation=interpolation)
    cameras = [softras.Camera.from_angles(3.5, 20.0, azimuth, **projection) for azimuth in (10.0, 130.0)]
    faces, colors = faces_of(bumpy), torch.tensor(bumpy.colors)
    gradients = []
    weights = torch.rand(2, 32, 40, 3, generator=torch.Generator().manual_seed(1))

    def by_render(vertices):
        images = st.render(vertices, faces, cameras, colors=colors, settings=dataclasses.replace(settings, outputs=("color", "silhouette")))
        # The shares of the triangles alone.
        return images.color / images.silhouette[..., None].clamp(min=1e-9) if background == "composite" else images.color

    def by_fragments(vertices):
        found = st.fragments(vertices, faces, cameras, k=60, settings=settings)
        assert (found.triangle[..., -1] < 0).all() and (found.weight[..., 0] > found.weight[..., 1] - 1e-4).all()
        return (found.weight[..., None] * st.interpolate(found, colors, faces)).sum(-2)

    for draw in (by_render, by_fragments):
        vertices = torch.tensor(bumpy.positions, requires_grad=True)
        picture = draw(vertices)
        # Where a pixel sees almost nothing its quotient has no digits.
        (picture * weights * (picture.detach() > 1e-3)).sum().backward()
        gradients.append((picture.detach(), vertices.grad))
    (image, expected), (ours, found) = gradients
    shown = image.sum(-1) > (0.2 if background == "composite" else -1)
    torch.testing.assert_close(ours[shown], image[shown], rtol=2e-4, atol=2e-5)
    if background == "weighted":
        assert (found - expected).norm() < 2e-3 * expected.norm()


@pytest.mark.parametrize("projection", PROJECTIONS, ids=str)
@pytest.mark.parametrize("fields", [{}, {"surface_point": "clip"}, {"interpolation": "perspective"}], ids=str)
def test_gradcheck(projection, fields):
    random = np.random.default_rng(9)
    vertices = torch.tensor(random.uniform(-0.7, 0.7, (6, 3)).astype(np.float32).astype(np.float64), requires_grad=True)
    values = torch.tensor(random.random((6, 2)), requires_grad=True)
    faces = torch.tensor([[0, 1, 2], [3, 4, 5]])
    if "pinhole" in projection:
        projection = {"pinhole": (9.0, 8.0, 3.5, 2.5)}
    camera = softras.Camera.look_at((0, 0, 3), (0, 0, 0), **projection)
    settings = softras.Settings(width=6, height=6, sigma=1e-2, gamma=0.05, near=1.0, far=5.0, tau=1e-12, **fields)

    def near(vertices, values):
        found = st.fragments(vertices, faces, camera, k=2, settings=settings)
        return (*found[1:], st.interpolate(found, values, faces))

    def at_centres(vertices, values):
        found = st.fragments(vertices, faces, camera, settings=settings)
        assert found.barycentrics.shape == (1, 6, 6, 3) and found.distance is None
        return (*found[1:3], st.interpolate(found, values, faces))

    for function in (near, at_centres):
        assert torch.autograd.gradcheck(function, (vertices, values), eps=1e-7, atol=1e-5, rtol=1e-4)


@pytest.mark.parametrize("projection", [*PROJECTIONS, {}], ids=str)
def test_points_are_those_of_the_renderer(bumpy, soft, projection):
    camera = softras.Camera.from_angles(3.5, 20.0, 10.0, **projection) if projection else softras.Camera.screen()
    places = np.float32([0, 0, 0] if projection else [0, 0, 2.5])
    mesh = softras.Mesh(0.8 * bumpy.positions + places, bumpy.triangles)
    ours = st.fragments(torch.tensor(mesh.positions, dtype=torch.float64), faces_of(mesh), camera, settings=soft)
    found = softras.fragments(mesh, camera, soft)
    assert (found.triangle >= 0).sum() > 50
    torch.testing.assert_close(ours.barycentrics, torch.tensor(found.barycentrics).double(), rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(ours.depth, torch.tensor(found.depth).double(), rtol=1e-5, atol=1e-5)


def test_a_shader_of_pytorch3d_runs(bumpy, cameras, soft):
    """Their softmax blending, by the names of their fragments, gives the image of the same sigma and gamma."""
    settings = dataclasses.replace(soft, epsilon=1e-10)
    vertices, faces, colors = torch.tensor(bumpy.positions), faces_of(bumpy), torch.tensor(bumpy.colors)
    found = st.fragments(vertices, faces, cameras, k=60, settings=settings)
    mask = found.pix_to_face >= 0
    texels = (found.bary_coords[..., None] * colors[faces[found.pix_to_face.clamp(min=0)]]).sum(-2)
    probability = torch.sigmoid(-found.dists / settings.sigma) * mask
    inverse = (settings.far - found.zbuf) / (settings.far - settings.near) * mask
    most = inverse.max(-1, keepdim=True).values.clamp(min=1e-10)
    share = probability * torch.exp((inverse - most) / settings.gamma)
    rest = torch.exp((1e-10 - most) / settings.gamma)
    picture = (share[..., None] * texels).sum(-2) / (share.sum(-1, keepdim=True) + rest)
    image = st.render(vertices, faces, cameras, colors=colors, settings=settings).color
    torch.testing.assert_close(picture, image, rtol=1e-3, atol=1e-4)
    one = st.fragments(vertices, faces, cameras, settings=settings)
    assert one.pix_to_face.shape == (2, 32, 40, 1) and (one.zbuf[one.pix_to_face < 0] == -1).all()


def test_batches_and_mistakes(bumpy, cameras, soft):
    vertices, faces = torch.tensor(bumpy.positions), faces_of(bumpy)
    both = torch.stack([vertices, 0.7 * vertices])
    found = st.fragments(both, faces, cameras, k=3, settings=soft)
    for i in range(2):
        alone = st.fragments(both[i], faces, cameras[i], k=3, settings=soft)
        for whole, part in zip(found, alone):
            assert torch.equal(whole[i], part[0])
    for wrong in (0, 10**9):
        with pytest.raises(softras.errors.InputError, match="ask for 1 to 1024"):
            st.fragments(vertices, faces, cameras, k=wrong)
    with pytest.raises(softras.errors.InputError, match="euclidean"):
        st.fragments(vertices, faces, cameras, k=2, settings=dataclasses.replace(soft, distance="hard"))
    with pytest.raises(softras.errors.InputError, match="ask for k"):
        st.fragments(vertices, faces, cameras, settings=soft).dists
    official = softras.Camera.official(np.eye(3, 4))
    with pytest.raises(softras.errors.InputError, match="official camera"):
        st.fragments(vertices, faces, official, k=2, settings=soft)
    nothing = st.fragments(vertices + 100, faces, cameras, k=2, settings=soft)
    assert (nothing.triangle == -1).all() and (nothing.weight == 0).all()
    # A first triangle without area, and no triangle at all.
    for broken in (torch.cat([torch.zeros(1, 3, dtype=torch.int64), faces]), faces[:0]):
        for k in (None, 2):
            moved = vertices.clone().requires_grad_()
            found = st.fragments(moved, broken, cameras, k=k, settings=soft)
            drawn = st.interpolate(found, vertices, broken)
            if k is None:
                drawn = st.antialias(drawn, found, moved, broken, cameras, soft)
            (drawn.sum() + found.depth.sum()).backward()
            assert drawn.isfinite().all() and moved.grad.isfinite().all()
    with pytest.raises(softras.errors.InputError, match="antialias: give one mesh"):
        st.antialias(drawn[..., 0], found, moved, faces, cameras, soft)


def test_an_outline_is_blended_and_has_the_gradient_of_its_place():
    """A square's sum of coverage grows with its sides, though every pixel's centre stays in or out."""
    faces = torch.tensor([[0, 1, 2], [0, 2, 3]])
    settings = softras.Settings(width=16, height=16, near=0.5, far=10.0)
    corners = torch.tensor([[-0.51, -0.33, 2], [0.41, -0.33, 2], [0.41, 0.57, 2], [-0.51, 0.57, 2]], dtype=torch.float64)

    def picture(vertices):
        found = st.fragments(vertices, faces, softras.Camera.screen(), settings=settings)
        hard = st.interpolate(found, torch.ones(4, 2, dtype=torch.float64), faces)
        return st.antialias(hard, found, vertices, faces, softras.Camera.screen(), settings)

    vertices = corners.clone().requires_grad_()
    drawn = picture(vertices)
    # The inner edge of the two triangles is no outline; pixels are a sixty-fourth of a screen unit squared.
    area = drawn[..., 0].sum() / 64
    assert abs(area.item() - 0.92 * 0.90) < 4e-3 and drawn.min() >= 0 and drawn.max() < 1 + 1e-9
    assert 0 < ((drawn[..., 0] > 0) & (drawn[..., 0] < 1)).sum() < 60
    area.backward()
    by_right = vertices.grad[[1, 2], 0].sum().item()
    by_top = vertices.grad[[2, 3], 1].sum().item()
    assert abs(by_right - 0.90) < 0.07 and abs(by_top - 0.92) < 0.07
    assert torch.autograd.gradcheck(picture, (corners.clone().requires_grad_(),), eps=1e-7, atol=1e-5)


def test_antialiasing_fits_a_silhouette():
    ball = softras.shapes.icosphere(2)
    vertices, faces = torch.tensor(ball.positions), faces_of(ball)
    cameras = [softras.Camera.from_angles(3.5, 15.0, azimuth, fov_y=0.8) for azimuth in (0.0, 70.0, 150.0)]
    settings = softras.Settings(width=48, height=48, near=1.0, far=6.0)

    def masks(moved):
        found = st.fragments(moved, faces, cameras, settings=settings)
        ones = (found.triangle >= 0)[..., None].to(moved)
        return st.antialias(ones, found, moved, faces, cameras, settings)

    target = masks(vertices * torch.tensor([1.2, 0.9, 1.0]) + torch.tensor([0.1, 0.0, 0.05]))
    scale, shift = torch.ones(3, requires_grad=True), torch.zeros(3, requires_grad=True)
    optimizer = torch.optim.Adam([scale, shift], lr=0.01)
    for _ in range(80):
        loss = (masks(vertices * scale + shift) - target).square().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    np.testing.assert_allclose(scale.detach(), [1.2, 0.9, 1.0], atol=0.02)
    np.testing.assert_allclose(shift.detach(), [0.1, 0.0, 0.05], atol=0.02)
