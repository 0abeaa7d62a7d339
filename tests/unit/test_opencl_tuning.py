"""Work-group sizes: turns of simulated launches, the file that keeps sizes, the same bits."""

from __future__ import annotations

import collections
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi.device import choice, tuning
from pyvista_vdi.device.devices import Candidate, DeviceInfo
from pyvista_vdi.device.runtime import Runtime
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.raycasting.raycast import render_first_hits, render_vdi
from pyvista_vdi.volume.render import raycast_volume

INFO = DeviceInfo(
    "Device", "Platform", "Vendor", "OpenCL 3.0", "1.2", "GPU", 8, 2**33, 2**31, has_fp64=True
)
MANY = 10**6  # work-items that fill the device below
ROUND = 2 * 5  # turns: sizes from 32 to 512, there and back
ALL = (1 + tuning.ROUNDS) * ROUND


class Named(SimpleNamespace):
    """As objects of the driver, told apart by identity."""

    __hash__ = object.__hash__


class Events:
    """Launches of a kernel on a simulated device; with a drift, as under a camera that moves."""

    DEVICE: ClassVar = SimpleNamespace(max_work_group_size=1024, max_work_item_sizes=[1024, 1, 1])

    def __init__(self, cost, *, most=1024, source="a kernel", drift=0.0):
        self.cost, self.drift, self.launches = cost, drift, []
        limits = {"PREFERRED_WORK_GROUP_SIZE_MULTIPLE": 32, "WORK_GROUP_SIZE": most}
        self.kernel = Named(
            path="raycasting/raycast.cl",
            name="raycast",
            source=source,
            object=SimpleNamespace(get_work_group_info=lambda what, _: limits[what]),
        )

    def run(self, tuner, launches, *, items=MANY, ends=True):
        """Launch, and return the sizes."""
        sizes = []
        for _ in range(launches):
            size, turn = tuner.size(self.kernel, items, 64)
            elapsed = int(1e6 * self.cost[size] * (1 + self.drift * len(self.launches)))
            event = SimpleNamespace(
                command_execution_status=0 if ends else 3,
                profile=SimpleNamespace(start=1000, end=1000 + elapsed),
            )
            self.launches.append(event)
            sizes.append(size)
            if turn is not None:
                tuner.timed(turn, event)
        return sizes


@pytest.fixture(autouse=True)
def _plain_driver(monkeypatch):
    """Names in place of the driver's constants where a test simulates the device."""
    names = SimpleNamespace(
        kernel_work_group_info=SimpleNamespace(
            PREFERRED_WORK_GROUP_SIZE_MULTIPLE="PREFERRED_WORK_GROUP_SIZE_MULTIPLE",
            WORK_GROUP_SIZE="WORK_GROUP_SIZE",
        ),
        command_execution_status=SimpleNamespace(COMPLETE=0),
        Error=RuntimeError,
    )
    real = tuning.opencl

    def chosen():
        return names if simulated else real()

    simulated = True
    monkeypatch.setattr(tuning, "opencl", chosen)

    def switch(on):
        nonlocal simulated
        simulated = on

    return switch


@pytest.fixture
def file(tmp_path):
    return tmp_path / "cache" / "work_groups.json"


def _tuner(file, **options):
    return tuning.Tuner(Events.DEVICE, INFO, file, **options)


COST = {16: 9.0, 32: 1.2, 64: 1.0, 128: 0.8, 256: 0.9, 512: 1.5}


