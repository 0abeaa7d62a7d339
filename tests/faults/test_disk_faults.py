"""Disks that fill, processes that are killed or race while they save: whole files or old ones.

All faults are held to one promise, by the same files: hence more than 500 lines.
"""

from __future__ import annotations

import errno
import importlib
import json
import os
import shutil
import signal
import struct
import subprocess
import sys
import textwrap
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest
from fresh_python import run_python
from strategies import random_vdi

from pyvista_vdi import VDI, Camera, io
from pyvista_vdi.errors import VDIFileError
from pyvista_vdi.web.bundle import viewer_script

# The package has a function of the module's name
whole_file_module = importlib.import_module("pyvista_vdi.io.whole_file")

posix = pytest.mark.skipif(os.name != "posix", reason="POSIX signals and limits")
formats = pytest.mark.parametrize("suffix", io.SUFFIXES)

#: With processes: a `.vti` file goes the way of the others (`io.whole_file`), hence every night.
formats_in_processes = pytest.mark.parametrize(
    "suffix", [pytest.param(s, marks=[pytest.mark.slow] * (s == ".vti")) for s in io.SUFFIXES]
)

#: Where this process finds what tests share.
SUPPORT = Path(__file__).parents[1] / "support"

#: Seconds after which a test that waits for another process gives up.
PATIENCE = 600


def vdi_number(seed):
    return random_vdi(np.random.default_rng(seed), max_window=(12, 9))


def options(suffix, compression=None):
    """What a VDI is saved with so that reading gives its bits: pages are in 8 bytes by default."""
    if suffix == ".html":
        return {"precision": "exact"}  # deflated always
    return {"compression": compression} if compression else {}


