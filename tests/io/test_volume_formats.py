"""Volumes in files that each format's own library writes: values, place and unit.

And what is truncated, missing or foreign: a sentence, and no process ends.
"""

from __future__ import annotations

import gzip
import struct

import numpy as np
import pytest
from PIL import Image

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError, InvalidVolumeError, UnsupportedError, VDIError

SPACING, ORIGIN = np.array([1.0, 1.5, 2.5]), np.array([-10.0, 20.0, 30.0])
#: From left, back, head to right, front, head.
RAS = np.diag([-1, -1, 1])


def scan(dtype=np.int16):
    return (np.arange(210).reshape(5, 6, 7) * 7 % 211).astype(dtype)


def turned():
    c, s = np.cos(0.5), np.sin(0.5)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def placed(direction=None, spacing=SPACING, origin=ORIGIN):
    place = np.eye(4)
    place[:3, :3] = (np.eye(3) if direction is None else direction) * spacing
    place[:3, 3] = origin
    return place


def check(volume, values, place, unit="", atol=1e-5):
    """The same values, type and unit; and the same place: files have float32 up to 40."""
    assert (volume.array.dtype, volume.unit) == (values.dtype, unit)
    np.testing.assert_array_equal(volume.array, values)
    np.testing.assert_allclose(volume.index_to_model, place, rtol=0, atol=atol)


def itk_image(values, direction=None, **kind):
    sitk = pytest.importorskip("SimpleITK")
    image = sitk.GetImageFromArray(values, **kind)
    n = image.GetDimension()
    along = np.eye(n)
    along[:3, :3] = turned() if direction is None else direction
    image.SetSpacing([*SPACING, 1.0][:n])
    image.SetOrigin([*ORIGIN, 0.0][:n])
    image.SetDirection(along.ravel())
    return sitk, image


@pytest.mark.parametrize("name", ["a.mhd", "a.gipl", "a.mnc", "a.nii.gz", "a.nrrd"])
def test_what_simpleitk_writes_is_where_it_says(name, tmp_path):
    direction = np.eye(3) if name == "a.gipl" else None  # which has none
    sitk, image = itk_image(scan(), direction)
    sitk.WriteImage(image, str(tmp_path / name))
    place = placed(turned() if direction is None else direction)
    if name in ("a.nii.gz", "a.img"):
        place[:3] = RAS @ place[:3]
    unit = "" if name in ("a.mha", "a.mhd", "a.nrrd") else "mm"
    volume = pvdi.read_volume(tmp_path / name)
    if name == "a.mnc":  # of which this writer scales the values
        assert np.allclose(volume.array, scan(), atol=1e-3)
        np.testing.assert_allclose(volume.index_to_model, place, atol=1e-5)
        return
    check(volume, scan(), place, unit)


def nifti(path, *, sform=None, qfac=1.0, quaternion=None, slope=0.0, shift=0.0, unit=2):
    """Write NIfTI-1; ``quaternion`` is (b, c, d, x, y, z), ``sform`` a 4 x 4 matrix."""
    header = bytearray(352)
    struct.pack_into("<i8h", header, 0, 348, *[0] * 8)
    struct.pack_into("<8h", header, 40, 3, 7, 6, 5, 1, 1, 1, 1)
    struct.pack_into("<2h", header, 70, 4, 16)  # int16
    struct.pack_into("<8f", header, 76, qfac, *SPACING, 1, 1, 1, 1)
    struct.pack_into("<3f", header, 108, 352, slope, shift)
    header[123] = unit
    struct.pack_into("<2h", header, 252, quaternion is not None, sform is not None)
    struct.pack_into("<6f", header, 256, *(quaternion or [0] * 6))
    struct.pack_into("<12f", header, 280, *(np.zeros(12) if sform is None else sform[:3].ravel()))
    header[344:348] = b"n+1\0"
    data = bytes(header) + scan().astype("<i2").tobytes()
    path.write_bytes(gzip.compress(data) if path.suffix == ".gz" else data)
    return path


