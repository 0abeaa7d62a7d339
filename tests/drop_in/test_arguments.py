"""Every argument of ``add_volume``, in every form."""

import matplotlib as mpl
import numpy as np
import pyvista as pv
from drop_in.stage import Kind, expectations
from drop_in.volumes import grid, values
from matplotlib.colors import ListedColormap

kind = Kind("Arguments of add_volume")


def case(case, /, *, volume=grid, **keywords):
    """Add a case that is nothing but arguments; values that are functions make them anew."""
    how = expectations(keywords)

    def scene(pl, add):
        made = {key: v() if type(v) is type(lambda: 0) else v for key, v in keywords.items()}
        add(volume(), **made)

    kind.add(case, scene, **how)


def ramp_table(**how):
    """A function that makes a table with opacities of its own."""

    def make():
        table = pv.LookupTable(**{"cmap": "cividis", "scalar_range": (1, 222), **how})
        table.apply_opacity([0.0, 0.2, 0.6, 0.3])
        return table

    return make


def table_of_bytes():
    table = pv.LookupTable()
    steps = np.linspace(0, 255, 8)
    rgba = np.stack([steps, 255 - steps, 90 + 0 * steps, steps / 3], axis=1)
    table.values = rgba.astype(np.uint8)
    table.scalar_range = (0, 255)
    return table


def shifted(by):
    """A function that makes a volume of values that are so much higher."""

    def make():
        volume = grid()
        volume["values"] += by
        return volume

    return make


def steps():
    """Labels 0 to 5."""
    return grid(high=5.0, dtype=np.uint8)


def several():
    """Three arrays of points, two of cells, of which one has the name of another."""
    volume = grid()
    volume["waves"] = 100 * np.sin(volume["values"] / 30)
    volume["other"] = volume["waves"]
    volume.cell_data["cells"] = np.linspace(0, 9, volume.n_cells)
    volume.cell_data["other"] = np.linspace(9, 0, volume.n_cells)
    volume.set_active_scalars("values")
    return volume


def rgba():
    """Colours by place, opacity by value."""
    z, y, x = np.meshgrid(*(np.linspace(0, 255, 24),) * 3, indexing="ij")
    return np.stack([x, y, z, values() * 255], axis=-1).reshape(-1, 4).astype(np.uint8)


def array():
    return values() * 255


case("none", quick=True)

for each in (
    *("linear", "linear_r", "geom", "geom_r", "sigmoid", "sigmoid_r", "sigmoid_3", "sigmoid_5_r"),
    *("sigmoid_10", "sigmoid_20", "foreground"),
):
    case(f"opacity={each!r}", opacity=each, quick=each == "sigmoid_5_r")
case("opacity=0.1", opacity=0.1)
case("opacity=1.0", opacity=1.0)
case("opacity: a list", opacity=[0, 0, 0.02, 0.9, 1.0])
case("opacity: a tuple", opacity=(0, 0.5, 0.1, 0.8))
case("opacity: an array up to 1", opacity=np.linspace(0, 0.7, 11))
case("opacity: an array of n_colors", opacity=np.arange(16) * 9, n_colors=16)
case("opacity: uint8 of 256", opacity=(np.linspace(0, 1, 256) ** 2 * 200).astype(np.uint8))
case("opacity: of no such name", opacity="linar", both_refuse=True)
case("opacity: longer than n_colors", opacity=np.ones(300), both_refuse=True)

for each in ("bone", "viridis_r", "coolwarm", "hot", "tab10", "Blues"):
    case(f"cmap={each!r}", cmap=each)
case("cmap: names of colours", cmap=["red", "lime", "blue"])
case("cmap: matplotlib's", cmap=mpl.colormaps["magma"])
case("cmap: ListedColormap", cmap=ListedColormap([(0.1, 0.2, 0.9), (0.9, 0.8, 0.1)]))
case("cmap: LookupTable", cmap=ramp_table(), quick=True)
case("cmap: LookupTable of bytes", cmap=table_of_bytes)
case("cmap: LookupTable, clim and opacity beside it", cmap=ramp_table(), clim=(0, 50), opacity=0.5)
for side, clim in (("below", (90, 222)), ("above", (9, 122))):
    table = ramp_table(**{f"{side}_range_color": "red", "scalar_range": clim})
    case(f"cmap: LookupTable of a colour {side} the range", cmap=table)
case("cmap: of no such name", cmap="viridi", both_refuse=True)
case("flip_scalars", flip_scalars=True, cmap="plasma")
case("colormap", colormap="plasma")
for n in (2, 3, 16, 255, 512, 1000):
    case(f"n_colors={n}", n_colors=n)

for each in ((0, 255), (50, 150), (-100, 400), [20, 200], 100, 40.0, (0, 1), (-50, -10)):
    case(f"clim={each}", clim=each, quick=each == (50, 150))
case("clim above all values", clim=(300, 400), opacity=0.2)
UPWARDS = "a range goes upwards: flip_scalars turns the colours; add_volume draws with VTK's errors"
case("clim the wrong way round", clim=(200, 50), refused=("the smaller first", UPWARDS))
case("rng", rng=(10, 190))
case("log_scale", volume=shifted(1), log_scale=True, cmap="bone", quick=True)
case("log_scale and clim", log_scale=True, clim=(1, 255))
case("log_scale of negative values", volume=shifted(-100), log_scale=True)
case("categories", volume=steps, categories=True, opacity=0.2, quick=True)
case("categories of an opacity array", volume=steps, categories=True, opacity=[0, 0.1, 0.6])
case("annotations", annotations={50: "low", 200: "high"})

