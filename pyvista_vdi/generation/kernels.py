"""The arguments of the kernels of ``opencl/generation/``, by name and type."""

from __future__ import annotations

from pyvista_vdi.device import KernelDeclaration, Struct
from pyvista_vdi.volume.kernels import MEDIUM, VIEW

#: The rays of a slice.
PLACE: dict[str, str | Struct] = {
    "first_column": "int",
    "columns": "int",
    "first_row": "int",
    "rows": "int",
}
#: What a merge error is weighted by.
WEIGHTS: dict[str, str | Struct] = {"reference_length": "float", "hidden_weight": "float"}

MARCH_LISTS = KernelDeclaration(
    "generation/march_lists.cl",
    "march_lists",
    **MEDIUM,
    **VIEW,
    **PLACE,
    first_step="int",
    steps="int",
    grain="int",
    finest="float",
    capacity="int",
    **WEIGHTS,
    window_row="int if GRID_PART",
    entering="float* if GRID_PART",
    thresholds="float*",
    all_records="float*",
    counts="uint*",
)
LONGEST_MARCHES = KernelDeclaration(
    "generation/march_lists.cl",
    "longest_marches",
    **{name: f"{kind} if GRID_PART" for name, kind in MEDIUM.items()},
    **VIEW,
    **PLACE,
    slice_rows="int",
    longest="int*",
)
SHORTEN_LISTS = KernelDeclaration(
    "generation/shorten_lists.cl",
    "shorten_lists",
    limit="int",
    exactly="int",
    width="int",
    height="int",
    **PLACE,
    forms="float*",
    capacity="int",
    **WEIGHTS,
    all_thresholds="float*",
    all_records="float*",
    all_errors="float*",
    counts="uint*",
)
CUT_LISTS = KernelDeclaration(
    "generation/criteria.cl",
    "cut_lists",
    limit="int",
    width="int",
    height="int",
    **PLACE,
    forms="float*",
    capacity="int",
    **WEIGHTS,
    threshold="float",
    records="float*",
    counts="uint*",
)
SUM_LENGTHS = KernelDeclaration(
    "generation/offsets.cl",
    "sum_lengths",
    lists="uint",
    lengths="uint*",
    partial="local ulong*",
    sums="ulong*",
)
LIST_OFFSETS = KernelDeclaration(
    "generation/offsets.cl",
    "list_offsets",
    lists="uint",
    lengths="uint*",
    partial="local ulong*",
    sums="ulong*",
    made="uint",
    all_offsets="ulong*",
)
PACK_LISTS = KernelDeclaration(
    "generation/pack_lists.cl",
    "pack_lists",
    records="float*",
    capacity="int",
    width="int",
    rows="int",
    offsets="ulong*",
    made="uint",
    held="ulong",
    fronts="float*",
    backs="float*",
    colors="float*",
    optical_depths="float*",
    forms="float* if DOUBLE_FLOAT_RAYS",
    planes="int if DOUBLE_FLOAT_RAYS",
    height="int if DOUBLE_FLOAT_RAYS",
    first_row="int if DOUBLE_FLOAT_RAYS",
)
