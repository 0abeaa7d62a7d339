"""Every kind of data: types, grids, spacings, missing values."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv
from drop_in.stage import Kind
from drop_in.volumes import grid, values

kind = Kind("Kinds of data")


def data(
    name: str,
    make: Any,
    *,
    quick: bool = False,
    refused: Any = None,
    both_refuse: bool = False,
    note: str = "",
    defect: str = "",
    warns: Any = None,
    **keywords: Any,
) -> None:
    """Add a case of a volume."""
    kind.add(
        name,
        lambda pl, add: add(make(), **keywords) and None,
        quick=quick,
        refused=refused,
        both_refuse=both_refuse,
        note=note,
        defect=defect,
        warns=warns,
    )


# -- types
for each in (
    "uint8",
    "uint16",
    "uint32",
    "uint64",
    "int8",
    "int16",
    "int32",
    "int64",
    "float32",
    "float64",
):
    data(each, lambda each=each: grid(high=120, dtype=each), quick=each in ("uint8", "int16"))
data("float16 in NumPy", lambda: values().astype(np.float16), both_refuse=True)
data("labels 0 and 1", lambda: grid(high=1.8, dtype=int), opacity=[0, 0.2])
kind.add(
    "bool",
    lambda pl, add: add(boolean(bool if add.ours else np.uint8), opacity=[0, 0.2]) and None,
    note="add_volume refuses bool; the same in uint8",
)
data("big-endian float32", lambda: grid(dtype=">f4"))
data(
    "complex",
    lambda: grid(dtype=complex),
    refused=(
        "2 components",
        "which part to show is for the user to say; add_volume draws the real part as opaque black",
    ),
)
data("uint16 up to 65535", lambda: grid(high=65535, dtype=np.uint16))
data("uint16 of a narrow range at 60000", lambda: plus(60000, np.uint16))
data("int32 of a narrow range at 2^30", lambda: plus(2**30, np.int32))
data("float64 of a narrow range at 1e9", lambda: plus(1e9, np.float64))
data("float32 of tiny values", lambda: grid(high=1e-20))
data("float32 of huge values", lambda: grid(high=1e20))
data("negative values", lambda: plus(-128, np.float32))
data(
    "int16 Hounsfield units",
    lambda: plus(-1000, np.int16, high=3000),
    clim=(-200, 1500),
    cmap="bone",
)


def boolean(dtype: Any) -> pv.ImageData:
    """Whether values are above 100."""
    volume = grid()
    volume["values"] = (volume["values"] > 100).astype(dtype)
    return volume


def plus(offset: float, dtype: Any, high: float = 255.0) -> pv.ImageData:
    """Values from an offset on."""
    volume = grid(dtype=np.float64)
    volume["values"] = (np.floor(volume["values"] / 255 * high) + offset).astype(dtype)
    return volume


# -- values
def nan_table() -> pv.LookupTable:
    table = pv.LookupTable(cmap="bone", nan_color="red", scalar_range=(0, 255))
    table.apply_opacity("linear")
    return table


def with_values(change: Any, dtype: Any = np.float32) -> pv.ImageData:
    """A changed array."""
    volume = grid(dtype=dtype)
    v = volume["values"].copy()
    change(v)
    volume["values"] = v
    return volume


def some_nan(v: np.ndarray) -> None:
    v[v < 1] = np.nan


def core_nan(v: np.ndarray) -> None:
    v[v > 200] = np.nan


def with_inf(v: np.ndarray) -> None:
    v[v > 240] = np.inf


def without_last(value: Any) -> None:
    value[:] = 5.0


data("NaN outside", lambda: with_values(some_nan), quick=True)
data("NaN inside", lambda: with_values(core_nan))
data("NaN outside and clim", lambda: with_values(some_nan), clim=(0, 255))
data("NaN and clim from above 0", lambda: with_values(core_nan), clim=(100, 255))
data("NaN and a table with a colour for it", lambda: with_values(core_nan), cmap=nan_table())
data("NaN in float64", lambda: with_values(some_nan, np.float64))
data(
    "only NaN",
    lambda: with_values(lambda v: v.fill(np.nan)),
    refused=("every value is NaN", "there is nothing to show; add_volume draws nothing, or noise"),
)
data("infinity and clim", lambda: with_values(with_inf), clim=(0, 255))
data(
    "infinity",
    lambda: with_values(with_inf),
    refused=("finite range", "no colour map reaches to infinity; with clim= it works"),
)
data("one value everywhere", lambda: with_values(without_last))
data("one value everywhere and clim", lambda: with_values(without_last), clim=(0, 10))
data("zeros", lambda: with_values(lambda v: v.fill(0)), clim=(0, 10), opacity=0.3)
data("noise", lambda: noise(), opacity=[0, 0, 0.1])


def noise() -> pv.ImageData:
    """Random values."""
    volume = grid(12)
    volume["values"] = np.random.default_rng(3).random(volume.n_points, dtype=np.float32)
    return volume


# -- grids
SKEW = pv.Transform().rotate_z(25).rotate_x(40).matrix[:3, :3]
data("anisotropic spacing", lambda: grid((24, 20, 8), spacing=(0.08, 0.1, 0.3)), quick=True)
data("origin far away", lambda: grid(origin=(1000.0, -2000.0, 500.0)))
kind.add(
    "origin at 1e6",
    lambda pl, add: add(grid(**({"origin": (1e6, -2e6, 5e5)} if add.ours else {}))) and None,
    note="add_volume shows splinters; the same at the origin",
)
data("negative origin", lambda: grid(origin=(-5.0, -4, -3)))
data("tiny spacing", lambda: grid(spacing=(1e-6,) * 3))
data("huge spacing", lambda: grid(spacing=(1e5,) * 3))
data("direction matrix", lambda: grid(direction_matrix=SKEW), quick=True)
kind.add(
    "direction matrix that mirrors",
    lambda pl, add: add(mirrored(add.ours)) and None,
    note="add_volume shows nothing; the array mirrored instead",
)
data(
    "direction matrix that swaps axes",
    lambda: grid((24, 16, 10), direction_matrix=[[0, 1, 0], [0, 0, 1], [1, 0, 0]]),
)
data("offset of the extent", lambda: with_offset())
data("even and odd dimensions", lambda: grid((31, 16, 7)))
data("two planes", lambda: thin(grid(24)), opacity=0.4)
data(
    "one plane",
    lambda: grid((24, 24, 1)),
    refused=("only one plane", "a plane has no depth; add_volume shows nothing of it"),
)
data("an image of PyVista's reader", lambda: read_back())
data("an extracted part", lambda: grid(28).extract_subset((4, 24, 2, 27, 5, 20)))
data("a coarser part", lambda: grid(28).extract_subset((0, 27, 0, 27, 0, 27), (2, 1, 1)))
data("a copy", lambda: grid().copy())
data("gaussian_smooth", lambda: grid().gaussian_smooth(std_dev=1.0))
data("threshold as a mask", lambda: masked())
data("cell_data_to_point_data", lambda: of_cells().cell_data_to_point_data())
data("cell data", lambda: of_cells(), quick=True)
data("points_to_cells", lambda: grid().points_to_cells())
data(
    "resampled",
    lambda: grid(12).resample(2.0, interpolation="cubic"),
)
data(
    "interpolated from points",
    lambda: grid(14).interpolate(pv.Sphere(radius=0.8).elevation(), radius=0.7),
)
data("sampled from a mesh", lambda: grid(16).sample(grid(12, name="x")), scalars="x")
data(
    "implicit distance",
    lambda: grid(16).compute_implicit_distance(pv.Sphere(radius=0.6)),
    scalars="implicit_distance",
    opacity=[0.4, 0.1, 0, 0],
)
data(
    "perlin noise",
    lambda: pv.sample_function(pv.perlin_noise(1, (2, 3, 2), (0, 0, 0)), dim=(16, 16, 16)),
)
data(
    "voxelized mesh",
    lambda: pv.Cone(resolution=12).voxelize_binary_mask(dimensions=(16, 16, 16)),
    opacity=[0, 0.2],
)
data("the magnitude of a vector", lambda: vectors(), scalars="size")
data("a vector", lambda: vectors(), scalars="v", both_refuse=True)
data("two components", lambda: components(2), both_refuse=True)
data("RGBA of a grid", lambda: components(4))
data("no scalars", lambda: pv.ImageData(dimensions=(4, 4, 4)), both_refuse=True)
data("an empty grid", lambda: pv.ImageData(), both_refuse=True)
data("texts", lambda: texts(), both_refuse=True)
data("field data beside it", lambda: with_field())
data("the array's name is empty", lambda: grid(name=" "))
kind.add(
    "a vtkImageData",
    lambda pl, add: add(bare_vtk() if add.ours else grid()) and None,
    note="add_volume takes PyVista's class alone; the same, wrapped",
)
UNIFORM = "a VDI is generated from a uniform grid; the message names the filter that resamples"
data(
    "RectilinearGrid",
    lambda: rectilinear(),
    refused=(
        "not a uniform grid",
        UNIFORM + ". VTK's picture is no measure of the resampling: of equidistant points, too, it "
        "differs from VTK's of the same values in an ImageData (SSIM .97)",
    ),
)
kind.add(
    "a RectilinearGrid of equidistant points",
    lambda pl, add: add(grid().cast_to_rectilinear_grid() if add.ours else grid()) and None,
    note="add_volume draws it larger and shifted; the same values in an ImageData",
)
data(
    "StructuredGrid", lambda: grid(8).cast_to_structured_grid(), refused=("not a uniform", UNIFORM)
)
data(
    "UnstructuredGrid",
    lambda: grid(8).cast_to_unstructured_grid(),
    refused=("not a uniform", UNIFORM),
)
data("tetrahedra", lambda: grid(6).to_tetrahedra(), refused=("not a uniform", UNIFORM))
data("PolyData", pv.Sphere, both_refuse=True)
data("a MultiBlock", lambda: pv.MultiBlock([grid(), grid(12, origin=(1.5, 1, 1))]))
data(
    "a MultiBlock with multi_colors",
    lambda: pv.MultiBlock([grid(), grid(12, origin=(1.5, 1, 1))]),
    multi_colors=True,
)
data("a MultiBlock with a hole", lambda: pv.MultiBlock([grid(), None]))
data("None", lambda: None, both_refuse=True)
data("a path", lambda: "brain.nrrd", both_refuse=True)


def mirrored(by_matrix: bool) -> pv.ImageData:
    if by_matrix:
        return grid(direction_matrix=np.diag([1.0, -1, 1]), origin=(-1, 1, -1))
    volume = grid()
    volume["values"] = volume["values"].reshape(24, 24, 24)[:, ::-1].ravel()
    return volume


def thin(volume: pv.ImageData) -> pv.ImageData:
    return volume.extract_subset((0, 23, 0, 23, 11, 12))


def with_offset() -> pv.ImageData:
    """An extent that does not begin at 0."""
    volume = pv.ImageData()
    volume.SetExtent(5, 20, -3, 12, 7, 22)
    volume.spacing = (0.1, 0.1, 0.1)
    volume["values"] = values(16).ravel()
    return volume


def read_back() -> pv.ImageData:
    """Written to and read from a file."""
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.vti"
        grid().save(path)
        return pv.read(path)


def masked() -> pv.ImageData:
    """Values above a threshold, others 0."""
    volume = grid()
    return volume.image_threshold((100.0, 255.0), in_value=None, out_value=0)


def of_cells() -> pv.ImageData:
    """Values per cell alone."""
    volume = pv.ImageData(dimensions=(21, 21, 21), spacing=(0.1,) * 3)
    volume.cell_data["c"] = values(20).ravel()
    return volume


def vectors() -> pv.ImageData:
    volume = grid()
    volume["v"] = np.random.default_rng(1).random((volume.n_points, 3))
    volume["size"] = np.linalg.norm(volume["v"], axis=1) * values().ravel()
    return volume


def components(n: int) -> pv.ImageData:
    volume = grid()
    v = volume["values"].astype(np.uint8)
    volume["colours"] = np.stack([v, 255 - v, v // 2, v][:n], axis=1)
    volume.set_active_scalars("colours")
    return volume


def texts() -> pv.ImageData:
    volume = grid(4)
    volume["t"] = np.full(64, "a")
    volume.set_active_scalars("t")
    return volume


def with_field() -> pv.ImageData:
    volume = grid()
    volume.field_data["time"] = [1.0, 2.0]
    volume.user_dict["who"] = "me"
    return volume


def bare_vtk() -> Any:
    from vtkmodules.vtkCommonDataModel import vtkImageData

    image = vtkImageData()
    image.ShallowCopy(grid())
    return image


def rectilinear() -> pv.RectilinearGrid:
    edges = np.linspace(-1, 1, 16) ** 3
    made = pv.RectilinearGrid(edges, edges, edges)
    made["values"] = values(16).ravel()
    return made


test_data = kind.test()
