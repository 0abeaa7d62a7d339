"""Deferred VDIs: valid or not built, classified as their definition says, stored to the bit."""

from __future__ import annotations

import json
import re
import zipfile

import numpy as np
import pytest
import reference
from rewriting import described
from strategies import kept_values, random_vdi

import pyvista_vdi as pvdi
from pyvista_vdi import DeferredVDI, TransferFunction, io
from pyvista_vdi.cli import main
from pyvista_vdi.errors import (
    InvalidArgumentError,
    InvalidVDIError,
    UnsupportedError,
    VDIFileError,
    VDIWarning,
)
from pyvista_vdi.model.classify_values import spread_of_values
from pyvista_vdi.model.deferred import lengths_of

LOOKS = TransferFunction([[1, 0, 0], [0, 1, 0], [0, 0, 1]], [0, 0.8, 0.3], (100, 300))


def arguments(seed=1, **changes):
    lists = random_vdi(np.random.default_rng(seed), max_supersegments=4)
    mean, spread, share = lists.color.T
    return {"lists": lists, "mean": mean, "spread": spread / 2, "share": share, **changes}


def deferred(seed=1, **changes):
    return kept_values(**arguments(seed, **changes))


def test_arrays_are_what_was_given_and_read_only():
    given = arguments(importance=[0, 1])
    made = kept_values(**given)
    for name in ("mean", "spread", "share"):
        array = getattr(made, name)
        assert array.dtype == np.float32
        assert np.array_equal(array, given[name])
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    assert made.importance == ((100, 0), (300, 1))
    assert made.values == pytest.approx(100 + 200 * given["mean"].astype(float))
    assert "100 to 300" in repr(made)


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("mean", 1.5, "0 <= color <= 1"),
        ("spread", 0.6, "0 <= spread <= 0.5"),
        ("share", -0.1, "0 <= color <= 1"),
        ("value_range", (2, 2), "low < high"),
        ("value_range", None, "low < high"),
        ("unit_distance", 0, "unit_distance must be a length"),
        ("sample_distance", "x", "sample_distance must be a length"),
        ("importance", [(0, -1), (1, 1)], "weights >= 0"),
    ],
)
def test_what_breaks_a_rule_is_refused(name, value, says):
    given = arguments()
    if name in ("mean", "spread", "share"):
        given[name] = np.array(given[name])
        given[name][1] = value
        says = f"supersegment 1 .*{says}"
    else:
        given[name] = value
    with pytest.raises(InvalidVDIError, match=says):
        kept_values(**given)


def test_classification_is_the_mean_over_values_of_that_mean_and_spread():
    """Against sums over many values, some of them at the ends of the range."""
    given = arguments(2)
    mean = given["mean"].astype(float)
    most = np.where(mean <= 0.5, 2 * mean / 3 - mean**2, mean * (1 - mean) / 3)
    given["spread"] = np.minimum(given["spread"], np.sqrt(most) * 0.999)
    made = kept_values(**given)
    vdi = made.classified(transfer_function=LOOKS)
    length, at, kinds = lengths_of(made.lists), 0, set()
    for k in range(made.n_supersegments):
        mean, spread = float(made.mean[k]), float(made.spread[k])
        low, high, *shares = (float(x) for x in spread_of_values(made.mean[k], made.spread[k]))
        counts = np.round(np.array([*shares, 1 - sum(shares)]) * 200001).astype(int)
        places = [(np.arange(count) + 0.5) / max(count, 1) for count in counts]
        values = np.concatenate(
            [low + (high - low) * places[0], high + (1 - high) * places[1], 0 * places[2]]
        )
        assert (values >= 0).all()
        assert (values <= 1).all()
        assert values.mean() == pytest.approx(mean, abs=2e-5)
        assert values.std() == pytest.approx(spread, abs=2e-4)
        kinds.add((shares[1] > 0, sum(shares) < 1 - 1e-9))
        place = 2 * values
        opacity = np.interp(place, range(3), LOOKS.opacities)
        color = np.stack([np.interp(place, range(3), c) for c in LOOKS.colors.T], axis=1)
        alpha = 1 - (1 - opacity) ** (made.sample_distance / made.unit_distance)
        steps = length[k] * made.share[k] / made.sample_distance
        tau = -np.log1p(-alpha.mean()) * steps
        if tau == 0:
            continue
        assert vdi.front[at] == made.front[k]
        assert vdi.optical_depth[at] == pytest.approx(tau, rel=2e-3, abs=1e-6)
        wanted = (alpha[:, np.newaxis] * color).mean(axis=0) / alpha.mean()
        assert vdi.color[at] == pytest.approx(wanted, abs=2e-3)
        at += 1
    assert at == vdi.n_supersegments
    assert kinds == {(False, False), (True, False), (False, True)}
    assert vdi.metadata["transfer_function"] == LOOKS.to_dict()


