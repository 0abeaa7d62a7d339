"""``pvdi.Report()``, and how a VDI shows itself."""

from __future__ import annotations

from importlib import metadata

import numpy as np
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi.device import report
from pyvista_vdi.errors import NoDeviceError
from pyvista_vdi.model.standard_cases import filling_camera

SIZE = (64, 48)


def test_a_report_names_versions_and_devices(default_runtime, monkeypatch):
    said = repr(pvdi.Report())
    assert f"numpy {metadata.version('numpy')}" in said
    assert default_runtime.info.name in said
    assert "<pre>" in pvdi.Report()._repr_html_()

    def none():
        raise NoDeviceError("no device")

    monkeypatch.setattr(report, "describe_devices", none)
    assert "no device" in repr(pvdi.Report())


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
