"""Every kind of data: types, grids, spacings, missing values."""

import tempfile
from pathlib import Path

import numpy as np
import pyvista as pv
from drop_in.stage import Kind, expectations
from drop_in.volumes import grid, values

from pyvista_vdi.vtk_pipeline.vtk import vtkImageData

kind = Kind("Kinds of data")


def case(name, make, **keywords):
    """Add a case of a volume."""
    how = expectations(keywords)

    def scene(pl, add):
        add(make(), **keywords)

    kind.add(name, scene, **how)


def with_values(change, dtype=np.float32, **shape):
    """A function that makes a grid of other values, or of those that it changes in place."""

    def make():
        volume = grid(dtype=dtype, **shape)
        v = volume["values"].copy()
        changed = change(v)
        volume["values"] = v if changed is None else changed
        return volume

    return make


def from_on(offset, dtype, high=255.0):
    """A function that makes a grid of values from an offset on."""

    def moved(v):
        return (np.floor(v / 255 * high) + offset).astype(dtype)

    return with_values(moved, np.float64)


def in_place(chosen, value):
    """A change of the values that are chosen."""

    def change(v):
        v[chosen(v)] = value

    return change


TYPES = (
    *("uint8", "uint16", "uint32", "uint64", "int8", "int16", "int32", "int64"),
    *("float32", "float64"),
)
for each in TYPES:
    case(each, lambda each=each: grid(high=120, dtype=each), quick=each in ("uint8", "int16"))
case("float16 in NumPy", lambda: values().astype(np.float16), both_refuse=True)
case("labels 0 and 1", lambda: grid(high=1.8, dtype=int), opacity=[0, 0.2])


@kind.case(name="bool", note="add_volume refuses bool; the same in uint8")
def _(pl, add):
    dtype = bool if add.ours else np.uint8
    add(with_values(lambda v: (v > 100).astype(dtype))(), opacity=[0, 0.2])


case("big-endian float32", lambda: grid(dtype=">f4"))
PARTS = "which part to show is for the user to say; add_volume draws the real part as opaque black"
case("complex", lambda: grid(dtype=complex), refused=("2 components", PARTS))
case("uint16 up to 65535", lambda: grid(high=65535, dtype=np.uint16))
case("uint16 of a narrow range at 60000", from_on(60000, np.uint16))
case("int32 of a narrow range at 2^30", from_on(2**30, np.int32))
case("float64 of a narrow range at 1e9", from_on(1e9, np.float64))
case("float32 of tiny values", lambda: grid(high=1e-20))
case("float32 of huge values", lambda: grid(high=1e20))
case("negative values", from_on(-128, np.float32))
HOUNSFIELD = from_on(-1000, np.int16, high=3000)
case("int16 Hounsfield units", HOUNSFIELD, clim=(-200, 1500), cmap="bone")


def nan_table():
    table = pv.LookupTable(cmap="bone", nan_color="red", scalar_range=(0, 255))
    table.apply_opacity("linear")
    return table


nan_outside = in_place(lambda v: v < 1, np.nan)
nan_inside = with_values(in_place(lambda v: v > 200, np.nan))
infinity = with_values(in_place(lambda v: v > 240, np.inf))
five = with_values(lambda v: v.fill(5.0))
case("NaN outside", with_values(nan_outside), quick=True)
case("NaN inside", nan_inside)
case("NaN outside and clim", with_values(nan_outside), clim=(0, 255))
case("NaN and clim from above 0", nan_inside, clim=(100, 255))
case("NaN and a table with a colour for it", nan_inside, cmap=nan_table())
case("NaN in float64", with_values(nan_outside, np.float64))
NOTHING = "there is nothing to show; add_volume draws nothing, or noise"
only_nan = with_values(lambda v: v.fill(np.nan))
case("only NaN", only_nan, refused=("every value is NaN", NOTHING))
case("infinity and clim", infinity, clim=(0, 255))
ENDLESS = "no colour map reaches to infinity; with clim= it works"
case("infinity", infinity, refused=("finite range", ENDLESS))
case("one value everywhere", five)
case("one value everywhere and clim", five, clim=(0, 10))
case("zeros", with_values(lambda v: v.fill(0)), clim=(0, 10), opacity=0.3)
noise = with_values(lambda v: np.random.default_rng(3).random(len(v), dtype=np.float32), n=12)
case("noise", noise, opacity=[0, 0, 0.1])

