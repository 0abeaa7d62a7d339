"""The plugin in a real ParaView: ``pvpython`` off-screen, judged from outside.

Needs ParaView, and an environment for it that tools/install_paraview.sh has made, in the folder
that PYVISTA_VDI_PARAVIEW names. PYVISTA_VDI_REQUIRE_PARAVIEW=1 makes their absence a failure.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from plugin_scenes import soft_ball
from virtual_screen import virtual_screen

import pyvista_vdi as pvdi
from pyvista_vdi import examples
from pyvista_vdi.device.icd import INTEL_LIBRARY
from pyvista_vdi.model.metrics import compare_images, over_background
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

#: Of the views in which series are shown.
SCREEN = (240, 180)

#: An opacity and a colour in eight bits each, their product in eight bits: 1.5 / 255 at most.
BLENDED = 2 / 255

#: SSIM of a VDI in a scene against ParaView's own volume there: measured 0.9998 from the generating
#: view, 0.9967 turned by 10 degrees, 0.89 without either.
LIKE_THE_VOLUME = {"own": 0.998, "turned": 0.99}


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
    line = f'eval "$({command} paraview --environment)"; exec $PROGRAM "$@"'
    left_out = ("PYTHONPATH", "VTK_DEFAULT_OPENGL_WINDOW", "WAYLAND_DISPLAY")
    environment = {k: v for k, v in os.environ.items() if k not in left_out}
    inside = Path(__file__).with_name("inside.py")

    with virtual_screen() as display:

        def run(case, folder, *more, script=inside, program="pvpython", bears=(), times=1):
            arguments = ["--force-offscreen-rendering", script, case, folder, *more]
            done = subprocess.run(
                ["sh", "-c", line, "sh", *arguments],
                env={**environment, "DISPLAY": display, "PROGRAM": program},
                cwd=folder,
                capture_output=True,
                text=True,
                timeout=600,
                check=False,
            )
            said = done.stdout + done.stderr
            assert done.returncode == 0, said
            # Ranks that write at once share lines
            assert done.stdout.count("all well") == times, said
            lines = [line for line in said.splitlines() if not any(text in line for text in bears)]
            for trouble in ("Traceback", "ERR|", "WARN|"):
                assert not any(trouble in line for line in lines), said
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


def ramp():
    return volume_property([0, 0, 0.2, 1, 255, 1, 0.5, 0], [(0, 0), (255, 0.8)], 0.2)


def test_pips_driver_is_found(paraview, tmp_path):
    """ParaView has loaded the system's OpenCL loader, and hwloc has asked it, before Python."""
    site = Path(os.environ[FOLDER_VARIABLE])
    if not (site / "lib" / INTEL_LIBRARY).is_file():
        pytest.skip(f"{site} was made without the extra cpu")
    paraview("devices", tmp_path)
    assert ["Intel(R) OpenCL", True] in json.loads((tmp_path / "devices.json").read_text())


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


@pytest.mark.parametrize("state", ["state.pvsm", pytest.param("state.py", marks=pytest.mark.slow)])
def test_states_come_back(made, paraview, state):
    folder, scene = made
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


@pytest.mark.slow
def test_vdi_in_a_scene_stands_for_paraviews_own_volume(paraview, tmp_path):
    """With a ball half inside it: seen where its outline is visible, and gone with its filter."""
    paraview("scene", tmp_path)
    for name, least in LIKE_THE_VOLUME.items():
        judge, found, without = (
            screenshot(tmp_path / f"{kind}_{name}.png") for kind in ("volume", "scene", "nothing")
        )
        assert compare_images(judge, found).ssim > least
        assert compare_images(judge, without).ssim < 0.95
    assert screenshot(tmp_path / "other.png").max() == 0
    np.testing.assert_array_equal(
        screenshot(tmp_path / "deleted.png"), screenshot(tmp_path / "nothing_turned.png")
    )


@pytest.mark.slow
def test_settings_reach_the_vdi(paraview, tmp_path):
    paraview("settings", tmp_path)
    found = json.loads((tmp_path / "settings.json").read_text())
    assert found["grey by default"]
    assert found["progress"]
    assert found["points before"] == 60 * 40
    assert found["idle"]
    assert found["functions"] == [True, True]
    before, after = found["blue"]
    assert before > 0.1
    assert after == 0.0  # the colour function has no blue any more
    assert found["longest"] == 3
    camera = found["camera"]
    np.testing.assert_allclose(camera["position"], (398, 108, 90), atol=1e-9)
    assert camera["parallel_projection"]
    # Coverage: the window is the bounds', 216 wide and 180 high, at 100 units per 40 pixels,
    # rounded up to the screen's pixels
    assert found["window"] == [88, 72]
    assert camera["parallel_scale"] == pytest.approx(50 * 72 / 40)


