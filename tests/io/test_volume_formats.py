"""Volumes in files of sixty kinds: values, place, direction and unit, against another library.

And what is truncated, damaged, missing or foreign: right, or a sentence, and no process ends.
"""

from __future__ import annotations

import logging
import subprocess
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from volume_kinds import ITK, ITK_PAGES, KINDS, NEEDS

import pyvista_vdi as pvdi
from pyvista_vdi.errors import (
    InvalidArgumentError,
    InvalidVolumeError,
    UnsupportedError,
    VDIError,
)
from pyvista_vdi.io.volumes import table


def made(name, folder):
    for library, names in NEEDS.items():
        if name.startswith(tuple(names.split())):
            pytest.importorskip(library)
    return KINDS[name](folder)


def loaded(volume):
    return volume.load() if volume.chunked else volume


def sampled(values):
    """The corners' indices (z, y, x), and a hundred others."""
    shape = values.shape[:3]
    corners = np.stack(np.meshgrid(*[(0, n - 1) for n in shape]), -1).reshape(-1, 3)
    rng = np.random.default_rng(1)
    return np.concatenate([corners, rng.integers(0, shape, (100, 3))])


@pytest.mark.parametrize("name", KINDS)
def test_values_place_and_unit(name, tmp_path):
    right = made(name, tmp_path)
    volume = loaded(pvdi.read_volume(right.path, **right.options))
    assert volume.unit == right.unit
    assert sorted(volume.array.shape) == sorted(right.values.shape)
    for z, y, x in sampled(right.values):
        world = right.to_world @ [x, y, z, 1]
        i, j, k = (np.linalg.inv(volume.index_to_model) @ world)[:3]
        assert np.allclose([i, j, k], np.round([i, j, k]), atol=2e-4)
        value = volume.array[round(k), round(j), round(i)]
        assert np.allclose(value, right.values[z, y, x], rtol=1e-6, equal_nan=True)
    listed = pvdi.list_volumes(right.path)
    assert volume.dimensions in [each.dimensions for each in listed]


def kinds_by_format(folder):
    """The rows of the page's table: what these tests read of each format."""
    found = {}
    for name, make in KINDS.items():
        (folder / name).mkdir()
        path = make(folder / name).path
        if path.is_dir():
            format_ = "zarr" if ".zarr" in path.name else "folders of slices"
        else:
            format_ = table.format_of(path).name
        found.setdefault(format_, []).append(name.replace("_", " "))
    return [f"| {format_} | {', '.join(names)} |" for format_, names in found.items()]


def test_the_page_lists_what_is_tried(tmp_path):
    for library in (*NEEDS, "h5py", "pydicom", "pyvista", "imagecodecs", "scipy", "tifffile"):
        pytest.importorskip(library)
    pytest.importorskip("zarr", minversion="3")
    page = Path(__file__).parents[2] / "docs" / "files.md"
    if not page.is_file():
        pytest.skip("the documentation is not beside the tests")
    rows = [
        "| format | kinds of files that the tests make |",
        "|---|---|",
        *kinds_by_format(tmp_path),
    ]
    assert "\n".join(rows) in page.read_text(encoding="utf-8")


def itk_image(right):
    """What SimpleITK reads: of one time and one channel."""
    sitk = pytest.importorskip("SimpleITK")
    if right.path.is_dir():
        names = sitk.ImageSeriesReader.GetGDCMSeriesFileNames(str(right.path))
        return sitk.ReadImage(names or sorted(map(str, right.path.iterdir())))
    image = sitk.ReadImage(str(right.path))
    if "time" in right.options and image.GetDimension() == 4:
        image = image[:, :, :, right.options["time"]]
    if "channel" in right.options and image.GetNumberOfComponentsPerPixel() > 1:
        image = sitk.VectorIndexSelectionCast(image, right.options["channel"])
    return image


@pytest.mark.parametrize("name", ITK)
def test_simpleitk_says_the_same(name, tmp_path):
    right = made(name, tmp_path)
    image = itk_image(right)
    volume = pvdi.read_volume(right.path, **right.options)
    values = itk_values(image)
    assert sorted(volume.array.shape) == sorted(values.shape)
    turn = np.diag([-1, -1, 1]) if right.flipped else np.eye(3)
    for z, y, x in sampled(values):
        world = turn @ image.TransformIndexToPhysicalPoint([int(x), int(y), int(z)])
        i, j, k = np.round((np.linalg.inv(volume.index_to_model) @ [*world, 1])[:3], 3)
        assert np.allclose(volume.array[int(k), int(j), int(i)], values[z, y, x], rtol=1e-6)


