"""The calls that the official demos and the official reconstruction make, run as scripts by `python -m softras.soft_renderer`.

The scripts are written anew with the names and arguments of the official ones: `demo_render`, `demo_deform`, and the
reconstruction's `train` and `test`, each with fewer steps; and of the rendering code of LASR, VISER, BANMO and UMR.
"""

import os
import subprocess
import sys

import numpy as np
import pytest

import softras

torch = pytest.importorskip("torch", reason="torch is not installed: test.sh --with torch adds it")

RENDER = """
import sys, numpy as np, soft_renderer as sr
mesh = sr.Mesh.from_obj("fish.obj", load_texture=True, texture_res=5, texture_type="surface")
renderer = sr.SoftRenderer(camera_mode="look_at")
pictures = []
for azimuth in (0, 120, 240):
    mesh.reset_()
    renderer.transform.set_eyes_from_angles(2.732, 30, azimuth)
    pictures.append(renderer.render_mesh(mesh).detach().cpu().numpy()[0].transpose((1, 2, 0)))
for power in (-4, -1.5):
    mesh.reset_()
    renderer.set_gamma(10 ** power)
    renderer.set_sigma(10 ** (power - 1))
    renderer.transform.set_eyes_from_angles(2.732, 30, 45)
    pictures.append(renderer.render_mesh(mesh).detach().cpu().numpy()[0].transpose((1, 2, 0)))
mesh.reset_()
mesh.save_obj("saved.obj", save_texture=True)
np.save("pictures.npy", pictures)
"""

MODEL = """
import numpy as np, torch, torch.nn as nn, torch.nn.functional as F
import soft_renderer as sr, soft_renderer.functional as srf
from soft_renderer.losses import FlattenLoss

def iou_loss(predict, target):
    dims = tuple(range(predict.ndimension())[1:])
    intersect = (predict * target).sum(dims)
    union = (predict + target - predict * target).sum(dims) + 1e-6
    return 1.0 - (intersect / union).mean()

assert FlattenLoss is sr.FlattenLoss
"""

DEFORM = MODEL + """
class Model(nn.Module):
    def __init__(self, path):
        super().__init__()
        self.template_mesh = sr.Mesh.from_obj(path)
        self.register_buffer("vertices", self.template_mesh.vertices * 0.5)
        self.register_buffer("faces", self.template_mesh.faces)
        self.register_buffer("textures", self.template_mesh.textures)
        self.register_parameter("displace", nn.Parameter(torch.zeros_like(self.template_mesh.vertices)))
        self.register_parameter("center", nn.Parameter(torch.zeros(1, 1, 3)))
        self.laplacian_loss = sr.LaplacianLoss(self.vertices[0].cpu(), self.faces[0].cpu())
        self.flatten_loss = sr.FlattenLoss(self.faces[0].cpu())

    def forward(self, batch_size):
        base = torch.log(self.vertices.abs() / (1 - self.vertices.abs()))
        centroid = torch.tanh(self.center)
        vertices = torch.sigmoid(base + self.displace) * torch.sign(self.vertices)
        vertices = F.relu(vertices) * (1 - centroid) - F.relu(-vertices) * (centroid + 1) + centroid
        meshes = sr.Mesh(vertices.repeat(batch_size, 1, 1), self.faces.repeat(batch_size, 1, 1))
        return meshes, self.laplacian_loss(vertices).mean(), self.flatten_loss(vertices).mean()

images, cameras = torch.from_numpy(np.load("views.npy")).cuda(), torch.from_numpy(np.load("cameras.npy"))
whole = sr.SoftRenderer(image_size=64, sigma_val=1e-4, aggr_func_rgb="hard", camera_mode="look_at", viewing_angle=15)
whole.transform.set_eyes_from_angles(*cameras.unbind(1))
# In parts.
lighting, transform = sr.Lighting(), sr.LookAt(viewing_angle=15)
rasterizer = sr.SoftRasterizer(image_size=64, sigma_val=1e-4, aggr_func_rgb="hard", fill_back=True)
transform.set_eyes_from_angles(*cameras.unbind(1))
curves = []
for render in (whole.render_mesh, lambda mesh: rasterizer(transform(lighting(mesh)))):
    model = Model("sphere.obj").cuda()
    optimizer = torch.optim.Adam(model.parameters(), 0.01, betas=(0.5, 0.99))
    curves.append([])
    for _ in range(6):
        mesh, laplacian, flatten = model(len(images))
        loss = iou_loss(render(mesh)[:, 3], images) + 0.03 * laplacian + 0.0003 * flatten
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        curves[-1].append(loss.item())
model(1)[0].save_obj("deformed.obj", save_texture=False)
np.save("curves.npy", curves)
"""

