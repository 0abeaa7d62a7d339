"""What the folders of extensions add to the core, and what is said where one is missing."""

from __future__ import annotations

import pytest

import pyvista_vdi as pvdi
from pyvista_vdi import registry


def test_what_a_format_needs_is_said_with_its_own_remedy():
    needs = 'lists (pip install "pyvista-vdi[lists]")'
    lists = registry.FileFormat(".lists", "absent_lists", needs=needs)
    message = r"\.lists files need lists \(pip install .* cannot be loaded .*; or use \.vdi files"
    with pytest.raises(pvdi.MissingDependencyError, match=message):
        lists.load()


def test_what_no_extension_has_is_said_by_name():
    with pytest.raises(pvdi.MissingDependencyError, match="by flight is of an extension"):
        registry.generator("flight")
    assert registry.method("VDI.flight", 5) == 5
    assert registry.shown(3) is None
