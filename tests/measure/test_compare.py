"""The comparison with VTK's mappers: whole, honest and repeatable, on a volume that is known."""

from __future__ import annotations

import json

import numpy as np
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi import cli, io
from pyvista_vdi.measure.bench import as_json
from pyvista_vdi.measure.compare import NAMES, measure
from pyvista_vdi.model.standard_cases import filling_camera

SIZE = (96, 64)
LOOKS = {"cmap": "viridis", "opacity": "linear", "interpolation": "linear"}


@pytest.fixture(scope="module")
def volume():
    """Smooth, so that two raycasters at different sample positions must still agree."""
    z, y, x = np.mgrid[-1:1:25j, -1:1:31j, -1:1:28j]
    values = (100 * np.exp(-2 * (x**2 + y**2 + z**2)) + 20 * x).astype(np.float32)
    return pvdi.Volume(values, (1.0, 0.9, 1.2), (5.0, -3.0, 2.0), name="density")


@pytest.fixture(scope="module")
def measured(volume, default_runtime):
    pytest.importorskip("pyvista")
    heard = []
    options = {"angles": (0, 20), "repeats": 1, "sample_distance": 0.2, "name": "blob"}
    return (*measure(volume, LOOKS, SIZE, progress=heard.append, **options), heard)


@pytest.mark.gl
def test_the_report_holds_every_figure(measured):
    report, vdi, images, heard = measured
    assert heard == sorted(heard)
    assert heard[-1] == 1
    assert [set(pictures) for pictures in images.values()] == [set(NAMES)] * 2
    at_generating_view, turned = report["views"]
    # At V_O and at the VDI's own size
    assert at_generating_view["near"]["vdi_to_raycaster"]["worst_pixel"] < 2
    assert turned["near"]["vdi_to_raycaster"]["ssim"] > 0.97
    for view in report["views"]:
        # Measured: SSIM 0.9994, PSNR 55 dB; VTK's picture has 8 bits
        assert view["near"]["raycaster_to_gpu"]["ssim"] > 0.999
        assert view["near"]["raycaster_to_gpu"]["psnr"] > 45
        # VTK's fixed-point mapper computes with 15 bits and draws the border differently:
        # it is 0.984 from VTK's own GPU mapper
        assert view["near"]["fixed_point_to_gpu"]["ssim"] > 0.97
        assert set(view["seconds"]) == set(NAMES)
        theirs = min(view["seconds"]["gpu"], view["seconds"]["fixed_point"])
        assert view["ratio_to_vtk"] == view["seconds"]["vdi"] / theirs
    assert report["sizes"]["supersegments"] == vdi.n_supersegments
    assert report["sizes"]["dense_bytes"] == SIZE[0] * SIZE[1] * 20 * 24
    assert report["system"]["OpenGL"]
    assert report["case"]["sample_distance"] == 0.2
    json.dumps(as_json(report), allow_nan=False)


@pytest.mark.gl
def test_the_command_writes_a_table_a_picture_figures_and_the_vdi(
    default_runtime, tmp_path, capsys
):
    """The README's command, small: the shipped brain with a colour map."""
    pytest.importorskip("pyvista")
    out = tmp_path / "new" / "out"
    arguments = ["compare", "--example", "brain", "--out", str(out), "--size", "80x48"]
    arguments += ["--precision", "8-byte", "--compression", "zstd"]
    assert cli.main([*arguments, "--angles=-10,0", "--repeats", "1", "--cmap", "bone"]) == 0
    assert "VDI / VTK" in capsys.readouterr().out
    assert sorted(p.name for p in out.iterdir()) == [
        f"brain.{kind}" for kind in ("json", "png", "vdi")
    ]
    report = json.loads((out / "brain.json").read_text(encoding="utf-8"))
    assert report["sizes"]["file_bytes"] == (out / "brain.vdi").stat().st_size
    assert [view["angle"] for view in report["views"]] == [-10, 0]
    vdi = io.read(out / "brain.vdi")
    assert (vdi.precision, io.read_info(out / "brain.vdi").codec) == ("8-byte", "zstd")
    # 8 bytes a supersegment and their lists' headers, of the arrays' 24 and the packed form
    assert report["sizes"]["device_bytes"] < 0.5 * report["sizes"]["vdi_bytes"]
    assert vdi.camera == filling_camera(vdi.bounds, (80, 48))


@pytest.mark.gl
@pytest.mark.parametrize(("name", "way"), [("brain", "linear"), ("rayleigh_taylor", "nearest")])
def test_shipped_volumes_are_as_vtk_draws_them(name, way, default_runtime):
    """With the soft transfer function; measured: SSIM .9949, PSNR 40.0 dB at least."""
    pytest.importorskip("pyvista")
    looks = {"cmap": "bone", "opacity": "linear", "interpolation": way}
    volume = pvdi.examples.load_data(name, as_volume=True)
    report, _, _ = measure(volume, looks, (320, 180), repeats=0)
    for view in report["views"]:
        assert view["near"]["raycaster_to_gpu"]["ssim"] >= 0.99, view["angle"]
        assert view["near"]["raycaster_to_gpu"]["psnr"] >= 38.0, view["angle"]
