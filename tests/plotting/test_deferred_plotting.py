"""A deferred VDI in a plotter: its property is followed, and nothing is generated again."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import pyvista_vdi as pvdi

pv = pytest.importorskip("pyvista")


def volume():
    rng = np.random.default_rng(1)
    image = pv.ImageData(dimensions=(12, 12, 12))
    image["a"] = (rng.random(12**3) * 255).astype(np.uint8)
    return image


@pytest.fixture
def plotter():
    plotter = pv.Plotter(off_screen=True, window_size=(48, 36))
    plotter.camera_position = "iso"
    plotter.reset_camera(bounds=volume().bounds)
    yield plotter
    plotter.close()


def seen(plotter):
    plotter.render()
    return plotter.screenshot(return_img=True).astype(int)


def test_changes_of_property_and_table_are_seen_and_nothing_is_generated(
    default_runtime, plotter, monkeypatch
):
    actor = plotter.add_vdi(volume(), classification="deferred", cmap="bone", show_scalar_bar=False)
    pictures = [seen(plotter)]
    monkeypatch.setattr("pyvista_vdi.generation.deferred.generate_vdi", None)
    actor.prop.GetScalarOpacity().RemoveAllPoints()
    actor.prop.GetScalarOpacity().AddPoint(200, 0)
    actor.prop.GetScalarOpacity().AddPoint(255, 0.3)
    pictures.append(seen(plotter))
    actor.mapper.lookup_table.apply_cmap("viridis")
    pictures.append(seen(plotter))
    table = pv.LookupTable("inferno", scalar_range=(0, 255))
    actor.prop = pv.VolumeProperty(lookup_table=table, opacity_unit_distance=3.0)
    pictures.append(seen(plotter))
    for before, after in itertools.pairwise(pictures):
        assert np.abs(before - after).mean() > 0.2


def test_a_file_takes_a_look_and_its_picture_is_that_of_the_classified_vdi(
    default_runtime, plotter, tmp_path
):
    kept = pvdi.generate(
        volume(), plotter.camera, plotter.window_size, classification="deferred", scalars="a"
    )
    path = kept.save(tmp_path / "kept.vdi")
    look = {"cmap": "bone", "opacity": [0, 0.2, 0.9], "clim": (50, 200)}
    actor = plotter.add_vdi(str(path), show_scalar_bar=False, **look)
    picture = seen(plotter)
    plotter.remove_actor(actor)
    plotter.add_vdi(kept.classified(**look), show_scalar_bar=False)
    assert np.abs(picture - seen(plotter)).max() <= 1


def test_picks_and_the_vdi_have_the_look_of_now(default_runtime, plotter):
    actor = plotter.add_vdi(volume(), classification="deferred", cmap="bone", opacity="linear")
    plotter.render()
    opacity = actor.prop.GetScalarOpacity()
    opacity.RemoveAllPoints()
    opacity.AddPoint(200, 0)
    opacity.AddPoint(255, 1)
    before = actor.vdi.n_supersegments
    hit = actor.pick(24, 18)
    plotter.render()
    assert before == actor.vdi.n_supersegments < actor.deferred.n_supersegments
    assert (hit and hit.value) == ((now := actor.pick(24, 18)) and now.value)
    assert isinstance(actor.deferred, pvdi.DeferredVDI)