def test_nifti_is_placed_by_its_sform_then_its_quaternion_then_from_the_origin(tmp_path):
    pytest.importorskip("SimpleITK")
    half = 0.25  # of the angle about z
    by_quaternion = (0, 0, np.sin(half), *ORIGIN)
    volume = pvdi.read_volume(nifti(tmp_path / "a.nii", quaternion=by_quaternion, unit=3))
    micrometres = placed(turned(), SPACING / 1000, ORIGIN / 1000)
    check(volume, scan(), micrometres, "mm")
    flipped = pvdi.read_volume(nifti(tmp_path / "a.nii", quaternion=by_quaternion, qfac=-1.0))
    check(flipped, scan(), placed(turned() @ np.diag([1, 1, -1])), "mm")
    other = placed(turned() @ turned())
    path = nifti(tmp_path / "a.nii.gz", quaternion=by_quaternion, sform=other)
    check(pvdi.read_volume(path), scan(), other, "mm")
    check(pvdi.read_volume(nifti(tmp_path / "a.nii")), scan(), placed(origin=(0, 0, 0)), "mm")
    with pytest.raises(InvalidVolumeError, match=r"a\.nii"):
        pvdi.read_volume(nifti(tmp_path / "a.nii", sform=np.zeros((4, 4))))


def test_nrrd(tmp_path):
    nrrd = pytest.importorskip("nrrd")
    header = {"space": "right-anterior-superior", "space units": ["um"] * 3}
    header |= {"space directions": (turned() * SPACING).T, "space origin": ORIGIN}
    for encoding in ("raw", "gzip", "ascii"):
        path = str(tmp_path / "a.nrrd")
        nrrd.write(path, scan(), {**header, "encoding": encoding}, index_order="C")
        check(pvdi.read_volume(path), scan(), placed(turned()), "um", atol=1e-9)
    nrrd.write(str(tmp_path / "a.nhdr"), scan(), {"spacings": SPACING}, index_order="C")
    place = placed(origin=(0, 0, 0))
    check(pvdi.read_volume(tmp_path / "a.nhdr"), scan(), place, atol=1e-9)


@pytest.mark.parametrize(
    ("how", "place", "unit"),
    [
        ({"imagej": True, "metadata": {"axes": "ZYX", "spacing": 2.5, "unit": "um"}}, True, "um"),
        (
            {
                "metadata": {"axes": "ZYX", "PhysicalSizeXUnit": "mm", "PhysicalSizeYUnit": "mm"}
                | {"PhysicalSizeZUnit": "mm", "PhysicalSizeX": 1, "PhysicalSizeY": 1.5}
                | {"PhysicalSizeZ": 2.5},
                "ome": True,
            },
            *(True, "mm"),
        ),
        ({"compression": "zlib", "bigtiff": True}, False, ""),
        ({"tile": (16, 16)}, False, ""),
    ],
)
def test_tiff(how, place, unit, tmp_path):
    tifffile = pytest.importorskip("tifffile")
    values = scan(np.uint16)
    resolution = {"resolution": (1, 1 / 1.5)} if how.get("imagej") else {}
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, values, photometric="minisblack", **resolution, **how)
    expected = placed(spacing=SPACING if place else np.ones(3), origin=(0, 0, 0))
    check(pvdi.read_volume(path), values[:, ::-1], expected, unit)


def test_times_channels_and_calibration_of_tiff(tmp_path):
    tifffile = pytest.importorskip("tifffile")
    two = np.stack([scan(np.uint16) + 9, scan(np.uint16)], 1)
    tifffile.imwrite(tmp_path / "a.tif", two, imagej=True, metadata={"axes": "ZCYX"})
    with pytest.raises(UnsupportedError, match="holds 2 channels, 0 to 1.* channel=0"):
        pvdi.read_volume(tmp_path / "a.tif")
    assert np.array_equal(pvdi.read_volume(tmp_path / "a.tif", channel=1).array, two[:, 1, ::-1])
    tifffile.imwrite(tmp_path / "b.tif", two.swapaxes(0, 1), imagej=True, metadata={"axes": "TZYX"})
    assert np.array_equal(pvdi.read_volume(tmp_path / "b.tif", time=1).array, two[:, 1, ::-1])
    names = {"axes": "CZYX", "Channel": {"Name": ["DAPI", "GFP"]}}
    path = tmp_path / "c.ome.tif"
    tifffile.imwrite(path, two.swapaxes(0, 1), photometric="minisblack", metadata=names)
    volume = pvdi.read_volume(path, channel="GFP")
    assert (volume.name, volume.array.tolist()) == ("GFP", two[:, 1, ::-1].tolist())
    with pytest.raises(InvalidArgumentError, match="no channel 'RFP': it holds DAPI, GFP"):
        pvdi.read_volume(path, channel="RFP")
    (listed,) = pvdi.list_volumes(path)
    assert str(listed).startswith("7 x 6 x 5 uint16, 2 channels (DAPI, GFP)")


