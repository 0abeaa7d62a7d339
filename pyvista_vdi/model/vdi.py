"""The Volumetric Depth Image: arrays and rules (docs/dev/conventions.md#the-arrays-of-a-vdi)."""

from __future__ import annotations

import math
import os
import reprlib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi import registry
from pyvista_vdi.errors import InvalidVDIError, UnsupportedError, VDIError
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import as_bounds, as_number, as_range, as_whole, one_of
from pyvista_vdi.model.packing import PRECISIONS, Arrays, Packed8, packing_of
from pyvista_vdi.model.transfer_function import TransferFunction

#: What of a camera differs between a view on the screen and one that covers all of a volume.
LENS = ("view_angle", "use_horizontal_view_angle", "parallel_scale", "window_center")

#: Cells of the tables that a transfer function is integrated in, over the range of values: a window
#: of a fiftieth of it has 327.
CELLS = 1 << 14

#: Whole numbers of this stand for opacities on devices: sums over all cells stay below 2^63.
_UNITS = 2.0**40


class Lists:
    """A view, and sorted lists of disjoint supersegments along its rays: see :class:`VDI`."""

    camera: Camera
    window_size: tuple[int, int]
    bounds: tuple[float, float, float, float, float, float]
    depth_origin: float
    metadata: dict[str, Any]
    #: What makes the arrays when they are asked for, by its ``arrays()``, not public: lists on the
    #: device that made them, 8-byte supersegments, or values and a transfer function.
    late: Any
    _arrays: Arrays | None

    @property
    def arrays(self) -> Arrays:
        """All arrays, in the order of :class:`VDI`'s arguments; made now if they are not yet."""
        if self._arrays is None:
            self._arrays = _read_only(self.late.arrays())
        return self._arrays

    @property
    def offsets(self) -> NDArray[np.uint64]:
        """Where each list begins, uint64 (W * H + 1,); the last entry is their number n."""
        known = getattr(self.late, "offsets", None)
        return self.arrays.offsets if known is None else known

    @property
    def front(self) -> NDArray[np.float32]:
        """View depth of the front faces less ``depth_origin``, world units, float32 (n,)."""
        return self.arrays.front

    @property
    def back(self) -> NDArray[np.float32]:
        """View depth of the back faces less ``depth_origin``, world units, float32 (n,)."""
        return self.arrays.back

    @property
    def n_supersegments(self) -> int:
        """Number of supersegments in all lists."""
        known = getattr(self.late, "n_supersegments", None)
        return int(self.offsets[-1]) if known is None else known

    @property
    def counts(self) -> NDArray[np.int64]:
        """Supersegments per list, int64 (H, W), bottom row first."""
        return np.diff(self.offsets).astype(np.int64).reshape(self.window_size[::-1])

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays, with those of the packed form, or of what makes them when asked."""
        if self._arrays is None:
            return getattr(self.late, "nbytes", 0)
        return sum(array.nbytes for array in self._arrays) + getattr(self.packing, "nbytes", 0)

    @property
    def packing(self) -> Packed8 | None:
        """The lists' 8-byte form, not public; ``None`` where they are exact."""
        return self.late if isinstance(self.late, Packed8) else None

    @property
    def precision(self) -> str:
        """What a supersegment takes on a device and in a file: see :meth:`VDI.with_precision`."""
        return "exact" if self.packing is None else "8-byte"

    @property
    def picture_size(self) -> tuple[int, int]:
        """Width and height of the pictures that it was made for, pixels.

        The plotter's or the window's that was asked for, where lists cover more or a dial has
        chosen them; else :attr:`window_size`.
        """
        return picture_view(self)[1]

    def equals(self, other: Any) -> bool:
        """Whether all arrays, the view, the bounds and the range are the same to the last bit."""
        names = ("camera", "window_size", "bounds", "depth_origin", "about")
        return (
            type(other) is type(self)
            and all(getattr(self, n, None) == getattr(other, n, None) for n in names)
            and all(map(np.array_equal, self.arrays, other.arrays))  # type: ignore[arg-type]
        )

    def save(self, path: str | os.PathLike[str], **options: Any) -> Path:
        """Write a file that `pyvista_vdi.read` opens: ``.vdi``, ``.html``, or ``.exr``.

        The options are those of :func:`pyvista_vdi.io.write`. A page of a :class:`DeferredVDI`
        has an editor of its transfer function, which begins with what is given here:
        ``kept.save("brain.html", cmap="bone", opacity="sigmoid")``. An ``.exr`` holds colours.
        """
        return registry.method("VDI.save")(self, path, **options)  # type: ignore[no-any-return]

    def __getstate__(self) -> dict[str, Any]:
        """Return what copies and other processes are given: words of 8 bytes, or arrays."""
        arrays = None if self.packing else self.arrays
        return {**vars(self), "_arrays": arrays, "late": self.packing}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._arrays = self._arrays and _read_only(self._arrays)  # NumPy's copies can be written

    def __repr__(self) -> str:
        width, height = self.window_size
        occupied = int(np.count_nonzero(self.counts))
        return (
            f"{type(self).__name__}({width} x {height} lists, {occupied} not empty, "
            f"{self.n_supersegments} supersegments, {self.nbytes / 2**20:.1f} MiB)"
        )

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> Any:
        """Return what a notebook shows: a viewer, or a picture."""
        forms = registry.method("VDI._repr_mimebundle_", lambda vdi, *_: {"text/plain": repr(vdi)})
        return forms(self, include, exclude)


