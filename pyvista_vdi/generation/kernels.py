"""The kernels of ``opencl/generation/``, and the structures that they take."""

from pyvista_vdi.device import KernelDeclaration, Struct
from pyvista_vdi.volume.kernels import CLASSIFIED, RAYS

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
_MARCH, _LISTS = "generation/march_lists.cl", "generation/offsets.cl"
MARCH_LISTS = KernelDeclaration(_MARCH, "march_lists", CLASSIFIED, RAYS, RECORDING)
LONGEST_MARCHES = KernelDeclaration(_MARCH, "longest_marches", CLASSIFIED, RAYS)
SHORTEN_LISTS = KernelDeclaration("generation/shorten_lists.cl", "shorten_lists", RAYS, RECORDING)
CUT_LISTS = KernelDeclaration("generation/homogeneity.cl", "cut_lists", RAYS, RECORDING)
SUM_LENGTHS = KernelDeclaration(_LISTS, "sum_lengths")
LIST_OFFSETS = KernelDeclaration(_LISTS, "list_offsets")
PACK_LISTS = KernelDeclaration("generation/pack_lists.cl", "pack_lists", RAYS)
