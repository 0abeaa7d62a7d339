"""The kernels of ``opencl/raycasting/`` and ``multi_vdi/``, and the structures that they take."""

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

# A ray in a work-item, or sixteen
RAYCAST = KernelDeclaration("raycasting/raycast.cl", "raycast", FRAME)
SEGMENTS = KernelDeclaration("multi_vdi/segments.cl", "segments", FRAME)
MERGE = KernelDeclaration("multi_vdi/merge.cl", "merge")
# A ray in a work-item
FIRST_HITS = KernelDeclaration("raycasting/first_hits.cl", "first_hits", FRAME)
PREVIEW = KernelDeclaration("raycasting/preview.cl", "preview", FRAME)
# Sixteen rays in a work-item, on CPUs
RAYCAST_PACKETS = KernelDeclaration("raycasting/packets.cl", "raycast_packets", FRAME)
RAYCAST_ALIGNED_VIEW = KernelDeclaration(
    "raycasting/aligned_view.cl", "raycast_aligned_view", FRAME
)
# What is made of a VDI and of a picture before
CLEAR_IMAGE = KernelDeclaration("raycasting/clear.cl", "clear_image")
CLEAR_HITS = KernelDeclaration("raycasting/clear.cl", "clear_hits")
PREPARE_LISTS = KernelDeclaration("raycasting/prepare.cl", "prepare_lists")
PREPARE_PACKED = KernelDeclaration("raycasting/prepare.cl", "prepare_packed")
CLASSIFY_VALUES = KernelDeclaration("raycasting/classify_values.cl", "classify_values")
PREPARE_VALUES = KernelDeclaration("raycasting/prepare_values.cl", "prepare_values", COUNTED)
COUNT_SUPERSEGMENTS = KernelDeclaration("raycasting/occupancy.cl", "count_supersegments", COUNTED)
COUNT_PACKED = KernelDeclaration("raycasting/occupancy.cl", "count_packed", COUNTED)
ENDS_OF_LISTS = KernelDeclaration("raycasting/occupancy.cl", "ends_of_lists")
OCCUPIED_SLABS = KernelDeclaration("raycasting/occupancy.cl", "occupied_slabs")
ALONE_ENDS = KernelDeclaration("multi_vdi/cells.cl", "alone_ends")
TAKE_CELLS = KernelDeclaration("multi_vdi/cells.cl", "take_cells")
