"""VTK's images to and from the engine's volumes and VDIs; no voxel is copied where VTK lets us."""

from __future__ import annotations

import itertools
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import (
    InvalidCameraError,
    InvalidVDIError,
    InvalidVolumeError,
    InvalidVolumeTypeError,
    UnknownArrayError,
    UnsupportedError,
)
from pyvista_vdi.io.vdi_file.layout import plain_number
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI, DeferredVDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.vtk_pipeline import vtk

#: Point scalars of the canonical form: how many supersegments each pixel's list has.
COUNT = "count"
#: Field array of the canonical form: everything that is not an array, as JSON.
DESCRIPTION = "vdi"
#: Point array of a uniform grid: what of a volume is blank, as :class:`Volume` has it.
BLANKED = "blank octants"
#: Version of the canonical form; readers refuse newer ones. The first is of colours alone.
FORM_VERSION = 2

#: Ragged arrays in field data, with their number of components.
_RAGGED = {"front": 1, "back": 1, "color": 3, "optical_depth": 1}


def require_image(data: Any) -> vtk.vtkImageData:
    """Return ``data`` if it is a uniform grid, and say how to make one of anything else."""
    if isinstance(data, vtk.vtkImageData):
        return data
    if not hasattr(data, "GetClassName"):
        raise InvalidVolumeTypeError(
            f"expected a vtkImageData or pyvista.ImageData; got {type(data).__name__}"
        )
    raise UnsupportedError(
        f"{type(data).__name__} is not a uniform grid, which is all that a VDI is made from: "
        "resample a grid (pyvista.ImageData(...).sample(grid), vtkResampleToImage, or in ParaView "
        "Resample To Image), take the blocks of a composite one by one, and voxelise a surface by "
        "PyVista (surface.voxelize_binary_mask())"
    )


def volume_from_vtk(image: Any, scalars: str | None = None, preference: str = "point") -> Volume:
    """Return the volume of a VTK image, with its origin, spacing, direction matrix and ghosts.

    ``scalars`` names the array; the active scalars by default, else the only array there is.
    ``preference`` says which, where points and cells both have one of that name. It shares memory
    with the point array where that is contiguous and of a type that kernels read.
    """
    image = require_image(image)
    array = scalars_of(image, scalars, preference)
    n = array.GetNumberOfComponents()
    rgba = n == 4 and array.GetDataType() == vtk.VTK_UNSIGNED_CHAR
    if n != 1 and not rgba:
        raise UnsupportedError(
            f"the scalars {array.GetName()!r} have {n} components: a VDI is made from one scalar "
            "per point (one component, or the vectors' length), or from RGBA of type unsigned char"
        )
    dimensions = image.GetDimensions()
    name = array.GetName() or "values"
    points = image.GetPointData()
    of_cells = all(points.GetArray(i) is not array for i in range(points.GetNumberOfArrays()))
    if of_cells:
        if min(dimensions) < 2:
            raise InvalidVolumeError(
                f"the volume has only one plane of points: its dimensions are {dimensions}, and "
                "a volume needs at least two points along each axis"
            )
        # Average the cells' values at the points, by the filter that add_volume uses
        cells, to_points = vtk.vtkImageData(), vtk.vtkCellDataToPointData()
        cells.CopyStructure(image)
        cells.GetCellData().SetScalars(array)
        to_points.SetInputData(cells)
        to_points.Update()
        array = to_points.GetOutput().GetPointData().GetScalars()
    direction, first = image.GetDirectionMatrix(), [0.0, 0.0, 0.0]
    image.TransformIndexToPhysicalPoint(*image.GetExtent()[::2], first)
    volume = Volume(
        as_numpy(array).reshape((*dimensions[::-1], 4) if rgba else dimensions[::-1]),
        image.GetSpacing(),
        first,
        [[direction.GetElement(i, j) for j in range(3)] for i in range(3)],
        name=name,
    )
    volume.blanked = _blanked(image, of_cells)
    return volume


def _blanked(image: vtk.vtkImageData, of_cells: bool) -> NDArray[np.uint8] | None:
    """Return the octants that are left out, as a :class:`Volume` has them.

    An array of the image's says which, and ghost arrays do as VTK's GPU mapper reads them: its
    texels are points, or cells where the scalars are theirs, and it leaves out a sample where the
    texel that it lies in is marked, or the nearest one to it along an axis. Where texels are
    points, a marked cell is the point that it begins at.
    """
    own = image.GetPointData().GetArray(BLANKED)
    nx, ny, nz = image.GetDimensions()
    blanked = None if own is None else as_numpy(own).astype(np.uint8).reshape((nz, ny, nx))
    for cells, array, shape in (
        (False, image.GetPointGhostArray(), (nz, ny, nx)),
        (True, image.GetCellGhostArray(), (nz - 1, ny - 1, nx - 1)),
    ):
        if array is None or not (marks := as_numpy(array).reshape(shape) > 0).any():
            continue
        texels = np.pad(marks, (0, 1)) if cells and not of_cells else marks
        cells &= of_cells
        points = [n + cells for n in texels.shape]
        texels = np.pad(texels, 1, mode="edge")
        octants = np.zeros(points, np.uint8)
        for octant, above in enumerate(itertools.product((0, 1), repeat=3)):  # z, y, x
            at = [up if cells else 1 for up in above]
            beside = [1 - up if cells else 2 * up for up in above]
            marked = np.zeros(points, bool)
            for first in (at, *([*at[:k], beside[k], *at[k + 1 :]] for k in range(3))):
                marked |= texels[tuple(slice(f, f + n) for f, n in zip(first, points, strict=True))]
            octants |= marked.astype(np.uint8) << octant
        blanked = octants if blanked is None else blanked | octants
    return blanked


