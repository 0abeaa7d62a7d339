"""VDIs drawn in bands of rows, for devices that their lists do not fit."""

from __future__ import annotations

import numpy as np
import pytest
from support.march_ways import VIEWS, WINDOW, transfer_for, volume_of

import pyvista_vdi as pvdi
from pyvista_vdi.errors import DeviceMemoryError
from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.raycasting import bands
from pyvista_vdi.raycasting.raycast import render_vdi

SIZE = (70, 60)


@pytest.fixture(scope="module", params=["all of it", "parallel", "from inside"])
def vdi(request):
    volume = volume_of("uint8")
    camera = VIEWS[request.param](volume)
    return pvdi.generate(volume, camera, WINDOW, transfer_function=transfer_for(volume))


def views(vdi):
    camera = vdi.camera
    yield from (camera.azimuth(angle) for angle in (0, 20, 90, 180))
    yield from (camera.elevation(angle) for angle in (-60, -20, 20, 60))
    yield camera.replace(parallel_projection=True, parallel_scale=45).elevation(30)
    yield pvdi.Camera((24, 20, 23), (24, 60, 23), (0, 0, 1))  # from inside


@pytest.mark.every(3)
@pytest.mark.parametrize("n", [2, 5])
def test_bands_are_the_picture(vdi, n):
    for camera in views(vdi):
        request = FrameRequest(camera, SIZE)
        expected = render_vdi(vdi, request)
        found = bands.render_in_bands(vdi, request, n)
        # A ray on the face between two bands rounds to either: nothing else differs by more than
        # a compositing's rounding
        differ = np.abs(found - expected).max(axis=2) > 1e-5
        assert differ.mean() < 0.002, camera
        assert np.abs(found - expected).mean() < 1e-6, camera


def test_bands_have_all_lists(vdi):
    cuts = [0, 10, 11, WINDOW[1]]
    parts = [bands.band(vdi, a, b) for a, b in zip(cuts, cuts[1:])]  # noqa: B905, RUF007
    assert sum(part.n_supersegments for part in parts) == vdi.n_supersegments
    np.testing.assert_array_equal(np.concatenate([part.front for part in parts]), vdi.front)


def test_what_does_not_fit_is_drawn_in_bands(vdi, monkeypatch):
    expected = pvdi.render(vdi, vdi.camera, SIZE)
    drawn = []

    def small(part, request):
        if part.n_supersegments > vdi.n_supersegments / 3:
            raise DeviceMemoryError("the device is too small")
        drawn.append(part)
        return render_vdi(part, request)

    monkeypatch.setattr(bands, "render_vdi", small)
    found = pvdi.render(vdi, vdi.camera, SIZE)
    assert len(drawn) >= 4
    assert np.abs(found - expected).mean() < 1e-6
    monkeypatch.setattr(bands, "_MOST", 2)
    with pytest.raises(DeviceMemoryError, match="too small"):
        pvdi.render(vdi, vdi.camera, SIZE)
