"""Classify a deferred VDI by the words of ``add_volume``."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.classification import Classification, refuse_unknown
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.options import declared
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.classified_values import classify_on_device

#: What says which scalars were seen, and how: that was said where they were kept.
_SAID_BEFORE = ("scalars", "preference", "interpolation")


def classified(deferred: DeferredVDI, look: Mapping[str, Any]) -> VDI:
    """Return what :meth:`DeferredVDI.classified` does."""
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
    ends = deferred.value_range
    values: Any = SimpleNamespace(array=np.array(ends), rgba=False, finite_range=lambda: ends)
    table = asked.transfer_function_of(values)
    return classify_on_device(deferred, table, look.get("device"))
