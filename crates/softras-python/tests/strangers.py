"""Writes small mesh files in every way that their specifications allow, each with what it means: the material of test_strangers.py."""

import base64
import itertools
import json
import struct

import numpy as np

# A shape without symmetry, at whole numbers that every type of number holds, with colours and UVs of each vertex.
POINTS = np.array([[0, 0, 0], [100, 0, 0], [90, 70, 0], [10, 80, 20], [40, 30, 110], [20, 120, 60], [127, 50, 80]], float)
FACES = [[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 6, 4], [3, 0, 4], [3, 4, 5], [2, 3, 5], [6, 5, 4]]
COLORS = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [51, 102, 153], [255, 255, 0], [0, 255, 255], [204, 0, 102]]) / 255
UVS = np.array([[0, 0], [255, 0], [255, 255], [0, 255], [51, 102], [153, 204], [102, 51]]) / 255
# A polygon that is not convex, as corners 7 to 11 of files with polygons, and the triangles that it is cut into.
NOTCH = np.array([[0, 0, 50], [40, 0, 50], [40, 40, 50], [20, 10, 50], [0, 40, 50]], float)
CUT = [[7, 8, 10], [8, 9, 10], [10, 11, 7]]
# Corners of a strip and of a fan over the same points, and the triangles that they mean.
STRIP = [0, 1, 2, 3, 5, 4, 6]
ORDERS = {
    4: (np.ravel(FACES), np.array(FACES)),
    5: (np.array(STRIP), np.array([STRIP[i : i + 3] if i % 2 == 0 else [STRIP[i + 1], STRIP[i], STRIP[i + 2]] for i in range(5)])),
    6: (np.array(STRIP), np.array([[STRIP[0], STRIP[i], STRIP[i + 1]] for i in range(1, 6)])),
}
# glTF's types of numbers, and the greatest of those that stand for shares.
TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
MOST = {5120: 127, 5121: 255, 5122: 32767, 5123: 65535}
PLY_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4", "double": "f8"}
# Statements of OBJ that draw no triangle: lines, points, groups, a free-form curve, levels of detail, and what nobody knows.
FREE_FORM = ["l 1 2 3", "p 1", "s off", "g one two", "vp 0.5", "cstype bezier", "deg 2", "curv 0 1 1 2 3", "parm u 0 1", "end", "lod 3", "xyzzy"]


class Meant:
    """The corners of a file's triangles, and perhaps the colours and UVs there."""

    def __init__(self, corners, colors=None, uvs=None):
        self.corners, self.colors, self.uvs = np.asarray(corners, float), colors, uvs


def stored(values, kind, share):
    """Numbers as an accessor holds them."""
    return np.round(values * MOST[kind] if share else values).astype(TYPES[kind]) if kind != 5126 else values.astype("<f4")


class Gltf:
    """A glTF file as its parts are added."""

    def __init__(self):
        self.blob, self.root = b"\7" * 8, {"asset": {"version": "2.0"}, "bufferViews": [], "accessors": []}

    def view(self, data, **stride):
        self.blob += b"\0" * (-len(self.blob) % 4)
        self.root["bufferViews"].append({"buffer": 0, "byteOffset": len(self.blob), "byteLength": len(data), **stride})
        self.blob += data
        return len(self.root["bufferViews"]) - 1

    def accessor(self, array, kind, share=False, padded=None, sparse=None, gap=0):
        """`padded` bytes follow each element, `gap` come first; `sparse` writes all elements, or the odd ones, apart."""
        count, width = len(array), array.shape[1] if array.ndim == 2 else 1
        kinds = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
        accessor = {"componentType": kind, "count": count, "type": kinds[width], **({"normalized": True} if share else {})}
        base, size = array.copy(), array.dtype.itemsize * width
        if sparse:
            changed = np.arange(count) if sparse[0] == "bare" else np.arange(1, count, 2)
            base[changed] = base[0]
            indices = {"bufferView": self.view(changed.astype(TYPES[sparse[1]]).tobytes()), "componentType": sparse[1]}
            values = {"bufferView": self.view(array[changed].tobytes())}
            accessor["sparse"] = {"count": len(changed), "indices": indices, "values": values}
        if not sparse or sparse[0] == "over":
            extra = b"" if padded is None else b"\x7f" * (padded + -size % 4)
            rows = b"\x7f" * gap + b"".join(row.tobytes() + extra for row in base)
            accessor["bufferView"] = self.view(rows, **({"byteStride": size + len(extra)} if padded is not None else {}))
            accessor["byteOffset"] = gap
        self.root["accessors"].append(accessor)
        return len(self.root["accessors"]) - 1

    def save(self, path, container):
        blob = self.blob + b"\0" * (-len(self.blob) % 4)
        uri = "data:application/octet-stream;base64," + base64.b64encode(blob).decode()
        if container == "bin":
            uri = path.stem + ".bin"
            path.with_name(uri).write_bytes(blob)
        self.root["buffers"] = [{"byteLength": len(blob), **({} if container == "glb" else {"uri": uri})}]
        text = json.dumps(self.root).encode()
        if container == "glb":
            path = path.with_suffix(".glb")
            text += b" " * (-len(text) % 4)
            head = struct.pack("<4sIII4s", b"glTF", 2, 28 + len(text) + len(blob), len(text), b"JSON")
            text = head + text + struct.pack("<I4s", len(blob), b"BIN\0") + blob
        path.write_bytes(text)
        return path


