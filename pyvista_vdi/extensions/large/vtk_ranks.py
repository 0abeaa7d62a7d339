"""``VDISource`` in a VTK program of several MPI ranks, each of which has a part of the volume.

Every rank asks for a block of its own, takes it from whoever has its points, and the ranks make the
VDI together by :func:`pyvista_vdi.extensions.large.on_mpi.generate_on_mpi`. A VDI is small: all
get it.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidVolumeError, UnsupportedError, VDIError
from pyvista_vdi.extensions.large.on_mpi import generate_on_mpi, mpi, require_same, together
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Grid
from pyvista_vdi.vtk_pipeline import vtk
from pyvista_vdi.vtk_pipeline.filters.algorithm import whole_extent
from pyvista_vdi.vtk_pipeline.filters.convert import (
    ghosts_of,
    require_image,
    scalars_of,
    volume_from_vtk,
)
from pyvista_vdi.vtk_pipeline.filters.source import Request, VDISource

#: What fails, for the message that all ranks get.
_MAKING = "making a VDI"

#: Points that a block has along each axis at least, see generate_on_mpi.
_LEAST_POINTS = 4

#: First point along z, y and x, and the one behind the last.
Box = tuple[tuple[int, int], ...]


def are_several() -> bool:
    """Whether VTK's program has several ranks."""
    try:
        from pyvista_vdi.vtk_pipeline.vtk import vtkMultiProcessController
    except ImportError:  # a VTK without its parallel modules
        return False
    controller = vtkMultiProcessController.GetGlobalController()
    return controller is not None and bool(controller.GetNumberOfProcesses() > 1)


@functools.cache
def communicator() -> Any:
    """Return a communicator of the ranks of VTK's parallel program; ``None`` where there is one.

    To be called first where all ranks are: it waits for all.

    Raises MissingDependencyError if there are several ranks and mpi4py is missing.
    """
    # A copy: VTK's own messages do not meet ours
    return mpi().COMM_WORLD.Dup() if are_several() else None


def is_first_rank() -> bool:
    """Whether this process is the one that writes files."""
    comm = communicator()
    return comm is None or comm.rank == 0


@dataclass(frozen=True)
class Part:
    """A rank's own points of a grid, in place of a :class:`~pyvista_vdi.Volume`.

    ``array`` (shape (nz, ny, nx)): the points' scalars. ``first``: index x, y, z of the first of
    them. ``grid``: the whole grid. ``name``: what the scalars are called. ``ends``: the least and
    the largest finite scalar of all ranks.
    """

    array: NDArray[Any]
    first: tuple[int, int, int]
    grid: Grid
    name: str
    ends: tuple[float, float]
    rgba: bool = False

    def finite_range(self) -> tuple[float, float]:
        """Return the least and the largest finite scalar of all ranks."""
        return self.ends


