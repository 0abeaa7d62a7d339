"""Folders of TIFF and PNG, raw and NumPy files as volumes: values, order, what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from skimage.io import imsave

from pyvista_vdi.errors import InvalidVolumeError, UnsupportedError, VDIWarning
from pyvista_vdi.io.volumes import read_volume


def scan(dtype=np.uint16):
    """Twelve slices, so that slice 10 is not between 1 and 2; every value is another."""
    return (np.arange(12 * 5 * 7).reshape(12, 5, 7) * 3 % 250).astype(dtype)


def write(folder, pictures, suffix="tif", name="slice_{}"):
    for i, picture in enumerate(pictures):
        imsave(folder / f"{name.format(i)}.{suffix}", picture, check_contrast=False)


@pytest.mark.parametrize(
    ("suffix", "dtype"),
    [
        ("tif", np.uint8),
        ("TIFF", np.uint16),
        ("tif", np.int16),
        ("tiff", np.float32),
        ("png", np.uint8),
        ("PNG", np.uint16),
    ],
)
def test_slices_become_what_pyvista_reads_of_each(suffix, dtype, tmp_path):
    pv = pytest.importorskip("pyvista")
    pictures = scan(dtype)
    folder = tmp_path / "stack"
    folder.mkdir()
    (folder / "notes.txt").write_text("of the scan")
    write(folder, pictures, suffix)
    volume = read_volume(folder)
    assert volume.array.dtype == dtype
    assert (volume.spacing, volume.origin) == ((1, 1, 1), (0, 0, 0))
    pages = [pv.read(folder / f"slice_{i}.{suffix}").active_scalars for i in range(len(pictures))]
    assert np.array_equal(volume.array.ravel(), np.concatenate(pages))


def test_colours_that_are_grey_are_values_and_rgba_is_opacity(tmp_path):
    grey = scan(np.uint8)
    for name, values, alpha, suffix in (
        ("grey", grey, 255, "png"),
        ("colour", grey, 90, "png"),
        ("floats", grey.astype(np.float32), 1.0, "tif"),
    ):
        (tmp_path / name).mkdir()
        rgba = np.stack([values, values, values, np.full_like(values, alpha)], axis=-1)
        write(tmp_path / name, rgba, suffix)
    for name in ("grey", "floats"):
        assert np.array_equal(read_volume(tmp_path / name).array, grey[:, ::-1])
    volume = read_volume(tmp_path / "colour")
    assert volume.rgba
    assert (volume.array[..., 3] == 90).all()


def _unequal(folder):
    write(folder, [np.zeros((6, 5), np.uint8), np.zeros((6, 7), np.uint8)])


def _types(folder):
    write(folder, [np.zeros((6, 5), np.uint8), np.zeros((6, 5), np.uint16)])


def _mixed(folder):
    write(folder, scan(np.uint8), "png")
    write(folder, scan(np.uint8), "tif")


def _single(folder):
    write(folder, scan(np.uint8)[:1])


def _pages(folder):
    imsave(folder / "a.tif", scan(), check_contrast=False)
    imsave(folder / "b.tif", scan(), check_contrast=False)


def _damaged(folder):
    write(folder, scan(np.uint8), "png")
    (folder / "slice_3.png").write_bytes(b"\x89PNG\r\n\x1a\n")


def _translucent(folder):
    write(folder, np.full((3, 4, 5, 4), 0.5, np.float32))


def _coloured(folder):
    write(folder, np.random.default_rng(1).integers(0, 255, (3, 4, 5, 3), np.uint8), "png")


@pytest.mark.parametrize(
    ("fill", "error", "message"),
    [
        (_unequal, InvalidVolumeError, "slice_1.tif is 6 x 7 uint8, and slice_0.tif is 6 x 5 uint"),
        (_types, InvalidVolumeError, "slice_1.tif is 6 x 5 uint16"),
        (_mixed, InvalidVolumeError, "12 TIFF and 12 PNG files"),
        (_single, InvalidVolumeError, "one slice: a volume needs two"),
        (_pages, InvalidVolumeError, "12 x 5 x 7 uint16, not one slice"),
        (_damaged, InvalidVolumeError, "slice_3.png cannot be read as a picture"),
        (_translucent, UnsupportedError, "are coloured"),
        (_coloured, UnsupportedError, "are coloured"),
    ],
)
def test_what_is_no_stack_is_refused_by_name(fill, error, message, tmp_path):
    fill(tmp_path)
    with pytest.raises(error, match=message):
        read_volume(tmp_path)


def test_missing_slices_bring_a_warning(tmp_path):
    write(tmp_path, scan())
    (tmp_path / "slice_4.tif").unlink()
    with pytest.warns(VDIWarning, match="not evenly spaced"):
        assert read_volume(tmp_path).dimensions == (7, 5, 11)


def test_a_picture_beside_dicom_slices_changes_nothing(tmp_path):
    """Whoever scans leaves a preview beside the slices."""
    pytest.importorskip("pydicom")
    pytest.importorskip("pyvista")
    from scan_files import write_dicom

    write_dicom(tmp_path, scan(np.int16)[:9], np.ones(3), np.zeros(3), np.eye(3))
    write(tmp_path, scan(np.uint8)[:2], "png")
    assert read_volume(tmp_path).dimensions == (7, 5, 9)


HEADER = b"\x93NUMPY\x01\x00\x28\x00"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("nut.raw", b"12345", "does not say what it holds"),
        ("nut_4x3x2_uint16.raw", b"12345", "has 5 bytes; 4 x 3 x 2 of uint16 are 48"),
        ("a.npy", b"", "cannot be read"),
        ("a.npy", b"no array", "cannot be read"),
        ("a.npy", b"PK\x03\x04", "cannot be read"),  # an .npz
        # A bracket that is not closed, keys that cannot be sorted, objects
        ("a.npy", HEADER + b"{'descr': '|u1', 'shape': (3,           ", "cannot be read"),
        ("a.npy", HEADER + b"{'descr': '|u1', b'shape': (3, 4), 2: 1}", "cannot be read"),
        ("a.npy", HEADER + b"{'descr': '|O', 'fortran_order': 0}     ", "cannot be read"),
    ],
)
def test_raw_and_numpy_files_are_checked(name, content, message, tmp_path):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InvalidVolumeError, match=message):
        read_volume(tmp_path / name)
