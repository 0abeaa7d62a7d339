"""The types of ``**options`` are those that ``generate`` writes out: all that a function takes."""

from __future__ import annotations

import inspect

import pytest

import pyvista_vdi as pvdi
from pyvista_vdi.extensions.series import keywords
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.options import Deferral, GenerationOptions, QualityTarget, declared

RECORDS = (Classification, GenerationOptions, QualityTarget, Deferral)
LOOK, MADE, DIAL, DEFERRAL = map(set, map(declared, RECORDS))
TAKEN = {
    "Look": LOOK,
    "SetOptions": LOOK | MADE - {"max_supersegments", "precision"},
    "InSituOptions": LOOK | MADE | DEFERRAL,
    "SeriesOptions": LOOK | MADE | DIAL | DEFERRAL,
    "WriterOptions": (LOOK | MADE | DIAL | DEFERRAL | {"client", "spacing", "origin"})
    - {"tolerance", "precision"},
}


@pytest.mark.parametrize("name", TAKEN)
def test_keywords_are_generates(name):
    kinds = {
        key: kind.__forward_arg__ for key, kind in getattr(keywords, name).__annotations__.items()
    }
    assert set(kinds) == TAKEN[name]
    theirs = inspect.signature(pvdi.generate).parameters
    grid = {"spacing", "origin"}
    assert kinds == {key: kinds[key] if key in grid else theirs[key].annotation for key in kinds}
