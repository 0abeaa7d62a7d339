"""Every kind of view and of window."""

import tempfile
from pathlib import Path

import numpy as np
import pyvista as pv
from drop_in.stage import WINDOW, Kind, shot
from drop_in.volumes import grid
from PIL import Image

kind = Kind("Views and windows")


def view(name, change, **how):
    """Add a case of a plotter that is changed after the volume came."""

    def scene(pl, add):
        add(grid(), show_scalar_bar=False)
        pl.add_mesh(pv.Sphere(radius=0.4, center=(0.4, -0.3, 0.3)), color="w")
        change(pl)

    kind.add(name, scene, **how)


def method(name, *arguments, case=None, **keywords):
    """Add a case of a plotter's method."""
    view(case or name, lambda pl: getattr(pl, name)(*arguments, **keywords))


def camera(name, value, case=None):
    """Add a case of an attribute of the camera."""
    view(case or name, lambda pl: setattr(pl.camera, name, value))


def zoom(by, case):
    view(case, lambda pl: pl.camera.zoom(by))


for name in ("xy", "xz", "yz", "yx", "zx", "zy", "isometric"):
    method(f"view_{name}")
method("view_xy", negative=True, case="view_xy from behind")
method("view_vector", (1, 2, -0.5), viewup=(0, 1, 0))
view("parallel projection", lambda pl: pl.enable_parallel_projection(), quick=True)


def narrow(pl):
    pl.enable_parallel_projection()
    pl.parallel_scale = 1.0


view("parallel projection and parallel_scale", narrow)
PLACE = [(4, 1, 2), (0.1, 0, 0), (0, 1, 1)]
for form, place in {"a name": "yz", "three vectors": PLACE, "a vector": (1, -1, 0.4)}.items():
    view(f"camera_position: {form}", lambda pl, p=place: setattr(pl, "camera_position", p))
camera("azimuth", 35)
camera("elevation", -20)
camera("roll", 60)
zoom(1.6, "zoom")
zoom(0.5, "zoom out")
zoom("tight", "zoom: tight")
view("tight", lambda pl: pl.camera.tight(padding=0.1))
camera("view_angle", 70, "a wide view angle")
camera("view_angle", 8, "a narrow view angle")
method("set_focus", (0.8, 0, 0.5))
method("set_position", (3, 3, 1))
method("set_viewup", (0, 1, 0.2))


def clip(pl):
    pl.show(auto_close=False)
    pl.camera.clipping_range = (pl.camera.distance - 0.3, pl.camera.distance + 0.5)


def go_inside(pl):
    pl.camera_position = [(0.6, 0.3, 0.2), (-1, 0, -0.2), (0, 0, 1)]
    pl.renderer.ResetCameraClippingRange()


def give_another(pl):
    pl.camera = pv.Camera()
    pl.reset_camera()


view("clipping_range", clip)
INSIDE = "coverage='bounds' needs the eye outside"
view("camera inside the volume", go_inside, warns=INSIDE, warns_if=("vdi",))
view("a camera of its own", give_another)
view("a camera that is turned before", lambda pl: (pl.view_yz(), pl.reset_camera()))
camera("model_transform_matrix", pv.Transform().rotate_z(30).matrix)
method("set_scale", zscale=1.5)
method("set_scale", xscale=0.4, yscale=0.8, case="set_scale smaller")

method("set_background", "lightsteelblue")
method("set_background", "black", top="white", case="set_background, gradient")
method("set_background", "gray", all_renderers=True, case="set_background, all")
method("enable_anti_aliasing", "msaa", case="enable_anti_aliasing('msaa')")
method("enable_anti_aliasing", "msaa", multi_samples=8, case="msaa of 8")
method("disable_anti_aliasing")
method("enable_depth_peeling", 4)
method("enable_lightkit")
method("enable_3_lights")
method("enable_hidden_line_removal", case="hidden line removal")
view("add_border", lambda pl: pl.renderer.add_border(color="red", width=4))
method("enable_stereo_render", case="stereo")


def without(case, name, *arguments):
    """Add a case in which VTK loses volumes; it is compared with the scene without that."""

    def scene(pl, add):
        add(grid(), show_scalar_bar=False)
        if add.ours:
            getattr(pl, name)(*arguments)

    kind.add(case, scene, note="add_volume shows nothing on Mesa; the same without it")


