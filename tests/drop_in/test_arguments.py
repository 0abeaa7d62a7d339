"""Every argument of ``add_volume``, in every form."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
import numpy as np
import pyvista as pv
from drop_in.stage import Kind
from drop_in.volumes import grid, values
from matplotlib.colors import ListedColormap

kind = Kind("Arguments of add_volume")


def ramp_table(**how: Any) -> pv.LookupTable:
    """A table with opacities of its own."""
    table = pv.LookupTable(**{"cmap": "cividis", "scalar_range": (1, 222), **how})
    table.apply_opacity([0.0, 0.2, 0.6, 0.3])
    return table


def hand_made_table() -> pv.LookupTable:
    """A table of RGBA values."""
    table = pv.LookupTable()
    steps = np.linspace(0, 255, 8)
    table.values = np.stack([steps, 255 - steps, 90 + 0 * steps, steps / 3], axis=1).astype(
        np.uint8
    )
    table.scalar_range = (0, 255)
    return table


def arguments(case: str, /, *, quick: bool = False, volume: Any = grid, **keywords: Any) -> None:
    """Add a case that is nothing but arguments; values that are functions make them anew."""
    how = {
        key: keywords.pop(key)
        for key in ("refused", "note", "warns", "defect", "both_refuse")
        if key in keywords
    }

    def scene(pl: pv.Plotter, add: Any) -> None:
        made = {key: v() if type(v) is type(lambda: 0) else v for key, v in keywords.items()}
        add(volume(), **made)

    kind.add(case, scene, quick=quick, **how)


arguments("none", quick=True)

# -- opacity
for each in (
    "linear",
    "linear_r",
    "geom",
    "geom_r",
    "sigmoid",
    "sigmoid_r",
    "sigmoid_3",
    "sigmoid_5_r",
    "sigmoid_10",
    "sigmoid_20",
    "foreground",
):
    arguments(f"opacity={each!r}", opacity=each, quick=each == "sigmoid_5_r")
arguments("opacity=0.1", opacity=0.1)
arguments("opacity=1.0", opacity=1.0)
arguments("opacity=1, an int", opacity=1)
arguments("opacity: a list", opacity=[0, 0, 0.02, 0.9, 1.0])
arguments("opacity: a tuple", opacity=(0, 0.5, 0.1, 0.8))
arguments("opacity: two entries", opacity=[0.0, 0.4])
arguments("opacity: an array up to 1", opacity=np.linspace(0, 0.7, 11))
arguments("opacity: an array of n_colors", opacity=np.arange(16) * 9, n_colors=16)
arguments("opacity: uint8 of 256", opacity=(np.linspace(0, 1, 256) ** 2 * 200).astype(np.uint8))
arguments("opacity: a hat of 256", opacity=np.where(abs(np.arange(256) - 120) < 30, 90.0, 0.0))
arguments("opacity: an array up to 255", opacity=np.array([0, 20, 80, 200]))
arguments("opacity: a float array of 256, a step", opacity=np.r_[np.zeros(100), np.full(156, 40.0)])
arguments("opacity: of no such name", opacity="linar", both_refuse=True)
arguments("opacity: longer than n_colors", opacity=np.ones(300), both_refuse=True)

# -- colour maps
for each in ("bone", "viridis_r", "coolwarm", "hot", "tab10", "Blues"):
    arguments(f"cmap={each!r}", cmap=each)
arguments("cmap: names of colours", cmap=["red", "lime", "blue"])
arguments("cmap: hexadecimal colours", cmap=["#102030", "#ff8800", "#ffffff"])
arguments("cmap: one colour", cmap=["orange"])
arguments("cmap: matplotlib's", cmap=mpl.colormaps["magma"])
arguments("cmap: ListedColormap", cmap=ListedColormap([(0.1, 0.2, 0.9), (0.9, 0.8, 0.1)]))
arguments("cmap: LookupTable", cmap=ramp_table, quick=True)
arguments("cmap: LookupTable of bytes", cmap=hand_made_table)
arguments("cmap: LookupTable, logarithmic", cmap=lambda: ramp_table(log_scale=True))
arguments("cmap: LookupTable of 6 colours", cmap=lambda: ramp_table(n_values=6))
arguments(
    "cmap: LookupTable, clim and opacity beside it", cmap=ramp_table, clim=(0, 50), opacity=0.5
)
arguments(
    "cmap: LookupTable of a colour below the range",
    cmap=lambda: ramp_table(below_range_color="red", scalar_range=(90, 222)),
)
arguments(
    "cmap: LookupTable of a colour above the range",
    cmap=lambda: ramp_table(above_range_color="red", scalar_range=(9, 122)),
)
arguments("cmap: of no such name", cmap="viridi", both_refuse=True)
arguments("flip_scalars", flip_scalars=True, cmap="plasma")
arguments("flip_scalars of a list", flip_scalars=True, cmap=["red", "lime", "blue"])
arguments("colormap", colormap="plasma")
for n in (2, 3, 16, 255, 512, 1000):
    arguments(f"n_colors={n}", n_colors=n)

# -- range
for each in (
    (0, 255),
    (50, 150),
    (-100, 400),
    [20, 200],
    100,
    40.0,
    (0, 1),
    (-50, -10),
    np.array([10, 90]),
):
    text = "numpy.array([10, 90])" if isinstance(each, np.ndarray) else each
    arguments(
        f"clim={text}", clim=each, quick=each == (50, 150) if isinstance(each, tuple) else False
    )
arguments("clim of one value", clim=(100, 100))
arguments("clim above all values", clim=(300, 400), opacity=0.2)
arguments(
    "clim the wrong way round",
    clim=(200, 50),
    refused=(
        "the smaller first",
        "a range goes upwards: flip_scalars turns the colours; add_volume draws with VTK's errors",
    ),
)
arguments("rng", rng=(10, 190))
arguments("log_scale", volume=lambda: above_zero(), log_scale=True, cmap="bone", quick=True)
arguments("log_scale and clim", log_scale=True, clim=(1, 255))
arguments("log_scale and clim from 0", log_scale=True, clim=(0, 255))
arguments("log_scale of negative values", volume=lambda: shifted(), log_scale=True)
arguments("categories", volume=lambda: steps(), categories=True, opacity=0.2, quick=True)
arguments(
    "categories of an opacity array", volume=lambda: steps(), categories=True, opacity=[0, 0.1, 0.6]
)
arguments("categories=5", categories=5)
arguments("annotations", annotations={50: "low", 200: "high"})


def shifted() -> pv.ImageData:
    """Values from -100 to 155."""
    volume = grid()
    volume["values"] -= 100
    return volume


def steps(dtype: Any = np.uint8) -> pv.ImageData:
    """Labels 0 to 5."""
    return grid(high=5.0, dtype=dtype)


def above_zero() -> pv.ImageData:
    """Values from 1 to 256."""
    volume = grid()
    volume["values"] += 1
    return volume


# -- scalars
def several() -> pv.ImageData:
    """Three arrays of points, two of cells, of which one has the name of another."""
    volume = grid()
    volume["waves"] = 100 * np.sin(volume["values"] / 30)
    volume["other"] = volume["waves"]
    volume.cell_data["cells"] = np.linspace(0, 9, volume.n_cells)
    volume.cell_data["other"] = np.linspace(9, 0, volume.n_cells)
    volume.set_active_scalars("values")
    return volume


arguments("scalars by name", volume=several, scalars="waves")
arguments("scalars of cells by name", volume=several, scalars="cells")
kind.add(
    "scalars of both, points preferred",
    lambda pl, add: (
        add(several(), scalars="other" if add.ours else "waves", scalar_bar_args={"title": "other"})
        and None
    ),
    note="add_volume shows the cells' values; the points' by another name",
)
arguments("scalars of both, cells preferred", volume=several, scalars="other", preference="cell")
arguments("scalars: an array", scalars=values().ravel() ** 2)
arguments("scalars: a list", scalars=(values().ravel() ** 2).tolist())
arguments("scalars: RGBA", scalars=lambda: rgba(), quick=True)
arguments(
    "scalars: RGBA and an opacity",
    scalars=lambda: rgba(),
    opacity="sigmoid",
    warns="opacity is ignored",
)
arguments("scalars: of no such name", scalars="w", both_refuse=True)
arguments("scalars: of a wrong length", scalars=np.zeros(7), both_refuse=True)
arguments("scalars: texts", scalars=np.full(24**3, "a"), both_refuse=True)
arguments("scalars: RGB", scalars=np.zeros((24**3, 3), np.uint8), both_refuse=True)
arguments("scalars: RGBA as floats", scalars=np.zeros((24**3, 4)), both_refuse=True)
arguments("scalars: values per cell", scalars=lambda: np.linspace(0, 1, 23**3) ** 2)


def rgba() -> np.ndarray:
    """Colours by place, opacity by value."""
    v = values()
    z, y, x = np.meshgrid(*(np.linspace(0, 255, 24),) * 3, indexing="ij")
    return np.stack([x, y, z, v * 255], axis=-1).reshape(-1, 4).astype(np.uint8)


# -- density, light
arguments("opacity_unit_distance=0.5", opacity_unit_distance=0.5)
arguments("opacity_unit_distance=0.01", opacity_unit_distance=0.01)
arguments("opacity_unit_distance=10", opacity_unit_distance=10)
arguments(
    "opacity_unit_distance=0",
    opacity_unit_distance=0,
    refused=("positive length", "no opacity is reached over no length"),
)
arguments("shade", shade=True, quick=True)
arguments("shade and ambient", shade=True, ambient=0.6)
arguments("shade and diffuse", shade=True, diffuse=1.0)
arguments("shade and specular", shade=True, specular=1.0, specular_power=40.0)
arguments("shade without light", shade=True, ambient=0.0, diffuse=0.0, specular=0.0)
arguments("light without shade", ambient=0.9, diffuse=0.2, specular=1.0, specular_power=1.0)
arguments("shade and a steep opacity", shade=True, opacity="sigmoid_20")

# -- scalar bars
arguments("show_scalar_bar=False", show_scalar_bar=False)
arguments("scalar_bar_args: title", scalar_bar_args={"title": "Density", "n_labels": 3})
arguments(
    "scalar_bar_args: vertical", scalar_bar_args={"vertical": True, "fmt": "%.0f", "color": "black"}
)
arguments(
    "scalar_bar_args: place",
    scalar_bar_args={"position_x": 0.1, "position_y": 0.8, "height": 0.15, "width": 0.8},
)
arguments(
    "scalar_bar_args: interactive",
    scalar_bar_args={
        "interactive": False,
        "outline": True,
        "fill": True,
        "background_color": "white",
    },
)
arguments(
    "scalar_bar_args and annotations", scalar_bar_args={"n_labels": 0}, annotations={128: "half"}
)
arguments(
    "scalar_bar_args although show_scalar_bar=False",
    show_scalar_bar=False,
    scalar_bar_args={"title": "x"},
)

# -- place and the scene
TURNED = pv.Transform().rotate_z(30).scale(1.0, 1.2, 0.8).translate(0.5, 0.1, 0.2).matrix
arguments("user_matrix", user_matrix=TURNED, quick=True)
arguments("user_matrix: a Transform", user_matrix=pv.Transform().rotate_x(40))
arguments("user_matrix: a vtkMatrix4x4", user_matrix=lambda: pv.vtkmatrix_from_array(TURNED))
arguments("user_matrix: 3 x 3", user_matrix=pv.Transform().rotate_y(20).matrix[:3, :3])
arguments("user_matrix: a mirror", user_matrix=np.diag([-1.0, 1, 1, 1]))
arguments("user_matrix: a list", user_matrix=TURNED.tolist())
arguments("name", name="ball")
arguments("pickable=False", pickable=False)
arguments("reset_camera=False", reset_camera=False)
arguments("reset_camera=True", reset_camera=True)
arguments("render=False", render=False)
arguments("render=None", render=None)
for each in (True, "front", "back", "f"):
    arguments(f"culling={each!r}", culling=each)
arguments("backface_culling", backface_culling=True)
arguments("culling of no such side", culling="side", both_refuse=True)
arguments(
    "preference of no such kind",
    preference="edge",
    volume=several,
    scalars="other",
    both_refuse=True,
)
arguments("an unknown argument", opacities=0.1, both_refuse=True)
arguments("scalar", scalar="values", both_refuse=True)

# -- arrays
arguments("a NumPy array", volume=lambda: values() * 255)
arguments(
    "a NumPy array and resolution", volume=lambda: values() * 255, resolution=(1, 2, 3), quick=True
)
arguments(
    "a NumPy array and a list as resolution",
    volume=lambda: values((20, 16, 12)),
    resolution=[0.5, 0.5, 1],
)
arguments(
    "a NumPy array and a wrong resolution",
    volume=lambda: values(),
    resolution=(1, 2),
    both_refuse=True,
)
arguments(
    "a NumPy array in Fortran's order", volume=lambda: np.asfortranarray(values((20, 16, 12)))
)
arguments("a part of a NumPy array", volume=lambda: values(28)[2:26:2, ::-1, 3:])
arguments("resolution of a grid", resolution=(2, 2, 2))
arguments("a flat NumPy array", volume=lambda: np.zeros((3, 3)), both_refuse=True)
arguments("a list", volume=lambda: [[[1.0]]], both_refuse=True)

# -- blending and mappers
SUMS = "a VDI holds colours and optical depths, not the largest (or the sum, mean) of the values"
for each in ("maximum", "minimum", "additive", "average", "maximum_intensity"):
    if each != "maximum_intensity":
        arguments(f"blending={each!r}", blending=each, refused=("blending", SUMS))
arguments("blending='composite'", blending="composite")
arguments("blending of no such name", blending="over", both_refuse=True)
for each in ("gpu", "smart", "open_gl"):
    arguments(f"mapper={each!r}", mapper=each, warns="mapper")
kind.add(
    "mapper='fixed_point'",
    lambda pl, add: add(grid(), mapper="fixed_point" if add.ours else None) and None,
    warns="mapper",
    note="coarse integers, 17 of 255 in 8 x 8 pixels; VTK's default mapper",
)
arguments(
    "mapper='ugrid'",
    mapper="ugrid",
    refused=(
        "mapper",
        "it draws unstructured grids alone; add_volume shows nothing, with VTK's errors",
    ),
)
arguments("mapper of no such name", mapper="fast", both_refuse=True)

test_arguments = kind.test()
