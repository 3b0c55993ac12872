"""Pictures of meshes, and meshes from pictures."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

import softras


def test_a_view_shows_all_of_a_mesh_and_is_saved(tmp_path):
    picture = softras.view(softras.shapes.fish(), size=(96, 64))
    assert picture.shape == (64, 96, 4) and picture.dtype == np.uint8
    alpha = picture[..., 3]
    # Nothing touches the border, and the mesh fills the picture.
    assert alpha[0].max() == alpha[-1].max() == alpha[:, 0].max() == alpha[:, -1].max() == 0
    assert (alpha.max(0) > 0).mean() > 0.8 and (alpha == 255).mean() > 0.2
    picture.save(tmp_path / "fish.png")
    assert (tmp_path / "fish.png").read_bytes() == picture._repr_png_()
    with pytest.raises(softras.errors.InputError, match="gif"):
        softras.view(softras.shapes.cube(), size=16, turntable=3).save(tmp_path / "turn.png")


def test_a_mesh_file_is_seen_as_its_mesh_and_turns(tmp_path):
    softras.shapes.fish().save(tmp_path / "fish.obj")
    mesh = softras.load(tmp_path / "fish.obj")
    seen = softras.view(tmp_path / "fish.obj", size=np.int64(48), background=[1, 1, 1])
    assert np.array_equal(seen, softras.view(mesh, size=48, background=[1, 1, 1]))
    assert (seen[..., 3] == 255).all() and (seen[0, 0] == 255).all()
    turn = softras.view(mesh, size=32, turntable=4)
    assert turn.shape == (4, 32, 32, 4) and not np.array_equal(turn[0], turn[2])
    turn.save(tmp_path / "turn.gif")
    assert (tmp_path / "turn.gif").read_bytes()[:6] == b"GIF89a"


def ball_from(count, size):
    """Pictures of an orange ball and their cameras: distance, elevation and azimuth."""
    ball = softras.shapes.icosphere(3).with_look(colors=[1.0, 0.5, 0.1])
    places = [(3.0, 40.0 * (-1) ** i, 360.0 * i / count) for i in range(count)]
    cameras = [softras.Camera.from_angles(*place, fov_y=np.radians(50.0)) for place in places]
    frame = softras.render(ball, cameras, softras.Settings(width=size, height=size, sigma=1e-6, near=1.0, far=6.0))
    return frame, cameras, places


def test_a_folder_of_pictures_becomes_a_mesh(tmp_path):
    frame, cameras, places = ball_from(6, 48)
    alpha = (255 * np.asarray(frame.silhouette)).astype(np.uint8)
    for i, (distance, elevation, azimuth) in enumerate(places):
        pixels = np.full((48, 48, 4), (255, 188, 89, 0), np.uint8)
        pixels[..., 3] = alpha[i]
        pixels.view(softras.Picture).save(tmp_path / f"{i}.png")
    entry = ["file", "distance", "elevation", "azimuth", "fov"]
    listed = [dict(zip(entry, (f"{i}.png", *place, 50.0))) for i, place in enumerate(places)]
    (tmp_path / "cameras.json").write_text(json.dumps(listed))

    views = softras.load_views(tmp_path)
    assert len(views.cameras) == 6 and views.silhouette.shape == (6, 48, 48) and views.color.shape == (6, 48, 48, 3)
    assert np.abs(views.silhouette - frame.silhouette).max() < 0.01
    steps = []
    fitted = views.fit(color=True, steps=12, progress=lambda step, loss: steps.append((step, loss)))
    # Before the first step it is called as well.
    assert steps[0][0] == 0 and np.isnan(steps[0][1])
    steps = [pair for pair in steps if pair[0]]
    assert [step for step, _ in steps] == list(range(1, 13))
    assert np.allclose([loss for _, loss in steps], fitted.losses["loss"])
    assert fitted.measures["held_out"].tolist() == [] and fitted.measures["held_out_mask_iou"] is None
    judged = views.fit(steps=2, hold_out=2, keep_cameras=True, report=tmp_path / "report.html").measures
    assert (tmp_path / "report.html").read_text().count("<figure>") == 6
    assert judged["held_out"].tolist() == [1, 3]
    assert judged["held_out_mask_iou"] == pytest.approx(judged["mask_iou"][[1, 3]].mean())
    assert fitted.measures["mask_iou"].min() > 0.9 and fitted.measures["parts"] == 1 and fitted.measures["genus"] == 0
    assert softras.iou(fitted.mesh, softras.shapes.icosphere(3)) > 0.85
    fitted.mesh.save(tmp_path / "ball.glb")
    assert len(softras.load(tmp_path / "ball.glb").triangles) == len(fitted.mesh.triangles)


@pytest.fixture
def folder(tmp_path):
    """A folder of pictures of a ball."""
    frame, _, places = ball_from(6, 48)
    (tmp_path / "views").mkdir()
    entries = []
    for i, place in enumerate(places):
        pixels = np.full((48, 48, 4), (255, 188, 89, 0), np.uint8)
        pixels[..., 3] = 255 * frame.silhouette[i]
        pixels.view(softras.Picture).save(tmp_path / "views" / f"{i}.png")
        entries.append({"file": f"{i}.png", **dict(zip(("distance", "elevation", "azimuth"), place)), "fov": 50.0})
    (tmp_path / "views" / "cameras.json").write_text(json.dumps(entries))
    return tmp_path / "views"


@pytest.mark.parametrize("options", [["--color"], ["--texture", "--texture-size=256"]], ids=str)
def test_a_fit_is_that_of_the_command_to_the_bit(folder, tmp_path, options):
    command = os.environ.get("SOFTRAS_COMMAND")
    if not command:
        pytest.skip("SOFTRAS_COMMAND names no command: test.sh builds one")
    target = tmp_path / "command.obj"
    call = [command, "fit", "--views", folder, *options, "--iterations", "8", "-o", target]
    done = subprocess.run(call, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    given = {"texture": 256} if "--texture" in options else {"color": True}
    found = softras.fit(softras.load_views(folder), steps=8, **given)
    found.mesh.save(tmp_path / "python.obj")
    theirs, ours = softras.load(target), softras.load(tmp_path / "python.obj")
    np.testing.assert_array_equal(ours.positions, theirs.positions)
    np.testing.assert_array_equal(ours.triangles, theirs.triangles)
    if theirs.textures:
        np.testing.assert_array_equal(ours.textures[0], theirs.textures[0])
    else:
        np.testing.assert_array_equal(ours.colors, theirs.colors)


def test_the_readers_notes_are_warnings(folder):
    frame = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]]
    bent = {"fl_x": 50, "w": 48, "h": 48, "k1": 0.01, "frames": [{"file_path": "0.png", "transform_matrix": frame}]}
    (folder / "cameras.json").unlink()
    (folder / "transforms.json").write_text(json.dumps(bent))
    with pytest.warns(UserWarning, match="distortion is removed"):
        assert len(softras.load_views(folder).cameras) == 1


def test_progress_true_draws_a_bar(folder, capsys, monkeypatch):
    views = softras.load_views(folder)
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    with pytest.raises(softras.errors.InputError, match="pip install tqdm"):
        softras.fit(views, steps=2, progress=True)
    monkeypatch.undo()
    pytest.importorskip("tqdm", reason="tqdm is not installed: test.sh --with tqdm adds it")
    softras.fit(views, steps=2, progress=True)
    assert "2/2" in capsys.readouterr().err
    with pytest.raises(softras.errors.InputError, match="cameras"):
        softras.fit(views, views.cameras)


def test_a_picture_is_saved_as_linear_light(tmp_path):
    picture = np.full((2, 3, 4), (188, 0, 255, 128), np.uint8).view(softras.Picture)
    picture.save(tmp_path / "light.exr")
    with pytest.raises(softras.errors.InputError, match="a picture of float64"):
        (picture / 255).save(tmp_path / "dark.png")
    content = (tmp_path / "light.exr").read_bytes()
    assert content[:4] == b"\x76\x2f\x31\x01"
    assert all(name + b"\0\x02\0\0\0" in content for name in (b"A", b"B", b"G", b"R"))


def test_what_does_not_fit_together_is_refused(tmp_path):
    frame, cameras, _ = ball_from(2, 16)
    with pytest.raises(softras.errors.FitError, match="cameras"):
        softras.Views(cameras[:1], silhouette=frame.silhouette).fit(steps=1)
    with pytest.raises(softras.errors.FitError, match="image"):
        softras.Views(cameras).fit(steps=1)
    with pytest.raises(softras.errors.InputError, match="begin"):
        softras.Views(cameras, silhouette=frame.silhouette).fit(begin="cube")
    with pytest.raises(softras.errors.FileError, match="cameras.json"):
        softras.load_views(tmp_path)
