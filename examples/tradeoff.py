"""Choosing the settings of a VDI by measuring: a few of them on one volume, drawn as a curve.

What one should see: four panels, each with SSIM upwards. Filled marks on a grey staircase are
settings that nothing beats in that panel, with their names; hollow ones are not worth their price.
Previews lie at the lower left of the first panel (fast and blurred), twice as many lists along each
edge at the upper right of all; in the panels of bytes 8-byte supersegments lie left of the
default, at the same height.

With a file name as argument the picture is written there, else to tradeoff.png. It takes about ten
seconds, and times of so short frames are rough.
"""

from __future__ import annotations

import sys

from pyvista_vdi import examples
from pyvista_vdi.measure.tradeoff import measure_tradeoff, sweep


def main() -> None:
    """Measure, print the fronts, and write the picture."""
    target = sys.argv[1] if len(sys.argv) > 1 else "tradeoff.png"
    settings = sweep(
        {
            "max_supersegments": (5, 40),
            "lists": (0.5, 2.0),
            "precision": ("8-byte",),
            "preview": (0.5,),
        },
        pairs=False,
    )
    found = measure_tradeoff(
        examples.load_brain(as_volume=True),
        settings,
        window_size=(320, 180),
        angles=(5, 30),
        name="brain",
        cmap="bone",
        opacity="linear",
    )
    for kind in ("frame", "memory", "generation"):
        print(f"{kind}: {', '.join(found.front(kind))}")
    print(f"written: {found.save_plot(target)}")


if __name__ == "__main__":
    main()
