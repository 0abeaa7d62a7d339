"""
Materials of a CT by their density
==================================

A CT's values have a unit, so that a look can name materials. The cylinder of this phantom is left
clear, lighter plastics are blue, denser ones orange, and each pin bears the mean of its values.
One that is nearly as dense as the cylinder stays unseen.

.. image:: /images/gallery-ct_pins.jpg
   :alt: Pins of several colours in a clear cylinder, with their Hounsfield units beside them
"""

# sphinx_gallery_thumbnail_path = 'images/gallery-ct_pins.jpg'

import numpy as np
import pyvista as pv
from matplotlib.colors import LinearSegmentedColormap

import pyvista_vdi as pvdi

ct = pvdi.examples.load_data("ct")
values = [-1000, -400, -250, -130, -60, 160, 260, 420, 1000, 1800]  # Hounsfield units
colors = ["royalblue"] * 2 + ["deepskyblue", "turquoise"] + ["slategray"] * 2
colors += ["orange"] * 2 + ["linen", "white"]
opacities = [0, 0, 0.1, 0.06, 0.008, 0.004, 0.08, 0.3, 0.9, 1]
at = np.interp(values, [-1000, 1800], [0, 1])
pl = pv.Plotter(window_size=(640, 480))
pl.background_color = "black"
pl.add_vdi(
    ct,
    cmap=LinearSegmentedColormap.from_list("density", list(zip(at, colors, strict=True))),
    opacity=255 * np.interp(np.linspace(-1000, 1800, 256), values, opacities),
    clim=(-1000, 1800),
    interpolation="linear",
    show_scalar_bar=False,
)

# %%
# Rows and columns of the pins' axes, and the means around them in seven slices.
scan = ct["hounsfield"].reshape(ct.dimensions[::-1])
pins = [(325, 206), (85, 206), (102, 146), (206, 86), (309, 146), (206, 325), (102, 265)]
means = [scan[2:9, y - 4 : y + 5, x - 4 : x + 5].mean() for y, x in pins]
ends = [(x * ct.spacing[0], y * ct.spacing[1], -4) for y, x in pins]
labels = [f"{mean:.0f} HU" for mean in means]
pl.add_point_labels(
    ends,
    labels,
    font_size=13,
    text_color="white",
    shape=None,
    show_points=False,
    always_visible=True,
)
pl.camera_position = [np.add(ct.center, (-65, -215, -235)), ct.center, (0, 0, -1)]
pl.show(screenshot="ct_pins.png")
