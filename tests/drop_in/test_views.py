"""Every kind of view and of window."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv
from drop_in.stage import Kind, shot
from drop_in.volumes import grid

kind = Kind("Views and windows")


def view(name: str, change: Any, **how: Any) -> None:
    """Add a case of a plotter that is changed after the volume came."""

    def scene(pl: pv.Plotter, add: Any) -> None:
        add(grid(), show_scalar_bar=False)
        pl.add_mesh(pv.Sphere(radius=0.4, center=(0.4, -0.3, 0.3)), color="w")
        change(pl)

    kind.add(name, scene, **how)


INSIDE = "coverage='bounds' needs the eye outside"

# -- cameras
for name in ("xy", "xz", "yz", "yx", "zx", "zy", "isometric"):
    view(f"view_{name}", lambda pl, name=name: getattr(pl, f"view_{name}")())
view("view_xy from behind", lambda pl: pl.view_xy(negative=True))
view("view_vector", lambda pl: pl.view_vector((1, 2, -0.5), viewup=(0, 1, 0)))
view("parallel projection", lambda pl: pl.enable_parallel_projection(), quick=True)
view(
    "parallel projection and parallel_scale",
    lambda pl: (pl.enable_parallel_projection(), setattr(pl, "parallel_scale", 1.0)),
)
view("camera_position: a name", lambda pl: setattr(pl, "camera_position", "yz"))
view(
    "camera_position: three vectors",
    lambda pl: setattr(pl, "camera_position", [(4, 1, 2), (0.1, 0, 0), (0, 1, 1)]),
)
view("camera_position: a vector", lambda pl: setattr(pl, "camera_position", (1, -1, 0.4)))
view("azimuth", lambda pl: setattr(pl.camera, "azimuth", 35))
view("elevation", lambda pl: setattr(pl.camera, "elevation", -20))
view("roll", lambda pl: setattr(pl.camera, "roll", 60))
view("zoom", lambda pl: pl.camera.zoom(1.6))
view("zoom out", lambda pl: pl.camera.zoom(0.5))
view("zoom: tight", lambda pl: pl.camera.zoom("tight"))
view("tight", lambda pl: pl.camera.tight(padding=0.1))
view("a wide view angle", lambda pl: setattr(pl.camera, "view_angle", 70))
view("a narrow view angle", lambda pl: setattr(pl.camera, "view_angle", 8))
view("set_focus", lambda pl: pl.set_focus((0.8, 0, 0.5)))
view("set_position", lambda pl: pl.set_position((3, 3, 1)))
view("set_viewup", lambda pl: pl.set_viewup((0, 1, 0.2)))
view(
    "clipping_range",
    lambda pl: (
        pl.show(auto_close=False),
        setattr(pl.camera, "clipping_range", (pl.camera.distance - 0.3, pl.camera.distance + 0.5)),
    ),
)
view(
    "camera inside the volume",
    lambda pl: (
        setattr(pl, "camera_position", [(0.6, 0.3, 0.2), (-1, 0, -0.2), (0, 0, 1)]),
        pl.renderer.ResetCameraClippingRange(),
    ),
    warns=INSIDE,
)
view("a camera of its own", lambda pl: setattr(pl, "camera", pv.Camera()) or pl.reset_camera())
view("a camera that is turned before", lambda pl: (pl.view_yz(), pl.reset_camera()))
view(
    "model_transform_matrix",
    lambda pl: setattr(pl.camera, "model_transform_matrix", pv.Transform().rotate_z(30).matrix),
)
view("set_scale", lambda pl: pl.set_scale(zscale=1.5))
view("set_scale smaller", lambda pl: pl.set_scale(xscale=0.4, yscale=0.8))

# -- backgrounds and anti-aliasing
view("set_background", lambda pl: pl.set_background("lightsteelblue"))
view("set_background, gradient", lambda pl: pl.set_background("black", top="white"))
view(
    "set_background, all",
    lambda pl: pl.set_background("gray", all_renderers=True),
)
view("enable_anti_aliasing('msaa')", lambda pl: pl.enable_anti_aliasing("msaa"))
view("msaa of 8", lambda pl: pl.enable_anti_aliasing("msaa", multi_samples=8))
view("disable_anti_aliasing", lambda pl: pl.disable_anti_aliasing())
view("enable_depth_peeling", lambda pl: pl.enable_depth_peeling(4))
view("enable_lightkit", lambda pl: pl.enable_lightkit())
view("enable_3_lights", lambda pl: pl.enable_3_lights())
view("hidden line removal", lambda pl: pl.enable_hidden_line_removal())
view("add_border", lambda pl: pl.renderer.add_border(color="red", width=4))
view("stereo", lambda pl: pl.enable_stereo_render())


def without(change: str, note: str) -> None:
    """Add a case in which VTK loses volumes; it is compared with the scene without that."""

    def scene(pl: pv.Plotter, add: Any) -> None:
        add(grid(), show_scalar_bar=False)
        if add.ours:
            pl.enable_anti_aliasing("ssaa") if change == "ssaa" else getattr(pl, change)()

    kind.add(change, scene, note=note)


without("ssaa", "add_volume shows nothing on Mesa; the same without it")
without("enable_eye_dome_lighting", "add_volume shows nothing on Mesa; the same without it")
without("add_blurring", "add_volume shows nothing on Mesa; the same without it")

# -- windows
kind.add(
    "two plots in a row",
    lambda pl, add: two(pl, add),
    window={"shape": (1, 2), "window_size": (300, 150)},
    quick=True,
)
kind.add(
    "two plots in a column",
    lambda pl, add: two(pl, add),
    window={"shape": (2, 1), "window_size": (200, 300)},
)
kind.add(
    "three plots as a string",
    lambda pl, add: two(pl, add),
    window={"shape": "1|2", "window_size": (300, 200)},
)
kind.add(
    "plots without a border",
    lambda pl, add: two(pl, add),
    window={"shape": (1, 2), "border": False, "window_size": (300, 150)},
)
kind.add(
    "plots of weights",
    lambda pl, add: two(pl, add),
    window={"shape": (1, 2), "col_weights": [1, 2], "window_size": (300, 150)},
)
kind.add(
    "linked plots",
    lambda pl, add: two(pl, add, link=True),
    window={"shape": (1, 2), "window_size": (300, 150)},
)
kind.add(
    "four plots", lambda pl, add: four(pl, add), window={"shape": (2, 2), "window_size": (300, 220)}
)
kind.add("a window of no lights", lambda pl, add: add(grid()) and None, window={"lighting": "none"})
kind.add(
    "a window of three lights",
    lambda pl, add: add(grid()) and None,
    window={"lighting": "three lights"},
)
kind.add("a wide window", lambda pl, add: add(grid()) and None, window={"window_size": (400, 80)})
kind.add("a tall window", lambda pl, add: add(grid()) and None, window={"window_size": (80, 300)})
kind.add("a small window", lambda pl, add: add(grid()) and None, window={"window_size": (40, 40)})
kind.add("a window with a title", lambda pl, add: add(grid()) and None, window={"title": "x"})
kind.add(
    "line_smoothing and polygon_smoothing",
    lambda pl, add: add(grid()) and None,
    window={"line_smoothing": True, "polygon_smoothing": True},
)
for name in ("dark", "document", "paraview", "default"):

    def themed(pl: pv.Plotter, add: Any, name: str = name) -> None:
        add(grid())

    theme = getattr(
        pv.themes,
        {
            "dark": "DarkTheme",
            "document": "DocumentTheme",
            "paraview": "ParaViewTheme",
            "default": "Theme",
        }[name],
    )
    kind.add(f"theme {name}", themed, window={"theme": theme()})


def own_theme() -> pv.themes.Theme:
    theme = pv.themes.Theme()
    theme.cmap, theme.background, theme.show_scalar_bar = "magma", "darkgreen", False
    theme.camera.position = [4.0, 1, 1]
    return theme


kind.add("a theme's colour map, background and camera", themed, window={"theme": own_theme()})


@kind.case()
def the_global_theme(pl: pv.Plotter, add: Any) -> list[Any]:
    pv.global_theme.cmap = "plasma"
    pv.global_theme.font.size = 8
    other = pv.Plotter(window_size=(200, 150), off_screen=True)
    add(grid(), to=other)
    return [shot(other)]


def two(pl: pv.Plotter, add: Any, link: bool = False) -> None:
    add(grid(), show_scalar_bar=False)
    pl.subplot(*((0, 1) if pl.shape[0] == 1 else (1, 0))) if len(pl.shape) == 2 else pl.subplot(1)
    add(grid(16, seed=1), cmap="hot", show_scalar_bar=False)
    if link:
        pl.link_views()
    pl.camera.azimuth = 40


def four(pl: pv.Plotter, add: Any) -> None:
    for i, opacity in enumerate(("linear", "geom", "sigmoid", 0.05)):
        pl.subplot(*divmod(i, 2))
        pl.add_text(str(opacity), font_size=6)
        add(grid(), opacity=opacity, show_scalar_bar=False)
    pl.link_views()


# -- pictures
def picture(name: str, take: Any, **how: Any) -> None:
    """Add a case that takes its own pictures."""

    def scene(pl: pv.Plotter, add: Any) -> list[Any]:
        add(grid(), show_scalar_bar=False)
        return [np.asarray(each) for each in take(pl)]

    kind.add(name, scene, **how)


picture(
    "screenshot, transparent", lambda pl: [over(shot(pl, transparent_background=True))], quick=True
)
picture("screenshot of twice the size", lambda pl: [shot(pl, scale=2)])
picture("screenshot of a size", lambda pl: [shot(pl, window_size=(120, 160))])
picture("pl.image", lambda pl: [pl.show(auto_close=False) or pl.image])
picture(
    "window_size changed",
    lambda pl: [shot(pl), pl.__setattr__("window_size", (150, 180)) or shot(pl)],
)
picture(
    "show twice",
    lambda pl: [pl.show(auto_close=False) or shot(pl), pl.show(auto_close=False) or shot(pl)],
)
picture("screenshot without show", lambda pl: [pl.screenshot(return_img=True)])
picture("a file", lambda pl: [to_file(pl, "a.png")])
picture(
    "get_image_depth",
    lambda pl: [
        pl.show(auto_close=False)
        or np.repeat(np.isnan(pl.get_image_depth())[..., None] * 255, 3, axis=2)
    ],
)


def over(image: np.ndarray) -> np.ndarray:
    """RGBA over grey."""
    alpha = image[..., 3:] / 255
    return (image[..., :3] * alpha + 90 * (1 - alpha)).astype(np.uint8)


def to_file(pl: pv.Plotter, name: str) -> np.ndarray:
    import tempfile
    from pathlib import Path

    from PIL import Image

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        pl.show(auto_close=False)
        pl.screenshot(path)
        return np.asarray(Image.open(path))[..., :3]


test_views = kind.test()