def test_the_fastest_size_is_found_during_real_launches_and_kept(file):
    tuner, events = _tuner(file), Events(COST)
    sizes = events.run(tuner, ALL)
    for half in range(0, ALL, ROUND // 2):
        assert sorted(sizes[half : half + ROUND // 2]) == [32, 64, 128, 256, 512]
    assert events.run(tuner, 3) == [128] * 3
    assert set(Events(COST).run(_tuner(file), 3)) == {128}  # a later process


@pytest.mark.parametrize("drift", [0.05, -0.009])
def test_a_camera_that_moves_decides_nothing(file, drift):
    """Costs grow threefold in the turns, or shrink to 0.6; sizes have none of it."""
    same = dict.fromkeys(COST, 1.0)
    tuner, events = _tuner(file), Events(same, drift=drift)
    events.run(tuner, ALL)
    assert events.run(tuner, 1) == [64]
    tuner, events = _tuner(file, redo=True), Events(COST, drift=drift)
    events.run(tuner, ALL)
    assert events.run(tuner, 1) == [128]


def test_launches_that_cannot_be_compared_decide_nothing(file):
    """Every third launch does seven times the work, as chunks of a march do."""
    tuner, events = _tuner(file), Events(COST)
    for n in range((1 + tuning.MOST_ROUNDS) * ROUND):
        events.drift = 6.0 / max(n, 1) if n % 3 == 0 else 0.0
        events.run(tuner, 1)
    assert events.run(tuner, 3) == [64] * 3
    assert not file.exists()  # another process may have more luck


def test_what_is_a_little_faster_or_not_always_is_not_taken(file):
    tuner, events = _tuner(file), Events({**COST, 128: 0.98, 256: 0.99})
    events.run(tuner, ALL)
    assert events.run(tuner, 1) == [64]

    tuner, events = _tuner(file, redo=True), Events(dict(COST))
    events.run(tuner, 3 * ROUND)
    events.cost[128] = 1.1  # in the last round
    events.run(tuner, ROUND)
    assert events.run(tuner, 1) == [256]


def test_sizes_are_those_that_device_and_kernel_allow(file):
    assert set(Events(COST, most=100).run(_tuner(file), ROUND)) == {32, 64}
    Events(COST).run(_tuner(file), ALL + 1)  # 128 is found and kept
    assert set(Events(COST, most=100).run(_tuner(file), 5)) == {64}  # compiled for another scene


def test_small_launches_and_events_that_have_not_ended_are_let_be(file):
    tuner, events = _tuner(file), Events(COST)
    assert set(events.run(tuner, 20, items=8 * 512 * 4 - 1)) == {64}
    events.run(tuner, ROUND, ends=False)
    assert events.run(tuner, 4, ends=False) == [64] * 4  # nobody waits
    for event in events.launches:
        event.command_execution_status = 0
    assert sorted(events.run(tuner, 5)) == [32, 64, 128, 256, 512]


def test_other_work_begins_a_round_anew(file):
    tuner, one, other = _tuner(file), Events(COST), Events(COST)
    one.run(tuner, 3)
    for begun in one, other:  # the other is compiled for another scene
        sizes = begun.run(tuner, 5, items=2 * MANY)
        assert sorted(sizes) == [32, 64, 128, 256, 512]


def test_a_failed_launch_makes_its_round_count_nothing(file):
    tuner, events = _tuner(file), Events(COST)
    events.run(tuner, ALL - 1)
    events.run(tuner, 1)
    events.launches[-1].command_execution_status = -5
    assert events.run(tuner, ROUND + 1)[-1] == 128
    assert len(events.launches) == ALL + ROUND + 1


def test_kept_sizes_are_of_this_driver_and_source(file):
    Events(COST).run(tuner := _tuner(file), ALL + 1)
    assert tuner.size(Events(COST).kernel, 1, 64) == (128, None)
    assert set(Events(COST, source="another").run(_tuner(file), ROUND)) == {32, 64, 128, 256, 512}
    updated = tuning.Tuner(Events.DEVICE, INFO.__class__(**{**vars(INFO), "driver": "2"}), file)
    assert set(Events(COST).run(updated, ROUND)) == {32, 64, 128, 256, 512}
    assert set(Events(COST).run(_tuner(file, redo=True), ROUND)) == {32, 64, 128, 256, 512}


def _contents(entry):
    key = "Platform / Device, driver 1.2"
    return json.dumps({"version": 1, "devices": {key: {"raycasting/raycast.cl:raycast": entry}}})


@pytest.mark.parametrize(
    "text",
    [
        "",
        "\0\xff",
        "[]",
        "{}",
        '{"version": 1, "devices": []}',
        '{"version": 1, "devices": {"Platform / Device, driver 1.2": 3}}',
        '{"version": 2, "devices": {}}',
        "[" * 10**5,
        _contents(128),
        _contents({"size": 100, "source": "x"}),
        _contents({"size": 64.0, "source": "x"}),
        _contents({"size": [], "source": "x"}),
        _contents({"size": 64}),
        _contents({"size": 64, "source": None}),
    ],
)
def test_files_that_make_no_sense_are_passed_by_and_replaced(file, text):
    file.parent.mkdir()
    file.write_text(text, encoding="latin-1")
    Events(COST).run(_tuner(file), ALL + 1)
    assert list(file.parent.iterdir()) == [file]
    assert set(Events(COST).run(_tuner(file), 3)) == {128}


def test_what_others_have_kept_stays(file):
    Events(COST).run(_tuner(file), ALL + 1)
    other = Events(COST)
    other.kernel.name = "march_lists"
    other.run(_tuner(file), ALL + 1)
    (kernels,) = json.loads(file.read_text())["devices"].values()
    assert sorted(kernels) == ["raycasting/raycast.cl:march_lists", "raycasting/raycast.cl:raycast"]


def test_where_nothing_can_be_written_sizes_hold_for_the_process(tmp_path):
    (tmp_path / "file").touch()
    for nowhere in (tmp_path / "file" / "work_groups.json", None):
        tuner, events = _tuner(nowhere), Events(COST)
        events.run(tuner, ALL)
        assert events.run(tuner, 1) == [128]


@pytest.mark.parametrize(
    ("platform", "environment", "folder"),
    [
        ("linux", {"XDG_CACHE_HOME": "/caches"}, "/caches/pyvista-vdi"),
        ("linux", {"XDG_CACHE_HOME": "relative"}, "/home/me/.cache/pyvista-vdi"),
        ("darwin", {}, "/home/me/Library/Caches/pyvista-vdi"),
        ("win32", {"LOCALAPPDATA": "/local"}, "/local/pyvista-vdi/Cache"),
        ("win32", {}, "/home/me/AppData/Local/pyvista-vdi/Cache"),
    ],
)
def test_the_folder_is_the_systems(monkeypatch, platform, environment, folder):
    monkeypatch.setattr(tuning.sys, "platform", platform)
    monkeypatch.setattr(tuning.Path, "home", lambda: Path("/home/me"))
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert tuning.cache_folder() == Path(folder)


@pytest.mark.parametrize(
    ("value", "on_gpu", "on_cpu"),
    [(None, True, False), ("off", False, False), ("0", False, False), ("On", True, True)],
)
def test_the_variable_says_where_sizes_are_tuned(monkeypatch, value, on_gpu, on_cpu):
    monkeypatch.delenv(tuning.TUNING_VARIABLE, raising=False)
    if value is not None:
        monkeypatch.setenv(tuning.TUNING_VARIABLE, value)
    cpu = INFO.__class__(**{**vars(INFO), "kind": "CPU"})
    assert (tuning.tuner_of(None, INFO) is not None) == on_gpu
    assert (tuning.tuner_of(None, cpu) is not None) == on_cpu


# -- real launches -----------------------------------------------------------------------------


class _EachInTurn(tuning.Tuner):
    """Takes another of the sizes that are allowed for every launch."""

    def __init__(self, device, info):
        super().__init__(device, info, None)
        self.used = collections.defaultdict(list)

    def size(self, kernel, items, own, *, timed=True):
        del items, timed
        allowed = self._sizes(kernel, own)
        used = self.used[kernel.name]
        used.append(allowed[len(used) % len(allowed)])
        return used[-1], None


def _looks(volume):
    return Classification({"cmap": "viridis", "opacity": "linear"}, "a test").transfer_function(
        volume
    )


def _like_a_gpu(runtime):
    """A second runtime on the device, whose kernels follow rays one by one, as a GPU's.

    Kernels that follow blocks of rays, a CPU's, leave no choice of a size.
    """
    return Runtime(Candidate(replace(runtime.info, kind="GPU"), runtime._device))


@pytest.fixture
def tuned(runtime, monkeypatch, tmp_path, _plain_driver):
    """One that tunes."""
    _plain_driver(False)
    monkeypatch.setattr(tuning, "cache_folder", lambda: tmp_path)
    monkeypatch.setenv(tuning.TUNING_VARIABLE, "on")
    tuned = _like_a_gpu(runtime)
    assert tuned.tunes_groups
    return tuned


def test_every_size_makes_the_same_bits(tuned, monkeypatch):
    """97 x 63 pixels: no size divides them, so each has surplus work-items."""
    monkeypatch.setenv(tuning.TUNING_VARIABLE, "off")
    untuned = _like_a_gpu(tuned)
    tuned._tuner = _EachInTurn(tuned._device, tuned.info)
    rng = np.random.default_rng(5)
    volume = pvdi.Volume(rng.integers(0, 255, (20, 30, 24), dtype=np.uint8))
    looks = _looks(volume)
    view = filling_camera(volume.bounds, (97, 63))
    vdi = generate_vdi(volume, view, (97, 63), looks, device=untuned)
    turned = view.azimuth(20)
    cropping = (3, 20, 3, 20, 3, 15)

    def drawn(on):
        yield raycast_volume(volume, turned, (97, 63), looks, device=on)
        yield render_vdi(vdi, turned, cropping=cropping, device=on)
        yield render_vdi(vdi, turned, preview_samples=8, device=on)
        yield render_first_hits(vdi, turned, device=on)

    for _ in tuning.SIZES:  # each kernel comes to all of its own
        assert vdi.equals(generate_vdi(volume, view, (97, 63), looks, device=tuned))
        for one, other in zip(drawn(untuned), drawn(tuned), strict=True):
            np.testing.assert_array_equal(one, other)
    for name in ("raycast", "render_volume", "preview", "march_lists", "shorten_lists"):
        assert len(set(tuned._tuner.used[name])) > 2, name


def test_frames_decide_and_devices_say_what_they_found(tuned, monkeypatch):
    monkeypatch.setattr(tuning, "_GROUPS_PER_UNIT", 0)  # small launches count,
    monkeypatch.setattr(tuning, "_SCATTER", np.inf)  # whatever else the machine does
    volume = pvdi.Volume(np.indices((9, 9, 9)).sum(axis=0).astype(np.uint8))
    looks = _looks(volume)
    view = filling_camera(volume.bounds, (64, 48))
    for _ in range(80):
        raycast_volume(volume, view, (64, 48), looks, device=tuned)
        if tuning.tuned_sizes(tuned.info):
            break
    found = tuning.tuned_sizes(tuned.info)
    assert found["render_volume"] in tuning.SIZES
    lines = choice._device_lines(tuned.info, is_default=False)
    assert f"    work-group sizes found: render_volume {found['render_volume']}" in lines
