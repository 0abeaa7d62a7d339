"""The kernels of ``opencl/volume/``, and the structures that they take."""

from pyvista_vdi.device import KernelDeclaration, Struct

#: The numbers of a volume, its classification, and the part that is there.
CLASSIFIED = Struct(
    "Classified",
    size="int4",
    held="int4",
    macrocells="int4",
    part_first="int4",
    part_lower="float4",
    part_upper="float4",
    entries="int",
    low="float",
    per_scalar="float",
)
#: The numbers of the rays of a view, or of part of its window, and which of their steps are taken.
RAYS = Struct(
    "RaysOfView",
    width="int",
    height="int",
    first_column="int",
    columns="int",
    first_row="int",
    rows="int",
    first_step="int",
    steps="int",
    planes="int",
    sample_distance="float",
    unit_distance="float",
)
#: How a volume is cut into bricks.
BRICKS = Struct("Bricks", counts="int4", shift="int", points="int", margin="int")

_BRICKS, _MACROCELLS = "volume/bricks.cl", "volume/macrocells.cl"
RENDER_VOLUME = KernelDeclaration("volume/render_volume.cl", "render_volume", CLASSIFIED, RAYS)
PROJECT = KernelDeclaration("volume/project.cl", "project", CLASSIFIED, RAYS)
WANT_BRICKS = KernelDeclaration(_BRICKS, "want_bricks", CLASSIFIED, RAYS, BRICKS)
SAMPLE_STEPS = KernelDeclaration(_BRICKS, "sample_steps", CLASSIFIED, RAYS, BRICKS)
MACROCELL_RANGES = KernelDeclaration(_MACROCELLS, "macrocell_ranges")
MACROCELL_DISTANCES = KernelDeclaration(_MACROCELLS, "macrocell_distances")
MACROCELL_VISIBILITY = KernelDeclaration(_MACROCELLS, "macrocell_visibility")
SCALAR_MEDIA = KernelDeclaration("volume/scalar_media.cl", "scalar_media")