def placing(linear, move):
    return np.vstack([np.c_[linear, move], [0, 0, 0, 1]])


# A turn by 90 degrees about z, a move and scales; nodes that place a mesh by them, and the matrix that they mean.
TURN, MOVE, SCALE = [0, 0, 0.5**0.5, 0.5**0.5], [30.0, -20.0, 5.0], [2.0, 0.5, 1.5]
TURNED = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
PLACES = {
    "none": ([{"mesh": 0}], np.eye(4)),
    "trs": ([{"mesh": 0, "translation": MOVE, "rotation": TURN, "scale": SCALE}], placing(TURNED * SCALE, MOVE)),
    "matrix": ([{"mesh": 0, "matrix": placing(TURNED * SCALE, MOVE).T.ravel().tolist()}], placing(TURNED * SCALE, MOVE)),
    "mirrored": ([{"mesh": 0, "scale": [-1, 1, 2], "translation": MOVE}], placing(np.diag([-1, 1, 2]), MOVE)),
    "nested": ([{"children": [1], "scale": SCALE}, {"children": [2], "rotation": TURN}, {"mesh": 0, "translation": MOVE}],
               placing(np.diag(SCALE) @ TURNED, np.diag(SCALE) @ TURNED @ MOVE)),
    "sheared": ([{"mesh": 0, "matrix": [1, 0, 0, 0, 0.5, 1, 0, 0, 0, 0.25, -1, 0, 7, 8, 9, 1]}],
                placing([[1, 0.5, 0], [0, 1, 0.25], [0, 0, -1]], [7, 8, 9])),
}


