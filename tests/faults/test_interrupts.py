"""Ctrl-C in every verb of the command line: status 130, one line, no half file, no buffer."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from faulty_driver import ALLOCATIONS, LAUNCHES, state_of

import pyvista_vdi as pvdi
from pyvista_vdi import cli, io
from pyvista_vdi.model.standard_cases import filling_camera

pytestmark = pytest.mark.skipif(os.name != "posix", reason="sends SIGINT")

SENTENCE = "pyvista-vdi: error: interrupted; nothing was left half done"

#: Verbs that use a device, with all that they need to run.
ON_A_DEVICE = {
    "generate": (
        *("generate", "v.nrrd", "-o", "out.vdi", "--size", "24x16"),
        *("--transfer-function", "tf.json"),
    ),
    "generate by names": (
        *("generate", "v.nrrd", "-o", "out.vdi", "--size", "24x16"),
        *("--cmap", "bone", "--opacity", "linear"),
    ),
    "render": ("render", "a.vdi", "-o", "out.png"),
    "compare": (
        *("compare", "v.nrrd", "--out", "out", "--size", "24x16", "--no-vtk"),
        *("--angles", "0,10", "--repeats", "1"),
    ),
    "view": ("view", "a.vdi", "--screenshot", "out.png"),
}
#: Verbs that do not, or not any more in this process; a function that each calls.
ON_THE_HOST = {
    "devices": (("devices",), "pyvista_vdi.device.describe_devices"),
    "info": (("info", "a.vdi"), "pyvista_vdi.io.vdi_file.reader.from_json"),
    "info of an .exr": (("info", "a.exr"), "pyvista_vdi.io.deep_exr.files.media"),
    "convert": (("convert", "a.vdi", "-o", "out.exr"), "pyvista_vdi.io.deep_exr.files.write_image"),
    "convert back": (
        ("convert", "a.exr", "-o", "out.vdi"),
        "pyvista_vdi.io.deep_exr.files.read_image",
    ),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("interrupts")
    import nrrd

    z, y, x = np.mgrid[:12, :10, :8]
    nrrd.write(str(path / "v.nrrd"), (x * y + z).astype(np.uint8), index_order="C")
    table = pvdi.TransferFunction([(0, 0, 0.2), (1, 0.5, 0)], [0, 0.5], (0, 74))
    (path / "tf.json").write_text(json.dumps(table.to_dict()))
    volume = pvdi.Volume((x * y + z).astype(np.uint8))
    camera = filling_camera(volume.bounds, (24, 16))
    vdi = pvdi.generate(volume, camera, (24, 16), transfer_function=table)
    vdi.save(path / "a.vdi")
    vdi.save(path / "a.exr", exact=False)
    return path


@pytest.fixture
def here(folder, monkeypatch):
    monkeypatch.chdir(folder)
    monkeypatch.delenv(cli.DEBUG_VARIABLE, raising=False)
    return folder


def files_in(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def check_interrupted(capsys, status):
    err = capsys.readouterr().err
    assert status == 130
    assert err.splitlines()[-1] == SENTENCE
    assert "Traceback" not in err
    assert "Exception ignored" not in err


@pytest.mark.parametrize("verb", ON_A_DEVICE)
@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_ctrl_c_at_a_use_of_the_device(verb, share, here, driver, capsys, default_runtime):
    """SIGINT before the first, a middle, and the last use of the device."""
    if verb not in ("render", "generate"):
        pytest.importorskip("pyvista")
    arguments = [*ON_A_DEVICE[verb]]
    names = (*ALLOCATIONS, *LAUNCHES)
    before = files_in(here)
    driver.count(names)
    assert cli.main(arguments) == 0
    calls = driver.calls
    driver.work()
    for name in set(files_in(here)) - set(before):
        (here / name).unlink()
    capsys.readouterr()
    state = state_of(default_runtime)
    driver.fail(names, round(share * (calls - 1)), lambda: signal.raise_signal(signal.SIGINT))
    status = cli.main(arguments)
    driver.work()
    check_interrupted(capsys, status)
    assert files_in(here) == before
    assert state_of(default_runtime) == state


def test_a_picture_that_cannot_be_drawn_is_not_written(here, driver, capsys, default_runtime):
    """VTK's renderer lets no error through: ``view`` still says what went wrong."""
    pytest.importorskip("pyvista")
    before = files_in(here)
    driver.fail(LAUNCHES, 1, "DEVICE_NOT_AVAILABLE")
    status = cli.main([*ON_A_DEVICE["view"]])
    driver.work()
    err = capsys.readouterr().err
    assert status == 1
    assert err.startswith("pyvista-vdi: error: ")
    assert "the driver says DEVICE_NOT_AVAILABLE" in err
    assert err.count("\n") == 1
    assert files_in(here) == before


@pytest.mark.parametrize("verb", ON_THE_HOST)
def test_ctrl_c_in_the_middle_of_a_verb(verb, here, capsys, monkeypatch):
    arguments, function = ON_THE_HOST[verb]
    before = files_in(here)
    called = []

    def interrupted(*_, **__):
        called.append(1)
        signal.raise_signal(signal.SIGINT)
        time.sleep(60)

    monkeypatch.setattr(function, interrupted)
    status = cli.main([*arguments])
    assert called
    check_interrupted(capsys, status)
    assert files_in(here) == before


@pytest.mark.parametrize("delay", [0.05, 0.3, pytest.param(0.6, marks=pytest.mark.slow)])
@pytest.mark.parametrize("verb", ["generate", "render", "devices", "info", "convert"])
def test_ctrl_c_to_a_process_at_any_time(verb, delay, here):
    """While it looks for drivers, compiles, works: it ends, and leaves nothing."""
    arguments = ON_A_DEVICE.get(verb) or ON_THE_HOST[verb][0]
    before = files_in(here)
    # A shell's background jobs ignore SIGINT, and what they start does: not this one
    code = (
        "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "from pyvista_vdi.cli import main\n"
        "print(1, flush=True)\n"
        "sys.exit(main(sys.argv[1:]))\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        process.stdout.readline()
        time.sleep(delay)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
    finally:
        process.kill()
        process.communicate()
    made = sorted(set(files_in(here)) - set(before))
    # Done before the signal came, or killed by it while Python was shutting down
    if process.returncode in (0, -signal.SIGINT):
        assert "Traceback" not in err
        assert len(made) <= 1
        for name in made:
            if name.endswith((".vdi", ".exr")):
                io.read(here / name)
            (here / name).unlink()
    else:
        assert process.returncode == 130, err
        assert made == []
        # Behind it, libraries that were half imported may complain at exit
        assert SENTENCE in err.splitlines()
