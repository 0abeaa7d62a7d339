"""What is fuzzed: functions of bytes that raise nothing while the package keeps its promises.

A target draws what it does from :class:`~fuzz.choices.Choices`, so that any engine can drive it:
hypothesis in the test suite (``test_fuzz.py``), atheris by ``run.py``. The promises are those of
``docs/dev/robustness.md``: whatever comes in, only the package's own errors come out; nothing is
written but the target that was named; memory stays within what a file could hold.
"""

from __future__ import annotations

import contextlib
import hashlib
import io as text_io
import itertools
import json
import os
import tempfile
import tracemalloc
import warnings
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import psutil
from fuzz.choices import JUNK, NUMBERS, Choices
from strategies import kept_values, random_vdi

import pyvista_vdi as pvdi
from pyvista_vdi import VDI, DeferredVDI, TransferFunction, cli, io
from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import VDIError, VDIWarning
from pyvista_vdi.extensions.series import series as series_files
from pyvista_vdi.extensions.sets import vdi_set as set_files
from pyvista_vdi.extensions.web import source as served

#: Bytes that a byte of a file may become (docs/dev/robustness.md): 128 KiB from 4 bytes is
#: Zstandard's best, and an array is held twice while it is decoded, a third time as the VDI's.
VDI_RATIO = 3 * 2**15
#: Bytes that reading takes for itself, whatever the file.
OWN_BYTES = 8 * 2**20

#: What a device may be asked for while fuzzing: pictures and VDIs stay small.
DEVICE_BYTES = 64 * 2**20

#: A look for what has none.
DARKENING = TransferFunction([[1, 1, 1], [0, 0, 0]], [0, 1], (-1000, 3000))

COMPRESSIONS = ("zstd", "lz4", "deflate", "none")


