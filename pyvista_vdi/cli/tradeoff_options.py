"""The options of the verb ``tradeoff``; imports nothing but the standard library."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

#: Frames and views, without and with ``--quick``.
SIZES = ((640, 360), (320, 180))
ANGLES = ((5.0, 30.0, 60.0), (5.0, 30.0))


def add_sweep_options(
    parser: argparse.ArgumentParser,
    size: Callable[[str], Any],
    numbers: Callable[[str], Any],
    count: Callable[[str], Any],
) -> None:
    """Add what is measured and where it goes.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        The verb's.
    size, numbers, count : callable
        Types of the options that other verbs have, too.
    """
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
        type=size,
        metavar="WxH",
        help="of all frames, pixels (default: 640x360; with --quick 320x180)",
    )
    parser.add_argument(
        "--angles",
        type=numbers,
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
        "--repeats", type=count, default=5, metavar="N", help="timed frames (default: 5)"
    )
    parser.add_argument(
        "--generations",
        type=count,
        default=5,
        metavar="N",
        help="timed generations of each VDI (default: 5)",
    )
    parser.add_argument("--no-vtk", action="store_true", help="leave out VTK's mappers")
