"""The public functions: what they take, what they refuse, and how the refusal reads."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi import api
from pyvista_vdi.errors import (
    InvalidArgumentError,
    InvalidCameraError,
    InvalidVDIError,
    InvalidVolumeError,
    MissingDependencyError,
    NoDeviceError,
    UnsupportedError,
)
from pyvista_vdi.model import classification
from pyvista_vdi.model.inputs import as_volume
from pyvista_vdi.model.standard_cases import filling_camera

SIZE = (24, 16)


def small_volume(**options):
    z, y, x = np.mgrid[:9, :8, :7]
    return pvdi.Volume((x * y + z).astype(np.float32), (1.0, 1.0, 0.5), **options)


def ramp(volume, **options):
    shades = np.linspace(0, 1, 16)
    colors = np.stack([shades, shades**2, 1 - shades], axis=1)
    return pvdi.TransferFunction(colors, shades * 0.7, volume.finite_range(), **options)


@pytest.fixture(scope="module")
def volume():
    return small_volume()


@pytest.fixture(scope="module")
def camera(volume):
    return filling_camera(volume.bounds, SIZE)


def test_a_volume_becomes_a_vdi_a_file_and_a_picture(volume, camera, default_runtime, tmp_path):
    table = ramp(volume)
    heard = []
    vdi = api.generate(
        volume, camera, SIZE, transfer_function=table, max_supersegments=64, progress=heard.append
    )
    assert vdi.window_size == SIZE
    assert heard[-1] == 1
    assert vdi.metadata["scalars"] == "values"
    read = api.read(vdi.save(tmp_path / "a.vdi"))
    assert read.equals(vdi)
    image = api.render(read, camera)
    direct = api.render_volume(volume, camera, SIZE, transfer_function=table)
    assert image.shape == direct.shape == (SIZE[1], SIZE[0], 4)
    assert image.dtype == direct.dtype == np.float32
    assert direct.max() > 0.1
    # Unlimited lists, same step, same rays: only merging and float32 differ (issue 2: 2/255)
    assert np.abs(image - direct).max() < 2 / 255
    assert api.render(vdi, camera, (12, 8)).shape == (8, 12, 4)


def test_vtk_objects_give_the_same_as_ours(volume, camera, default_runtime):
    pv = pytest.importorskip("pyvista")
    from pyvista_vdi.plotting.classify import Looks
    from pyvista_vdi.vtk_pipeline import vdi_to_image

    grid = pv.ImageData(dimensions=volume.dimensions, spacing=volume.spacing)
    grid["values"] = volume.array.ravel()
    view = pv.Camera()
    view.position, view.focal_point, view.up = camera.position, camera.focal_point, (0, 0, 1)
    view.view_angle = camera.view_angle
    arguments = {"cmap": "viridis", "opacity": "sigmoid_5", "clim": (0, 40)}
    ours = api.generate(volume, camera, SIZE, **arguments)
    theirs = api.generate(grid, view, SIZE, **arguments)
    assert theirs.equals(ours)
    assert ours.metadata["classification"]["cmap"] == "viridis"
    picture = api.render_volume(grid, view, SIZE, **arguments)
    assert np.array_equal(picture, api.render_volume(volume, camera, SIZE, **arguments))
    # The VTK form of a VDI is rendered
    assert np.array_equal(api.render(vdi_to_image(ours), camera), api.render(ours, camera))
    # A volume property stands in place of arguments
    looks = Looks(cmap="viridis", opacity="sigmoid_5", clim=(0, 40))
    table = looks.lookup_table(volume.array)
    prop = looks.volume_property(table, volume.default_unit_distance)
    assert isinstance(prop, pv.VolumeProperty)
    assert np.array_equal(picture, api.render_volume(volume, camera, SIZE, volume_property=prop))


def test_scalars_of_a_volume_are_its_own(volume):
    assert as_volume(volume, "values") is volume
    with pytest.raises(InvalidVolumeError, match="its only one is 'values'; of other values make"):
        as_volume(volume, np.arange(volume.array.size))


def test_estimate_says_bytes(volume):
    needed = api.estimate(volume, (640, 480), max_supersegments=10)
    assert needed.volume == volume.array.nbytes
    assert needed.vdi_worst_case >= 640 * 480 * 10 * 24
    assert needed.total == needed.volume + needed.vdi_worst_case + needed.working
    # More of a ray is recorded before it is cut, and four rows are made at least
    merged, cut = (
        api.estimate(volume, (8192, 8), settings=pvdi.Settings(criterion=name))
        for name in ("least-error", "homogeneity")
    )
    assert cut.working > 2 * merged.working
    assert cut.vdi_worst_case == merged.vdi_worst_case
    # Scalars that are taken relative to their range are floats
    counts = pvdi.Volume((60000 + np.arange(504).reshape(7, 8, 9) % 90).astype(np.uint16))
    for clim, nbytes in ((None, 4 * 504), ((0, 60100), 2 * 504)):
        assert api.estimate(counts, (64, 48), clim=clim).volume == nbytes
    with pytest.raises(InvalidArgumentError, match="criterion must be .*; got 'depth'"):
        api.estimate(volume, (640, 480), settings=pvdi.Settings(criterion="depth"))
    with pytest.raises(TypeError, match="color_map"):
        api.estimate(volume, (64, 48), color_map="bone")


def test_the_engine_works_without_vtk_and_pyvista(default_runtime):
    code = """