SKEW = pv.Transform().rotate_z(25).rotate_x(40).matrix[:3, :3]
SWAP = [[0, 1, 0], [0, 0, 1], [1, 0, 0]]
case("anisotropic spacing", lambda: grid((24, 20, 8), spacing=(0.08, 0.1, 0.3)), quick=True)
case("origin far away", lambda: grid(origin=(1000.0, -2000.0, 500.0)))


@kind.case(name="origin at 1e6", note="add_volume shows splinters; the same at the origin")
def _(pl, add):
    add(grid(**({"origin": (1e6, -2e6, 5e5)} if add.ours else {})))


case("negative origin", lambda: grid(origin=(-5.0, -4, -3)))
case("tiny spacing", lambda: grid(spacing=(1e-6,) * 3))
case("huge spacing", lambda: grid(spacing=(1e5,) * 3))
case("direction matrix", lambda: grid(direction_matrix=SKEW), quick=True)


@kind.case(note="add_volume shows nothing; the array mirrored instead")
def direction_matrix_that_mirrors(pl, add):
    if add.ours:
        add(grid(direction_matrix=np.diag([1.0, -1, 1]), origin=(-1, 1, -1)))
    else:
        add(with_values(lambda v: v.reshape(24, 24, 24)[:, ::-1].ravel())())


def with_offset():
    """An extent that does not begin at 0."""
    volume = pv.ImageData()
    volume.SetExtent(5, 20, -3, 12, 7, 22)
    volume.spacing = (0.1, 0.1, 0.1)
    volume["values"] = values(16).ravel()
    return volume


def read_back():
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.vti"
        grid().save(path)
        return pv.read(path)


def of_cells():
    """Values per cell alone."""
    volume = pv.ImageData(dimensions=(21, 21, 21), spacing=(0.1,) * 3)
    volume.cell_data["c"] = values(20).ravel()
    return volume


def vectors():
    volume = grid()
    volume["v"] = np.random.default_rng(1).random((volume.n_points, 3))
    volume["size"] = np.linalg.norm(volume["v"], axis=1) * values().ravel()
    return volume


