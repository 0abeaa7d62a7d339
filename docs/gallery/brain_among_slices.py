"""
A brain among slices
====================

Meshes and a VDI in one scene: rays end where opaque geometry begins. Here three slices of the scan
stand within a translucent brain.

.. image:: /images/gallery-brain_among_slices.jpg
   :alt: Three grey slices of a brain that cross each other, and translucent red tissue around them
"""

# sphinx_gallery_thumbnail_path = 'images/gallery-brain_among_slices.jpg'

import pyvista as pv

import pyvista_vdi as pvdi

brain = pvdi.examples.load_brain()
pl = pv.Plotter(window_size=(640, 480))
pl.background_color = "black"
for piece in brain.slice_orthogonal(x=72, y=90, z=60):
    inside = piece.threshold(8)
    pl.add_mesh(inside, cmap="gray", clim=(0, 133), lighting=False, show_scalar_bar=False)
actor = pl.add_vdi(brain, cmap="mri-muscle", interpolation="linear", show_scalar_bar=False)
actor.opacity_multiplier = 0.2  # of the VDI: none is made anew
pl.camera_position = [(360, 400, 270), brain.center, (0, 0, 1)]
pl.camera.zoom(1.5)
pl.show(screenshot="brain_among_slices.png")