def gltf_files(folder):
    """Every type of positions by every mode, type of index and sparsity; all else as dice fall."""
    dice = np.random.default_rng(1)
    pick = lambda *options: options[dice.integers(len(options))]
    kinds = [(5126, False), *itertools.product(MOST, (False, True))]
    product = itertools.product(kinds, ORDERS, [None, 5121, 5123, 5125], [None, ("over", 5121), ("over", 5123), ("bare", 5125)])
    for number, ((kind, share), mode, index, sparse) in enumerate(product):
        place, container, moved_by = pick(*PLACES), pick("uri", "glb", "bin"), pick("nothing", "nothing", "morph", "skin", "instances")
        layout = {"padded": pick(None, 0, 8), "sparse": sparse, "gap": pick(0, 4)}
        file, (corners, faces) = Gltf(), ORDERS[mode]
        order = corners if index is None else np.arange(len(POINTS))
        points = stored(POINTS / 128 if share else POINTS, kind, share)
        attributes = {"POSITION": file.accessor(points[order], kind, share, **layout)}
        primitive, nodes = {"mode": mode, "attributes": attributes}, json.loads(json.dumps(PLACES[place][0]))
        primitives = [primitive]
        if index is not None:
            # Lists of triangles may be parted: primitives share their vertices.
            parts = np.split(corners, pick([], [6])) if mode == 4 else [corners]
            places = [file.accessor(part.astype(TYPES[index]), index, gap=layout["gap"]) for part in parts]
            primitives = [{**primitive, "indices": place} for place in places]
        file.root.update(meshes=[{"primitives": primitives}], nodes=nodes, scenes=[{"nodes": [0]}], scene=0)
        meant, moved = Meant((points / (MOST[kind] if share else 1.0))[faces]), PLACES[place][1]
        of, wide, look = pick(5126, 5121, 5123), pick(3, 4), pick("plain", "colours", "uvs")
        if look == "colours":
            rgba = stored(np.c_[COLORS, np.ones(len(COLORS))][order, :wide], of, True)
            attributes["COLOR_0"] = file.accessor(rgba, of, of != 5126, **{**layout, "padded": layout["padded"] or 0})
            meant.colors = COLORS[faces]
        if look == "uvs":
            attributes["TEXCOORD_0"] = file.accessor(stored(UVS[order], of, True), of, of != 5126, **{**layout, "padded": 4})
            offset, scale = pick(([0, 0], [1, 1]), ([0.25, 0.5], [2, -0.5]))
            texture = {"index": 0, "extensions": {"KHR_texture_transform": {"offset": offset, "scale": scale}}}
            # One pixel of COLORS[6].
            picture = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR42mM4w5AGAALOATNweIrgAAAAAElFTkSuQmCC"
            file.root.update(images=[{"uri": "data:image/png;base64," + picture}], textures=[{"source": 0}])
            file.root["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": texture}}]
            for one in primitives:
                one["material"] = 0
            # Without effect on a picture of one pixel, whichever way UVs lie outside of it.
            wrap = pick(None, 10497, 33071)
            if wrap:
                file.root.update(samplers=[{"wrapS": wrap, "wrapT": wrap, "minFilter": 9987}])
                file.root["textures"][0]["sampler"] = 0
            meant.uvs = ((UVS * scale + offset) * [1, -1] + [0, 1])[faces]
        if moved_by == "morph":
            offsets = np.roll(POINTS, 1, axis=0)
            target = file.accessor(stored(offsets[order], 5126, False), 5126, **layout)
            for one in primitives:
                one["targets"] = [{"POSITION": target}]
            pick(file.root["meshes"][0], nodes[-1])["weights"] = [0.25]
            meant.corners = meant.corners + 0.25 * offsets[faces]
        if moved_by == "skin":
            # Half of each vertex follows a joint that the inverse bind matrix moves by (8, 0, 0) and doubles, half stays.
            of, joint_kind = pick(5126, 5121, 5123), pick(5121, 5123)
            inverse = np.array([placing(2 * np.eye(3), [8, 0, 0]).T.ravel(), np.eye(4).ravel()], "<f4")
            each = lambda *four: np.tile(four, (len(order), 1))
            file.root["skins"] = [{"joints": [len(nodes), len(nodes)], "inverseBindMatrices": file.accessor(inverse, 5126)}]
            attributes["JOINTS_0"] = file.accessor(each(0, 1, 0, 0).astype(TYPES[joint_kind]), joint_kind)
            attributes["WEIGHTS_0"] = file.accessor(stored(each(0.5, 0.5, 0, 0), of, True), of, of != 5126)
            nodes[-1]["skin"], moved = 0, np.eye(4)
            nodes.append({})
            meant.corners = 1.5 * meant.corners + [4, 0, 0]
        if moved_by == "instances":
            of = pick(5126, 5120, 5122)
            turns = stored(np.array([[0, 0, 0, 1], TURN]), of, True)
            instances = {"TRANSLATION": file.accessor(np.array([[0, 0, 0], MOVE], "<f4"), 5126), "ROTATION": file.accessor(turns, of, of != 5126)}
            nodes[-1]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": instances}}
            both = lambda array: None if array is None else np.concatenate([array, array])
            meant = Meant(np.concatenate([meant.corners, meant.corners @ TURNED.T + MOVE]), both(meant.colors), both(meant.uvs))
        meant.corners = meant.corners @ moved[:3, :3].T + moved[:3, 3]
        if np.linalg.det(moved[:3, :3]) < 0:
            meant = Meant(*(None if array is None else array[:, ::-1] for array in (meant.corners, meant.colors, meant.uvs)))
        tags = {f"mode {mode}", f"sparse {sparse is not None}", f"share {share}", f"index {index}", f"type {kind}"}
        tags |= {place, moved_by, look, container, str(layout)}
        yield file.save(folder / f"{number}.gltf", container), meant, tags


