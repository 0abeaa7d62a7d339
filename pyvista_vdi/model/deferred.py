"""A VDI that keeps values: its transfer function is chosen afterwards (docs/deferred.md)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi import registry
from pyvista_vdi.errors import InvalidVDIError, UnsupportedError
from pyvista_vdi.model.checks import as_number, as_range, one_of
from pyvista_vdi.model.packing import PRECISIONS, Arrays
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI, Lists, lengths_of, made_vdi

#: Straight colours and optical depths of supersegments.
Media = tuple[NDArray[np.float32], NDArray[np.float32]]

#: Cells of the tables that a transfer function is integrated in, over the range of values: a window
#: of a fiftieth of it has 327.
CELLS = 1 << 14

#: Whole numbers of this stand for opacities on devices: sums over all cells stay below 2^63.
_UNITS = 2.0**40


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

    #: Its lists in the form of a VDI, for storage: colours are no colours (docs/files.md).
    lists: VDI
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
        if lists.n_supersegments and not float(lists.optical_depth.max()) <= 0.5:
            k = int(np.argmax(lists.optical_depth))
            raise InvalidVDIError(
                f"supersegment {k} breaks the rule '0 <= spread <= 0.5': {lists.optical_depth[k]}"
            )
        ends = about.get("value_range")
        low, high = self.value_range = as_range(ends)
        if not (np.isfinite(low) and np.isfinite(high) and low < high):
            raise InvalidVDIError(
                f"value_range must be two finite numbers, low < high; got {ends!r}"
            )
        for name in ("unit_distance", "sample_distance"):
            length = as_number(about.get(name))
            if not 0 < length < np.inf:
                raise InvalidVDIError(f"{name} must be a length above 0; got {about.get(name)!r}")
            setattr(self, name, length)
        for name in ("camera", "window_size", "bounds", "depth_origin", "metadata"):
            setattr(self, name, getattr(lists, name))
        self.lists = lists

    @property
    def about(self) -> dict[str, Any]:
        """What is stored beside :attr:`lists`, in values that JSON can hold."""
        return {
            "version": 1,
            "value_range": list(self.value_range),
            "unit_distance": self.unit_distance,
            "sample_distance": self.sample_distance,
            "importance": None,  # older files say which values counted most when lists were cut
        }

    @cached_property
    def mean(self) -> NDArray[np.float32]:
        """Mean by length, as a share of the range of values, float32 (n,)."""
        color = self.lists.color
        mean = color[:, 0]
        if self.precision != "exact":  # two bytes: what is left below the first is in the second
            mean = np.minimum(mean + color[:, 1] / np.float32(255), np.float32(1))
        mean.setflags(write=False)
        return mean

    @property
    def spread(self) -> NDArray[np.float32]:
        """Standard deviation by length, as a share of the range of values, float32 (n,)."""
        return self.lists.optical_depth

    @property
    def share(self) -> NDArray[np.float32]:
        """Share of the length that holds values of the range, float32 (n,)."""
        return self.lists.color[:, 2]

    @cached_property
    def steps(self) -> NDArray[np.float32]:
        """Steps of the march through what each supersegment holds, float32 (n,)."""
        length = lengths_of(self.lists) / self.sample_distance
        return (length * self.share).astype(np.float32)

    def with_precision(self, precision: str) -> DeferredVDI:
        """Return it with supersegments of fewer bytes: ``"exact"``, ``"8-byte"``.

        In 8 bytes depths have 14 bits of the list's extent, the mean 3825 steps over the range of
        values, the spread 4 significant bits and the share 8 bits.
        """
        if one_of(precision, "precision", PRECISIONS) == self.precision:
            return self
        lists = self.lists
        mean = self.mean.astype(np.float64)
        low, spread = np.zeros_like(mean), lists.optical_depth
        if precision == "8-byte":
            # Fewer codes than there is room for, which compress better: 255 * 15, and 4 bits
            whole = np.round(mean * 3825)
            mean, low = whole // 15 / 255, whole % 15 / 15
            fraction, exponent = np.frexp(spread)
            spread = np.ldexp(np.round(fraction * 16) / 16, exponent)
        color = np.stack([mean, low, self.share], axis=1).astype(np.float32)
        plain = made_vdi(lists.arrays._replace(color=color, optical_depth=spread), lists)
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
        return repr(self.lists).replace("VDI(", "DeferredVDI(")[:-1] + f", {low:g} to {high:g})"


@dataclass(frozen=True, eq=False)
class ValuesLook:
    """Values and the transfer function that a VDI shows of them.

    ``integrals``: what kernels take of a transfer function, float32 (CELLS + 2, 2, 4): the low end
    of the range, then the integrals over cells up to each, in pairs of a large part and what it
    leaves. ``media_of``: what makes straight colours and optical depths of some supersegments.
    """

    deferred: DeferredVDI
    integrals: NDArray[np.float32]
    media_of: Callable[[ValuesLook, Any], Media]

    def arrays(self) -> Arrays:
        """Return the arrays: what is transparent is left out."""
        color, optical_depth = self.media_of(self, slice(None))
        arrays = self.deferred.arrays._replace(color=color, optical_depth=optical_depth)
        rows = np.flatnonzero(optical_depth > 0)
        if len(rows) == len(optical_depth):
            return arrays
        return arrays.take(np.searchsorted(rows, arrays.offsets.view(np.int64)), rows)


def classify(
    deferred: DeferredVDI,
    transfer_function: TransferFunction,
    media_of: Callable[[ValuesLook, Any], Media],
) -> VDI:
    """Return the VDI that a transfer function makes of what is kept (docs/dev/conventions.md).

    The VDI's arrays are made when they are asked for, by ``media_of``; a raycast asks for none.
    Errors are those of :meth:`DeferredVDI.classified`.
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
    table = np.zeros((CELLS + 2, 4), np.int64)
    table[0] = units[0]
    np.cumsum(units[1:], axis=0, out=table[2:])
    whole = table / _UNITS
    large = whole.astype(np.float32)
    integrals = np.stack([large, (whole - large).astype(np.float32)], axis=1)
    metadata = {
        **deferred.metadata,
        "opacity_unit_distance": unit,
        "transfer_function": transfer_function.to_dict(),
        "deferred": deferred.about,
    }
    return made_vdi(ValuesLook(deferred, integrals, media_of), deferred, metadata=metadata)
