"""Grids that are not uniform, masks and stores in a plotter: what is drawn of them."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from pyvista_vdi.errors import Cancelled, InvalidArgumentError, UnsupportedError
from pyvista_vdi.plotting import prepared

pytestmark = pytest.mark.usefixtures("default_runtime")


def linear(grid):
    grid["T"] = grid.points @ np.array([1.0, 2.0, 3.0])
    return grid


def grids():
    rectilinear = pv.RectilinearGrid(*[np.array([0, 1, 1.5, 4.0])] * 3)
    image = pv.ImageData(dimensions=(5, 5, 5))
    return {
        "rectilinear": linear(rectilinear),
        "structured": linear(image.cast_to_structured_grid()),
        "unstructured": linear(image.cast_to_unstructured_grid()),
    }


def shown(volume, **how):
    plotter = pv.Plotter(off_screen=True, window_size=(16, 12))
    try:
        actor = plotter.add_vdi(volume, show_scalar_bar=False, **how)
        return actor.mapper.GetSource().GetVolume()
    finally:
        plotter.close()


@pytest.mark.parametrize("kind", ["rectilinear", "structured", "unstructured"])
def test_other_grids_are_resampled_where_that_is_asked_for(kind, caplog):
    grid = grids()[kind]
    with pytest.raises(UnsupportedError, match="not a uniform grid"):
        shown(grid)
    caplog.set_level("INFO", "pyvista_vdi")
    volume = shown(grid, resample=(5, 6, 7))
    assert volume.dimensions == (5, 6, 7)
    x, y, z = volume.spacing
    assert volume.array[3, 2, 1] == pytest.approx(x + 2 * 2 * y + 3 * 3 * z)
    assert "differs by" in caplog.text
    assert min(shown(grid, resample="auto").dimensions) >= 4
    with pytest.raises(InvalidArgumentError, match="three numbers of points"):
        shown(grid, resample=(1, 2))


def test_blocks_are_resampled_and_others_refused_before_any_is_added():
    plotter = pv.Plotter(off_screen=True, window_size=(16, 12))
    blocks = pv.MultiBlock([grids()["rectilinear"], pv.MultiBlock([grids()["unstructured"]])])
    first, (second,) = plotter.add_vdi(blocks, resample=(5, 6, 7), show_scalar_bar=False)
    for actor in (first, second):
        assert actor.mapper.GetSource().GetVolume().dimensions == (5, 6, 7)
    count = len(plotter.renderer.actors)
    with pytest.raises(UnsupportedError, match="a surface has no volume"):
        plotter.add_vdi(pv.MultiBlock([*blocks, pv.Sphere()]), resample="auto")
    with pytest.raises(UnsupportedError, match="not a uniform grid"):
        plotter.add_vdi(blocks)
    assert len(plotter.renderer.actors) == count
    plotter.close()


def test_resampling_in_slabs_is_the_same_says_how_far_it_is_and_can_be_stopped(monkeypatch, caplog):
    grid = linear(pv.ImageData(dimensions=(9, 9, 9)).cast_to_unstructured_grid())
    ball = grid.extract_cells(np.linalg.norm(grid.cell_centers().points - 4, axis=1) < 4)
    ball.cell_data["cells"] = np.arange(ball.n_cells)
    at_once = prepared.resampled(ball, (10, 11, 12))
    seen = []
    monkeypatch.setattr(prepared, "_SLAB", 500)
    caplog.set_level("INFO", "pyvista_vdi")
    in_slabs = prepared.resampled(ball, (10, 11, 12), "cells", seen.append)
    assert seen == [0, 1 / 3, 2 / 3, 1]
    for name in ("T", "cells", "vtkGhostType"):
        assert np.allclose(in_slabs[name], at_once[name], rtol=1e-12)
    assert in_slabs.active_scalars_name == "cells"
    said = caplog.records[-1].getMessage()
    assert f"of its own {ball.n_cells}, 'cells' differs by" in said
    hidden = in_slabs["vtkGhostType"] != 0
    assert 0 < hidden.sum() < in_slabs.n_points
    assert np.allclose((in_slabs.points @ [1, 2, 3])[~hidden], in_slabs["T"][~hidden])
    with pytest.raises(Cancelled, match="resampling was stopped"):
        shown(ball, resample="auto", progress_bar=lambda fraction: False)


def test_what_a_mask_leaves_out_is_blank():
    image = pv.ImageData(dimensions=(4, 5, 6))
    image["T"] = np.arange(120.0)
    labels = image.copy()
    labels["T"] = (np.arange(120) % 4 > 1).astype(np.uint8)
    volume = shown(image, mask=labels)
    assert volume.blanked is not None
    seen = volume.blanked == 0
    assert not seen[..., 0].any()
    with pytest.raises(InvalidArgumentError, match="a label for each"):
        shown(image, mask=np.zeros((4, 5, 7)))