def test_of_any_mean_and_spread_that_a_file_may_have_the_mean_is_kept():
    mean, spread = (x.ravel() for x in np.meshgrid(np.linspace(0, 1, 101), np.linspace(0, 0.5, 51)))
    low, high, even, above = spread_of_values(mean, spread)
    assert (low >= 0).all()
    assert (high >= low).all()
    assert (high <= 1).all()
    assert ((even >= 0) & (above >= 0) & (even + above <= 1 + 1e-12)).all()
    assert (even * (low + high) + above * (high + 1)) / 2 == pytest.approx(mean)


def test_what_is_opaque_is_opaque_and_what_is_transparent_left_out():
    made = deferred(spread=np.zeros_like(arguments()["mean"]), mean=arguments()["mean"] * 0 + 0.75)
    step = TransferFunction([[1, 1, 1]] * 3, [0, 0, 1], (100, 300))
    hard = TransferFunction([[1, 1, 1]] * 2, [0, 1], (240, 240))
    vdi = made.classified(transfer_function=hard)
    steps = lengths_of(made.lists) * made.share / made.sample_distance
    assert vdi.optical_depth == pytest.approx(30 * steps[steps > 0], rel=1e-3)
    low = deferred(spread=made.spread, mean=made.mean * 0)
    assert low.classified(transfer_function=step).n_supersegments == 0


def test_a_look_outside_the_range_is_said_with_its_share():
    volume = {"volume": {"scalar_range": [0, 400]}}
    with pytest.warns(VDIWarning, match=r"outside 100 to 300.*50.0% of its opacity from 0 to 400"):
        deferred(metadata=volume).classified(
            transfer_function=TransferFunction([[1, 1, 1]], [0.5], (0, 400))
        )


@pytest.mark.parametrize(
    ("look", "error", "says"),
    [
        ({"shade": True}, UnsupportedError, "shading needs gradients"),
        ({"blending": "maximum"}, UnsupportedError, "blending"),
        ({"interpolation": "linear"}, InvalidArgumentError, "interpolation was said"),
        ({"scalars": "a"}, InvalidArgumentError, "scalars was said"),
        ({"colour": "bone"}, TypeError, "classified"),
    ],
)
def test_what_no_list_knows_is_refused(look, error, says):
    pytest.importorskip("pyvista")
    with pytest.raises(error, match=says):
        deferred().classified(**look)


def test_words_of_add_volume_classify_over_the_range_of_values():
    pytest.importorskip("pyvista")
    vdi = deferred().classified(cmap="bone", opacity=[0, 0.5, 0.9])
    stored = vdi.metadata["transfer_function"]
    assert stored["scalar_range"] == [100, 300]
    assert vdi.metadata["opacity_unit_distance"] == 2


@pytest.mark.extension("deep_exr")
def test_entrances_for_colours_name_the_remedy(tmp_path):
    made = deferred()
    for call in (
        lambda: pvdi.render(made, made.camera),
        lambda: pvdi.render([made, made], made.camera),
        lambda: pvdi.pick(made, made.camera, (0, 0)),
        lambda: pvdi.render_depth(made, made.camera),
        lambda: made.save(tmp_path / "a.exr"),
    ):
        with pytest.raises(InvalidVDIError, match=r"classified\(cmap=..., opacity=...\)"):
            call()
    assert not list(tmp_path.iterdir())
    with pytest.raises(TypeError, match="cmap"):
        pvdi.render(made.classified(transfer_function=LOOKS), made.camera, cmap="bone")


def test_what_importance_leaves_out_is_warned_of():
    made = deferred(importance=[(100, 0), (200, 0), (200, 1), (300, 1)])
    with pytest.warns(VDIWarning, match=r"or of importance 0.*100\.0% of its opacity"):
        made.classified(cmap="bone", opacity=[0, 1, 0], clim=(110, 190))


@pytest.mark.filterwarnings("ignore:the transfer function shows values outside")
def test_one_look_of_several_is_over_all_their_ranges(default_runtime):
    low, high = deferred(value_range=(0, 300)), deferred(value_range=(100, 400))
    look = {"cmap": "bone", "opacity": "linear"}
    picture = pvdi.render([low, high], low.camera, **look)
    over_all = pvdi.render([low, high], low.camera, clim=(0, 400), **look)
    assert np.array_equal(picture, over_all)


def test_render_takes_the_look(default_runtime):
    made = deferred()
    picture = pvdi.render(made, made.camera, transfer_function=LOOKS)
    vdi = made.classified(transfer_function=LOOKS)
    assert np.array_equal(picture, pvdi.render(vdi, made.camera))
    wanted = reference.render(vdi, made.camera, vdi.window_size)
    assert np.abs(picture - wanted).max() < 1e-3
    # Of several, those that keep values take it
    both = pvdi.render([made, vdi], made.camera, transfer_function=LOOKS)
    assert np.array_equal(both, pvdi.render([vdi, vdi], made.camera))


