"""The arguments of the kernel of ``opencl/series/``, by name and type."""

from __future__ import annotations

from pyvista_vdi.device import KernelDeclaration

DECODE_LISTS = KernelDeclaration(
    "series/decode.cl",
    "decode_lists",
    n_lists="int",
    how="uchar*",
    starts="int*",
    places="int*",
    origins_left="int*",
    strides_left="int*",
    shifts="int*",
    pitches="double*",
    data="uchar*",
    streams="uint*",
    kept="uchar*",
    kept_there="uchar*",
    old_starts="int*",
    old_origins="int*",
    old_strides="ushort*",
    old_words="uint2*",
    old_entries="uchar*",
    colors="uchar*",
    extinctions="float*",
    origins="int*",
    strides="ushort*",
    words="uint2*",
    entries="uchar*",
    trouble="int*",
)
