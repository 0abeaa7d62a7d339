"""A volume in a store, opened at the level that the view needs, made into a VDI by two processes.

What one should see: a shell of waves in blue and yellow, cut open so that its inside shows.

The store, an OME-Zarr image of three levels, is written by the example itself, a chunk at a time:
it stands for one of terabytes. Nothing here ever holds the volume. The cluster is two processes of
this machine; `Client("tcp://host:8786")` would be any other.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
import zarr
from distributed import Client, LocalCluster

import pyvista_vdi as pvdi
from pyvista_vdi.io.png import to_bytes, write_png

POINTS, CHUNK, SIZE = 192, 48, (640, 480)


def write_store(path: Path) -> None:
    """Write the waves at three resolutions, and the metadata that says so."""
    form = {"zarr_format": 2} if zarr.__version__[0] > "2" else {}  # that of OME-Zarr 0.4
    group = zarr.open_group(str(path), mode="w", **form)
    levels = []
    for level in range(3):
        points, voxel = POINTS >> level, 2.0**level
        shape, chunks = (points,) * 3, (CHUNK,) * 3
        array = zarr.open_array(
            str(path / str(level)), mode="w", shape=shape, chunks=chunks, dtype="f4", **form
        )
        for corner in np.ndindex(*(points // CHUNK,) * 3):
            box = tuple(slice(k * CHUNK, (k + 1) * CHUNK) for k in corner)
            array[box] = waves(*(np.arange(b.start, b.stop) * voxel for b in box))
        scale = {"type": "scale", "scale": [voxel] * 3}
        levels.append({"path": str(level), "coordinateTransformations": [scale]})
    axes = [{"name": name, "type": "space", "unit": "micrometer"} for name in "zyx"]
    group.attrs["multiscales"] = [{"version": "0.4", "axes": axes, "datasets": levels}]


def waves(z: np.ndarray, y: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the values at some points, float32: a shell, open at the top right."""
    z, y, x = (2 * at / POINTS - 1 for at in np.ix_(z, y, x))
    r = np.sqrt(x * x + y * y + z * z)
    field = 140 + 100 * np.sin(9 * x) * np.cos(8 * y + 3 * z)
    shell = np.exp(-(((r - 0.75) / 0.15) ** 2)) * ~((x > 0) & (z > 0) & (y < 0))
    return (field * shell).clip(0, 255).astype(np.float32)


def main() -> None:
    """Write the store, make the VDI, draw it."""
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "large_volume.png")
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder) / "waves.ome.zarr"
        write_store(store)
        camera = pvdi.Camera((330, -345, 300), (96, 96, 96), (0, 0, 1))
        volume = pvdi.read_volume(store).in_view(camera, window_size=SIZE)
        print(volume.describe())
        with (
            LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster,
            Client(cluster) as client,
        ):
            looks = {"cmap": "cividis", "opacity": [0, 0, 0.2, 0.5, 0.9], "clim": (0, 255)}
            vdi = pvdi.generate(volume, camera, SIZE, client=client, **looks)
    picture = pvdi.render(vdi, camera.azimuth(10))
    write_png(to_bytes(picture, (1, 1, 1)), target)
    print(f"{vdi.metadata['blocks']} blocks; {vdi!r}")
    print(f"written: {target}")


if __name__ == "__main__":
    main()
