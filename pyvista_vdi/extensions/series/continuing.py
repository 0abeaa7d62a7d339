"""Goes on with a .vdis file that another run has begun, and replaces none by accident."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pyvista_vdi.errors import InvalidArgumentError, VDIFileError
from pyvista_vdi.extensions.series import layout
from pyvista_vdi.extensions.series.reader import StepsReader
from pyvista_vdi.extensions.series.series import check_range, range_of
from pyvista_vdi.io.vdi_file.description import to_json
from pyvista_vdi.model.checks import as_flag
from pyvista_vdi.model.deferred import importance_points
from pyvista_vdi.model.options import Deferral

#: What a VDI's metadata say that must be the same in all steps.
_SAME = ("transfer_function", "lights", "ambient_occlusion")


class Begun(StepsReader):
    """A file with which a writer goes on: the steps that it has, of which there may be none."""

    _LEAST = 0

    @classmethod
    def of(cls, path: Path, append: Any, overwrite: Any) -> Begun | None:
        """Return what there is of a file to go on with; ``None`` if it is to be written anew."""
        append, overwrite = checked_way(append, overwrite)
        if overwrite or not path.exists() or path.stat().st_size == 0:
            return None
        try:
            steps = cls(path)
        except VDIFileError:
            if append:
                raise
            raise refused(path, "") from None
        if not steps.times:
            return None  # there is nothing to lose
        if not append:
            last = steps.times[-1]
            raise refused(path, f" with {len(steps)} steps, the last at time {last:g}")
        if steps._frames[-1][1].number != len(steps) - 1:
            raise VDIFileError(
                f"{path} has lost steps and cannot be gone on with: write what it has to another "
                "file (pyvista-vdi convert), or begin a new one"
            )
        steps.info()  # refused now where it is damaged
        return steps

    @property
    def entries(self) -> list[bytes]:
        """The index so far."""
        return [layout.ENTRY.pack(at) + header.to_bytes() for at, header in self._frames]

    @property
    def end(self) -> int:
        """Where the last step ends."""
        place, last = self._frames[-1]
        return place + layout.HEADER_BYTES + last.n_bytes

    def check_head(self, **given: Any) -> None:
        """Raise InvalidArgumentError if steps would be written in another way."""
        for name, value in given.items():
            if self._head.get(name) != value:
                shown = {"codec": "compression"}.get(name, name)
                raise InvalidArgumentError(
                    f"{self._path} was written with {shown}={self._head.get(name)!r}, and goes on "
                    f"with the same only; got {value!r}"
                )

    def check_kept(self, deferral: Deferral) -> None:
        """Raise InvalidVDIError or InvalidArgumentError if other values would be kept."""
        if deferral.deferred and deferral.value_range is not None:
            check_range(deferral, range_of(self.info()), "this run")
            points = importance_points(deferral.importance, deferral.value_range)
            _check_importance(self._path, self.info(), points)

    def check(self, step: Any) -> None:
        """Raise InvalidArgumentError if a VDI is not of this series."""
        check_goes_on(self._path, self.info(), step)


def checked_way(append: Any, overwrite: Any) -> tuple[bool, bool]:
    """Return both as truth values, or raise InvalidArgumentError if both are asked for."""
    append, overwrite = as_flag(append, "append"), as_flag(overwrite, "overwrite")
    if append and overwrite:
        raise InvalidArgumentError(
            "append=True goes on with a file and overwrite=True replaces it: pass one of them"
        )
    return append, overwrite


def refused(path: Path, with_what: str) -> VDIFileError:
    """Return the error by which a file is kept from being replaced."""
    return VDIFileError(
        f"{path} is there already{with_what}: pass append=True to go on with it, overwrite=True to "
        "replace it, or another name"
    )


def check_goes_on(path: Any, first: Any, step: Any) -> None:
    """Raise InvalidArgumentError if a VDI has another view or classification than one before."""
    pairs = {
        "camera": (first.camera, step.camera),
        "window_size": (tuple(first.window_size), tuple(step.window_size)),
    }
    for name, (before, now) in pairs.items():
        if before != now:
            raise InvalidArgumentError(
                f"{path} cannot be gone on with: its {name} is {before}, and that of this step is "
                f"{now}; give the same, or begin another file"
            )
    check_range(step, range_of(first), "this step")
    _check_importance(path, first, getattr(step, "importance", None))
    for name in _SAME:
        before, now = (json.loads(to_json(vdi.metadata.get(name))) for vdi in (first, step))
        if before != now:
            raise InvalidArgumentError(
                f"{path} cannot be gone on with: its {name.replace('_', ' ')} is another than that "
                "of this step; give the same classification (clim, too), or begin another file"
            )


def _check_importance(path: Any, first: Any, points: Any) -> None:
    """Raise InvalidArgumentError if values are kept by another importance than before."""
    before = getattr(first, "importance", None)
    if points != before:
        raise InvalidArgumentError(
            f"{path} was written with importance={before}, as points (value, weight), and goes on "
            f"with the same only; got {points}"
        )