def scalars_of(
    image: vtk.vtkImageData, name: str | None, preference: str = "point"
) -> vtk.vtkDataArray:
    """Return the array that ``name`` means: see :func:`volume_from_vtk`."""
    if image.GetNumberOfPoints() == 0:
        raise InvalidVolumeError("the volume is empty: it has no points")
    if is_vdi_image(image):
        raise InvalidVolumeError(
            "this image is a VDI in its VTK form, not a volume: render, add_vdi and VDIMapper "
            "show it as it is"
        )
    attributes = [image.GetPointData(), image.GetCellData()]
    if name is None:
        # Active scalars: points first, whatever the preference, as pyvista's active_scalars
        for data in attributes:
            if data.GetScalars() is not None:
                return data.GetScalars()
    # Of text there is None, which cannot be rendered
    arrays = [
        [a for i in range(data.GetNumberOfArrays()) if (a := data.GetArray(i)) is not None]
        for data in attributes
    ]
    marks = (vtk.vtkDataSetAttributes.GhostArrayName(), BLANKED)
    named = [array.GetName() for found in arrays for array in found]
    names = [name for name in dict.fromkeys(named) if name not in marks]
    if name is None:
        if len(names) != 1:
            raise InvalidVolumeError(
                f"the volume has no active scalars; its arrays are {names}: name one"
                if names
                else "the volume has no scalars: there is nothing to render"
            )
        name = names[0]
    for found in arrays if preference == "point" else arrays[::-1]:
        for array in found:
            if array.GetName() == name:
                return array
    raise UnknownArrayError(f"the volume has no array {name!r}: its arrays are {names}")


def as_numpy(array: vtk.vtkDataArray) -> NDArray[Any]:
    """Return the values of VTK's array, sharing its memory where they lie one after the other."""
    if not array.HasStandardMemoryLayout():  # implicit (constant, affine, ...), or by components
        plain = vtk.vtkDataArray.CreateDataArray(array.GetDataType())
        plain.DeepCopy(array)
        return vtk.vtk_to_numpy(plain)  # type: ignore[no-any-return]
    values: NDArray[Any] = vtk.vtk_to_numpy(array)
    # NumPy's own array rather than one that keeps VTK's, which has an attribute: see held_by_vtk
    lent = getattr(array, "_numpy_reference", values)
    theirs, ours = ((a.dtype, a.size, a.ctypes.data) for a in (lent, values))
    return lent.reshape(values.shape) if theirs == ours else values


def volume_to_image(volume: Volume, name: str | None = None) -> vtk.vtkImageData:
    """Return a volume as a grid that shares its memory; its scalars are the active ones."""
    image = vtk.vtkImageData()
    image.SetDimensions(volume.dimensions)
    image.SetSpacing(volume.spacing)
    image.SetOrigin(volume.origin)
    image.SetDirectionMatrix(volume.direction.ravel().tolist())
    # x runs fastest in VTK's point order, as it does in a C-ordered [z, y, x] array
    flat = volume.array.reshape((-1, 4) if volume.rgba else -1)
    image.GetPointData().SetScalars(to_vtk(volume.name if name is None else name, flat))
    if volume.blanked is not None:
        image.GetPointData().AddArray(to_vtk(BLANKED, volume.blanked.ravel()))
    return image


