"""How a VDI shows itself."""

from __future__ import annotations

import numpy as np
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi.model.standard_cases import filling_camera

SIZE = (64, 48)


@pytest.fixture(scope="module")
def vdi(default_runtime):
    z, y, x = np.mgrid[:9, :9, :9]
    volume = pvdi.Volume((x * y + z).astype(np.float32))
    shades = np.linspace(0, 1, 16)
    look = pvdi.TransferFunction(np.stack([shades] * 3, axis=1), shades / 2, (0, 72))
    view = filling_camera(volume.bounds, SIZE)
    return pvdi.generate(volume, view, SIZE, transfer_function=look)


@pytest.mark.gl
def test_plot_shows_the_generating_view(vdi):
    pytest.importorskip("pyvista")
    options = {"show_scalar_bar": False, "show_axes": False, "background": "black"}
    right = 255 * pvdi.render(vdi, vdi.camera)[..., :3]
    shown = vdi.plot(off_screen=True, return_img=True, anti_aliasing=False, **options)
    assert np.abs(shown[..., :3] - right).max() <= 0.51  # rounding to 8 bits, and the driver's own
    # Of eight samples, those beside the outline of the bounds count as empty: pixels lack light
    off = vdi.plot(off_screen=True, return_img=True, **options)[..., :3] - right
    assert off.max() <= 0.51
    assert (off < -0.51).any(axis=2).sum() <= 8  # 3 where it was measured, 0 where there is no MSAA