def ply_files(folder):
    """Every format by every type of coordinates and of corners' numbers; order of properties and elements, names and colours as dice fall."""
    dice = np.random.default_rng(2)
    pick = lambda *options: options[dice.integers(len(options))]
    new_names = dict(zip(PLY_TYPES, ["int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64"]))
    points, colors = np.concatenate([POINTS, NOTCH]), np.concatenate([COLORS, COLORS[:5]])
    formats = ["ascii", "binary_little_endian", "binary_big_endian"]
    for number, (form, kind, index) in enumerate(itertools.product(formats, PLY_TYPES, list(PLY_TYPES)[:6])):
        coloring, order = pick(None, "vertex", "face"), pick(["vertex", "face"], ["face", "vertex"], ["vertex", "other", "face"])
        shade, count = pick("uchar", "ushort", "float"), pick("char", "uchar", "short", "ushort", "int", "uint")
        name, end, polygon = pick(lambda kind: kind, new_names.get), pick("\n", "\r\n"), pick(False, True)
        rows = [*FACES, [7, 8, 9, 10, 11]] if polygon else [*FACES, *CUT]
        # Each column of an element: its name, its type, and a value for each row.
        numbers = [(axis, kind, points[:, i]) for i, axis in enumerate("xyz")] + [("quality", "double", points[:, 0])]
        weighted = pick(False, True)
        numbers += [("weights", "list", [[i] * (i % 3) for i in range(12)])] * weighted
        scale = {"uchar": 255, "ushort": 65535, "float": 1}[shade]
        rgb = np.round(colors.T * scale, 3 if scale == 1 else 0)
        shades = [(color, shade, values) for color, values in zip(["red", "green", "blue"], rgb[:, : len(rows) if coloring == "face" else 12])]
        lists = [(pick("vertex_index", "vertex_indices"), "list", rows), ("flags", "short", np.arange(len(rows)))]
        elements = {"vertex": numbers + shades * (coloring == "vertex"), "face": lists + shades * (coloring == "face"),
                    "other": [("x", "float", [1, 2]), ("parts", "list", [[1, 2, 3], []])]}
        head, text, blob = ["ply", f"format {form} 1.0", "comment by a test"], [], b""
        for element in order:
            columns = [elements[element][i] for i in dice.permutation(len(elements[element]))]
            head += [f"element {element} {len(columns[0][2])}"]
            head += [f"property list {name(count)} {name(index)} {c}" if k == "list" else f"property {name(k)} {c}" for c, k, _ in columns]
            pack = lambda value, kind: np.array(value).astype((">" if "big" in form else "<") + PLY_TYPES[kind]).tobytes()
            for i in range(len(columns[0][2])):
                for _, k, values in columns:
                    row = values[i]
                    text += [str(len(row)), *map(str, row)] if k == "list" else [str(float(row) if k in ("float", "double") else int(row))]
                    blob += pack(len(row), count) + pack(row, index) if k == "list" else pack(row, k)
                text += [end]
        path = folder / f"{number}.ply"
        path.write_bytes(end.join([*head, "end_header", ""]).encode() + (" ".join(text).encode() if form == "ascii" else blob))
        faces = np.array(FACES + CUT)
        of_face = np.repeat(colors[np.minimum(np.arange(11), len(rows) - 1)][:, None], 3, axis=1)
        tags = {form, f"coordinates {kind}", f"corners {index}", f"count {count}", f"{coloring} {shade}", str(order), f"polygon {polygon}"}
        tags |= {f"weighted {weighted}"}
        yield path, Meant(points[faces], {"vertex": colors[faces], "face": of_face}.get(coloring)), tags


