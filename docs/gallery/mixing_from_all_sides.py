"""
A mixing layer from all sides
=============================

A VDI serves the views near its own, and a set of them serves all: each picture is drawn from the
VDIs that were made nearest to it. Here eight VDIs of a simulation, a heavy fluid above a light one,
are seen from six views between theirs. Both fluids are clear, and what is mixed is not.

.. image:: /images/gallery-mixing_from_all_sides.jpg
   :alt: Six views of a rough, translucent layer, green below and orange above
"""

# sphinx_gallery_thumbnail_path = 'images/gallery-mixing_from_all_sides.jpg'

import matplotlib.pyplot as plt

import pyvista_vdi as pvdi

field = pvdi.examples.load_data("rayleigh_taylor")
x, y, z = field.center
camera = pvdi.Camera((x - 350, y - 320, z + 130), field.center, (0, 0, 1))
vdis = pvdi.generate_set(
    field,
    8,
    (240, 180),
    camera=camera,
    lists=0.8,
    max_supersegments=10,
    cmap="Spectral_r",
    opacity=[0, 0, 0.08, 0.3, 0.08, 0, 0],
)

# %%
# A set is drawn as a VDI is; ``vdis.save("mixing.vdiset")`` would keep it.
figure, axes = plt.subplots(2, 3, figsize=(9.6, 4.8), layout="constrained", facecolor="black")
for turn, axis in enumerate(axes.flat):
    view = camera.azimuth(60 * turn)
    axis.imshow(pvdi.render(vdis, view)[..., :3])
    axis.set_title(f"{vdis.distances(view).min():.0f}° from the nearest", color="white", size=10)
    axis.axis("off")
figure.savefig("mixing_from_all_sides.png", dpi=100)
