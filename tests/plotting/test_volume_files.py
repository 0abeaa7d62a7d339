"""Volumes from files of other programs: each voxel where its file says, or an error that helps.

The files are written byte by byte by ``scan_files``, or by VTK and pynrrd. Where the marked voxel
lies is what SimpleITK 2.5 and nibabel 5.3 say of the same files, too (with x and y of NIfTI's frame
negated for SimpleITK).
"""

from __future__ import annotations

import re
import shutil
import struct
import sys
from argparse import Namespace

import numpy as np
import pytest
import pyvista as pv
from scan_files import (
    IMPLICIT,
    JPEG,
    dicom_slice,
    element,
    write_dicom,
    write_meta_image,
    write_nifti,
)
from strategies import random_vdi
from volume_kinds import KINDS
from vtk_builds import vtk_or_skip

import pyvista_vdi as pvdi
from pyvista_vdi import cli, registry
from pyvista_vdi.cli.inputs import read_volume
from pyvista_vdi.errors import (
    InvalidVolumeError,
    MissingDependencyError,
    UnsupportedError,
    VDIWarning,
)
from pyvista_vdi.vtk_pipeline.vtk import vtkMatrix4x4, vtkNIFTIImageWriter

SPACING, ORIGIN = np.array([1.0, 1.5, 2.5]), np.array([-10.0, 20.0, 30.0])
MARK = (4, 2, 1)  # x, y, z


def turned(about_z, about_x):
    z, x = np.radians([about_z, about_x])
    around_z = [[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]]
    around_x = [[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]]
    return np.array(around_z) @ np.array(around_x)


#: Columns are the directions of the x, y and z axes.
DIRECTIONS = {
    "straight": np.eye(3),
    "oblique": turned(30, 20),
    "mirrored": turned(30, 20) @ np.diag([1, 1, -1]),
    "coronal": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
}


def scan():
    """Values that differ everywhere; the largest is at the mark."""
    array = np.arange(5 * 6 * 7, dtype=np.int16).reshape(5, 6, 7)
    array[MARK[::-1]] = 1000
    return array


def affine(direction):
    matrix = np.eye(4)
    matrix[:3, :3] = direction * SPACING
    matrix[:3, 3] = ORIGIN
    return matrix


def as_grid(direction):
    grid = pv.ImageData(
        dimensions=(7, 6, 5), spacing=SPACING, origin=ORIGIN, direction_matrix=direction
    )
    grid["ct"] = scan().ravel()
    return grid


def write_nrrd(path, direction):
    import nrrd

    header = {
        "space": "left-posterior-superior",
        "space directions": (direction * SPACING).T,
        "space origin": ORIGIN,
    }
    nrrd.write(str(path), scan(), header, index_order="C")
    return path


def write_in(kind, folder, direction):
    """Write the scan in a format, in the same coordinates whatever a format calls them."""
    path = folder / f"scan.{kind}"
    if kind == "vti":
        as_grid(direction).save(path)
    elif kind in ("nrrd", "nhdr"):
        write_nrrd(path, direction)
    elif kind in ("mha", "mhd"):
        write_meta_image(path, scan(), SPACING, ORIGIN, direction)
    elif kind == "dicom":
        write_dicom(path, scan(), SPACING, ORIGIN, direction)
    else:
        write_nifti(path, scan(), SPACING, sform=affine(direction))
    return path


#: Options of stores of chunks, which no other file has.
_OF_A_STORE = ("level", "channel", "time_index", "series")
FORMATS = ("vti", "nrrd", "nhdr", "mha", "mhd", "nii", "nii.gz", "dicom")


def read(path, **options):
    """Read as every verb does that takes a volume."""
    if ".nii" in str(path):
        pytest.importorskip("nibabel")
    absent = ("example", "scalars", "preference", "spacing", "origin", *_OF_A_STORE)
    return read_volume(Namespace(**dict.fromkeys(absent) | {"file": str(path)} | options))


def marked(volume):
    """Where the largest value lies, world coordinates."""
    z, y, x = np.unravel_index(int(np.argmax(volume.array)), volume.array.shape)
    return (volume.index_to_model @ [x, y, z, 1])[:3]


