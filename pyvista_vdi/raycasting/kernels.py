"""The arguments of the kernels of ``opencl/raycasting/`` and ``opencl/multi_vdi/``."""

from pyvista_vdi.device import KernelDeclaration, Struct

#: The scalars of a frame (``raycasting/frame.cl``).
FRAME = Struct(
    "Frame",
    lists_wide="int",
    lists_high="int",
    width="int",
    height="int",
    planes="int",
    depth_origin="float",
    cutoff="float",
    first_depth="float",
    slabs_per_depth="float",
    depth_step="float",
    nearest_offset="float",
    regions="uint",
)
#: The occupancy grid as it is counted (``raycasting/occupancy.cl``).
COUNTED = Struct(
    "Counted",
    width="int",
    height="int",
    stacks_wide="int",
    first_depth="float",
    slabs_per_depth="float",
    margin="float",
)

#: What every kernel takes that draws a frame.
_DRAWN: dict[str, str | Struct] = {
    "headers": "HEADER_T*",
    "faces": "ulong*",
    "media": "ulong*",
    "forms": "float*",
    "opaque_depth": "float*",
    "masks": "ulong*",
    "frame": FRAME,
}
_CELLS: dict[str, str | Struct] = {
    "alone": "short*",
    "vdi": "int",
    "cells_wide": "int",
    "width": "int",
    "height": "int",
}
_CLEARED: dict[str, str | Struct] = {"pixels": "ulong"}
_COUNTS: dict[str, str | Struct] = {"grid": COUNTED, "changes": "uint*"}

# A ray in a work-item, or sixteen
RAYCAST = KernelDeclaration(
    "raycasting/raycast.cl", "raycast", **_DRAWN, part="int4", image="float4*"
)
SEGMENTS = KernelDeclaration(
    "multi_vdi/segments.cl",
    "segments",
    **_DRAWN,
    cells="int2*",
    first_cell="int",
    number="int",
    band_rays="int",
    depth_shift="float",
    margin="float",
    capacity="int",
    pool="float*",
    ends="int*",
    contributes="uchar*",
    dark="float*",
)
MERGE = KernelDeclaration(
    "multi_vdi/merge.cl",
    "merge",
    pool="float*",
    capacity="int",
    ends="int*",
    contributes="uchar*",
    rays="int",
    cells="int2*",
    first_cell="int",
    width="int",
    height="int",
    transmittance_cutoff="float",
    streams_of="int*",
    needed="int*",
    image="float4*",
    owner="short*",
)

# A ray in a work-item
FIRST_HITS = KernelDeclaration(
    "raycasting/first_hits.cl",
    "first_hits",
    **_DRAWN,
    part="int4",
    least_optical_depth="float",
    accumulated="int",
    image="float*",
)
PREVIEW = KernelDeclaration(
    "raycasting/preview.cl", "preview", **_DRAWN, counts="uint*", samples="int", image="float4*"
)

# Sixteen rays in a work-item, on CPUs
RAYCAST_PACKETS = KernelDeclaration(
    "raycasting/packets.cl",
    "raycast_packets",
    **_DRAWN,
    epipole="float4",
    part="int4",
    image="float4*",
)
RAYCAST_ALIGNED_VIEW = KernelDeclaration(
    "raycasting/aligned_view.cl", "raycast_aligned_view", **_DRAWN, origin="int2", image="float4*"
)

# What is made of a VDI and of a picture before
CLEAR_IMAGE = KernelDeclaration("raycasting/clear.cl", "clear_image", **_CLEARED, image="float4*")
CLEAR_HITS = KernelDeclaration("raycasting/clear.cl", "clear_hits", **_CLEARED, image="float*")
PREPARE_LISTS = KernelDeclaration(
    "raycasting/prepare.cl",
    "prepare_lists",
    starts="ulong*",
    headers="HEADER_T*",
    fronts="float*",
    backs="float*",
    colors="float*",
    optical_depths="float*",
    depth_origin="float",
    nearest="float",
    width="int",
    height="int",
    centre_ray="float*",
    faces="float2*",
    media="float4*",
)
PREPARE_PACKED = KernelDeclaration(
    "raycasting/prepare_packed.cl",
    "prepare_packed",
    starts="ulong*",
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
CLASSIFY_VALUES = KernelDeclaration(
    "raycasting/classify_values.cl",
    "classify_values",
    count="uint",
    cells="int",
    means="float*",
    spreads="float*",
    steps="float*",
    integrals="float4*",
    colors="float*",
    optical_depths="float*",
)
PREPARE_VALUES = KernelDeclaration(
    "raycasting/prepare_values.cl",
    "prepare_values",
    starts="ulong*",
    places="ulong*",
    fronts="float*",
    backs="float*",
    means="float*",
    spreads="float*",
    steps="float*",
    integrals="float4*",
    cells="int",
    depth_origin="float",
    nearest="float",
    centre_ray="float*",
    **_COUNTS,
    headers="ulong*",
    faces="float2*",
    media="float4*",
)
COUNT_SUPERSEGMENTS = KernelDeclaration(
    "raycasting/occupancy.cl",
    "count_supersegments",
    starts="ulong*",
    fronts="float*",
    backs="float*",
    **_COUNTS,
)
COUNT_PACKED = KernelDeclaration(
    "raycasting/occupancy.cl",
    "count_packed",
    starts="ulong*",
    origins="int*",
    strides="ushort*",
    words="uint2*",
    step="float",
    **_COUNTS,
)
ENDS_OF_LISTS = KernelDeclaration(
    "raycasting/occupancy.cl",
    "ends_of_lists",
    starts="ulong*",
    fronts="float*",
    backs="float*",
    lists="uint",
    ends="float2*",
)
OCCUPIED_SLABS = KernelDeclaration(
    "raycasting/occupancy.cl", "occupied_slabs", counts="uint*", stacks="uint", masks="ulong*"
)
ALONE_ENDS = KernelDeclaration(
    "multi_vdi/cells.cl",
    "alone_ends",
    **_CELLS,
    opaque_depth="float*",
    ends="float*",
)
TAKE_CELLS = KernelDeclaration(
    "multi_vdi/cells.cl", "take_cells", **_CELLS, picture="float4*", image="float4*", owner="short*"
)
