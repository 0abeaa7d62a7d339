"""The subcommands of the core: what each does, and its options (:func:`declare.add`)."""

from __future__ import annotations

from pyvista_vdi.registry import Verb

DEVICES = "json"

GENERATE = """
VOLUME output size=1280x720
camera: the view that the volume fills, 20 degrees above its middle
table: ambient_occlusion deferral:
[limits]
max_supersegments criterion sample_distance tolerance view_cone memory_limit
[quality] Lists and precision are chosen by a measurement; --size is that of pictures.
quality target_ssim full_fps max_bytes
[file]
compression compression_level
precision  {exact,8-byte}  of .vdi, by default exact, and of .html 8-byte
[execution]
scheduler device
"""

RENDER = """
VDI
output      FILE   .png to write
size        WxH    window size in pixels (default: the VDI's)
background  COLOR  blend over this; by default the picture is transparent
transmittance_cutoff time device
camera: the VDI's generating view
values:
"""

VIEW = """
VDI|VOLUME device
size        WxH   window size in pixels (default: the VDI's)
screenshot  FILE  write this .png, open no window
time
[while the view moves]
target_fps  RATE  kept by fewer pixels; 0: every frame is full (default: 30)
regenerate  {auto,never}      make another VDI where it does not serve the view
draw        {auto,vdi,volume}  what is raycast where the volume is at hand
look:
"""

COMPARE = """
VOLUME out size=1280x720 angles=0,5,30 no_vtk
repeats=3  COUNT  timed frames of each kind
compression=lz4 precision max_supersegments sample_distance device
look:
"""

TRADEOFF = """
VOLUME out size=640x360 angles=5,30,60 no_vtk device
repeats=5      COUNT     timed frames
generations=3  COUNT     timed generations of each VDI
sweep  AXIS[=A,B,...] ...  settings, with other values than usual: max-supersegments, \
tolerance, lists, precision, criterion, view-cone, sample-distance
table:
"""

CONVERT = """
VDI output
[file]
compression compression_level
precision  {exact,8-byte}  of the supersegments; by default as in the file
values:
[deep images of other programs]
camera_json  FILE    the view that the image shows, where it does not say it
thickness    LENGTH  world units, given to samples that have none (surfaces)
"""

INFO = "VDI|VOLUME scalars preference json"


def _verb(name: str, module: str, summary: str, example: str) -> Verb:
    run = f"pyvista_vdi.cli.{module}:{name}"
    return Verb(name, summary, f"pyvista-vdi {name}{example}", f"{__name__}:{name.upper()}", run)


VERBS = (
    _verb("devices", "files", "list the OpenCL devices, and say why one is not used", ""),
    _verb(
        "generate",
        "generate",
        "generate a VDI of a volume and write it to a file",
        " knee.nrrd -o knee.vdi --cmap bone --opacity sigmoid_6 --azimuth 30",
    ),
    _verb(
        "render",
        "render",
        "render a VDI from a new view and write a picture",
        " knee.vdi -o knee.png --azimuth 20 --background white",
    ),
    _verb("view", "render", "turn a VDI, or a volume by a VDI of it, in a window", " knee.vdi"),
    _verb("info", "files", "say what a file holds: a VDI or a volume", " knee.vdi --json"),
    _verb(
        "compare",
        "measured",
        "compare VTK's mappers, our raycaster and a VDI by pictures",
        " --example brain --cmap bone --out out",
    ),
    _verb(
        "tradeoff",
        "measured",
        "measure what each setting of a VDI costs and gives",
        " --example brain --out out",
    ),
    _verb(
        "convert",
        "files",
        "write a VDI, a series or a set in another format",
        " knee.vdi -o knee.exr",
    ),
)
