"""The public names for checkers of types: those of extensions, too, which are found at run time."""

from pyvista_vdi import errors as errors
from pyvista_vdi import examples as examples
from pyvista_vdi._version import __version__ as __version__
from pyvista_vdi.api import Settings as Settings
from pyvista_vdi.api import generate as generate
from pyvista_vdi.api import pick as pick
from pyvista_vdi.api import read as read
from pyvista_vdi.api import render as render
from pyvista_vdi.api import render_depth as render_depth
from pyvista_vdi.api import render_volume as render_volume
from pyvista_vdi.device import describe_devices as describe_devices
from pyvista_vdi.device import list_devices as list_devices
from pyvista_vdi.errors import *
from pyvista_vdi.extensions.series.generate import generate_series as generate_series
from pyvista_vdi.extensions.series.series import VDISeries as VDISeries
from pyvista_vdi.extensions.series.writer import SeriesWriter as SeriesWriter
from pyvista_vdi.extensions.sets.generate import generate_set as generate_set
from pyvista_vdi.extensions.sets.vdi_set import VDISet as VDISet
from pyvista_vdi.io.volumes import list_volumes as list_volumes
from pyvista_vdi.io.volumes import read_volume as read_volume
from pyvista_vdi.model.ambient_occlusion import AmbientOcclusion as AmbientOcclusion
from pyvista_vdi.model.camera import Camera as Camera
from pyvista_vdi.model.cropping import Cropping as Cropping
from pyvista_vdi.model.lighting import Light as Light
from pyvista_vdi.model.lighting import Lights as Lights
from pyvista_vdi.model.lighting import Shading as Shading
from pyvista_vdi.model.metrics import compare_images as compare_images
from pyvista_vdi.model.presets import presets as presets
from pyvista_vdi.model.transfer_function import TransferFunction as TransferFunction
from pyvista_vdi.model.vdi import VDI as VDI
from pyvista_vdi.model.vdi import DeferredVDI as DeferredVDI
from pyvista_vdi.model.volume import Volume as Volume
from pyvista_vdi.raycasting.picking import Pick as Pick
from pyvista_vdi.vtk_pipeline import VDIActor as VDIActor
from pyvista_vdi.vtk_pipeline import VDIMapper as VDIMapper
from pyvista_vdi.vtk_pipeline import VDISource as VDISource
