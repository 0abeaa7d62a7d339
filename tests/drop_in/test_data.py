"""Every kind of data: types, grids, spacings, missing values."""

import numpy as np
import pyvista as pv
from drop_in.stage import Kind, expectations
from drop_in.volumes import grid, values

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


PARTS = "which part to show is for the user to say; add_volume draws the real part as opaque black"
case("complex", lambda: grid(dtype=complex), refused=("2 components", PARTS))
case("uint16 up to 65535", lambda: grid(high=65535, dtype=np.uint16))
case("float32 of huge values", lambda: grid(high=1e20))
HOUNSFIELD = from_on(-1000, np.int16, high=3000)
case("int16 Hounsfield units", HOUNSFIELD, clim=(-200, 1500), cmap="bone")


nan_outside = in_place(lambda v: v < 1, np.nan)
nan_inside = with_values(in_place(lambda v: v > 200, np.nan))
infinity = with_values(in_place(lambda v: v > 240, np.inf))
five = with_values(lambda v: v.fill(5.0))
case("NaN outside", with_values(nan_outside), quick=True)
case("NaN inside", nan_inside)
case("NaN outside and clim", with_values(nan_outside), clim=(0, 255))
NOTHING = "there is nothing to show; add_volume draws nothing, or noise"
only_nan = with_values(lambda v: v.fill(np.nan))
case("only NaN", only_nan, refused=("every value is NaN", NOTHING))
case("infinity and clim", infinity, clim=(0, 255))
ENDLESS = "no colour map reaches to infinity; with clim= it works"
case("infinity", infinity, refused=("finite range", ENDLESS))
case("one value everywhere", five)

SKEW = pv.Transform().rotate_z(25).rotate_x(40).matrix[:3, :3]
SWAP = [[0, 1, 0], [0, 0, 1], [1, 0, 0]]
case("anisotropic spacing", lambda: grid((24, 20, 8), spacing=(0.08, 0.1, 0.3)), quick=True)
case("origin far away", lambda: grid(origin=(1000.0, -2000.0, 500.0)))


case("direction matrix", lambda: grid(direction_matrix=SKEW), quick=True)


@kind.case(note="add_volume shows nothing; the array mirrored instead")
def direction_matrix_that_mirrors(pl, add):
    if add.ours:
        add(grid(direction_matrix=np.diag([1.0, -1, 1]), origin=(-1, 1, -1)))
    else:
        add(with_values(lambda v: v.reshape(24, 24, 24)[:, ::-1].ravel())())


def of_cells():
    """Values per cell alone."""
    volume = pv.ImageData(dimensions=(21, 21, 21), spacing=(0.1,) * 3)
    volume.cell_data["c"] = values(20).ravel()
    return volume


def components(n):
    volume = grid()
    v = volume["values"].astype(np.uint8)
    volume["colours"] = np.stack([v, 255 - v, v // 2, v][:n], axis=1)
    volume.set_active_scalars("colours")
    return volume


def rectilinear():
    edges = np.linspace(-1, 1, 16) ** 3
    made = pv.RectilinearGrid(edges, edges, edges)
    made["values"] = values(16).ravel()
    return made


def two_blocks():
    return pv.MultiBlock([grid(), grid(12, origin=(1.5, 1, 1))])


case("direction matrix that swaps axes", lambda: grid((24, 16, 10), direction_matrix=SWAP))
case("two planes", lambda: grid(24).extract_subset((0, 23, 0, 23, 11, 12)), opacity=0.4)
PLANE = "a plane has no depth; add_volume shows nothing of it"
case("one plane", lambda: grid((24, 24, 1)), refused=("only one plane", PLANE))
case("cell data", of_cells, quick=True)
case("two components", lambda: components(2), both_refuse=True)
case("RGBA of a grid", lambda: components(4))
case("no scalars", lambda: pv.ImageData(dimensions=(4, 4, 4)), both_refuse=True)


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
case("tetrahedra", lambda: grid(6).to_tetrahedra(), refused=REFUSED)
case("PolyData", pv.Sphere, both_refuse=True)
case("a MultiBlock", two_blocks)
case("a MultiBlock with multi_colors", two_blocks, multi_colors=True)
case("None", lambda: None, both_refuse=True)

test_data = kind.test()