class VDI(Lists):
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
        origin = as_number(depth_origin)
        if not math.isfinite(origin):
            raise InvalidVDIError(f"depth_origin must be finite; got {depth_origin!r}")
        if not isinstance(metadata, Mapping | None):
            raise InvalidVDIError(f"metadata must be a dictionary; got {type(metadata).__name__}")
        self.bounds, self.depth_origin = as_bounds(bounds, InvalidVDIError), origin
        self.metadata = dict(metadata or {})
        given = (offsets, front, back, color, optical_depth)
        self._arrays, self.late = _read_only(Arrays(*map(_array, Arrays._fields, given))), None
        _check(self)

    @property
    def color(self) -> NDArray[np.float32]:
        """Straight RGB, 0 to 1, float32 (n, 3)."""
        return self.arrays.color

    @property
    def optical_depth(self) -> NDArray[np.float32]:
        """From front to back along the list's centre ray, float32 (n,)."""
        return self.arrays.optical_depth

    def list_at(self, x: int, y: int) -> slice:
        """Return the supersegments of pixel (x, y), y = 0 at the bottom, as a slice."""
        width, height = self.window_size
        if not (0 <= as_whole(x) < width and 0 <= as_whole(y) < height):
            raise IndexError(f"there is no pixel ({x!r}, {y!r}) in {width} x {height}")
        i = y * width + x
        return slice(int(self.offsets[i]), int(self.offsets[i + 1]))

    def with_precision(self, precision: str) -> VDI:
        """Return the VDI with supersegments of fewer bytes, on devices and in ``.vdi`` files.

        With 8 bytes each list that is not empty takes 16 more, so that lists of one supersegment
        save nothing. The arrays hold what the packed form gives back, so that whatever reads them
        sees what is drawn. docs/dev/conventions.md ("Packed supersegments") has the bounds.

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
        if one_of(precision, "precision", PRECISIONS) == self.precision:
            return self
        exact = precision == "exact"
        return made_vdi(self.arrays if exact else packing_of(self.arrays, _nearest(self)), self)


class DeferredVDI(Lists):
    """A VDI whose supersegments keep the mean and the spread of the values along the ray.

    It is a view-dependent stand-in for a volume that has not been classified yet:
    :meth:`classified` makes an ordinary :class:`VDI` of it for any transfer function, without the
    volume. Lists, depths and bounds are those of a :class:`VDI`. It is valid or cannot be built,
    and its arrays are read-only.

    Made by :func:`pyvista_vdi.generate` with ``classification="deferred"``, and read from files.

    Parameters
    ----------
    lists : VDI
        Its lists. In the place of colours are the mean by length of the values, as a share of
        ``value_range``, what of it is left below its float32 or byte, and the share of the length
        that holds values of the range, which is below 1 where a gap had to be covered to keep the
        list's budget. In the place of the optical depth is the standard deviation by length, as a
        share of ``value_range``, 0 to 1/2.
    about : mapping
        ``value_range``, the least and the largest value that it keeps; ``unit_distance``, the
        opacity unit distance of a transfer function that has none of its own, and
        ``sample_distance``, the step of the march that made it, by whose opacity values are
        averaged, model units; ``version``, 1.

    Raises
    ------
    InvalidVDIError
        If something breaks a rule; the message names it and the rule.
    """

    value_range: tuple[float, float]
    unit_distance: float
    sample_distance: float

    def __init__(self, lists: VDI, about: Mapping[str, Any]) -> None:
        version = about.get("version") if isinstance(about, Mapping) else about
        if version != 1:
            raise InvalidVDIError(
                f"its values are of version {version!r}, and this program reads version 1: "
                "upgrade by pip install -U pyvista-vdi"
            )
        if not (lists.optical_depth <= 0.5).all():
            k = int(np.argmax(lists.optical_depth))
            raise InvalidVDIError(
                f"supersegment {k} breaks the rule '0 <= spread <= 0.5': {lists.optical_depth[k]}"
            )
        ends = about.get("value_range")
        low, high = self.value_range = as_range(ends)
        if not -math.inf < low < high < math.inf:
            raise InvalidVDIError(
                f"value_range must be two finite numbers, low < high; got {ends!r}"
            )
        #: What is stored beside :attr:`lists`, in values that JSON can hold.
        self.about: dict[str, Any] = {"version": 1, "value_range": [low, high]}
        for name in ("unit_distance", "sample_distance"):
            length = self.about[name] = as_number(about.get(name))
            if not 0 < length < np.inf:
                raise InvalidVDIError(f"{name} must be a length above 0; got {about.get(name)!r}")
            setattr(self, name, length)
        self.about["importance"] = None  # older files say what counted most when lists were cut
        vars(self).update(vars(lists))

    @property
    def lists(self) -> VDI:
        """Its lists in the form of a VDI, for storage: colours are no colours (docs/files.md)."""
        return made_vdi(self.late or self.arrays, self)

    @cached_property
    def mean(self) -> NDArray[np.float32]:
        """Mean by length, as a share of the range of values, float32 (n,)."""
        color = self.arrays.color
        mean = color[:, 0]
        if self.precision != "exact":  # two bytes: what is left below the first is in the second
            mean = np.minimum(mean + color[:, 1] / np.float32(255), np.float32(1))
        mean.setflags(write=False)
        return mean

    @property
    def spread(self) -> NDArray[np.float32]:
        """Standard deviation by length, as a share of the range of values, float32 (n,)."""
        return self.arrays.optical_depth

    @property
    def share(self) -> NDArray[np.float32]:
        """Share of the length that holds values of the range, float32 (n,)."""
        return self.arrays.color[:, 2]

    @cached_property
    def steps(self) -> NDArray[np.float32]:
        """Steps of the march through what each supersegment holds, float32 (n,)."""
        length = lengths_of(self) / self.sample_distance
        return (length * self.share).astype(np.float32)

    def with_precision(self, precision: str) -> DeferredVDI:
        """Return it with supersegments of fewer bytes: ``"exact"``, ``"8-byte"``.

        In 8 bytes depths have 14 bits of the list's extent, the mean 3825 steps over the range of
        values, the spread 4 significant bits and the share 8 bits.
        """
        if one_of(precision, "precision", PRECISIONS) == self.precision:
            return self
        mean = self.mean.astype(np.float64)
        low, spread = np.zeros_like(mean), self.spread
        if precision == "8-byte":
            # Fewer codes than there is room for, which compress better: 255 * 15, and 4 bits
            whole = np.round(mean * 3825)
            mean, low = whole // 15 / 255, whole % 15 / 15
            fraction, exponent = np.frexp(spread)
            spread = np.ldexp(np.round(fraction * 16) / 16, exponent)
        color = np.stack([mean, low, self.share], axis=1).astype(np.float32)
        plain = made_vdi(self.arrays._replace(color=color, optical_depth=spread), self)
        return DeferredVDI(plain.with_precision(precision), self.about)

    def classified(self, **look: Any) -> VDI:
        """Return the VDI that a transfer function makes of it, without the volume.

        Parameters
        ----------
        **look
            Those of :func:`pyvista_vdi.generate`, with its names and defaults: ``cmap``,
            ``opacity``, ``clim`` (the range of values by default), ``n_colors``,
            ``flip_scalars``, ``log_scale``, ``opacity_unit_distance``; or ``volume_property`` or
            ``transfer_function`` in place of them. And ``device``, where it is computed: by
            default as for :func:`pyvista_vdi.render`.

        Returns
        -------
        VDI
            What is transparent is left out.

        Raises
        ------
        UnsupportedError
            If the transfer function asks for light or gradient opacity, which no list knows.
        """
        return registry.method("DeferredVDI.classified")(self, look)  # type: ignore[no-any-return]

    def __repr__(self) -> str:
        low, high = self.value_range
        return f"{super().__repr__()[:-1]}, {low:g} to {high:g})"


def made_vdi(arrays: Any, like: Lists | None = None, **attributes: Any) -> VDI:
    """Return a VDI of ``Arrays`` that this package made, or of what makes them; not checked.

    Attributes that are not given are those of ``like``.
    """
    vdi = VDI.__new__(VDI)
    for name in ("camera", "window_size", "bounds", "depth_origin", "metadata"):
        setattr(vdi, name, attributes[name] if name in attributes else getattr(like, name))
    vdi.metadata = dict(vdi.metadata)
    exact = isinstance(arrays, Arrays)
    vdi._arrays, vdi.late = (_read_only(arrays), None) if exact else (None, arrays)
    return vdi


def _nearest(vdi: VDI) -> float:
    """Return the least front that is before the eye."""
    return -math.inf if vdi.camera.parallel_projection else -vdi.depth_origin


def _array(name: str, values: ArrayLike) -> NDArray[Any]:
    """Return an array of a VDI by its name, of its type and shape, or raise InvalidVDIError."""
    dtype: Any = np.uint64 if name == "offsets" else np.float32
    item = (3,) if name == "color" else ()
    try:
        given = np.asarray(values)
    except (TypeError, ValueError) as error:  # lists of different lengths
        raise InvalidVDIError(f"{name} must be an array of numbers: {error}") from error
    if given.size == 0:
        given = np.zeros((0, *item), dtype)
    whole = given.dtype.kind == "u" or (given.dtype.kind == "i" and given.min() >= 0)
    fits = whole if dtype is np.uint64 else given.dtype.kind in "uif"
    if not fits or given.ndim != 1 + len(item) or given.shape[1:] != item:
        wanted = "whole numbers >= 0" if dtype is np.uint64 else "numbers"
        raise InvalidVDIError(
            f"{name} must be {wanted}, in an array of shape {'(n, 3)' if item else '(n,)'}; got "
            f"{reprlib.repr(values)}, {given.dtype} of shape {given.shape}"
        )
    with np.errstate(over="ignore"):  # infinite then: a rule refuses it, and says where
        return np.ascontiguousarray(given, dtype=dtype)


def _read_only(arrays: Arrays) -> Arrays:
    """Return views that cannot be written; the caller's own arrays stay writable."""
    given: Any = arrays
    views = Arrays(*map(np.ndarray.view, given))
    for view in views:
        view.setflags(write=False)
    return views