@pytest.mark.parametrize("name", ITK_PAGES)
def test_simpleitk_has_the_same_pages(name, tmp_path):
    right = made(name, tmp_path)
    pages = itk_values(itk_image(right))[ITK_PAGES[name]]
    assert np.array_equal(pvdi.read_volume(right.path, **right.options).array, pages[:, ::-1])


def itk_values(image):
    return sys.modules["SimpleITK"].GetArrayFromImage(image)


def tried(path, options):
    """What reading gives: a volume, and whether a sentence was said; or the error's text."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            return loaded(pvdi.read_volume(path, **options)).array, bool(said)
        except VDIError as error:
            return str(error), True


#: XDMF is read in a process of its own, and has a test of its own.
SOON = [name for name in KINDS if not name.startswith("xdmf")]


@pytest.mark.slow
def test_damaged_xdmf_ends_no_process(tmp_path, capfd):
    right = made("xdmf_without_time", tmp_path)
    content = right.path.read_bytes()
    for damaged in (content[:300], content.replace(b"5 6 7", b"5 6 9", 1), content[1:]):
        right.path.write_bytes(damaged)
        with pytest.raises(InvalidVolumeError, match="cannot be read as XDMF"):
            pvdi.read_volume(right.path)
    assert capfd.readouterr() == ("", "")


@pytest.mark.every(4)
@pytest.mark.parametrize("name", SOON)
def test_cut_off_or_changed_is_right_or_a_sentence(name, tmp_path, capfd):
    right = made(name, tmp_path)
    whole = right.path
    if whole.is_dir():
        whole = max((f for f in whole.rglob("*") if f.is_file()), key=lambda f: f.stat().st_size)
    content = whole.read_bytes()
    rng = np.random.default_rng(4)
    capfd.readouterr()
    for share in np.linspace(0, 0.97, 10):
        whole.write_bytes(content[: int(share * len(content))])
        found, said = tried(right.path, right.options)
        if not said:  # what was cut is filling
            assert np.allclose(np.sort(found.ravel()), np.sort(right.values.ravel())), share
    for at in rng.integers(0, len(content), 10):
        changed = bytearray(content)
        changed[at] ^= 1 << rng.integers(8)
        whole.write_bytes(changed)
        tried(right.path, right.options)
    printed = capfd.readouterr()
    assert (printed.out, printed.err) == ("", "")


#: Kinds with checksums, and what stands before what these cover, where that is not all.
CHECKED = {
    "nifti_gz": b"",
    "mgz": b"",
    "afni_gz": b"",
    "nrrd_gzip": b"\n\n",
    "meta_image_compressed": b"LOCAL\n",
    "npz": b"",
    "tiff_big_deflated": b'"shape": ',
    "png_slices": b"",
    "hdf5_checked": b"",
    "zarr_checked": b"",
    "fits_checked": b"",
}


@pytest.mark.parametrize("name", CHECKED)
def test_a_changed_byte_is_found_by_the_checksum(name, tmp_path):
    right = made(name, tmp_path)
    folder = tmp_path if right.path.is_file() else right.path
    files = [f for f in folder.rglob("*") if f.is_file() and f.suffix not in (".HEAD", ".json")]
    file = max(files, key=lambda f: f.stat().st_size)
    content = file.read_bytes()
    begin = content.index(CHECKED[name]) + len(CHECKED[name])
    values = loaded(pvdi.read_volume(right.path, **right.options)).array
    rng, n_found = np.random.default_rng(5), 0
    for at in rng.integers(begin, len(content), 30):
        changed = bytearray(content)
        changed[at] ^= 1 << rng.integers(8)
        file.write_bytes(changed)
        found, _ = tried(right.path, right.options)
        n_found += isinstance(found, str)
        assert isinstance(found, str) or np.array_equal(found, values), at
    assert n_found > 5  # others are no content, the time in gzip's head say


def test_packed_values_of_volumes_given_as_arrays(tmp_path):
    """As NetCDF's conventions: signed bytes that stand for unsigned ones, two fill values."""
    h5py = pytest.importorskip("h5py")
    stored = np.array([-1, -2, 3, 4, 5, 6, 7, 8], np.int8).reshape(2, 2, 2)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["v"] = stored
        file["v"].attrs.update(_Unsigned="true", scale_factor=0.5, _FillValue=[3], missing_value=4)
        file["u"] = stored
        file["u"].attrs["_FillValue"] = "AAAAAAAAFEA="  # 5 as xarray writes it in zarr's format 3
        values = pvdi.Volume(file["v"]).load().array
        assert values.dtype == np.float32
        expected = [127.5, 127, np.nan, np.nan, 2.5, 3, 3.5, 4]
        assert np.array_equal(values.ravel(), expected, equal_nan=True)
        values = pvdi.Volume(file["u"]).load().array
        assert np.isnan(values).sum() == np.isnan(values[1, 0, 0]) == 1


