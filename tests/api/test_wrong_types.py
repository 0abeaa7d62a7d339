"""Every public entry with values of wrong types: only the package's own errors come out."""

from __future__ import annotations

import inspect
import warnings
from pathlib import Path

import numpy as np
import pytest
from extension_marks import cases

import pyvista_vdi as pvdi
from pyvista_vdi.errors import VDIError
from pyvista_vdi.model.classification import Classification

ARRAY = np.random.default_rng(0).random((6, 5, 4), dtype=np.float32)
VOLUME = pvdi.Volume(ARRAY)
CAMERA = pvdi.Camera((1.5, -20, 3), (1.5, 2, 2.5), (0, 0, 1))
TABLE = pvdi.TransferFunction(np.eye(3), [0.0, 0.3, 0.6], (0, 1))
SIZE = (6, 5)


def wrong_values(vdi):
    """Return values of all kinds, of which some are right for some arguments."""
    return [
        None, True, -1, 2.5, float("nan"), float("inf"), 10**400, 1j, "x", "", b"x", object(),
        abs, int, [], (), {}, {"a": 1}, [1, 2, 3], ["a", "b"], (1, 2), (1,), [None, None],
        [[1, 2], [3]], np.zeros(3), np.zeros((2, 2)), np.array("x"), np.zeros((3, 3, 3), complex),
        Path("x"), slice(None), np.float32(0.5), range(3), iter([1, 2]), ARRAY, VOLUME, CAMERA,
        TABLE, vdi,
    ]  # fmt: skip


MADE = {"volume": VOLUME, "camera": CAMERA, "window_size": SIZE}
TABLED = {**MADE, "transfer_function": TABLE}
LOOK = tuple(Classification.declared)
OF_GENERATE = [
    each.name
    for each in inspect.signature(pvdi.generate).parameters.values()
    if each.name not in (*MADE, *LOOK) and each.kind is not each.VAR_KEYWORD
]
#: Settings that generate has no use for.
_OF_PICTURES = ("transmittance_cutoff", "regenerate_below", "coverage")
#: For each entry: the function, what is right, and further arguments.
ENTRIES = {
    "generate": lambda vdi: (pvdi.generate, TABLED, OF_GENERATE),
    "looks": lambda vdi: (pvdi.generate, MADE, LOOK[:-1]),
    "render_volume": lambda vdi: (
        pvdi.render_volume,
        TABLED,
        [
            *("opaque_depth", "clipping_planes", "cropping", "lights"),
            *("early_termination", "ambient_occlusion", "opacity_multiplier", "settings"),
        ],
    ),
    "Settings": lambda vdi: (pvdi.Settings, {}, None),
    "Settings of a VDI": lambda vdi: (
        lambda **given: pvdi.generate(**TABLED, settings=pvdi.Settings(**given)),
        {},
        [name for name in pvdi.Settings.declared if name not in _OF_PICTURES],
    ),
    "render": lambda vdi: (pvdi.render, {"vdi": vdi, "camera": CAMERA}, None),
    "pick": lambda vdi: (pvdi.pick, {"vdi": vdi, "camera": CAMERA, "pixel": (3, 3)}, None),
    "read": lambda vdi: (pvdi.read, {"path": "none.vdi"}, ["progress", "camera"]),
    "generate_series": lambda vdi: (
        pvdi.generate_series,
        {"volumes": [VOLUME], "camera": CAMERA, "window_size": SIZE, "transfer_function": TABLE},
        ["times", "progress", "max_supersegments"],
    ),
    "generate_set": lambda vdi: (
        pvdi.generate_set,
        {"volume": VOLUME, "views": [CAMERA], "window_size": (16, 12), "lists": 0.5}
        | {"max_supersegments": 4, "transfer_function": TABLE},
        ["camera", "half_angle", "progress"],
    ),
    "Volume": lambda vdi: (pvdi.Volume, {"array": ARRAY}, None),
    "Camera": lambda vdi: (
        pvdi.Camera,
        {"position": (0, 0, 9), "focal_point": (0, 0, 0), "view_up": (0, 1, 0)},
        None,
    ),
    "TransferFunction": lambda vdi: (
        pvdi.TransferFunction,
        {"colors": np.eye(3), "opacities": [0, 0.1, 0.2], "scalar_range": (0, 1)},
        None,
    ),
    **{
        name: lambda vdi, name=name: (getattr(pvdi, name), {}, None)
        for name in ("Light", "Lights", "Shading", "AmbientOcclusion")
    },
    "VDISeries": lambda vdi: (pvdi.VDISeries, {"steps": [vdi], "times": [0]}, None),
    "VDI": lambda vdi: (
        pvdi.VDI,
        {name: getattr(vdi, name) for name in inspect.signature(pvdi.VDI).parameters},
        None,
    ),
    "VDI.with_precision": lambda vdi: (vdi.with_precision, {"precision": "exact"}, None),
    "VDI.save": lambda vdi: (
        vdi.save,
        {"path": "v.vdi"},
        ["path", "precision", "compression", "level", "progress"],
    ),
    "TransferFunction.from_dict": lambda vdi: (
        pvdi.TransferFunction.from_dict,
        {"state": TABLE.to_dict()},
        None,
    ),
}


@pytest.fixture
def vdi(default_runtime, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return pvdi.generate(**TABLED)


@pytest.mark.parametrize(
    "entry",
    [
        pytest.param(
            *case.values, marks=[*case.marks, *[pytest.mark.slow] * (name == "generate_set")]
        )
        for name, case in zip(ENTRIES, cases(*ENTRIES), strict=True)
    ],
)
def test_only_errors_of_the_package_come_out(entry, vdi):
    if entry == "looks":
        pytest.importorskip("pyvista")  # its colour maps
    function, right, more = ENTRIES[entry](vdi)
    named = inspect.signature(function).parameters.values() if more is None else ()
    names = [p.name for p in named if p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)]
    escaped = []
    # A wrong communicator would begin MPI in this process: tests/extensions/insitu gives ranks one
    for name in dict.fromkeys(n for n in [*right, *names, *(more or ())] if n != "comm"):
        for value in wrong_values(vdi):
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    function(**{**right, name: value})
            except (VDIError, IndexError) as error:  # of a place outside, as of sequences
                if len(str(error)) < 15:
                    escaped.append((name, value, "says nothing", str(error)))
            except Exception as error:
                escaped.append((name, repr(value)[:40], repr(error)[:120]))
    assert not escaped
