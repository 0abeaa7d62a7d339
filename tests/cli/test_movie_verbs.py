"""The verbs ``turntable`` and ``movie``: frames are those that ``render`` draws."""

from __future__ import annotations

import json
import subprocess
from importlib.util import find_spec

import numpy as np
import pytest
from command_line import run
from PIL import Image, ImageSequence

import pyvista_vdi as pvdi
from pyvista_vdi.cli.movie import camera_path
from pyvista_vdi.io import to_bytes
from pyvista_vdi.model.standard_cases import filling_camera

SIZE = (64, 48)
#: A GIF has 256 colours: what a byte of a smooth picture may differ by (measured: 12).
OF_A_PALETTE = 24

needs_films = pytest.mark.skipif(
    find_spec("imageio_ffmpeg") is None, reason="needs the extra: movie"
)


@pytest.fixture(scope="module")
def volume(tmp_path_factory):
    path = tmp_path_factory.mktemp("volume") / "v.npy"
    z, y, x = np.mgrid[:9, :9, :9] - 4
    np.save(path, (250 * np.exp(-((x - 1) ** 2 + 3 * y**2 + z**2) / 9)).astype(np.uint8))
    return path


@pytest.fixture(scope="module")
def saved(volume, default_runtime):
    path = volume.with_name("v.vdi")
    view = pvdi.Camera((2, -25, 12), (4, 4, 4), (0, 0, 1))
    colors = np.linspace([0, 0, 1], [1, 1, 0], 4)
    table = pvdi.TransferFunction(colors, [0, 0.2, 0.4, 0.6], (0, 250))
    pvdi.generate(pvdi.Volume(np.load(volume)), view, SIZE, transfer_function=table).save(path)
    return path


def expected(vdi, view):
    return to_bytes(pvdi.render(vdi, view, SIZE), (0, 0, 0)).astype(int)


def test_a_turntable_is_a_turn_of_frames(saved, capsys, tmp_path):
    target = tmp_path / "v.gif"
    said = run(capsys, "turntable", saved, "-o", target, "--frames", 6, "--fps", 10)
    assert "6 frames of 64 x 48 pixels, 0.6 s at 10 a second" in said
    assert said.count("views more than 60 degrees") == 1
    vdi = pvdi.read(saved)
    with Image.open(target) as movie:
        assert (movie.n_frames, movie.info["duration"], movie.info["loop"]) == (6, 100, 0)
        for k in range(6):
            movie.seek(k)
            frame = np.asarray(movie.convert("RGB")).astype(int)
            assert np.abs(frame - expected(vdi, vdi.camera.azimuth(60 * k))).max() <= OF_A_PALETTE
    assert [path.name for path in tmp_path.iterdir()] == ["v.gif"]


def test_a_volume_is_drawn_by_volume_rendering(volume, capsys, tmp_path):
    pytest.importorskip("pyvista")
    looks = {"cmap": "bone", "opacity": "linear"}
    options = [f"--{name}={value}" for name, value in looks.items()]
    target = tmp_path / "frame_{}.png"
    run(capsys, "turntable", volume, "-o", target, "--size", "64x48", "--frames", 2, *options)
    read = pvdi.Volume(np.load(volume))
    view = filling_camera(read.bounds, SIZE)
    for k in range(2):
        picture = pvdi.render_volume(read, view.azimuth(180 * k), SIZE, **looks)
        found = np.asarray(Image.open(tmp_path / f"frame_{k}.png"))
        np.testing.assert_array_equal(found, to_bytes(picture, (0, 0, 0)))


@pytest.mark.extension("series")
def test_a_series_plays_and_turns_meanwhile(saved, capsys, tmp_path):
    vdi = pvdi.read(saved)
    steps = [vdi, vdi.with_precision("8-byte"), vdi]
    pvdi.VDISeries(steps, (0.0, 1.0, 2.0)).save(tmp_path / "run.vdis")
    run(capsys, "movie", tmp_path / "run.vdis", "-o", tmp_path / "f_{:02d}.png", "--turn", 30)
    series = pvdi.read(tmp_path / "run.vdis")
    for k in range(3):
        found = np.asarray(Image.open(tmp_path / f"f_{k:02d}.png")).astype(int)
        np.testing.assert_array_equal(found, expected(series[k], vdi.camera.azimuth(15 * k)))


def write_views(folder, **views):
    for name, view in views.items():
        (folder / name).write_text(json.dumps(view.to_dict()))
    return [folder / name for name in views]


def test_a_path_passes_its_views(saved, capsys, tmp_path):
    vdi = pvdi.read(saved)
    keys = [vdi.camera, vdi.camera.azimuth(20), vdi.camera.azimuth(40).elevation(20)]
    files = write_views(tmp_path, **dict(zip("abc", keys, strict=True)))
    run(capsys, "movie", saved, "-o", tmp_path / "p{}.png", "--frames", 5, "--path", *files)
    for frame, key in ((0, keys[0]), (2, keys[1]), (4, keys[2])):
        found = np.asarray(Image.open(tmp_path / f"p{frame}.png")).astype(int)
        # The spline's rounding moves few samples over borders
        assert np.abs(found - expected(vdi, key)).mean() < 0.1