def _check(vdi: VDI) -> None:
    """Raise InvalidVDIError for the first rule that an element breaks."""
    offsets, front, back, color, tau = arrays = vdi.arrays
    (width, height), n = vdi.window_size, len(front)
    lengths = dict(zip(Arrays._fields[1:], map(len, arrays[1:]), strict=True))
    ends = len(offsets) == width * height + 1 and offsets[0] == 0 and offsets[-1] == n
    if not ends or (offsets[1:] < offsets[:-1]).any() or {*lengths.values()} != {n}:
        raise InvalidVDIError(
            f"offsets must be W * H + 1 = {width * height + 1} numbers that never decrease, from 0 "
            f"to the number of supersegments, which every other array has; got {len(offsets)}, "
            f"{offsets}, and lengths {lengths}"
        )
    # Check each supersegment. Comparisons are written so that NaN fails them
    ordered = np.ones(n, dtype=bool)
    np.less_equal(back[:-1], front[1:], out=ordered[1:])
    starts = offsets[:-1].view(np.int64)  # which NumPy takes as indices without a copy
    ordered[starts[: np.searchsorted(starts, n)]] = True  # none is before a list's first
    for rule, good in {
        "front and back finite": np.isfinite(front) & np.isfinite(back),
        "front < back": front < back,
        "0 <= color <= 1": ((color >= 0) & (color <= 1)).all(axis=1),
        "optical_depth >= 0 and finite": (tau >= 0) & np.isfinite(tau),
        "in front of the eye (depth >= 0)": front >= np.float64(_nearest(vdi)),  # exactly
        "sorted within its list and not overlapping": ordered,
    }.items():
        if not good.all():
            k = int(np.argmin(good))
            i = int(np.searchsorted(offsets, k, side="right")) - 1
            raise InvalidVDIError(
                f"supersegment {k} (list {i}: pixel x={i % width}, y={i // width}) breaks the "
                f"rule '{rule}': front {front[k]}, back {back[k]}, color {color[k]}, "
                f"optical_depth {tau[k]}, depth_origin {vdi.depth_origin}"
            )


