"""Cases that need an extension: of a file or a verb that one brings."""

from __future__ import annotations

import re

import pytest

#: Ends of files' names, verbs and public names, and the extensions that bring them.
BROUGHT_BY = {
    r"\.exr|\bexr\b": "deep_exr",
    r"\.html|\bhtml\b|\bserve\b": "web",
    r"\.vdis\b|\bseries\b|VDISeries|SeriesWriter|generate_series": "series",
    r"\.vdiset\b|\bset\b|VDISet|generate_set": "sets",
    r"\bparaview\b": "paraview",
    r"InSitu": "insitu",
    r"--scheduler|\bchunks\b": "large",
}


def cases(*values, by=str):
    """Return test cases; those of an extension are skipped where that is deleted.

    ``by`` returns the words of a case.
    """
    return [
        pytest.param(
            *(value if isinstance(value, tuple) else (value,)),
            marks=[
                pytest.mark.extension(name)
                for words, name in BROUGHT_BY.items()
                if re.search(words, by(value))
            ],
        )
        for value in values
    ]