def values_in_space(volume):
    """Every voxel's world coordinates and value, in an order of their own."""
    z, y, x = np.meshgrid(*map(np.arange, volume.array.shape), indexing="ij")
    index = np.stack([x, y, z, np.ones_like(x)], axis=-1).reshape(-1, 4)
    rows = np.column_stack([(index @ volume.index_to_model.T)[:, :3], volume.array.ravel()])
    return rows[np.argsort(rows[:, 3], kind="stable")]


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("kind", FORMATS)
def test_every_voxel_is_where_the_file_says(kind, direction, tmp_path):
    matrix = affine(DIRECTIONS[direction])
    volume = read(write_in(kind, tmp_path, DIRECTIONS[direction]))
    expected = (matrix @ [*MARK, 1])[:3]
    # NIfTI's header is float32, DICOM's numbers have nine digits here: coordinates up to 50
    np.testing.assert_allclose(marked(volume), expected, atol=1e-5)
    reference = values_in_space(pvdi.Volume(scan(), SPACING, ORIGIN, DIRECTIONS[direction]))
    np.testing.assert_allclose(values_in_space(volume), reference, atol=1e-5)


def assert_marked_at(path, world, atol=1e-5):
    """The largest value lies there."""
    np.testing.assert_allclose(marked(read(path)), world[:3], atol=atol)


@pytest.mark.parametrize("qfac", [1.0, -1.0])
def test_nifti_by_quaternion_and_by_sform_which_comes_first(qfac, tmp_path):
    """30 degrees about z; qfac -1 turns the third axis round (nifti1.h, method 2).

    The form is sheared; nibabel takes it so.
    """
    half = np.radians(15)
    path = write_nifti(
        tmp_path / "a.nii",
        scan(),
        SPACING,
        quaternion=(0, 0, np.sin(half), *ORIGIN),
        qfac=qfac,
    )
    assert_marked_at(path, affine(turned(30, 0) @ np.diag([1, 1, qfac])) @ [*MARK, 1])
    sform = affine(turned(30, 20))
    sform[:3, 1] += 0.3 * sform[:3, 0]
    path = write_nifti(
        tmp_path / "a.nii", scan(), SPACING, sform=sform, quaternion=(0, 0, 1, 1, 2, 3), qfac=qfac
    )
    assert_marked_at(path, sform @ [*MARK, 1])


def test_nifti_without_a_map_begins_at_the_origin(tmp_path):
    assert_marked_at(write_nifti(tmp_path / "a.nii", scan(), SPACING), SPACING * MARK, atol=1e-6)


def test_files_of_vtks_writers(tmp_path):
    matrix = vtkMatrix4x4()  # VTK's maps points, spacing included
    for (i, j), value in np.ndenumerate(affine(turned(30, 20)) @ np.diag([*1 / SPACING, 1])):
        matrix.SetElement(i, j, value)
    grid, writer = as_grid(np.eye(3)), vtkNIFTIImageWriter()
    grid.origin = (0, 0, 0)  # which the matrix has
    writer.SetFileName(str(tmp_path / "a.nii"))
    writer.SetInputData(grid)
    writer.SetSFormMatrix(matrix)
    writer.Write()
    assert_marked_at(tmp_path / "a.nii", affine(turned(30, 20)) @ [*MARK, 1])
    writer = vtk_or_skip("vtkMetaImageWriter")()
    writer.SetFileName(str(tmp_path / "a.mha"))
    writer.SetInputData(as_grid(np.eye(3)))
    writer.Write()
    assert read(tmp_path / "a.mha").direction.tolist() == np.eye(3).tolist()
    assert_marked_at(tmp_path / "a.mha", SPACING * MARK + ORIGIN)


@pytest.mark.parametrize("key", ["TransformMatrix", "Rotation", "Orientation"])
def test_meta_images_other_names_of_the_direction(key, tmp_path):
    path = write_meta_image(tmp_path / "a.mha", scan(), SPACING, ORIGIN, turned(30, 20), key)
    np.testing.assert_allclose(read(path).direction, turned(30, 20), atol=1e-12)


