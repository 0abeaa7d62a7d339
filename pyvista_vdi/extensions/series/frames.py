"""Finds the frames of a file of steps: by its index, or one behind the other where it has none."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable

from pyvista_vdi.extensions.series import layout
from pyvista_vdi.extensions.series.layout import FrameHeader

#: Where each step's frame begins, and its header.
Frames = list[tuple[int, FrameHeader]]

#: Returns so many bytes of the file from a place on, fewer at its end.
Read = Callable[[int, int], bytes]

#: Bytes that are searched at a time.
_WINDOW = 1 << 20


def indexed(read: Read, begin: int, end: int) -> Frames | None:
    """Return the frames that the index names; None where there is none, or it is damaged."""
    size = layout.TRAILER.size
    data = read(max(0, end - size), size)
    if len(data) < size:
        return None
    at, magic = layout.TRAILER.unpack(data)
    if magic != layout.TRAILER_MAGIC or not begin <= at <= end - size:
        return None
    header = FrameHeader.of_bytes(read(at, layout.HEADER_BYTES))
    if header is None or header.what != layout.INDEX:
        return None
    entry = layout.ENTRY.size + layout.HEADER_BYTES
    content_at = at + layout.HEADER_BYTES
    if header.n_bytes != header.number * entry or content_at + header.n_bytes > end:
        return None
    content = read(content_at, header.n_bytes)
    if zlib.crc32(content) != header.checksum:
        return None
    frames: Frames = []
    last = begin
    for k in range(header.number):
        (place,) = layout.ENTRY.unpack_from(content, k * entry)
        step = FrameHeader.of_bytes(content[k * entry + layout.ENTRY.size : (k + 1) * entry])
        if step is None or place != last or not _follows(step, frames):
            return None
        last = place + layout.HEADER_BYTES + step.n_bytes
        frames.append((int(place), step))
    return frames if last == at else None


def found_between(read: Read, begin: int, end: int) -> Frames:
    """Return the frames that are there whole, found one behind the other."""
    frames: Frames = []
    place: int | None = begin
    while place is not None:
        header = FrameHeader.of_bytes(read(place, layout.HEADER_BYTES))
        if header is None or not _follows(header, frames):
            place = _next(read, place + 1, end, frames)
            continue
        behind = place + layout.HEADER_BYTES + header.n_bytes
        if behind > end:
            break  # still being written, or cut off
        frames.append((place, header))
        place = behind
    return frames


def _next(read: Read, place: int, end: int, frames: Frames) -> int | None:
    """Return where the next header is that may follow, behind one that is damaged."""
    overlap = layout.HEADER_BYTES - 1
    while place < end:
        window = read(place, _WINDOW + overlap)
        found = window.find(layout.STEP)
        while found >= 0:
            header = FrameHeader.of_bytes(window[found : found + layout.HEADER_BYTES])
            if header is not None and _follows(header, frames):
                return place + found
            found = window.find(layout.STEP, found + 1)
        place += _WINDOW
    return None


def _follows(header: FrameHeader, frames: Frames) -> bool:
    """Whether a header is one of a step behind these."""
    before = frames[-1][1] if frames else None
    return (
        header.what == layout.STEP
        and header.kind in (layout.VDI_FILE, layout.LISTS, layout.AGAIN)
        and -1 <= header.by < header.number
        and (header.by < 0) <= (header.kind != layout.AGAIN)
        and (header.by >= 0) <= (header.kind != layout.VDI_FILE)
        and math.isfinite(header.time)
        and (before is None or (before.number < header.number and before.time < header.time))
    )
