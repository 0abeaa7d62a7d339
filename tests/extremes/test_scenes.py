"""Worlds, actors' matrices, voxels, transfer functions, lights and lenses at their extremes.

Each scene is drawn directly and as a VDI, from some views, all of it held against float64
(tests/support/extreme_scenes.py).
"""

from __future__ import annotations

import numpy as np
import pytest
import reference
from drawing import generate_vdi, raycast_volume, render_vdi
from extreme_scenes import FIELD, WINDOW, check_scene, field_volume, transfer, turned, view

from pyvista_vdi import InvalidCameraError, Light, Lights, Shading, TransferFunction, Volume

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
    "tiny": (1e-9, 1e7),
    "hugest": (1e16, 0.0),
    "needle along x": ((1000, 1, 1), 0.0),
    "plate": ((1, 0.001, 1), 0.0),
}


@pytest.mark.parametrize("world", ["tiny", "hugest", "needle along x", "plate"])
def test_worlds(runtime, worst, world):
    """A plate is a staircase of lists: rays in its plane, at larger angles, may pass between."""
    volume, even = field_volume(*WORLDS[world]), np.ndim(WORLDS[world][0]) == 0
    function = transfer(unit_distance=np.min(volume.spacing) * (1 if even else 5))
    check(runtime, worst, volume, function, (0, 25, 180) if even else (0, 8), zoom=not even)


@pytest.mark.parametrize(
    ("world", "name"),
    [("tiny", "both, lit by lamps"), ("needle along x", "both"), ("plate", "gradient")],
)
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


@pytest.mark.parametrize(("exponent", "by"), [(-25, "spacing"), (36, "matrix")])
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


@pytest.mark.parametrize("shape", [(2, 2, 2), (9, 2, 9), (2, 2, 300)], ids=str)
def test_the_smallest_volumes(runtime, worst, shape):
    """One cell, one cell thick along each axis, a row of cells."""
    volume = Volume(np.random.default_rng(shape).random(shape).astype(np.float32))
    check(runtime, worst, volume, transfer(), (0, 8), zoom=True)


CHECKERS = np.indices(FIELD.shape).sum(axis=0) % 2  # Nyquist: neighbours differ by the whole range

#: Scalars, their type, and the range of the transfer function: every type's whole range, and ranges
#: that float32 has few digits for.
SCALARS = {
    "checkerboard": (CHECKERS, "float32", 0, 1),
    "int16 full range": ((FIELD - 0.5) * 65535, "int16", -32768, 32767),
    "uint32 full range": (FIELD * 4.2e9, "uint32", 0, 2**32 - 1),
    "float32 one denormal": (FIELD * 1.4e-44, "float32", 0, 1.4e-44),
    "float32 both ends": ((FIELD - 0.5) * 6.7e38, "float32", -3.35e38, 3.35e38),
    "float32 a Kelvin": (300 + FIELD * 0.02, "float32", 300.001, 300.019),
    "float64 far from zero": (1e9 + FIELD, "float64", 1e9, 1e9 + 1),
    "float64 largest": (FIELD * 1e300, "float64", 0, 1e300),
}


@pytest.mark.parametrize("name", SCALARS)
def test_scalars(runtime, worst, name):
    values, dtype, low, high = SCALARS[name]
    values = np.round(values) if dtype[0] in "ui" else values
    check(runtime, worst, Volume(values.astype(dtype)), transfer(low, high))


@pytest.mark.parametrize(
    ("value", "dtype", "interpolation"),
    [
        (np.nan, "float32", "linear"),
        (np.inf, "float32", "linear"),
        (-np.inf, "float64", "nearest"),
        (-3.4e38, "float32", "nearest"),
        (1e300, "float64", "linear"),
    ],
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


@pytest.mark.parametrize(("at", "dtype"), [(0.1, "float64"), (0.0, "float32"), (7.0, "int32")])
def test_a_range_of_one_scalar(runtime, worst, at, dtype):
    """At or below it the first entry holds, above it the last: also where float32 rounds it."""
    array = np.array([np.nextafter(np.float32(at), -9), at, np.nextafter(np.float32(at), 9)])
    if dtype == "int32":
        array = np.array([0, 5, 9])
    cube = np.broadcast_to(array[:, None, None], (3, 3, 3)).astype(dtype)
    options = {"unit_distance": 1.0, "interpolation": "nearest"}
    function = TransferFunction([[1, 0, 0], [0, 1, 0]], [0.2, 0.6], (at, at), **options)
    check(runtime, worst, Volume(cube), function)


@pytest.mark.parametrize("name", ["both"])
@pytest.mark.parametrize("scale", [1e-40, 1e-20, 3e38])
def test_gradients_from_denormal_to_huge(runtime, worst, scale, name):
    """Gradients whose squares float32 does not hold: densities in kg/m3, or counts of atoms."""
    volume, function = Volume((FIELD * scale).astype(np.float32)), look(name, scale)
    check(runtime, worst, volume, transfer(0, scale, **function), (0, 8), lit=True)


#: Tables of 33 opacities over 0..1.
TABLES = {
    "one entry": np.where(np.arange(33) == 17, 0.9, 0),
    "step at a bin edge": np.where(np.arange(33) >= 17, 0.7, 0),
    "all zero": np.zeros(33),
}


@pytest.mark.parametrize(
    ("kind", "interpolation"),
    [("one entry", "linear"), ("step at a bin edge", "nearest"), ("all zero", "linear")],
)
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
