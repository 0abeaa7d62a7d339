"""The plugin in a real ParaView: ``pvpython`` off-screen, judged from outside.

Needs ParaView, and an environment for it that tools/install_paraview.sh has made, in the folder
that PYVISTA_VDI_PARAVIEW names. PYVISTA_VDI_REQUIRE_PARAVIEW=1 makes their absence a failure.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from virtual_screen import virtual_screen

import pyvista_vdi as pvdi
from pyvista_vdi import examples
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.vtk_pipeline.vtk import (
    vtkColorTransferFunction,
    vtkPiecewiseFunction,
    vtkVolumeProperty,
)

pytestmark = pytest.mark.paraview

#: The folder that tools/install_paraview.sh has filled.
FOLDER_VARIABLE = "PYVISTA_VDI_PARAVIEW"
REQUIRED = os.environ.get("PYVISTA_VDI_REQUIRE_PARAVIEW") == "1"

#: ParaView's Python is not the tests': its NumPy and its libraries for sine and cosine are others,
#: so a view that is turned differs in its last digits. A pixel whose ray then falls on the other
#: side of a border is another one; 0.1 % of the pixels may be.
ROUNDING = 1e-5
SHARE_OF_BORDER_PIXELS = 1e-3

#: An opacity and a colour in eight bits each, their product in eight bits: 1.5 / 255 at most.
BLENDED = 2 / 255


def _missing():
    if shutil.which("pvpython") is None:
        return "pvpython (ParaView) is not installed: see tools/README.md"
    if shutil.which("Xvfb") is None:
        return "Xvfb is not installed, by which ParaView draws: Debian's package 'xvfb'"
    named = os.environ.get(FOLDER_VARIABLE)
    if not named:
        return f"{FOLDER_VARIABLE} names no folder made by tools/install_paraview.sh"
    if not Path(named, "bin", "pyvista-vdi").is_file():
        return f"{FOLDER_VARIABLE}={named} holds no pyvista-vdi: see tools/install_paraview.sh"
    return None


@pytest.fixture(scope="module")
def paraview():
    """Run a case of inside.py in a fresh pvpython; return what it said."""
    reason = _missing()
    if reason is not None:
        (pytest.fail if REQUIRED else pytest.skip)(reason)
    command = Path(os.environ[FOLDER_VARIABLE]).resolve() / "bin" / "pyvista-vdi"
    # To the letter what docs/guide_paraview.md says
    line = f'eval "$({command} paraview --environment)"; exec pvpython "$@"'
    left_out = ("PYTHONPATH", "VTK_DEFAULT_OPENGL_WINDOW", "WAYLAND_DISPLAY")
    environment = {k: v for k, v in os.environ.items() if k not in left_out}
    inside = Path(__file__).with_name("inside.py")

    with virtual_screen() as display:

        def run(case, folder, *more):
            arguments = ["--force-offscreen-rendering", inside, case, folder, *more]
            done = subprocess.run(
                ["sh", "-c", line, "sh", *arguments],
                env={**environment, "DISPLAY": display},
                cwd=folder,
                capture_output=True,
                text=True,
                timeout=600,
                check=False,
            )
            said = done.stdout + done.stderr
            assert done.returncode == 0, said
            assert "all well" in done.stdout, said
            for trouble in ("Traceback", "ERR|", "WARN|"):
                assert trouble not in said
            return done.stderr

        yield run


@pytest.fixture(scope="module")
def made(paraview, tmp_path_factory):
    """The folder with what ParaView made in the case ``pipeline``, and its settings."""
    folder = tmp_path_factory.mktemp("paraview")
    assert paraview("pipeline", folder).strip() == ""
    return folder, json.loads((folder / "scene.json").read_text())


def screenshot(path):
    return np.asarray(Image.open(path).convert("RGB")) / 255.0


def assert_pixels_alike(found, expected):
    apart = np.abs(found - expected).max(axis=2)
    assert (apart > ROUNDING).mean() <= SHARE_OF_BORDER_PIXELS


def pixels(path, size):
    return np.load(path).reshape(size[1], size[0], 4)[::-1]


def over_black(image):
    return np.clip(image[..., :3], 0, 1)


def volume_property(colors, opacities, unit_distance):
    color, opacity, prop = vtkColorTransferFunction(), vtkPiecewiseFunction(), vtkVolumeProperty()
    for node in np.reshape(colors, (-1, 4)):
        color.AddRGBPoint(*node)
    for node in opacities:
        opacity.AddPoint(*node)
    prop.SetColor(color)
    prop.SetScalarOpacity(opacity)
    prop.SetScalarOpacityUnitDistance(unit_distance)
    prop.SetInterpolationTypeToLinear()
    return prop


def test_vdi_is_what_generate_makes(made, default_runtime):
    folder, scene = made
    found = pvdi.read(folder / "brain.vdi")
    whole, step = examples.load_brain(as_volume=True), scene["step"]
    volume = pvdi.Volume(np.ascontiguousarray(whole.array[::step, ::step, ::step]), (step,) * 3)
    camera = filling_camera(found.bounds, scene["size"])
    assert found.window_size == tuple(scene["size"])
    np.testing.assert_allclose(found.camera.position, camera.position, rtol=1e-12)
    nodes = np.reshape(scene["opacities"], (-1, 4))
    looks = volume_property(scene["colors"], nodes, scene["unit distance"])
    expected = pvdi.generate(volume, found.camera, scene["size"], volume_property=looks)
    np.testing.assert_array_equal(found.offsets, expected.offsets)
    # The matrices' last digits differ between the two Pythons. Measured: 2.4e-7 of a depth, two of
    # its steps; by that the samples move, and the colours by 2.5e-5, the optical depths by 3e-6
    for name in ("front", "back"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=1e-6)
    for name in ("color", "optical_depth"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(expected, name), rtol=0, atol=1e-4, err_msg=name
        )
    assert found.metadata["scalars"] == "ImageScalars"


def test_files_keep_every_bit(made):
    folder, _ = made
    first = pvdi.read(folder / "brain.vdi")
    assert first.n_supersegments > 10_000
    assert pvdi.read(folder / "again.vdi").equals(first)
    assert pvdi.read(folder / "small.vdi").equals(first.with_precision("8-byte"))
    assert (folder / "small.vdi").stat().st_size < 0.5 * (folder / "brain.vdi").stat().st_size


def test_picture_is_what_render_returns(made, default_runtime):
    folder, scene = made
    vdi = pvdi.read(folder / "brain.vdi")
    expected = pvdi.render(vdi, vdi.camera.azimuth(scene["azimuth"]))
    found = pixels(folder / "pixels.npy", scene["size"])
    assert expected[..., 3].max() > 0.9
    assert_pixels_alike(found, expected)
    shown = screenshot(folder / "picture.png")
    assert np.abs(shown - over_black(found)).max() <= BLENDED
    assert compare_images(shown, over_black(expected)).ssim > 0.999


def test_states_come_back(made, paraview):
    folder, scene = made
    state = "state.pvsm"
    assert paraview("load", folder, state).strip() == ""
    before = pixels(folder / "pixels.npy", scene["size"])
    np.testing.assert_array_equal(pixels(folder / f"{state}.npy", scene["size"]), before)
    np.testing.assert_array_equal(
        screenshot(folder / f"{state}.png"), screenshot(folder / "picture.png")
    )


def test_vdi_looks_like_paraviews_own_volume(paraview, tmp_path):
    """One view, one pair of transfer functions: TakeActiveView, and VTK's GPU mapper as judge."""
    paraview("volume", tmp_path)
    judge, found = screenshot(tmp_path / "volume.png"), screenshot(tmp_path / "vdi.png")
    assert judge.max() > 0.5
    # 0.9994 measured; steps of the mapper are its own choice
    assert compare_images(judge, found).ssim > 0.998


def test_mistakes_are_said_and_nothing_breaks(paraview, tmp_path):
    said = paraview("mistakes", tmp_path)
    assert json.loads((tmp_path / "mistakes.json").read_text()) == [0, 30 * 20]
    assert "VDISourceFilter: the camera's position and focal point are the same point" in said
    assert "VDIToImageFilter: this vtkImageData is not a VDI" in said
    assert f"VDIFileReader: {tmp_path}/absent.vdi cannot be read" in said
    assert f"VDIFileWriter: {tmp_path}/no folder/x.vdi cannot be written" in said
    assert "VDISourceFilter: vtkUnstructuredGrid is not a uniform grid" in said
    assert "Resample To Image" in said
    assert len(said.splitlines()) == 5
