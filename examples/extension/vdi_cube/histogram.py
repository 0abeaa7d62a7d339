"""The verb ``histogram``."""

import argparse

import numpy as np

from pyvista_vdi.cli import declare
from pyvista_vdi.cli.inputs import read_volume


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's options."""
    declare.volume(parser)
    declare.array(parser)
    declare.option(parser, "--bins", "how many", "N", declare.parse_count, default=8)


def run(options: argparse.Namespace) -> int:
    """Print a line for each bin; return the exit status."""
    counts, edges = np.histogram(read_volume(options).array, options.bins)
    for count, low, high in zip(counts, edges, edges[1:], strict=False):
        print(f"{low:g} to {high:g}: {count}")
    return 0
