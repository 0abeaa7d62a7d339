"""Kernels and their arguments: by name, and of the declared types."""

from __future__ import annotations

import numpy as np
import pytest

from pyvista_vdi.device import (
    KernelDeclaration,
    devices,
    list_devices,
    programs,
)
from pyvista_vdi.device.programs import define_options
from pyvista_vdi.errors import DeviceError, InvalidArgumentError
from pyvista_vdi.volume.rays import Variant

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
    return KernelDeclaration("affine.cl", "affine")


def test_wrong_arguments_are_refused_by_name(runtime, affine):
    with runtime.buffer((8,), name="eight") as y, runtime.buffer((8,), np.int32) as integers:
        launch = runtime.bind(affine, {"T": "float"}, x=None, y=y)
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
        with pytest.raises(InvalidArgumentError, match=r"\(8,\) is no multiple of .*\(3,\)"):
            launch(8, 3)
    with pytest.raises(DeviceError, match="'eight' was used after its release"):
        launch(8, 4)


#: Rooms whose module ``kernels`` declares what is in their folder of ``opencl/``.
ROOMS = ("generation", "raycasting", "volume", "extensions.large")
#: ``-D`` options that every program of a room may have, and those that kernels must have beside.
OPTIONS = {room: Variant("ushort").defines for room in ("generation", "volume", "extensions.large")}
LISTS = {"DEPTH": "PARALLEL", "PACKED": 0}
RAYS = {"CROPPED": 1, "SKIP_EMPTY": 1}
OF_KERNELS = {
    "RAYCAST": {**LISTS, **RAYS, "ONE_LIST": 1},
    "FIRST_HITS": {**LISTS, **RAYS, "ONE_LIST": 0},
    "PREVIEW": {**LISTS, "CROPPED": 1},
    "SEGMENTS": {**LISTS, **RAYS, "SEGMENT_ROWS": 0},
    "MERGE": {"SEGMENT_ROWS": 0, "STREAMS": 2},
    "RAYCAST_PACKETS": {**LISTS, "SKIP_EMPTY": 1, "UPRIGHT": 1, "SWEEP_V": 0},
    "RAYCAST_ALIGNED_VIEW": LISTS,
    "PREPARE_LISTS": LISTS,
    "PREPARE_VALUES": LISTS,
    "PREPARE_PACKED": {"DEPTH": "PARALLEL", "PACKED": 1},
    "PROJECT": {"BLEND_MODE": 1},
    "OPTICAL_DEPTHS": {"GRID_PART": 1},
}


def declared():
    """Every kernel that is declared, with the options that make its arguments what they are."""
    for room in ROOMS:
        module = import_module(f"pyvista_vdi.{room}.kernels")
        for name, declaration in vars(module).items():
            if isinstance(declaration, KernelDeclaration):
                own = {"OFFSET_T": "int", **OPTIONS.get(room, {}), **OF_KERNELS.get(name, {})}
                yield pytest.param(declaration, own, id=f"{room}.{name}")


@pytest.fixture(scope="module")
def compiler():
    """The device that compiles soonest: PoCL's, which optimises when a kernel is launched."""
    usable = [info for info in list_devices() if info.usable]
    return devices.handles[max(usable, key=lambda i: i.platform.startswith("Portable")).selector]


@pytest.mark.every(4)
@pytest.mark.parametrize(("declaration", "defines"), list(declared()))
def test_declarations_are_as_compilers_see_kernels(compiler, declaration, defines):
    """Programs from a cache have no names on Intel's, so that every one is compiled here."""
    cl = devices.opencl()
    context = cl.Context([compiler])  # which a program does not keep alive
    program = cl._cl._Program(context, programs.expand(declaration.path))
    options = (*define_options(defines), "-cl-kernel-arg-info")
    program._build(options=" ".join(("-cl-std=CL1.2", *options)).encode(), devices=[compiler])
    kernel = cl.Kernel(program, declaration.name)
    info, space = cl.kernel_arg_info, cl.kernel_arg_address_qualifier
    seen = {}
    for index in range(kernel.num_args):
        name = kernel.get_arg_info(index, info.NAME).removeprefix("_cl_")  # PoCL's for OpenCL's own
        local = kernel.get_arg_info(index, info.ADDRESS_QUALIFIER) == space.LOCAL
        seen[name] = "local " * local + kernel.get_arg_info(index, info.TYPE_NAME)
    expected = {}
    parameters = declaration.parameters(defines)
    assert list(seen) == list(parameters)
    for (name, parameter), kind in zip(parameters.items(), seen.values(), strict=True):
        pointed, star = parameter.kind.removesuffix("*"), "*" * parameter.kind.endswith("*")
        of_file = parameter.dtype is None  # a type that the kernel's file has of its own
        expected[name] = kind if of_file else f"{defines.get(pointed, pointed)}{star}"
    assert seen == expected
