"""The tradeoff: sweeps, tiny runs, and what is made of their figures."""

from __future__ import annotations

import copy
import itertools
import json
import math

import numpy as np
import pytest
from json_schema import faults
from measured import SCHEMA, checked, made_up_results

import pyvista_vdi as pvdi
from pyvista_vdi import cli
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.measure.paper.datasets import look
from pyvista_vdi.measure.results import Results
from pyvista_vdi.measure.tradeoff import AXES, Setting, Tradeoff, measure_tradeoff, sweep
from pyvista_vdi.measure.tradeoff.settings import DEFAULT_AXES, ON_REQUEST, PAIRS, QUICK_AXES

TINY_SWEEP = ("max-supersegments=2", "precision=8-byte", "preview=0.5", "skip-empty")
TINY_RUN = ("--size", "32x24", "--angles", "0,30", "--repeats", "2", "--generations", "1")


def shell():
    """Return a hollow ball in a block, uint8 (14, 18, 20)."""
    z, y, x = np.mgrid[-1:1:14j, -1:1:18j, -1:1:20j]
    radius = np.sqrt(x * x + y * y + z * z)
    return np.rint(255 * np.exp(-(((radius - 0.7) / 0.15) ** 2))).astype(np.uint8)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a volume in two files of NumPy's."""
    path = tmp_path_factory.mktemp("tradeoff")
    np.save(path / "ball.npy", shell())
    np.save(path / "shell.npy", shell())
    return path


def settings_of(results):
    """Return the rows of settings by what they change."""
    return {
        " ".join(str(v) for n, v in row["case"].items() if n in AXES): row
        for row in results.rows(what="setting")
    }


def tradeoff(*arguments):
    return cli.main(["tradeoff", *(str(a) for a in arguments)])


def test_the_default_is_what_generate_does():
    setting, defaults = Setting(), pvdi.generate.__kwdefaults__
    for name in ("max_supersegments", "tolerance", "view_cone", "criterion"):
        assert getattr(setting, name) == defaults[name]
    assert (setting.name, setting.changes) == ("default", {})


def test_the_default_sweep_changes_one_thing_or_a_pair():
    settings = sweep()
    assert settings[0] == Setting()
    assert len({setting.name for setting in settings}) == len(settings)
    changes = [setting.changes for setting in settings]
    alone = {(n, v) for change in changes if len(change) == 1 for n, v in change.items()}
    assert alone == {(name, value) for name in DEFAULT_AXES for value in AXES[name]}
    together = [change for change in changes if len(change) > 1]
    assert together == [dict(pair) for pair in PAIRS]
    assert set(DEFAULT_AXES) | set(ON_REQUEST) == set(AXES)
    assert all(set(QUICK_AXES[name]) <= set(AXES[name]) for name in QUICK_AXES)


def test_pairs_need_both_axes():
    settings = sweep({"lists": (2.0,), "precision": ("8-byte",), "tolerance": (0.1,)})
    names = ["default", "lists x2", "8-byte", "tolerance 0.1", "lists x2, 8-byte"]
    assert [setting.name for setting in settings] == names
    assert len(sweep({"lists": (2.0,), "precision": ("8-byte",)}, pairs=False)) == 3


def test_a_sweep_can_begin_elsewhere():
    base = Setting(lists=2.0, precision="8-byte")
    assert sweep({"tolerance": (0.1,)}, base=base)[1].name == "tolerance 0.1, lists x2, 8-byte"


def test_what_is_chosen_after_generation_shares_a_vdi():
    one = Setting(max_supersegments=5, precision="8-byte", skip_empty=False, preview=0.5)
    assert one.generated == Setting(max_supersegments=5)


@pytest.mark.parametrize(
    ("make", "values", "message"),
    [
        (Setting, {"max_supersegments": 0}, "from 1 to 4096; got 0"),
        (Setting, {"precision": "4-byte"}, "precision must be one of exact, 8-byte"),
        (Setting, {"criterion": "depth"}, "criterion must be one of least-error"),
        (Setting, {"lists": 0.0}, "lists must be from 0.05 to 8; got 0.0"),
        (Setting, {"preview": 1.5}, "preview must be from 0.02 to 1; got 1.5"),
        (Setting, {"tolerance": math.nan}, "tolerance must be from 0 to 1e"),
        (Setting, {"view_cone": 91.0}, "view_cone must be from 0 to 90"),
        (sweep, {"axes": ["size"]}, "no axis 'size': known are max_supersegments"),
        (
            sweep,
            {"axes": {"tolerance": np.linspace(0.001, 1, 1000)}},
            "has 1001 settings, more than 500",
        ),
    ],
)
def test_settings_and_sweeps_are_checked(make, values, message):
    with pytest.raises(InvalidArgumentError, match=message):
        make(**values)


