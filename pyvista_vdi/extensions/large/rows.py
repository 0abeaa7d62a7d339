"""How rows of lists are shared out among those who merge them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

#: Rows of lists are shared out in multiples of this.
ROWS = 4


def balanced(weights: NDArray[np.int64], parts: int) -> Iterator[tuple[int, int]]:
    """Cut rows into ranges of like weight, each of whole groups of four rows but the last."""
    groups = -(-len(weights) // ROWS)
    sums = np.add.reduceat(weights, np.arange(0, len(weights), ROWS)).cumsum()
    wanted = np.arange(1, parts) * (sums[-1] / parts)
    cuts = np.unique([0, *np.searchsorted(sums, wanted, side="right"), groups])
    for first, last in zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True):
        yield first * ROWS, min(last * ROWS, len(weights))