def large_vdi():
    """Some 200 KiB."""
    n = 64 * 64 * 2
    front = np.tile(np.float32([1, 3]), n // 2)
    return VDI(
        Camera((0, 0, 0), (0, 0, 1), (0, 1, 0)),
        (64, 64),
        np.arange(64 * 64 + 1) * 2,
        front,
        front + np.float32(1),
        np.random.default_rng(3).random((n, 3)),
        np.ones(n),
        (-1, 1, -1, 1, 1, 4),
    )


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


# -- disks that fill -------------------------------------------------------------------------------


class FullDisk:
    """A file that takes so many calls of write, flush and seek, and then has no room."""

    def __init__(self, stream, calls):
        self._stream, self._left = stream, calls
        self.calls = 0

    def _use(self):
        self.calls += 1
        if self._left is not None and self.calls > self._left:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def write(self, data):
        self._use()
        return self._stream.write(data)

    def flush(self):
        self._use()
        self._stream.flush()

    def __getattr__(self, name):
        return getattr(self._stream, name)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self._stream.close()


@pytest.fixture
def disk(monkeypatch):
    """Lets files take ``disk.calls`` calls; ``disk.used`` says how many the last one took."""

    class Disk:
        calls = None
        used = 0
        last = None

    open_beside = whole_file_module._open_beside

    def opened(target):
        temporary, stream = open_beside(target)
        Disk.last = FullDisk(stream, Disk.calls)
        return temporary, Disk.last

    monkeypatch.setattr(whole_file_module, "_open_beside", opened)
    return Disk


@pytest.mark.every(3)
@formats
@pytest.mark.parametrize("old", [True, False])
def test_a_disk_that_fills_at_each_write(suffix, old, disk, tmp_path):
    path = tmp_path / f"a{suffix}"
    if old:
        vdi_number(1).save(path)
        before = path.read_bytes()
    disk.calls = None
    vdi_number(2).save(tmp_path / f"counted{suffix}", **options(suffix))
    calls = disk.last.calls
    (tmp_path / f"counted{suffix}").unlink()
    # VTK hands over all at once, and a page is one text
    assert calls > (1 if suffix in (".vti", ".html") else 10)
    for k in range(calls):
        disk.calls = k
        with pytest.raises(VDIFileError, match=r"could not be written: No space left on device"):
            vdi_number(2).save(path, **options(suffix))
        assert names_in(tmp_path) == [path.name] * old, k
        assert not old or path.read_bytes() == before, k
    disk.calls = None
    vdi_number(2).save(path, **options(suffix))
    assert io.read(path).equals(vdi_number(2))


@formats
@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_a_disk_that_fails_at_the_last_steps(suffix, step, monkeypatch, tmp_path):
    path = vdi_number(1).save(tmp_path / f"a{suffix}")
    before = path.read_bytes()

    def fail(*_):
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    owner = os if step == "fsync" else type(path)
    monkeypatch.setattr(owner, step, fail)
    with pytest.raises(VDIFileError, match="could not be written: Input/output error"):
        vdi_number(2).save(path)
    monkeypatch.undo()
    assert path.read_bytes() == before
    assert names_in(tmp_path) == [path.name]


@pytest.mark.every(3)
@posix
@formats
def test_a_limit_of_the_size_of_files(suffix, tmp_path):
    """What a quota does: the kernel itself refuses the write."""
    path = vdi_number(1).save(tmp_path / f"a{suffix}")
    before = path.read_bytes()
    done = run_python(
        f"""
import resource, sys
sys.path.insert(0, {str(SUPPORT)!r})
import numpy as np
from strategies import random_vdi
from pyvista_vdi.errors import VDIFileError
vdi = random_vdi(np.random.default_rng(2), max_window=(40, 30))
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
try:
    vdi.save({str(path)!r}, **{options(suffix, "none")!r})
except VDIFileError as error:
    print(error)
"""
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith("could not be written: File too large\n")
    assert path.read_bytes() == before
    assert names_in(tmp_path) == [path.name]


@pytest.mark.skipif(
    sys.platform != "linux" or os.geteuid() != 0, reason="mounts a small file system: root on Linux"
)
@formats
def test_a_file_system_that_is_full(suffix, tmp_path):
    """Not simulated: a file system of 64 KiB, or as much more as the viewer is in a page."""
    folder = tmp_path / "small"
    folder.mkdir()
    kib = 64 + (len(viewer_script()) // 1024 if suffix == ".html" else 0)
    mount = ["mount", "-t", "tmpfs", "-o", f"size={kib}k", "tmpfs", str(folder)]
    if shutil.which("mount") is None or subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("file systems cannot be mounted here")
    try:
        large = large_vdi()
        path = vdi_number(1).save(folder / f"a{suffix}")
        before = path.read_bytes()
        with pytest.raises(VDIFileError, match="could not be written: No space left on device"):
            large.save(path, **options(suffix, "none"))
        assert path.read_bytes() == before
        assert names_in(folder) == [path.name]
    finally:
        subprocess.run(["umount", str(folder)], check=True)


# -- killed processes ------------------------------------------------------------------------------

#: Saves, and stops for good at the n-th of these: a write, the file's fsync, the move, the folder's
#: fsync. Says whether the file had been moved by then.
SAVE_AND_STOP = """
import os, sys, time
sys.path.insert(0, {tests!r})
import importlib
import numpy as np
from pathlib import Path
from strategies import random_vdi
module = importlib.import_module("pyvista_vdi.io.whole_file")

left = [{moment}]
moved = []

def reached():
    left[0] -= 1
    if left[0] < 0:
        print("moved" if moved else "now", flush=True)
        time.sleep(3600)

open_beside, fsync, replace = module._open_beside, os.fsync, Path.replace

class Stream:
    def __init__(self, stream):
        self.stream = stream
    def write(self, data):
        reached()
        written = self.stream.write(data)
        self.stream.flush()  # so that half a file is on the disk
        return written
    def __getattr__(self, name):
        return getattr(self.stream, name)
    def __enter__(self):
        return self
    def __exit__(self, *error):
        self.stream.close()

def opened(target):
    temporary, stream = open_beside(target)
    return temporary, Stream(stream)

module._open_beside = opened
os.fsync = lambda number: (reached(), fsync(number))[1]
Path.replace = lambda self, target: (reached(), replace(self, target), moved.append(1))[1]
random_vdi(np.random.default_rng(2), max_window=(12, 9)).save({path!r}, **{options!r})
print("saved", flush=True)
time.sleep(3600)
"""


def killed_at(moment, path):
    """Kill a process that saves at a moment; what it had said by then."""
    code = SAVE_AND_STOP.format(
        tests=str(SUPPORT), moment=moment, path=str(path), options=options(path.suffix)
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    try:
        said = process.stdout.readline().strip()
    finally:
        process.kill()
        process.communicate(timeout=PATIENCE)
    return said


@pytest.mark.every(3)
@posix
@formats_in_processes
@pytest.mark.parametrize(
    "moments", [(0, 7, 9999), pytest.param((*range(40), 9999), marks=pytest.mark.slow)]
)
def test_a_process_that_is_killed_while_it_saves(suffix, moments, tmp_path):
    """SIGKILL at any moment: the old file is intact, or the new one is whole."""
    path = vdi_number(1).save(tmp_path / f"a{suffix}")
    before = path.read_bytes()
    outcomes = set()
    for moment in moments:
        path.write_bytes(before)
        said = killed_at(moment, path)
        outcomes.add(said)
        if said == "now":
            assert path.read_bytes() == before, moment
        else:
            assert said in ("moved", "saved")
            assert io.read(path).equals(vdi_number(2))
        for left in set(names_in(tmp_path)) - {path.name}:
            # The dead process could not remove it: hidden, named after the file, never read
            assert left.startswith(f".{path.name}.")
            assert left.endswith(".tmp")
            (tmp_path / left).unlink()
    assert outcomes >= {"now", "saved"}


# -- several processes -----------------------------------------------------------------------------

SAVE_OFTEN = """
import select, sys
sys.path.insert(0, {tests!r})
import numpy as np
from strategies import random_vdi
vdi = random_vdi(np.random.default_rng({seed}), max_window=(12, 9))
sys.stdin.readline()
while not select.select([sys.stdin], [], [], 0)[0]:
    vdi.save({path!r}, **{options!r})
"""


@pytest.mark.every(3)
@formats_in_processes
def test_two_processes_that_save_to_one_name(suffix, tmp_path):
    """Whoever reads meanwhile finds one of their files, whole."""
    path = vdi_number(1).save(tmp_path / f"a{suffix}", **options(suffix))
    processes = [
        subprocess.Popen(
            [
                *(sys.executable, "-c"),
                SAVE_OFTEN.format(
                    tests=str(SUPPORT), seed=seed, path=str(path), options=options(suffix)
                ),
            ],
            stdin=subprocess.PIPE,
            text=True,
        )
        for seed in (1, 2)
    ]
    known = [vdi_number(1), vdi_number(2)]
    seen = set()

    def look():
        vdi = io.read(path)
        assert any(one.equals(vdi) for one in known)
        seen.update(i for i, one in enumerate(known) if one.equals(vdi))

    try:
        for process in processes:
            process.stdin.write("go\n")
            process.stdin.flush()
        # They save until they are told to end
        deadline = time.monotonic() + PATIENCE
        looks = 0
        while looks < 60 or seen != {0, 1}:
            assert time.monotonic() < deadline
            look()
            looks += 1
        for process in processes:
            process.stdin.close()
        for process in processes:
            process.wait(PATIENCE)
        look()
    finally:
        for process in processes:
            process.kill()
            process.wait()
    assert [process.returncode for process in processes] == [0, 0]
    assert names_in(tmp_path) == [path.name]


# -- what reading does -----------------------------------------------------------------------------


def test_reading_opens_nothing_else_and_runs_nothing(tmp_path):
    """Python's audit events of reading every file that fuzzing keeps, and whole ones."""
    files = [str(vdi_number(1).save(tmp_path / f"a{suffix}")) for suffix in io.SUFFIXES]
    for kind, suffix in (("vdi_bytes", ".vdi"), ("exr_bytes", ".exr")):
        for path in sorted((SUPPORT.parent / "fuzz" / "corpus" / kind).iterdir()):
            target = tmp_path / (path.name + suffix)
            shutil.copy(path, target)
            files.append(str(target))
    code = textwrap.dedent(
        f"""
        import json, sys
        from pyvista_vdi import io
        from pyvista_vdi.errors import VDIError
        def read(path):
            for function in (io.read_info, io.read):
                try:
                    function(path)
                except VDIError:
                    pass
        files = {files!r}
        for path in files:
            read(path)  # imports what it needs
        events = []
        def heard(event, arguments):
            if event in ("open", "exec", "compile", "import", "subprocess.Popen", "os.system",
                         "pickle.find_class", "marshal.loads", "os.remove", "os.rename",
                         "os.mkdir", "socket.connect", "ctypes.dlopen", "os.exec", "os.fork"):
                events.append((event, [str(a) for a in arguments]))
        sys.addaudithook(heard)
        for path in files:
            read(path)
        print(json.dumps(events))
        """
    )
    done = run_python(code)
    assert done.returncode == 0, done.stderr
    for event, arguments in json.loads(done.stdout):
        assert event == "open", (event, arguments)
        assert arguments[0] in files, arguments
        assert arguments[1] in ("r", "rb"), arguments


def declaring(path, n, window):
    """A ``.vdi`` file that declares more than it holds, consistently."""
    with zipfile.ZipFile(path) as archive:
        members = {info.filename: archive.read(info) for info in archive.infolist()}
    description = json.loads(members["vdi.json"])
    description |= {"n_supersegments": n, "window_size": window}
    for name, array in description["arrays"].items():
        array["shape"][0] = window[0] * window[1] if name == "counts" else n
    members["vdi.json"] = json.dumps(description).encode()
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(zipfile.ZipInfo(name), content)
    return path


@pytest.mark.skipif(sys.platform != "linux", reason="RLIMIT_AS")
def test_hostile_files_stay_within_a_limit_of_memory(tmp_path):
    """The system's own limit: 400 MiB beyond what the process has when it begins to read."""
    files = []
    for i, (n, window) in enumerate([(10**12, [9, 9]), (0, [65536, 65536]), (2**47, [1, 1])]):
        for compression in ("none", "zstd", "lz4"):
            path = tmp_path / f"{i}_{compression}.vdi"
            vdi_number(1).save(path, compression=compression)
            files.append(str(declaring(path, n, window)))
    large = bytearray(vdi_number(1).save(tmp_path / "a.exr", compression="none").read_bytes())
    for name in (b"dataWindow", b"displayWindow"):
        at = large.index(name + b"\0box2i\0") + len(name) + 11
        large[at : at + 16] = struct.pack("<4i", 0, 0, 65535, 65535)
    (tmp_path / "a.exr").write_bytes(large)
    files.append(str(tmp_path / "a.exr"))
    done = run_python(
        f"""
import resource
from pathlib import Path
from pyvista_vdi import io
from pyvista_vdi.errors import VDIFileError
files = {files!r}
def refused(path):
    try:
        io.read(path)
    except VDIFileError as error:
        return str(error)
    raise AssertionError(path)
refused(files[0]), refused(files[-1])  # imports what it needs
pages = int(Path("/proc/self/statm").read_text().split()[0])
limit = pages * resource.getpagesize() + 400 * 2**20
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
for path in files:
    print(refused(path))
"""
    )
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == len(files)


# -- Ctrl-C ----------------------------------------------------------------------------------------


@posix
@formats
def test_ctrl_c_while_saving(suffix, disk, tmp_path):
    """A real SIGINT at each write: no half file, and the old one is intact."""
    path = vdi_number(1).save(tmp_path / f"a{suffix}")
    before = path.read_bytes()
    vdi_number(2).save(tmp_path / f"counted{suffix}", **options(suffix))
    calls = disk.last.calls
    (tmp_path / f"counted{suffix}").unlink()

    class Interrupting(FullDisk):
        def _use(self):
            self.calls += 1
            if self.calls > self._left:
                self._left = 10**9
                signal.raise_signal(signal.SIGINT)

    open_beside = whole_file_module._open_beside
    for k in range(0, calls, 3):

        def opened(target, k=k):
            temporary, stream = open_beside(target)
            return temporary, Interrupting(stream._stream, k)

        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(whole_file_module, "_open_beside", opened)
            with pytest.raises(KeyboardInterrupt):
                vdi_number(2).save(path)
        assert path.read_bytes() == before
        assert names_in(tmp_path) == [path.name]
