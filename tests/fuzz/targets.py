"""What is fuzzed: functions of bytes that raise nothing while the package keeps its promises.

A target draws what it does from :class:`~fuzz.choices.Choices`, so that any engine can drive it:
hypothesis in the test suite (``test_fuzz.py``), atheris by ``run.py``. The promises are those of
``docs/dev/robustness.md``: whatever comes in, only the package's own errors come out; nothing is
written but the target that was named; memory stays within what a file could hold.
"""

from __future__ import annotations

import base64
import contextlib
import hashlib
import io as text_io
import itertools
import json
import os
import re
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
from pyvista_vdi import VDI, Camera, DeferredVDI, TransferFunction, Volume, cli, io
from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import VDIError, VDIWarning
from pyvista_vdi.extensions.series import series as series_files
from pyvista_vdi.extensions.sets import vdi_set as set_files
from pyvista_vdi.extensions.web import source as served
from pyvista_vdi.extensions.web.page import DATA_TYPE
from pyvista_vdi.extensions.web.page import page as page_of

#: Bytes that a byte of a file may become (docs/dev/robustness.md): 128 KiB from 4 bytes is
#: Zstandard's best, and an array is held twice while it is decoded, a third time as the VDI's.
VDI_RATIO = 3 * 2**15
#: Bytes that reading takes for itself, whatever the file.
OWN_BYTES = 8 * 2**20

#: What a device may be asked for while fuzzing: pictures and VDIs stay small.
DEVICE_BYTES = 64 * 2**20

#: A page's element with the VDI, in base64.
_DATA = re.compile(rb'<script type="%b">([^<]*)' % re.escape(DATA_TYPE).encode())

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
    importance = [(-1000, 0), (3000, 1)] if index % 2 else None
    about = {"value_range": (-1000, 3000), "unit_distance": 1.5, "importance": importance}
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


@cache
def _page(index: int, precision: str) -> bytes:
    return page_of(base_vdi(index), precision=precision)


def html_patches(data: bytes) -> None:
    """A page of ours that is broken, in the text or in the ``.vdi`` that the text holds."""
    choices = Choices(data)
    page = _page(choices.integer(0, 7), choices.pick(("8-byte", "exact")))
    for _ in range(choices.integer(1, 3)):
        parts = list(_DATA.finditer(page))
        kind = choices.integer(0, 3)
        if kind == 0 or not parts:
            page = choices.patched(page)
        elif kind == 1:
            begin, end = choices.pick(parts).span(1)  # base64 is most of a page, but not all
            page = page[:begin] + choices.patched(page[begin:end]) + page[end:]
        elif kind == 2:
            begin, end = choices.pick(parts).span(1)
            with contextlib.suppress(ValueError):  # broken before
                held = choices.patched(base64.b64decode(page[begin:end]))
                page = page[:begin] + base64.b64encode(held) + page[end:]
        else:
            begin, end = choices.pick(parts).span()
            place = choices.integer(0, len(page))
            piece = page[begin:end] + b"</script>"
            page = choices.pick((page[:begin] + page[end:], page[:place] + piece + page[place:]))
    _read_all("html", page)


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


def vtk_form(data: bytes) -> None:
    """The canonical VTK image, damaged, and back to a VDI."""
    from pyvista_vdi.vtk_pipeline.filters.convert import vdi_from_image, vdi_to_image
    from pyvista_vdi.vtk_pipeline.vtk import numpy_to_vtk, vtk_to_numpy, vtkStringArray

    choices = Choices(data)
    image = vdi_to_image(base_vdi(choices.integer(0, 15)))
    field, points = image.GetFieldData(), image.GetPointData()
    for _ in range(choices.integer(1, 3)):
        kind = choices.integer(0, 5)
        if kind == 0:
            image.SetDimensions(*(choices.pick((1, 2, 0, 7, 300)) for _ in range(3)))
        elif kind == 1:
            text = field.GetAbstractArray("vdi")
            if text is not None and text.GetNumberOfValues():
                with contextlib.suppress(ValueError, RecursionError):
                    about = choices.edited(json.loads(text.GetValue(0)))
                    text.SetValue(0, json.dumps(about))
        elif kind == 2:
            text = vtkStringArray()
            text.SetName("vdi")
            if not choices.chance(4):
                text.InsertNextValue(choices.pick(("", "[]", "{", '"x"', "[" * 3000, "1" * 5000)))
            field.AddArray(text)
        elif kind == 3:
            field.RemoveArray(choices.pick(("front", "back", "color", "optical_depth", "vdi")))
        else:
            where, name = choices.pick(
                [(field, name) for name in ("front", "back", "color", "optical_depth")]
                + [(points, "count")]
            )
            array = where.GetArray(name)
            if array is None:
                continue
            changed = _changed_array(choices, vtk_to_numpy(array).copy())
            if not isinstance(changed, np.ndarray) or changed.dtype.kind not in "uif":
                continue
            if changed.dtype == np.float16 or changed.ndim > 2:  # VTK has no such arrays
                continue
            native = np.ascontiguousarray(changed, changed.dtype.newbyteorder("="))
            replaced = numpy_to_vtk(native, deep=True)
            replaced.SetName(name)
            where.AddArray(replaced)
    with only_our_errors():
        _check_valid(vdi_from_image(image))


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
            "--transfer-function --sample-distance --scalars --preference --tf --device "
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


