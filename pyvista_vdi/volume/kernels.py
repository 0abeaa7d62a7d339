"""The arguments of the kernels of ``opencl/volume/``, by name and type."""

from __future__ import annotations

from pyvista_vdi.device import KernelDeclaration, Struct

#: A volume and its transfer function.
CLASSIFIED: dict[str, str | Struct] = {
    "voxels": "VOXEL_T*",
    "size": "int4",
    "table": "float4*",
    "entries": "int",
    "low": "float",
    "per_scalar": "float",
}
#: What of a grid is there, where that is part of one.
GRID_PART: dict[str, str | Struct] = {
    "part_first": "int4 if GRID_PART",
    "part_lower": "float4 if GRID_PART",
    "part_upper": "float4 if GRID_PART",
}
#: What samples are shaded by (``volume/shading.cl``), and which are blank.
_SHADING: dict[str, str | Struct] = {
    "lighting": "float* if SHADED",
    "gradient": "float* if GRADIENT_OPACITY",
}
_OCCLUSION: dict[str, str | Struct] = {
    "ambient": "float* if OCCLUSION",
    "nodes": "int4 if OCCLUSION",
    "to_nodes": "float4 if OCCLUSION",
}
_BLANKING: dict[str, str | Struct] = {"blanked": "uchar* if BLANKED"}
#: What is sampled on the way (``volume/march.cl``), unless it has been before.
_SAMPLED_NOW: dict[str, str | Struct] = {
    **CLASSIFIED,
    "distances": "uchar*",
    "macrocells": "int4",
    **GRID_PART,
    **_SHADING,
    **_OCCLUSION,
    **_BLANKING,
}
MEDIUM: dict[str, str | Struct] = {
    **_SAMPLED_NOW,
    "samples": "float4* if SAMPLED",
    "held_samples": "int if SAMPLED",
    "first_sample": "int if SAMPLED",
}
#: The rays of a view.
VIEW: dict[str, str | Struct] = {
    "forms": "float*",
    "planes": "int",
    "sample_distance": "float",
    "unit_distance": "float",
    "width": "int",
    "height": "int",
}
#: The steps of some rows' rays that are sampled brick by brick.
_WALK: dict[str, str | Struct] = {
    **VIEW,
    "first_row": "int",
    "rows": "int",
    "first_step": "int",
    "steps": "int",
    "opaque_depth": "float*",
    "has_opaque_depth": "int",
    "seen": "uchar*",
    "bricks": "int4",
}

RENDER_VOLUME = KernelDeclaration(
    "volume/render_volume.cl",
    "render_volume",
    **MEDIUM,
    **VIEW,
    opaque_depth="float*",
    has_opaque_depth="int",
    transmittance_cutoff="float",
    regions="uint if CROPPED",
    opacity_multiplier="float if OPACITY_MULTIPLIER",
    first_row="int if SAMPLED",
    rows="int if SAMPLED",
    first_step="int if SAMPLED",
    steps="int if SAMPLED",
    states="float4* if SAMPLED",
    image="float4*",
)
PROJECT = KernelDeclaration(
    "volume/project.cl",
    "project",
    **MEDIUM,
    **VIEW,
    opaque_depth="float*",
    has_opaque_depth="int",
    regions="uint if CROPPED",
    per_range="float",
    at_zero="float",
    image="float4*",
)
WANT_BRICKS = KernelDeclaration(
    "volume/bricks.cl",
    "want_bricks",
    **_SAMPLED_NOW,
    **_WALK,
    wanted="uint*",
    samples="float4*",
)
SAMPLE_STEPS = KernelDeclaration(
    "volume/bricks.cl",
    "sample_steps",
    **_SAMPLED_NOW,
    **_WALK,
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
    **CLASSIFIED,
    visible="uchar*",
    macrocells="int4",
    **GRID_PART,
    **_SHADING,
    **_BLANKING,
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
