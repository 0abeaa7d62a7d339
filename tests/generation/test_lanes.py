"""A CPU device marches in blocks of rays: VDIs and pictures are the same, to the last bit.

Kernels of 16 lanes against one, as other devices have them.
"""

from __future__ import annotations

import numpy as np
import pytest
from drawing import generate_vdi
from march_ways import CENTER, VIEWS, WINDOW, both_ways, transfer_for, volume_of
from settings import with_settings

from pyvista_vdi import Light, Shading, render_volume

ENDS = np.random.default_rng(3).uniform(60, 160, WINDOW[::-1]).astype(np.float32)
ENDS[:5] = np.inf
PLANES = {"clipping_planes": [(*CENTER, 1, 0.5, 0.2)]}
CROPPED = {"cropping": ((10, 30, 10, 30, 10, 30), "fence")}
DEPTH, FINE = {"opaque_depth": ENDS}, {"sample_distance": 0.05}
LAMP = {"lights": [Light("scene", (200, 300, 100), CENTER, positional=True, cone_angle=120.0)]}

#: What a look has beside colours and opacities.
PLAIN, GRADIENT = {}, {"gradient_opacities": [0.2, 1, 0.3], "gradient_range": (2, 30)}
SHADED = {"shading": Shading(0.2, 0.7, 0.4, 8.0)}


@pytest.mark.parametrize(
    ("kernel", "dtype", "interpolation", "view", "look", "blanked", "options"),
    [
        ("march_lists", "uint8", "nearest", "all of it", PLAIN, True, FINE),
        ("march_lists", "float32", "linear", "from inside", GRADIENT | SHADED, False, LAMP),
        ("march_lists", "uint8", "nearest", "past it", PLAIN, False, {"memory_limit": 2**22}),
        ("march_lists", "uint8", "nearest", "parallel", PLAIN, False, {"criterion": "homogeneity"}),
        ("shorten_lists", "uint8", "nearest", "along an axis", PLAIN, True, {"tolerance": 0.05}),
        ("shorten_lists", "uint8", "nearest", "parallel", PLAIN, False, {"max_supersegments": 5}),
        ("render_volume", "float32", "linear", "all of it", PLAIN, False, CROPPED | DEPTH),
        ("render_volume", "float32", "linear", "parallel", SHADED | GRADIENT, True, PLANES | LAMP),
        ("render_volume", "float32", "linear", "parallel", PLAIN, False, FINE),
    ],
)  # fmt: skip
def test_blocks_of_rays_give_the_same_bits(
    monkeypatch, runtime, kernel, dtype, interpolation, view, look, blanked, options
):
    volume = volume_of(dtype, spacing=(1, 0.8, 1.3))
    if blanked:  # a third of the octants
        octants = np.random.default_rng(4).integers(0, 256, (2, *volume.array.shape), np.uint8)
        volume.blanked = octants[0] & octants[1]
    function = transfer_for(volume, interpolation, **look)
    arguments = (volume, VIEWS[view](volume), WINDOW)

    def make():
        if kernel in ("march_lists", "shorten_lists"):
            return generate_vdi(*arguments, function, device=runtime, **options)
        shown = with_settings(transfer_function=function, **options)
        return render_volume(*arguments, device=runtime, **shown)

    found, expected, launches = both_ways(monkeypatch, runtime, kernel, make)
    assert launches[0] == launches[1] > 0
    if kernel in ("march_lists", "shorten_lists"):
        assert found.equals(expected)
        assert found.n_supersegments > (100 if view == "past it" else 1000)
    else:
        assert found.tobytes() == expected.tobytes()
        assert found[..., 3].max() > 0.1