def test_a_tilted_gantry_shears_the_volume(tmp_path):
    folder = tmp_path / "scan"
    folder.mkdir()
    step = np.array([0.0, 0.7, 2.4])  # not along the normal
    for z, pixels in enumerate(scan()):
        data = dicom_slice(pixels, ORIGIN + z * step, np.eye(3)[:2], SPACING, number=z)
        (folder / f"{z}.dcm").write_bytes(data)
    assert_marked_at(folder, ORIGIN + SPACING * [MARK[0], MARK[1], 0] + step * MARK[2])


@pytest.mark.every(3)
@pytest.mark.parametrize("kind", [k for k in FORMATS if k != "vti"])
def test_pictures_of_all_formats_are_the_same(kind, tmp_path, capsys, default_runtime):
    """Through the verbs: generate from the file, render from the side."""
    from PIL import Image

    pictures = []
    looks = ("--cmap", "bone", "--opacity", "0,0.6", "--clim", "0", "210", "--size", "48x36")
    for form in ("vti", kind):
        volume = write_in(form, tmp_path, turned(30, 20))
        vdi, png = tmp_path / f"{form}.vdi", tmp_path / f"{form}.png"
        arguments = ["generate", str(volume), "-o", str(vdi), *looks, "--interpolation", "linear"]
        assert cli.main(arguments) == 0, capsys.readouterr().err
        arguments = ["render", str(vdi), "-o", str(png), "--azimuth", "10", "--background", "black"]
        assert cli.main(arguments) == 0, capsys.readouterr().err
        with Image.open(png) as image:
            pictures.append(np.asarray(image).astype(int))
    assert pictures[0].max() > 60
    # Coordinates differ by float32's rounding, rays at faces may take another voxel: seen up to 1
    assert np.abs(pictures[0] - pictures[1]).max() <= 2


def test_scaled_values(tmp_path):
    """NIfTI's scl_slope and DICOM's RescaleSlope: what the file means, not what it stores."""
    nifti = read(write_nifti(tmp_path / "a.nii", scan(), SPACING, slope=0.5))
    np.testing.assert_allclose(nifti.array, scan() * 0.5 - 3, atol=1e-4)
    folder = write_dicom(tmp_path / "scan", scan(), SPACING, ORIGIN, np.eye(3), slope=2)
    assert read(folder).array.max() == 1900  # 2 * 1000 - 100


def test_cell_data_become_point_data(tmp_path, capsys, default_runtime):
    grid = pv.ImageData(dimensions=(6, 5, 4))
    grid.cell_data["c"] = np.arange(grid.n_cells, dtype=np.float32)
    grid.save(tmp_path / "cells.vti")
    expected = grid.cell_data_to_point_data().point_data["c"]
    np.testing.assert_array_equal(read(tmp_path / "cells.vti").array.ravel(), expected)
    assert read(tmp_path / "cells.vti", scalars="c", preference="cell").name == "c"
    arguments = ["compare", str(tmp_path / "cells.vti"), "--out", str(tmp_path / "out")]
    options = ["--size", "24x16", "--angles", "0", "--repeats", "1", "--no-vtk"]
    assert cli.main([*arguments, *options]) == 0, capsys.readouterr().err


@pytest.mark.parametrize("kind", ["vti", "mha", "nrrd"])
def test_several_components_are_refused_by_name(kind, tmp_path):
    path = tmp_path / f"a.{kind}"
    values = np.zeros((4, 5, 6, 3), np.float32)
    if kind == "nrrd":
        import nrrd

        nrrd.write(str(path), values, index_order="C")
        message = "a volume is a three-dimensional array; got shape"
    elif kind == "vti":
        grid = pv.ImageData(dimensions=(6, 5, 4))
        grid["velocity"] = values.reshape(-1, 3)
        grid.save(path)
        message = "the scalars 'velocity' have 3 components: .* pass one component"
    else:
        text = (
            "NDims = 3\nBinaryData = True\nDimSize = 6 5 4\nElementNumberOfChannels = 3\n"
            "ElementType = MET_FLOAT\nElementDataFile = LOCAL\n"
        )
        path.write_bytes(text.encode() + values.tobytes())
        message = "holds 3 channels, 0 to 2, .* choose one by channel=0"
    with pytest.raises((UnsupportedError, InvalidVolumeError), match=message):
        read(path)


