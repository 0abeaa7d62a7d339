"""DICOM as pydicom writes it: slices in the order of their places, values that are meant."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from PIL import Image

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidVolumeError, UnsupportedError, VDIWarning

pydicom = pytest.importorskip("pydicom")

SPACING, ORIGIN = np.array([1.0, 1.5, 2.5]), np.array([-10.0, 20.0, 30.0])
SCAN = (np.arange(210).reshape(5, 6, 7) * 7 % 211).astype(np.int16)
STRAIGHT = np.eye(3)


def turned():
    z, x = np.radians([30, 20])
    around_z = [[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]]
    around_x = [[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]]
    return np.array(around_z) @ np.array(around_x)


def dataset(pixels, series, number=1, sop="1.2.840.10008.5.1.4.1.1.2"):
    data, meta = pydicom.Dataset(), pydicom.dataset.FileMetaDataset()
    meta.TransferSyntaxUID = pydicom.uid.ExplicitVRLittleEndian
    meta.MediaStorageSOPClassUID = data.SOPClassUID = sop
    meta.MediaStorageSOPInstanceUID = data.SOPInstanceUID = f"{series}.{number}"
    data.file_meta, data.SeriesInstanceUID = meta, series
    data.SeriesDescription, data.InstanceNumber = f"series {series}", number
    data.Rows, data.Columns = pixels.shape[-2:]
    data.SamplesPerPixel, data.PhotometricInterpretation = 1, "MONOCHROME2"
    data.BitsAllocated = data.BitsStored = 16
    data.HighBit, data.PixelRepresentation = 15, int(pixels.dtype.kind == "i")
    data.PixelSpacing, data.SliceThickness = [SPACING[1], SPACING[0]], SPACING[2]
    data.PixelData = pixels.astype(pixels.dtype.newbyteorder("<")).tobytes()
    return data


def write(folder, direction=STRAIGHT, edit=None, *, series="1.2.3", step=None, values=SCAN):
    """Write a series, whose files' names are not in the slices' order."""
    folder.mkdir(exist_ok=True)
    step = direction[:, 2] * SPACING[2] if step is None else step
    for z, pixels in enumerate(values):
        data = dataset(pixels, series, z + 1)
        data.ImagePositionPatient = [f"{n:.9g}" for n in ORIGIN + step * z]
        data.ImageOrientationPatient = [f"{n:.9g}" for n in direction[:, :2].T.ravel()]
        if edit is not None:
            edit(data)
        data.save_as(folder / f"{7 * z % 11:02d}.dcm", enforce_file_format=True)
    return folder


def check(volume, steps, values=SCAN):
    """Each voxel is where it should be: the directions of axes may be any."""
    z, y, x = np.meshgrid(*map(np.arange, values.shape), indexing="ij")
    world = ORIGIN + np.stack([x, y, z], -1).reshape(-1, 3) @ np.asarray(steps).T
    index = np.column_stack([world, np.ones(len(world))]) @ np.linalg.inv(volume.index_to_model).T
    i, j, k = np.rint(index[:, :3]).astype(int).T
    np.testing.assert_allclose(index[:, :3], np.column_stack([i, j, k]), atol=1e-4)
    np.testing.assert_array_equal(volume.array[k, j, i], values.ravel())
    assert (volume.array.dtype, volume.unit) == (values.dtype, "mm")


@pytest.mark.parametrize("direction", [STRAIGHT, turned() @ np.diag([1, 1, -1])])
def test_every_voxel_is_where_its_slice_says(direction, tmp_path):
    volume = pvdi.read_volume(write(tmp_path / "scan", direction))
    check(volume, direction * SPACING)
    assert volume.name == "series 1.2.3"


def test_a_tilted_gantry_shears_the_volume(tmp_path):
    step = np.array([0.0, 0.7, 2.4])  # not along the normal
    volume = pvdi.read_volume(write(tmp_path / "scan", step=step))
    check(volume, np.column_stack([(1, 0, 0), (0, 1.5, 0), step]))


@pytest.mark.parametrize(
    ("slope", "intercept", "dtype"),
    [(1, -1024, np.int16), (0.5, 1, np.float32)],
)
def test_values_are_those_that_the_slices_mean(slope, intercept, dtype, tmp_path):
    """Of 12 bits stored, as a CT's are; one type for all slices, whatever they hold."""

    def edit(data):
        data.BitsStored, data.HighBit, data.PixelRepresentation = 12, 11, 0
        data.RescaleSlope, data.RescaleIntercept = slope, intercept

    volume = pvdi.read_volume(write(tmp_path / "scan", edit=edit))
    check(volume, np.diag(SPACING), (slope * SCAN.astype(float) + intercept).astype(dtype))


