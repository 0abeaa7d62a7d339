"""The options of the verb ``tradeoff``; their types are those of other verbs."""

from __future__ import annotations

import argparse

from pyvista_vdi.cli.options import parse_count, parse_numbers, parse_size

#: Frames and views, without and with ``--quick``.
SIZES = ((640, 360), (320, 180))
ANGLES = ((5.0, 30.0, 60.0), (5.0, 30.0))


def add_sweep_options(parser: argparse.ArgumentParser) -> None:
    """Add what is measured and where it goes."""
    parser.add_argument(
        "--out",
        metavar="FOLDER",
        default=".",
        help="where tradeoff-NAME.json (every figure), .md (tables) and .png (plot) go",
    )
    parser.add_argument("--name", help="in place of the volume's own, for several runs of one")
    parser.add_argument("--resume", action="store_true", help="go on with what is there")
    parser.add_argument(
        "--quick", action="store_true", help="fewer settings and angles in a smaller window"
    )
    parser.add_argument(
        "--size",
        "--window-size",
        type=parse_size,
        metavar="WxH",
        help="of all frames, pixels (default: 640x360; with --quick 320x180)",
    )
    parser.add_argument(
        "--angles",
        type=parse_numbers,
        metavar="A,B,...",
        help="degrees from V_O (default: 5,30,60; with --quick 5,30)",
    )
    parser.add_argument(
        "--sweep",
        nargs="+",
        metavar="AXIS[=A,B,...]",
        help="which settings, with values other than the usual ones: max-supersegments, "
        "tolerance, lists (along an edge, per pixel), precision, skip-empty, preview (share of the "
        "pixels along an edge); and on request criterion, view-cone, sample-distance (voxels)",
    )
    among = parser.add_mutually_exclusive_group()
    among.add_argument(
        "--alone", action="store_true", help="change one setting at a time, and no two together"
    )
    among.add_argument("--product", action="store_true", help="measure every combination")
    parser.add_argument(
        "--repeats", type=parse_count, default=5, metavar="N", help="timed frames (default: 5)"
    )
    parser.add_argument(
        "--generations",
        type=parse_count,
        default=5,
        metavar="N",
        help="timed generations of each VDI (default: 5)",
    )
    parser.add_argument("--no-vtk", action="store_true", help="leave out VTK's mappers")
