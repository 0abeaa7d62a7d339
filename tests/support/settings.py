"""Options of public functions in a table, of which some stand in :class:`pyvista_vdi.Settings`."""

from __future__ import annotations

import pyvista_vdi as pvdi


def with_settings(**options):
    """Return options, those that are seldom turned as ``settings``."""
    seldom = {name: options.pop(name) for name in [*options] if name in pvdi.Settings.declared}
    return {**options, "settings": pvdi.Settings(**seldom)} if seldom else options
