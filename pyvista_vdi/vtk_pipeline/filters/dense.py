"""The dense VTK form of a VDI: an image of W x H x N points, one for each possible supersegment.

For programs that know images and not lists: each supersegment is a point, (x, y) its pixel, z its
place in the list. It takes much more memory than the canonical form, which is why that is asked
for first.
"""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError, InvalidVDIError
from pyvista_vdi.model.compositing import opacity
from pyvista_vdi.model.host_memory import require_host_memory
from pyvista_vdi.model.inputs import as_vdi
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.vtk_pipeline.filters.algorithm import (
    Algorithm,
    accessors,
    announce,
    whole_extent,
)
from pyvista_vdi.vtk_pipeline.filters.convert import (
    as_numpy,
    counts_of,
    description_of,
    has_description,
    offsets_of,
    to_vtk,
    vdi_from_image,
    view_from_description,
)
from pyvista_vdi.vtk_pipeline.vtk import VTK_FLOAT, VTK_UNSIGNED_CHAR, vtkImageData

#: Field string of the dense form: everything that is not an array, as JSON.
DESCRIPTION = "vdi_dense"
#: Field array: supersegments of each list.
COUNT = "count"

_COLOR, _DEPTH, _OPTICAL_DEPTH = "color", "depth", "optical_depth"

#: VTK's number of the type of ``color``, and components; of bytes and exact.
SCALARS = {False: (VTK_UNSIGNED_CHAR, 4), True: (VTK_FLOAT, 3)}

#: Bytes of a point: two depths and an optical depth, float32, and RGBA bytes or RGB float32.
_BYTES = {False: 16, True: 24}


def vdi_to_dense_image(
    vdi: Any, *, exact: bool = False, max_supersegments: int | None = None
) -> vtkImageData:
    """Return a VDI as an image with a point for each possible supersegment.

    Parameters
    ----------
    vdi : VDI or vtkImageData
        The VDI, or its canonical form.
    exact : bool
        Keep the colours as they are, float32, so that nothing is lost.
    max_supersegments : int, optional
        Points along z; the longest list by default, at least 1.

    Returns
    -------
    vtkImageData
        W x H x N points, origin 0 and spacing 1: point (x, y, z) is the supersegment z of pixel
        (x, y), y = 0 at the bottom. Point data:

        - ``color``, the active scalars: uint8 (4,), straight RGB and opacity, rounded; with
          ``exact`` float32 (3,), straight RGB;
        - ``depth``: float32 (2,), front and back, view depth less the depth origin;
        - ``optical_depth``: float32.

        Points that no supersegment fills are 0 throughout. Field data: ``count``, how many are
        filled of each pixel, uint32 (W * H,), bottom row first, and the string ``vdi_dense``,
        camera, bounds, depth origin and metadata as JSON.

    Raises
    ------
    InvalidArgumentError
        If a list is longer than ``max_supersegments``: nothing is dropped.
    DeviceMemoryError
        If the host has less memory than the image takes, 16 bytes per point, with ``exact`` 24.
    """
    vdi = as_vdi(vdi)
    counts = vdi.counts.ravel()
    longest = longest_list(counts)
    if max_supersegments is not None:
        if max_supersegments < longest:
            raise InvalidArgumentError(
                f"the longest list has {longest} supersegments, and max_supersegments="
                f"{max_supersegments} would drop some: give at least {longest}, or generate with "
                "that limit"
            )
        longest = int(max_supersegments)
    width, height = vdi.window_size
    n = width * height * longest
    require_host_memory(
        n * _BYTES[bool(exact)] + 24 * vdi.n_supersegments,  # and where each one goes
        f"the dense form of {width} x {height} lists of {longest} supersegments",
        "keep the canonical form (vdi_to_image), or generate fewer lists or shorter ones",
    )
    places = _places(vdi.offsets, counts)
    image = vtkImageData()
    image.SetDimensions(width, height, longest)
    data = image.GetPointData()
    color = np.zeros((n, 3), np.float32) if exact else np.zeros((n, 4), np.uint8)
    color[places] = vdi.color if exact else _rgba_bytes(vdi)
    data.SetScalars(to_vtk(_COLOR, color))
    depth = np.zeros((n, 2), np.float32)
    depth[places, 0], depth[places, 1] = vdi.front, vdi.back
    data.AddArray(to_vtk(_DEPTH, depth))
    optical_depth = np.zeros(n, np.float32)
    optical_depth[places] = vdi.optical_depth
    data.AddArray(to_vtk(_OPTICAL_DEPTH, optical_depth))
    field = image.GetFieldData()
    field.AddArray(to_vtk(COUNT, counts.astype(np.uint32)))
    field.AddArray(description_of(DESCRIPTION, vdi))
    return image


def is_dense_image(data: Any) -> bool:
    """Whether a VTK object is a VDI in its dense form."""
    return has_description(data, DESCRIPTION)


