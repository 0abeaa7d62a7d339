"""Bytes as a sequence of choices: how every target reads what a fuzzer gives it."""

from __future__ import annotations

import struct
import sys
from collections.abc import Sequence
from typing import Any

#: Numbers at which arithmetic, ranges and types end.
NUMBERS: tuple[Any, ...] = (
    *(0, 1, -1, 2, 3, 7, 16, 255, 256, 65535, 65536, 2**31 - 1, 2**31, 2**32, 2**53 + 1, 2**63),
    *(2**64, 10**30, 0.0, -0.0, 0.5, 1.0, 1e-300, 1e-45, 5e-324, 1e-9, 1e9, 3.5e38, 1e300),
    *(sys.float_info.max, float("inf"), float("-inf"), float("nan")),
)

#: What stands where something else belongs.
JUNK: tuple[Any, ...] = (
    *(*NUMBERS, None, True, False, "", "x", "a\0b", "\x1b[31m", "ü" * 40, "9" * 400),
    *([], {}, [1], [[]], [None, "x", 2.5], [[1, 2], [3]], {"a": 1}, [0] * 7, [1e400] * 3),
)


class Choices:
    """Draws from bytes; when they are used up, everything drawn is the first of its kind.

    Any bytes make sense, and a changed byte changes one choice as a rule.
    """

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.at = 0

    def take(self, n: int) -> bytes:
        """The next n bytes, fewer at the end."""
        piece = self.data[self.at : self.at + n]
        self.at += n
        return piece

    def integer(self, low: int, high: int) -> int:
        """A whole number, both ends included."""
        span = high - low + 1
        size = max(1, ((span - 1).bit_length() + 7) // 8)
        return low + int.from_bytes(self.take(size), "little") % span

    def pick(self, options: Sequence[Any]) -> Any:
        """One of some options; the first where there are no bytes left."""
        return options[self.integer(0, len(options) - 1)]

    def chance(self, one_in: int) -> bool:
        """True once in so many; False where there are no bytes left."""
        return self.integer(0, one_in - 1) == one_in - 1

    def number(self) -> float:
        """A float: one of the hard ones, or any bit pattern."""
        if self.chance(4):
            return float(struct.unpack("<d", self.take(8).ljust(8, b"\0"))[0])
        return float(self.pick(NUMBERS))

    def junk(self) -> Any:
        """Anything that JSON or Python may hold in the wrong place."""
        return self.pick(JUNK)

    def patched(self, content: bytes) -> bytes:
        """Content with some of its bytes changed, cut out, put in or left out at the end."""
        patched = bytearray(content)
        for _ in range(self.integer(0, 6)):
            at = self.integer(0, max(0, len(patched) - 1)) if patched else 0
            kind = self.integer(0, 5)
            if kind == 0:
                patched[at : at + 1] = self.take(1)
            elif kind == 1:
                piece = self.take(self.integer(1, 8))
                patched[at : at + len(piece)] = piece
            elif kind == 2:
                value = self.pick([n for n in NUMBERS if isinstance(n, int)]) % 2**64
                size = self.pick((4, 8, 2, 1))
                patched[at : at + size] = (value % 2 ** (8 * size)).to_bytes(size, "little")
            elif kind == 3:
                patched[at:at] = self.take(self.integer(1, 16))
            elif kind == 4:
                del patched[at : at + self.integer(1, 64)]
            else:
                del patched[at:]
        return bytes(patched)

    def edited(self, value: Any) -> Any:
        """A tree of dictionaries and lists with one of its nodes replaced, removed or repeated."""
        if isinstance(value, dict) and value and not self.chance(6):
            name = self.pick(sorted(value, key=str))
            return self._edited_entry(dict(value), name)
        if isinstance(value, list) and value and not self.chance(4):
            changed = list(value)
            at = self.integer(0, len(value) - 1)
            if self.chance(4):
                del changed[at]
            elif self.chance(4):
                changed.insert(at, changed[at])
            else:
                changed[at] = self.edited(changed[at])
            return changed
        return self.junk()

    def _edited_entry(self, changed: dict[str, Any], name: str) -> dict[str, Any]:
        if self.chance(6):
            del changed[name]
        elif self.chance(6):
            changed[str(self.junk())] = changed[name]
        else:
            changed[name] = self.edited(changed[name])
        return changed
