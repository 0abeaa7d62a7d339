"""Shading, gradient opacity and RGBA at the extremes of worlds and of scalars."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from drawing import raycast_volume
from extreme_scenes import BOUND, FIELD, check_scene, field_volume, transfer, turned, view

from pyvista_vdi import Light, Lights, Shading, reference
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.volume import Volume

pytestmark = pytest.mark.extremes

SHINY = Shading(0.2, 0.6, 0.5, 30.0)
LOOKS = {
    "shaded": {"shading": SHINY},
    "gradient": {"gradient_opacities": [0.0, 0.1, 0.8, 1.0], "gradient_range": (0.02, 0.25)},
}
LOOKS["both"] = {**LOOKS["shaded"], **LOOKS["gradient"]}


def scaled_look(look, scale):
    """The same look of scalars that are ``scale`` times as large."""
    options = dict(LOOKS[look])
    if "gradient_range" in options:
        options["gradient_range"] = tuple(scale * end for end in options["gradient_range"])
    return options


def lamps(volume):
    """A spotlight, a camera light and a scene light at the volume's own scale."""
    centre = np.reshape(volume.bounds, (3, 2)).mean(axis=1)
    reach = volume.length
    return Lights(
        (
            Light(
                "scene",
                centre + reach * np.array([1, 2, 3]),
                centre,
                positional=True,
                cone_angle=60,
                attenuation=(1, 0.1 / reach, 0.01 / reach**2),
                diffuse=(0.5, 0.4, 0.3),
            ),
            Light("camera", (1, 0.5, 0.2), (0, 0, 0), diffuse=(0.3, 0.5, 0.2)),
            Light("scene", centre + reach, centre, diffuse=(0.2, 0.2, 0.4)),
        )
    )


def check(runtime, worst, volume, function, lights=None, **options):
    camera = view(volume, zoom=options.pop("zoom", False))
    views = turned(camera, volume, (0, 8))
    check_scene(runtime, worst, volume, function, camera, views, lights=lights, **options)


@pytest.mark.every(4)
@pytest.mark.parametrize(
    ("lit_by", "look"), [*(("headlight", look) for look in LOOKS), ("lamps", "both")]
)
@pytest.mark.parametrize(
    ("spacing", "offset"),
    [(1e-9, 1e7), (1e9, 1e7), ((1, 1, 1000), 0), ((1000, 1, 1), 0), ((1, 0.001, 1), 0)],
    ids=["tiny", "huge", "along z", "along x", "plate"],
)
def test_worlds(runtime, worst, spacing, offset, lit_by, look):
    """Normals are transformed as normals: those of a needle or of a plate, too.

    A highlight or a table of gradient opacities changes by half in a voxel, and rays enter some
    thousand voxels from where they are formed.
    """
    volume, even = field_volume(spacing, offset), np.ndim(spacing) == 0
    function = transfer(unit_distance=np.min(spacing) * (1 if even else 5), **LOOKS[look])
    lights = lamps(volume) if lit_by == "lamps" else None
    least_drawn = 3 if even else 1
    check(runtime, worst, volume, function, lights, zoom=not even, least_drawn=least_drawn)


@pytest.mark.every(2)
@pytest.mark.parametrize("look", LOOKS)
@pytest.mark.parametrize("scale", [1e-40, 1e-24, 1e-20, 1e20, 3e38])
def test_gradients_from_denormal_to_huge(runtime, worst, scale, look):
    """Gradients whose squares float32 does not hold: densities in kg/m3, or counts of atoms."""
    volume = Volume((FIELD * scale).astype(np.float32))
    function = transfer(0, scale, **scaled_look(look, scale))
    check(runtime, worst, volume, function, lamps(volume))


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
    check(runtime, worst, volume, transfer(shading=SHINY), Lights((bulb,)))


@pytest.mark.every(4)
@pytest.mark.parametrize("look", ["plain", *LOOKS])
def test_rgba(runtime, worst, look):
    colors = [FIELD, 1 - FIELD, np.roll(FIELD, 3), FIELD]
    rgba = np.round(np.stack(colors, axis=-1) * 255).astype(np.uint8)
    own = field_volume(1e-9, 1e7)
    volume = Volume(rgba, own.spacing, own.origin)
    options = {} if look == "plain" else scaled_look(look, 255)
    check(runtime, worst, volume, transfer(0, 255, unit_distance=1e-9, **options))


def test_rgba_of_one_opacity(runtime, worst):
    """A table over a single scalar, or over less than one: colours stay the bytes that they are."""
    rgba = np.full((4, 4, 4, 4), 200, np.uint8)
    rgba[..., 0] = np.arange(64).reshape(4, 4, 4) * 4
    for low, high in ((199.0, 199.0), (199.9, 200.1)):
        function = transfer(low, high, unit_distance=2.0)
        check(runtime, worst, Volume(rgba), function)


@pytest.mark.parametrize("power", [0.0, 1e-3, 1e6])
def test_specular_powers(runtime, worst, power):
    """From a highlight everywhere to one that hardly a sample is in."""
    check(runtime, worst, field_volume(), transfer(shading=Shading(0.1, 0.5, 1.0, power)))


@pytest.mark.every(2)
@pytest.mark.parametrize("lit_by", ["headlight", "lamp", "back lamp"])
@pytest.mark.parametrize("power", [99.0, 101.0, 1e4, 1e6])
def test_the_middle_of_a_highlight(runtime, worst, power, lit_by):
    """A ramp seen along its gradient, and nothing but its highlight, from the middle to its rim."""
    ramp = np.broadcast_to(np.linspace(0.2, 1, 9)[:, None, None], (9, 4, 5))
    volume = Volume(ramp.astype(np.float32))
    centre = np.reshape(volume.bounds, (3, 2)).mean(axis=1)
    eye = centre - [0, 0, 20]  # before the thin side, where VTK's normals look away
    # The rim, where a thousandth is left, is half way to the window's edge
    angle = 2 * np.degrees(np.arccos(np.exp(np.log(1e-3) / power)))
    camera = Camera(eye, centre, (0, 1, 0), view_angle=float(angle))
    lights = None
    if lit_by != "headlight":
        light = Light(
            "scene", eye if lit_by == "lamp" else centre * 2 - eye, centre, positional=True
        )
        lights = Lights((light,), two_sided=lit_by == "back lamp")
    function = transfer(opacity=0.9, shading=Shading(0.0, 0.0, 1.0, power))
    scene = (volume, camera, (9, 7), function)
    exact = reference.volume_image(*scene, None, lights)
    image = raycast_volume(*scene, lights=lights, device=runtime)
    assert exact[..., 0].max() > 0.3
    assert exact[..., 0].min() < 0.2
    off = np.abs(image - exact).max()
    worst(f"power {power:g}", off)
    assert off <= BOUND


@pytest.mark.parametrize(
    ("parallel", "two_sided"), list(itertools.product([False, True], repeat=2))
)
def test_an_eye_in_the_shaded_volume(runtime, worst, parallel, two_sided):
    volume = field_volume()
    centre = np.reshape(volume.bounds, (3, 2)).mean(axis=1)
    camera = Camera(
        centre, centre + np.array([0, 0.1, 1]), (0, 1, 0), view_angle=90,
        parallel_projection=parallel, parallel_scale=4.0,
    )  # fmt: skip
    function = transfer(shading=SHINY)
    lights = Lights(two_sided=two_sided)
    check_scene(
        runtime, worst, volume, function, camera, [camera, camera.azimuth(20)], lights=lights
    )