@contextlib.contextmanager
def only_our_errors(*allowed: type[Warning]) -> Iterator[None]:
    """Let the package's errors pass for success; every other one, and any warning, comes out."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for kind in (VDIWarning, *allowed):
            warnings.simplefilter("ignore", kind)
        with contextlib.suppress(VDIError):
            yield


@cache
def work_folder() -> Path:
    """A folder of this process for files that targets read and write."""
    return Path(tempfile.mkdtemp(prefix="pyvista_vdi_fuzz_"))


@cache
def base_vdi(index: int = 0) -> VDI:
    """Small valid VDIs to start from: perspective and parallel ones, with and without lists."""
    rng = np.random.default_rng(index)
    return random_vdi(rng, max_window=(6, 4), max_supersegments=index % 4)


@contextlib.contextmanager
def limited(device_bytes: int = DEVICE_BYTES) -> Iterator[None]:
    """Pretend that device and host are small, so that absurd sizes are refused, not tried."""
    runtime, memory = get_runtime(), psutil.virtual_memory
    info = runtime.info
    runtime.info = replace(
        info, max_allocation=device_bytes, global_memory=runtime.allocated + 4 * device_bytes
    )
    small = SimpleNamespace(total=4 * device_bytes, available=4 * device_bytes)
    psutil.virtual_memory = lambda: small
    try:
        yield
    finally:
        runtime.info, psutil.virtual_memory = info, memory


def _steps_of(path: Path) -> Iterator[VDI]:
    """The steps of a series that can be read; the first ones, where it has many."""
    steps = series_files.read(path)
    for i in range(min(len(steps), 6)):
        with contextlib.suppress(VDIError):
            yield steps[i]


def _views_of(path: Path) -> Iterator[VDI]:
    """The VDIs of a set that can be read."""
    vdi_set = set_files.read(path)
    vdi_set.weights(vdi_set.cameras[0])
    for i in range(min(len(vdi_set), 6)):
        with contextlib.suppress(VDIError):
            yield vdi_set[i]


#: Of each kind of file: bytes that a byte may become, what says what is in it, what reads it.
READERS: dict[str, tuple[int, Callable[[Path], Any], Callable[[Path], Iterable[VDI]]]] = {
    "vdi": (VDI_RATIO, io.read_info, lambda path: [io.read(path)]),
    "html": (VDI_RATIO, io.read_info, lambda path: [io.read(path)]),
    "vdis": (VDI_RATIO, series_files.read_info, _steps_of),
    "vdiset": (VDI_RATIO, set_files.read_info, _views_of),
}


def _read_all(kind: str, content: bytes) -> None:
    """Read content as a file of that kind, within the memory that it could hold."""
    ratio, about, vdis = READERS[kind]
    folder = work_folder()
    path = folder / f"content.{kind}"
    path.write_bytes(content)
    before = sorted(folder.iterdir())
    tracing = tracemalloc.is_tracing()
    if not tracing:
        tracemalloc.start()
    try:
        tracemalloc.reset_peak()
        start = tracemalloc.get_traced_memory()[0]
        with only_our_errors():
            about(path)
        with only_our_errors():
            for vdi in vdis(path):
                _check_valid(vdi)
        peak = tracemalloc.get_traced_memory()[1] - start
    finally:
        if not tracing:
            tracemalloc.stop()
    allowed = ratio * len(content) + OWN_BYTES
    assert peak <= allowed, f"{peak} bytes were taken for a file of {len(content)}"
    assert path.read_bytes() == content, "reading changed the file"
    assert sorted(folder.iterdir()) == before, "reading left files behind"


def _any_bytes(kind: str) -> Callable[[bytes], None]:
    """Any bytes as a file of a kind."""

    def target(data: bytes) -> None:
        _read_all(kind, data)

    target.__name__ = f"{kind}_bytes"
    return target


@cache
def base_deferred(index: int = 0) -> DeferredVDI:
    """The same lists with values in place of colours."""
    lists = base_vdi(index)
    mean, spread, share = lists.color.T
    about = {"value_range": (-1000, 3000), "unit_distance": 1.5}
    return kept_values(lists, mean, spread / 2, share, **about)


@cache
def _vdi_members(
    index: int, compression: str, precision: str, deferred: bool = False
) -> dict[str, bytes]:
    options = {"compression": compression, "precision": precision}
    base = base_deferred(index) if deferred else base_vdi(index)
    path = base.save(work_folder() / "base.vdi", **options)
    with zipfile.ZipFile(path) as archive:
        members = {info.filename: archive.read(info) for info in archive.infolist()}
    path.unlink()
    return members


def vdi_members(data: bytes) -> None:
    """A ``.vdi`` file whose members were changed, with checksums that fit."""
    choices = Choices(data)
    precision = choices.pick(("exact", "8-byte"))
    members = _vdi_members(choices.integer(0, 7), choices.pick(COMPRESSIONS), precision)
    _read_changed(choices, dict(members))


def deferred_members(data: bytes) -> None:
    """The same of a ``.vdi`` file that keeps values."""
    choices = Choices(data)
    precision = choices.pick(("exact", "8-byte"))
    index, compression = choices.integer(0, 7), choices.pick(COMPRESSIONS)
    _read_changed(choices, dict(_vdi_members(index, compression, precision, True)))


def _read_changed(choices: Choices, members: dict[str, bytes]) -> None:
    """Change members of a ``.vdi`` file, and read what that is."""
    description = json.loads(members["vdi.json"])
    for _ in range(choices.integer(0, 3)):
        description = choices.edited(description)
    text = json.dumps(description)
    members["vdi.json"] = text.encode("utf-8", "surrogatepass")
    for _ in range(choices.integer(0, 3)):
        name = choices.pick(sorted(members))
        members[name] = choices.patched(members[name])
    buffer = text_io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in members.items():
            archive.writestr(zipfile.ZipInfo(name), content)
    content = buffer.getvalue()
    _read_all("vdi", choices.patched(content) if choices.chance(8) else content)


@cache
def _archive_members(kind: str, index: int, compression: str) -> dict[str, bytes]:
    """What is in a small series, or a small set."""
    first = base_vdi(index)
    vdis = [_with(first, camera=first.camera.azimuth(angle)) for angle in (0, 20, 40)]
    several: Any = pvdi.VDISeries if kind == "vdis" else pvdi.VDISet
    path = several(vdis).save(work_folder() / f"base.{kind}", compression=compression)
    with zipfile.ZipFile(path) as archive:
        members = {info.filename: archive.read(info) for info in archive.infolist()}
    path.unlink()
    return members


def archive_heads(data: bytes) -> None:
    """A series or a set whose JSON was changed, with a checksum that fits, or whose bytes were."""
    choices = Choices(data)
    kind = choices.pick(("vdis", "vdiset"))
    members = dict(_archive_members(kind, choices.integer(0, 7), choices.pick(COMPRESSIONS)))
    name = "series.json" if kind == "vdis" else "set.json"
    head = json.loads(members[name])
    for _ in range(choices.integer(0, 3)):
        head = choices.edited(head)
    members[name] = json.dumps(head).encode("utf-8", "surrogatepass")
    buffer = text_io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in members.items():
            archive.writestr(zipfile.ZipInfo(name), content)
    content = buffer.getvalue()
    _read_all(kind, choices.patched(content) if choices.chance(4) else content)


def _arrays(vdi: VDI) -> dict[str, Any]:
    names = ("offsets", "front", "back", "color", "optical_depth")
    return {name: np.array(getattr(vdi, name)) for name in names}


def _with(vdi: VDI, **changes: Any) -> VDI:
    """A VDI with other arguments, without its metadata."""
    names = ("camera", "window_size", "bounds", "depth_origin")
    return VDI(**{**{name: getattr(vdi, name) for name in names}, **_arrays(vdi), **changes})


def _changed_array(choices: Choices, array: Any) -> Any:
    """An array made wrong, or right in another way: type, order, shape, single values."""
    kind = choices.integer(0, 8)
    if kind == 0:
        return choices.junk()
    if kind == 1:
        dtype = choices.pick(
            ("f8", "f4", "f2", "i8", "u1", "i4", "c16", "S4", "U4", "O", "?", "M8")
        )
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                return array.astype(dtype)
            except (TypeError, ValueError, OverflowError):
                return array
    if kind == 2:
        return array[: choices.integer(0, len(array))]
    if kind == 5:
        return array.reshape(-1, *([1] * choices.integer(0, 2)), *array.shape[1:])
    if kind == 3:
        return array[::-1]
    if kind == 4:
        return np.concatenate([array, array])
    if kind == 6:
        return array.tolist()
    if kind == 7:
        return array.astype(array.dtype.newbyteorder())
    changed = array.copy()
    for _ in range(choices.integer(1, 3)):
        if changed.size:
            with np.errstate(all="ignore"), contextlib.suppress(ValueError, OverflowError):
                changed.reshape(-1)[choices.integer(0, changed.size - 1)] = choices.number()
    return changed


def _check_valid(vdi: VDI | DeferredVDI) -> None:
    """Check a VDI that was accepted by docs/dev/conventions.md, written another way."""
    if isinstance(vdi, DeferredVDI):
        for values, most in ((vdi.mean, 1), (vdi.spread, 0.5), (vdi.share, 1)):
            assert all(0 <= float(value) <= most for value in values)
        assert -np.inf < vdi.value_range[0] < vdi.value_range[1] < np.inf
        _check_valid(vdi.classified(transfer_function=DARKENING))
        vdi = vdi.lists
    width, height = vdi.window_size
    starts = [int(o) for o in vdi.offsets]
    assert len(starts) == width * height + 1
    assert starts[0] == 0
    assert starts[-1] == len(vdi.front) == len(vdi.back) == len(vdi.optical_depth)
    assert vdi.color.shape == (starts[-1], 3)
    origin = float(vdi.depth_origin)
    for first, last in itertools.pairwise(starts):
        assert first <= last
        end = -np.inf
        for k in range(first, last):
            front, back = float(vdi.front[k]), float(vdi.back[k])
            assert end <= front < back < np.inf
            assert vdi.camera.parallel_projection or front + origin >= -abs(origin) * 2**-50
            assert 0 <= float(vdi.optical_depth[k]) < np.inf
            assert all(0 <= float(c) <= 1 for c in vdi.color[k])
            end = back


def validator(data: bytes) -> None:
    """``VDI(...)`` of arguments made wrong, or right in another way."""
    choices = Choices(data)
    base = base_vdi(choices.integer(0, 15))
    arguments: dict[str, Any] = {**_arrays(base), "metadata": {"made": "up"}}
    for name in ("camera", "window_size", "bounds", "depth_origin"):
        arguments[name] = getattr(base, name)
    for _ in range(choices.integer(1, 3)):
        name = choices.pick(sorted(arguments))
        value = arguments[name]
        is_array = isinstance(value, np.ndarray)
        arguments[name] = _changed_array(choices, value) if is_array else choices.junk()
    with only_our_errors():
        vdi = VDI(**arguments)
        _check_valid(vdi)
        path = work_folder() / "valid.vdi"
        vdi.save(path)
        assert io.read(path).equals(vdi)


@cache
def command_folder() -> Path:
    """A folder with what commands may be given: a volume, tables, views, VDIs and rubbish."""
    import nrrd

    folder = Path(tempfile.mkdtemp(prefix="pyvista_vdi_fuzz_cli_"))
    z, y, x = np.mgrid[:6, :5, :4]
    nrrd.write(str(folder / "v.nrrd"), (x * y + z).astype(np.uint8), index_order="C")
    table = TransferFunction([(0, 0, 0.2), (1, 0.5, 0)], [0, 0.5], (0, 17))
    (folder / "tf.json").write_text(json.dumps(table.to_dict()))
    (folder / "camera.json").write_text(json.dumps(base_vdi(1).camera.to_dict()))
    (folder / "list.json").write_text("[1, 2]")
    (folder / "deep.json").write_text("[" * 20000)
    (folder / "half.vdi").write_bytes(base_vdi(1).save(folder / "a.vdi").read_bytes()[:-40])
    base_vdi(3).save(folder / "a.exr")
    (folder / "rubbish.nrrd").write_bytes(b"NRRD0004\ntype: int\ndimension: 3\nsizes: -1 9 9\n\n")
    (folder / "rubbish.vti").write_text("<VTKFile type='ImageData'><ImageData WholeExtent='0")
    (folder / "empty.vdi").touch()
    (folder / "folder.vdi").mkdir()
    return folder


_INPUTS = (
    *("a.vdi", "a.exr", "half.vdi", "empty.vdi", "folder.vdi", "none.vdi", "v.nrrd", "tf.json"),
    *("rubbish.nrrd", "rubbish.vti", "camera.json", ".", "", "ü.vdi", "x" * 300),
)
_VOLUMES = ("v.nrrd", "v.nrrd", "v.nrrd", *_INPUTS)
_OUTPUTS = (
    *("out.vdi", "out.exr", "out.png", "out.vdi", "out.png", "out", "no/out.vdi", "folder.vdi"),
    *("", ".vdi", "x" * 300 + ".vdi", "\x1b[31m.vdi", "out.PNG", "out.VDI"),
)
_SIZES = ("8x6", "1x1", "16X9", "0x3", "65537x1", "65536x65536", "9", "x", "-1x5", "٣x٤", "")
_TEXTS = (
    *(repr(n) for n in NUMBERS),
    *(text for text in JUNK if isinstance(text, str) and "\0" not in text),
    *("bone", "viridis", "linear", "sigmoid_6", "0,0.5,1", "0,x", "0,2", "nan,1", "white", "#12"),
    *("values", "point", "nearest", "soft", "-5", "--", "-x", "1e-12", "4096", "20"),
)
#: Lengths of steps: none is so short that a ray takes millions.
_STEPS = ("0.5", "1", "0", "-1", "nan", "inf", "1e300", "1e-12", "x", "2")

#: Of each verb: what it needs, and options.
_VERBS: dict[str, tuple[tuple[Any, ...], str]] = {
    "generate": (
        ((_VOLUMES,), ("-o", _OUTPUTS), ("--size", _SIZES)),
        (
            "--max-supersegments --tolerance --view-cone --clim --opacity --cmap --level --channel "
            "--time-index --compression-level --compression --position --focal-point --view-up "
            "--azimuth --elevation --view-angle --parallel-scale --camera-json --n-colors "
            "--transfer-function --sample-distance --scalars --preference --device "
            "--opacity-unit-distance --log-scale --flip-scalars --memory-limit"
        ),
    ),
    "render": (
        ((_INPUTS,), ("-o", _OUTPUTS), ("--size", _SIZES)),
        (
            "--background --position --focal-point --view-up --azimuth --device --elevation "
            "--view-angle --parallel-scale --camera-json"
        ),
    ),
    "convert": (
        ((_INPUTS,), ("-o", _OUTPUTS)),
        "--compression-level --compression --camera-json --thickness --standard-channels",
    ),
    "info": (((_INPUTS,),), "--json"),
    "devices": ((), "--json"),
}
#: Which verb: what does most is tried most.
_TRIED = ("generate", "generate", "generate", "render", "render", "convert", "convert", "info")
_SWITCHES = ("--json", "--log-scale", "--flip-scalars", "--standard-channels")
_TABLES = ("tf.json", "camera.json", "list.json", "deep.json", "a.vdi", "none.json", ".", "")


def _arguments(choices: Choices) -> list[str]:
    verb = choices.pick((*_TRIED, "devices")) if choices.chance(16) else choices.pick(_TRIED)
    required, optional = _VERBS[verb]
    arguments = [verb]
    for wanted in required:
        if not choices.chance(24):
            *flag, values = wanted
            arguments += [*flag, choices.pick(values)]
    for _ in range(choices.integer(0, 4)):
        name = choices.pick(optional.split())
        arguments.append(name)
        if name in _SWITCHES:
            continue
        if name in ("--transfer-function", "--camera-json"):
            arguments.append(choices.pick(_TABLES))
        elif name == "--sample-distance":
            arguments.append(choices.pick(_STEPS))
        elif name in ("--position", "--focal-point", "--view-up"):
            arguments += [choices.pick(_TEXTS) for _ in range(3)]
        else:
            arguments.append(choices.pick(_TEXTS))
            if name == "--clim":
                arguments.append(choices.pick(_TEXTS))
    if choices.chance(24):
        arguments.insert(choices.integer(0, len(arguments)), choices.pick(_TEXTS))
    return arguments


def _digest(folder: Path) -> dict[str, str]:
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "folder"
        for path in folder.iterdir()
    }


def command_line(data: bytes) -> None:
    """The command with arguments that make sense, or do not."""
    folder = command_folder()
    arguments = _arguments(Choices(data))
    before, here = _digest(folder), Path.cwd()
    out, err = text_io.StringIO(), text_io.StringIO()
    os.chdir(folder)
    try:
        with (
            limited(),
            warnings.catch_warnings(),
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
        ):
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", VDIWarning)
            status = cli.main(arguments)
    finally:
        os.chdir(here)
    after = _digest(folder)
    made = sorted(set(after) - set(before))
    for name in made:
        (folder / name).unlink()
    assert {name: after.get(name) for name in before} == before, f"{arguments} changed a file"
    assert status in (0, 1, 2), f"{arguments}: status {status}"
    if status == 0:
        assert len(made) <= 1, f"{arguments} wrote {made}"
        assert not made or made[0] in arguments
    else:
        last = err.getvalue().splitlines()[-1]
        assert last.startswith("pyvista-vdi: error: "), f"{arguments}: {last}"
        assert "Traceback" not in err.getvalue()
        assert not made, f"{arguments} failed and left {made}"
        unprintable = [c for c in last if not c.isprintable()]
        assert not unprintable, f"{arguments}: control characters {unprintable} in the message"


# -- what clients of a server say ------------------------------------------------------------------

_CAMERA = {"position": [0, -5, 0], "focal_point": [0, 0, 0], "view_up": [0, 0, 1], "view_angle": 30}
_VIEW = {"type": "view", "camera": _CAMERA, "size": [64, 48]}
_SAID = (
    _VIEW,
    {**_VIEW, "camera": {**_VIEW["camera"], "parallel_scale": 2.0}},
    {"type": "time", "step": 1},
)
_OFFERS = ({"steps": 2}, {"steps": 1})


def served_messages(data: bytes) -> None:
    """What a client may say to a server: taken, and then within bounds, or refused by name."""
    choices = Choices(data)
    offer, wish = choices.pick(_OFFERS), served.Wish()
    for _ in range(choices.integer(1, 6)):
        said = choices.pick(_SAID)
        for _ in range(choices.integer(0, 3)):
            said = choices.edited(said)
        text = json.dumps(said)
        if choices.chance(3):
            text = choices.patched(text.encode()).decode("utf-8", "replace")
        with contextlib.suppress(served.BadMessageError):
            wish = served.wish_after(text, wish, offer)
        _check_wish(wish, offer)


def _check_wish(wish: served.Wish, offer: Mapping[str, Any]) -> None:
    assert type(wish.step) is int
    assert 0 <= wish.step < offer["steps"]
    hash(wish)  # what is made is looked up by it
    if wish.view is not None:
        assert all(1 <= edge <= served.MAX_PICTURE_EDGE for edge in wish.view.size)


#: Every target by name.
TARGETS: dict[str, Callable[[bytes], None]] = {
    target.__name__: target
    for target in (
        *map(_any_bytes, READERS),
        *(
            vdi_members,
            deferred_members,
            archive_heads,
            served_messages,
        ),
        *(validator, command_line),
    )
}