without("ssaa", "enable_anti_aliasing", "ssaa")
without("enable_eye_dome_lighting", "enable_eye_dome_lighting")
without("add_blurring", "add_blurring")


def two(pl, add, *, link=False):
    add(grid(), show_scalar_bar=False)
    pl.subplot(*((0, 1) if pl.shape[0] == 1 else (1, 0)) if len(pl.shape) == 2 else (1,))
    add(grid(16, seed=1), cmap="hot", show_scalar_bar=False)
    if link:
        pl.link_views()
    pl.camera.azimuth = 40


def two_plots(name, size, scene=two, quick=False, **window):
    kind.add(name, scene, window={"window_size": size, **window}, quick=quick)


def four(pl, add):
    for i, opacity in enumerate(("linear", "geom", "sigmoid", 0.05)):
        pl.subplot(*divmod(i, 2))
        pl.add_text(str(opacity), font_size=6)
        add(grid(), opacity=opacity, show_scalar_bar=False)
    pl.link_views()


ROW = (300, 150)
two_plots("two plots in a row", ROW, shape=(1, 2), quick=True)
two_plots("two plots in a column", (200, 300), shape=(2, 1))
two_plots("three plots as a string", (300, 200), shape="1|2")
two_plots("plots without a border", ROW, shape=(1, 2), border=False)
two_plots("plots of weights", ROW, shape=(1, 2), col_weights=[1, 2])
two_plots("linked plots", ROW, lambda pl, add: two(pl, add, link=True), shape=(1, 2))
two_plots("four plots", (300, 220), four, shape=(2, 2))


def window(name, **window):
    """Add a case of a window's arguments."""

    def scene(pl, add):
        add(grid())

    kind.add(name, scene, window=window)


def own_theme():
    theme = pv.themes.Theme()
    theme.cmap, theme.background, theme.show_scalar_bar = "magma", "darkgreen", False
    theme.camera.position = [4.0, 1, 1]
    return theme


window("a window of no lights", lighting="none")
window("a window of three lights", lighting="three lights")
window("a wide window", window_size=(400, 80))
window("a tall window", window_size=(80, 300))
window("a small window", window_size=(40, 40))
window("a window with a title", title="x")
window("line_smoothing and polygon_smoothing", line_smoothing=True, polygon_smoothing=True)
window("theme dark", theme=pv.themes.DarkTheme())
window("theme document", theme=pv.themes.DocumentTheme())
window("theme paraview", theme=pv.themes.ParaViewTheme())
window("theme default", theme=pv.themes.Theme())
window("a theme's colour map, background and camera", theme=own_theme())


@kind.case()
def the_global_theme(pl, add):
    pv.global_theme.cmap = "plasma"
    pv.global_theme.font.size = 8
    other = pv.Plotter(window_size=WINDOW, off_screen=True)
    add(grid(), to=other)
    return [shot(other)]


def picture(name, take, **how):
    """Add a case that takes its own pictures."""

    def scene(pl, add):
        add(grid(), show_scalar_bar=False)
        return [np.asarray(each) for each in take(pl)]

    kind.add(name, scene, **how)


def over_grey(pl):
    image = shot(pl, transparent_background=True)
    alpha = image[..., 3:] / 255
    return [(image[..., :3] * alpha + 90 * (1 - alpha)).astype(np.uint8)]


def last_image(pl):
    pl.show(auto_close=False)
    return [pl.image]


def in_another_size(pl):
    yield shot(pl)
    pl.window_size = (150, 180)
    yield shot(pl)


def shown_twice(pl):
    return [pl.show(auto_close=False) or shot(pl) for _ in range(2)]


def of_file(pl):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.png"
        pl.show(auto_close=False)
        pl.screenshot(path)
        return [np.asarray(Image.open(path))[..., :3]]


def depths(pl):
    pl.show(auto_close=False)
    return [np.repeat(np.isnan(pl.get_image_depth())[..., None] * 255, 3, axis=2)]


picture("screenshot, transparent", over_grey, quick=True)
picture("screenshot of twice the size", lambda pl: [shot(pl, scale=2)])
picture("screenshot of a size", lambda pl: [shot(pl, window_size=(120, 160))])
picture("pl.image", last_image)
picture("window_size changed", in_another_size)
picture("show twice", shown_twice)
picture("screenshot without show", lambda pl: [pl.screenshot(return_img=True)])
picture("a file", of_file)
picture("get_image_depth", depths)

test_views = kind.test()