def test_several_times_are_refused_by_name(tmp_path):
    path = write_nifti(tmp_path / "a.nii", scan(), SPACING, nt=4)
    with pytest.raises(UnsupportedError, match=r"a\.nii holds 4 times.* choose one by time=0"):
        read(path)
    assert read(path, time_index=3).dimensions == (7, 6, 5)


def dicom_folder(tmp_path, **options):
    return write_dicom(tmp_path / "scan", scan(), SPACING, ORIGIN, np.eye(3), **options)


def open_ended(tag, content, explicit):
    """A sequence of undefined length (PS3.5, section 7.5)."""
    head = struct.pack("<HH", tag >> 16, tag & 0xFFFF)
    head += b"SQ\0\0" if explicit else b""
    item = struct.pack("<HHI", 0xFFFE, 0xE000, 0xFFFFFFFF) + content
    item += struct.pack("<HHI", 0xFFFE, 0xE00D, 0)
    return head + b"\xff" * 4 + item + struct.pack("<HHI", 0xFFFE, 0xE0DD, 0)


@pytest.mark.parametrize("syntax", [IMPLICIT, "1.2.840.10008.1.2.1"])
def test_what_lies_before_and_beside_what_is_wanted_is_passed_by(syntax, tmp_path):
    """Sequences, one in the other; files that are no slices; names without a suffix."""
    explicit = syntax != IMPLICIT
    inner = element(0x0020000E, "UI", "9.9.9", explicit=explicit)  # of another series
    sequence = open_ended(0x0008114A, inner, explicit) + inner
    sequence = open_ended(0x00081115, sequence, explicit)
    for options in ({"sequence": sequence}, {"suffix": ""}):
        folder = dicom_folder(tmp_path, syntax=syntax, **options)
        (folder / "README.txt").write_text("not a slice")
        (folder / "empty").touch()
        (folder / "noise.dcm").write_bytes(bytes(range(256)) * 8)
        (folder / "sub").mkdir()
        assert_marked_at(folder, ORIGIN + SPACING * MARK)
        shutil.rmtree(folder)


def test_slices_lie_where_they_say_however_numbers_are_written(tmp_path, monkeypatch):
    """ITK writes .5 for 0.5: VTK's reader then takes the slices in an order that is nobody's."""

    def bare(values):
        texts = (f"{v:.9g}" for v in np.ravel(values))
        return "\\".join(re.sub(r"^(-?)0\.", r"\1.", text) for text in texts)

    monkeypatch.setattr("scan_files.numbers", bare)
    array = np.arange(11 * 6 * 7, dtype=np.int16).reshape(11, 6, 7)
    direction = turned(10, -30)
    volume = read(write_dicom(tmp_path / "scan", array, SPACING, ORIGIN, direction))
    for x, y, z in [(0, 0, 0), (6, 5, 10), (3, 1, 4), (2, 4, 7)]:
        world = ORIGIN + direction @ (SPACING * (x, y, z))
        i, j, k = (np.linalg.inv(volume.index_to_model) @ [*world, 1])[:3]
        np.testing.assert_allclose([i, j, k], np.round([i, j, k]), atol=1e-5)
        assert volume.array[round(k), round(j), round(i)] == array[z, y, x]


@pytest.mark.parametrize(
    ("slope", "intercept", "dtype"),
    [(1, -1024, np.int16), (2, 0, np.int16), (0.5, 1, np.float32)],
)
def test_values_are_those_that_the_slices_mean(slope, intercept, dtype, tmp_path):
    """Of 12 bits stored, as a CT's are; one type for all slices, whatever they hold."""
    import pydicom

    folder = dicom_folder(tmp_path)
    for path in folder.iterdir():
        slice_ = pydicom.dcmread(path)
        slice_.BitsStored, slice_.HighBit, slice_.PixelRepresentation = 12, 11, 0
        slice_.RescaleSlope, slice_.RescaleIntercept = slope, intercept
        slice_.save_as(path)
    volume = read(folder)
    assert volume.array.dtype == dtype
    expected = slope * scan().astype(float) + intercept
    assert np.array_equal(np.sort(volume.array.ravel()), np.sort(expected.ravel()))