def test_a_tiny_run_writes_what_the_schema_says(runtime, folder, tmp_path, capsys):
    device = ("--device", runtime.info.selector)
    run = (folder / "ball.npy", *TINY_RUN, "--sweep", *TINY_SWEEP, "--no-vtk", *device)
    assert tradeoff(*run, "--out", tmp_path) == 0
    results = checked(tmp_path / "tradeoff-ball.json")
    points = settings_of(results)
    assert set(points) == {"", "2", "8-byte", "0.5", "False"}
    for point in points.values():
        assert [view["angle"] for view in point["angles"]] == [0, 30]
        for view in point["angles"]:
            for taken in (view["seconds"], view["volume_seconds"]):
                assert len(taken["clock"]) == len(taken["device"]) == 2
        assert len(point["generation"]["seconds"]["clock"]) == 1
    # From V_O a VDI loses nothing, whatever the budget
    for name in ("", "2", "False"):
        assert points[name]["angles"][0]["to_volume"]["ssim"] > 0.9999
    # Skipping changes no bit
    near = [[view["to_volume"] for view in points[name]["angles"]] for name in ("", "False")]
    assert near[0] == near[1]
    assert points["2"]["vdi"]["longest_list"] == 2
    assert points["8-byte"]["vdi"]["bytes_memory"] < points[""]["vdi"]["bytes_memory"]
    assert points["8-byte"]["generation"]["packing"] is not None
    # What differs only after generation shares a VDI
    assert points["0.5"]["vdi"] == points[""]["vdi"]
    assert points["0.5"]["generation"] == points[""]["generation"]
    assert points["2"]["generation"] != points[""]["generation"]
    names = [one.name for one in Tradeoff.read(tmp_path / "tradeoff-ball.json").points]
    assert names == ["default", "N_S 2", "8-byte", "preview x0.5", "no skipping"]
    text = (tmp_path / "tradeoff-ball.md").read_text()
    assert "| preview x0.5 |" in text
    assert "Not measured" not in text
    shown = capsys.readouterr().out
    assert "bytes on the device against SSIM: N_S 2 (" in shown
    written = shown.rpartition("Written: ")[2]
    assert all(str(tmp_path / f"tradeoff-ball.{kind}") in written for kind in ("json", "md"))


def test_python_and_the_command_measure_the_same(default_runtime, folder, tmp_path):
    run = (folder / "shell.npy", *TINY_RUN, "--sweep", "lists=0.5", "--no-vtk")
    assert tradeoff(*run, "--out", tmp_path, "--device", default_runtime.info.selector) == 0
    commanded = Tradeoff.read(tmp_path / "tradeoff-shell.json")
    ours = measure_tradeoff(
        pvdi.Volume(shell()),
        sweep({"lists": (0.5,)}),
        window_size=(32, 24),
        angles=(0, 30),
        repeats=1,
        generations=1,
        vtk=False,
        transfer_function=look("ramp", (0.0, 255.0), "nearest"),
        device=default_runtime,
    )
    assert [one.name for one in ours.points] == ["default", "lists x0.5"]
    for name in ("default", "lists x0.5"):
        a, b = commanded.point(name), ours.point(name)
        assert (a.ssims, a.bytes_memory, a.bytes_file) == (b.ssims, b.bytes_memory, b.bytes_file)
    assert ours.table().startswith("# Tradeoff: volume, 32x24\n")
    with pytest.raises(InvalidArgumentError, match=r"no setting 'N_S 3' was measured: .*'default'"):
        ours.point("N_S 3")
    with pytest.raises(InvalidArgumentError, match="kind must be one of frame, memory, file, gen"):
        ours.front("bytes")


