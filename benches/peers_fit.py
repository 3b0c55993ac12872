"""Time to a result: softras, deodr and Mitsuba 3 fit the same pictures from the same start, with the same optimizer. `peers.py --fit` runs it.

Shape: a sphere becomes a mesh, by 12 pictures of 128² of it, in STEPS steps of Adam with smoothed gradients (Nicolet et al., "Large Steps in
Inverse Rendering of Geometry", 2021). Judged outside the clock by 6 other views. A peer's renderer is called as its documents say; what is not rendering is one
code for both. The command `softras fit` takes the same pictures as files and begins with a hull; its time is that of the whole program.

Mitsuba runs in one round alone, and only where LLVM 16 or newer is found (DRJIT_LIBLLVM_PATH, or Debian's libllvm19): each of its steps takes as long
as many of the others.

Pose: 40 rotations of a mesh that is known, from one picture of it, in 150 steps of Adam; beside it `softras.pose`, which chooses its own starts.
"""

import json
import os
import pathlib
import statistics
import subprocess
import tempfile
import time

import numpy as np
import scipy.sparse
import scipy.sparse.linalg
import softras
from deodr.differentiable_renderer import Camera, Scene3D
from deodr.triangulated_mesh import ColoredTriMesh
from PIL import Image

try:
    newest = sorted(pathlib.Path("/usr/lib").glob("*/libLLVM.so.[12]*"))
    if newest:
        os.environ.setdefault("DRJIT_LIBLLVM_PATH", str(newest[-1]))
    import drjit as dr
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
except ImportError as error:
    print(f"Mitsuba is left out: {error}")
    mi = None

SIZE, STEPS, POSE_STEPS = 128, 300, 150
FOCAL = SIZE / 2 / np.tan(np.radians(15))
DISTANCE = 2.732


class View:
    """Where a camera stands that looks at the origin: x right, y down, z forward."""

    def __init__(self, azimuth, elevation):
        a, e = np.radians([azimuth, elevation])
        forward = -np.array([np.cos(e) * np.sin(a), np.sin(e), -np.cos(e) * np.cos(a)])
        right = np.cross(forward, [0, 1, 0])
        right /= np.linalg.norm(right)
        self.rotation = np.stack([right, np.cross(forward, right), forward])
        self.translation = np.array([0, 0, DISTANCE])

    def intrinsics(self, size=SIZE):
        """OpenCV's, which counts from the centre of the first pixel, as deodr does."""
        return np.array([[FOCAL * size / SIZE, 0, (size - 1) / 2], [0, FOCAL * size / SIZE, (size - 1) / 2], [0, 0, 1.0]])

    def softras(self, size=SIZE):
        return softras.Camera.from_opencv(self.intrinsics(size), self.rotation, self.translation)

    def deodr(self):
        extrinsic = np.column_stack([self.rotation, self.translation])
        return Camera(extrinsic=extrinsic, intrinsic=self.intrinsics(), width=SIZE, height=SIZE)


FITTED = [View(30 * i, (-20, 10, 40)[i % 3]) for i in range(12)]
HELD_OUT = [View(15 + 60 * i, (25, -5)[i % 2]) for i in range(6)]


def pictures(vertices, faces, colors, views, samples=8):
    """Colour and mask [views, SIZE, SIZE, 4] of a mesh, each pixel the mean of samples²."""
    size = SIZE * samples
    mesh = softras.Mesh(vertices.astype(np.float32), faces, colors=colors.astype(np.float32))
    settings = softras.Settings(width=size, height=size, color="hard", silhouette="hard", background="composite")
    images = []
    for view in views:
        camera = view.softras(size)
        frame = softras.render(mesh, camera, settings.with_depths_of(mesh, [camera]))
        image = np.concatenate([frame.color[0] * frame.silhouette[0, ..., None], frame.silhouette[0, ..., None]], -1)
        images.append(image.reshape(SIZE, samples, SIZE, samples, 4).mean((1, 3)))
    return np.stack(images)


class Softras:
    """Images and gradients by softras: softer at first."""

    name = "softras"

    def __init__(self, faces, views, sigmas):
        self.faces, self.cameras, self.sigmas = faces, [view.softras() for view in views], sigmas

    def step(self, vertices, colors, goal, done):
        mesh = softras.Mesh(vertices.astype(np.float32), self.faces, colors=colors.astype(np.float32))
        first, last = self.sigmas
        settings = softras.Settings(width=SIZE, height=SIZE, sigma=first * (last / first) ** done, background="composite")
        settings = settings.with_depths_of(mesh, self.cameras)
        frame = softras.render(mesh, self.cameras, settings, save=True)
        color, silhouette = frame.color - goal[..., :3], frame.silhouette - goal[..., 3]
        found = frame.backward(color=color, silhouette=silhouette, by=("positions", "colors")).meshes[0]
        return (color**2).sum() + (silhouette**2).sum(), found.positions, found.colors


