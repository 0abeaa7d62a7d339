"""What is installed and what is missing, for a report of a defect: ``pvdi.Report()``."""

from __future__ import annotations

import html
import platform
import re
from importlib import metadata

from packaging.requirements import Requirement

from pyvista_vdi._version import __version__
from pyvista_vdi.device.choice import describe_devices
from pyvista_vdi.errors import VDIError

#: Extras for those who work on this project, which nobody else misses.
_FOR_DEVELOPERS = ("browser", "dev", "docs", "fuzz", "ome-zarr", "qt", "test")
_EXTRA = re.compile(r"""extra\s*==\s*["']([\w-]+)["']""")


class Report:
    """Devices, drivers, versions, and what is missing; needs neither VTK nor PyVista.

    Attributes
    ----------
    devices : str
        What :func:`pyvista_vdi.describe_devices` says, or why it cannot.
    packages : dict of str to (str or None)
        Version of every package that is needed, or that an extra brings; ``None`` where it is
        missing.
    missing : dict of str to list of str
        By extra (``""``: needed always), packages that are not here, or are too old.

    Examples
    --------
    >>> import pyvista_vdi as pvdi
    >>> print(pvdi.Report())  # doctest: +SKIP
    """

    devices: str
    packages: dict[str, str | None]
    missing: dict[str, list[str]]

    def __init__(self) -> None:
        try:
            self.devices = describe_devices()
        except VDIError as error:
            self.devices = str(error)
        self.packages, self.missing = {}, {}
        for extra, required in _requirements():
            found = _version(required.name)
            self.packages[required.name] = found
            if found is None or not required.specifier.contains(found, prereleases=True):
                self.missing.setdefault(extra, []).append(f"{required.name}{required.specifier}")

    def __repr__(self) -> str:
        lines = [
            f"pyvista-vdi {__version__}",
            f"Python {platform.python_version()} ({platform.python_implementation()})",
            f"{platform.platform()}, {platform.machine()}",
            "",
            "OpenCL devices",
            *(f"  {line}" for line in self.devices.splitlines()),
            "",
            "Packages",
        ]
        width = max(map(len, self.packages), default=0)
        for name in sorted(self.packages, key=str.lower):
            lines.append(f"  {name:{width}}  {self.packages[name] or 'missing'}")
        lines += ["", "Missing" if self.missing else "Nothing is missing."]
        for extra, names in self.missing.items():
            remedy = f"[{extra}]" if extra else ""
            lines.append(f'  {", ".join(names)}: pip install "pyvista-vdi{remedy}"')
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(repr(self))}</pre>"


def _requirements() -> list[tuple[str, Requirement]]:
    """Return (extra or "", requirement) of what this installation's metadata names for here."""
    found = []
    for text in metadata.requires("pyvista-vdi") or ():
        required = Requirement(text)
        extra = _EXTRA.search(str(required.marker or ""))
        name = extra[1] if extra else ""
        if name in _FOR_DEVELOPERS or required.name == "pyvista-vdi":
            continue
        if required.marker is None or required.marker.evaluate({"extra": name}):
            found.append((name, required))
    return found


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None
