"""The kernels of ``opencl/volume/``."""

from pyvista_vdi.device import KernelDeclaration

_BRICKS, _MACROCELLS = "volume/bricks.cl", "volume/macrocells.cl"
_OCCLUSION = "volume/ambient_occlusion.cl"
RENDER_VOLUME = KernelDeclaration("volume/render_volume.cl", "render_volume")
WANT_BRICKS = KernelDeclaration(_BRICKS, "want_bricks")
SAMPLE_STEPS = KernelDeclaration(_BRICKS, "sample_steps")
MACROCELL_RANGES = KernelDeclaration(_MACROCELLS, "macrocell_ranges")
MACROCELL_DISTANCES = KernelDeclaration(_MACROCELLS, "macrocell_distances")
MACROCELL_VISIBILITY = KernelDeclaration(_MACROCELLS, "macrocell_visibility")
SCALAR_MEDIA = KernelDeclaration("volume/scalar_media.cl", "scalar_media")
STEP_OPACITIES = KernelDeclaration(_OCCLUSION, "step_opacities")
AMBIENT_TRANSMITTANCES = KernelDeclaration(_OCCLUSION, "ambient_transmittances")