def test_a_series_is_one_source_with_time_steps(paraview, tmp_path, default_runtime):
    paraview("series", tmp_path)
    found = json.loads((tmp_path / "series.json").read_text())
    assert found["times"] == [0, 1, 2]
    assert found["times of one"] == []
    assert found["longest"] == [3, 5, 9]
    # Colours are shown as they are, without a table, until somebody wants one
    assert found["shown"] == ["Slice", ["POINTS", "RGBA"], 0]
    assert found["set by hand"] == 1
    for step in range(3):
        vdi = pvdi.read(tmp_path / f"x_{step}.vdi")
        expected = pvdi.render(vdi, vdi.camera.azimuth(30))
        assert_pixels_alike(pixels(tmp_path / f"step_{step}.npy", (60, 40)), expected)


def test_colour_map_editor_acts_on_values(paraview, tmp_path, default_runtime):
    """Of a file, in a scene and as a picture; and of a source, which generates nothing again."""
    looks = [([[0, 0.2, 1], [1, 0.5, 0]], [0.0, 0.8]), ([[1, 1, 1], [0.9, 0, 0.3]], [0.0, 0.3])]
    low, high = 30.0, 220.0
    ball, camera = soft_ball(12), filling_camera((-1, 1, -1, 1, -1, 1), SCREEN)
    kept = pvdi.generate(
        ball, camera, SCREEN, classification="deferred", value_range=(low, high), scalars="v"
    )
    kept.save(tmp_path / "kept.vdi")
    seen_from = camera.azimuth(10)
    asked = {"camera": seen_from.to_dict(), "looks": []}
    for colors, (first, last) in looks:
        points = [low, *colors[0], high, *colors[1]], [low, first, 0.5, 0, high, last, 0.5, 0]
        asked["looks"].append(points)
    (tmp_path / "asked.json").write_text(json.dumps(asked))
    assert paraview("deferred", tmp_path).strip() == ""

    found = json.loads((tmp_path / "found.json").read_text())
    assert found == {"array": ["POINTS", "v"], "range": [low, high], "idle": True}
    assert pvdi.read(tmp_path / "again.vdi").equals(kept)
    brain = pvdi.read(tmp_path / "source.vdi")
    assert brain.value_range == (20, 133)
    for i, (colors, opacities) in enumerate(looks):
        table = pvdi.TransferFunction(colors, opacities, (low, high))
        expected = over_black(pvdi.render(kept, seen_from, SCREEN, transfer_function=table))
        assert_alike(screenshot(tmp_path / f"scene_{i}.png"), expected)
        front = pvdi.render(kept, camera, SCREEN, transfer_function=table)
        assert_pixels_alike(pixels(tmp_path / f"file_{i}.npy", SCREEN), front)
        front = pvdi.render(brain, brain.camera, transfer_function=table)
        assert_pixels_alike(pixels(tmp_path / f"source_{i}.npy", SCREEN), front)
    for name, i in (("first", 0), ("last", 1)):  # from a state, each view by its own colour map
        again = screenshot(tmp_path / f"{name}.png")
        np.testing.assert_array_equal(again, screenshot(tmp_path / f"scene_{i}.png"))


def ball_at(step):
    """A soft ball that moves along x and fades."""
    ball = soft_ball(12)
    ball["v"] = ball["v"] * (1 - 0.2 * step)
    ball.origin = (-1 + 0.4 * step, -1, -1)
    return ball


def save_steps(folder):
    """Save a volume of three time steps, a file each; return them."""
    balls = [ball_at(step) for step in range(3)]
    for step, ball in enumerate(balls):
        ball.origin = balls[0].origin  # ParaView takes it from the first file
        ball.save(folder / f"ball_{step}.vti")
    return balls


def assert_alike(found, expected):
    """Two pictures over black, border pixels and the rounding to bytes apart."""
    assert expected.max() > 0.2
    apart = np.abs(found - expected).max(axis=2)
    assert (apart > BLENDED).mean() <= SHARE_OF_BORDER_PIXELS, apart.max()