RECONSTRUCT = MODEL + """
class Model(nn.Module):
    def __init__(self, path):
        super().__init__()
        template = sr.Mesh.from_obj(path)
        self.register_buffer("vertices_base", template.vertices[0].cpu() * 0.4)
        self.register_buffer("faces", template.faces[0].cpu())
        layers = nn.Linear(4 * 32 * 32, 16), nn.ReLU(), nn.Linear(16, 3 * template.num_vertices)
        self.network = nn.Sequential(nn.Flatten(), *layers)
        self.renderer = sr.SoftRenderer(
            image_size=32, sigma_val=1e-4, aggr_func_rgb="hard", camera_mode="look_at", viewing_angle=15, dist_eps=1e-10
        )
        self.laplacian_loss = sr.LaplacianLoss(self.vertices_base, self.faces)
        self.flatten_loss = sr.FlattenLoss(self.faces)

    def reconstruct(self, images):
        offsets = self.network(images).reshape(len(images), -1, 3)
        return self.vertices_base + 0.05 * torch.tanh(offsets), self.faces[None].repeat(len(images), 1, 1)

    def predict_multiview(self, image_a, image_b, viewpoint_a, viewpoint_b):
        viewpoints = torch.cat((viewpoint_a, viewpoint_a, viewpoint_b, viewpoint_b), dim=0)
        self.renderer.transform.set_eyes(viewpoints)
        vertices, faces = self.reconstruct(torch.cat((image_a, image_b), dim=0))
        silhouettes = self.renderer(torch.cat((vertices, vertices), dim=0), torch.cat((faces, faces), dim=0))
        return silhouettes.chunk(4, dim=0), self.laplacian_loss(vertices), self.flatten_loss(vertices)

    def evaluate_iou(self, images, voxels):
        vertices, faces = self.reconstruct(images)
        corners = srf.face_vertices(vertices, faces).data * 1.0 * (32.0 - 1) / 32.0 + 0.5
        predicted = srf.voxelization(corners, 32, False).cpu().numpy().transpose(0, 2, 1, 3)[:, :, :, ::-1]
        return (voxels * predicted).sum((1, 2, 3)) / (0 < (voxels + predicted)).sum((1, 2, 3)), vertices, faces

torch.manual_seed(1)
torch.cuda.manual_seed_all(1)
images = torch.from_numpy(np.load("objects.npy")).cuda()
ones = torch.ones(len(images))
viewpoints = [srf.get_points_from_angles(2.732 * ones, 30.0 * ones, -15.0 * i * ones) for i in (0, 4)]
model = Model("sphere.obj").cuda()
optimizer = torch.optim.Adam(model.parameters(), 1e-3)
losses = []
for step in range(8):
    model.renderer.set_sigma(1e-4)
    silhouettes, laplacian, flatten = model.predict_multiview(images[:, 0], images[:, 1], *viewpoints)
    raa, rba, rab, rbb = (silhouette[:, 3] for silhouette in silhouettes)
    a, b = images[:, 0, 3], images[:, 1, 3]
    loss = (iou_loss(raa, a) + iou_loss(rba, a) + iou_loss(rab, b) + iou_loss(rbb, b)) / 4
    loss = loss + 5e-3 * laplacian.mean() + 5e-4 * flatten.mean()
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()
    losses.append(loss.item())
# A checkpoint whose tensors say that they come from a GPU.
torch.serialization.location_tag = lambda storage: "cuda:0"
torch.save({"model": model.state_dict()}, "checkpoint.pth")
model.load_state_dict(torch.load("checkpoint.pth")["model"], strict=False)
model.eval()
iou, vertices, faces = model.evaluate_iou(images[:, 0], np.load("voxels.npy"))
srf.save_obj("predicted.obj", vertices[0], faces[0])
np.savez("result.npz", losses=losses, iou=iou)
"""

