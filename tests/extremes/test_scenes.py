"""Worlds, actors' matrices, voxels, transfer functions, lights and lenses at their extremes.

Each scene is drawn directly and as a VDI, from some views, all of it held against float64
(tests/support/extreme_scenes.py).
"""

from __future__ import annotations

import math

import numpy as np
import pytest
import reference
from drawing import generate_vdi, raycast_volume, render_vdi
from extreme_scenes import (
    FIELD,
    WINDOW,
    assert_within,
    check_scene,
    field_volume,
    transfer,
    turned,
    view,
)

from pyvista_vdi import (
    Camera,
    InvalidCameraError,
    Light,
    Lights,
    Shading,
    TransferFunction,
    Volume,
)
from pyvista_vdi.model.float32_limits import scalars_suit_float32

pytestmark = pytest.mark.extremes

SHINY = Shading(0.2, 0.6, 0.5, 30.0)
#: Looks of scalars from 0 to 1.
LOOKS = {
    "plain": {},
    "shaded": {"shading": SHINY},
    "gradient": {"gradient_opacities": [0.0, 0.1, 0.8, 1.0], "gradient_range": (0.02, 0.25)},
}
LOOKS["both"] = {**LOOKS["shaded"], **LOOKS["gradient"]}


def look(name, scale=1.0):
    """One of :data:`LOOKS`, of scalars that are ``scale`` times as large."""
    options = dict(LOOKS[name])
    if "gradient_range" in options:
        options["gradient_range"] = tuple(scale * end for end in options["gradient_range"])
    return options


def lamps(volume):
    """A spotlight, a camera light and a scene light at the volume's own scale."""
    centre, reach = np.reshape(volume.bounds, (3, 2)).mean(axis=1), volume.length
    spot = centre + reach * np.array([1, 2, 3])
    fading = {"attenuation": (1, 0.1 / reach, 0.01 / reach**2), "diffuse": (0.5, 0.4, 0.3)}
    return Lights(
        (
            Light("scene", spot, centre, positional=True, cone_angle=60, **fading),
            Light("camera", (1, 0.5, 0.2), (0, 0, 0), diffuse=(0.3, 0.5, 0.2)),
            Light("scene", centre + reach, centre, diffuse=(0.2, 0.2, 0.4)),
        )
    )


def check(runtime, worst, volume, function, turns=(0, 90), *, zoom=False, lit=False, **options):
    """A view that the volume fills; with ``zoom`` the short way across it does."""
    camera = view(volume, transform=options.pop("transform", None), zoom=zoom)
    views = turned(camera, volume, turns, zoom=zoom)
    lights = lamps(volume) if lit is True else lit or None
    check_scene(runtime, worst, volume, function, camera, views, lights=lights, **options)


def scaled(scale, offset=0.0):
    """A world, and an origin so many extents away."""
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = np.array([1, -0.7, 0.3]) * scale * offset
    return matrix


#: Spacing and offset in extents: from a cell in metres to a galaxy in whatever; just within
#: float32; cells a thousand times as long as wide.
WORLDS = {
    "as it is": (1.0, 0.0),
    "tiny": (1e-9, 1e7),
    "huge": (1e9, 1e7),
    "tiniest": (1e-16, 0.0),
    "hugest": (1e16, 0.0),
    "needle along z": ((1, 1, 1000), 0.0),
    "needle along x": ((1000, 1, 1), 0.0),
    "plate": ((1, 0.001, 1), 0.0),
}


@pytest.mark.every(3)
@pytest.mark.parametrize("world", WORLDS)
def test_worlds(runtime, worst, world):
    """A plate is a staircase of lists: rays in its plane, at larger angles, may pass between."""
    volume, even = field_volume(*WORLDS[world]), np.ndim(WORLDS[world][0]) == 0
    function = transfer(unit_distance=np.min(volume.spacing) * (1 if even else 5))
    check(runtime, worst, volume, function, (0, 25, 180) if even else (0, 8), zoom=not even)