class Deodr:
    """Images and gradients by deodr: hard, with antialiased outlines."""

    name = "deodr"

    def __init__(self, faces, views, _):
        self.mesh = ColoredTriMesh(faces.astype(np.uint32), vertices=np.zeros((faces.max() + 1, 3)), nb_colors=4)
        self.cameras, self.scene = [view.deodr() for view in views], Scene3D(sigma=1)
        self.scene.set_mesh(self.mesh)
        self.scene.set_light(light_directional=None, light_ambient=1.0)
        self.scene.set_background_color(np.zeros(4))

    def step(self, vertices, colors, goal, done):
        self.mesh.set_vertices(vertices)
        self.mesh.set_vertices_colors(np.column_stack([colors, np.ones(len(colors))]))
        loss, by_vertices, by_colors = 0.0, np.zeros_like(vertices), np.zeros_like(colors)
        for camera, picture in zip(self.cameras, goal):
            difference = self.scene.render(camera) - picture
            self.scene.clear_gradients()
            self.scene.render_backward(difference)
            loss += (difference**2).sum()
            by_vertices += self.mesh._vertices_b
            by_colors += self.mesh.vertices_colors_b[:, :3]
        return loss, by_vertices, by_colors


class Mitsuba:
    """Images and gradients by Mitsuba 3's projective sampling: of a mesh that glows in its colours, and of one that glows white."""

    name = "mitsuba"

    def __init__(self, faces, views, _, samples=4):
        sensors = {f"view{i}": self.sensor(view) for i, view in enumerate(views)}
        self.views, self.samples, self.steps, self.scenes = len(views), samples, 0, []
        mi.set_log_level(mi.LogLevel.Error)
        for radiance in ({"type": "mesh_attribute", "name": "vertex_color"}, {"type": "rgb", "value": 1.0}):
            mesh = mi.Mesh("mesh", int(faces.max()) + 1, len(faces), props=self.glowing(radiance))
            mesh.add_attribute("vertex_color", 3, np.full(3 * (int(faces.max()) + 1), 0.5))
            params = mi.traverse(mesh)
            params["faces"] = faces.astype(np.uint32).ravel()
            params.update()
            integrator = {"type": "direct_projective", "sppi": 0, "hide_emitters": False}
            scene = mi.load_dict({"type": "scene", "integrator": integrator, "mesh": mesh, **sensors})
            self.scenes.append((scene, mi.traverse(scene)))

    @staticmethod
    def glowing(radiance):
        props = mi.Properties()
        props["emitter"] = mi.load_dict({"type": "area", "radiance": radiance})
        return props

    @staticmethod
    def sensor(view):
        origin = -view.rotation.T @ view.translation
        film = {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}}
        place = mi.ScalarTransform4f().look_at(origin.tolist(), [0, 0, 0], [0, 1, 0])
        return {"type": "perspective", "fov": 30, "to_world": place, "film": film}

    def step(self, vertices, colors, goal, done):
        loss, by_vertices, by_colors = 0.0, np.zeros_like(vertices), np.zeros_like(colors)
        self.steps += 1
        # The mask is each of the three channels of the white one. Without colours to find it is all that there is.
        for (scene, params), channels in list(zip(self.scenes, ([0, 1, 2], [3, 3, 3])))[int(np.all(colors == 1)) :]:
            places, paint = mi.Float(vertices.ravel()), mi.Float(colors.ravel())
            dr.enable_grad(places, paint)
            params["mesh.vertex_positions"], params["mesh.vertex_color"] = places, paint
            params.update()
            for i, picture in enumerate(goal):
                image = mi.render(scene, params, sensor=i, spp=self.samples, seed=self.steps * self.views + i)
                difference = dr.square(image - mi.TensorXf(picture[..., channels]))
                error = dr.sum(difference, axis=None) / (3 if channels[0] == 3 else 1)
                dr.backward(error)
                loss += error.array[0]
            by_vertices += np.array(dr.grad(places)).reshape(vertices.shape)
            by_colors += np.array(dr.grad(paint)).reshape(colors.shape)
        return loss, by_vertices, by_colors


