"""
What a VDI loses when it is turned
==================================

The same view, 30 degrees from where a VDI was made: the volume, a VDI with up to 20 supersegments
in a list, and one with up to 3. SSIM, against the volume, says how alike pictures are.

.. image:: /images/gallery-turned_away.jpg
   :alt: Three pictures of a brain, the last with streaks along the rays that it was made of
"""

# sphinx_gallery_thumbnail_path = 'images/gallery-turned_away.jpg'

import matplotlib.pyplot as plt

import pyvista_vdi as pvdi

brain = pvdi.examples.load_brain()
look = {"cmap": "mri-brain", "ambient_occlusion": True, "interpolation": "linear"}
made_from = pvdi.Camera((265, 385, 210), brain.center, (0, 0, 1))
view, size = made_from.azimuth(30), (360, 360)
pictures = {"the volume": pvdi.render_volume(brain, view, size, **look)}
for most in (20, 3):
    vdi = pvdi.generate(brain, made_from, size, max_supersegments=most, **look)
    picture = pvdi.render(vdi, view)
    ssim = pvdi.compare_images(picture, pictures["the volume"]).ssim
    pictures[f"at most {most}: SSIM {ssim:.3f}"] = picture

# %%
# Side by side.
figure, axes = plt.subplots(1, 3, figsize=(9.6, 3.4), layout="constrained", facecolor="black")
for axis, (text, picture) in zip(axes, pictures.items(), strict=True):
    axis.imshow(picture[..., :3])
    axis.set_title(text, color="white")
    axis.axis("off")
figure.savefig("turned_away.png", dpi=100)
