"""A VDI as one HTML file, which anyone opens: no Python, no server, no network.

What one should see in a browser: a brain, first coarse and a moment later sharp; it turns with the
left mouse button as in VTK, and loses accuracy the farther it is turned.

The page is written to the file that the argument names (web_page.html without one).
"""

from __future__ import annotations

import sys

import pyvista_vdi as pvdi
from pyvista_vdi import examples

target = sys.argv[1] if len(sys.argv) > 1 else "web_page.html"

volume = examples.load_brain()
camera = pvdi.Camera((90, 560, 180), volume.center, (0, 0, 1))
vdi = volume.vdi.generate(camera, (640, 360), cmap="bone", opacity="linear")
page = vdi.save(target, title="Brain", background=(0.1, 0.1, 0.15))
print(f"{page}: {page.stat().st_size / 2**20:.1f} MiB, {vdi.n_supersegments} supersegments")

# Whoever has the page has the VDI
again = pvdi.read(page)
assert again.equals(vdi.with_precision("8-byte"))
