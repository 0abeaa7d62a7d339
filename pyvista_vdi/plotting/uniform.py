"""A volume resampled to a uniform grid, or masked: made anew whenever it or its mask changes."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from pyvista_vdi.errors import (
    InvalidArgumentError,
    InvalidVolumeError,
    UnsupportedError,
    VDIError,
    warn_external,
)
from pyvista_vdi.model.host_memory import require_host_memory
from pyvista_vdi.vtk_pipeline.filters.algorithm import Algorithm, ask_for_all, watch
from pyvista_vdi.vtk_pipeline.filters.convert import (
    BLANKED,
    as_numpy,
    first_point,
    is_of_cells,
    scalars_of,
    to_vtk,
)
from pyvista_vdi.vtk_pipeline.vtk import (
    vtkAlgorithm,
    vtkDataObject,
    vtkDataSetAttributes,
    vtkStreamingDemandDrivenPipeline,
)

#: Points that ``resample="auto"`` takes, at most.
_MOST_POINTS = 2**27
#: Cells whose boxes are looked at for the shape of the mean cell.
_CELLS_SEEN = 1000
#: How far a mask's points may lie from the volume's, in voxels.
_ASIDE = 0.01
#: Arrays that mark points, and are not resampled as values are.
_MARKS = (vtkDataSetAttributes.GhostArrayName(), BLANKED, "vtkValidPointMask")


class UniformGrid(Algorithm):
    """A pipeline's step from a grid, and perhaps a mask, to the uniform grid that is drawn of them.

    It executes again when values, points or the mask have changed. A mask that is a NumPy array
    tells nobody of its changes, and is compared with what it was at each update; a data set is
    followed, whichever array is its active one. Which arrays the grid has is decided now, as by
    ``add_volume``. ``categorical``: resample by the nearest value.

    ``image`` is the output, a ``pyvista.ImageData``, of which the array ``name`` is drawn;
    ``values`` are the grid's own, of which ``add_volume`` takes the range, and ``unit_distance`` is
    the opacity unit distance that it takes by default, model units.
    """

    bad_input = InvalidVolumeError

    def __init__(
        self,
        grid: Any,
        name: str | None,
        preference: str,
        *,
        resample: str | Sequence[int] | None = None,
        mask: Any = None,
        categorical: bool = False,
    ) -> None:
        super().__init__(
            nInputPorts=2, inputType="vtkDataSet", nOutputPorts=1, outputType="vtkImageData"
        )
        self.image = pv.ImageData()
        held = pv.wrap(grid).copy(deep=False)
        chosen = scalars_of(held, name, preference)
        self.name, self.values = chosen.GetName(), as_numpy(chosen)
        self._resample = resample
        self._categorical = categorical and not is_of_cells(held, chosen)
        of_points = held.GetPointData().GetArray(self.name)
        if resample is not None and of_points is not None and of_points is not chosen:
            held.GetPointData().RemoveArray(self.name)  # a point has one value of that name
        elif resample is not None and of_points is not None:
            held.GetPointData().SetActiveScalars(self.name)  # by which categories are sampled
        evenly = isinstance(held, pv.ImageData | pv.RectilinearGrid)
        # VTK's default of a property, which add_volume leaves where a grid has no dimensions
        self.unit_distance = held.length / (np.mean(held.dimensions) - 1) if evenly else 1.0
        self.SetInputDataObject(0, held)
        watch(grid, self, type(self).Modified)  # values may have been written behind VTK's back
        self._array = mask if isinstance(mask, np.ndarray) else None
        if self._array is not None:
            self._copy = mask.copy(order="K")
            self._labels = (mask != 0).ravel(order="F").astype(np.uint8)
            mask = _like(held, to_vtk("mask", self._labels), mask)
        if mask is not None:
            self.SetInputDataObject(1, mask)
        self.Update()

    def FillInputPortInformation(self, port: int, information: Any) -> int:  # noqa: N802
        """Need a grid; a mask may be missing."""
        information.Set(vtkAlgorithm.INPUT_IS_OPTIONAL(), port)
        return int(super().FillInputPortInformation(port, information))

    def Update(self, *args: Any) -> None:  # noqa: N802
        """Bring the output up to date, and raise what went wrong."""
        if self._array is not None:
            nan = self._array.dtype.kind == "f"
            if not np.array_equal(self._array, self._copy, equal_nan=nan):
                self._copy = self._array.copy(order="K")
                self._labels[:] = (self._copy != 0).ravel(order="F")
                self.Modified()
        super().Update(*args)

    def RequestDataObject(self, request: Any, inputs: Any, outputs: Any) -> int:  # noqa: N802
        """Set PyVista's grid, in which others may choose another array."""
        outputs.GetInformationObject(0).Set(vtkDataObject.DATA_OBJECT(), self.image)
        return 1

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:  # noqa: N802
        """Announce the extent of what was made last."""
        extent = self.image.GetExtent() if self.image.n_points else (0, 0) * 3
        key = vtkStreamingDemandDrivenPipeline.WHOLE_EXTENT()
        outputs.GetInformationObject(0).Set(key, extent, 6)
        return 1

    def RequestUpdateExtent(self, request: Any, inputs: Any, outputs: Any) -> int:  # noqa: N802
        """Ask for the whole grid, and the whole mask."""
        self._last = self.image.copy(deep=False)  # VTK clears the output before it is made anew
        for port in inputs:
            if port.GetNumberOfInformationObjects():
                ask_for_all([port])
        return 1

    def _execute(self, inputs: Any, outputs: Any) -> None:
        last = self._last
        try:
            made = self._made(inputs)
        except VDIError as error:
            if not last.n_points:
                raise
            warn_external(f"what changed cannot be drawn, and the picture stays: {error}")
            made = last
        chosen = last.GetPointData().GetScalars()  # by somebody, perhaps
        self.image.ShallowCopy(made)
        if chosen is not None:
            self.image.GetPointData().SetActiveScalars(chosen.GetName())
        self.RequestInformation(None, inputs, outputs)
        ask_for_all([outputs])

    def _made(self, inputs: Any) -> pv.ImageData:
        """Return the uniform grid of what is at the inputs."""
        grid, kept = pv.wrap(vtkDataObject.GetData(inputs[0], 0)), None
        if inputs[1].GetNumberOfInformationObjects():
            kept = _kept(pv.wrap(vtkDataObject.GetData(inputs[1], 0)), grid)
        numbers = _numbers(grid, self._resample)
        if numbers is not None:
            image = _resampled(grid, numbers, kept, self._categorical)
            image.set_active_scalars(self.name, "point")
            return image
        image = grid.copy(deep=False)
        if kept is not None:
            blank = _blank_of_mask(grid, kept)
            blank |= grid.point_data.get(BLANKED, np.uint8(0))
            image.GetPointData().AddArray(to_vtk(BLANKED, blank))
        return image