@pytest.mark.every(7)
@pytest.mark.parametrize("name", ["shaded", "gradient", "both", "both, lit by lamps"])
@pytest.mark.parametrize("world", ["tiny", "huge", "needle along z", "needle along x", "plate"])
def test_lit_worlds(runtime, worst, world, name):
    """Normals are transformed as normals: those of a needle or of a plate, too.

    A highlight or a table of gradient opacities changes by half in a voxel, and rays enter some
    thousand voxels from where they are formed.
    """
    volume, even = field_volume(*WORLDS[world]), np.ndim(WORLDS[world][0]) == 0
    unit = np.min(volume.spacing) * (1 if even else 5)
    function = transfer(unit_distance=unit, **LOOKS[name.partition(",")[0]])
    drawn = {"zoom": not even, "least_drawn": 3 if even else 1, "lit": "lamps" in name}
    check(runtime, worst, volume, function, (0, 8), **drawn)


MATRICES = {
    "tiny": scaled(1e-9, 1e7),
    "huge": scaled(1e9, 1e7),
    "tiniest": scaled(1e-16),
    "hugest": scaled(1e16),
    "mirrored": np.diag([-1, 1, 1, 1.0]),
    "stretched": np.diag([0.03, 1, 30, 1.0]),
    "sheared": np.array([[1, 5, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]),
    "all of it": np.array([[-0.1, 5, 0, 9], [0, 1, 0.1, 1], [0, 0, 10, -3], [0, 0, 0, 1.0]]),
}


@pytest.mark.parametrize("name", MATRICES)
def test_actors_matrices(runtime, worst, name):
    zoom = name in ("stretched", "sheared", "all of it")
    turns = (0, 8) if zoom else (0, 90)
    check(runtime, worst, field_volume(), transfer(), turns, transform=MATRICES[name], zoom=zoom)


@pytest.mark.parametrize("exponent", [-36, -25, 25, 36])
@pytest.mark.parametrize("by", ["spacing", "matrix"])
def test_worlds_beyond_float32_are_refused(runtime, exponent, by):
    scale = 10.0**exponent
    volume = field_volume(scale if by == "spacing" else 1.0)
    camera = view(volume, transform=scaled(scale) if by == "matrix" else None)
    with pytest.raises(InvalidCameraError, match=r"beyond float32: scale the spacing \(or"):
        generate_vdi(volume, camera, WINDOW, transfer(), device=runtime)
    # A VDI that another program made there is refused, too
    made = reference.build_vdi(volume, camera, WINDOW, transfer())
    with pytest.raises(InvalidCameraError, match="beyond float32"):
        render_vdi(made, camera, device=runtime)


@pytest.mark.parametrize(
    "shape", [(2, 2, 2), (2, 9, 9), (9, 2, 9), (9, 9, 2), (2, 2, 300)], ids=str
)
def test_the_smallest_volumes(runtime, worst, shape):
    """One cell, one cell thick along each axis, a row of cells."""
    volume = Volume(np.random.default_rng(shape).random(shape).astype(np.float32))
    check(runtime, worst, volume, transfer(), (0, 8), zoom=True)


CHECKERS = np.indices(FIELD.shape).sum(axis=0) % 2  # Nyquist: neighbours differ by the whole range

#: Scalars, their type, and the range of the transfer function: every type's whole range, and ranges
#: that float32 has few digits for.
SCALARS = {
    "constant": (np.full((5, 6, 7), 0.6), "float32", 0, 1),
    "checkerboard": (CHECKERS, "float32", 0, 1),
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


@pytest.mark.every(6)
@pytest.mark.parametrize("name", SCALARS)
def test_scalars(runtime, worst, name):
    values, dtype, low, high = SCALARS[name]
    values = np.round(values) if dtype[0] in "ui" else values
    interpolations = ["nearest", "linear"] if dtype == "float32" and high == 1 else ["linear"]
    for interpolation in interpolations:
        function = transfer(low, high, interpolation=interpolation)
        check(runtime, worst, Volume(values.astype(dtype)), function)


@pytest.mark.every(6)
@pytest.mark.parametrize("interpolation", ["nearest", "linear"])
@pytest.mark.parametrize(
    ("value", "dtype"),
    [
        *((value, "float32") for value in (np.nan, np.inf, -np.inf, -3.4e38, 3.4e38)),
        *((value, "float64") for value in (np.nan, -np.inf, 1e300, -1e300)),
    ],
    ids=str,
)
def test_voxels_that_are_not_numbers_or_no_data(runtime, worst, value, interpolation, dtype):
    """NaN is transparent, infinite is the end of the table; and so is what marks missing data."""
    array = FIELD.astype(dtype)
    # Few, so that linear sampling, where NaN spreads to its cells, leaves something
    array[2:4, 3:5, 5:7] = value
    volume, function = Volume(array), transfer(interpolation=interpolation)
    if not (np.isinf(value) and interpolation == "linear"):
        check(runtime, worst, volume, function)
        return
    # Between a finite and an infinite voxel there is no value; either way it is finite colour
    camera = view(volume)
    assert np.isfinite(raycast_volume(volume, camera, WINDOW, function, device=runtime)).all()
    vdi = generate_vdi(volume, camera, WINDOW, function, device=runtime)
    assert np.isfinite(render_vdi(vdi, camera.azimuth(90), device=runtime)).all()


@pytest.mark.every(4)
@pytest.mark.parametrize("dtype", ["float32", "float64", "int32"])
@pytest.mark.parametrize("at", [0.1, 0.0, 7.0])
def test_a_range_of_one_scalar(runtime, worst, at, dtype):
    """At or below it the first entry holds, above it the last: also where float32 rounds it."""
    array = np.array([np.nextafter(np.float32(at), -9), at, np.nextafter(np.float32(at), 9)])
    if dtype == "int32":
        array = np.array([0, 5, 9])
    cube = np.broadcast_to(array[:, None, None], (3, 3, 3)).astype(dtype)
    options = {"unit_distance": 1.0, "interpolation": "nearest"}
    function = TransferFunction([[1, 0, 0], [0, 1, 0]], [0.2, 0.6], (at, at), **options)
    check(runtime, worst, Volume(cube), function)


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
    check(runtime, worst, volume, transfer(low, high, interpolation=interpolation))


@pytest.mark.every(4)
@pytest.mark.parametrize("name", ["shaded", "gradient", "both"])
@pytest.mark.parametrize("scale", [1e-40, 1e-24, 1e-20, 1e20, 3e38])
def test_gradients_from_denormal_to_huge(runtime, worst, scale, name):
    """Gradients whose squares float32 does not hold: densities in kg/m3, or counts of atoms."""
    volume, function = Volume((FIELD * scale).astype(np.float32)), look(name, scale)
    check(runtime, worst, volume, transfer(0, scale, **function), (0, 8), lit=True)


@pytest.mark.every(4)
@pytest.mark.parametrize("name", LOOKS)
def test_rgba(runtime, worst, name):
    colors = [FIELD, 1 - FIELD, np.roll(FIELD, 3), FIELD]
    rgba = np.round(np.stack(colors, axis=-1) * 255).astype(np.uint8)
    own = field_volume(1e-9, 1e7)
    function = transfer(0, 255, unit_distance=1e-9, **look(name, 255))
    check(runtime, worst, Volume(rgba, own.spacing, own.origin), function, (0, 8))


@pytest.mark.parametrize("attenuation", [(0, 0, 1), (0, 0, 1e30), (1e-38, 0, 0)], ids=str)
def test_a_light_inside_the_volume(runtime, worst, attenuation):
    """Strengths from nothing to beyond float32, at a sample's very place."""
    volume = field_volume()
    centre = np.reshape(volume.bounds, (3, 2)).mean(axis=1)
    bulb = Light(
        "scene", centre, centre + 1, positional=True, attenuation=attenuation, cone_angle=180,
        diffuse=(1, 0, 0.5), specular=(0, 1, 0),
    )  # fmt: skip
    # Two-sided: a sample whose normal is across the light jumps from none to all of it
    check(runtime, worst, volume, transfer(shading=SHINY), (0, 8), lit=Lights((bulb,)))


@pytest.mark.every(3)
@pytest.mark.parametrize("lit_by", ["headlight", "lamp", "back lamp"])
@pytest.mark.parametrize("power", [99.0, 101.0, 1e4, 1e6])
def test_the_middle_of_a_highlight(runtime, worst, power, lit_by):
    """A ramp seen along its gradient, and nothing but its highlight, from the middle to its rim."""
    ramp = np.broadcast_to(np.linspace(0.2, 1, 9)[:, None, None], (9, 4, 5))
    volume = Volume(ramp.astype(np.float32))
    centre = np.reshape(volume.bounds, (3, 2)).mean(axis=1)
    eye = centre - [0, 0, 20]  # before the thin side, where VTK's normals look away
    # The rim, where a thousandth is left, is half way to the window's edge
    angle = 2 * math.degrees(math.acos(math.exp(math.log(1e-3) / power)))
    camera = Camera(eye, centre, (0, 1, 0), view_angle=angle)
    lights = None
    if lit_by != "headlight":
        place = eye if lit_by == "lamp" else centre * 2 - eye
        lamp = Light("scene", place, centre, positional=True)
        lights = Lights((lamp,), two_sided=lit_by == "back lamp")
    scene = volume, camera, (9, 7), transfer(opacity=0.9, shading=Shading(0.0, 0.0, 1.0, power))
    exact = reference.volume_image(*scene, None, lights)
    image = raycast_volume(*scene, lights=lights, device=runtime)
    assert exact[..., 0].max() > 0.3
    assert exact[..., 0].min() < 0.2
    assert_within(worst, f"power {power:g}", image, exact)


@pytest.mark.parametrize(("parallel", "two_sided"), [(False, True), (True, False)])
def test_an_eye_in_the_shaded_volume(runtime, worst, parallel, two_sided):
    volume = field_volume()
    centre = np.reshape(volume.bounds, (3, 2)).mean(axis=1)
    camera = Camera(
        centre, centre + np.array([0, 0.1, 1]), (0, 1, 0), view_angle=90,
        parallel_projection=parallel, parallel_scale=4.0,
    )  # fmt: skip
    scene = volume, transfer(shading=SHINY), camera, [camera, camera.azimuth(20)]
    check_scene(runtime, worst, *scene, lights=Lights(two_sided=two_sided))


@pytest.mark.parametrize(
    ("unit", "opacity"),
    [(1e-8, 1e-7), (1e-8, 1.0), (1.0, 1 - 2.0**-24), (1.0, 1e-7), (1e8, 0.5), (1e-4, 0.5)],
)
def test_unit_distance_and_opacity(runtime, worst, unit, opacity):
    """Unit distances per extent, and extinctions with them; opacities from hardly any to all."""
    volume = field_volume()
    function = transfer(unit_distance=unit * volume.length, opacity=opacity)
    # Even what is nearly nothing is there to a few digits: below 2^-25 alpha alone would be 0
    drawn = 0 if opacity / unit < 1e-6 or unit > 1 else 3
    check(runtime, worst, volume, function, (0, 25, 180), least_drawn=drawn)


#: Tables of 33 opacities over 0..1.
TABLES = {
    "one entry": np.where(np.arange(33) == 17, 0.9, 0),
    "step at a bin edge": np.where(np.arange(33) >= 17, 0.7, 0),
    "all zero": np.zeros(33),
    "all one": np.ones(33),
}


@pytest.mark.every(3)
@pytest.mark.parametrize("interpolation", ["nearest", "linear"])
@pytest.mark.parametrize("kind", TABLES)
def test_transfer_functions(runtime, worst, kind, interpolation):
    # Whole multiples of a bin: nearest samples lie exactly on its edges
    field = np.round(FIELD * 32) / 32 if interpolation == "nearest" else FIELD
    volume, shares = Volume(field.astype(np.float32)), np.linspace(0, 1, 33)
    colors = np.stack([shares, 1 - shares, 0.5 + 0 * shares], axis=1)
    options = {"unit_distance": 1.0, "interpolation": interpolation}
    function = TransferFunction(colors, TABLES[kind], (0, 1), **options)
    if kind == "all zero":
        scene = volume, view(volume), WINDOW, function
        assert not raycast_volume(*scene, device=runtime).any()
        assert generate_vdi(*scene, device=runtime).n_supersegments == 0
        return
    check(runtime, worst, volume, function, (0, 25, 180))
