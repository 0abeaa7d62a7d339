"""
How far away a brain is
=======================

A VDI knows the depth of what it shows. ``render_depth`` gives, for each pixel, the distance at
which half of the light is lost: a map of the surface, with lines of equal distance, no mesh having
been made.

.. image:: /images/gallery-brain_depth.jpg
   :alt: A brain in colours of distance, with contour lines that follow its folds
"""

# sphinx_gallery_thumbnail_path = 'images/gallery-brain_depth.jpg'

import matplotlib.pyplot as plt
import numpy as np

import pyvista_vdi as pvdi

brain = pvdi.examples.load_brain()
view = pvdi.Camera((-110, 310, 268), brain.center, (0, 0, 1))
vdi = pvdi.generate(brain, view, (640, 480), cmap="mri-brain", interpolation="linear")
depth = pvdi.render_depth(vdi, view.azimuth(5), (640, 480), opacity_threshold=0.5)

# %%
# Pixels that show nothing have no distance.
depth = np.where(np.isfinite(depth), depth, np.nan)
figure = plt.figure(figsize=(6.4, 4.8), facecolor="black")
axes = figure.add_axes((0, 0, 1, 1))
axes.imshow(depth, cmap="magma_r")
axes.contour(depth, levels=np.arange(100, 400, 4), colors="black", linewidths=0.4)
axes.axis("off")
figure.savefig("brain_depth.png", dpi=100)
