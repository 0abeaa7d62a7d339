"""The files of data that the headers of NRRD and MetaImage name."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from pyvista_vdi.errors import InvalidVolumeError


def files_of(folder: Path, said: str, following: Sequence[str]) -> list[Path]:
    """Return the files that hold the data, in order; one that is not there is refused.

    ``said``: a name; a pattern with its first and last number and a step, ``"a%03d.raw 1 9 1"``; or
    ``LIST``, behind which each of the ``following`` lines is a name.
    """
    words, names = said.split(), [said.strip()]
    if words[:1] == ["LIST"]:
        names = [line.strip() for line in following if line.strip()]
    elif len(words) > 3 and re.search(r"%\d*d", words[0]):
        first, last, step = map(int, words[1:4])
        names = [words[0] % n for n in range(first, last + (1 if step > 0 else -1), step)]
    for name in names:
        if not (folder / name).is_file():
            raise InvalidVolumeError(f"its data file {name} is not there: put it beside it")
    return [folder / name for name in names]