def components(n):
    volume = grid()
    v = volume["values"].astype(np.uint8)
    volume["colours"] = np.stack([v, 255 - v, v // 2, v][:n], axis=1)
    volume.set_active_scalars("colours")
    return volume


def texts():
    volume = grid(4)
    volume["t"] = np.full(64, "a")
    volume.set_active_scalars("t")
    return volume


def with_field():
    volume = grid()
    volume.field_data["time"] = [1.0, 2.0]
    volume.user_dict["who"] = "me"
    return volume


def bare_vtk():
    image = vtkImageData()
    image.ShallowCopy(grid())
    return image


def rectilinear():
    edges = np.linspace(-1, 1, 16) ** 3
    made = pv.RectilinearGrid(edges, edges, edges)
    made["values"] = values(16).ravel()
    return made


def two_blocks():
    return pv.MultiBlock([grid(), grid(12, origin=(1.5, 1, 1))])


def distances():
    return grid(16).compute_implicit_distance(pv.Sphere(radius=0.6))


def perlin():
    return pv.sample_function(pv.perlin_noise(1, (2, 3, 2), (0, 0, 0)), dim=(16, 16, 16))


def cone():
    return pv.Cone(resolution=12).voxelize_binary_mask(dimensions=(16, 16, 16))


def mask():
    return grid().image_threshold((100.0, 255.0), in_value=None, out_value=0)


def from_points():
    return grid(14).interpolate(pv.Sphere(radius=0.8).elevation(), radius=0.7)


case("direction matrix that swaps axes", lambda: grid((24, 16, 10), direction_matrix=SWAP))
case("offset of the extent", with_offset)
case("even and odd dimensions", lambda: grid((31, 16, 7)))
case("two planes", lambda: grid(24).extract_subset((0, 23, 0, 23, 11, 12)), opacity=0.4)
PLANE = "a plane has no depth; add_volume shows nothing of it"
case("one plane", lambda: grid((24, 24, 1)), refused=("only one plane", PLANE))
case("an image of PyVista's reader", read_back)
case("an extracted part", lambda: grid(28).extract_subset((4, 24, 2, 27, 5, 20)))
case("a coarser part", lambda: grid(28).extract_subset((0, 27, 0, 27, 0, 27), (2, 1, 1)))
case("a copy", lambda: grid().copy())
case("gaussian_smooth", lambda: grid().gaussian_smooth(std_dev=1.0))
case("threshold as a mask", mask)
case("cell_data_to_point_data", lambda: of_cells().cell_data_to_point_data())
case("cell data", of_cells, quick=True)
case("points_to_cells", lambda: grid().points_to_cells())
case("resampled", lambda: grid(12).resample(2.0, interpolation="cubic"))
case("interpolated from points", from_points)
case("sampled from a mesh", lambda: grid(16).sample(grid(12, name="x")), scalars="x")
case("implicit distance", distances, scalars="implicit_distance", opacity=[0.4, 0.1, 0, 0])
case("perlin noise", perlin)
case("voxelized mesh", cone, opacity=[0, 0.2])
case("the magnitude of a vector", vectors, scalars="size")
case("a vector", vectors, scalars="v", both_refuse=True)
case("two components", lambda: components(2), both_refuse=True)
case("RGBA of a grid", lambda: components(4))
case("no scalars", lambda: pv.ImageData(dimensions=(4, 4, 4)), both_refuse=True)
case("an empty grid", lambda: pv.ImageData(), both_refuse=True)
case("texts", texts, both_refuse=True)
case("field data beside it", with_field)
case("the array's name is empty", lambda: grid(name=" "))


@kind.case(name="a vtkImageData", note="add_volume takes PyVista's class alone; the same, wrapped")
def _(pl, add):
    add(bare_vtk() if add.ours else grid())


UNIFORM = "a VDI is generated from a uniform grid; the message names the filter that resamples"
NO_MEASURE = (
    ". VTK's picture is no measure of the resampling: of equidistant points, too, it "
    "differs from VTK's of the same values in an ImageData (SSIM .97)"
)
case("RectilinearGrid", rectilinear, refused=("not a uniform grid", UNIFORM + NO_MEASURE))


@kind.case(
    name="a RectilinearGrid of equidistant points",
    note="add_volume draws it larger and shifted; the same values in an ImageData",
)
def _(pl, add):
    add(grid().cast_to_rectilinear_grid() if add.ours else grid())


REFUSED = ("not a uniform", UNIFORM)
case("StructuredGrid", lambda: grid(8).cast_to_structured_grid(), refused=REFUSED)
case("UnstructuredGrid", lambda: grid(8).cast_to_unstructured_grid(), refused=REFUSED)
case("tetrahedra", lambda: grid(6).to_tetrahedra(), refused=REFUSED)
case("PolyData", pv.Sphere, both_refuse=True)
case("a MultiBlock", two_blocks)
case("a MultiBlock with multi_colors", two_blocks, multi_colors=True)
case("a MultiBlock with a hole", lambda: pv.MultiBlock([grid(), None]))
case("None", lambda: None, both_refuse=True)
case("a path", lambda: "brain.nrrd", both_refuse=True)

test_data = kind.test()
