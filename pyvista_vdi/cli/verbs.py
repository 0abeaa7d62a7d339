"""The subcommands of the core: what each does, and its options as help shows them."""

from __future__ import annotations

from typing import NamedTuple


class Verb(NamedTuple):
    """A subcommand: its module, what it does, an example, and its options (:func:`declare.add`)."""

    module: str
    summary: str
    example: str
    options: str


_FRAMES = """
VDI|VOLUME
output            FILE   .gif, .mp4 or .webm to write (pip install 'pyvista-vdi[movie]')
size              WxH    window size in pixels (default: the VDI's)
background=0,0,0  COLOR  a name, #rrggbb or R,G,B from 0 to 1
frames            COUNT  in all (default: one a step; of a path or a turn four seconds of them)
fps=25            FPS    frames per second
camera: the first view is the VDI's own, or one that the volume fills
table: device
"""

VERBS = {
    "devices": Verb(
        "files",
        "list the OpenCL devices, and say why one is not used",
        "pyvista-vdi devices",
        "json",
    ),
    "generate": Verb(
        "generate",
        "generate a VDI of a volume and write it to a file",
        "pyvista-vdi generate knee.nrrd -o knee.vdi --cmap bone --opacity sigmoid_6 --azimuth 30",
        """
        VOLUME output size=1280x720
        camera: the view that the volume fills, 20 degrees above its middle
        table: deferral: occlusion:
        [limits]
        max_supersegments criterion sample_distance tolerance view_cone memory_limit
        [quality] Lists and precision are chosen by a measurement; --size is that of pictures.
        quality target_ssim full_fps max_bytes target_angle
        [file]
        compression compression_level
        precision  {exact,8-byte}  of .vdi, by default exact, and of .html 8-byte
        [execution]
        scheduler device
        """,
    ),
    "render": Verb(
        "render",
        "render a VDI from a new view and write a picture",
        "pyvista-vdi render knee.vdi -o knee.png --azimuth 20 --background white",
        """
        VDIS
        output      FILE   .png to write
        size        WxH    window size in pixels (default: the VDI's)
        background  COLOR  blend over this; by default the picture is transparent
        transmittance_cutoff time device
        camera: the VDI's generating view
        values:
        """,
    ),
    "view": Verb(
        "render",
        "turn a VDI, or a volume by a VDI of it, in a window",
        "pyvista-vdi view knee.vdi",
        """
        VDI|VOLUME device
        size        WxH   window size in pixels (default: the VDI's)
        screenshot  FILE  write this .png, open no window
        [series] The space bar plays and pauses, a slider seeks.
        play  -    begin to play at once
        rate  FPS  steps per second (default: 24)
        time
        [while the view moves]
        target_fps  RATE  kept by fewer pixels; 0: every frame is full (default: 30)
        regenerate  {auto,never}      make the VDI anew where it does not serve the view
        draw        {auto,vdi,volume}  what is raycast where the volume is at hand
        status      -     show in a corner how it is drawn: pixels, frames per second, angle
        look:
        """,
    ),
    "turntable": Verb(
        "movie",
        "turn a VDI or a volume about itself: a moving picture",
        "pyvista-vdi turntable knee.vdiset -o knee.gif --frames 60",
        f"degrees=360  DEGREES  turn by so many in all, about what is up\n{_FRAMES}",
    ),
    "movie": Verb(
        "movie",
        "play a series, or fly along a path: a moving picture",
        "pyvista-vdi movie run.vdis -o run.mp4 --turn 20",
        f"""{_FRAMES}
        [path]
        path    FILE ...  views to fly along, each Camera.to_dict() as JSON; two at least
        turn=0  DEGREES   turn by so many meanwhile, about what is up
        """,
    ),
    "info": Verb(
        "files",
        "say what a file holds: a VDI or a volume",
        "pyvista-vdi info knee.vdi --json",
        "VDI|VOLUME scalars preference json",
    ),
    "compare": Verb(
        "measured",
        "compare VTK's mappers, our raycaster and a VDI by pictures",
        "pyvista-vdi compare --example brain --tf soft --out out",
        """
        VOLUME out size=1280x720 angles=0,5,30 no_vtk
        repeats=3        COUNT           timed frames of each kind
        precision=exact  {exact,8-byte}  of the supersegments
        compression=lz4 max_supersegments sample_distance device
        look:
        """,
    ),
    "tradeoff": Verb(
        "measured",
        "measure what each setting of a VDI costs and gives",
        "pyvista-vdi tradeoff --example brain --out out",
        """
        VOLUME out no_vtk device
        name           NAME      in place of the volume's own, for several runs of one
        quick          -         fewer settings and angles in a smaller window
        size|window_size  WxH    of all frames (default: 640x360; quick: 320x180)
        angles         A,B,...   from the generating view (default: 5,30,60; quick: 5,30)
        repeats=5      COUNT     timed frames
        generations=3  COUNT     timed generations of each VDI
        sweep  AXIS[=A,B,...] ...  settings, with other values than usual: max-supersegments, \
tolerance, lists, precision, skip-empty, preview, criterion, view-cone, sample-distance
        table:
        """,
    ),
    "convert": Verb(
        "files",
        "write a VDI, a series or a set in another format",
        "pyvista-vdi convert knee.vdi -o knee.exr",
        """
        VDI output
        [file]
        compression compression_level
        precision  {exact,8-byte}  of the supersegments; by default as in the file
        values:
        [deep images of other programs]
        camera_json  FILE    the view that the image shows, where it does not say it
        thickness    LENGTH  world units, given to samples that have none (surfaces)
        """,
    ),
}
