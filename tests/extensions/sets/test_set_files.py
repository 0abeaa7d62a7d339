"""``.vdiset`` files: what is written is read, whatever becomes of the file."""

from __future__ import annotations

import json

import numpy as np
import pytest
from stepped_vdis import damaged, frames_of, same, stepped_vdi

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError, VDIFileError, VDIWarning
from pyvista_vdi.extensions.series import layout
from pyvista_vdi.extensions.sets import files


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
    made = pvdi.VDISet.of(vdis, window_size=(40, 30))
    made.about = {"target_ssim": 0.5}
    return made.save(tmp_path_factory.mktemp("sets") / "a.vdiset")


def test_every_view_is_read_to_the_last_bit(vdis, saved):
    read = pvdi.read(saved)
    assert isinstance(read, pvdi.VDISet)
    assert len(read) == 6
    assert read.cameras == tuple(vdi.camera for vdi in vdis)
    assert (read.window_size, read.bounds) == ((40, 30), vdis[0].bounds)
    assert read.about == {"target_ssim": 0.5}
    for one, other in zip(read, vdis, strict=True):
        assert same(one, other)
    assert not read.can_grow


def test_a_view_is_found_without_decoding_another(vdis, saved):
    views = files.SetReader(saved)
    one = pvdi.VDISet(views, views.cameras, window_size=views.picture_size, bounds=views.all_bounds)
    view = vdis[4].camera.azimuth(3)
    assert one.nearest(view) == 4
    assert views.n_decoded == 0
    pvdi.pick(one, view, (20, 15))
    assert views.n_decoded == 1


@pytest.mark.every(2)
@pytest.mark.parametrize(
    ("precision", "compression"),
    [("8-byte", "zstd"), ("8-byte", "none"), ("exact", "deflate")],
)
def test_a_set_that_has_grown_is_written_with_what_it_has(
    precision, compression, vdis, saved, tmp_path
):
    read = pvdi.read(saved)
    read.add(_seen_from(stepped_vdi(seed=9), vdis[0].camera.azimuth(30)))
    path = tmp_path / "b.vdiset"
    again = pvdi.read(read.save(path, precision=precision, compression=compression))
    assert len(again) == 7
    for one, other in zip(again, read, strict=True):
        assert same(one, other.with_precision(precision))
    again.save(path)  # over what it is read from


def test_every_byte_counts(saved):
    """A changed byte anywhere is an error or a warning, or leaves all views as they were."""
    content = saved.read_bytes()
    rng = np.random.default_rng(0)
    before = list(pvdi.read(saved))
    for at in rng.integers(0, len(content), 25):
        path = damaged(saved, lambda data, at=int(at): data.__setitem__(at, data[at] ^ 0x55))
        try:
            read = pvdi.read(path)
            vdis = list(read)
        except (VDIFileError, VDIWarning):
            continue
        assert all(any(same(vdi, old) for old in before) for vdi in vdis)


def test_a_file_that_is_cut_off_gives_the_views_that_are_whole(vdis, saved):
    size = saved.stat().st_size
    path = damaged(saved, lambda data: data.__delitem__(slice(size * 2 // 3, None)))
    read = pvdi.read(path)
    assert 1 <= len(read) < 6
    for one, other, camera in zip(read, vdis, read.cameras, strict=False):
        assert same(one, other)
        assert one.camera == camera


def test_a_damaged_view_is_named_and_the_others_are_read(vdis, saved):
    place, header = frames_of(saved)[3]
    middle = place + layout.HEADER_BYTES + header.n_bytes // 2
    path = damaged(saved, lambda data: data.__setitem__(middle, data[middle] ^ 7))
    read = pvdi.read(path)
    with pytest.raises(VDIFileError, match="view 3"):
        read[3]
    assert same(read[4], vdis[4])


def _headed(saved, **changes):
    """The file with another head, whose checksum fits."""
    content, begin = saved.read_bytes(), frames_of(saved)[0][0]
    head = json.loads(content[len(files.MAGIC) + layout.HEAD.size : begin]) | changes
    head = {name: value for name, value in head.items() if value is not None}
    path = saved.with_name("headed.vdiset")
    path.write_bytes(layout.head_bytes(head, files.MAGIC) + content[begin:])
    return path


@pytest.mark.parametrize(
    "changes",
    [
        {"views": None},
        {"views": [{}]},
        {"views": 7},
        {"views": []},
        {"picture_size": [0, 1]},
        {"bounds": [1, 2]},
        {"bounds": [0, 1, 0, 1, 0, None]},
        {"about": 3},
        {"codec": "other"},
        {"precision": "9-byte"},
    ],
)
def test_heads_that_are_wrong_are_refused(changes, saved):
    with pytest.raises(VDIFileError):
        pvdi.read(_headed(saved, **changes))
    other = pvdi.read(_headed(saved, bounds=[0, 1, 0, 1, 0, 1]))
    with pytest.raises(VDIFileError, match="another scene"):
        other[0]


def test_foreign_files_and_names(saved, vdis, tmp_path):
    other = pvdi.VDISeries.of([vdis[0]]).save(tmp_path / "a.vdis")
    for name, content, message in (
        ("b.vdiset", other.read_bytes(), "not a set of VDIs"),
        ("c.vdis", saved.read_bytes(), "not a series"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(VDIFileError, match=message):
            pvdi.read(tmp_path / name)
    with pytest.raises(VDIFileError, match="absent|cannot be read"):
        pvdi.read(tmp_path / "none.vdiset")
    with pytest.raises(VDIFileError, match="vdiset"):
        pvdi.VDISet.of(vdis).save(tmp_path / "a.vdi")
    with pytest.raises(InvalidArgumentError, match="compression"):
        pvdi.VDISet.of(vdis).save(tmp_path / "a.vdiset", compression="zip")
    with pytest.raises(InvalidArgumentError, match="option"):
        pvdi.read(saved, thickness=3)


def test_newer_versions_are_named(saved):
    def newer(data):
        data[8:12] = (layout.FORMAT_VERSION + 1).to_bytes(4, "little")

    with pytest.raises(VDIFileError, match="version 2"):
        pvdi.read(damaged(saved, newer))