def test_libraries_can_be_imported_after_others_were_used(tmp_path):
    """astropy cannot where its logger was made before."""
    pytest.importorskip("astropy")
    np.save(tmp_path / "a.npy", np.zeros((3, 4, 5)))
    code = "import sys, pyvista_vdi; pyvista_vdi.read_volume(sys.argv[1]); import astropy"
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "a.npy")], check=True)


def test_reading_in_threads_leaves_what_others_log_alone(tmp_path, caplog):
    """What libraries log is heard in the thread that reads; handlers are as before."""
    path = made("tiff_ome_channels", tmp_path).path
    loggers = [logging.getLogger(name) for name in (None, "tifffile")]
    before = [(each.handlers[:], each.filters[:], each.propagate) for each in loggers]
    with ThreadPoolExecutor(4) as pool:
        read = [pool.submit(pvdi.read_volume, path, channel=0) for _ in range(24)]
        while not all(each.done() for each in read):
            loggers[1].warning("by another thread")
            logging.getLogger("of the program").warning("by the program")
    assert len({each.result().array.tobytes() for each in read}) == 1
    assert [(each.handlers, each.filters, each.propagate) for each in loggers] == before
    said = [record.getMessage() for record in caplog.records]
    assert said.count("by another thread") == said.count("by the program") > 0


def test_what_holds_several_is_asked_for_by_name(tmp_path):
    pytest.importorskip("tifffile")
    np.savez(tmp_path / "a.npz", one=np.zeros((3, 4, 5)), two=np.zeros((3, 4, 6)))
    with pytest.raises(UnsupportedError, match=r"holds 2 volumes, 0: 'one': 5 x 4 x 3 .* array="):
        pvdi.read_volume(tmp_path / "a.npz")
    assert pvdi.read_volume(tmp_path / "a.npz", array=1).dimensions == (6, 4, 3)
    with pytest.raises(InvalidArgumentError, match="no array 'three'"):
        pvdi.read_volume(tmp_path / "a.npz", array="three")
    with pytest.raises(InvalidArgumentError, match="holds arrays?, and series='x' was asked for"):
        pvdi.read_volume(tmp_path / "a.npz", series="x")
    kind = made("tiff_ome_channels", tmp_path)
    with pytest.raises(UnsupportedError, match="2 channels, DAPI, GFP, .* channel=0"):
        pvdi.read_volume(kind.path)
    with pytest.raises(InvalidArgumentError, match="has no channel 'RFP'"):
        pvdi.read_volume(kind.path, channel="RFP")
    (listed,) = pvdi.list_volumes(kind.path)
    assert listed.channels == ("DAPI", "GFP")
    assert str(listed).startswith("7 x 6 x 5 uint16, 2 channels (DAPI, GFP)")


def test_one_door(tmp_path):
    """A path is a volume wherever one is taken."""
    kind = made("meta_image", tmp_path)
    assert pvdi.open_volume(kind.path).dimensions == (7, 6, 5)
    from pyvista_vdi.model.inputs import as_volume

    assert as_volume(str(kind.path)).dimensions == (7, 6, 5)
    placed = pvdi.read_volume(kind.path, spacing=(1, 2, 3), origin=(4, 5, 6))
    assert (placed.spacing, placed.origin) == ((1, 2, 3), (4, 5, 6))


FOREIGN = {
    "a.vdb": "OpenVDB",
    "a.am": "Amira",
    "a.bov": "BOV",
    "a.mif": "MRtrix",
    "a.czi": "Zeiss.*OME-TIFF",
    "a.zip": "unpack it",
    "a.mat": "v7.3",
}


@pytest.mark.parametrize("name", FOREIGN)
def test_what_no_library_reads_is_refused_with_the_remedy(name, tmp_path):
    (tmp_path / name).write_bytes(bytes(2000))
    with pytest.raises(UnsupportedError, match=FOREIGN[name]):
        pvdi.read_volume(tmp_path / name)


