"""Names of files of data, as the headers of NRRD and MetaImage say them."""

from __future__ import annotations

import re
from collections.abc import Sequence


def names_of(said: str, following: Sequence[str]) -> list[str]:
    """Return the names of the files that hold the data, in order.

    ``said``: a name; a pattern with its first and last number and a step, ``"a%03d.raw 1 9 1"``; or
    ``LIST``, behind which each of the ``following`` lines is a name.
    """
    words = said.split()
    if words[:1] == ["LIST"]:
        return [line.strip() for line in following if line.strip()]
    if len(words) > 3 and re.search(r"%\d*d", words[0]):
        first, last, step = map(int, words[1:4])
        return [words[0] % n for n in range(first, last + (1 if step > 0 else -1), step)]
    return [said.strip()]
