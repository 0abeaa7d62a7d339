"""What is refused, by whom, and words of the message: never by Python or NumPy.

Many of these were found by fuzzing: errors of NumPy and Python came out, or a warning.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from pyvista_vdi import VDI, AmbientOcclusion, Cropping, TransferFunction, Volume
from pyvista_vdi.errors import (
    InvalidArgumentError,
    InvalidCameraError,
    InvalidVDIError,
    InvalidVolumeError,
)
from pyvista_vdi.model.camera import MAX_WINDOW_EDGE, Camera, check_window_size
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.model.options import RenderOptions
from pyvista_vdi.model.packing import DEPTH_CODES

pytestmark = pytest.mark.fast

#: An integer that is beyond float64, and an array where a number is wanted.
HUGE, TWO = 10**400, np.array([1, 2])
NAN, INF = math.nan, math.inf
PLANES = (0, 1, 0, 1, 0, 1)
NORMALS = ([[1, 0, 0], [0, 1, 0], [1, 1, 0]], [1, 0, 0], [[NAN] * 3] * 3, "x")
FLAT = np.diag([1.0, 1.0, 0.0, 1.0])
PROJECTIVE = np.eye(4) + np.diag([0, 0, 1], -1)
PICTURE, CUBE = np.zeros((24, 32, 3)), np.zeros((2, 2, 2))

#: Arguments that each of these takes.
GOOD = {
    Camera: {"position": (0, 0, 5), "focal_point": (0, 0, 0), "view_up": (0, 1, 0)},
    TransferFunction: {
        "colors": [[0, 0, 0], [0.5, 0.25, 1]],
        "opacities": [0.0, 0.75],
        "scalar_range": (-1, 3),
    },
    VDI: {  # three lists of 2, 0 and 1 supersegments
        "camera": Camera((0, 0, 9), (0, 0, 0), (0, 1, 0)),
        "window_size": (3, 1),
        "offsets": [0, 2, 2, 3],
        "front": [1.0, 2.0, 1.5],
        "back": [2.0, 3.0, 1.75],
        "color": [[0, 0, 0], [1, 1, 1], [0.2, 0.4, 0.6]],
        "optical_depth": [0.0, 0.5, 100.0],
        "bounds": (-1, 1, -2, 2, -3, 3),
        "depth_origin": 4.0,
    },
    Volume: {"array": CUBE},
    RenderOptions: {},
}
CAMERA, VALID = Camera(**GOOD[Camera]), VDI(**GOOD[VDI])
#: Those of which a changed copy is refused in the same words.
COPIES = {
    Camera: CAMERA,
    TransferFunction: TransferFunction(**GOOD[TransferFunction]),
    RenderOptions: RenderOptions(),
}
ERRORS = {
    Camera: InvalidCameraError,
    Camera.from_any: InvalidCameraError,
    Camera.from_dict: InvalidCameraError,
    CAMERA.azimuth: InvalidCameraError,
    VDI: InvalidVDIError,
    Volume: InvalidVolumeError,
}


def each(message, *values):
    """The same words for each of some single arguments."""
    return [((value,), message) for value in values]


def long_list(count):
    faces = np.arange(count + 1) + 1.0
    media = np.full((count, 3), 0.5), np.ones(count)
    return VDI(CAMERA, (1, 1), [0, count], faces[:-1], faces[1:], *media, PLANES)


#: By what is called: its arguments, of keywords where they are a dictionary, and the words; a row
#: for each check.
REFUSED = {
    AmbientOcclusion: [
        ({"radius": 0}, "a length in model units above 0; got 0"),
        ({"radius": "far"}, "a length in model units above 0; got 'far'"),
        ({"strength": NAN}, "strength .* from 0 to 1; got nan"),
        ({"directions": 11}, "from 12 to 4096; got 11"),
    ],
    AmbientOcclusion.from_any: [
        *each("True, a radius in model units or a pyvista_v", "much", (1, 2), {"radius": 1}),
    ],
    Cropping: [
        (((HUGE,) * 6,), "cropping takes six planes"),
        ((PLANES, TWO), "27 flags, .* got array"),
        ((PLANES, "hedge"), "27 flags, 0 to 0x7ffffff, or one of 'subvolume'.*got 'hedge'"),
        *(((PLANES, 0, normals), "three independent directions.*got") for normals in NORMALS),
    ],
    RenderOptions: [
        ({"clipping_planes": [[HUGE] * 6]}, "clipping_planes must be"),
        ({"clipping_planes": [[0, 0, 0, 0, 0, 0]]}, "plane"),
        ({"cropping": (1, 2, 3)}, "cropping"),
        ({"opacity_multiplier": -1}, "opacity_multiplier"),
        ({"preview_samples": "8"}, "preview_samples must be .* got '8'"),
        ({"preview_samples": 2**23 + 1}, "preview_samples must be"),
        ({"transmittance_cutoff": 1}, "transmittance_cutoff must be .* from 0 to below 1; got 1"),
    ],
    TransferFunction: [
        ({"opacities": [0.5]}, "as many opacities as colors; got 1 and 2"),
        ({"opacities": [[0, 1]]}, r"opacities .* of shape \(n,\); got .* of shape \(1, 2\)"),
        ({"opacities": [0, 1.5]}, r"opacities must be numbers from 0 to 1.* from 0.0 to 1.5"),
        ({"opacities": [NAN, 1]}, "opacities must be numbers from 0 to 1.* from nan to nan"),
        ({"opacities": ["thick", "thin"]}, "opacities must be numbers.*thick"),
        ({"colors": [[0, 0, 0, 1]] * 2}, r"colors .* of shape \(n, 3\); got .* of shape \(2, 4\)"),
        ({"colors": [[0, 0, 255]] * 2}, "colors must be numbers from 0 to 1.* from 0.0 to 255.0"),
        ({"scalar_range": (3, 1)}, r"\(clim\) must be two finite numbers, the smaller first"),
        ({"scalar_range": (0, INF)}, "must be two finite numbers"),
        ({"scalar_range": ("a", "b")}, "must be two finite numbers"),
        ({"unit_distance": 0}, "unit_distance must be a length in model units above 0; got 0"),
        ({"unit_distance": "x"}, "unit_distance .* got 'x'"),
        ({"interpolation": "cubic"}, "interpolation must be 'nearest' or 'linear'; got 'cubic'"),
    ],
    TransferFunction.from_dict: each(
        "no description of a transfer function", None, [1], {}, {"shading": {"glow": 1}}
    ),
    Camera: [
        ({"focal_point": (0, 0, 5)}, r"and focal point are the same point, \(0.0, 0.0, 5.0\)"),
        ({"view_up": (0, 0, 0)}, "is zero or parallel to"),
        ({"view_up": (0, 0, 7)}, r"or parallel to the direction of projection \(0.0, 0.0, -1.0\)"),
        ({"position": (0, 0, NAN)}, "position must be 3 finite numbers"),
        ({"position": "here"}, "position must be 3 finite numbers; got 'here'"),
        ({"position": (1e308, 0, 0), "focal_point": (-1e308, 0, 0)}, "too far apart"),
        ({"view_angle": 180}, "view_angle .* got 180"),
        ({"view_angle": NAN, "parallel_projection": True}, "view_angle must lie between"),
        ({"parallel_scale": [1]}, "parallel_scale .* got nan"),
        ({"window_center": (0, 0, 0)}, "window_center must be 2 finite numbers"),
        ({"model_transform": np.eye(3)}, "model_transform must be 4 x 4"),
        ({"model_transform": FLAT}, "model_transform cannot be inverted"),
        ({"model_transform": PROJECTIVE}, "model_transform must be 4 x 4 finite numbers, affine"),
    ],
    Camera.from_any: [(({},), "got dict")],
    Camera.from_dict: [(([1],), "no camera's description: .* must be a mapping, not list")],
    CAMERA.azimuth: each("turned by a finite angle; got", INF, "far"),
    CAMERA.tile: [(((9, 9), (0, 0), (5, 0)), r"tile_size must be .* got \(5, 0\)")],
    check_window_size: [
        (((5, MAX_WINDOW_EDGE + 1),), r"from 1 to 65536 whole pixels each; got \(5, 65537\)"),
        (((2.5, 5),), r"whole pixels each; got \(2.5, 5\)"),
        ((5,), "whole pixels each; got 5"),
    ],
    VDI: [
        ({"offsets": [0, 2, 3]}, r"W \* H \+ 1 = 4 numbers .*; got 3, \[0 2 3\]"),
        ({"offsets": [1, 2, 2, 3]}, r"from 0 .* \[1 2 2 3\]"),
        ({"offsets": [0, 2, 1, 3]}, r"never decrease, .* \[0 2 1 3\]"),
        ({"offsets": [0, 1, 2, 2]}, r"to the number of supersegments, .*'front': 3"),
        ({"offsets": [0, 1.5, 2, 3]}, "offsets must be whole numbers >= 0, .* float64 of shape"),
        ({"offsets": None}, "offsets must be whole numbers >= 0, in an array of .*; got None"),
        ({"back": [2.0, 3.0]}, "'front': 3, 'back': 2, 'color': 3, "),
        ({"color": [0, 0, 0]}, r"of shape \(n, 3\); got .* of shape \(3,\)"),
        ({"front": [[1, 2], [3]]}, "front must be an array of numbers"),
        (
            {"front": [1.0, 3.0, 1.5]},
            r"supersegment 1 \(list 0: pixel x=0, y=0\) breaks the rule 'front < back': front 3.0",
        ),
        ({"front": [1.0, 1.5, 1.5]}, "1 .* 'sorted within its list and not overlapping'"),
        ({"front": [NAN, 2.0, 1.5]}, "supersegment 0 .* 'front and back finite'"),
        ({"front": [-4.5, 2, 1.5]}, r"0 .* 'in front of the eye \(depth >= 0\)'.*depth_origin 4.0"),
        ({"back": [2.0, 1e300, 1.75]}, "supersegment 1 .* 'front and back finite'"),
        ({"color": [[0, NAN, 0], [1, 1, 1], [0, 0, 0]]}, "supersegment 0 .* '0 <= color <= 1'"),
        ({"optical_depth": [0, INF, 1]}, "supersegment 1 .* 'optical_depth >= 0 and finite'"),
        ({"depth_origin": INF}, "depth_origin must be finite; got inf"),
        ({"depth_origin": "3"}, "depth_origin must be finite; got"),
        ({"bounds": (1, -1, *PLANES[2:])}, "bounds must be six finite numbers"),
        ({"bounds": {}}, "bounds must be six finite numbers"),
        ({"metadata": [1]}, "metadata must be a dictionary; got list"),
    ],
    long_list(DEPTH_CODES + 1).with_precision: [
        (("8-byte",), "a list of 16384 supersegments .* 'exact'"),
        (("4-byte",), "'exact' or '8-byte'; got '4-byte'"),
    ],
    Volume: [
        ({"array": np.zeros((3, 3))}, r"three-dimensional array.*; got shape \(3, 3\)$"),
        ({"array": np.zeros((3, 3, 3, 4))}, r"per point; got shape \(3, 3, 3, 4\)"),
        ({"array": np.zeros((0, 3, 3))}, r"or none: its shape is \(0, 3, 3\)"),
        ({"array": np.zeros((3, 1, 3))}, "only one plane of points.* two points along each"),
        ({"array": CUBE.astype(complex)}, "voxels of type complex128 are not supported"),
        ({"array": np.full((2, 2, 2), "a")}, "are not supported: convert to one of uint8"),
        ({"array": np.full((2, 2, 2), 2**53 + 1)}, "hold values up to 9007199254740993"),
        ({"array": [[1, 2], [3]]}, "a volume is an array of numbers"),
        ({"spacing": (1, 1, -1)}, "flip the array"),
        ({"spacing": "thin"}, "spacing must be 3 finite numbers; got 'thin'"),
        ({"origin": (0, 0, INF)}, "origin must be 3 finite numbers"),
        ({"direction": np.eye(4)}, "direction must be 3 x 3 finite numbers"),
        ({"direction": np.diag([1, 1, 0])}, "three independent directions as columns"),
    ],
    compare_images: [
        ((PICTURE, PICTURE[:, 1:]), "different sizes, 32 x 24 and 31 x 24"),
        ((PICTURE.astype(np.uint8), PICTURE), "got uint8 of shape"),
        ((PICTURE[0], PICTURE), r"got float64 of shape \(32, 3\)"),
        ((PICTURE * NAN, PICTURE), "finite floats"),
    ],
}


@pytest.mark.parametrize(
    ("call", "arguments", "message"),
    [
        pytest.param(call, *row, id=f"{getattr(call, '__qualname__', call)}-{number}")
        for call, rows in REFUSED.items()
        for number, row in enumerate(rows)
    ],
)
def test_what_is_refused(call, arguments, message):
    error = ERRORS.get(call, InvalidArgumentError)
    named = isinstance(arguments, dict)
    given = () if named else arguments
    keywords = {**GOOD.get(call, {}), **arguments} if named else {}
    with pytest.raises(error, match=message):
        call(*given, **keywords)
    if call in COPIES:
        with pytest.raises(error, match=message):
            COPIES[call].replace(**arguments)
