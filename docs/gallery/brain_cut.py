"""
A corner cut out of a brain
===========================

Cropping takes an eighth of the volume away, as VTK's volume mappers do. The VDI has been made of
all of it: where the planes lie is decided frame by frame, and nothing is made anew.

.. image:: /images/gallery-brain_cut.jpg
   :alt: A brain, a corner of which is cut away and shows grey and white matter
"""

# sphinx_gallery_thumbnail_path = 'images/gallery-brain_cut.jpg'

import pyvista as pv

import pyvista_vdi as pvdi

brain = pvdi.examples.load_brain()
pl = pv.Plotter(window_size=(640, 480))
pl.background_color = "black"
actor = pl.add_vdi(
    brain,
    cmap="bone",
    clim=(20, 140),
    opacity=[0, 0.1, 1, 1],
    interpolation="linear",
    max_supersegments=60,
    show_scalar_bar=False,
)

# %%
# Of the 27 regions that six planes make, all are shown but the one in the middle, which is here to
# the right, at the front and above.
actor.mapper.SetCropping(True)
actor.mapper.SetCroppingRegionPlanes(88, 181, 100, 217, 88, 181)
actor.mapper.SetCroppingRegionFlags((1 << 27) - 1 & ~(1 << (1 + 3 * 1 + 9 * 1)))
pl.camera_position = [(370, 420, 300), brain.center, (0, 0, 1)]
pl.camera.zoom(1.3)
pl.show(screenshot="brain_cut.png")