@pytest.mark.parametrize("damage", ["ends early", "no number"])
def test_a_damaged_slice_is_said(damage, tmp_path):
    folder = dicom_folder(tmp_path)
    last = folder / "06.dcm"  # without which those that are left are evenly apart
    content = last.read_bytes()
    rows = content.index(b"\x28\0\x10\0")  # the tag (0028,0010) of how many there are
    if damage == "ends early":
        last.write_bytes(content[:rows])
    else:
        at = content.index(f"{ORIGIN[0]:g}".encode())
        last.write_bytes(content[:at] + b"?" + content[at + 1 :])
    said = rf"1 of 5 files in the folder .*scan are left out.*{last.name} cannot be read"
    with pytest.warns(VDIWarning, match=said):
        volume = read(folder)
    assert volume.dimensions == (7, 6, 4)
    for path in folder.iterdir():
        path.write_bytes(content[:rows])
    with pytest.raises(InvalidVolumeError, match=r"\.dcm cannot be read .* ends within its header"):
        read(folder)


@pytest.mark.parametrize("files", [{}, {"a.jpg": b"no slice"}, {"b.dcm": bytes(128) + b"DICM"}])
def test_a_folder_without_slices(files, tmp_path, capsys):
    (tmp_path / "scan").mkdir()
    for name, content in files.items():
        (tmp_path / "scan" / name).write_bytes(content)
    with pytest.raises(InvalidVolumeError, match=r"scan holds no slices .* give the folder"):
        read(tmp_path / "scan")
    for verb in (["generate", "-o", str(tmp_path / "a.vdi")], ["compare", "--out", str(tmp_path)]):
        assert cli.main([verb[0], str(tmp_path / "scan"), *verb[1:]]) == 1
        assert "holds no slices" in capsys.readouterr().err
    assert not (tmp_path / "a.vdi").exists()


def test_without_pydicom_the_extra_is_named(tmp_path, monkeypatch):
    folder = dicom_folder(tmp_path)
    monkeypatch.setitem(sys.modules, "pydicom", None)
    with pytest.raises(MissingDependencyError, match=r"pydicom.*pyvista-vdi\[medical\]"):
        read(folder)


def test_several_series_are_named(tmp_path):
    folder = dicom_folder(tmp_path)
    other = write_dicom(tmp_path / "other", scan()[:3], SPACING, ORIGIN, np.eye(3), series="7.8")
    for file in other.iterdir():
        shutil.copy(file, folder / f"other{file.name}")
    said = (
        r"holds 2 volumes, 0: 'series 1\.2\.3': 7 x 6 x 5 .*1: 'series 7\.8': 7 x 6 x 3 .*series="
    )
    with pytest.raises(UnsupportedError, match=said):
        read(folder)
    assert read(folder, series="series 7.8").dimensions == (7, 6, 3)


def test_slices_that_do_not_make_a_volume(tmp_path):
    folder = dicom_folder(tmp_path)
    along, across = np.eye(3)[:2], turned(0, 90)[:, :2].T
    for place, orientation, options, error, message in (
        (ORIGIN, along, {}, InvalidVolumeError, "several slices .* lie in the same place"),
        (ORIGIN + 40, across, {}, InvalidVolumeError, "turned against each other"),
        (
            *(ORIGIN + np.array([0, 0, 7.5]), along, {"syntax": JPEG}),
            *(UnsupportedError, rf"10\.dcm .*{re.escape(JPEG)}.*gdcmconv --raw"),
        ),
    ):
        data = dicom_slice(scan()[0], place, orientation, SPACING, **options)
        (folder / "10.dcm").write_bytes(data)
        with pytest.raises(error, match=message):
            read(folder)
    with pytest.raises(UnsupportedError, match="gdcmconv --raw"):
        read(folder / "10.dcm")
    with pytest.raises(InvalidVolumeError, match=r"00\.dcm holds one slice of 7 x 6 .* folder"):
        read(folder / "00.dcm")


