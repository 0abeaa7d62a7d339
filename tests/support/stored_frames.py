"""Where the steps of ``.vdis`` and ``.vdiset`` files are."""

from __future__ import annotations

from pyvista_vdi.extensions.series.layout import HEADER_BYTES, STEP, FrameHeader


def frames_of(data):
    """Return for each step where its content begins, and its header."""
    frames, at = [], data.find(STEP)
    while header := FrameHeader.of_bytes(data[at : at + HEADER_BYTES]):
        if header.what != STEP:
            break
        frames.append((at + HEADER_BYTES, header))
        at += HEADER_BYTES + header.n_bytes
    return frames
