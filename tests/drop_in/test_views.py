"""Every kind of view and of window."""

import numpy as np
import pyvista as pv
from drop_in.stage import Kind, shot
from drop_in.volumes import grid

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
zoom(1.6, "zoom")
camera("view_angle", 70, "a wide view angle")
method("set_focus", (0.8, 0, 0.5))


def go_inside(pl):
    pl.camera_position = [(0.6, 0.3, 0.2), (-1, 0, -0.2), (0, 0, 1)]
    pl.renderer.ResetCameraClippingRange()


def give_another(pl):
    pl.camera = pv.Camera()
    pl.reset_camera()


view("camera inside the volume", go_inside)
view("a camera of its own", give_another)
camera("model_transform_matrix", pv.Transform().rotate_z(30).matrix)
method("set_scale", zscale=1.5)

method("set_background", "lightsteelblue")
method("enable_anti_aliasing", "msaa", case="enable_anti_aliasing('msaa')")
method("disable_anti_aliasing")
method("enable_depth_peeling", 4)
method("enable_3_lights")
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


def two(pl, add, *, link=False):
    add(grid(), show_scalar_bar=False)
    pl.subplot(*((0, 1) if pl.shape[0] == 1 else (1, 0)) if len(pl.shape) == 2 else (1,))
    add(grid(16, seed=1), cmap="hot", show_scalar_bar=False)
    if link:
        pl.link_views()
    pl.camera.azimuth = 40


def two_plots(name, size, scene=two, quick=False, **window):
    kind.add(name, scene, window={"window_size": size, **window}, quick=quick)


ROW = (300, 150)
two_plots("two plots in a row", ROW, shape=(1, 2), quick=True)
two_plots("two plots in a column", (200, 300), shape=(2, 1))
two_plots("plots of weights", ROW, shape=(1, 2), col_weights=[1, 2])
two_plots("linked plots", ROW, lambda pl, add: two(pl, add, link=True), shape=(1, 2))


def window(name, **window):
    """Add a case of a window's arguments."""

    def scene(pl, add):
        add(grid())

    kind.add(name, scene, window=window)


window("a window of no lights", lighting="none")
window("a wide window", window_size=(400, 80))
window("a tall window", window_size=(80, 300))
window("theme dark", theme=pv.themes.DarkTheme())


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


picture("screenshot, transparent", over_grey, quick=True)
picture("screenshot of twice the size", lambda pl: [shot(pl, scale=2)])
picture("screenshot of a size", lambda pl: [shot(pl, window_size=(120, 160))])

test_views = kind.test()
