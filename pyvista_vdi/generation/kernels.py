"""The kernels of ``opencl/generation/``."""

from pyvista_vdi.device import KernelDeclaration

_MARCH, _LISTS = "generation/march_lists.cl", "generation/offsets.cl"
MARCH_LISTS = KernelDeclaration(_MARCH, "march_lists")
LONGEST_MARCHES = KernelDeclaration(_MARCH, "longest_marches")
SHORTEN_LISTS = KernelDeclaration("generation/shorten_lists.cl", "shorten_lists")
CUT_LISTS = KernelDeclaration("generation/homogeneity.cl", "cut_lists")
SUM_LENGTHS = KernelDeclaration(_LISTS, "sum_lengths")
LIST_OFFSETS = KernelDeclaration(_LISTS, "list_offsets")
PACK_LISTS = KernelDeclaration("generation/pack_lists.cl", "pack_lists")