@pytest.mark.extension("sets")
def test_generating_a_set_of_values_is_refused_by_name():
    volume = pvdi.Volume(np.zeros((4, 4, 4), np.float32))
    with pytest.raises(TypeError, match="'classification': values in place of colours are kept by"):
        pvdi.generate_set(volume, classification="deferred", cmap="bone")


@pytest.mark.parametrize("compression", ["lz4", "zstd", "deflate", "none"])
@pytest.mark.parametrize("precision", ["exact", "8-byte"])
def test_files_give_back_every_bit(compression, precision, tmp_path):
    made = deferred(3, importance=[(100, 1), (300, 0.5)]).with_precision(precision)
    path = made.save(tmp_path / "kept.vdi", compression=compression)
    read = pvdi.read(path)
    assert isinstance(read, DeferredVDI)
    assert read.equals(made)
    assert io.read_info(path).deferred == made.about


def test_packed_values_are_within_their_bounds():
    made = deferred(4)
    packed = made.with_precision("8-byte")
    assert np.abs(packed.mean - made.mean).max() <= 0.51 / 3825
    assert (np.abs(packed.spread - made.spread) <= made.spread / 16 + 2**-19).all()
    assert np.abs(packed.share - made.share).max() <= 0.51 / 255
    assert packed.with_precision("exact").with_precision("8-byte").equals(packed)
    with pytest.raises(InvalidArgumentError, match="16-byte"):
        made.with_precision("16-byte")


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("version", 2, "version 2, .*upgrade"),
        ("version", "1", "values are of version '1'"),
        ("value_range", [1], "value_range must be"),
        ("unit_distance", None, "unit_distance must be"),
        ("importance", "x", "importance must be"),
    ],
)
def test_what_a_file_says_of_values_is_checked(key, value, says, tmp_path):
    path = deferred().save(tmp_path / "kept.vdi")
    about = {**pvdi.read(path).about, key: value}
    path.write_bytes(described(path.read_bytes(), deferred=about))
    with pytest.raises(VDIFileError, match=says):
        pvdi.read(path)


@pytest.mark.extension("deep_exr", "web")
def test_convert_classifies_and_info_says_which_kind(tmp_path, capsys):
    pytest.importorskip("pyvista")
    path = deferred().save(tmp_path / "kept.vdi")
    assert main(["info", str(path)]) == 0
    assert re.search(r"values from 100 to 300, classified afterwards", capsys.readouterr().out)
    for suffix in (".vdi", ".exr"):
        target = tmp_path / f"seen{suffix}"
        assert main(["convert", str(path), "--cmap", "bone", "-o", str(target)]) == 0
        assert isinstance(pvdi.read(target), pvdi.VDI)
    assert main(["convert", str(path), "-o", str(tmp_path / "again.vdi")]) == 0
    assert pvdi.read(tmp_path / "again.vdi").equals(pvdi.read(path))
    # A page keeps values, and begins with a look
    page = tmp_path / "kept.html"
    assert main(["convert", str(path), "--cmap", "bone", "-o", str(page)]) == 0
    kept, first = pvdi.read(page), deferred().classified(cmap="bone")
    assert np.array_equal(kept.mean, deferred().with_precision("8-byte").mean)
    assert kept.metadata["transfer_function"] == first.metadata["transfer_function"]
    with pytest.raises(UnsupportedError, match="in the colours that it has"):
        first.save(tmp_path / "no.html", cmap="bone")
    capsys.readouterr()
    # A look for what has one, and none for what needs one
    assert main(["convert", str(tmp_path / "seen.vdi"), "--cmap", "bone", "-o", "x.vdi"]) != 0
    assert "has its look" in capsys.readouterr().err
    assert main(["convert", str(path), "-o", str(tmp_path / "none.exr")]) != 0
    assert "keeps values, which have no colours yet: give --cmap" in capsys.readouterr().err
    seen, picture = str(tmp_path / "seen.vdi"), str(tmp_path / "none.png")
    assert main(["render", str(path), "-o", picture]) != 0
    assert "give --cmap" in capsys.readouterr().err
    # Of several, those that keep values take it
    assert main(["render", seen, str(path), "-o", picture]) != 0
    assert "kept.vdi keeps values" in capsys.readouterr().err
    assert main(["render", seen, str(path), "--cmap", "bone", "-o", picture]) == 0
    with zipfile.ZipFile(path) as archive:
        assert json.loads(archive.read("vdi.json"))["format"] == "pyvista-vdi-deferred"
