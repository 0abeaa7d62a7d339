"""The arguments of the kernels of ``opencl/generation/``, by name and type."""

from pyvista_vdi.device import KernelDeclaration, Struct
from pyvista_vdi.volume.kernels import CLASSIFIED, MEDIUM, VIEW

#: The numbers of records of runs.
RECORDING = Struct(
    "Recording",
    capacity="int",
    limit="int",
    grain="int",
    window_row="int",
    finest="float",
    reference_length="float",
    hidden_weight="float",
)
MARCH_LISTS = KernelDeclaration(
    "generation/march_lists.cl",
    "march_lists",
    **MEDIUM,
    **VIEW,
    samples="float4*",
    recording=RECORDING,
    entering="float*",
    thresholds="float*",
    records="float*",
    counts="uint*",
)
LONGEST_MARCHES = KernelDeclaration(
    "generation/march_lists.cl",
    "longest_marches",
    classified=CLASSIFIED,
    **VIEW,
    slice_rows="int",
    longest="int*",
)
SHORTEN_LISTS = KernelDeclaration(
    "generation/shorten_lists.cl",
    "shorten_lists",
    **VIEW,
    recording=RECORDING,
    exactly="int",
    thresholds="float*",
    records="float*",
    errors="float*",
    counts="uint*",
)
CUT_LISTS = KernelDeclaration(
    "generation/homogeneity.cl",
    "cut_lists",
    **VIEW,
    recording=RECORDING,
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
    **VIEW,
    capacity="int",
    records="float*",
    offsets="ulong*",
    made="uint",
    held="ulong",
    fronts="float*",
    backs="float*",
    colors="float*",
    optical_depths="float*",
)