def test_views_of_a_path_go_evenly_about_their_point():
    """Two views a turn apart: the point stays, the distance too, and the angle grows as eased."""
    first = pvdi.Camera((0, -5, 0), (0, 0, 0), (0, 0, 1))
    path = camera_path([first, first.azimuth(90)], np.linspace(0, 1, 9))
    angles = [np.degrees(np.arctan2(view.position[0], -view.position[1])) for view in path]
    assert np.diff(angles).min() > 0
    np.testing.assert_allclose([angles[0], angles[4], angles[8]], [0, 45, 90], atol=1e-6)
    for view in path:
        np.testing.assert_allclose(np.linalg.norm(view.position), 5, rtol=1e-9)
        np.testing.assert_allclose(view.focal_point, 0, atol=1e-12)
        np.testing.assert_allclose(view.axes[1], (0, 0, 1), atol=1e-9)


def test_frames_of_a_gif_last_as_long_as_was_asked_for(saved, capsys, tmp_path):
    """Its times are hundredths of a second: at 30 a second, frames of 3 and of 4 of them."""
    target = tmp_path / "v.gif"
    run(capsys, "turntable", saved, "-o", target, "--frames", 6, "--fps", 30)
    with Image.open(target) as movie:
        frames = ImageSequence.Iterator(movie)
        assert [frame.info["duration"] for frame in frames] == [30, 40, 30, 30, 40, 30]
    # However slow it is, it has one
    run(capsys, "turntable", saved, "-o", tmp_path / "f_{}.png", "--fps", 0.1)
    run(capsys, "turntable", saved, "-o", target, "--fps", 0.1)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["f_0.png", "v.gif"]


@needs_films
def test_frames_of_a_film_are_not_kept(saved, capsys, monkeypatch, tmp_path):
    done = []

    def writer(*_, **__):
        while (yield) is not None:
            done.append("encoded")

    def draw(*arguments, **options):
        done.append("drawn")
        return pvdi.render(*arguments, **options)

    monkeypatch.setattr("pyvista_vdi.cli.movie.render", draw)
    monkeypatch.setattr("imageio_ffmpeg.write_frames", writer)
    arguments = ("movie", saved, "-o", tmp_path / "v.mp4", "--turn", 20, "--frames", 3)
    assert "could not be written" in run(capsys, *arguments, status=1)  # nobody wrote it
    assert done == ["drawn", "encoded"] * 3
    assert not list(tmp_path.iterdir())


@needs_films
@pytest.mark.parametrize("suffix", ["mp4", "webm"])
def test_a_film_has_its_frames(saved, capsys, tmp_path, suffix):
    import imageio_ffmpeg

    target = tmp_path / f"v.{suffix}"
    run(capsys, "movie", saved, "-o", target, "--turn", 20, "--frames", 8, "--size", "65x49")
    ffmpeg = [imageio_ffmpeg.get_ffmpeg_exe(), "-loglevel", "error", "-i", str(target)]
    raw = subprocess.run(
        [*ffmpeg, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"], capture_output=True, check=True
    )
    decoded = np.frombuffer(raw.stdout, np.uint8).reshape(-1, 48, 64, 3)
    assert len(decoded) == 8
    vdi = pvdi.read(saved)
    for found, view in ((decoded[0], vdi.camera), (decoded[-1], vdi.camera.azimuth(20))):
        assert np.abs(found.astype(int) - expected(vdi, view)).mean() < 6  # half the colours


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("turntable v.vdi -o v.avi", "is no moving picture"),
        ("turntable v.vdi -o v.png", "frame_{:04d}.png"),
        ("movie v.vdi -o v.gif", "nothing moves"),
        ("movie v.vdi -o v.gif --path a.json", "two views at least"),
        ("movie v.vdi -o absent/v.gif --turn 9", "absent"),
        ("movie v.vdi -o v.gif --path a b --azimuth 9", "--azimuth is"),
        ("turntable v.vdi -o v.gif --cmap bone", "--cmap bone is for VDIs that keep values"),
        ("turntable v.vdi -o v.gif --fps 0", "above 0"),
        ("turntable v.vdi -o v.gif --fps 60", "0.01 to 50 frames a second"),
    ],
)
def test_mistakes_are_said_before_anything_is_drawn(saved, capsys, monkeypatch, arguments, said):
    monkeypatch.chdir(saved.parent)
    before = sorted(saved.parent.iterdir())
    assert said in run(capsys, *arguments.split(), status=2 if said == "above 0" else 1)
    assert sorted(saved.parent.iterdir()) == before


def test_a_path_has_one_projection(saved, capsys, tmp_path):
    first = pvdi.read(saved).camera
    names = write_views(tmp_path, a=first, b=first.replace(parallel_projection=True))
    said = run(capsys, "movie", saved, "-o", tmp_path / "v.gif", "--path", *names, status=1)
    assert f"{names[0]}: perspective, {names[1]}: parallel" in said
    assert sorted(tmp_path.iterdir()) == sorted(names)


def test_a_movie_that_fails_leaves_what_was_there(saved, capsys, monkeypatch, tmp_path):
    target = tmp_path / "v.gif"
    target.write_bytes(b"what was there")

    def failing(*_, **__):
        raise pvdi.errors.DeviceError("the device is gone")

    monkeypatch.setattr("pyvista_vdi.cli.movie.render", failing)
    assert "gone" in run(capsys, "turntable", saved, "-o", target, "--frames", 3, status=1)
    assert target.read_bytes() == b"what was there"
    assert [path.name for path in tmp_path.iterdir()] == ["v.gif"]
