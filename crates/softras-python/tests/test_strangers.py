"""Files as their specifications allow them, written by strangers.py, against what was meant and against trimesh, an independent reader.

Each file holds one small shape without symmetry. `softras.load` must find its triangles, colours and UVs as they were meant, and
`softras.render` must draw them as a z-buffer of numpy does from three sides. trimesh, where it is installed (`test.sh --with trimesh
--with scipy`), must find the same triangles and, where it gives colours of vertices or faces, the same colours, but for the kinds of files that
`TRIMESH_CANNOT` names. It gives none for OBJ files with UVs or materials, and takes glTF's UVs without their scale and transform.
"""

import numpy as np
import pytest

import softras
from strangers import COLORS, FILES

# Files that trimesh 4 reads otherwise than the specification says, or not at all. glTF: normalized positions, fans, sparse accessors,
# morphs, skins and instances. PLY: polygons beside triangles, lists of vertices, and elements between vertices and faces. STL: old
# line ends and names with words of the format. OBJ: tabs, comments that end in a backslash and polygons that are not convex.
TRIMESH_CANNOT = {"share True", "mode 6", "sparse True", "morph", "skin", "instances", "polygon True", "weighted True"}
TRIMESH_CANNOT |= {"['vertex', 'other', 'face']"}
TRIMESH_CANNOT |= {"end '\\r'", "name vertex 1 2 3", "name endsolid", "space '\\t'", "backslash True"}


def ordered(corners, *more):
    """Triangles in an order of their own, each from its least corner on, with what else is at the corners."""
    corners = np.round(corners, 2) + 0.0
    first = [min(range(3), key=lambda k: tuple(corner[k])) for corner in corners]
    turned = [np.array([np.roll(one, -k, axis=0) for one, k in zip(array, first)]) for array in (corners, *more)]
    order = np.lexsort(turned[0].reshape(len(corners), 9).T)
    return [array[order] for array in turned]


def drawn(corners, colors, size=48):
    """Colours and silhouette of triangles seen along -z, by a z-buffer at the centres of pixels of [-1, 1]²."""
    centres = (np.arange(size) + 0.5) / size * 2 - 1
    x, y = np.meshgrid(centres, -centres)
    color, depth = np.zeros((size, size, 3)), np.full((size, size), -np.inf)
    for (a, b, c), shades in zip(corners, colors):
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if abs(area) > 1e-9:
            v = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area
            w = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area
            weights = np.stack([1 - v - w, v, w], axis=2)
            z = weights @ np.array([a[2], b[2], c[2]])
            nearer = (weights >= 0).all(axis=2) & (z > depth)
            depth[nearer], color[nearer] = z[nearer], (weights @ shades)[nearer]
    return color, np.isfinite(depth)


@pytest.mark.parametrize("kind", FILES)
def test_what_a_file_means_is_read_and_drawn(tmp_path, kind):
    found, places = [], []
    for path, meant, tags in FILES[kind](tmp_path):
        mesh = softras.load(path, srgb=False)
        place, corners = f"{path.name} {sorted(tags)} {mesh.notes}", mesh.positions[mesh.triangles].astype(float)
        looks = {"colors": None, "uvs": None if mesh.uvs is None else mesh.uvs[mesh.uv_triangles]}
        if mesh.surface is not None:
            looks["colors"] = np.repeat(mesh.surface.reshape(-1, 1, 3), 3, axis=1)
        elif np.ndim(mesh.colors) == 2:
            looks["colors"] = mesh.colors[mesh.triangles]
        assert corners.shape == meant.corners.shape, place
        for name, got in looks.items():
            assert (got is None) == (getattr(meant, name) is None), f"{name}: {place}"
            got, wanted = ([] if array is None else [array] for array in (got, getattr(meant, name)))
            for got, wanted in zip(ordered(corners, *got), ordered(meant.corners, *wanted)):
                np.testing.assert_allclose(got, wanted, atol=0.011, err_msg=f"{name}: {place}")
        low, high = meant.corners.min(axis=(0, 1)), meant.corners.max(axis=(0, 1))
        fit = lambda points: (points - (low + high) / 2) / (high - low).max() * 1.8
        found.append(mesh.with_positions(fit(mesh.positions)))
        places.append((place, fit(meant.corners), meant.colors, meant.uvs))
    assert len(found) > 130
    settings = softras.Settings(width=48, height=48, sigma=1e-9, near=0.1, far=10, color="hard", silhouette="hard")
    # From +z, +x and +y: what is right, up and near in the picture.
    for turn in np.array([[[1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 0, -1], [0, 1, 0], [1, 0, 0]], [[1, 0, 0], [0, 0, -1], [0, 1, 0]]]):
        cameras = [softras.Camera.look_at(3 * turn[2], [0, 0, 0], turn[1], half_height=1.0)] * len(found)
        frame = softras.render(found, cameras, settings, softras.Lights())
        for (place, corners, colors, uvs), silhouette, color in zip(places, frame.silhouette, frame.color):
            plain = np.ones(3) if uvs is None else COLORS[6]
            wanted, inside = drawn(corners @ turn.T, np.tile(plain, (len(corners), 3, 1)) if colors is None else colors)
            assert (inside != (silhouette > 0.5)).mean() < 0.003, place
            assert np.abs(wanted - color).mean() < 0.01, place


@pytest.mark.parametrize("kind", FILES)
def test_trimesh_reads_the_same(tmp_path, kind):
    trimesh = pytest.importorskip("trimesh")
    pytest.importorskip("scipy")
    count = 0
    for path, meant, tags in FILES[kind](tmp_path):
        if tags & TRIMESH_CANNOT:
            continue
        mesh = trimesh.load(path, force="mesh", process=False)
        faces, colors = np.asarray(mesh.faces), []
        if meant.colors is not None and mesh.visual.kind in ("vertex", "face"):
            per_vertex = mesh.visual.kind == "vertex"
            colors = [mesh.visual.vertex_colors[faces] if per_vertex else np.repeat(mesh.visual.face_colors[:, None], 3, axis=1)]
        got = ordered(np.asarray(mesh.vertices)[faces], *[color[..., :3] / 255 for color in colors])
        for got, wanted in zip(got, ordered(meant.corners, *[meant.colors for _ in colors])):
            assert got.shape == wanted.shape and np.abs(got - wanted).max() < 0.02, f"{path.name} {sorted(tags)}"
        count += 1
    assert count > 10
