"""What is installed, for a report of a defect: ``pvdi.Report()``."""

from __future__ import annotations

import html
import platform
import re
from importlib import metadata

from pyvista_vdi._version import __version__
from pyvista_vdi.device.choice import describe_devices
from pyvista_vdi.errors import VDIError


class Report:
    """Devices, drivers and versions; needs neither VTK nor PyVista.

    Attributes
    ----------
    devices : str
        What :func:`pyvista_vdi.describe_devices` says, or why it cannot.
    packages : dict of str to str
        Versions of the packages that are needed, or that extras bring, as far as they are here.

    Examples
    --------
    >>> import pyvista_vdi as pvdi
    >>> print(pvdi.Report())  # doctest: +SKIP
    """

    devices: str
    packages: dict[str, str]

    def __init__(self) -> None:
        try:
            self.devices = describe_devices()
        except VDIError as error:
            self.devices = str(error)
        wanted = re.findall(r"^[\w.-]+", "\n".join(metadata.requires("pyvista-vdi") or ()), re.M)
        found = {each.metadata["Name"].lower(): each.version for each in metadata.distributions()}
        self.packages = {n: found[n.lower()] for n in sorted({*wanted}) if n.lower() in found}

    def __repr__(self) -> str:
        return "\n".join(
            (
                f"pyvista-vdi {__version__}, Python {platform.python_version()}",
                f"{platform.platform()}, {platform.machine()}",
                self.devices,
                *(f"{name} {version}" for name, version in self.packages.items()),
            )
        )

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(repr(self))}</pre>"
