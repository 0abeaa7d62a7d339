"""Volumes: the smallest, the largest, every voxel type's extremes, scalars far from zero."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drawing import raycast_volume, render_vdi
from extreme_scenes import (
    BOUND,
    FIELD,
    WINDOW,
    check_scene,
    check_views,
    field_volume,
    transfer,
    turned,
    view,
)

from pyvista_vdi import Shading, reference
from pyvista_vdi.device import Runtime
from pyvista_vdi.errors import DeviceMemoryError, InvalidVolumeError
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.float32_limits import scalars_suit_float32
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.volume import upload
from pyvista_vdi.volume.light_tables import GRADIENT_SHARE

pytestmark = pytest.mark.extremes


def check(runtime, worst, volume, function, views=(0, 90), **options):
    camera = view(volume)
    return check_scene(
        runtime, worst, volume, function, camera, turned(camera, volume, views), **options
    )


@pytest.mark.parametrize(
    "shape", [(2, 2, 2), (2, 9, 9), (9, 2, 9), (9, 9, 2), (2, 2, 300)], ids=str
)
def test_the_smallest_volumes(runtime, worst, shape):
    """One cell, one cell thick along each axis, a row of cells."""
    field = np.random.default_rng(shape).random(shape).astype(np.float32)
    volume = Volume(field)
    camera = view(volume, zoom=True)
    views = turned(camera, volume, (0, 8), zoom=True)
    check_scene(runtime, worst, volume, transfer(), camera, views)


@pytest.mark.parametrize("shape", [(1, 5, 5), (5, 1, 5), (5, 5, 1), (1, 1, 9), (1, 1, 1)], ids=str)
def test_one_plane_of_points_is_refused(shape):
    with pytest.raises(InvalidVolumeError, match="at least two points along each axis"):
        Volume(np.zeros(shape, np.uint8))


@pytest.mark.parametrize("interpolation", ["nearest", "linear"])
@pytest.mark.parametrize("kind", ["constant", "checkerboard"])
def test_constant_and_checkerboard(runtime, worst, kind, interpolation):
    array = np.full((5, 6, 7), 0.6)
    if kind == "checkerboard":  # Nyquist: neighbours differ by the whole range
        array = np.indices(FIELD.shape).sum(axis=0) % 2
    volume = Volume(array.astype(np.float32))
    check(runtime, worst, volume, transfer(interpolation=interpolation))


SCALARS = {
    "int16 negative": ((FIELD - 1) * 30000, "int16", -30000, -100),
    "int16 full range": ((FIELD - 0.5) * 65535, "int16", -32768, 32767),
    "uint16 full range": (FIELD * 65535, "uint16", 0, 65535),
    "int8": ((FIELD - 0.5) * 255, "int8", -128, 127),
    "int32 full range": ((FIELD - 0.5) * 4.2e9, "int32", -(2**31), 2**31 - 1),
    "uint32 full range": (FIELD * 4.2e9, "uint32", 0, 2**32 - 1),
    "uint16 narrow": (60000 + FIELD * 100, "uint16", 60000, 60100),
    "uint16 between values": (60000 + FIELD * 100, "uint16", 60000.3, 60002.7),
    "float32 smallest": (FIELD * 1e-40, "float32", 0, 1e-40),
    "float32 one denormal": (FIELD * 1.4e-44, "float32", 0, 1.4e-44),
    "float32 small": (FIELD * 1e-30, "float32", 0, 1e-30),
    "float32 largest": (FIELD * 3e38, "float32", 0, 3e38),
    "float32 both ends": ((FIELD - 0.5) * 6.7e38, "float32", -3.35e38, 3.35e38),
    "float32 far from zero": (1e5 + FIELD, "float32", 1e5, 1e5 + 1),
    "float32 a Kelvin": (300 + FIELD * 0.02, "float32", 300.001, 300.019),
    "float64 far from zero": (1e9 + FIELD, "float64", 1e9, 1e9 + 1),
    "float64 smallest": (FIELD * 1e-300, "float64", 0, 1e-300),
    "float64 largest": (FIELD * 1e300, "float64", 0, 1e300),
}


@pytest.mark.every(4)
@pytest.mark.parametrize("name", SCALARS)
def test_scalars(runtime, worst, name):
    """Every type's whole range, and ranges that float32 has few digits for."""
    values, dtype, low, high = SCALARS[name]
    volume = Volume(np.round(values).astype(dtype) if dtype[0] in "ui" else values.astype(dtype))
    check(runtime, worst, volume, transfer(low, high))


