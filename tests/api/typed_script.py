"""What users write, for a checker of types: ``mypy --strict`` of it says nothing.

``test_typed_script.py`` has it checked, and finds that what is wrong below a comment is refused.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv

import pyvista_vdi as pvdi


def without_vtk(folder: Path) -> pvdi.VDI:
    """Make a VDI of an array, write it, read it, and draw it."""
    volume = pvdi.Volume(np.zeros((8, 9, 10), np.float32), (1.0, 1.0, 2.0))
    camera = pvdi.Camera((5, -40, 9), (5, 4, 9), (0, 0, 1))
    table = pvdi.TransferFunction([(0, 0, 0), (1, 1, 1)], [0, 1], (0, 1))
    vdi = pvdi.generate(
        volume,
        camera,
        (64, 48),
        max_supersegments=10,
        settings=pvdi.Settings(tolerance=0.01, memory_limit="1 GiB"),
        lights=[pvdi.Light()],
        progress=print,
        transfer_function=table,
    )
    vdi.save(folder / "a.vdi")
    picture = pvdi.render(
        vdi,
        camera.azimuth(20),
        (64, 48),
        clipping_planes=[(5, 4, 9, 1, 0, 0)],
        cropping=(0, 5, 0, 5, 0, 5),
        settings=pvdi.Settings(transmittance_cutoff=0.004),
    )
    depth = pvdi.render_depth(vdi, camera, opaque_depth=np.full((48, 64), np.inf))
    several = pvdi.render([vdi, vdi], camera, opacity_multiplier=[1.0, 0.5])
    hit = pvdi.pick(vdi, camera, (32, 24))
    assert picture.shape == several.shape == (*depth.shape, 4)
    assert hit is None or 0 <= hit.opacity <= 1
    return vdi


def with_pyvista(plotter: pv.Plotter, grid: pv.ImageData) -> pvdi.VDI:
    """Make VDIs with the arguments of ``add_volume``."""
    vdi = pvdi.generate(grid, plotter.camera, (64, 48), cmap="bone", opacity="sigmoid_5")
    pvdi.generate(grid, plotter.camera, [64, 48], quality="high", opacity=[0.0, 0.5], clim=(0, 9))
    pvdi.render_volume(grid, plotter.camera, (64, 48), cmap=["red", "blue"], shade=True)
    needed = pvdi.estimate(grid, (64, 48), cmap="bone")
    assert needed.total > 0
    return vdi


def of_several(folder: Path, volumes: list[pvdi.Volume], camera: pvdi.Camera) -> None:
    """Make VDIs of several times, and of several views."""
    series = pvdi.generate_series(volumes, camera, (64, 48), cmap="bone")
    with pvdi.SeriesWriter(folder / "a.vdis", camera, (64, 48), level=3, clim=(0, 9)) as out:
        out.append(volumes[0], 0.5)
    views = pvdi.generate_set(volumes[0], [camera], lists=0.5)
    assert len(series) == len(views)


def mistakes(grid: pv.ImageData, camera: pvdi.Camera) -> None:
    """Make mistakes that a checker of types finds: each is silenced, and would be useless else."""
    pvdi.generate(grid, camera, (64, 48), max_supersegments="many")  # type: ignore[call-overload]
    pvdi.generate(grid, camera, (64, 48), colour_map="bone")  # type: ignore[call-overload]
    pvdi.generate(grid, 5, (64, 48))  # type: ignore[call-overload]
    pvdi.render("a.vdi", camera)  # type: ignore[arg-type]
    pvdi.generate_series([grid], 5, (64, 48))  # type: ignore[arg-type]
    pvdi.generate_set(grid, half_angle="wide")  # type: ignore[arg-type]