case("scalars by name", volume=several, scalars="waves")
case("scalars of cells by name", volume=several, scalars="cells")


@kind.case(
    name="scalars of both, points preferred",
    note="add_volume shows the cells' values; the points' by another name",
)
def _(pl, add):
    add(several(), scalars="other" if add.ours else "waves", scalar_bar_args={"title": "other"})


case("scalars of both, cells preferred", volume=several, scalars="other", preference="cell")
case("scalars: an array", scalars=values().ravel() ** 2)
case("scalars: RGBA", scalars=rgba, quick=True)
case("scalars: RGBA and an opacity", scalars=rgba, opacity="sigmoid", warns="opacity is ignored")
case("scalars: of no such name", scalars="w", both_refuse=True)
case("scalars: of a wrong length", scalars=np.zeros(7), both_refuse=True)
case("scalars: texts", scalars=np.full(24**3, "a"), both_refuse=True)
case("scalars: RGB", scalars=np.zeros((24**3, 3), np.uint8), both_refuse=True)
case("scalars: RGBA as floats", scalars=np.zeros((24**3, 4)), both_refuse=True)
case("scalars: values per cell", scalars=np.linspace(0, 1, 23**3) ** 2)

for n in (0.5, 0.01, 10):
    case(f"opacity_unit_distance={n}", opacity_unit_distance=n)
NO_LENGTH = ("length in model units above 0", "no opacity is reached over no length")
case("opacity_unit_distance=0", opacity_unit_distance=0, refused=NO_LENGTH)
case("shade", shade=True, quick=True)
case("shade and specular", shade=True, specular=1.0, specular_power=40.0)
case("light without shade", ambient=0.9, diffuse=0.2, specular=1.0, specular_power=1.0)

FRAMED = {"interactive": False, "outline": True, "fill": True, "background_color": "white"}
BARS = {
    "title": {"title": "Density", "n_labels": 3},
    "vertical": {"vertical": True, "fmt": "%.0f", "color": "black"},
    "place": {"position_x": 0.1, "position_y": 0.8, "height": 0.15, "width": 0.8},
    "interactive": FRAMED,
}
case("show_scalar_bar=False", show_scalar_bar=False)
for name, bar in BARS.items():
    case(f"scalar_bar_args: {name}", scalar_bar_args=bar)
NO_BAR = {"show_scalar_bar": False, "scalar_bar_args": {"title": "x"}}
case("scalar_bar_args although show_scalar_bar=False", **NO_BAR)

TURNED = pv.Transform().rotate_z(30).scale(1.0, 1.2, 0.8).translate(0.5, 0.1, 0.2).matrix
case("user_matrix", user_matrix=TURNED, quick=True)
case("user_matrix: a Transform", user_matrix=pv.Transform().rotate_x(40))
case("user_matrix: a mirror", user_matrix=np.diag([-1.0, 1, 1, 1]))
case("name", name="ball")
case("pickable=False", pickable=False)
case("reset_camera=False", reset_camera=False)
case("reset_camera=True", reset_camera=True)
case("render=False", render=False)
for each in (True, "front", "back", "f"):
    case(f"culling={each!r}", culling=each)
case("culling of no such side", culling="side", both_refuse=True)
NO_KIND = {"volume": several, "scalars": "other", "preference": "edge"}
case("preference of no such kind", **NO_KIND, both_refuse=True)
case("an unknown argument", opacities=0.1, both_refuse=True)
case("scalar", scalar="values", both_refuse=True)

case("a NumPy array", volume=array)
case("a NumPy array and resolution", volume=array, resolution=(1, 2, 3), quick=True)
case("a NumPy array and a wrong resolution", volume=values, resolution=(1, 2), both_refuse=True)
case("a flat NumPy array", volume=lambda: np.zeros((3, 3)), both_refuse=True)
case("a list", volume=lambda: [[[1.0]]], both_refuse=True)

SUMS = "a VDI holds colours and optical depths, not the largest (or the sum, mean) of the values"
for each in ("maximum", "minimum", "additive", "average"):
    case(f"blending={each!r}", blending=each, refused=("blending", SUMS))
case("blending='composite'", blending="composite")
case("blending of no such name", blending="over", both_refuse=True)
for each in ("gpu", "smart", "open_gl"):
    case(f"mapper={each!r}", mapper=each, warns="mapper")


@kind.case(
    name="mapper='fixed_point'",
    warns="mapper",
    note="coarse integers, 17 of 255 in 8 x 8 pixels; VTK's default mapper",
)
def _(pl, add):
    add(grid(), mapper="fixed_point" if add.ours else None)


UGRID = "it draws unstructured grids alone; add_volume shows nothing, with VTK's errors"
case("mapper='ugrid'", mapper="ugrid", refused=("mapper", UGRID))
case("mapper of no such name", mapper="fast", both_refuse=True)

test_arguments = kind.test()
