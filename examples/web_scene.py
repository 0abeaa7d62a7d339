"""A plotter's scene with a VDI as one HTML file, which anyone opens: no Python, no server.

What one should see in a browser: a brain, cut open, with a slice of the scan on the cut; a red
sphere in it, half before the cut; an outline around it, a title and a scalar bar. It turns with
the left mouse button as in VTK.

The page is written to the file that the argument names (web_scene.html without one).
"""

from __future__ import annotations

import sys
from pathlib import Path

import pyvista as pv

from pyvista_vdi import examples

target = Path(sys.argv[1] if len(sys.argv) > 1 else "web_scene").with_suffix(".html")

volume = examples.load_brain()
x, y, z = volume.center
cut = pv.generate_plane(normal=(-1, 0, 0), origin=(x + 20, y, z))

plotter = pv.Plotter(off_screen=True, window_size=(640, 360))
actor = plotter.add_vdi(volume, cmap="bone", opacity="linear", scalar_bar_args={"title": "MRI"})
actor.mapper.AddClippingPlane(cut)
slice_ = volume.slice("x", origin=cut.GetOrigin()).threshold(20)
plotter.add_mesh(slice_, cmap="bone", clim=(0, 133), lighting=False, show_scalar_bar=False)
plotter.add_mesh(pv.Sphere(radius=18, center=(x + 20, y + 40, z)), color="tomato")
plotter.add_mesh(volume.outline(), color="gray")
plotter.add_text("A brain, cut open", position="upper_left", font_size=10)
plotter.set_background("white", top="lightsteelblue")
plotter.camera_position = [(560, 330, 240), (x, y, z), (0, 0, 1)]
plotter.vdi.export_html(target)
plotter.close()
print(f"{target}: {target.stat().st_size / 2**20:.1f} MiB")
