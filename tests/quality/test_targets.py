"""Targets: what is chosen, what is said of it, and what cannot be asked."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from drawing import request

import pyvista_vdi as pvdi
from pyvista_vdi import TransferFunction, Volume
from pyvista_vdi.errors import InvalidArgumentError, VDIWarning
from pyvista_vdi.generation import generate
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.quality.targets import LADDER, PRESETS, bytes_of, describe, turned
from pyvista_vdi.raycasting.prepared import prepared_vdi

WINDOW = (64, 48)

#: Estimated less true SSIM of such small pictures: seen are 0.006.
CLOSE = 0.015


def ball(points=24):
    axes = np.meshgrid(*[np.linspace(-1, 1, points)] * 3, indexing="ij")
    distance = np.sqrt(sum(np.square(a) for a in axes))
    wave = 1 + 0.3 * np.sin(9 * axes[0]) * np.sin(7 * axes[1])
    return Volume((100 * np.clip(1 - distance, 0, 1) * wave).astype(np.float32))


VOLUME = ball()
TRANSFER = TransferFunction(
    [[1, 0, 0], [1, 1, 0], [0, 1, 1], [1, 1, 1]],
    [0, 0.1, 0.4, 0.8],
    (0, 100),
    unit_distance=2.0,
    interpolation="linear",
)
VIEW = filling_camera(VOLUME.bounds, WINDOW)


def generated(runtime=None, volume=VOLUME, camera=VIEW, window=WINDOW, **arguments):
    return pvdi.generate(
        volume, camera, window, transfer_function=TRANSFER, device=runtime, **arguments
    )


def rung_of(vdi):
    """Which rung a VDI was made by."""
    made = vdi.metadata["dial"]["chosen"]
    window, longest = tuple(made["window_size"]), made["max_supersegments"]
    assert window == vdi.window_size
    asked = [each.applied_to(request(VOLUME, VIEW, WINDOW, TRANSFER)) for each in LADDER]
    settings = [(each.window_size, each.options.max_supersegments) for each in asked]
    return settings.index((window, longest))


@pytest.fixture(scope="module")
def ladder(default_runtime):
    """A VDI of each rung, its true SSIM at 30 degrees and its bytes."""
    view = turned(VIEW, VOLUME.bounds, 30)
    truth = pvdi.render_volume(VOLUME, view, WINDOW, transfer_function=TRANSFER)
    found = []
    for rung in LADDER:
        vdi = generate.generate_vdi(rung.applied_to(request(VOLUME, VIEW, WINDOW, TRANSFER)))
        found.append((compare_images(pvdi.render(vdi, view, WINDOW), truth).ssim, bytes_of(vdi)))
    return found


@pytest.mark.filterwarnings("ignore::pyvista_vdi.errors.VDIWarning")
@pytest.mark.parametrize("goal", [0.5, 0.9, 0.95, 0.97, 0.99])
def test_a_goal_is_reached_by_the_cheapest_rung_or_the_next(default_runtime, ladder, goal):
    vdi = generated(default_runtime, target_ssim=goal)
    rung, dial = rung_of(vdi), vdi.metadata["dial"]
    assert dial["predicted"]["ssim"] == pytest.approx(ladder[rung][0], abs=CLOSE)
    reached = dial["predicted"]["ssim"] >= goal
    assert reached or (rung == len(LADDER) - 1 and "the best settings" in dial["missed"][0])
    below = 2 if goal >= 0.96 else 0  # from there on squares would be seen
    assert all(ssim < goal + CLOSE for ssim, _ in ladder[below : max(below, rung - 1)])


def test_limits_are_kept_and_what_cannot_be_is_said(default_runtime, ladder):
    for rung in (0, 3, 8):
        limit = ladder[rung][1]
        vdi = generated(default_runtime, max_bytes=limit)  # warnings are errors here
        assert rung_of(vdi) in (rung, rung - 1)
        assert prepared_vdi(default_runtime, vdi).list_bytes <= limit
    vdi = generated(default_runtime, quality="fast", max_bytes=1e9)
    assert rung_of(vdi) == PRESETS["fast"][0], "a limit is no wish for more"
    for asked, rung, said in (
        ({"max_bytes": 7}, 0, f"max_bytes=7 cannot be kept: .* {ladder[0][1]} bytes"),
        ({"quality": "high", "max_bytes": ladder[3][1]}, 3, "quality='high' is not .* within max"),
        ({"full_fps": 1e9}, 0, "1e.09 full frames per second cannot .* 64 x 48 pixels"),
    ):
        with pytest.warns(VDIWarning, match=said) as caught:
            vdi = generated(default_runtime, **asked)
        assert rung_of(vdi) == rung
        assert caught[0].filename == __file__
        assert vdi.metadata["dial"]["missed"] == [str(caught[0].message)]
        assert "target missed" in describe(vdi.metadata)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"quality": "best"}, "one of reference, high, balanced and fast; got 'best'"),
        ({"target_ssim": 1.0}, "target_ssim must be an SSIM between 0 and 1; got 1.0"),
        ({"full_fps": math.inf}, "full_fps must be"),
        ({"max_bytes": -1}, "max_bytes must be a whole number of bytes, 1 or above; got -1"),
        ({"quality": "fast", "target_ssim": 0.9}, "each say how good pictures are"),
        ({"quality": "reference", "max_bytes": 10}, "'reference' and max_bytes=10 each say"),
        ({"quality": "fast", "max_supersegments": 7}, "'fast' chooses .* max_supersegments=7"),
        ({"target_ssim": 0.9, "window": (160, 10)}, "160 x 10 pixels has no SSIM"),
    ],
)
def test_what_contradicts_or_is_out_of_range_is_refused(default_runtime, asked, said):
    with pytest.raises(InvalidArgumentError, match=said):
        generated(default_runtime, **asked)


def test_metadata_say_what_was_asked_chosen_and_predicted(default_runtime, tmp_path):
    vdi = generated(default_runtime, target_ssim=0.9, max_bytes=10**7)
    found = vdi.metadata["dial"]
    assert found["asked"] == {"target_ssim": 0.9, "max_bytes": 10**7}
    assert (found["angle"], found["window_size"], found["missed"]) == (30.0, list(WINDOW), [])
    assert found["chosen"]["precision"] == vdi.precision == "8-byte"
    assert found["predicted"]["fps"] > 0
    assert json.loads(json.dumps(found)) == found
    width, height = vdi.window_size
    assert describe(vdi.metadata).startswith(f"chosen {width} x {height} lists of up to")
    again = pvdi.read(vdi.save(tmp_path / "a.vdi"))
    assert again.metadata["dial"] == found
    # It remembers the pictures that it is for, whatever its lists are
    assert again.picture_size == WINDOW != again.window_size
    assert pvdi.render(again, VIEW).shape == (WINDOW[1], WINDOW[0], 4)