OTHERS = """
import torch, numpy as np, soft_renderer as sr, soft_renderer.functional as srf
mesh = sr.Mesh.from_obj("fish.obj", load_texture=True, texture_res=5, texture_type="surface")
start, faces = (0.4 * mesh.vertices[0]).cuda(), mesh.faces[0].cuda()
light = {"light_mode": "vertex", "light_intensity_ambient": 1.0, "light_intensity_directionals": 0.0}

# LASR, VISER: vertices on the screen already, planes from the graph, masks and flows as vertex colours.
soft = sr.SoftRenderer(
    image_size=32, sigma_val=1e-12, camera_mode="look_at", perspective=False, aggr_func_rgb="hard", **light
)
flow = sr.SoftRenderer(image_size=32, gamma_val=1e-4, camera_mode="look_at", perspective=False, aggr_func_rgb="softmax", **light)
pose = torch.nn.Parameter(torch.tensor([0.1, 0.0, 0.0]))
vertices = torch.cat([start[None] + pose, start[None] - pose]) + torch.tensor([0.0, 0, 5])
depths = vertices[..., -1] + 1 / np.tan(np.radians(30.0)) + 1
nearest, farthest = depths.min(), depths.max()
for renderer in (soft, flow):
    renderer.rasterizer.near = nearest - (farthest - nearest) / 2
    renderer.rasterizer.far = farthest + (farthest - nearest) / 2
    renderer.rasterizer.background_color = [1, 1, 1]
faces2 = faces[None].repeat(2, 1, 1)
colors = torch.rand(2, len(start), 3, requires_grad=True)
seen = soft.render_mesh(sr.Mesh(vertices, faces2, textures=colors, texture_type="vertex"))
moved = flow.render_mesh(sr.Mesh(vertices, faces2, textures=vertices - pose, texture_type="vertex"))
mask, texture = seen[:, -1], seen[:, :3]
assert mask.view(2, -1).shape == (2, 1024) and moved[:, :2].permute(0, 2, 3, 1).isfinite().all()
loss = (mask - 1).pow(2).mean(1).mean() + (texture * mask.detach()[:, None]).mean() + moved[:, -1].mean()
loss.backward()
assert pose.grad.any() and colors.grad.any()

# BANMO: colours of a mesh file by vertices, planes behind the eye.
soft.rasterizer.near, soft.rasterizer.far = float(vertices[..., 2].min()) - 10, 100.0
with torch.no_grad():
    picture = soft.render_mesh(sr.Mesh(vertices[:1], faces[None], textures=colors[:1], texture_type="vertex"))[:, :3]
assert picture.cpu().numpy().transpose(0, 2, 3, 1).min() < 0.9

# UMR: the fork's third images.
sr.SoftRasterizer.returns_info = True
renderer = sr.SoftRenderer(image_size=32, camera_mode="look_at", aggr_func_rgb="softmax", dist_eps=1e-10)
renderer.transform.set_eyes([0, 0, -2.732])
texels = torch.rand(1, faces.shape[0], 36, 3, requires_grad=True)
images, places, info = renderer.render_mesh(sr.Mesh(start[None], faces[None], texels))
images[:, :3].mean().backward()
visible = info[:, 1].long().unique()
assert texels.grad.any() and places.shape == (1, len(faces), 2) and -1 in visible and len(visible) > 20
"""