class _Session:
    """A user who does one thing after the other, some of them wrong."""

    def __init__(self, choices: Choices) -> None:
        self.choices = choices
        self.volume = Volume(np.arange(60, dtype=np.uint8).reshape(3, 4, 5))
        self.camera = Camera((2, 1.5, 12), (2, 1.5, 1), (0, 1, 0))
        self.table = TransferFunction(np.eye(3), [0.0, 0.3, 0.6], (0, 60), interpolation="linear")
        self.vdi = base_vdi(1)
        self.steps: tuple[Callable[[], None], ...] = (
            *(self.generate, self.render, self.render_volume, self.take_camera, self.take_volume),
            *(self.take_table, self.save_and_read, self.through_vtk, self.edit_vdi, self.classify),
            self.estimate,
        )

    def run(self) -> None:
        for _ in range(self.choices.integer(1, 6)):
            # Where numbers leave float32's range is for the tests of numerics: here they may warn
            with only_our_errors(RuntimeWarning):
                self.choices.pick(self.steps)()

    def size(self) -> Any:
        sizes = ((7, 5), (1, 1), (16, 16), (33, 2), (0, 1), (65536, 65536), None, "ab", 2**40)
        return self.choices.pick(sizes)

    def planes(self) -> Any:
        if not self.choices.chance(3):
            return None
        n_planes = self.choices.integer(0, 2)
        return [[self.choices.number() for _ in range(6)] for _ in range(n_planes)]

    def ends(self, size: Any) -> Any:
        if not self.choices.chance(3) or not isinstance(size, tuple) or max(size) > 100:
            return None
        return np.full(size[::-1], self.choices.number(), np.float64)

    def cuts(self, size: Any) -> dict[str, Any]:
        return {"clipping_planes": self.planes(), "opaque_depth": self.ends(size)}

    def options(self, known: dict[str, tuple[Any, ...]]) -> dict[str, Any]:
        given = {}
        for name, values in known.items():
            if self.choices.chance(3):
                given[name] = self.choices.pick((*values, *JUNK))
        return given

    def generate(self) -> None:
        options = self.options(
            {"max_supersegments": (1, 5, 20), "tolerance": (0.1,), "view_cone": (0, 90, 30)}
        )
        seldom = {name: options.pop(name) for name in ("tolerance", "view_cone") if name in options}
        step = self.choices.pick((None, 0.5, 3, 0, "x", float("nan"), 1e300, -1))
        made = pvdi.generate(
            *(self.volume, self.camera, self.size()),
            transfer_function=self.table,
            settings=pvdi.Settings(sample_distance=step, **seldom),
            **options,
        )
        _check_valid(made)
        self.vdi = made

    def render(self) -> None:
        size = self.size()
        image = pvdi.render(*(self.vdi, self.camera, size), **self.cuts(size))
        self.check_image(image, size or self.vdi.window_size)

    def render_volume(self) -> None:
        size = self.size()
        image = pvdi.render_volume(
            *(self.volume, self.camera, size), transfer_function=self.table, **self.cuts(size)
        )
        self.check_image(image, size)

    @staticmethod
    def check_image(image: Any, size: Any) -> None:
        assert image.shape == (size[1], size[0], 4)
        assert image.dtype == np.float32
        assert np.isfinite(image).all(), "a pixel is not finite"
        assert image.min() >= 0
        assert image.max() <= 1 + 2.0**-20

    def take_camera(self) -> None:
        kind = self.choices.integer(0, 3)
        if kind == 0:
            self.camera = self.camera.azimuth(self.choices.number())
        elif kind == 1:
            names = ("position", "focal_point", "view_up", "view_angle", "parallel_scale")
            name = self.choices.pick((*names, "parallel_projection", "window_center"))
            value = self.choices.junk()
            if self.choices.chance(2):
                value = [self.choices.number() for _ in range(3)]
            self.camera = self.camera.replace(**{name: value})
        elif kind == 2:
            self.camera = Camera.from_dict(self.choices.edited(self.camera.to_dict()))
        else:
            self.camera = self.vdi.camera

    def take_volume(self) -> None:
        choices = self.choices
        shape = tuple(choices.pick((2, 3, 5, 1, 0)) for _ in range(choices.pick((3, 2, 4))))
        dtype = choices.pick(("u1", "i2", "f4", "f8", "i8", "u4", "?", "c8", "O", "S3", "f2"))
        values = np.zeros(shape, "f8")
        for _ in range(choices.integer(0, 5)):
            if values.size:
                values.reshape(-1)[choices.integer(0, values.size - 1)] = choices.number()
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            values = values.astype(dtype)
        spacing = [choices.pick((1, 0.25, 3, 0, -1, 1e-9, 1e9, np.nan, 1e300)) for _ in range(3)]
        self.volume = Volume(
            values if not choices.chance(8) else choices.junk(),
            spacing if not choices.chance(8) else choices.junk(),
            choices.pick(((0, 0, 0), (1e7, -1e7, 0), (np.inf, 0, 0), *JUNK)),
            choices.pick((None, np.eye(3)[::-1], np.zeros((3, 3)), *JUNK)),
        )

    def take_table(self) -> None:
        choices = self.choices
        n = choices.integer(1, 4)
        arguments: dict[str, Any] = {
            "colors": [[0.5, choices.number(), 1] if choices.chance(3) else [0, 0.5, 1]] * n,
            "opacities": [choices.pick((0, 0.3, 1, 2**-24, 1 - 2**-24, -1, 2)) for _ in range(n)],
            "scalar_range": (choices.pick((0, -3, 2.5)), choices.pick((60, 2.5, 1e9, -9))),
            "unit_distance": choices.pick((None, 1.0, 1e-8, 1e8, 0, -1)),
            "interpolation": choices.pick(("linear", "nearest", "cubic")),
        }
        if choices.chance(3):
            arguments[choices.pick(sorted(arguments))] = choices.junk()
        if choices.chance(6):
            state = choices.edited(TransferFunction(np.eye(3), [0, 0, 1], (0, 1)).to_dict())
            self.table = TransferFunction.from_dict(state)
        else:
            self.table = TransferFunction(**arguments)

    def save_and_read(self) -> None:
        choices = self.choices
        name = choices.pick(("a.vdi", "a.exr", "a.png", "no/a.vdi", "a\0.vdi", ""))
        options = {}
        if choices.chance(2):
            options["compression"] = choices.pick(("lz4", "none", "zstd", *JUNK))
        if choices.chance(4):
            options["level"] = choices.pick((9, *JUNK))
        target = work_folder() / name if name else choices.junk()
        path = self.vdi.save(target, **options)
        try:
            io.read_info(path)
            back = io.read(path)
        finally:
            path.unlink()
        assert path.suffix == ".exr" or back.equals(self.vdi)  # which rounds
        self.vdi = back

    def through_vtk(self) -> None:
        from pyvista_vdi.vtk_pipeline.filters.convert import vdi_from_image, vdi_to_image

        back = vdi_from_image(vdi_to_image(self.vdi))
        assert back.equals(self.vdi)

    def edit_vdi(self) -> None:
        choices, vdi = self.choices, self.vdi
        arrays = _arrays(vdi)
        name = choices.pick(sorted(arrays))
        arrays[name] = _changed_array(choices, arrays[name])
        origin = choices.pick((vdi.depth_origin, 0.0, choices.number()))
        self.vdi = _with(vdi, depth_origin=origin, **arrays)

    def classify(self) -> None:
        given = self.options(
            {
                "cmap": ("bone", "viridis", ["red", "blue"], [[0, 0, 1]]),
                "opacity": ("sigmoid_6", "linear", [0, 0.5, 1], 0.4),
                "clim": ((0, 30), (5, 5), 30),
                "n_colors": (2, 256),
                "log_scale": (True,),
                "flip_scalars": (True,),
                "opacity_unit_distance": (2.0,),
                "blending": ("composite",),
                "interpolation": ("linear", "nearest"),
                "shade": (True,),
                "ambient": (0.3,),
                "specular_power": (5.0,),
            }
        )
        made = pvdi.generate(self.volume, self.camera, (6, 5), **given)
        _check_valid(made)

    def estimate(self) -> None:
        limit = self.choices.pick((20, 1, *JUNK))
        pvdi.estimate(self.volume, self.size(), max_supersegments=limit)


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


def public_functions(data: bytes) -> None:
    """The public functions in any order, with arguments that make sense, or do not."""
    with limited():
        _Session(Choices(data)).run()


#: Every target by name.
TARGETS: dict[str, Callable[[bytes], None]] = {
    target.__name__: target
    for target in (
        *map(_any_bytes, READERS),
        *(
            vdi_members,
            deferred_members,
            archive_heads,
            html_patches,
            served_messages,
        ),
        *(validator, vtk_form, command_line, public_functions),
    )
}