def _like(grid: Any, array: Any, given: NDArray[Any]) -> Any:
    """Return a grid of the same points and cells with one array, of a mask that was given."""
    copy = type(grid)()
    copy.CopyStructure(grid)
    points = getattr(grid, "dimensions", None)
    cells = None if points is None else tuple(n - 1 for n in points)
    if given.shape in ((grid.n_points,), points):
        copy.GetPointData().SetScalars(array)
    elif given.shape in ((grid.n_cells,), cells):
        copy.GetCellData().SetScalars(array)
    else:
        along = "" if points is None else f" ({points} along x, y and z)"
        raise InvalidArgumentError(
            f"mask must have a label for each of the volume's {grid.n_points} points{along}, or "
            f"for each of its {grid.n_cells} cells; got an array of shape {given.shape}"
        )
    if given.dtype.kind not in "buif":
        raise InvalidArgumentError(f"mask must be of numbers; got an array of {given.dtype}")
    return copy


def _kept(mask: Any, grid: Any) -> tuple[NDArray[np.bool_], bool]:
    """Return which points of a grid, or cells, a mask keeps, and whether they are cells."""
    try:
        labels = scalars_of(mask, None)
    except VDIError as error:
        raise InvalidArgumentError(
            f"mask must have labels, its active array or the only one; it has {mask.array_names}"
        ) from error
    kept = as_numpy(labels) != 0
    of_cells = is_of_cells(mask, labels)
    if kept.ndim == 1 and len(kept) == (mask.n_cells if of_cells else mask.n_points):
        if isinstance(mask, pv.ImageData) and isinstance(grid, pv.ImageData):
            turned = _turned(kept, mask, grid, of_cells)
            if turned is not None:
                return turned, of_cells
        elif mask.n_points == grid.n_points and mask.n_cells == grid.n_cells:
            aside = np.abs(np.asarray(mask.points) - grid.points).max()
            if aside <= _ASIDE * grid.length / grid.n_points ** (1 / 3):
                return kept, of_cells
    raise InvalidArgumentError(
        f"mask must have a label at each of the volume's points, or for each of its cells; its "
        f"{mask.n_points} points cover {_rounded(mask.bounds)}, and the volume's {grid.n_points} "
        f"{_rounded(grid.bounds)}: resample it to the volume's points, by the nearest label "
        "(PyVista's sample)"
    )


def _rounded(bounds: Any) -> list[float]:
    return [float(f"{each:.5g}") for each in bounds]


