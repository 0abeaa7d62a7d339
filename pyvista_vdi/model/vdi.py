"""The Volumetric Depth Image: arrays and rules (docs/conventions.md#the-arrays-of-a-vdi)."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi import registry
from pyvista_vdi.errors import InvalidArgumentError, InvalidVDIError, VDIError
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import as_floats, as_number, as_whole, not_taken
from pyvista_vdi.model.packing import Packed8, check_precision, packing_of

if TYPE_CHECKING:
    import os


#: The arrays of supersegments.
_MEDIA = ("front", "back", "color", "optical_depth")
#: What of a camera differs between a view on the screen and one that covers all of a volume.
_LENS = ("view_angle", "use_horizontal_view_angle", "parallel_scale", "window_center")


class ClassifiedValues(Protocol):
    """Values and a transfer function (``model/classify_values.py``)."""

    @property
    def lists(self) -> VDI:
        """Lists of all that is kept, transparent or not."""

    def made(self) -> VDI:
        """Return the arrays, checked."""


class VDI:
    """A view-dependent, piecewise constant stand-in for a classified volume.

    Pixel (x, y) of the generating view V_O, y = 0 at the bottom, owns list ``i = y * W + x``: the
    supersegments ``offsets[i]:offsets[i + 1]``, sorted by depth and disjoint. Each is a
    homogeneous medium between two depths. A VDI is valid or cannot be built, and its arrays are
    read-only.

    Parameters
    ----------
    camera : Camera
        The generating view V_O, with the model transform in it.
    window_size : (int, int)
        W and H: lists along each edge of the viewport.
    offsets : array_like of uint64, shape (W * H + 1,)
        Where each list begins; the last entry is the number n of supersegments.
    front, back : array_like of float32, shape (n,)
        View depth of the two faces less ``depth_origin``, world units; ``front < back``.
    color : array_like of float32, shape (n, 3)
        Straight RGB, 0 to 1.
    optical_depth : array_like of float32, shape (n,)
        tau >= 0 from front to back along the list's centre ray.
    bounds : array_like of float, shape (6,)
        Axis-aligned bounds (x0, x1, y0, y1, z0, z1) of what it was made from, in the model frame;
        medium outside contributes nothing.
    depth_origin : float
        World units, float64; added to every front and back.
    metadata : mapping, optional
        What made it; values that JSON can hold.

    Raises
    ------
    InvalidVDIError
        If an element breaks a rule; the message names the element and the rule.
    """

    camera: Camera
    window_size: tuple[int, int]
    offsets: NDArray[np.uint64]
    front: NDArray[np.float32]
    back: NDArray[np.float32]
    color: NDArray[np.float32]
    optical_depth: NDArray[np.float32]
    bounds: tuple[float, float, float, float, float, float]
    depth_origin: float
    metadata: dict[str, Any]
    #: The packed form of the arrays, not public; ``None`` where they are exact.
    packing: Packed8 | None
    #: What a classified deferred VDI is made of, not public: its arrays are made when asked for.
    values: ClassifiedValues | None = None

    def __init__(
        self,
        camera: Camera,
        window_size: Sequence[int],
        offsets: ArrayLike,
        front: ArrayLike,
        back: ArrayLike,
        color: ArrayLike,
        optical_depth: ArrayLike,
        bounds: ArrayLike,
        *,
        depth_origin: float = 0.0,
        metadata: Mapping[str, Any] | None = None,
    ) -> None:
        self.camera = Camera.from_any(camera)
        self.window_size = check_window_size(window_size)
        self._set_frame(bounds, depth_origin, metadata)
        self.offsets = _array("offsets", offsets, np.uint64, ())
        self.front = _array("front", front, np.float32, ())
        self.back = _array("back", back, np.float32, ())
        self.color = _array("color", color, np.float32, (3,))
        self.optical_depth = _array("optical_depth", optical_depth, np.float32, ())
        self.packing = None
        # Check that the lists' offsets and the arrays' lengths fit together
        width, height = self.window_size
        n_lists, n = width * height, len(self.front)
        if len(self.offsets) != n_lists + 1:
            raise InvalidVDIError(
                f"offsets must have W * H + 1 = {n_lists + 1} entries for {width} x {height} "
                f"lists; got {len(self.offsets)}"
            )
        if self.offsets[0] != 0:
            raise InvalidVDIError(f"offsets[0] must be 0; got {self.offsets[0]}")
        falls = self.offsets[1:] < self.offsets[:-1]
        if falls.any():
            i = int(np.argmax(falls))
            raise InvalidVDIError(
                f"offsets must not decrease; offsets[{i}] = {self.offsets[i]} is followed by "
                f"{self.offsets[i + 1]}"
            )
        for name in _MEDIA:
            if len(getattr(self, name)) != n or self.offsets[-1] != n:
                lengths = [f"{each} has {len(getattr(self, each))}" for each in _MEDIA]
                raise InvalidVDIError(
                    f"offsets[-1] = {self.offsets[-1]} supersegments, but {', '.join(lengths)} "
                    "entries: give each as many"
                )
        self._check_media()

    @classmethod
    def _of_values(cls, values: ClassifiedValues, metadata: Mapping[str, Any]) -> VDI:
        """Return the VDI that a transfer function makes of values; arrays are made later."""
        vdi, lists = cls.__new__(cls), values.lists
        vdi.camera, vdi.window_size = lists.camera, lists.window_size
        vdi._set_frame(lists.bounds, lists.depth_origin, metadata)
        vdi.packing, vdi.values = None, values
        return vdi

    def _set_frame(self, bounds: ArrayLike, depth_origin: Any, metadata: Any) -> None:
        origin, box = as_number(depth_origin), as_floats(bounds)
        if not math.isfinite(origin):
            raise InvalidVDIError(f"depth_origin must be finite; got {depth_origin!r}")
        if not isinstance(metadata, Mapping | None):
            raise InvalidVDIError(f"metadata must be a dictionary; got {type(metadata).__name__}")
        if box.shape != (6,) or not np.isfinite(box).all() or (box[::2] > box[1::2]).any():
            raise InvalidVDIError(
                f"bounds must be six finite numbers x0 <= x1, y0 <= y1, z0 <= z1; got {bounds!r}"
            )
        x0, x1, y0, y1, z0, z1 = box.tolist()
        self.bounds, self.depth_origin = (x0, x1, y0, y1, z0, z1), origin
        self.metadata = dict(metadata or {})

    def __getattr__(self, name: str) -> Any:
        """Make the arrays of a classified VDI."""
        if name not in ("offsets", *_MEDIA) or self.values is None:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        made = self.values.made()
        for array in ("offsets", *_MEDIA):
            setattr(self, array, getattr(made, array))
        return vars(self)[name]

    def __getstate__(self) -> dict[str, Any]:
        """Return what copies and other processes are given: arrays, not what they are made of."""
        arrays = {} if self.values is None else {"offsets": self.offsets}
        return {**vars(self), **arrays, "values": None}

    @property
    def n_supersegments(self) -> int:
        """Number of supersegments in all lists."""
        return int(self.offsets[-1])

    @property
    def counts(self) -> NDArray[np.int64]:
        """Supersegments per list, int64 (H, W), bottom row first."""
        width, height = self.window_size
        starts = self.offsets.view(np.int64)
        counts = starts[1:] - starts[:-1]
        return counts.reshape(height, width)

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays in memory, with those of the packed form where there is one."""
        arrays = [vars(self)[name] for name in ("offsets", *_MEDIA) if name in vars(self)]
        packed = 0 if self.packing is None else self.packing.nbytes
        return sum(array.nbytes for array in arrays) + packed

    @property
    def picture_size(self) -> tuple[int, int]:
        """Width and height of the pictures that it was made for, pixels.

        The plotter's or the window's that was asked for, where lists cover more or a dial has
        chosen them; else :attr:`window_size`.
        """
        return picture_size(self.window_size, self.metadata)

    @property
    def precision(self) -> str:
        """What a supersegment takes on a device and in a file: see :meth:`with_precision`."""
        return "exact" if self.packing is None else self.packing.precision

    def list_at(self, x: int, y: int) -> slice:
        """Return the supersegments of pixel (x, y), y = 0 at the bottom, as a slice."""
        width, height = self.window_size
        if math.isnan(as_whole(x)) or math.isnan(as_whole(y)):
            raise not_taken(x)(f"x and y must be whole numbers of pixels; got {x!r} and {y!r}")
        if not (0 <= x < width and 0 <= y < height):
            raise IndexError(f"pixel ({x}, {y}) is outside the window of {width} x {height}")
        i = y * width + x
        return slice(int(self.offsets[i]), int(self.offsets[i + 1]))

    def equals(self, other: VDI) -> bool:
        """Whether all arrays, the view and the bounds are the same to the last bit."""
        names = ("offsets", *_MEDIA)
        return (
            isinstance(other, VDI)
            and self.camera == other.camera
            and self.window_size == other.window_size
            and self.bounds == other.bounds
            and self.depth_origin == other.depth_origin
            and all(np.array_equal(getattr(self, n), getattr(other, n)) for n in names)
        )

    def with_precision(self, precision: str) -> VDI:
        """Return the VDI with supersegments of fewer bytes, on devices and in ``.vdi`` files.

        With 8 bytes each list that is not empty takes 16 more, so that lists of one supersegment
        save nothing; in this process's memory the packed form lies beside the arrays. These hold
        what it gives back, so that whatever reads them sees what is drawn. docs/conventions.md
        ("Packed supersegments") has the bounds.

        Parameters
        ----------
        precision : {"exact", "8-byte"}
            ``"exact"``: 24 bytes, whatever float32 holds; from a packed VDI, its values.
            ``"8-byte"``: depths in 14 bits of the list's extent, optical depth with 8 significant
            bits, colours in steps of 1/255.

        Returns
        -------
        VDI
            Itself where it has that precision.

        Raises
        ------
        InvalidArgumentError
            If there is no such precision, or a list is too long for 8 bytes (above 16383).
        """
        if check_precision(precision) == self.precision:
            return self
        if precision == "exact":
            return self._with_media(None, {})
        packing = packing_of(self)
        return self._with_media(packing, packing.media(self.counts.reshape(-1)))

    def _with_media(self, packing: Packed8 | None, media: Mapping[str, Any]) -> VDI:
        arrays: dict[str, Any] = {name: media.get(name, getattr(self, name)) for name in _MEDIA}
        about = {"depth_origin": self.depth_origin, "metadata": self.metadata}
        arrays |= {"offsets": self.offsets, "bounds": self.bounds, **about}
        vdi = VDI(self.camera, self.window_size, **arrays)
        vdi.packing = packing
        return vdi

    def save(self, path: str | os.PathLike[str], **options: Any) -> Path:
        """Write a ``.vdi``, ``.exr`` or ``.html`` file that `pyvista_vdi.read` opens.

        The options are those of :func:`pyvista_vdi.io.write`.
        """
        return registry.method("VDI.save")(self, path, **options)  # type: ignore[no-any-return]

    def __repr__(self) -> str:
        width, height = self.window_size
        occupied = int(np.count_nonzero(np.diff(self.offsets)))
        return (
            f"VDI({width} x {height} lists, {occupied} not empty, "
            f"{self.n_supersegments} supersegments, {self.nbytes / 2**20:.1f} MiB)"
        )

    def plot(self, **arguments: Any) -> Any:
        """Show it in a window, from its generating view.

        Parameters
        ----------
        **arguments
            Those of ``volume.vdi.plot``: ``pyvista.plot``'s and ``Plotter.show``'s
            (``off_screen``, ``screenshot``, ``return_img``, ``cpos`` and so on); all others go to
            ``Plotter.add_vdi``. Needs PyVista.

        Returns
        -------
        object
            What ``Plotter.show`` returns.

        Notes
        -----
        The picture is that of :func:`pyvista_vdi.render` to half of 1/255, its rounding, with
        ``anti_aliasing=False``. PyVista's own setting takes eight samples of a pixel: where the
        outline of the bounds crosses a pixel, samples beside it count as empty, as they do for
        VTK's volumes, and the pixel gets a part of its light. In a window of 64 x 48 that was 3
        pixels, by 3.7/255; of the same volume drawn by VTK, 21 pixels, by up to 20/255.

        Examples
        --------
        >>> import pyvista_vdi as pvdi
        >>> pvdi.read("brain.vdi").plot()  # doctest: +SKIP
        """
        return registry.method("VDI.plot")(self, **arguments)

    def _repr_html_(self) -> str | None:
        """Return a thumbnail and the figures, for what shows HTML and no viewer."""
        form = registry.method("VDI._repr_html_", lambda vdi: None)
        return form(self)  # type: ignore[no-any-return]

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> Any:
        """Return what a notebook shows: a viewer, or a picture."""
        forms = registry.method("VDI._repr_mimebundle_", lambda vdi, *_: {"text/plain": repr(vdi)})
        return forms(self, include, exclude)

    def _check_media(self) -> None:
        if len(self.front) == 0:
            return
        front, back, color, tau = self.front, self.back, self.color, self.optical_depth
        # Extremes need no array in between. Comparisons are written so that NaN fails each
        if not (-np.inf < front.min() and back.max() < np.inf):
            self._require(np.isfinite(front) & np.isfinite(back), "front and back finite")
        self._require(front < back, "front < back")
        if not (color.min() >= 0 and color.max() <= 1):
            inside = (color >= 0) & (color <= 1)
            self._require(inside[:, 0] & inside[:, 1] & inside[:, 2], "0 <= color <= 1")
        if not (tau.min() >= 0 and tau.max() < np.inf):
            self._require((tau >= 0) & np.isfinite(tau), "optical_depth >= 0 and finite")
        # Exact comparison: depth in front of the eye is front + depth_origin > 0
        nearest = np.float64(-self.depth_origin)
        if not self.camera.parallel_projection and not front.min() >= nearest:
            self._require(front >= nearest, "in front of the eye (depth >= 0)")
        ordered = np.ones(len(front), dtype=bool)
        np.less_equal(back[:-1], front[1:], out=ordered[1:])
        # None is before a list's first. As int64, which NumPy takes as indices without a copy
        starts = self.offsets[:-1].view(np.int64)
        ordered[starts[: np.searchsorted(starts, len(front))]] = True
        self._require(ordered, "sorted within its list and not overlapping")

    def _require(self, good: NDArray[np.bool_], rule: str) -> None:
        if good.all():
            return
        k = int(np.argmin(good))
        i = int(np.searchsorted(self.offsets, k, side="right")) - 1
        width = self.window_size[0]
        raise InvalidVDIError(
            f"supersegment {k} (list {i}: pixel x={i % width}, y={i // width}) breaks the rule "
            f"'{rule}': front {self.front[k]}, back {self.back[k]}, color {self.color[k]}, "
            f"optical_depth {self.optical_depth[k]}, depth_origin {self.depth_origin}"
        )


