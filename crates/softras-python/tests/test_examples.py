"""The examples and the notebook, run in an empty folder with smaller numbers, reach what they are for."""

import base64
import importlib.util
import io
import json
import os
import pathlib
import re
import subprocess
import sys

import numpy as np
import pytest

import softras

image = pytest.importorskip("PIL.Image", reason="Pillow is not installed, which the examples need: pip install pillow")

HERE = pathlib.Path(__file__).parent
#: Beside the tests where test.sh has put them, or in the repository.
EXAMPLES = HERE / "examples" if (HERE / "examples").is_dir() else HERE.parent / "examples"

#: The size of the pictures of two examples.
PICTURE = {"width=240, height=240": "width=64, height=64"}


def needs(package, ask=None):
    spec = importlib.util.find_spec(package)
    reason = f"{package} is not installed: test.sh --with '{ask or package}' adds it"
    # A folder of the same name would be a package without a file.
    return pytest.mark.skipif(spec is None or spec.origin is None, reason=reason)


def run(folder, name, text, changes, *arguments):
    """The output of a program after some of its numbers were changed, each of which it must contain once."""
    for old, new in changes.items():
        assert text.count(old) == 1, f"{name} has no single {old!r}"
        text = text.replace(old, new)
    (folder / name).write_text(text, encoding="utf-8")
    # Files that Ray leaves in the home directory stay in the test's folder.
    environment = {**os.environ, "MPLBACKEND": "agg", "HOME": str(folder)}
    command = [sys.executable, name, *map(str, arguments)]
    result = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=600)
    assert result.returncode == 0, result.stderr
    return result.stdout


def example(folder, name, changes, *arguments):
    return run(folder, name, (EXAMPLES / name).read_text(encoding="utf-8"), changes, *arguments)


def numbers(output, pattern):
    """The numbers of the only line that a pattern finds."""
    (found,) = re.findall(pattern, output)
    return np.array(found, float)


def tiles(path, rows, columns):
    """A picture's tiles [rows, columns, height, width, 3] in [0, 1], in each of which something is seen."""
    pixels = np.asarray(image.open(path).convert("RGB"), float) / 255
    height, width = pixels.shape[0] // rows, pixels.shape[1] // columns
    cut = pixels.reshape(rows, height, columns, width, 3).swapaxes(1, 2)
    covered = (cut.max(-1) > 0.1).mean((2, 3))
    assert ((covered > 0.05) & (covered < 0.9)).all(), covered
    return cut


def test_colors_with_numpy_alone(tmp_path):
    changes = {"width=128, height=128": "width=64, height=64", "range(60)": "range(40)"}
    output = example(tmp_path, "numpy_only.py", changes)
    assert numbers(output, r"at last: loss (\S+)") < 0.02 * numbers(output, r"step 0: loss (\S+)")
    target, found = tiles(tmp_path / "colors.png", 2, 4)
    assert np.abs(target - found).mean() < 0.01 < np.ptp(target[..., 0])


def test_a_pose(tmp_path):
    changes = {"width=64, height=64": "width=40, height=40", "starts=24": "starts=3, steps=45", **PICTURE}
    output = example(tmp_path, "pose.py", changes)
    degrees, off = numbers(output, r"off by (\S+) degrees and (\S+) of")
    assert degrees < 5 and off < 0.1
    ((start, found, true),) = tiles(tmp_path / "pose.png", 1, 3)
    assert np.abs(found - true).mean() < 0.4 * np.abs(start - true).mean()


@needs("torch")
def test_a_mesh_from_silhouettes(tmp_path):
    changes = {"width=96, height=96": "width=64, height=64", "range(300)": "range(80)"}
    output = example(tmp_path, "silhouettes.py", changes)
    assert numbers(output, r"IoU of the silhouettes: (\S+)") > 0.94
    assert len(softras.load(tmp_path / "fitted.obj").triangles) == 1280
    target, fitted = tiles(tmp_path / "silhouettes.png", 2, 4)
    assert ((target.max(-1) > 0.5) == (fitted.max(-1) > 0.1)).mean() > 0.95


@needs("torch")
def test_a_texture(tmp_path):
    changes = {"width=160, height=160": "width=80, height=80", "range(100)": "range(40)"}
    output = example(tmp_path, "texture.py", changes)
    assert numbers(output, r"at last: mean difference (\S+)") < 0.2 * numbers(output, r"step 0: mean difference (\S+)")
    assert softras.load(tmp_path / "textured.obj").textures[0].shape[:2] == (256, 256)
    target, found = tiles(tmp_path / "texture.png", 2, 4)
    assert np.abs(target - found).mean() < 0.02


@needs("torch")
def test_deferred_shading(tmp_path):
    output = example(tmp_path, "deferred.py", {"width=96, height=96": "width=48, height=48", "range(300)": "range(120)"})
    for what, most in (("places", 0.6), ("albedo", 0.6), ("pictures", 0.15)):
        first, last = numbers(output, rf"{what}: error (\S+) at first, (\S+) at last")
        assert last < most * first, what
    rows = tiles(tmp_path / "deferred.png", 4, 4)
    assert np.abs(rows[0] - rows[2]).mean() < 0.3 * np.abs(rows[0] - rows[1]).mean()


