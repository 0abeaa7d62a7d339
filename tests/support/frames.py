"""Where the steps of ``.vdis`` and ``.vdiset`` files are."""

from __future__ import annotations

from pyvista_vdi.series.layout import HEADER_BYTES, STEP, FrameHeader


def frames_of(data):
    """Return for each step where its content begins, and its header."""
    frames, at = [], data.find(STEP)
    while at >= 0:
        header = FrameHeader.of_bytes(data[at : at + HEADER_BYTES])
        at += 1 if header is None else HEADER_BYTES
        if header is not None:
            frames.append((at, header))
            at += header.n_bytes
        at = data.find(STEP, at)
    return frames