def lengths_of(lists: Lists) -> NDArray[np.float64]:
    """Return the model length of each supersegment along its list's centre ray, float64 (n,)."""
    per_depth = length_per_depth(lists.camera, lists.window_size)
    thickness = lists.back.astype(np.float64) - lists.front
    return thickness * np.repeat(per_depth.ravel(), lists.counts.ravel())


def length_per_depth(
    camera: Camera, window: tuple[int, int], *pixels: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return model lengths of a world unit of depth along the rays of pixels x, y; (y, x).

    Of all pixels of the window by default.
    """
    x, y = pixels or map(np.arange, window)
    u, v = (2 * x + 1) / window[0] - 1, (2 * y + 1) / window[1] - 1
    constant, along_u, along_v = camera.ray_coefficients(window)[1] @ (
        np.linalg.inv(camera.model_to_view)[:3, :3].T
    )
    return np.linalg.norm(
        constant + u[:, np.newaxis] * along_u + v[:, np.newaxis, np.newaxis] * along_v, axis=-1
    )


def picture_view(shown: Any) -> tuple[Camera, tuple[int, int]]:
    """Return the view that a VDI, or one of several, was made for, and the size of its picture.

    That on the screen, where the lists cover all of a volume; the size that a dial was given.
    """
    camera, size, metadata = shown.camera, shown.window_size, getattr(shown, "metadata", {})
    for what in ("dial", "screen"):
        with suppress(TypeError, KeyError, VDIError):  # none, or what somebody has put
            size = check_window_size(metadata[what]["window_size"])
    with suppress(TypeError, KeyError, VDIError):
        camera = camera.replace(**{name: metadata["screen"][name] for name in LENS})
    return camera, size


def classification_of(
    deferred: DeferredVDI, transfer_function: TransferFunction
) -> tuple[NDArray[np.float32], dict[str, Any]]:
    """Return what kernels take of a transfer function, and a classified VDI's metadata.

    Float32 (CELLS + 2, 2, 4): the low end of the range, then the integrals over cells up to each,
    in pairs of a large part and what it leaves (docs/dev/conventions.md).
    """
    for name, asked in (
        ("shading", transfer_function.shading),
        ("gradient opacity", transfer_function.gradient_opacities),
    ):
        if asked is not None:
            raise UnsupportedError(
                f"{name} needs gradients, which a DeferredVDI does not keep: leave it out, or "
                "generate with the transfer function and classification='baked'"
            )

    # Look up colours and opacities at the low end of the range and in cells of it
    low, high = deferred.value_range
    values = low + (np.arange(-1, CELLS) + 0.5).clip(0) / CELLS * (high - low)
    first, last = transfer_function.scalar_range
    nodes = np.arange(len(transfer_function.opacities))
    place = np.where(values > last, nodes[-1], 0.0)
    if last > first:
        place = (values - first) / (last - first) * nodes[-1]
    columns = (*transfer_function.colors.T, transfer_function.opacities)
    *rgb, opacity = (np.interp(place, nodes, each.astype(np.float64)) for each in columns)
    # Sum up a step's opacity, and the colour times it, in whole numbers: where nothing is added,
    # nothing changes
    unit = transfer_function.unit_distance or deferred.unit_distance
    with np.errstate(divide="ignore"):
        of_step = -np.expm1(np.log1p(-opacity) * deferred.sample_distance / unit)
    of_cells = np.stack([*(of_step * each for each in rgb), of_step], axis=1)
    units = np.rint(of_cells * _UNITS).astype(np.int64)
    whole = np.concatenate([units[:1], 0 * units[:1], units[1:].cumsum(axis=0)]) / _UNITS
    large = whole.astype(np.float32)
    integrals = np.stack([large, (whole - large).astype(np.float32)], axis=1)
    metadata = {
        **deferred.metadata,
        "opacity_unit_distance": unit,
        "transfer_function": transfer_function.to_dict(),
        "deferred": {**deferred.about, "value_range": [*deferred.value_range]},
    }
    return integrals, metadata