@needs("torch")
@pytest.mark.parametrize("arguments, most", [((), 0.02), (("--hard", "--steps", "400"), 0.1)], ids=["soft", "hard"])
def test_a_cube_of_few_pixels(tmp_path, arguments, most):
    steps = () if "--steps" in arguments else ("--steps", "500")
    output = example(tmp_path, "cube.py", {"step % 250": "step % 100"}, *arguments, *steps)
    errors = [float(error) for error in re.findall(r"vertices are (\S+) off", output)]
    assert errors[-1] < most < errors[0]
    ((_, start, found, true),) = tiles(tmp_path / "cube.png", 1, 4)
    assert np.abs(found - true).mean() < 0.2 * np.abs(start - true).mean()


@needs("torch")
def test_a_shader_has_the_gradients_of_what_it_draws():
    """Those of vertices, albedo, light, lamp and roughness through features, in double precision."""
    import torch

    spec = importlib.util.spec_from_file_location("deferred", EXAMPLES / "deferred.py")
    deferred = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(deferred)
    mesh = softras.shapes.icosphere(0)
    camera = softras.Camera.look_at((0, 0.5, 3), (0, 0, 0), fov_y=0.8)
    settings = softras.Settings(width=6, height=6, sigma=1e-2, gamma=0.05, near=1.0, far=5.0, tau=1e-12, background="composite")
    random = np.random.default_rng(7)

    def leaf(array):
        # Values that single precision holds.
        return torch.tensor(np.asarray(array, np.float32), dtype=torch.float64).requires_grad_()

    faces = torch.tensor(mesh.triangles.astype(np.int64))
    given = [0.7 * mesh.positions, random.random((12, 3)), random.random((9, 3)), [1.0, 2.0, 3.0], 0.5]

    def pictures(vertices, albedo, light, lamp, roughness):
        return deferred.shaded(vertices, faces, [camera], albedo, light, lamp, roughness, settings)

    assert torch.autograd.gradcheck(pictures, [leaf(one) for one in given], eps=1e-6, atol=1e-4, rtol=1e-3)


@needs("torch")
def test_a_camera(tmp_path):
    output = example(tmp_path, "camera.py", {"width=128, height=128": "width=64, height=64", **PICTURE})
    assert numbers(output, r"the eye is (\S+) from") < 0.08
    ((start, found, true),) = tiles(tmp_path / "camera.png", 1, 3)
    assert np.abs(found - true).mean() < 0.4 * np.abs(start - true).mean()


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture
def meshes(tmp_path):
    """A folder of three meshes and two files that are none."""
    folder = tmp_path / "meshes"
    folder.mkdir()
    softras.shapes.icosphere(2).save(folder / "ball.obj")
    softras.shapes.cube().save(folder / "cube.obj")
    softras.shapes.fish().save(folder / "fish.obj")
    (folder / "broken.obj").write_text("v 0 0 zero\nf 1 1 1\n")
    (folder / "empty.stl").write_text("")
    return folder


def test_a_folder(tmp_path, meshes):
    output = example(tmp_path, "folder.py", {}, "meshes", "pictures").splitlines()
    assert output[0] == "3 of 5 meshes rendered" and "broken.obj:1:" in output[1] and "empty.stl" in output[2]
    assert names(tmp_path / "pictures") == ["ball.obj.png", "cube.obj.png", "fish.obj.png"]
    for path in (tmp_path / "pictures").iterdir():
        alpha = np.asarray(image.open(path))[..., 3]
        assert 0.05 < (alpha > 128).mean() < 0.9
    # The ball, the cube and the fish are files 0, 2 and 4.
    output = example(tmp_path, "folder.py", {}, "meshes", "shard", "--workers", "1", "--shard", "2/3")
    assert output == "1 of 1 meshes rendered\n" and names(tmp_path / "shard") == ["cube.obj.png"]
    assert (tmp_path / "shard/cube.obj.png").read_bytes() == (tmp_path / "pictures/cube.obj.png").read_bytes()


@needs("ray", "ray[data]")
def test_a_folder_by_ray(tmp_path, meshes):
    expected = example(tmp_path, "folder.py", {}, "meshes", "pictures")
    assert example(tmp_path, "folder.py", {}, "meshes", "by_ray", "--ray") == expected
    same_files(tmp_path / "pictures", tmp_path / "by_ray")


def same_files(a, b):
    assert names(a) == names(b)
    assert all((a / name).read_bytes() == (b / name).read_bytes() for name in names(a))


@pytest.fixture(scope="module")
def cells():
    """The notebook's programs."""
    found = json.loads((EXAMPLES / "tour.ipynb").read_text(encoding="utf-8"))["cells"]
    return [cell for cell in found if cell["cell_type"] == "code"]


@needs("torch")
@needs("matplotlib")
def test_the_notebook_runs(tmp_path, cells):
    text = "\n".join("".join(cell["source"]) for cell in cells) + '\nprint("losses", losses[0], losses[-1])\n'
    changes = {"range(150)": "range(40)", "steps=300": "steps=40", "icosphere(4)": "icosphere(3)"}
    output = run(tmp_path, "tour.py", text, changes)
    first, last = numbers(output, r"losses (\S+) (\S+)")
    assert last < 0.5 * first


def test_the_notebook_has_its_pictures(cells):
    for cell in cells:
        shows = any(line.startswith("show(") for line in cell["source"])
        pictures = [one["data"]["image/png"] for one in cell["outputs"] if "image/png" in one.get("data", {})]
        assert bool(pictures) == shows
        for picture in pictures:
            assert np.ptp(np.asarray(image.open(io.BytesIO(base64.b64decode(picture))).convert("L"))) > 100