@pytest.mark.slow
def test_a_series_plays_with_paraviews_animation(paraview, tmp_path, default_runtime):
    """In a scene, as a picture and in a saved animation: the step nearest to the time."""
    times, camera = (0.5, 1.0, 4.0), filling_camera(ball_at(0).bounds, SCREEN)
    look = {"volume_property": ramp(), "window_size": SCREEN}
    pvdi.generate_series([ball_at(i) for i in range(4)], camera, times=(*times, 5.0), **look).save(
        tmp_path / "more.vdis"
    )
    series = pvdi.read(tmp_path / "more.vdis")[:3]
    series.save(tmp_path / "ball.vdis")
    seen_from = camera.azimuth(10)
    (tmp_path / "camera.json").write_text(json.dumps(seen_from.to_dict()))
    asked = {4.0: 2, 0.5: 0, 2.4: 1, 2.7: 2, 1.0: 1}
    (tmp_path / "times.json").write_text(json.dumps(list(asked)))
    assert paraview("animation", tmp_path).strip() == ""
    found = json.loads((tmp_path / "animation.json").read_text())
    assert found["reader"] == "VDISeriesReader"
    assert found["times"] == found["scene"] == list(times)
    assert found["shown"] == [times[step] for step in asked.values()]
    assert found["reloaded"] == [*times, 5.0]
    expected = [over_black(pvdi.render(vdi, seen_from, SCREEN)) for vdi in series]
    for i, step in enumerate(asked.values()):
        assert_alike(screenshot(tmp_path / f"scene_{i}.png"), expected[step])
        turned = pvdi.render(series[step], camera.azimuth(20), SCREEN)
        assert_pixels_alike(pixels(tmp_path / f"picture_{i}.npy", SCREEN), turned)
    assert_alike(screenshot(tmp_path / "kept_0.png"), expected[0])
    played = sorted(tmp_path.glob("played*.png"))
    assert len(played) == 3
    for path, picture in zip(played, expected, strict=True):
        assert_alike(screenshot(path), picture)


@pytest.mark.slow
def test_vdis_are_made_of_the_time_that_paraview_shows(paraview, tmp_path, default_runtime):
    balls = save_steps(tmp_path)
    assert paraview("temporal", tmp_path).strip() == ""
    assert json.loads((tmp_path / "times.json").read_text()) == [0, 1, 2]
    series, usual = (pvdi.read(tmp_path / name) for name in ("made.vdis", "usual.vdis"))
    assert series.times == usual.times == (0, 1, 2)
    for made, small in zip(series, usual, strict=True):
        assert (made.precision, small.precision) == ("exact", "8-byte")
        assert small.equals(made.with_precision("8-byte"))
    for step, made in enumerate(series):
        expected = pvdi.generate(balls[step], made.camera, SCREEN, volume_property=ramp())
        np.testing.assert_array_equal(made.offsets, expected.offsets)
        np.testing.assert_allclose(made.optical_depth, expected.optical_depth, atol=1e-4)
        picture = over_black(pvdi.render(expected, made.camera, SCREEN))
        assert_alike(screenshot(tmp_path / f"scene_{step}.png"), picture)


def test_mistakes_are_said_and_nothing_breaks(paraview, tmp_path):
    said = paraview("mistakes", tmp_path)
    assert json.loads((tmp_path / "mistakes.json").read_text()) == [0, 30 * 20]
    assert "VDISource: the camera's position and focal point are the same point" in said
    assert "VDIToImage: this vtkImageData is not a VDI" in said
    assert f"VDIReader: {tmp_path}/absent.vdi cannot be read" in said
    assert f"VDIWriter: {tmp_path}/no folder/x.vdi cannot be written" in said
    assert "VDISource: vtkUnstructuredGrid is not a uniform grid" in said
    assert "Resample To Image" in said
    assert len(said.splitlines()) == 5


def test_paraviews_own_python_bears_our_numpy(paraview, tmp_path):
    paraview("arrays", tmp_path)
    found = json.loads((tmp_path / "arrays.json").read_text())
    assert found["from"].startswith(str(Path(os.environ[FOLDER_VARIABLE]).resolve()))
    gradient, copied = found["results"]
    assert 0 < gradient[0] < gradient[1]
    np.testing.assert_allclose(copied, (37.35310363769531, 276.8288269042969), rtol=1e-6)


@pytest.mark.slow
def test_the_guides_script_runs(paraview, tmp_path, default_runtime):
    """What docs/guide_paraview.md shows, to the letter."""
    checkout = Path(os.environ.get("PYVISTA_VDI_CHECKOUT") or Path(__file__).parents[3])
    guide = checkout / "docs" / "guide_paraview.md"
    if not guide.is_file():
        pytest.skip("no checkout at hand: set PYVISTA_VDI_CHECKOUT to one")
    shown = re.search(r"```py\n(.*?)```", guide.read_text(encoding="utf-8"), re.DOTALL)
    (tmp_path / "brain.py").write_text(shown[1] + 'print("all well")\n', encoding="utf-8")
    paraview("guide", tmp_path, script=tmp_path / "brain.py")
    vdi = pvdi.read(tmp_path / "brain.vdi")
    found = screenshot(tmp_path / "brain.png")
    expected = over_background(pvdi.render(vdi, vdi.camera.azimuth(20)), found[0, 0])
    assert (np.abs(found - expected).max(axis=2) > BLENDED).mean() <= SHARE_OF_BORDER_PIXELS
    assert (tmp_path / "brain.pvsm").stat().st_size > 0
