"""The arguments of the kernels of ``opencl/raycasting/`` and ``opencl/multi_vdi/``."""

from __future__ import annotations

from pyvista_vdi.device import KernelDeclaration, Struct

#: A VDI and the frame that is asked of it (``raycasting/frame.cl``).
FRAME: dict[str, str | Struct] = {
    "headers": "HEADER_T*",
    "faces": "ulong* if not PACKED",
    "media": "ulong* if not PACKED",
    "supersegments": "ulong* if PACKED=16",
    "words": "uint2* if PACKED=8",
    "constants": "float* if PACKED",
    "lists_wide": "int",
    "lists_high": "int",
    "depth_origin": "float",
    "forms": "float*",
    "planes": "int",
    "width": "int",
    "height": "int",
    "opaque_depth": "float*",
    "has_opaque_depth": "int",
    "cutoff": "float",
    "masks": "ulong*",
    "first_depth": "float",
    "slabs_per_depth": "float",
}
_CROPPED: dict[str, str | Struct] = {"regions": "uint if CROPPED"}
_PICTURE: dict[str, str | Struct] = {"part": "int4", "image": "float4*"}
_FIRST_HITS: dict[str, str | Struct] = {
    "part": "int4",
    "least_optical_depth": "float",
    "accumulated": "int",
    "image": "float*",
}
_SEGMENTS: dict[str, str | Struct] = {
    "cells": "int2*",
    "first_cell": "int",
    "stream": "int",
    "band_rays": "int",
    "depth_shift": "float",
    "margin": "float",
    "capacity": "int",
    "pool": "float*",
    "ends": "int*",
    "contributes": "uchar*",
    "dark": "float*",
}
_MERGE: dict[str, str | Struct] = {
    "pool": "float*",
    "capacity": "int",
    "ends": "int*",
    "contributes": "uchar*",
    "rays": "int",
    "cells": "int2*",
    "first_cell": "int",
    "width": "int",
    "height": "int",
    "transmittance_cutoff": "float",
    "streams_of": "int*",
    "needed": "int*",
    "image": "float4*",
    "owner": "short*",
}
_CELLS: dict[str, str | Struct] = {
    "alone": "short*",
    "vdi": "int",
    "cells_wide": "int",
    "width": "int",
    "height": "int",
}

_FILE = "raycasting/raycast.cl"
RAYCAST = KernelDeclaration(_FILE, "raycast", **FRAME, **_CROPPED, **_PICTURE)
RAYCAST_BLOCKS = KernelDeclaration(_FILE, "raycast_blocks", **FRAME, **_CROPPED, **_PICTURE)
FIRST_HITS = KernelDeclaration(_FILE, "raycast", **FRAME, **_CROPPED, **_FIRST_HITS)
SEGMENTS = KernelDeclaration(_FILE, "raycast", **FRAME, **_CROPPED, **_SEGMENTS)
SEGMENTS_BLOCKS = KernelDeclaration(_FILE, "raycast_blocks", **FRAME, **_CROPPED, **_SEGMENTS)
RAYCAST_PACKETS = KernelDeclaration(
    "raycasting/packets.cl", "raycast_packets", **FRAME, epipole="float4", **_PICTURE
)
RAYCAST_ALIGNED_VIEW = KernelDeclaration(
    "raycasting/aligned_view.cl", "raycast_aligned_view", **FRAME, origin="int2", image="float4*"
)
PREVIEW = KernelDeclaration(
    "raycasting/preview.cl",
    "preview",
    **FRAME,
    **_CROPPED,
    counts="uint*",
    samples="int",
    image="float4*",
)
CLEAR_IMAGE = KernelDeclaration(
    "raycasting/clear.cl", "clear_image", pixels="ulong", image="IMAGE_T*"
)
PREPARE_LISTS = KernelDeclaration(
    "raycasting/prepare.cl",
    "prepare_lists",
    starts="OFFSET_T*",
    headers="ulong*",
    fronts="float*",
    backs="float*",
    colors="COLOR_T*",
    optical_depths="float*",
    depth_origin="float",
    nearest="float",
    width="int",
    height="int",
    centre_ray="float*",
    supersegments="uint4* if PACKED=16",
    faces="float2* if not PACKED=16",
    media="float4* if not PACKED=16",
)
PREPARE_PACKED = KernelDeclaration(
    "raycasting/prepare_packed.cl",
    "prepare_packed",
    starts="OFFSET_T*",
    headers="OFFSET_T*",
    origins="int*",
    strides="ushort*",
    stored="uint2*",
    step="float",
    width="int",
    height="int",
    centre_ray="float*",
    words="uint2*",
)
COUNT_SUPERSEGMENTS = KernelDeclaration(
    "raycasting/occupancy.cl",
    "count_supersegments",
    offsets="OFFSET_T*",
    origins="int* if PACKED",
    strides="ushort* if PACKED",
    words="uint2* if PACKED",
    step="float if PACKED",
    fronts="float* if not PACKED",
    backs="float* if not PACKED",
    width="int",
    height="int",
    stacks_wide="int",
    first_depth="float",
    slabs_per_depth="float",
    margin="float",
    changes="uint*",
)
OCCUPIED_SLABS = KernelDeclaration(
    "raycasting/occupancy.cl", "occupied_slabs", counts="uint*", stacks="uint", masks="ulong*"
)

MERGE = KernelDeclaration("multi_vdi/merge.cl", "merge", **_MERGE)
MERGE_BLOCKS = KernelDeclaration("multi_vdi/merge.cl", "merge_blocks", **_MERGE)
ALONE_ENDS = KernelDeclaration(
    "multi_vdi/cells.cl",
    "alone_ends",
    **_CELLS,
    opaque_depth="float*",
    has_opaque_depth="int",
    ends="float*",
)
TAKE_CELLS = KernelDeclaration(
    "multi_vdi/cells.cl", "take_cells", **_CELLS, picture="float4*", image="float4*", owner="short*"
)