class Adam:
    """Adam; `uniform` divides all values of a step by one number, as large steps want it."""

    def __init__(self, rate, uniform=False):
        self.rate, self.uniform, self.first, self.second, self.count = rate, uniform, 0.0, 0.0, 0

    def step(self, gradient, done):
        self.count += 1
        self.first = 0.9 * self.first + 0.1 * gradient
        self.second = 0.999 * self.second + 0.001 * gradient**2
        second = self.second.max() if self.uniform else self.second
        spread = np.sqrt(second / (1 - 0.999**self.count)) + 1e-12
        return self.rate * 0.1**done * self.first / (1 - 0.9**self.count) / spread


def smoothing(faces, weight=5.0):
    """(1 + weight L) of a mesh and what solves with it."""
    count = faces.max() + 1
    i, j = faces[:, [0, 1, 2]].ravel(), faces[:, [1, 2, 0]].ravel()
    adjacent = scipy.sparse.coo_matrix((np.ones(2 * len(i)), (np.r_[i, j], np.r_[j, i])), (count, count)).tocsr()
    adjacent.data[:] = 1.0
    degrees = scipy.sparse.diags(np.asarray(adjacent.sum(1)).ravel())
    matrix = (scipy.sparse.identity(count) + weight * (degrees - adjacent)).tocsc()
    return matrix, scipy.sparse.linalg.splu(matrix).solve


def judged(vertices, faces, colors, truth):
    """The mean IoU of held-out masks, and the mean difference of colours where both have the object."""
    found = pictures(vertices, faces, colors, HELD_OUT, 2)
    masks, goals = found[..., 3] > 0.5, truth[..., 3] > 0.5
    iou = ((masks & goals).sum((1, 2)) / (masks | goals).sum((1, 2))).mean()
    inside = (found[..., 3] == 1) & (truth[..., 3] == 1)
    return iou, np.abs(found - truth)[inside][:, :3].mean()


GOALS = {"IoU 0.90": lambda iou, _: iou >= 0.9, "IoU 0.95": lambda iou, _: iou >= 0.95, "IoU 0.97": lambda iou, _: iou >= 0.97,
         "colour 0.05": lambda iou, color: iou >= 0.9 and color <= 0.05}


def fitted(engine, start, faces, goal, truth, colored):
    """Seconds until each goal, those of all steps, and the IoU and colours at the end."""
    vertices, colors = start.astype(np.float64), np.full((len(start), 3), 0.5 if colored else 1.0)
    clock, reached, begin = 0.0, {}, time.perf_counter()
    matrix, solve = smoothing(faces)
    smooth, shape, paint = matrix @ vertices, Adam(0.06, uniform=True), Adam(0.02)
    renderer = engine(faces, FITTED, (1e-4, 1e-5))
    for step in range(STEPS):
        _, by_vertices, by_colors = renderer.step(vertices, colors, goal, step / STEPS)
        smooth -= shape.step(solve(by_vertices), step / STEPS)
        vertices = solve(smooth)
        if colored:
            colors = np.clip(colors - paint.step(by_colors, step / STEPS), 0, 1)
        if step % 5 == 4:
            clock += time.perf_counter() - begin
            found = judged(vertices, faces, colors, truth)
            for name, holds in GOALS.items():
                if name not in reached and holds(*found):
                    reached[name] = clock
            begin = time.perf_counter()
    return reached, clock, found


def commanded(program, goal, truth, colored):
    """The same by `softras fit`, from files."""
    with tempfile.TemporaryDirectory() as folder:
        folder, frames = pathlib.Path(folder), []
        for i, (view, picture) in enumerate(zip(FITTED, goal)):
            alpha = picture[..., 3:]
            light = picture[..., :3] / np.maximum(alpha, 1e-6)
            curve = np.where(light > 0.0031308, 1.055 * np.maximum(light, 0) ** (1 / 2.4) - 0.055, 12.92 * light)
            bytes_ = np.round(255 * np.clip(np.concatenate([curve, alpha], -1), 0, 1)).astype(np.uint8)
            Image.fromarray(bytes_).save(folder / f"{i:02}.png")
            place = np.eye(4)
            # OpenGL's axes, from the camera to the world.
            place[:3, :3] = view.rotation.T @ np.diag([1, -1, -1])
            place[:3, 3] = -view.rotation.T @ view.translation
            frames.append({"file_path": f"{i:02}.png", "transform_matrix": place.tolist()})
        lens = {"fl_x": FOCAL, "fl_y": FOCAL, "cx": SIZE / 2, "cy": SIZE / 2, "w": SIZE, "h": SIZE}
        (folder / "transforms.json").write_text(json.dumps({**lens, "frames": frames}))
        out = folder / "out.ply"
        command = [program, "fit", "--views", folder, "-o", out, "-q", "--hold-out", "0"] + ["--color"] * colored
        begin = time.perf_counter()
        subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)
        clock = time.perf_counter() - begin
        mesh = softras.load(out)
        colors = mesh.colors if colored else np.ones_like(mesh.positions)
        found = judged(mesh.positions, mesh.triangles, colors, truth)
    return {name: clock for name, holds in GOALS.items() if holds(*found)}, clock, found