import sys
sys.modules.update(dict.fromkeys(("cvista", "pyvista", "vtk", "vtkmodules", "matplotlib")))
import numpy as np, pyvista_vdi as pvdi
volume = pvdi.Volume(np.arange(60.0).reshape(3, 4, 5))
camera = pvdi.Camera((2, 2, 20), (2, 2, 1), (0, 1, 0))
table = pvdi.TransferFunction([(0, 0, 0), (1, 1, 1)], [0, 1], (0, 60))
vdi = pvdi.generate(volume, camera, (8, 8), transfer_function=table)
assert pvdi.render(vdi, camera).max() > 0
"""
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(
    ("name", "suggestion"),
    [
        ("colormap", "did you mean 'cmap'"),
        ("rng", "did you mean 'clim'"),
        ("opcity", "did you mean 'opacity'"),
        ("max_supersegment", "did you mean 'max_supersegments'"),
        ("qqqq", "known are volume, camera"),
    ],
)
def test_an_unknown_keyword_is_a_type_error(name, suggestion, volume, camera):
    message = rf"generate\(\) got an unexpected .*{name!r}: {suggestion}"
    with pytest.raises(TypeError, match=message):
        api.generate(volume, camera, SIZE, **{name: 1})


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"blending": "mip"}, InvalidArgumentError, "one of composite, maximum, .* got 'mip'"),
        ({"interpolation": "cubic"}, InvalidArgumentError, "must be 'nearest' or 'linear'"),
        ({"preference": "row"}, InvalidArgumentError, "preference must be 'point' or 'cell'"),
        ({"transfer_function": "bone"}, InvalidArgumentError, "must be a pyvista_vdi.TransferF"),
        ({"volume_property": 3, "transfer_function": 4}, InvalidArgumentError, "both given"),
        ({"volume_property": 3, "cmap": "bone"}, InvalidArgumentError, "in place of cmap: leave"),
        (
            {"transfer_function": 4, "clim": (0, 1), "opacity": "geom"},
            InvalidArgumentError,
            "transfer_function stands in place of clim, opacity: leave out either",
        ),
        ({"scalars": "density"}, InvalidVolumeError, "no array 'density': its only one is 'value"),
        ({"scalars": [1, 2]}, InvalidVolumeError, "one value per point, 504; got 2"),
    ],
)
@pytest.mark.parametrize("function", [api.generate, api.render_volume])
def test_arguments_that_are_refused_by_name(function, arguments, error, message, volume, camera):
    with pytest.raises(error, match=message):
        function(volume, camera, SIZE, **arguments)


@pytest.mark.parametrize("blending", ["maximum", "minimum", "average", "additive"])
def test_a_vdi_composites(blending, volume, camera):
    with pytest.raises(UnsupportedError, match=f"'{blending}' is not .* by .*render_volume"):
        api.generate(volume, camera, SIZE, blending=blending)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"cmap": "viridys"}, "cmap='viridys'.*did you mean 'viridis'"),
        ({"opacity": "sigmoid_99x"}, "opacity='sigmoid_99x'"),
        ({"clim": (2, 1)}, "clim must be two finite numbers, the smaller first"),
        ({"n_colors": 0}, "n_colors must be a whole number from 1 to 16384; got 0"),
        # Found by fuzzing: errors and warnings of NumPy and VTK came out
        ({"n_colors": 2**31}, "n_colors must be a whole number from 1 to 16384; got 2147483648"),
        ({"opacity": [7]}, "an opacity array beyond 0 to 1 is stretched .* got 7 to 7"),
        ({"opacity": [-1e308, 1e308]}, "stretched to that range, .* different values"),
        ({"clim": 10**400}, "clim must be two finite numbers"),
        ({"opacity_unit_distance": "x"}, "opacity_unit_distance must be a positive .* got 'x'"),
        ({"shade": True, "specular_power": "x"}, "specular_power must be a finite number; got 'x'"),
        ({"shade": True, "ambient": []}, r"ambient must be a finite number; got \[\]"),
    ],
)
def test_names_and_values_that_add_volume_would_not_take(arguments, message, volume, camera):
    pytest.importorskip("pyvista")
    with pytest.raises(InvalidArgumentError, match=message):
        api.generate(volume, camera, SIZE, **arguments)


def test_names_need_the_plot_extra(volume, camera, monkeypatch):
    monkeypatch.setattr(classification, "find_spec", lambda name: None)
    message = r'not installed: install it by pip install "pyvista-vdi\[plot\]", or pass transfer_fu'
    with pytest.raises(MissingDependencyError, match=message):
        api.generate(volume, camera, SIZE, cmap="bone")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (np.zeros((4, 4, 4)), r"got a NumPy array of shape \(4, 4, 4\).*pyvista_vdi.Volume\(array"),
        ("knee.nrrd", "knee.nrrd does not exist: check the volume's path"),
        (None, "got NoneType"),
    ],
)
def test_what_is_no_volume(given, message, camera):
    for function, arguments in (
        (api.generate, (camera, SIZE)),
        (api.render_volume, (camera, SIZE)),
        (api.estimate, (SIZE,)),
    ):
        with pytest.raises(InvalidVolumeError, match=message):
            function(given, *arguments)


def test_what_is_no_vdi(camera):
    pv = pytest.importorskip("pyvista")
    for given, message in (
        ("knee.vdi", r"got the path 'knee.vdi': read it by pyvista_vdi.read\(path\)"),
        (None, "expected a VDI or its VTK form"),
        (pv.ImageData(dimensions=(2, 2, 1)), "is not a VDI"),
    ):
        with pytest.raises(InvalidVDIError, match=message):
            api.render(given, camera)


@pytest.mark.parametrize("name", ["cmap", "rng", "transfer_function"])
def test_a_vdi_of_colours_takes_no_look(name, camera):
    vdi = pvdi.VDI(camera, (1, 1), [0, 0], [], [], np.empty((0, 3)), [], (0, 1, 0, 1, 0, 1))
    for function, arguments in ((api.render, ()), (api.render_depth, ()), (api.pick, ((0, 0),))):
        with pytest.raises(TypeError, match=f"{name!r}: this VDI's colours are fixed: .*deferred"):
            function(vdi, camera, *arguments, **{name: "bone"})


def test_volumes_without_something_to_render(camera):
    pv = pytest.importorskip("pyvista")
    plane = pv.ImageData(dimensions=(4, 4, 1))
    plane["a"] = np.zeros(16)
    for grid, message in (
        (pv.ImageData(dimensions=(0, 0, 0)), "the volume is empty"),
        (pv.ImageData(dimensions=(4, 4, 4)), "the volume has no scalars"),
        (plane, "only one plane of points"),
        (pvdi.Volume(np.full((3, 3, 3), np.nan)), "every value"),
    ):
        with pytest.raises(InvalidVolumeError, match=message):
            api.generate(grid, camera, SIZE, cmap="bone")
    with pytest.raises(UnsupportedError, match="not a uniform grid.*voxelise it"):
        api.generate(pv.Sphere(), camera, SIZE)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"max_supersegments": 4097}, "max_supersegments must be .* 1 to 4096; got 4097"),
        ({"window_size": (0, 16)}, "between 1 and 65536 pixels along each edge; got 0 x 16"),
        ({"window_size": 7}, "two whole numbers of pixels"),
    ],
)
def test_settings_that_are_refused(change, message, volume, camera, default_runtime):
    """All that the engine refuses: test_engine_errors.py."""
    asked = {"window_size": SIZE, **change}
    with pytest.raises(InvalidArgumentError, match=message):
        api.estimate(volume, **asked)
    functions = [api.generate]
    if "window_size" in change:
        functions.append(api.render_volume)
    for function in functions:
        with pytest.raises(InvalidArgumentError, match=message):
            function(volume, camera, transfer_function=ramp(volume), **asked)


def test_cameras_and_devices_that_are_none(volume, camera, default_runtime):
    with pytest.raises(InvalidCameraError, match="position and focal point are the same point"):
        api.generate(volume, pvdi.Camera((1, 2, 3), (1, 2, 3), (0, 0, 1)), SIZE)
    for none in ("xyz", (1, 2), ((1, 2, 3), (1, 2, 4))):
        with pytest.raises(InvalidCameraError, match="expected a pyvista_vdi.Camera, a vtkCamera"):
            api.generate(volume, none, SIZE)
    with pytest.raises(NoDeviceError, match="no such device|no .*device") as caught:
        api.generate(volume, camera, SIZE, transfer_function=ramp(volume), device="no such device")
    assert default_runtime.info.name in str(caught.value)  # the message lists what exists