def stl_files(folder):
    """Binary, and text in every spelling of its keywords, numbers, line ends and names."""
    corners = POINTS[FACES]
    for number, header in enumerate([b"made by a test", b"solid facet loop", b"\xff" * 80, b""]):
        rows = b"".join(struct.pack("<12fH", 0, 0, number % 2 or np.nan, *corner.ravel(), 0) for corner in corners)
        path = folder / f"binary{number}.stl"
        path.write_bytes(header.ljust(80, b"\0") + struct.pack("<I", len(corners)) + rows)
        yield path, Meant(corners), {"binary"}
    numbers = [repr, "{:.6e}".format, "{:+.3E}".format, "{:.0f}.".format, lambda x: f"{x / 1000:.4f}e3".replace("0.", ".", 1)]
    names = ["", " a name", " facet", " vertex 1 2 3", " endsolid", " Größe 20%"]
    product = itertools.product(numbers, ["\n", "\r\n", "\r"], [str.lower, str.upper, str.title], ["  ", "\t", ""])
    for number, (write, end, case, indent) in enumerate(product):
        name, normal, parts = names[number % 6], ["0 0 1", "nan nan nan", "0 0 0"][number // 2 % 3], 1 + number // 4 % 2
        lines = []
        for part in np.array_split(corners, parts):
            lines.append(case("solid") + name)
            for corner in part:
                lines += [indent + case("facet normal ") + normal, indent * 2 + case("outer loop")]
                lines += [indent * 3 + case("vertex ") + " ".join(write(float(x)) for x in point) for point in corner]
                lines += [indent * 2 + case("endloop"), indent + case("endfacet"), *([""] if number % 5 == 0 else [])]
            lines.append(case("endsolid") + (name if number % 7 else ""))
        path = folder / f"{number}.stl"
        path.write_bytes((end.join(lines) + (end if number % 8 else "")).encode())
        yield path, Meant(corners), {"text", f"end {end!r}", f"name{name}", f"{parts} solids", f"number {write(1.5)}", case("case"), normal}


def obj_files(folder):
    """Every form of a face's corners, by positive and negative numbers, colours, line ends, and ways to write numbers and lines."""
    (folder / "one.mtl").write_text("newmtl a\nKd 0.2 0.4 0.6\nnewmtl b\nKd 1 0 0\n")
    forms = ["{v}", "{v}/{t}", "{v}//{t}", "{v}/{t}/{t}"]
    product = itertools.product(forms, [False, True], ["", "rgb", "w", "mtl"], ["\n", "\r\n", "\r"], [str, "{:.4e}".format], [" ", "\t"])
    points, colors, faces = np.concatenate([POINTS, NOTCH]), np.concatenate([COLORS, COLORS[:5]]), np.array(FACES + CUT)
    for number, (form, negative, kind, end, write, space) in enumerate(product):
        texts = ["# a test", "mtllib one.mtl" if kind == "mtl" else "o thing", *["vt 0.5 0.25", "vn 0 0 1"] * 7]
        tails = {"rgb": colors, "w": np.ones((12, 1))}.get(kind, np.ones((12, 0)))
        texts += ["v" + space + space.join(write(float(x)) for x in row) for row in np.c_[points, tails]]
        backslash = number % 7 == 0
        texts += FREE_FORM * (number % 5 == 0) + ["# C:\\models\\"] * backslash
        base, polygon = 1 if not negative else -12, number % 3 == 0
        for i, face in enumerate([*FACES, *([range(7, 12)] if polygon else CUT)]):
            texts += ["usemtl " + "ab"[i % 2]] if kind == "mtl" else []
            words = [form.format(v=v + base, t=v % 7 + (1 if not negative else -7)) for v in face]
            texts += ["f " + words[0] + " \\", " ".join(words[1:])] if number % 11 == 0 else ["f" + space + space.join(words)]
        path = folder / f"{number}.obj"
        path.write_bytes((end.join(texts) + end).encode())
        of_face = np.array([[[0.2, 0.4, 0.6], [1, 0, 0]][(min(i, 8) if polygon else i) % 2] for i in range(11)])[:, None].repeat(3, axis=1)
        meant = Meant(points[faces], {"rgb": colors[faces], "mtl": of_face}.get(kind))
        tags = {f"form {form}", f"negative {negative}", kind, f"end {end!r}", f"space {space!r}"}
        yield path, meant, tags | {f"backslash {backslash}", f"polygon {polygon}"}


FILES = {"gltf": gltf_files, "ply": ply_files, "stl": stl_files, "obj": obj_files}
