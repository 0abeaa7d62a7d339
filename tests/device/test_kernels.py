"""Kernels and their arguments: by name, and of the declared types."""

from __future__ import annotations

import numpy as np
import pytest

from pyvista_vdi.device import programs
from pyvista_vdi.errors import DeviceError, InvalidArgumentError

SOURCE = """\
#define SHIFT_PARAMETERS \\
    const uint4 shift
typedef struct { int n; float4 weights; float factor; } Affine;
__kernel void affine(
    Affine by, __global const T *x, // or 0
    SHIFT_PARAMETERS, /* (room) */ __local float *room, __global T *y)
{
    const int i = get_global_id(0);
    room[get_local_id(0)] = (x ? x[i] : 1) * by.factor + by.weights.w + shift.y;
    if (i < by.n)
        y[i] = room[get_local_id(0)];
}
"""


@pytest.fixture
def affine(monkeypatch):
    monkeypatch.setattr(programs, "expand", lambda path: SOURCE)
    return "affine.cl", "affine"


def test_wrong_arguments_are_refused_by_name(runtime, affine):
    with runtime.buffer((8,), name="eight") as y, runtime.buffer((8,), np.int32) as integers:
        launch = runtime.bind(*affine, {"T": "float"}, x=None, y=y)
        with pytest.raises(
            InvalidArgumentError, match=r"'affine' of affine\.cl was .*without.*by, shift, room"
        ):
            launch(8, 4)
        with pytest.raises(
            InvalidArgumentError, match="no argument 'pairs'.*it takes by, x, shift"
        ):
            launch.set(pairs=y)
        for name, values in {
            "y": (integers, 3, np.zeros(8, np.float32)),
            "shift": ((1, 2, 3), (0, 0, 0, -1), (0.5, 0, 0, 0), None, y),
            "room": (1.5, y),
            "by": (1, np.zeros(1), {"n": 1, "weights": (0, 0, 0, 0)}),
        }.items():
            for value in values:
                with pytest.raises(TypeError, match=f"'{name}' of kernel 'affine' is declared as"):
                    launch.set(**{name: value})
        by = {"n": 1, "weights": (0, 0, 0, 0), "factor": 1}
        launch.set(by=by, shift=(0, 0, 0, 0), room=4)
        with pytest.raises(DeviceError, match=r"launching 'affine' .*\(8,\) by \(3,\)"):
            launch(8, 3)
    with pytest.raises(DeviceError, match="'eight' was used after its release"):
        launch(8, 4)
