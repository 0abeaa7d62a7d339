"""VDIs as VTK's data: the canonical form, in memory and files, bit for bit."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
import pyvista as pv
import strategies

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidVDIError
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.vtk_pipeline import (
    vdi_from_image,
    vdi_to_image,
)
from pyvista_vdi.vtk_pipeline.vtk import (
    vtkXMLImageDataReader,
    vtkXMLImageDataWriter,
)

#: Metadata that text could spoil.
METADATA = {
    "nan": math.nan,
    "infinite": [math.inf, -math.inf],
    "negative zero": -0.0,
    "smallest": 5e-324,
    "third": 1 / 3,
    "large": 2**60 + 1,
    "text": 'ü "<&>]]>\u2028\x00\x07\U0001f600 \\ ',
    "none": None,
    "nested": {"a": [True, {"b": []}]},
}


def some_vdi(seed=1, **options):
    vdi = strategies.random_vdi(np.random.default_rng(seed), **options)
    vdi.metadata.update(METADATA)
    return vdi


def empty_vdi():
    camera = pvdi.Camera((0, 0, 5), (0, 0, 0), (0, 1, 0))
    return VDI(camera, (4, 3), [0] * 13, [], [], [], [], (-1, 1, -1, 1, -1, 1), metadata=METADATA)


def vdi_of_hard_numbers():
    """Depths and optical depths that printing and parsing may spoil, in a parallel projection."""
    camera = pvdi.Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), parallel_projection=True)
    tiny, small = np.float32(1e-45), np.finfo(np.float32).tiny
    front = np.array([-3e38, -small, -0.0, tiny, 1 / 3, 16777215.0], np.float32)
    back = np.array([-1e38, -tiny, 0.0, small, 0.5, 16777216.0], np.float32)
    back[2] = tiny
    front[3] = tiny
    color = np.array([[0, 1, 1 / 3], [tiny, small, 0.1]] * 3, np.float32)
    tau = np.array([0, tiny, small, 1e-20, 3e38, np.nextafter(np.float32(1), np.float32(2))])
    return VDI(
        camera,
        (3, 1),
        [0, 6, 6, 6],
        front,
        back,
        color,
        tau,
        (-1, 1, -1, 1, -1, 1),
        depth_origin=1e300 / 3,
        metadata=METADATA,
    )


VDIS = {
    "some": some_vdi,
    "empty": empty_vdi,
    "hard numbers": vdi_of_hard_numbers,
}


def assert_same(vdi, expected, *, text=False):
    assert vdi.equals(expected)
    assert repr(vdi.metadata) == repr(expected.metadata)  # NaN is not equal to itself
    if text:
        return  # VTK 9.4 writes -0 as 0, 9.7 does not
    for name in ("front", "back", "color", "optical_depth"):
        bits = [getattr(v, name).view(np.uint32) for v in (vdi, expected)]
        np.testing.assert_array_equal(*bits)  # zeros have signs


@pytest.mark.parametrize(
    ("mode", "compressor"),
    [
        ("Ascii", "None"),  # text is not compressed
        ("Binary", "ZLib"),
        ("Appended", "LZ4"),
    ],
)
@pytest.mark.parametrize("kind", VDIS)
def test_files_of_vtk_and_pyvista_keep_every_bit(kind, mode, compressor, tmp_path):
    vdi, path, text = VDIS[kind](), tmp_path / "v.vti", mode == "Ascii"
    writer = vtkXMLImageDataWriter()
    writer.SetInputData(vdi_to_image(vdi))
    writer.SetFileName(str(path))
    getattr(writer, f"SetDataModeTo{mode}")()
    getattr(writer, f"SetCompressorTypeTo{compressor}")()
    assert writer.Write()
    reader = vtkXMLImageDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    pv.read(path).save(tmp_path / "again.vti", binary=not text)
    for back in (
        vdi_from_image(reader.GetOutput()),
        vdi_from_image(pv.read(path)),
        vdi_from_image(pv.read(tmp_path / "again.vti")),
    ):
        assert_same(back, vdi, text=text)


def text_with(image, **changes):
    return json.dumps({**json.loads(image.field_data["vdi"][0]), **changes})


def described(text):
    return lambda image: image.field_data.set_array(
        [text_with(image, **text) if isinstance(text, dict) else text], "vdi"
    )


def counting(value):
    return lambda image: image.point_data.set_array(np.full(16, value), "count")


#: Damage to the image of a VDI of 4 x 4 lists, and words of what is said of it.
DAMAGES = {
    "plain": (lambda i: i.field_data.remove("vdi"), "not a VDI: it has no field string 'vdi'"),
    "no backs": (lambda i: i.field_data.remove("back"), "lacks its field array 'back'"),
    "no json": (described("{"), "description is damaged"),
    "no camera": (described('{"form_version": 1}'), "damaged.*camera"),
    "newer": (described({"form_version": 9}), "version 9.*update pyvista-vdi"),
    "wrong counts": (lambda i: i["count"].fill(1), "the number of supersegments"),
    # Found by fuzzing: errors of NumPy and Python came out, or gigabytes were taken
    "a list": (described("[]"), "description is damaged"),
    "deep": (described("[" * 9000), "description is damaged"),
    "version": (described({"form_version": "x"}), "damaged"),
    "window": (lambda i: setattr(i, "dimensions", (60000, 60000, 1)), "60000 x 60000 x 1 points"),
    "planes": (lambda i: setattr(i, "dimensions", (4, 2, 2)), "4 x 2 x 2 points"),
    "nan": (counting(np.nan), "whole numbers >= 0"),
}


@pytest.mark.parametrize(("damage", "message"), DAMAGES.values(), ids=DAMAGES)
def test_damaged_forms_are_refused(damage, message):
    image = pv.wrap(vdi_to_image(some_vdi(5, window=(4, 4)))).copy()
    damage(image)
    with pytest.raises(InvalidVDIError, match=message):
        vdi_from_image(image)
