"""
The light fluid's bubbles, lit from the side
============================================

``shade=True`` lights a volume by the plotter's own lights, whose light is baked into the VDI. One
low light makes the surface between both fluids plain.

.. image:: /images/gallery-mixing_surface.jpg
   :alt: A landscape of round bubbles and narrow valleys under low light
"""

# sphinx_gallery_thumbnail_path = 'images/gallery-mixing_surface.jpg'

import pyvista as pv

import pyvista_vdi as pvdi

field = pvdi.examples.load_data("rayleigh_taylor")
pl = pv.Plotter(window_size=(640, 480), lighting="none")
pl.background_color = "black"
pl.add_light(pv.Light(position=(500, -400, 330), focal_point=field.center, intensity=1.1))
pl.add_vdi(
    field,
    cmap="YlGnBu",
    opacity=[0, 0, 0.9, 0.5, 0, 0, 0],
    shade=True,
    ambient=0.25,
    interpolation="linear",
    show_scalar_bar=False,
)
pl.camera_position = [(-70, -200, 320), field.center, (0, 0, 1)]
pl.show(screenshot="mixing_surface.png")