def test_what_cannot_be_opened_is_said(tmp_path):
    with pytest.raises(InvalidVolumeError, match=r"none\.nrrd does not exist: check .*--example"):
        pvdi.read_volume(tmp_path / "none.nrrd")
    (tmp_path / "empty.tif").touch()
    with pytest.raises(InvalidVolumeError, match="it is empty"):
        pvdi.read_volume(tmp_path / "empty.tif")
    (tmp_path / "loop.nrrd").symlink_to(tmp_path / "loop.nrrd")
    with pytest.raises(InvalidVolumeError, match=r"loop\.nrrd"):
        pvdi.read_volume(tmp_path / "loop.nrrd")
    with pytest.raises(InvalidVolumeError, match=r"cannot be read|does not exist"):
        pvdi.read_volume("x" * 5000)
    header = b"NRRD0005\ntype: short\ndimension: 3\nsizes: 900000 900000 900000\n"
    header += b"endian: little\nencoding: raw\n\n"
    (tmp_path / "enormous.nrrd").write_bytes(header)
    with pytest.raises(VDIError, match=r"enormous\.nrrd.* GiB"):
        pvdi.read_volume(tmp_path / "enormous.nrrd")


def test_sizes_that_are_not_said_are_warned_of(tmp_path):
    tifffile = pytest.importorskip("tifffile")
    said = {"axes": "ZYX", "PhysicalSizeX": 0.5, "PhysicalSizeY": 0.5}
    how = {"photometric": "minisblack", "metadata": said}
    tifffile.imwrite(tmp_path / "a.ome.tif", np.zeros((3, 4, 5), np.uint8), **how)
    with pytest.warns(pvdi.VDIWarning, match=r"0\.5 x 0\.5, and not how far apart slices are"):
        assert pvdi.read_volume(tmp_path / "a.ome.tif").spacing == (0.5, 0.5, 1)
    pydicom, kind = pytest.importorskip("pydicom"), made("dicom", tmp_path)
    for path in kind.path.iterdir():
        data = pydicom.dcmread(path)
        del data.PixelSpacing
        data.save_as(path)
    with pytest.warns(pvdi.VDIWarning, match="do not say how large pixels are, and 1 mm is taken"):
        assert pvdi.read_volume(kind.path).spacing[:2] == pytest.approx((1, 1))


def test_values_that_imagej_calibrates_by_a_curve_are_warned_of(tmp_path):
    tifffile = pytest.importorskip("tifffile")
    for function, c1 in ((0, 0.5), (4, 2.0)):
        said = f"ImageJ=1.53t\nimages=3\nslices=3\ncf={function}\nc0=1.0\nc1={c1}\n"
        how = {"photometric": "minisblack", "description": said, "metadata": None}
        tifffile.imwrite(tmp_path / f"{function}.tif", np.full((3, 4, 5), 8, np.uint8), **how)
    assert (pvdi.read_volume(tmp_path / "0.tif").array == 5).all()
    with pytest.warns(pvdi.VDIWarning, match="ImageJ's function 4, which is not applied"):
        assert (pvdi.read_volume(tmp_path / "4.tif").array == 8).all()


def test_a_cube_in_angstrom_is_refused_for_that(tmp_path):
    pytest.importorskip("pyvista")
    kind = KINDS["cube"](tmp_path)
    lines = kind.path.read_text().splitlines()
    lines[3:6] = [f"-{line}" for line in lines[3:6]]
    kind.path.write_text("\n".join(lines))
    with pytest.raises(UnsupportedError, match="lengths are in angstrom"):
        pvdi.read_volume(kind.path)


def test_what_is_missing_is_named(tmp_path, monkeypatch):
    kind = KINDS["nifti"](tmp_path)
    monkeypatch.setitem(sys.modules, "nibabel", None)
    with pytest.raises(pvdi.MissingDependencyError, match=r'pip install "pyvista-vdi\[medical\]"'):
        pvdi.read_volume(kind.path)


def test_a_plotter_takes_a_path(tmp_path, default_runtime):
    pv = pytest.importorskip("pyvista")
    kind = made("nrrd_rgba", tmp_path)
    plotter = pv.Plotter(off_screen=True)
    actor = plotter.add_vdi(str(kind.path))
    assert actor.bounds == pytest.approx((-10, -4, 20, 27.5, 30, 40))
    plotter.close()
