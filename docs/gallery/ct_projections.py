"""
Projections of a CT
===================

What is not composited has no VDI, but the volume raycaster draws it: the greatest, the least and
the mean value along each ray of a CT, as an X-ray picture shows it.

.. image:: /images/gallery-ct_projections.jpg
   :alt: Three grey discs: bright pins and bars, dark pins, and a haze with both
"""

# sphinx_gallery_thumbnail_path = 'images/gallery-ct_projections.jpg'

import numpy as np
from PIL import Image

import pyvista_vdi as pvdi

ct = pvdi.examples.load_data("ct")
x, y, z = ct.center
view = pvdi.Camera(
    (x, y, z - 400), (x, y, z), (0, -1, 0), parallel_projection=True, parallel_scale=105
)
looks = {"maximum": (-200, 1200), "minimum": (-1000, 300), "average": (-100, 250)}
pictures = [
    pvdi.render_volume(
        ct, view, (320, 320), cmap="gray", opacity=[1, 1], clim=clim, blending=blending
    )
    for blending, clim in looks.items()
]
row = np.concatenate([picture[..., :3] for picture in pictures], axis=1)
Image.fromarray(np.rint(255 * row).astype(np.uint8)).save("ct_projections.png")