@pytest.mark.gl
def test_vtk_takes_part(default_runtime, folder, tmp_path):
    run = (folder / "ball.npy", *TINY_RUN, "--sweep", "skip-empty", "--interpolation", "linear")
    assert tradeoff(*run, "--out", tmp_path, "--device", default_runtime.info.selector) == 0
    results = checked(tmp_path / "tradeoff-ball.json")
    for row in results.rows(what="volume rendering"):
        assert row["left_out"] == {}
        assert {"vtk_gpu", "vtk_fixed_point"} < set(row["seconds"])
        assert row["volume_to_vtk_gpu"]["ssim"] > 0.95
    assert results.data["system"]["opengl"]
    assert "VTK GPU | VTK fixed point" in (tmp_path / "tradeoff-ball.md").read_text()


def test_mistakes_of_the_command_line(capsys):
    assert tradeoff("a.npy", "--window-size", "12") == 2
    assert "a size is WIDTHxHEIGHT" in capsys.readouterr().err


@pytest.mark.parametrize("size", [(32, 24, 3), (32.5, 24), 32])
def test_a_window_that_is_none_is_refused(size):
    with pytest.raises(InvalidArgumentError, match=r"window_size must be \(width, height\)"):
        measure_tradeoff(pvdi.Volume(shell()), window_size=size)


@pytest.mark.parametrize(
    ("options", "names"),
    [
        (["--sweep", "lists=0.5,2"], ["default", "lists x0.5", "lists x2"]),
        (["--sweep", "view-cone"], ["default", *(f"view cone {n}" for n in (0, 30, 90))]),
        (
            ["--sweep", "lists=2", "precision=8-byte"],
            ["default", "lists x2", "8-byte", "lists x2, 8-byte"],
        ),
        (["--quick"], [setting.name for setting in sweep(QUICK_AXES, pairs=False)]),
        ([], [setting.name for setting in sweep()]),
    ],
)
def test_the_options_reach_the_sweep(options, names, folder, tmp_path, monkeypatch):
    asked = []

    def measure(volume, settings, **others):
        asked.append((settings, others["window_size"]))
        return Tradeoff(made_up())

    monkeypatch.setattr("pyvista_vdi.cli.tradeoff.measure_tradeoff", measure)
    size = ("--window-size", "64x36", "--no-vtk", "--out", tmp_path)
    assert tradeoff(folder / "ball.npy", *options, *size) == 0
    ((settings, window),) = asked
    assert window == (64, 36)
    assert [setting.name for setting in settings] == names


STEADY = np.array([1.0, 1.01, 0.99, 1.02, 0.98])


def times(median):
    return {"clock": (median * STEADY).tolist(), "device": []}


