"""
Half a brain of glass
=====================

The same scan twice in the same place, with a look of its own for each half. VDIs that overlap are
merged by depth along each ray, in whatever order they were added.

.. image:: /images/gallery-brain_halves.jpg
   :alt: A brain, one half of which is opaque, and the other translucent and red
"""

# sphinx_gallery_thumbnail_path = 'images/gallery-brain_halves.jpg'

import pyvista as pv

import pyvista_vdi as pvdi

brain = pvdi.examples.load_brain()
middle = 90
left = brain.crop(extent=(0, middle, 0, 216, 0, 180))
right = brain.crop(extent=(middle, 180, 0, 216, 0, 180))
pl = pv.Plotter(window_size=(640, 480))
pl.background_color = "black"
pl.add_vdi(left, **pvdi.presets["mri-brain"], interpolation="linear", show_scalar_bar=False)
pl.add_vdi(right, cmap="mri-muscle", clim=(0, 133), interpolation="linear", show_scalar_bar=False)
pl.camera_position = [(130, 470, 300), brain.center, (0, 0, 1)]
pl.camera.zoom(1.35)
pl.show(screenshot="brain_halves.png")