def test_a_missing_slice_is_said(tmp_path):
    folder = dicom_folder(tmp_path)
    (folder / "03.dcm").unlink()  # the third
    with pytest.warns(VDIWarning, match=r"scan are 2\.5 to 5 apart, and are taken as 3\.33333"):
        volume = read(folder)
    assert volume.dimensions == (7, 6, 4)


def test_slices_that_do_not_say_where_they_lie(tmp_path):
    folder = tmp_path / "scan"
    folder.mkdir()
    for z, pixels in enumerate(scan()):
        (folder / f"{z}.dcm").write_bytes(dicom_slice(pixels, None, None, SPACING, number=z))
    with pytest.warns(VDIWarning, match="do not say where they lie .* 2.5 apart, in an order"):
        assert read(folder).spacing == tuple(SPACING)


def test_a_vdi_is_no_volume(tmp_path):
    vdi = random_vdi(np.random.default_rng(1))
    for name in ("a.vdi", *["a.exr"] * ("deep_exr" in registry.extensions())):
        vdi.save(tmp_path / name)
        with pytest.raises(InvalidVolumeError, match=f"{name} is a VDI, not a volume"):
            read(tmp_path / name)
    pv.read(tmp_path / "a.vdi").save(tmp_path / "a.vti")
    with pytest.raises(InvalidVolumeError, match=r"a\.vti is a VDI in its VTK form"):
        read(tmp_path / "a.vti")


@pytest.mark.parametrize("kind", ["vti", "mha", "mhd", "nii", "nii.gz", "nrrd"])
def test_a_folder_that_is_named_like_a_file(kind, tmp_path):
    (tmp_path / f"a.{kind}").mkdir()
    with pytest.raises(InvalidVolumeError, match=rf"a\.{kind} (holds no slices|cannot be read)"):
        read(tmp_path / f"a.{kind}")


@pytest.mark.parametrize("written", ["mha", "nii", "vti"])
@pytest.mark.parametrize("named", ["nii.gz", "nrrd", "dat"])
def test_another_formats_name_changes_nothing(written, named, tmp_path):
    path = tmp_path / f"b.{named}"
    shutil.copy(write_in(written, tmp_path, np.eye(3)), path)
    assert_marked_at(path, SPACING * MARK + ORIGIN)


@pytest.mark.parametrize("kind", ["mha", "nii", "nii.gz"])
def test_a_file_that_ends_too_soon(kind, tmp_path):
    path = write_in(kind, tmp_path, np.eye(3))
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(InvalidVolumeError, match="cannot be read as"):
        read(path)


def test_an_orientation_without_extent_is_refused(tmp_path):
    path = write_nifti(tmp_path / "a.nii", scan(), SPACING, sform=np.zeros((4, 4)))
    with pytest.raises(InvalidVolumeError, match="states an orientation that cannot be inverted"):
        read(path)


@pytest.mark.parametrize(
    ("line", "now", "message"),
    [
        (2, "b1 0 0 0", "lines 3 to 6 must each"),
        (2, "999999 0 0 0", "its head says 999999 atoms"),
        (3, "99999 1 0 0", "and it has"),
        (4, "4 0 nan 0", "lines 3 to 6 must each"),
        (5, "0 0 0 1", "and it has"),
        (5, "", "lines 3 to 6 must each"),
        (6, "166 0 0 0 0", "its head says 1 atoms"),
    ],
)
def test_heads_of_cubes_that_end_vtks_process_are_refused(line, now, message, tmp_path):
    path = KINDS["cube"](tmp_path).path
    lines = path.read_text().splitlines()
    lines[line] = now
    path.write_text("\n".join(lines))
    with pytest.raises(InvalidVolumeError, match=message):
        pvdi.read_volume(path)