def _turned(
    kept: NDArray[np.bool_], mask: Any, grid: Any, of_cells: bool
) -> NDArray[np.bool_] | None:
    """Return labels of a uniform grid in the order of another one of the same points.

    Its axes may be mirrored, or in another order. ``None`` if the points are others.
    """
    to = np.linalg.inv(_index_to_model(mask)) @ _index_to_model(grid)
    corners = np.array([*itertools.product((0, 1), repeat=3)]) * np.subtract(grid.dimensions, 1)
    there = corners @ to[:3, :3].T + to[:3, 3]
    axes = np.abs(to[:3, :3]).argmax(axis=0)  # of the mask, along each of the grid
    whole = np.zeros((3, 3))
    whole[axes, range(3)] = np.sign(to[axes, range(3)])
    sides = np.where(whole.sum(axis=1) < 0, np.subtract(mask.dimensions, 1), 0)
    same_size = np.array_equal(np.take(mask.dimensions, axes), grid.dimensions)
    if not same_size or np.abs(corners @ whole.T + sides - there).max() > _ASIDE:
        return None
    volume = kept.reshape(np.subtract(mask.dimensions, int(of_cells)), order="F")
    steps = [slice(None, None, int(whole[axis, k])) for k, axis in enumerate(axes)]
    return volume.transpose(axes)[tuple(steps)].ravel(order="F")