def test_numpy(tmp_path):
    np.save(tmp_path / "a.npy", scan())
    check(pvdi.read_volume(tmp_path / "a.npy"), scan(), np.eye(4))
    np.savez(tmp_path / "a.npz", one=np.zeros((3, 4, 5)), two=scan(), three=np.zeros(3))
    with pytest.raises(UnsupportedError, match=r"holds 2 volumes, 'one': 5 x 4 x 3 .* array="):
        pvdi.read_volume(tmp_path / "a.npz")
    for asked in (1, "two"):
        assert np.array_equal(pvdi.read_volume(tmp_path / "a.npz", array=asked).array, scan())
    with pytest.raises(InvalidArgumentError, match="no volume 'three': it holds 'one'"):
        pvdi.read_volume(tmp_path / "a.npz", array="three")
    volume = pvdi.read_volume(tmp_path / "a.npz", array=1, spacing=(1, 2, 3), origin=(4, 5, 6))
    assert (volume.spacing, volume.origin) == ((1, 2, 3), (4, 5, 6))
    np.save(tmp_path / "b.npy", np.stack([scan(), scan()]))
    with pytest.raises(
        InvalidVolumeError, match=r"shape \(2, 5, 6, 7\): a volume has three.*Volume"
    ):
        pvdi.read_volume(tmp_path / "b.npy")


def test_pictures_in_a_folder_are_slices_in_the_order_of_their_numbers(tmp_path):
    rows = np.arange(6, dtype=np.uint16).reshape(2, 3)  # the top one is the last along y
    for i in range(12):
        Image.fromarray(rows + np.uint16(i)).save(tmp_path / f"s{i}.png")
    assert pvdi.read_volume(tmp_path).array[:, 0, 0].tolist() == [*range(3, 15)]


@pytest.mark.parametrize("name", ["a.nii.gz", "a.mha", "a.nrrd", "a.gipl", "a.npy", "a.tif"])
def test_what_is_cut_off_is_refused(name, tmp_path, capfd):
    sitk, image = itk_image(scan())
    path = tmp_path / name
    if name == "a.npy":
        np.save(path, scan())
    else:
        sitk.WriteImage(image, str(path))
    whole = path.read_bytes()
    capfd.readouterr()
    for share in (0, 0.02, 0.2, 0.5, 0.9):
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(VDIError, match=name.replace(".", r"\.")):
            pvdi.read_volume(path)
    assert capfd.readouterr().out == ""


def test_what_cannot_be_opened_is_said(tmp_path):
    with pytest.raises(InvalidVolumeError, match=r"none\.nrrd does not exist: check .*--example"):
        pvdi.read_volume(tmp_path / "none.nrrd")
    (tmp_path / "empty.tif").touch()
    with pytest.raises(InvalidVolumeError, match="it is empty"):
        pvdi.read_volume(tmp_path / "empty.tif")
    header = b"NRRD0005\ntype: short\ndimension: 3\nsizes: 900000 900000 900000\n"
    (tmp_path / "a.nrrd").write_bytes(header + b"endian: little\nencoding: raw\n\n")
    with pytest.raises(VDIError, match=r"a\.nrrd.* GiB"):
        pvdi.read_volume(tmp_path / "a.nrrd")


@pytest.mark.parametrize("name", ["a.fits", "a.raw", "IM0001", "run.pvd"])
def test_what_is_not_read_is_refused_with_the_remedy(name, tmp_path):
    (tmp_path / name).write_bytes(b"<VTKFile" + bytes(2000))
    with pytest.raises(
        UnsupportedError, match=r"own library, .*Volume\(array, spacing=, origin=\)"
    ):
        pvdi.read_volume(tmp_path / name)
