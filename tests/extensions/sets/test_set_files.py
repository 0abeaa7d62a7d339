"""``.vdiset`` files: what is written is read, and what is wrong with one is said."""

from __future__ import annotations

import json
import zipfile

import pytest
from stepped_vdis import same, stepped_vdi

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError, VDIFileError


def _seen_from(vdi, camera):
    arrays = {n: getattr(vdi, n) for n in ("offsets", "front", "back", "color", "optical_depth")}
    return pvdi.VDI(
        camera, vdi.window_size, **arrays, bounds=vdi.bounds, metadata=vdi.metadata
    ).with_precision("8-byte")


@pytest.fixture(scope="module")
def vdis():
    base = stepped_vdi().camera
    return [_seen_from(stepped_vdi(seed=k), base.azimuth(60 * k)) for k in range(6)]


@pytest.fixture(scope="module")
def saved(vdis, tmp_path_factory):
    made = pvdi.VDISet(vdis, window_size=(40, 30))
    return made.save(tmp_path_factory.mktemp("sets") / "a.vdiset")


def test_every_view_is_read_to_the_last_bit(vdis, saved, tmp_path):
    read = pvdi.read(saved)
    assert isinstance(read, pvdi.VDISet)
    assert read.cameras == tuple(vdi.camera for vdi in vdis)
    assert (read.window_size, read.bounds) == ((40, 30), vdis[0].bounds)
    assert read.camera == vdis[0].camera
    assert all(same(one, vdi) for one, vdi in zip(read, vdis, strict=True))
    # A view is found and read without another
    with zipfile.ZipFile(saved) as archive:
        archive.extractall(tmp_path / "a.vdiset")
    for k in (0, 1, 2, 3, 5):
        (tmp_path / "a.vdiset" / f"{k:06}.vdi").write_bytes(b"damaged")
    read = pvdi.read(tmp_path / "a.vdiset")
    view = vdis[4].camera.azimuth(3)
    assert read.nearest(view) == 4
    assert same(read[4], vdis[4])
    with pytest.raises(VDIFileError, match=r"000003\.vdi"):
        read[3]


@pytest.mark.parametrize(
    "changes",
    [{"views": []}, {"picture_size": [0, 1]}, {"bounds": [1, 2]}, {"camera": 3}, {"version": 2}],
)
def test_what_the_json_says_wrongly_is_refused(changes, saved, tmp_path):
    with zipfile.ZipFile(saved) as archive:
        archive.extractall(tmp_path / "a.vdiset")
    head = tmp_path / "a.vdiset" / "set.json"
    head.write_text(json.dumps(json.loads(head.read_text()) | changes))
    with pytest.raises(VDIFileError):
        pvdi.read(tmp_path / "a.vdiset")


def test_foreign_files_and_names(saved, vdis, tmp_path):
    other = pvdi.VDISeries([vdis[0]]).save(tmp_path / "a.vdis")
    for name, content, message in (
        ("b.vdiset", other.read_bytes(), r"no set\.json"),
        ("c.vdis", saved.read_bytes(), r"no series\.json"),
        ("d.vdiset", bytes(40), "no set of VDIs"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(VDIFileError, match=message):
            pvdi.read(tmp_path / name)
    with pytest.raises(VDIFileError, match="absent|cannot be read"):
        pvdi.read(tmp_path / "none.vdiset")
    with pytest.raises(VDIFileError, match="vdiset"):
        pvdi.VDISet(vdis).save(tmp_path / "a.vdi")
    with pytest.raises(InvalidArgumentError, match="compression"):
        pvdi.VDISet(vdis).save(tmp_path / "a.vdiset", compression="zip")