def _array(name: str, values: ArrayLike, dtype: Any, item: tuple[int, ...]) -> NDArray[Any]:
    try:
        array = np.asarray(values)
    except (TypeError, ValueError) as error:  # lists of different lengths
        raise InvalidVDIError(f"{name} must be an array of numbers: {error}") from error
    if array.dtype.kind not in "uif":
        if array.size:
            raise InvalidVDIError(
                f"{name} must be numbers, in an array; got {reprlib.repr(values)}, of {array.dtype}"
            )
        array = np.zeros(array.shape, dtype)
    counts = dtype is np.uint64 and array.size > 0
    if counts and (array.dtype.kind == "f" or array.min() < 0):
        raise InvalidVDIError(
            f"{name} must be whole numbers >= 0, of an integer type; got {array.min()} among "
            f"numbers of {array.dtype}"
        )
    with np.errstate(over="ignore"):  # infinite then: a rule refuses it, and says where
        array = np.ascontiguousarray(array, dtype=dtype)
    if array.size == 0 and item:
        array = array.reshape((0, *item))
    if array.ndim != 1 + len(item) or array.shape[1:] != item:
        wanted = f"(n, {item[0]})" if item else "(n,)"
        raise InvalidVDIError(f"{name} must have shape {wanted}; got {array.shape}")
    view = array.view()  # the caller's own array stays writable
    view.setflags(write=False)
    return view


