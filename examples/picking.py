"""Click at a VDI: a marker appears where its surface begins.

What one should see: a bluish grey brain, and a light grey sphere to its lower left; five small
red markers half sunk into the brain's surface, and a sixth into the sphere's. A seventh was asked
for where nothing is, and is not there.

Off-screen (with a file name as argument, or PYVISTA_OFF_SCREEN=true) seven places are picked and a
picture is written; else a window opens, in which a left click sets a marker.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pyvista as pv

import pyvista_vdi as pvdi

#: What off-screen is clicked at, in pixels of the window from its lower left corner.
PLACES = ((345, 250), (265, 220), (410, 265), (310, 200), (350, 310), (182, 175), (20, 20))


def main() -> None:
    """Show it, or write a picture of it."""
    target = sys.argv[1] if len(sys.argv) > 1 else "picking.png"
    off_screen = len(sys.argv) > 1 or pv.OFF_SCREEN
    plotter = pv.Plotter(off_screen=off_screen, window_size=(640, 480))
    volume = pvdi.examples.load_brain()
    brain = plotter.add_vdi(volume, cmap="bone", opacity="sigmoid_10", show_scalar_bar=False)
    brain.mapper.SetPickingOpacity(0.5)
    size = volume.length
    beside = np.add(volume.center, np.multiply((0.3, -0.3, -0.35), size))
    plotter.add_mesh(pv.Sphere(radius=0.07 * size, center=beside), color="lightgrey")

    def mark(point: Any, picker: Any) -> None:
        prop = picker.GetViewProp()
        if prop is None:
            return
        marker = pv.Sphere(radius=0.012 * size, center=point)
        plotter.add_mesh(marker, color="red", pickable=False, reset_camera=False)
        if prop is brain:
            hit = brain.pick(*picker.GetSelectionPoint()[:2])
            print(f"supersegment {hit.index} of list {hit.list}, at {np.round(hit.position, 1)}")

    plotter.enable_point_picking(
        mark,
        picker="prop",
        use_picker=True,
        left_clicking=True,
        show_point=False,
        show_message=not off_screen,
    )
    if not off_screen:
        plotter.show()
        return
    plotter.show(auto_close=False)
    for x, y in PLACES:
        plotter.iren.picker.Pick(x, y, 0, plotter.renderer)
    plotter.screenshot(target)
    print(f"{brain.vdi}\nwritten: {target}")
    plotter.close()


if __name__ == "__main__":
    main()
