"""What the level costs that open_volume chooses for a view: SSIM and bytes beside the finest level.

For each volume: an image of OME-Zarr with levels of 1, 2, 4 and 8 voxels, written by its reference
implementation; V_O fills the window; the pictures of both VDIs 30 degrees from V_O are held against
the volume's. Run: ``python benchmarks/store_levels.py --size 64x36 brain bonsai``.
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from pathlib import Path

import pyvista_vdi as pvdi
from pyvista_vdi.cli.declare import parse_size
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS, filling_camera


def written(volume: pvdi.Volume, path: Path) -> Path:
    """Write a volume and its coarser levels by ome-zarr-py."""
    import zarr
    from ome_zarr.format import FormatV04
    from ome_zarr.writer import write_image

    x, y, z = volume.spacing
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        write_image(
            volume.array,
            zarr.open_group(str(path), mode="w", zarr_format=2),
            fmt=FormatV04(),
            axes="zyx",
            scale={"z": z, "y": y, "x": x},
            scale_factors=[{"z": n, "y": n, "x": n} for n in (2, 4, 8)],
            storage_options={"chunks": (64, 64, 64)},
        )
    return path


def measure(name: str, size: tuple[int, int], folder: Path) -> None:
    """Print a row for each transfer function."""
    volume = pvdi.examples.load_data(name, as_volume=True)
    finest = pvdi.open_volume(written(volume, folder / f"{name}.ome.zarr"), level=0)
    camera = filling_camera(finest.bounds, size)
    chosen = finest.at_level("auto", camera, size)
    share = chosen.array.nbytes / finest.array.nbytes
    clim, turned = volume.finite_range(), camera.azimuth(30)
    for look, arguments in TRANSFER_FUNCTIONS.items():
        arguments = {**arguments, "clim": clim}
        truth = pvdi.render_volume(volume, turned, size, **arguments)
        auto, full = (
            pvdi.compare_images(
                pvdi.render(pvdi.generate(level, camera, size, **arguments), turned), truth
            ).ssim
            for level in (chosen, finest)
        )
        print(
            f"| {name} | {look} | {size[0]} x {size[1]} | {chosen.level} | {share:.3f} "
            f"| {auto:.4f} | {full:.4f} | {auto - full:+.4f} |",
            flush=True,
        )


def main() -> None:
    """Measure the volumes that are named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=parse_size, default=(64, 36))
    parser.add_argument("volumes", nargs="+")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for name in options.volumes:
            measure(name, options.size, Path(folder))


if __name__ == "__main__":
    main()