@pytest.mark.every(4)
@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("interpolation", ["nearest", "linear"])
@pytest.mark.parametrize(
    "value", [np.nan, np.inf, -np.inf, -3.4e38, 3.4e38, 1e300, -1e300], ids=str
)
def test_voxels_that_are_not_numbers_or_no_data(runtime, worst, value, interpolation, dtype):
    """NaN is transparent, infinite is the end of the table; and so is what marks missing data."""
    if abs(value) == 1e300 and dtype == "float32":
        pytest.skip("float32 holds no 1e300")
    array = FIELD.astype(dtype)
    # Few, so that linear sampling, where NaN spreads to its cells, leaves something
    array[2:4, 3:5, 5:7] = value
    volume = Volume(array)
    function = transfer(interpolation=interpolation)
    camera = view(volume)
    if np.isinf(value) and interpolation == "linear":
        # Between a finite and an infinite voxel there is no value; either way it is finite colour
        assert np.isfinite(raycast_volume(volume, camera, WINDOW, function, device=runtime)).all()
        vdi = generate_vdi(volume, camera, WINDOW, function, device=runtime)
        assert np.isfinite(render_vdi(vdi, camera.azimuth(90), device=runtime)).all()
        return
    check(runtime, worst, volume, function)


@pytest.mark.parametrize("dtype", ["float32", "float64", "uint8", "int32"])
@pytest.mark.parametrize("at", [0.1, 0.0, 7.0])
def test_a_range_of_one_scalar(runtime, worst, at, dtype):
    """At or below it the first entry holds, above it the last: also where float32 rounds it."""
    array = np.array([np.nextafter(np.float32(at), -9), at, np.nextafter(np.float32(at), 9)])
    if np.dtype(dtype).kind != "f":
        array = np.array([0, 5, 9])
    cube = np.broadcast_to(array[:, None, None], (3, 3, 3)).astype(dtype)
    function = TransferFunction(
        [[1, 0, 0], [0, 1, 0]], [0.2, 0.6], (at, at), unit_distance=1.0, interpolation="nearest"
    )
    check(runtime, worst, Volume(cube), function)


@pytest.mark.every(6)
@pytest.mark.parametrize("dtype", ["float32", "float64", "int32"])
@pytest.mark.parametrize("look", ["plain", "gradient", "shaded"])
@pytest.mark.parametrize("interpolation", ["nearest", "linear"])
def test_gradients_beside_a_range_of_one_scalar(runtime, worst, interpolation, look, dtype):
    """What is above is drawn, and how fast the scalar changes there counts as ever."""
    scale = 1e6 if dtype == "int32" else 1.0
    at = 300001.0 if dtype == "int32" else 0.3  # which neither float32 nor a fifth of it holds
    options = {
        "plain": {},
        "gradient": {
            "gradient_opacities": [0.0, 0.1, 0.8, 1.0],
            "gradient_range": (0.02 * scale, 0.25 * scale),
        },
        "shaded": {"shading": Shading(0.2, 0.6, 0.5, 30.0)},
    }[look]
    volume = Volume((FIELD * scale).astype(dtype))
    function = TransferFunction(
        [[1, 0.2, 0], [0, 1, 0.5]],
        [0.0, 0.4],
        (at, at),
        unit_distance=1.0,
        interpolation=interpolation,
        **options,
    )
    check(runtime, worst, volume, function)


@pytest.mark.parametrize(("factor", "suits"), [(0.999, True), (1.001, False)])
@pytest.mark.parametrize(("interpolation", "most"), [("linear", 64), ("nearest", 576)])
def test_scalars_at_the_border_of_being_taken_relative(
    runtime, worst, interpolation, most, factor, suits
):
    """As they are, or relative to the range on the host: within the bound on both sides."""
    high = most * factor
    low = high - 1.0
    assert scalars_suit_float32(low, high, np.float32, interpolation) is suits
    volume = Volume((low + FIELD).astype(np.float32))
    function = transfer(low, high, interpolation=interpolation)
    check(runtime, worst, volume, function)