def turned(angles):
    """The rotation by a vector of radians."""
    x, y, z = angles
    norm = np.linalg.norm(angles)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sinc(norm / np.pi) * cross + 0.5 * np.sinc(norm / 2 / np.pi) ** 2 * cross @ cross


def degrees(a, b):
    return np.degrees(np.arccos(np.clip((np.trace(a @ b.T) - 1) / 2, -1, 1)))


def posed(engine, vertices, faces, colors, goal, start):
    """The rotation that a start becomes."""
    renderer, rotation, adam = engine(faces, [View(0, 0)], (3e-2, 1e-6)), start, Adam(0.1)
    for step in range(POSE_STEPS):
        placed = vertices @ rotation.T
        _, by_vertices, _ = renderer.step(placed, colors, goal, step / POSE_STEPS)
        rotation = turned(-adam.step(np.cross(placed, by_vertices).sum(0), step / POSE_STEPS)) @ rotation
    return rotation


def rotations(count):
    """Rotations at random, the same in each run."""
    numbers = np.random.default_rng(1).normal(size=(count, 4))
    numbers /= np.linalg.norm(numbers, axis=1, keepdims=True)
    return [turned(2 * np.arctan2(np.linalg.norm(q[1:]), q[0]) * q[1:] / np.linalg.norm(q[1:])) for q in numbers]


def row(words, values):
    print((f"{words[0]:>18} {words[1]:>20}" + "".join(f"{value:>13}" for value in values)).rstrip(), flush=True)


def shapes(program, vertices, faces, colors, rounds):
    ball = softras.shapes.icosphere(4)
    start, ball_faces = 0.6 * ball.positions, ball.triangles
    row(("pictures", "fitted by"), [*GOALS, "all steps", "IoU", "colour"])
    for colored in (False, True):
        look = colors if colored else np.ones_like(colors)
        goal, truth = pictures(vertices, faces, look, FITTED), pictures(vertices, faces, look, HELD_OUT)
        runs = {}
        for turn in range(rounds):
            for engine in [Softras, Deodr] + [Mitsuba] * (mi is not None and turn == 0):
                runs.setdefault(engine.name, []).append(fitted(engine, start, ball_faces, goal, truth, colored))
            runs.setdefault("softras fit", []).append(commanded(program, goal, truth, colored))
        for name, found in runs.items():
            median = lambda goal: statistics.median(reached[goal] for reached, *_ in found)
            seconds = [f"{median(g):.1f} s" if all(g in reached for reached, *_ in found) else "-" for g in GOALS]
            if not colored:
                seconds[-1] = ""
            iou, color = found[0][2]
            last = [f"{statistics.median(clock for _, clock, _ in found):.1f} s", f"{iou:.4f}", f"{color:.4f}" if colored else ""]
            row(("colour and mask" if colored else "mask", name), seconds + last)


def poses(vertices, faces, colors, count=40):
    view = View(0, 0)
    goal = pictures(vertices, faces, colors, [view])
    starts, results = rotations(count), {}
    mesh = softras.Mesh(vertices.astype(np.float32), faces, colors=colors.astype(np.float32))
    for start in starts:
        for engine in (Softras, Deodr):
            begin = time.perf_counter()
            found = posed(engine, vertices, faces, colors, goal, start)
            results.setdefault(engine.name, []).append((degrees(found, np.eye(3)), time.perf_counter() - begin))
    for start in starts[:8]:
        # The search knows no start: the mesh that it is given is turned.
        away = mesh.with_positions((vertices @ start.T).astype(np.float32))
        begin = time.perf_counter()
        found = softras.pose(away, view.softras(), goal[..., :3].astype(np.float32), goal[..., 3].astype(np.float32), translate=False, center=(0, 0, 0))
        results.setdefault("softras.pose", []).append((degrees(found.rotation @ start, np.eye(3)), time.perf_counter() - begin))
    print()
    row(("a pose", "found by"), ["within 5°", "seconds each"])
    for name, found in results.items():
        near = sum(angle <= 5 for angle, _ in found)
        row(("colour and mask", name), [f"{near} of {len(found)}", f"{statistics.median(seconds for _, seconds in found):.1f} s"])