def _index_to_model(grid: Any) -> NDArray[np.float64]:
    """Return what leads from the index of a point, from 0 on, to its place, (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3] = grid.direction_matrix * np.asarray(grid.spacing)
    matrix[:3, 3] = first_point(grid)
    return matrix


def _blank_of_mask(grid: Any, kept: tuple[NDArray[np.bool_], bool]) -> NDArray[np.uint8]:
    """Return the blank octants of a masked uniform grid: all of a point, or those in a cell."""
    labels, of_cells = kept
    shape = np.array(grid.dimensions[::-1])
    if not of_cells:
        return np.where(labels, np.uint8(0), np.uint8(255))
    return _blank(np.pad(labels.reshape(shape - 1), 1, mode="edge"), shape, 1)


def _blank(drawn: NDArray[np.bool_], shape: Any, stride: int) -> NDArray[np.uint8]:
    """Return the octants that are not drawn, of points whose octants begin ``stride`` apart."""
    blank = np.zeros(shape, np.uint8)
    for octant, first in enumerate(itertools.product((0, 1), repeat=3)):  # z, y, x
        at = (slice(o, o + stride * (n - 1) + 1, stride) for o, n in zip(first, shape, strict=True))
        blank |= (~drawn[tuple(at)]).astype(np.uint8) << octant
    return blank.ravel()


def _numbers(grid: Any, resample: str | Sequence[int] | None) -> NDArray[Any] | None:
    """Return the numbers of points along each axis; ``None``: the grid stays as it is."""
    if resample is None:
        return None
    uniform = isinstance(grid, pv.ImageData)
    size = np.diff(np.reshape(grid.bounds, (3, 2))).ravel()
    if grid.n_cells == 0 or not (size > 0).all():
        raise InvalidVolumeError(
            f"a {type(grid).__name__} of {grid.n_cells} cells, {size.tolist()} long, cannot be "
            "resampled: it must have cells, and a length along each axis"
        )
    auto = isinstance(resample, str) and resample == "auto"
    if auto and uniform:
        return None
    numbers = np.asarray(resample)
    if auto:
        # As large as the mean cell, and of the shape of its box
        volumes = np.abs(grid.compute_cell_sizes(length=False, area=False)["Volume"])
        if not volumes.any():
            raise InvalidVolumeError(f"none of the {grid.n_cells} cells has a volume")
        seen = np.linspace(0, grid.n_cells - 1, min(grid.n_cells, _CELLS_SEEN)).astype(int)
        boxes = np.reshape([grid.get_cell(i).bounds for i in seen.tolist()], (-1, 3, 2))
        edges = np.diff(boxes).mean(axis=0).ravel()
        step = edges * (volumes[volumes > 0].mean() / np.prod(edges)) ** (1 / 3)
        numbers = np.maximum(2, np.ceil(size / step - 1e-6).astype(int) + 1)
    if numbers.shape != (3,) or numbers.dtype.kind not in "iu" or (numbers < 2).any():
        raise InvalidArgumentError(
            f'resample must be "auto" or three numbers of points, 2 or more; got {resample!r}'
        )
    count = int(np.prod(numbers, dtype=object))
    if count > _MOST_POINTS and auto:
        raise UnsupportedError(
            f"the mean cell of the grid asks for {' x '.join(map(str, numbers))} points: give "
            "resample=(nx, ny, nz)"
        )
    need = count * 8 * (2 + len(grid.array_names))
    require_host_memory(need, f"the grid of {count} points", "resample to fewer", free=True)
    return numbers


def _resampled(
    grid: Any,
    numbers: NDArray[Any],
    kept: tuple[NDArray[np.bool_], bool] | None,
    categorical: bool,
) -> pv.ImageData:
    """Return a grid's arrays at the points of a uniform one, and what of that is blank.

    An octant of a point is drawn if its centre lies in a cell that the mask keeps. A point in no
    cell of which one is drawn has the value at its centre.
    """
    image = pv.ImageData(dimensions=numbers)
    if isinstance(grid, pv.ImageData):
        # Along the axes of the grid, wherever it lies
        image.origin = first_point(grid)
        image.direction_matrix = grid.direction_matrix
        upright = pv.ImageData(dimensions=grid.dimensions, spacing=grid.spacing)
        upright.GetPointData().ShallowCopy(grid.GetPointData())
        upright.GetCellData().ShallowCopy(grid.GetCellData())
        grid = upright
        low = np.zeros(3)
    else:
        low = image.origin = np.array(grid.bounds)[::2]
    image.spacing = spacing = np.diff(np.reshape(grid.bounds, (3, 2))).ravel() / (numbers - 1)

    # Which octants are drawn
    box = isinstance(grid, pv.ImageData | pv.RectilinearGrid) and not _marked(grid)
    blank = None
    if kept is not None or not box:
        structure = type(grid)()
        structure.CopyStructure(grid)
        for data, marks in (
            (structure.GetPointData(), grid.GetPointGhostArray()),
            (structure.GetCellData(), grid.GetCellGhostArray()),
        ):
            data.AddArray(marks)
        labels, of_cells = kept or (np.ones(grid.n_points, bool), False)
        data = structure.GetCellData() if of_cells else structure.GetPointData()
        data.SetScalars(to_vtk("kept", labels.astype(np.uint8)))
        centres = low + spacing / 4
        found = _sampled(structure, 2 * (numbers - 1), spacing / 2, centres, not of_cells)
        drawn = found["vtkValidPointMask"] != 0
        if not drawn.any():
            raise InvalidVolumeError("no point of the uniform grid lies in a cell of the other")
        drawn &= found["kept"] != 0
        drawn = np.pad(drawn.reshape(2 * (numbers[::-1] - 1)), 1, mode="edge")
        blank = _blank(drawn, numbers[::-1], 2)

    # Values; rounded up, the last points would lie outside
    found = _sampled(grid, numbers, spacing * (1 - 2**-50), low, categorical)
    lacking = np.flatnonzero(found["vtkValidPointMask"] == 0)
    if lacking.size and blank is not None:
        _fill(found, lacking, blank, grid, image, low, categorical)
    for name in {*found.keys()} - {*_MARKS}:
        image.point_data[name] = found[name]
    if blank is not None:
        image.GetPointData().AddArray(to_vtk(BLANKED, blank))
    return image


def _marked(grid: Any) -> bool:
    """Whether ghost arrays may hide something of a grid."""
    return grid.GetPointGhostArray() is not None or grid.GetCellGhostArray() is not None


def _sampled(
    grid: Any, numbers: NDArray[Any], spacing: NDArray[Any], origin: Any, categorical: bool
) -> Any:
    """Return a grid's arrays at the points of a uniform one."""
    points = pv.ImageData(dimensions=numbers, spacing=spacing, origin=origin)
    return points.sample(grid, categorical=categorical, mark_blank=False).point_data


def _fill(
    found: Any,
    lacking: NDArray[Any],
    blank: NDArray[np.uint8],
    grid: Any,
    image: pv.ImageData,
    low: Any,
    categorical: bool,
) -> None:
    """Set the values of points outside of all cells: at an octant that is drawn, else any value."""
    beside = lacking[blank[lacking] != 255]
    octant = np.unpackbits(blank[beside, None], axis=1, bitorder="little").argmin(axis=1)
    above = np.stack([octant & 1, octant >> 1 & 1, octant >> 2], axis=1)
    index = np.stack(np.unravel_index(beside, image.dimensions, order="F"), axis=1)
    centres = pv.PolyData(low + (index + above / 2 - 0.25) * image.spacing)
    there = centres.sample(grid, categorical=categorical, mark_blank=False)
    at = there["vtkValidPointMask"] != 0
    known = np.ones(len(blank), bool)
    known[lacking] = False
    known[beside[at]] = True
    for name in {*found.keys()} - {*_MARKS}:
        found[name][beside[at]] = there[name][at]
        if known.any():
            found[name][~known] = found[name][known.argmax()]