def test_frames_of_one_file_lie_where_it_says(tmp_path):
    """Of an enhanced CT by places, the last first."""
    enhanced = dataset(SCAN[::-1], "1.2", sop="1.2.840.10008.5.1.4.1.1.2.1")
    enhanced.NumberOfFrames = 5
    del enhanced.PixelSpacing
    group = pydicom.Dataset()
    group.PlaneOrientationSequence, group.PixelMeasuresSequence = (
        [pydicom.Dataset()] for _ in "ab"
    )
    group.PlaneOrientationSequence[0].ImageOrientationPatient = [1, 0, 0, 0, 1, 0]
    group.PixelMeasuresSequence[0].PixelSpacing = [SPACING[1], SPACING[0]]
    enhanced.SharedFunctionalGroupsSequence = [group]
    places = []
    for z in range(5)[::-1]:
        frame, place = pydicom.Dataset(), pydicom.Dataset()
        place.ImagePositionPatient = list(ORIGIN + np.array([0, 0, 2.5 * z]))
        frame.PlanePositionSequence = [place]
        places.append(frame)
    enhanced.PerFrameFunctionalGroupsSequence = places
    enhanced.save_as(tmp_path / "enhanced.dcm", enforce_file_format=True)
    check(pvdi.read_volume(tmp_path / "enhanced.dcm"), np.diag(SPACING))


def test_other_files_and_series_beside_the_slices(tmp_path):
    folder = write(tmp_path / "scan")
    (folder / "README.txt").write_text("not a slice")
    (folder / "empty").touch()
    (folder / "noise.dcm").write_bytes(bytes(range(256)) * 8)
    (folder / "sub").mkdir()
    for number in (1, 2):  # previews
        Image.fromarray(SCAN[number].astype(np.uint8)).save(folder / f"{number}.png")
    check(pvdi.read_volume(folder), np.diag(SPACING))
    other = write(tmp_path / "other", series="7.8", values=SCAN[:3])
    for file in other.iterdir():
        shutil.copy(file, folder / f"other{file.name}")
    said = r"holds 2 volumes, 'series 1\.2\.3': 7 x 6 x 5 .*'series 7\.8': 7 x 6 x 3 .*series="
    with pytest.raises(UnsupportedError, match=said):
        pvdi.read_volume(folder)
    assert pvdi.read_volume(folder, series="series 7.8").dimensions == (7, 6, 3)


def test_a_damaged_slice_is_said(tmp_path):
    folder = write(tmp_path / "scan")
    last = folder / "06.dcm"  # without which those that are left are evenly apart
    content = last.read_bytes()
    rows = content.index(b"\x28\0\x10\0")  # the tag (0028,0010) of how many there are
    last.write_bytes(content[:rows])
    said = rf"1 files or series in the folder .*scan are left out.*{last.name} cannot be read"
    with pytest.warns(VDIWarning, match=said):
        assert pvdi.read_volume(folder).dimensions == (7, 6, 4)
    for path in folder.iterdir():
        path.write_bytes(content[:rows])
    with pytest.raises(InvalidVolumeError, match=r"\.dcm cannot be read .* ends within its header"):
        pvdi.read_volume(folder)


def test_slices_that_do_not_make_a_volume(tmp_path):
    def at(place, orientation=(1, 0, 0, 0, 1, 0)):
        data = dataset(SCAN[0], "1.2.3", 9)
        data.ImagePositionPatient, data.ImageOrientationPatient = list(place), list(orientation)
        data.save_as(folder / "10.dcm", enforce_file_format=True)

    folder = write(tmp_path / "scan")
    at(ORIGIN)
    with pytest.raises(InvalidVolumeError, match="several slices .* lie in the same place"):
        pvdi.read_volume(folder)
    (tmp_path / "none").mkdir()
    with pytest.raises(InvalidVolumeError, match=r"none holds no slices .* give the folder"):
        pvdi.read_volume(tmp_path / "none")


def test_what_slices_do_not_say_is_warned_of(tmp_path):
    folder = write(tmp_path / "scan")
    (folder / "03.dcm").unlink()  # the third
    with pytest.warns(VDIWarning, match=r"scan are 2\.5 to 5 apart, and are taken as 3\.33333"):
        assert pvdi.read_volume(folder).dimensions == (7, 6, 4)

    def sizeless(data):
        del data.PixelSpacing

    with pytest.warns(VDIWarning, match="do not say how large pixels are, and 1 mm is taken"):
        assert pvdi.read_volume(write(tmp_path / "b", edit=sizeless)).spacing == (1, 1, 2.5)
