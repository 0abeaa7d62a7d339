"""Pictures of several frames, GIF, PNG and WebP, by Pillow."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pyvista_vdi.errors import InvalidVolumeError
from pyvista_vdi.io.volumes.in_file import VolumeInFile


def volumes_in(file: Path) -> list[VolumeInFile]:
    """Return frames as slices along z: the top row is the last along y."""
    from PIL import Image, ImageSequence

    with Image.open(file) as picture:
        count = getattr(picture, "n_frames", 1)
        if count < 2:
            raise InvalidVolumeError(
                f"{file} holds one picture: give the folder that holds all slices of the volume"
            )
        frames = [np.asarray(frame.convert("RGBA")) for frame in ImageSequence.Iterator(picture)]
    array = np.stack(frames)[:, ::-1]
    return [VolumeInFile(array, "zyxs")]