class RanksVDISource(VDISource):
    """A :class:`VDISource` that all ranks of a parallel program execute together.

    In a program of one process it is a :class:`VDISource`.
    """

    def __init__(self) -> None:
        super().__init__()
        self._part: Part | None = None
        self._refused: VDIError | None = None  # by what was given to this rank as its input

    def FillInputPortInformation(self, port: int, information: Any) -> int:
        """Take nothing as well, of several ranks: one without an input is to tell the others."""
        super().FillInputPortInformation(port, information)
        if are_several():
            information.Set(self.INPUT_IS_OPTIONAL(), 1)
        return 1

    def SetInputDataObject(self, *args: Any) -> None:
        """Set the volume; of several ranks, the next update refuses what is none, on all."""
        with self._refused_later():
            super().SetInputDataObject(*args)

    def SetInputConnection(self, *args: Any) -> None:
        """Set what makes the volume; of several ranks, the next update refuses it, on all."""
        with self._refused_later():
            super().SetInputConnection(*args)

    @contextmanager
    def _refused_later(self) -> Iterator[None]:
        """Keep the error for the next update, which the other ranks take part in."""
        self._refused = None
        try:
            yield
        except VDIError as error:
            if not are_several():
                raise
            self._refused = error
            self.Modified()

    def Update(self, *args: Any) -> None:
        """Bring the output up to date, and raise what went wrong, on whichever rank."""
        try:
            super().Update(*args)
        except Exception:
            comm = communicator()
            if comm is None:
                raise
            with together(comm, _MAKING):  # where the others are, if they do not know it yet
                raise

    def RequestUpdateExtent(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Ask for the whole input; of several ranks each for its block, and a point around it."""
        super().RequestUpdateExtent(request, inputs, outputs)
        comm = communicator()
        information = inputs[0].GetInformationObject(0)
        whole = whole_extent(information)
        if comm is not None and whole is not None:
            with suppress(InvalidVolumeError):  # RequestData says it
                own = _boxes(_points(whole), comm.size)[comm.rank]
                pipeline = vtk.vtkStreamingDemandDrivenPipeline
                # Of several pieces, readers would take this rank's part of the block alone
                information.Set(pipeline.UPDATE_PIECE_NUMBER(), 0)
                information.Set(pipeline.UPDATE_NUMBER_OF_PIECES(), 1)
                information.Set(pipeline.UPDATE_NUMBER_OF_GHOST_LEVELS(), 0)
                # The block and a point around it: by that, values of cells become right
                extent: list[int] = []
                for axis, (begin, end) in enumerate(own[::-1]):
                    low, high = whole[2 * axis : 2 * axis + 2]
                    extent += [max(low + begin - 1, low), min(low + end, high)]
                information.Set(pipeline.UPDATE_EXTENT(), extent, 6)
        return 1

    def RequestData(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Generate; all ranks at a time."""
        self._part = None
        return super().RequestData(request, inputs, outputs)

    def _execute(self, inputs: Any, outputs: Any) -> None:
        comm = communicator()
        if comm is None:
            self._execute_here(inputs, outputs)
            return
        with together(comm, _MAKING):  # a camera that only one has, say
            if self._refused is not None:
                raise self._refused
            if self.GetNumberOfInputConnections(0) == 0:
                raise InvalidVolumeError(self._no_input())
            self._execute_here(inputs, outputs)

    def _execute_here(self, inputs: Any, outputs: Any) -> None:
        """Generate; what fails on this rank is told to the others."""
        super()._execute(inputs, outputs)

    def _check_input(self) -> None:
        if not are_several():  # ranks keep what they have read for one execution
            super()._check_input()

    def _scalar_range(self, image: Any) -> tuple[float, float]:
        """Return the least and the largest scalar of the whole input."""
        if communicator() is not None:
            return self._read(image).finite_range()  # type: ignore[no-any-return]
        array = scalars_of(require_image(image), self.GetScalars(), self._preference)
        return array.GetFiniteRange()

    def _default_unit_distance(self, image: Any) -> float:
        """Return the default scalar opacity unit distance of the whole input."""
        volume = self._read(image)
        return getattr(volume, "grid", volume).default_unit_distance  # type: ignore[no-any-return]

    def _holds_all(self, data: vtk.vtkImageData) -> bool:
        return not are_several()

    def _view(
        self, grid: vtk.vtkImageData, camera: Camera, window_size: tuple[int, int], *, warn: bool
    ) -> tuple[Camera, tuple[int, int]]:
        whole = self._input_grid() if communicator() is not None else grid
        return super()._view(whole or grid, camera, window_size, warn=warn)

    def _read(self, image: Any) -> Any:
        comm = communicator()
        if comm is None:
            return super()._read(image)
        if self._part is None:
            whole = whole_extent(self.GetInputInformation(0, 0))
            self._part = _read_part(comm, image, whole, self.GetScalars(), self._preference)
            self._volume_key = object()  # no two are equal: ranks must not differ in that
        return self._part

    def _generate(self, request: Request) -> VDI:
        comm = communicator()
        if comm is None:
            return super()._generate(request)
        if request.deferral.deferred:
            raise UnsupportedError(
                "several ranks make VDIs with colours alone: start one rank, or leave "
                "classification='deferred' out"
            )
        part: Any = request.volume
        camera, window_size = request.generating
        vdi = generate_on_mpi(
            part.array,
            part.first,
            part.grid,
            camera,
            window_size,
            request.transfer_function,
            request.options,
            comm=comm,
            device=request.device,
            name=part.name,
            metadata=request.generation.metadata,
        )
        return comm.bcast(vdi)  # type: ignore[no-any-return]


def _boxes(points: Any, ranks: int) -> list[Box]:
    """Return each rank's own points of a grid, a product of cuts along z, y and x.

    Raises InvalidVolumeError if there are too few points for so many ranks.
    """
    counts = [1, 1, 1]
    longest_first = sorted(range(3), key=lambda axis: -int(points[axis]))
    for axis, n in zip(longest_first, sorted(mpi().Compute_dims(ranks, 3))[::-1], strict=True):
        counts[axis] = n
    if any(n // count < _LEAST_POINTS for n, count in zip(points, counts, strict=True)):
        raise InvalidVolumeError(
            f"{ranks} ranks cut {tuple(points)[::-1]} points into {tuple(counts)[::-1]} blocks, "
            f"and a block needs {_LEAST_POINTS} points along each axis: start fewer ranks"
        )
    cuts = [[k * n // c for k in range(c + 1)] for n, c in zip(points, counts, strict=True)]
    return [
        tuple((cuts[axis][k], cuts[axis][k + 1]) for axis, k in enumerate(at))
        for at in np.ndindex(*counts)
    ]


def _points(whole: Any) -> tuple[int, ...]:
    """Return the points along z, y and x of an extent."""
    return tuple(whole[k + 1] - whole[k] + 1 for k in (4, 2, 0))


@dataclass(frozen=True)
class _Held:
    """Points that a rank has of its input."""

    box: Box
    values: NDArray[Any]
    name: str
    grid: Grid
    ends: tuple[float, float]

    @classmethod
    def of(cls, image: vtk.vtkImageData, whole: Any, scalars: str | None, preference: str) -> _Held:
        """Return the points whose values are right: not those at a border, if of cells."""
        volume = volume_from_vtk(image, scalars, preference)
        if volume.rgba:
            raise UnsupportedError(
                f"the scalars {volume.name!r} are RGBA, of which several ranks make no VDI: start "
                "one, or pass one scalar per point"
            )
        # Copies of what other ranks have are marked, too
        hidden = {
            "point": vtk.vtkDataSetAttributes.HIDDENPOINT,
            "cell": vtk.vtkDataSetAttributes.HIDDENCELL,
        }
        if any((marks & hidden[kind]).any() for kind, marks in ghosts_of(image).items()):
            raise UnsupportedError(
                "the input has hidden points or cells, of which several ranks make no VDI: start "
                "one, or write NaN there"
            )
        array, of_points = scalars_of(image, scalars, preference), image.GetPointData()
        at_points = (of_points.GetArray(i) for i in range(of_points.GetNumberOfArrays()))
        of_cells = all(each is not array for each in at_points)
        extent, box, right = image.GetExtent(), [], []
        for axis in (2, 1, 0):
            low, high = extent[2 * axis], extent[2 * axis + 1]
            first, last = whole[2 * axis], whole[2 * axis + 1]
            before, after = int(of_cells and low > first), int(of_cells and high < last)
            box.append((low - first + before, high - first + 1 - after))
            right.append(slice(before, high - low + 1 - after))
        corner = [0.0, 0.0, 0.0]
        image.TransformIndexToPhysicalPoint(*whole[::2], corner)
        nz, ny, nx = _points(whole)
        x, y, z = corner
        grid = Grid((nx, ny, nz), volume.spacing, (x, y, z), volume.direction)
        finite = np.isfinite(volume.array).any()
        ends = volume.finite_range() if finite else (np.nan, np.nan)
        return cls(tuple(box), volume.array[tuple(right)], volume.name, grid, ends)

    def common(self, box: Box) -> Box | None:
        """Return what of a box is here."""
        pairs = zip(self.box, box, strict=True)
        found = tuple((max(a[0], b[0]), min(a[1], b[1])) for a, b in pairs)
        return found if all(begin < end for begin, end in found) else None

    def cut(self, box: Box) -> NDArray[Any]:
        """Return the values of a box that is here."""
        return np.ascontiguousarray(self.values[_within(box, self.box)])

    def described(self) -> _Held:
        """Return it without its values."""
        return replace(self, values=np.zeros((0, 0, 0), self.values.dtype))


def _within(box: Box, outer: Box) -> tuple[slice, ...]:
    """Return where a box lies in an array of another one's points."""
    pairs = zip(box, outer, strict=True)
    return tuple(slice(begin - first, end - first) for (begin, end), (first, _) in pairs)


def _read_part(comm: Any, image: Any, whole: Any, scalars: str | None, preference: str) -> Part:
    """Return this rank's own points, taken from the ranks that have them. All ranks call it."""
    here: _Held | None = None
    boxes: list[Box] = []
    with together(comm, "reading the volume"):
        if whole is None:
            raise InvalidVolumeError("what is before VDISource does not say how large its grid is")
        boxes = _boxes(_points(whole), comm.size)
        if image is not None and require_image(image).GetNumberOfPoints():
            here = _Held.of(image, whole, scalars, preference)
    require_same(comm, extent=tuple(whole))
    of_ranks: list[_Held | None] = comm.allgather(here.described() if here else None)
    held = [each for each in of_ranks if each is not None]
    sent: list[Any] = []
    with together(comm, "reading the volume"):
        kinds = sorted({f"{each.name} ({each.values.dtype})" for each in held})
        if len(kinds) != 1:
            raise InvalidVolumeError(
                f"the ranks have different arrays: {', '.join(kinds)}"
                if kinds
                else "the volume is empty: no rank has points"
            )
        for box, of_rank in zip(boxes, of_ranks, strict=True):
            needed = of_rank is None or of_rank.common(box) != box
            common = here.common(box) if here and needed else None
            sent.append((common, here.cut(common)) if here and common else None)
    received = comm.alltoall(sent)
    own = boxes[comm.rank]
    array = np.zeros([end - begin for begin, end in own], held[0].values.dtype)
    with together(comm, "taking the blocks from the ranks that have them"):
        if here and here.common(own) == own:
            array = here.cut(own)
        else:
            missing = np.ones(array.shape, bool)
            for common, values in filter(None, received):
                at = _within(common, own)
                array[at], missing[at] = values, False
            if missing.any():
                raise InvalidVolumeError(
                    f"nobody has {int(missing.sum())} of the {missing.size} points of this "
                    "block: if the scalars are those of cells, use Cell Data To Point Data before "
                    "VDI Source; else let the reader, or a filter, give all of them"
                )
    low, high = zip(*(each.ends for each in held), strict=True)
    ends = (float(np.fmin.reduce(low)), float(np.fmax.reduce(high)))
    (z, _), (y, _), (x, _) = own
    return Part(array, (x, y, z), held[0].grid, held[0].name, ends)