@pytest.mark.slow
@pytest.mark.parametrize("planes", [2**11 + 8, 2**12 + 8], ids=["over 2^31", "over 2^32"])
@pytest.mark.parametrize("interpolation", ["nearest", "linear"])
def test_very_many_voxels(runtime, worst, planes, interpolation):
    """Addresses beyond 31 and 32 bits: what is there must be seen, and nothing else."""
    array = np.zeros((planes, 1024, 1024), np.uint8)
    array[-2:, 400:600, 400:600] = 200
    volume = Volume(array)
    function = TransferFunction(
        [[0.2, 0.5, 0.8]] * 2, [0, 0.6], (0, 200), unit_distance=2.0, interpolation=interpolation
    )
    centre = np.array([500.3, 500.2, planes - 1.5])
    camera = Camera(centre + np.array([900, 700, 3000]), centre, (0, 1, 0), view_angle=4)
    try:
        image = raycast_volume(volume, camera, WINDOW, function, device=runtime)
    except DeviceMemoryError as error:
        pytest.skip(str(error))
    # The same corner alone, with the planes before it left out
    start = planes - 8
    part = Volume(volume.array[start:], origin=(0, 0, start))
    exact = reference.volume_image(part, camera, WINDOW, function)
    assert exact[..., 3].max() > 0.3
    error = np.abs(image - exact).max()
    worst(f"{planes} planes", error)
    # A grid coordinate is rounded by half a unit in its last place, 2^-24 of `planes` of a voxel,
    # and in one voxel the opacity changes by up to a half
    assert error <= max(BOUND, 2.0**-24 * planes / 2)
    vdi = generate_vdi(volume, camera, WINDOW, function, device=runtime)
    check_views(runtime, worst, vdi, [camera, camera.azimuth(3)])
    # Two voxels of medium up to 4096 from where depths are counted
    seen = render_vdi(vdi, camera, device=runtime)
    worst(f"{planes} planes, VDI at V_O", np.abs(seen - image).max())
    assert np.abs(seen - image).max() <= BOUND


def test_what_one_allocation_does_not_hold_goes_brick_by_brick(runtime, monkeypatch):
    rng = np.random.default_rng(5)
    volume = Volume(rng.integers(0, 256, (96, 96, 300), np.uint8))
    camera, function = view(volume), transfer(0, 255)
    image = raycast_volume(volume, camera, WINDOW, function, device=runtime)
    vdi = generate_vdi(volume, camera, WINDOW, function, device=runtime)
    same = Volume(volume.array)  # nothing of it is on the device
    monkeypatch.setattr(runtime, "info", replace(runtime.info, max_allocation=2**21))
    assert volume.array.nbytes > 2**21
    assert np.array_equal(raycast_volume(same, camera, WINDOW, function, device=runtime), image)
    assert generate_vdi(same, camera, WINDOW, function, device=runtime).equals(vdi)


@pytest.mark.slow
def test_more_than_2_31_voxels_that_the_host_never_holds(runtime, worst, monkeypatch, tmp_path):
    """From a file, mostly a hole, of which bricks alone are in memory."""
    start, planes = 1017, 1025
    array = np.memmap(tmp_path / "voxels", np.uint8, "w+", shape=(planes, 1024, 2048))
    array[-3:, 400:600, 1400:1600] = 200
    # The same corner alone, with the planes before it left out
    volume, part = Volume(array), Volume(np.array(array[start:]), origin=(0, 0, start))
    assert array.size > 2**31
    function = transfer(0, 200, unit_distance=2.0)
    centre = np.array([1500.3, 500.2, planes - 2.5])
    camera = Camera(centre + np.array([900, 700, 3000]), centre, (0, 1, 0), view_angle=4)
    options = {"sample_distance": 1.0, "memory_limit": "100 MiB", "device": runtime}
    held, launch = [before := runtime.allocated], Runtime.launch

    def noted(self, *arguments, **how):
        held.append(self.allocated)
        launch(self, *arguments, **how)

    monkeypatch.setattr(Runtime, "launch", noted)
    image = raycast_volume(volume, camera, WINDOW, function, **options)
    vdi = generate_vdi(volume, camera, WINDOW, function, **options)
    assert max(held) - before <= 100 * 2**20
    exact = reference.volume_image(part, camera, WINDOW, function, 1.0)
    assert exact[..., 3].max() > 0.3
    error = np.abs(image - exact).max()
    worst("brick by brick", error)
    # A coordinate from 1024 to 2048 is rounded twice, as the form's value and as the sum at t, by
    # half a unit in the last place, 2^-24 of 1024, each; a channel changes by less than 1 a voxel
    assert error <= max(BOUND, 2.0**-24 * max(volume.dimensions))
    seen = render_vdi(vdi, camera, device=runtime)
    assert np.abs(seen - image).max() <= BOUND


def test_gradients_see_scalars_taken_relative(runtime, worst):
    """Gradient opacity in scalars, where voxels are scaled because they are far from zero."""
    volume = Volume((1e4 + FIELD).astype(np.float32))
    function = transfer(
        1e4,
        1e4 + 1,
        gradient_opacities=[0.0, 0.2, 0.9],
        gradient_range=(0.0, GRADIENT_SHARE),
    )
    check(runtime, worst, volume, function)


def test_a_volume_beyond_float32_is_found_once(runtime, monkeypatch):
    volume = Volume(((FIELD - 0.5) * 6e38).astype(np.float32))
    function = transfer(-3e38, 3e38)
    assert not upload.reads_natively(runtime, volume, function, None)
    monkeypatch.setattr(upload, "upload_voxels", None)
    assert not upload.reads_natively(runtime, volume, function, None)
    assert not upload.uploads_of(field_volume()).too_large