def made_up(*points, angles=(5.0, 30.0)):
    """Return results of settings given as (setting, frame ratio, SSIM, bytes, generation ratio)."""
    rows = []
    taken = {"volume": times(0.02), "volume_skipping": times(0.01), "vtk_gpu": times(0.03)}
    for angle in angles:
        case = {"what": "volume rendering", "volume": "ball", "angle": angle}
        found = {"volume_to_vtk_gpu": None, "seconds": copy.deepcopy(taken), "left_out": {}}
        rows.append({"case": case, **found})
    for setting, frame, ssim, size, made in points:
        near = {"ssim": ssim, "psnr": 30.0, "worst_pixel": 9.0}
        lists = {"window_size": [64, 36], "supersegments": 10, "mean_length": 2.0}
        views = [
            {
                "angle": angle,
                "to_volume": {**near},
                "seconds": times(frame * 0.01),
                "volume_seconds": times(0.01),
            }
            for angle in angles
        ]
        generation = {"seconds": times(made), "packing": None, "volume_seconds": times(1.0)}
        vdi = {**lists, "longest_list": 4, "bytes_memory": size, "bytes_saved": size // 2}
        case = {"what": "setting", "volume": "ball", **setting.changes}
        rows.append({"case": case, "vdi": vdi, "generation": generation, "angles": views})
    volume = {"name": "ball", "dimensions": [2, 2, 2], "dtype": "uint8", "bytes": 3 * 10**6}
    plan = {"volume": volume, "looks": {"cmap": "bone"}, "interpolation": "nearest"}
    plan |= {"window_size": [64, 36], "angles": list(angles), "repeats": 5, "generations": 5}
    plan |= {"settings": [setting.to_dict() for setting, *_ in points]}
    return made_up_results("tradeoff", plan, rows)


def setting_rows(data):
    return list(Results(data).rows(what="setting"))


#: One setting that is best at nothing, and three that are best at something.
FOUR = (
    (Setting(), 0.50, 0.980, 4_000_000, 5.0),
    (Setting(max_supersegments=5), 0.40, 0.960, 1_000_000, 4.0),
    (Setting(lists=2.0), 0.80, 0.990, 16_000_000, 20.0),
    (Setting(tolerance=0.1), 0.60, 0.979, 4_100_000, 6.0),
)


#: One that is slower than the volume.
SLOW = (Setting(lists=4.0), 1.5, 0.995, 64_000_000, 80.0)


def test_made_up_figures_are_of_the_schema():
    schema = json.loads(SCHEMA.read_text())
    assert faults(made_up(*FOUR), schema) == []


def test_fronts_and_dominated_settings():
    found = Tradeoff(made_up(*FOUR))
    for kind in ("frame", "memory", "file", "generation"):
        assert found.front(kind) == ["N_S 5", "default", "lists x2"]
    assert found.dominated() == {"tolerance 0.1": ["default"]}
    one = found.point("N_S 5")
    assert one.frame == pytest.approx(0.4)
    assert one.frames == {5.0: pytest.approx(0.4), 30.0: pytest.approx(0.4)}
    assert one.ssim == pytest.approx(0.96)
    assert one.generation == pytest.approx(4.0)
    assert one.frame_spread == pytest.approx(0, abs=1e-9)  # the volume's noise is the same


def test_worse_at_one_angle_is_worse():
    data = made_up(*FOUR)
    # Less than the default at 5 degrees, more at 30
    setting_rows(data)[3]["angles"][1]["to_volume"]["ssim"] = 0.9815
    assert Tradeoff(data).dominated() == {}


def test_equal_settings_are_named_once():
    found = Tradeoff(made_up(*FOUR, (Setting(skip_empty=False), *FOUR[0][1:])))
    assert "no skipping" not in found.front("memory")
    assert "no skipping" not in found.dominated()


def test_what_noise_hides_is_named_once_and_not_dominated():
    data = made_up(*FOUR, (Setting(precision="8-byte"), 0.55, 0.9799, 4_000_000, 5.0))
    frames = [row["seconds"] for row in setting_rows(data)[-1]["angles"]]
    for row in frames:
        row["clock"][0] = 0.004  # once faster than the default, in the median a tenth slower
    found = Tradeoff(data)
    assert found.point("8-byte").frame == pytest.approx(0.55)
    assert "8-byte" not in found.front("frame")
    assert "8-byte" not in found.dominated()
    for row in frames:
        row["clock"][0] = 0.0055
    assert Tradeoff(data).dominated()["8-byte"] == ["default"]


def test_a_slower_machine_in_one_round_changes_nothing():
    data = made_up(*FOUR)
    for point in setting_rows(data):
        for row in point["angles"]:
            for name in ("seconds", "volume_seconds"):
                row[name]["clock"][2] *= 7
    for ours, theirs in zip(Tradeoff(data).points, Tradeoff(made_up(*FOUR)).points, strict=True):
        assert ours.frame == pytest.approx(theirs.frame)
        assert ours.frame_spread == pytest.approx(theirs.frame_spread, abs=1e-12)


def test_packing_is_part_of_generation():
    data = made_up(*FOUR)
    setting_rows(data)[0]["generation"]["packing"] = {"clock": [0.5] * 5, "device": []}
    assert Tradeoff(data).point("default").generation == pytest.approx(5.5, rel=0.01)


def test_a_file_that_had_no_room_leaves_the_rest():
    data = made_up(*FOUR)
    setting_rows(data)[2]["vdi"]["bytes_saved"] = None
    found = Tradeoff(data)
    assert found.front("file") == ["N_S 5", "default"]
    assert found.front("memory") == ["N_S 5", "default", "lists x2"]
    assert found.dominated() == {"tolerance 0.1": ["default"]}
    assert "| - |" in found.table()


def test_the_table_says_where_volumes_win():
    text = Tradeoff(made_up(*FOUR)).table()
    assert "cmap bone, nearest sampling" in text
    # Without skipping twice as slow, VTK three times; nobody is slower than either
    assert "| 5 | 10 | 2.00 | 3.00 | - | 0.50 | 0 of 4 | 0 of 4 |" in text
    assert "- tolerance 0.1: by default" in text
    text = Tradeoff(made_up(*FOUR, SLOW)).table()
    assert "| 0.50 | 1 of 5 | 0 of 5 |" in text
    rows = [line for line in text.splitlines() if line.startswith("| N_S 5 | 0.40")]
    heads = [line for line in text.splitlines() if line.startswith("| setting | frame /")]
    assert len(rows) == 2  # in the front, and among all
    assert [row.count("|") for row in rows] == [head.count("|") for head in heads]


def labels(figure):
    """Return the boxes of the names on each panel, without their lines, pixels."""
    from matplotlib.text import Annotation, Text

    renderer = figure.canvas.get_renderer()
    return [
        {
            text.get_text(): Text.get_window_extent(text, renderer)
            for text in panel.texts
            if isinstance(text, Annotation)
        }
        for panel in figure.axes
    ]


def test_the_plot_names_the_front_and_no_names_overlap():
    pytest.importorskip("matplotlib")
    rng = np.random.default_rng(5)
    # A front of fifteen settings close together, as a full sweep has it
    dense = [Setting(max_supersegments=n, lists=2.0, precision="8-byte") for n in range(2, 17)]
    crowd = [
        (setting, 0.3 * 1.06**i, 0.97 + 0.0011 * i, int(1e6 * 1.1**i), 4 * 1.06**i)
        for i, setting in enumerate(dense)
    ]
    dominated = [
        (Setting(tolerance=float(t)), 1.0, 0.96, 9_000_000, 9.0) for t in rng.uniform(0, 1, 6)
    ]
    found = Tradeoff(made_up(*crowd, *dominated))
    figure = found.plot()
    figure.canvas.draw()
    kinds = ("frame", "memory", "generation")
    for panel, boxes, kind in zip(figure.axes, labels(figure), kinds, strict=True):
        assert list(boxes) == found.front(kind)
        assert len(boxes) == 15
        for (a, one), (b, other) in itertools.combinations(boxes.items(), 2):
            assert not one.overlaps(other), (kind, a, b)
        beside = panel.get_window_extent()
        neighbours = [other.get_window_extent().x0 for other in figure.axes]
        end = min([x for x in neighbours if x > beside.x1], default=figure.bbox.x1)
        for box in boxes.values():
            assert beside.x1 < box.x0 < box.x1 < end
            assert beside.y0 <= box.y0 <= box.y1 <= beside.y1


def test_the_limits_do_not_overlap_either():
    pytest.importorskip("matplotlib")
    data = made_up(*FOUR, SLOW)
    for row in Results(data).rows(
        what="volume rendering"
    ):  # VTK is nearly as fast as render_volume
        row["seconds"]["vtk_gpu"]["clock"] = [0.0101] * 5
    figure = Tradeoff(data).plot()
    figure.canvas.draw()
    from matplotlib.text import Annotation

    texts = [text for text in figure.axes[0].texts if not isinstance(text, Annotation)]
    assert {text.get_text().strip() for text in texts} == {"render_volume", "VTK, faster mapper"}
    one, other = (text.get_window_extent() for text in texts)
    assert not one.overlaps(other)


def test_an_axis_of_less_than_a_decade_has_numbers():
    pytest.importorskip("matplotlib")
    # Frames from .6 to 1.2, where 1 is the only 1, 2 or 5
    figure = Tradeoff(made_up(*((one, 1.5 * frame, *rest) for one, frame, *rest in FOUR))).plot()
    figure.canvas.draw()
    for panel in figure.axes:
        low, high = panel.get_xlim()
        assert sum(low < x < high for x in panel.get_xticks()) >= 2


def test_the_plot_is_written_whole(tmp_path):
    pytest.importorskip("matplotlib")
    path = Tradeoff(made_up(*FOUR)).save_plot(tmp_path / "a.png")
    assert path.read_bytes().startswith(b"\x89PNG")
    with pytest.raises(InvalidArgumentError, match="nothing was measured"):
        Tradeoff(made_up()).plot()


def test_exact_pictures_can_be_drawn():
    pytest.importorskip("matplotlib")
    exact = [(setting, frame, 1.0, size, made) for setting, frame, _, size, made in FOUR]
    figure = Tradeoff(made_up(*exact)).plot()
    figure.canvas.draw()
    assert all(np.isfinite(panel.get_ylim()).all() for panel in figure.axes)
