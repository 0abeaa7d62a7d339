"""The arguments of the kernels of ``opencl/volume/``, by name and type."""

from pyvista_vdi.device import KernelDeclaration, Struct

#: The numbers of a volume, its classification, its ambient occlusion, and the part that is there.
CLASSIFIED = Struct(
    "Classified",
    size="int4",
    held="int4",
    macrocells="int4",
    part_first="int4",
    part_lower="float4",
    part_upper="float4",
    nodes="int4",
    to_nodes="float4",
    entries="int",
    low="float",
    per_scalar="float",
)
#: A classified volume (``Medium`` of ``volume/medium.cl``).
MEDIUM: dict[str, str | Struct] = {
    "classified": CLASSIFIED,
    "voxels": "VOXEL_T*",
    "table": "float4*",
    "distances": "uchar*",
    "blanked": "uchar*",
    "gradient": "float*",
    "lighting": "float*",
    "ambient": "float*",
}
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
#: These, and their forms.
VIEW: dict[str, str | Struct] = {"view": RAYS, "forms": "float*"}
#: How a volume is cut into bricks.
BRICKS = Struct("Bricks", counts="int4", shift="int", points="int", margin="int")

RENDER_VOLUME = KernelDeclaration(
    "volume/render_volume.cl",
    "render_volume",
    **MEDIUM,
    **VIEW,
    opaque_depth="float*",
    transmittance_cutoff="float",
    opacity_multiplier="float",
    regions="uint",
    samples="float4*",
    states="float4*",
    image="float4*",
)
PROJECT = KernelDeclaration(
    "volume/project.cl",
    "project",
    **MEDIUM,
    **VIEW,
    opaque_depth="float*",
    regions="uint",
    per_range="float",
    at_zero="float",
    image="float4*",
)
WANT_BRICKS = KernelDeclaration(
    "volume/bricks.cl",
    "want_bricks",
    classified=CLASSIFIED,
    **VIEW,
    opaque_depth="float*",
    visible="uchar*",
    bricks=BRICKS,
    wanted="uint*",
    samples="float4*",
)
SAMPLE_STEPS = KernelDeclaration(
    "volume/bricks.cl",
    "sample_steps",
    **MEDIUM,
    **VIEW,
    opaque_depth="float*",
    visible="uchar*",
    bricks=BRICKS,
    slots="int*",
    samples="float4*",
)
MACROCELL_RANGES = KernelDeclaration(
    "volume/macrocells.cl",
    "macrocell_ranges",
    voxels="VOXEL_T*",
    size="int4",
    macrocells="int4",
    ranges="float2*",
)
MACROCELL_DISTANCES = KernelDeclaration(
    "volume/macrocells.cl",
    "macrocell_distances",
    before="uchar*",
    macrocells="uint",
    apart="uint",
    along="int",
    most="int",
    distances="uchar*",
)
MACROCELL_VISIBILITY = KernelDeclaration(
    "volume/macrocells.cl",
    "macrocell_visibility",
    ranges="float2*",
    macrocells="uint",
    visible_before="uint*",
    entries="int",
    low="float",
    per_scalar="float",
    visible="uchar*",
)
SCALAR_MEDIA = KernelDeclaration(
    "volume/scalar_media.cl",
    "scalar_media",
    table="float4*",
    entries="int",
    low="float",
    per_scalar="float",
    first="int",
    count="int",
    media="float4*",
)
STEP_OPACITIES = KernelDeclaration(
    "volume/ambient_occlusion.cl",
    "step_opacities",
    classified=CLASSIFIED,
    voxels="VOXEL_T*",
    table="float4*",
    blanked="uchar*",
    gradient="float*",
    visible="uchar*",
    points="int4",
    first_node="int4",
    nodes="int4",
    cell="int4",
    samples="int4",
    margin="int4",
    padded="int4",
    units="float",
    steps="float",
    opacities="float*",
)
AMBIENT_TRANSMITTANCES = KernelDeclaration(
    "volume/ambient_occlusion.cl",
    "ambient_transmittances",
    opacities="float*",
    nodes="int4",
    cell="int4",
    margin="int4",
    padded="int4",
    visible="uchar*",
    macrocells="int4",
    places="int*",
    shares="float*",
    directions="int",
    steps="int",
    ambient="float*",
)
