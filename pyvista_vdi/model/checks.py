"""What callers give for numbers, as numbers: NaN or nothing where it is none.

Range checks that are written so that NaN fails them then refuse it, in the words of the one who
asked for it.
"""

import difflib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError, InvalidArgumentTypeError


def as_float(value: Any) -> float:
    """Return ``value`` as a float, NaN where it is no number: range checks then refuse it."""
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan


def as_number(value: Any) -> float:
    """Return the same, NaN also for text and truth values."""
    return math.nan if isinstance(value, str | bool | np.bool_) else as_float(value)


def as_whole(value: Any) -> float:
    """Return :func:`as_number` of a whole number, NaN where ``value`` is none."""
    number = as_number(value)
    return number if number % 1 == 0 else math.nan


def as_flag(value: Any, name: str) -> bool:
    """Return a truth value, a number or ``None`` as a bool; InvalidArgumentTypeError for others."""
    if isinstance(value, bool | np.bool_ | int | float | np.number | None):
        return bool(value)
    raise InvalidArgumentTypeError(f"{name} must be True or False; got {value!r}")


@dataclass(frozen=True)
class Number:
    """A check of a number from ``low`` to ``high``, finite; without these if ``open_ended``.

    ``of`` says in an error what it is a number of. ``whole``: whether it is a whole number;
    ``below``: whether it must be less than ``high``; ``none``: whether None passes.
    """

    of: str = ""
    low: float = 0
    high: float = math.inf
    whole: bool = False
    open_ended: bool = False
    below: bool = False
    name: str = ""
    none: bool = False

    def __call__(self, value: Any, name: str = "") -> Any:
        """Return a value as a float or an int; raises InvalidArgumentError, which names it."""
        if self.none and value is None:
            return None
        number = as_whole(value) if self.whole else as_number(value)
        at_end = number in (self.low, self.high) and self.open_ended
        at_end = at_end or (number == self.high and self.below)
        if not self.low <= number <= self.high or number == math.inf or at_end:
            wanted = self.of or ("a whole number" if self.whole else "a finite number")
            if self.high < math.inf:
                ends = " from {} to below {}" if self.below else " from {} to {}"
                ends = " between {} and {}" if self.open_ended else ends
                wanted += ends.format(self.low, self.high)
            elif self.low > -math.inf:
                wanted += f" above {self.low}" if self.open_ended else f", {self.low} or above"
            error = InvalidArgumentTypeError if math.isnan(number) else InvalidArgumentError
            raise error(f"{name or self.name} must be {wanted}; got {value!r}")
        return int(number) if self.whole else number


def one_of(value: Any, name: str, names: Sequence[str], none: bool = False) -> Any:
    """Return a text that is one of some, or None where ``none`` is true."""
    if (isinstance(value, str) and value in names) or (none and value is None):
        return value
    error = InvalidArgumentError if isinstance(value, str) else InvalidArgumentTypeError
    near = difflib.get_close_matches(value, names, n=1) if isinstance(value, str) else ()
    hint = f": did you mean {near[0]!r}?" if near else ""
    known = f"one of {', '.join(names[:-1])} and {names[-1]}"
    if len(names) < 3:
        known = " or ".join(map(repr, names))
    raise error(f"{name} must be {known}; got {value!r}{hint}")


def suggestion(name: str, known: Sequence[str], cutoff: float = 0.6) -> str:
    """Return the known name that an unknown one is near to, as a question, or all there are."""
    near = difflib.get_close_matches(name, known, n=1, cutoff=cutoff)
    return f"did you mean {near[0]!r}?" if near else f"known are {', '.join(known)}"


def check_callback(function: Any) -> Any:
    """Return ``progress``; InvalidArgumentTypeError if it is neither a function nor ``None``."""
    if function is not None and not callable(function):
        raise InvalidArgumentTypeError(f"progress must be a function; got {function!r}")
    return function


def as_range(values: Any) -> tuple[float, float]:
    """Return two numbers as floats, NaN where they are no numbers or not two."""
    ends = as_floats(values)
    return tuple(ends.tolist()) if ends.shape == (2,) else (math.nan, math.nan)


def as_floats(values: Any) -> NDArray[np.float64]:
    """Return numbers as a new float64 array, of shape (0,) where they are none."""
    try:
        if np.iscomplexobj(values):
            return np.empty(0)
        return np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        return np.empty(0)


def as_vector(
    value: Any, name: str, length: int = 3, error: type[ValueError] = InvalidArgumentError
) -> Any:
    """Return so many finite numbers as a tuple of floats, or raise an error that names them."""
    vector = as_floats(value)
    if vector.shape != (length,) or not np.isfinite(vector).all():
        raise error(f"{name} must be {length} finite numbers; got {value!r}")
    return tuple(vector.tolist())


def as_bounds(bounds: Any, error: type[ValueError] = InvalidArgumentError) -> Any:
    """Return the bounds of a box as a tuple of floats, or raise an error."""
    box = as_floats(bounds)
    if box.shape != (6,) or not np.isfinite(box).all() or (box[::2] > box[1::2]).any():
        raise error(
            f"bounds must be six finite numbers x0 <= x1, y0 <= y1, z0 <= z1; got {bounds!r}"
        )
    return tuple(box.tolist())