def vdi_from_dense_image(image: Any) -> VDI:
    """Return the VDI that a dense form holds.

    Parameters
    ----------
    image : vtkImageData
        As :func:`vdi_to_dense_image` makes it.

    Returns
    -------
    VDI
        The same to the last bit if the image was made with ``exact``; otherwise each colour is off
        by up to 1/510, and nothing else.

    Raises
    ------
    InvalidVDIError
        If the image is not such a form, of a newer version, or its arrays break a rule.
    """
    if not is_dense_image(image):
        raise InvalidVDIError(
            f"this {type(image).__name__} is not a VDI's dense form: it has no field string "
            f"{DESCRIPTION!r}"
        )
    about = view_from_description(image, DESCRIPTION)
    width, height, longest = image.GetDimensions()
    n_lists = width * height
    counts = _numbers(image.GetFieldData(), COUNT, (n_lists,)).astype(np.int64)
    if counts.min(initial=0) < 0 or counts.max(initial=0) > longest:
        raise InvalidVDIError(
            f"the dense form's {COUNT!r} must be 0 to {longest}, its points along z; got "
            f"{counts.min()} to {counts.max()}"
        )
    points = image.GetPointData()
    n = n_lists * longest
    exact = points.GetArray(_COLOR) is None or points.GetArray(_COLOR).GetNumberOfComponents() == 3
    color = _numbers(points, _COLOR, (n, 3 if exact else 4))
    depth = _numbers(points, _DEPTH, (n, 2))
    optical_depth = _numbers(points, _OPTICAL_DEPTH, (n,))
    offsets = offsets_of(counts)
    places = _places(offsets, counts)
    straight = color[places]
    if not exact:
        straight = straight[:, :3].astype(np.float32) / np.float32(255)
    return VDI(
        window_size=(width, height),
        offsets=offsets,
        front=depth[places, 0],
        back=depth[places, 1],
        color=straight,
        optical_depth=optical_depth[places],
        **about,
    )


def _checked_limit(limit: Any) -> int | None:
    if limit is not None and not (isinstance(limit, int) and limit >= 1):
        raise InvalidArgumentError(
            f"max_supersegments must be a whole number from 1 on; got {limit!r}"
        )
    return limit


class VDIToDenseImage(Algorithm):
    """A filter from a VDI's canonical form to its dense form: see :func:`vdi_to_dense_image`.

    One image in, from :class:`VDISource` or a reader; one image out. Python's ``Update`` raises
    what went wrong; an update that VTK asks for writes it to VTK's output window and gives an
    empty image.
    """

    def __init__(self) -> None:
        super().__init__(
            nInputPorts=1, inputType="vtkImageData", nOutputPorts=1, outputType="vtkImageData"
        )
        self._exact = False
        self._max_supersegments: int | None = None

    SetExact, GetExact = accessors(
        "Exact",
        "_exact",
        "exact",
        "Choose whether colours stay float32; off by default.",
        "Whether colours stay float32.",
        bool,
    )

    def ExactOn(self) -> None:
        """Keep colours as they are."""
        self.SetExact(True)

    def ExactOff(self) -> None:
        """Round colours to bytes."""
        self.SetExact(False)

    SetMaxSupersegments, GetMaxSupersegments = accessors(
        "MaxSupersegments",
        "_max_supersegments",
        "limit",
        "Set the points along z; ``None``, the default, is the longest list.",
        "Return the points along z.",
        _checked_limit,
    )

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Announce the points; how many along z, only the data tell: they are made for that."""
        extent = whole_extent(inputs[0].GetInformationObject(0))
        if extent is not None:
            size = (extent[1] - extent[0] + 1, extent[3] - extent[2] + 1)
            announce(outputs, size, SCALARS[self._exact], self._points_along_z(inputs))
        return 1

    def _points_along_z(self, inputs: Any) -> int:
        if self._max_supersegments is not None:
            return self._max_supersegments
        port = self.GetInputConnection(0, 0)
        port.GetProducer().GetExecutive().Update(port.GetIndex())
        with contextlib.suppress(InvalidVDIError):  # _execute says it
            return longest_list(counts_of(vtkImageData.GetData(inputs[0], 0)))
        return 1

    def _execute(self, inputs: Any, outputs: Any) -> None:
        vdi = vdi_from_image(vtkImageData.GetData(inputs[0], 0))
        dense = vdi_to_dense_image(
            vdi, exact=self._exact, max_supersegments=self._max_supersegments
        )
        vtkImageData.GetData(outputs, 0).ShallowCopy(dense)


def longest_list(counts: NDArray[Any]) -> int:
    """Return the supersegments of the longest list, at least 1."""
    return max(1, int(counts.max(initial=0)))


def _rgba_bytes(vdi: VDI) -> NDArray[np.uint8]:
    alpha = opacity(vdi.optical_depth).astype(np.float32)
    rgba = np.concatenate([vdi.color, alpha[:, None]], axis=1)
    return np.rint(rgba * np.float32(255)).astype(np.uint8)


def _places(offsets: NDArray[np.uint64], counts: NDArray[Any]) -> NDArray[np.int64]:
    """Return the point of each supersegment: z W H + list; lists are points of one slice."""
    n_lists = len(counts)
    lists = np.repeat(np.arange(n_lists, dtype=np.int64), counts)
    rank = np.arange(len(lists), dtype=np.int64) - offsets.astype(np.int64)[lists]
    return rank * n_lists + lists


def _numbers(data: Any, name: str, shape: tuple[int, ...]) -> NDArray[Any]:
    array = data.GetArray(name)
    values = np.zeros(0) if array is None else as_numpy(array)
    if values.shape != shape:
        found = "there is none" if array is None else f"its shape is {values.shape}"
        raise InvalidVDIError(f"the dense form needs an array {name!r} of shape {shape}; {found}")
    return values
