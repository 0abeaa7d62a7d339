"""The renderers that the paper compares itself with, as honest test renderers (docs/baselines.md).

Nothing of the product uses them: they are measured beside it, and held against the float64 oracle.
"""

from __future__ import annotations
