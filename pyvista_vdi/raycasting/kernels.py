"""The kernels of ``opencl/raycasting/`` and ``multi_vdi/``."""

from pyvista_vdi.device import KernelDeclaration

# A ray in a work-item, or sixteen
RAYCAST = KernelDeclaration("raycasting/raycast.cl", "raycast")
SEGMENTS = KernelDeclaration("multi_vdi/segments.cl", "segments")
MERGE = KernelDeclaration("multi_vdi/merge.cl", "merge")
# A ray in a work-item
FIRST_HITS = KernelDeclaration("raycasting/first_hits.cl", "first_hits")
PREVIEW = KernelDeclaration("raycasting/preview.cl", "preview")
# Sixteen rays in a work-item, on CPUs
RAYCAST_PACKETS = KernelDeclaration("raycasting/packets.cl", "raycast_packets")
RAYCAST_ALIGNED_VIEW = KernelDeclaration("raycasting/aligned_view.cl", "raycast_aligned_view")
# What is made of a VDI and of a picture before
CLEAR_IMAGE = KernelDeclaration("raycasting/clear.cl", "clear_image")
CLEAR_HITS = KernelDeclaration("raycasting/clear.cl", "clear_hits")
PREPARE_LISTS = KernelDeclaration("raycasting/prepare.cl", "prepare_lists")
PREPARE_PACKED = KernelDeclaration("raycasting/prepare.cl", "prepare_packed")
CLASSIFY_VALUES = KernelDeclaration("raycasting/classify_values.cl", "classify_values")
PREPARE_VALUES = KernelDeclaration("raycasting/prepare_values.cl", "prepare_values")
COUNT_SUPERSEGMENTS = KernelDeclaration("raycasting/occupancy.cl", "count_supersegments")
COUNT_PACKED = KernelDeclaration("raycasting/occupancy.cl", "count_packed")
ENDS_OF_LISTS = KernelDeclaration("raycasting/occupancy.cl", "ends_of_lists")
OCCUPIED_SLABS = KernelDeclaration("raycasting/occupancy.cl", "occupied_slabs")
ALONE_ENDS = KernelDeclaration("multi_vdi/cells.cl", "alone_ends")
TAKE_CELLS = KernelDeclaration("multi_vdi/cells.cl", "take_cells")
