"""The verbs ``turntable`` and ``movie``: frames are those that ``render`` draws."""

from __future__ import annotations

import json
import subprocess
from importlib.util import find_spec

import numpy as np
import pytest
from command_line import run
from PIL import Image

import pyvista_vdi as pvdi
from pyvista_vdi.io import to_bytes

SIZE = (64, 48)
#: A GIF has 256 colours: what a byte of a smooth picture may differ by (measured: 12).
OF_A_PALETTE = 24

pytestmark = pytest.mark.skipif(find_spec("imageio") is None, reason="needs the extra: movie")
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


def frames(path):
    with Image.open(path) as movie:
        for k in range(movie.n_frames):
            movie.seek(k)
            yield np.asarray(movie.convert("RGB")).astype(int)


def expected(vdi, view):
    return to_bytes(pvdi.render(vdi, view, SIZE), (0, 0, 0)).astype(int)


def test_a_turntable_is_a_turn_of_frames(saved, capsys, tmp_path):
    target = tmp_path / "v.gif"
    said = run(capsys, "turntable", saved, "-o", target, "--frames", 6, "--fps", 10)
    assert "6 frames of 64 x 48 pixels, 0.6 s at 10 a second" in said
    vdi = pvdi.read(saved)
    with Image.open(target) as movie:
        assert (movie.n_frames, movie.info["duration"], movie.info["loop"]) == (6, 100, 0)
    for k, frame in enumerate(frames(target)):
        assert np.abs(frame - expected(vdi, vdi.camera.azimuth(60 * k))).max() <= OF_A_PALETTE
    assert [path.name for path in tmp_path.iterdir()] == ["v.gif"]


def write_views(folder, **views):
    for name, view in views.items():
        (folder / name).write_text(json.dumps(view.to_dict()))
    return [folder / name for name in views]


def test_a_path_passes_its_views(saved, capsys, tmp_path):
    vdi = pvdi.read(saved)
    keys = [vdi.camera, vdi.camera.azimuth(20), vdi.camera.azimuth(40).elevation(20)]
    files = write_views(tmp_path, **dict(zip("abc", keys, strict=True)))
    run(capsys, "movie", saved, "-o", tmp_path / "p.gif", "--frames", 5, "--path", *files)
    found = [*frames(tmp_path / "p.gif")]
    for frame, key in ((0, keys[0]), (2, keys[1]), (4, keys[2])):
        assert np.abs(found[frame] - expected(vdi, key)).max() <= OF_A_PALETTE
    said = run(capsys, "movie", saved, "-o", tmp_path / "p.gif", "--path", files[0], status=1)
    assert "two views or more" in said


@needs_films
def test_a_film_has_its_frames(saved, capsys, tmp_path):
    import imageio_ffmpeg

    target = tmp_path / "v.mp4"
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
