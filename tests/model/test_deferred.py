"""Deferred VDIs: valid or not built, classified as their definition says, stored to the bit."""

from __future__ import annotations

import numpy as np
import pytest
import reference
from strategies import kept_values, random_vdi

import pyvista_vdi as pvdi
from pyvista_vdi import DeferredVDI, TransferFunction, io
from pyvista_vdi.cli import main
from pyvista_vdi.errors import InvalidArgumentError, InvalidVDIError
from pyvista_vdi.model.vdi import lengths_of

LOOKS = TransferFunction([[1, 0, 0], [0, 1, 0], [0, 0, 1]], [0, 0.8, 0.3], (100, 300))


def arguments(seed=1, **changes):
    lists = random_vdi(np.random.default_rng(seed), max_window=(12, 9), max_supersegments=4)
    mean, spread, share = lists.color.T
    return {"lists": lists, "mean": mean, "spread": spread / 2, "share": share, **changes}


def deferred(seed=1, **changes):
    return kept_values(**arguments(seed, **changes))


def test_arrays_are_what_was_given_and_read_only():
    given = arguments()
    made = kept_values(**given)
    for name in ("mean", "spread", "share"):
        array = getattr(made, name)
        assert array.dtype == np.float32
        assert np.array_equal(array, given[name])
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
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


def spread_of_values(m, s):
    """How values of a mean and a spread lie: docs/dev/conventions.md, in float64.

    The ends of those that are spread evenly and their share, and the share of those above.
    """
    if np.sqrt(3) * s < min(m, 1 - m):
        return m - np.sqrt(3) * s, m + np.sqrt(3) * s, 1.0, 0.0
    if m <= 0.5:
        high = min(1.0, 3 * (s**2 + m**2) / (2 * m)) if m > 0 else 1.0
        return 0.0, high, 2 * m / high, 0.0
    below = min(m, 3 * s**2 / (1 - m)) if m < 1 else m
    share = (1 - m) / (1 - m + below)
    return m - below, m, share, 1 - share


def test_classification_is_the_mean_over_values_of_that_mean_and_spread(default_runtime):
    """Against sums over many values, some of them at the ends of the range."""
    given = arguments(2)
    mean = given["mean"].astype(float)
    most = np.where(mean <= 0.5, 2 * mean / 3 - mean**2, mean * (1 - mean) / 3)
    given["spread"] = np.minimum(given["spread"], np.sqrt(most) * 0.999)
    made = kept_values(**given)
    vdi = made.classified(transfer_function=LOOKS)
    length, at, kinds = lengths_of(made), 0, set()
    for k in range(made.n_supersegments):
        mean, spread = float(made.mean[k]), float(made.spread[k])
        low, high, *shares = spread_of_values(mean, spread)
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
        # A part of a cell counts as its mean: for opacity half of what it changes by in a cell, 1.6
        # / 2^15 = 5e-5 at most. Measured, where it is 0.0045: 7.4e-5 of it; of a colour 2.7e-6
        assert vdi.optical_depth[at] == pytest.approx(tau, rel=2e-4, abs=1e-6)
        wanted = (alpha[:, np.newaxis] * color).mean(axis=0) / alpha.mean()
        assert vdi.color[at] == pytest.approx(wanted, abs=1e-5)
        at += 1
    assert at == vdi.n_supersegments
    assert kinds == {(False, False), (True, False), (False, True)}
    assert vdi.metadata["transfer_function"] == LOOKS.to_dict()


def test_a_range_of_one_value_is_a_step():
    look = LOOKS.replace(scalar_range=(200, 200))
    assert deferred().classified(transfer_function=look).n_supersegments > 0


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


@pytest.mark.parametrize(("compression", "precision"), [("lz4", "exact"), ("zstd", "8-byte")])
def test_files_give_back_every_bit(compression, precision, tmp_path):
    made = deferred(3).with_precision(precision)
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


@pytest.mark.extension("web")
def test_convert_and_render_classify_and_say_what_is_missing(tmp_path, capsys):
    pytest.importorskip("pyvista")
    path, seen, page = (tmp_path / name for name in ("kept.vdi", "seen.vdi", "kept.html"))
    deferred().save(path)
    assert main(["info", str(path)]) == 0
    assert '"value_range": [100.0, 300.0]' in capsys.readouterr().out
    assert main(["convert", str(path), "--cmap", "bone", "-o", str(seen)]) == 0
    assert isinstance(pvdi.read(seen), pvdi.VDI)
    # A page keeps values, and begins with a look
    assert main(["convert", str(path), "--cmap", "bone", "-o", str(page)]) == 0
    assert np.array_equal(pvdi.read(page).mean, deferred().with_precision("8-byte").mean)
    # A look for what has one, and none for what needs one
    for command, says in (
        (["convert", str(seen), "--cmap", "bone", "-o", "x.vdi"], "has its look"),
        (["convert", str(path), "-o", str(tmp_path / "none.exr")], "have no colours yet: give --c"),
        (["render", str(path), "-o", "x.png"], "kept.vdi stores scalars"),
    ):
        assert main(command) != 0
        assert says in capsys.readouterr().err
