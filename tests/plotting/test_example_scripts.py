"""Example scripts write a picture with something in it, and the gallery's the one that is shown."""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from skimage.io import imread

EXAMPLES = Path(__file__).parents[2] / "examples"

CHECKOUT = Path(os.environ.get("PYVISTA_VDI_CHECKOUT") or Path(__file__).resolve().parents[2])
GALLERY = CHECKOUT / "docs" / "gallery"

#: Scripts of the gallery that are run with every change; the others take as long, or longer.
QUICK = ("ct_pins",)

pytestmark = pytest.mark.gl
documented = pytest.mark.skipif(
    not GALLERY.is_dir(),
    reason="no documentation at hand: set PYVISTA_VDI_CHECKOUT to a checkout",
)


#: Arguments of each; those without are to choose the file's name.
ARGUMENTS = {
    "files.py": ["picture.png"],
    "large_volume.py": ["picture.png"],
    "pipeline.py": ["picture.png"],
    "plotter.py": [],
    "series.py": [],
    "sets.py": [],
    "side_by_side.py": [],
    "web_page.py": ["page.html"],
}

#: Those that serve, which write no picture: tests/extensions/web/test_server.py runs them.
SERVING = ["serve.py"]
#: Those for several processes: tests/extensions/insitu/test_mpi.py runs them.
PARALLEL = ["insitu.py"]
#: Needs a screen and Qt.
WINDOWED = ["qt_window.py"]


def test_every_example_is_run_here():
    found = sorted(path.name for path in EXAMPLES.glob("*.py"))
    assert found == sorted([*ARGUMENTS, *SERVING, *PARALLEL, *WINDOWED])


def run_example(name, folder):
    """Run an example off-screen; what it printed, and the file that it wrote."""
    arguments = ARGUMENTS[name]
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / name), *arguments],
        env={**os.environ, "PYVISTA_OFF_SCREEN": "true"},
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
    )
    assert done.returncode == 0, done.stderr
    assert "VDIWarning" not in done.stderr
    suffix = ".gif" if name in ("series.py", "sets.py", "side_by_side.py") else ".png"
    suffix = Path(arguments[0]).suffix if arguments else suffix
    target = folder / (arguments[0] if arguments else Path(name).with_suffix(suffix))
    assert list(folder.glob(f"*{suffix}")) == [target]
    assert target.name in done.stdout
    return done.stdout, target


@pytest.mark.parametrize(
    "name",
    [
        "plotter.py",
        "pipeline.py",
        pytest.param("files.py", marks=pytest.mark.slow),
        pytest.param("large_volume.py", marks=pytest.mark.slow),
    ],
)
def test_example_writes_a_picture(name, tmp_path):
    said, target = run_example(name, tmp_path)
    assert "supersegments" in said
    image = imread(target)[..., :3]
    assert image.shape == (480, 640, 3)
    assert np.ptp(image.reshape(-1, 3).astype(int), axis=0).max() > 100


def gif(path):
    """The frames of a movie, and their size."""
    with Image.open(path) as movie:
        frames = []
        for k in range(movie.n_frames):
            movie.seek(k)
            frames.append(np.asarray(movie.convert("RGB")).astype(int))
        return frames, movie.size


@pytest.mark.slow
def test_side_by_side_example_writes_an_animation_of_both(tmp_path):
    said, target = run_example("side_by_side.py", tmp_path)
    assert "add_volume" in said
    frames, size = gif(target)
    assert size == (800, 300)
    for half in (slice(400), slice(400, None)):
        assert np.abs(frames[-1][40:, half] - frames[0][40:, half]).mean() > 2, "it has not turned"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "told", "size", "count"),
    [
        ("series.py", "series.vdis: 12 steps", (480, 360), 12),
        ("sets.py", "sets.vdiset: 32 VDIs", (200, 150), 24),
    ],
)
def test_example_writes_a_movie(name, told, size, count, tmp_path):
    said, target = run_example(name, tmp_path)
    assert told in said
    frames, found = gif(target)
    assert (found, len(frames)) == (size, count)
    assert np.abs(frames[count // 2] - frames[0]).mean() > 2


def test_a_page_is_written(tmp_path):
    """It opens again in there; tests/extensions/web look at such pages in a browser."""
    printed, target = run_example("web_page.py", tmp_path)
    assert "supersegments" in printed
    assert b"<vdi-viewer" in target.read_bytes()


def scripts():
    """Name each script of the gallery, most of them for the nightly run."""
    for script in sorted(GALLERY.glob("*.py")):
        marks = () if script.stem in QUICK else pytest.mark.slow
        yield pytest.param(script.stem, marks=marks)


@documented
@pytest.mark.parametrize("name", [*scripts()])
def test_a_script_of_the_gallery_writes_its_picture(name, tmp_path, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(GALLERY / f"{name}.py"))
    assert [file.name for file in tmp_path.iterdir()] == [f"{name}.png"]
    shown = CHECKOUT / "docs" / "images" / f"gallery-{name}.jpg"
    stored = BytesIO()  # as docs/make_gallery.py does
    Image.open(tmp_path / f"{name}.png").convert("RGB").save(stored, "jpeg", quality=85)
    written, kept = (np.asarray(Image.open(file), dtype=float) for file in (stored, shown))
    assert written.shape == kept.shape
    # The same where it was made; fonts, drivers and devices differ in few pixels
    assert np.abs(written - kept).mean() < 1
