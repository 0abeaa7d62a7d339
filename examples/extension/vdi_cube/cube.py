"""Reads a density from a cube file: its grid, and a value for each of its points."""

from pathlib import Path

import numpy as np

from pyvista_vdi import InvalidVolumeError, Volume


def read(path: Path) -> Volume:
    """Read the density in a cube file; lengths are Bohr radii."""
    try:
        lines = Path(path).read_text(encoding="utf-8").splitlines()
        n_atoms, *origin = (float(word) for word in lines[2].split()[:4])
        counts, steps = [], []
        for line in lines[3:6]:
            count, *step = line.split()
            counts.append(int(count))
            steps.append([float(number) for number in step])
        values = " ".join(lines[6 + abs(int(n_atoms)) :]).split()
        # Here x is the slowest, and in a Volume the fastest
        array = np.array(values, np.float32).reshape(counts).transpose()
    except (OSError, ValueError, IndexError) as error:
        raise InvalidVolumeError(f"{path} is no cube file ({error}): write it anew") from error
    spacing = np.linalg.norm(steps, axis=1)
    direction = (np.array(steps) / spacing[:, None]).T
    return Volume(np.ascontiguousarray(array), spacing, origin, direction, name="density")