def run(folder, script):
    (folder / "script.py").write_text(script)
    command = [sys.executable, "-m", "softras.soft_renderer", "script.py"]
    # Sums of torch's own on a GPU would differ in their last places.
    hidden = {**os.environ, "CUDA_VISIBLE_DEVICES": ""}
    result = subprocess.run(command, cwd=folder, env=hidden, capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, result.stderr


def eyes(count, distance, elevation):
    """The official eyes d (cos e sin a, sin e, -cos e cos a), as rows (d, e, a) and as cameras of half an angle of 15°."""
    angles = np.array([[distance, elevation, 360.0 * i / count] for i in range(count)], np.float32)
    e, a = np.radians(angles[:, 1]), np.radians(angles[:, 2])
    rows = distance * np.stack([np.cos(e) * np.sin(a), np.sin(e), -np.cos(e) * np.cos(a)], 1)
    return angles, [softras.Camera.look_at(eye, (0, 0, 0), fov_y=np.radians(30.0)) for eye in rows]


def test_the_render_demo(tmp_path):
    softras.shapes.fish().save(tmp_path / "fish.obj")
    run(tmp_path, RENDER)
    pictures = np.load(tmp_path / "pictures.npy")
    assert pictures.shape == (5, 256, 256, 4) and (pictures[:, :, :, 3].max((1, 2)) > 0.9).all()
    saved = softras.load(tmp_path / "saved.obj")
    assert len(saved.triangles) == len(softras.shapes.fish().triangles) and saved.textures is not None


def test_the_rendering_of_other_projects(tmp_path):
    softras.shapes.fish().save(tmp_path / "fish.obj")
    run(tmp_path, OTHERS)


def test_the_deform_demo(tmp_path):
    angles, cameras = eyes(6, 2.732, 20.0)
    settings = softras.Settings(width=64, height=64, outputs=("silhouette",))
    cube = softras.shapes.cube()
    views = softras.render(cube.with_positions(0.4 * cube.positions), cameras, settings).silhouette
    np.save(tmp_path / "views.npy", views)
    np.save(tmp_path / "cameras.npy", angles)
    softras.shapes.icosphere(2).save(tmp_path / "sphere.obj")
    run(tmp_path, DEFORM)
    whole, parts = np.load(tmp_path / "curves.npy")
    assert whole[-1] < whole[0] - 0.01
    np.testing.assert_array_equal(whole, parts)
    assert len(softras.load(tmp_path / "deformed.obj").triangles) == 320


def test_the_reconstruction(tmp_path):
    solids = [softras.shapes.cube(), softras.shapes.torus()]
    solids = [solid.with_positions(0.4 / np.abs(solid.positions).max() * solid.positions) for solid in solids]
    _, cameras = eyes(24, 2.732, 30.0)
    settings = softras.Settings(width=32, height=32)
    # Pictures of ids 0 and 4, whose azimuth the official data count downwards.
    frames = [softras.render(solid, [cameras[0], cameras[-4]], settings) for solid in solids]
    rgba = [np.concatenate([f.color, f.silhouette[..., None]], -1).transpose(0, 3, 1, 2) for f in frames]
    np.save(tmp_path / "objects.npy", np.stack(rgba))
    voxels = [softras.voxelize(solid, 32, (-0.5, -0.5, -0.5), 1.0) for solid in solids]
    np.save(tmp_path / "voxels.npy", np.stack(voxels).transpose(0, 2, 1, 3)[:, :, :, ::-1].astype(np.int32))
    softras.shapes.icosphere(2).save(tmp_path / "sphere.obj")
    run(tmp_path, RECONSTRUCT)
    result = np.load(tmp_path / "result.npz")
    assert result["losses"][-1] < result["losses"][0] - 0.002
    assert result["iou"][0] > 0.4 and len(softras.load(tmp_path / "predicted.obj").triangles) == 320