def picture_size(window_size: tuple[int, int], metadata: Mapping[str, Any]) -> tuple[int, int]:
    """Return :attr:`VDI.picture_size` of a VDI of these lists and metadata."""
    for what in ("screen", "dial"):
        try:
            return check_window_size(metadata[what]["window_size"])
        except (TypeError, KeyError, InvalidArgumentError):  # none, or what somebody has put
            continue
    return window_size


def screen_metadata(camera: Camera, window_size: tuple[int, int]) -> dict[str, Any]:
    """Return what metadata say of the view on the screen whose volume a wider window covers."""
    lens = {name: getattr(camera, name) for name in _LENS}
    return {"window_size": list(window_size), **lens, "window_center": list(camera.window_center)}


def picture_view(vdi: Any) -> tuple[Camera, tuple[int, int]]:
    """Return the view that a VDI, or one of several, was made for, and the size of its picture.

    That on the screen, where the lists cover all of a volume.
    """
    screen: Any = getattr(vdi, "metadata", {}).get("screen")
    camera, size = vdi.camera, getattr(vdi, "picture_size", vdi.window_size)
    try:
        return camera.replace(**{name: screen[name] for name in _LENS}), size
    except (TypeError, KeyError, VDIError):  # none, or what somebody has put
        return camera, size