def vdi_to_image(vdi: VDI | DeferredVDI) -> vtk.vtkImageData:
    """Return a VDI in its canonical VTK form.

    Parameters
    ----------
    vdi : VDI or DeferredVDI
        Any VDI. One that keeps values has them in the place of colours, and is marked so.

    Returns
    -------
    vtkImageData
        Dimensions (W, H, 1), bottom row first; point scalars ``count``: supersegments per pixel;
        field data ``front``, ``back``, ``color``, ``optical_depth``: all lists one after the
        other; field string ``vdi``: camera, bounds, depth origin and metadata as JSON. The
        arrays share the VDI's memory, so they must not be written to. A ``.vti`` file keeps every
        bit.
    """
    lists = vdi.with_precision("exact")
    kept = {"deferred": vdi.about} if isinstance(vdi, DeferredVDI) else {}
    width, height = lists.window_size
    image = vtk.vtkImageData()
    image.SetDimensions(width, height, 1)
    counts = np.diff(lists.offsets).astype(np.uint32)
    image.GetPointData().SetScalars(to_vtk(COUNT, counts))
    field = image.GetFieldData()
    for name in _RAGGED:
        field.AddArray(to_vtk(name, getattr(lists.arrays, name)))
    # Everything that is not an array, as a field string of JSON
    about = {
        "form_version": FORM_VERSION if kept else 1,
        "camera": lists.camera.to_dict(),
        "bounds": list(lists.bounds),
        "depth_origin": lists.depth_origin,
        "metadata": lists.metadata,
        **kept,
    }
    try:
        text = json.dumps(about, default=plain_number)  # NaN and infinity, as Python reads them
    except (TypeError, ValueError, RecursionError) as error:
        raise InvalidVDIError(
            f"the VDI's metadata cannot be written: {error}; they may hold numbers, text, lists "
            "and dictionaries with text as keys"
        ) from error
    description = vtk.vtkStringArray()
    description.SetName(DESCRIPTION)
    description.InsertNextValue(text)
    field.AddArray(description)
    return image


def is_vdi_image(data: Any) -> bool:
    """Whether a VTK object is a VDI in its canonical form."""
    return isinstance(data, vtk.vtkImageData) and isinstance(
        data.GetFieldData().GetAbstractArray(DESCRIPTION), vtk.vtkStringArray
    )


def vdi_from_image(image: Any) -> VDI | DeferredVDI:
    """Return the VDI that a canonical VTK form holds.

    Parameters
    ----------
    image : vtkImageData or pyvista.ImageData
        As :func:`vdi_to_image` makes it, or ``pyvista.read("x.vdi")``.

    Returns
    -------
    VDI or DeferredVDI
        The same to the last bit; it shares the image's memory.

    Raises
    ------
    InvalidVDIError
        If the image is not such a form, of a newer version, or its arrays break a rule.
    """
    if not is_vdi_image(image):
        kind = type(image).__name__
        raise InvalidVDIError(
            f"this {kind} is not a VDI: it has no field string {DESCRIPTION!r}; a volume becomes "
            "a VDI by pyvista_vdi.generate or VDISource"
        )
    # Read everything that is not an array
    try:
        about = json.loads(image.GetFieldData().GetAbstractArray(DESCRIPTION).GetValue(0))
        version, camera = int(about["form_version"]), about["camera"]
        view = Camera.from_dict(camera) if version <= FORM_VERSION else None
        entries = {key: about[key] for key in ("bounds", "depth_origin", "metadata")}
    except (
        *(KeyError, TypeError, IndexError, ValueError, OverflowError, RecursionError),
        InvalidCameraError,
    ) as error:
        raise InvalidVDIError(f"the VDI's description is damaged: {error!r}") from error
    if view is None:
        raise InvalidVDIError(
            f"the VDI's VTK form has version {version}, and this pyvista-vdi reads up to "
            f"{FORM_VERSION}: update pyvista-vdi"
        )
    # Check the supersegments of each list: nothing is allocated for a window alone
    width, height, depth = image.GetDimensions()
    array = image.GetPointData().GetArray(COUNT)
    counts = np.array(-1) if array is None else as_numpy(array)
    flat = depth == 1 and counts.shape == (width * height,)
    if not (flat and counts.dtype.kind in "ui" and (counts >= 0).all()):
        raise InvalidVDIError(
            f"the VDI's image has {width} x {height} x {depth} points, and needs a point array "
            f"{COUNT!r} of whole numbers >= 0, one for each point of one plane"
        )
    # Where each list begins, and where the last one ends
    offsets = np.zeros(len(counts) + 1, dtype=np.uint64)
    np.cumsum(counts, dtype=np.uint64, out=offsets[1:])
    arrays: dict[str, Any] = {}
    for name, components in _RAGGED.items():
        array = image.GetFieldData().GetArray(name)
        if array is not None:
            arrays[name] = as_numpy(array)
        elif offsets[-1] == 0:  # VTK's XML files drop arrays without values
            arrays[name] = np.zeros((0, 3) if components == 3 else 0, dtype=np.float32)
        else:
            raise InvalidVDIError(f"the VDI's image lacks its field array {name!r}")
    vdi = VDI(camera=view, window_size=(width, height), offsets=offsets, **arrays, **entries)
    kept = about.get("deferred")
    return vdi if kept is None else DeferredVDI(vdi, kept)


def to_vtk(name: str, array: NDArray[Any]) -> vtk.vtkDataArray:
    """Return a named array of VTK's that shares the memory."""
    # VTK's arrays hold memory through the buffer protocol; this view drops NumPy's read-only flag
    if not array.flags.writeable and array.size:
        array = np.frombuffer(memoryview(array.data).cast("B"), dtype=array.dtype).reshape(
            array.shape
        )
    result = vtk.numpy_to_vtk(array)
    result.SetName(name)
    return result
