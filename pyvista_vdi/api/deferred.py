"""Classify a deferred VDI by the words of ``add_volume``."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np

from pyvista_vdi.errors import InvalidArgumentError, InvalidVDIError
from pyvista_vdi.model.arguments import refuse_unknown
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.options import declared
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.classified_values import classify_on_device

#: What says which scalars were seen, and how: that was said where they were kept.
_SAID_BEFORE = ("scalars", "preference", "interpolation")


def classified(deferred: DeferredVDI, look: Mapping[str, Any]) -> VDI:
    """Return what :meth:`DeferredVDI.classified` does."""
    return classify_on_device(deferred, _table_of(look, deferred.value_range), look.get("device"))


def classified_each(collection: VDICollection, look: Mapping[str, Any]) -> VDICollection:
    """Return what :meth:`VDICollection.classified` does."""
    ends = collection.value_range
    if ends is None:
        raise InvalidVDIError(
            "these VDIs have colours already: a look is for those that keep values, which "
            "classification='deferred' makes"
        )
    table, device = _table_of(look, ends), look.get("device")
    made: Any = partial(classify_on_device, transfer_function=table, device=device)  # is pickled
    return collection._mapped(made)


def _table_of(look: Mapping[str, Any], ends: tuple[float, float]) -> TransferFunction:
    """Return the transfer function of a look, for values of a range."""
    refuse_unknown(look, "classified", (*declared(Classification), "device"))
    asked = Classification(**{name: value for name, value in look.items() if name != "device"})
    asked.require_composite()
    for name in _SAID_BEFORE:
        if name in asked.given:
            raise InvalidArgumentError(
                f"{name} was said where the values were kept: give it to pyvista_vdi.generate, "
                "and leave it out here"
            )
    # The range of the values stands for those of the volume
    values: Any = SimpleNamespace(array=np.array(ends), rgba=False, finite_range=lambda: ends)
    return asked.transfer_function_of(values)
