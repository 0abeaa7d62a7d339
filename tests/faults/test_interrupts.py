"""Ctrl-C in every verb of the command line: status 130, one line, no half file, no buffer."""

from __future__ import annotations

import os
import signal

import numpy as np
import pytest
from faulty_driver import ALLOCATIONS, LAUNCHES, state_of

import pyvista_vdi as pvdi
from pyvista_vdi import cli
from pyvista_vdi.model.standard_cases import filling_camera

pytestmark = pytest.mark.skipif(os.name != "posix", reason="sends SIGINT")

SENTENCE = "pyvista-vdi: error: interrupted; nothing was left half done"

#: Verbs that use a device, with all that they need to run.
ON_A_DEVICE = {
    "generate by names": "generate v.nrrd -o out.vdi --size 24x16 --cmap bone --opacity linear",
    "render": "render a.vdi -o out.png",
    "view": "view a.vdi --screenshot out.png",
}
#: Verbs that do not, or not any more in this process; a function that each calls.
ON_THE_HOST = {
    "devices": ("devices", "device.describe_devices"),
    "info": ("info a.vdi", "io.vdi_file.reader.from_json"),
    "convert": ("convert a.vdi -o out.exr", "extensions.deep_exr.files.whole_file"),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    nrrd = pytest.importorskip("nrrd")
    path = tmp_path_factory.mktemp("interrupts")
    z, y, x = np.mgrid[:12, :10, :8]
    nrrd.write(str(path / "v.nrrd"), (x * y + z).astype(np.uint8), index_order="C")
    table = pvdi.TransferFunction([(0, 0, 0.2), (1, 0.5, 0)], [0, 0.5], (0, 74))
    volume = pvdi.Volume((x * y + z).astype(np.uint8))
    camera = filling_camera(volume.bounds, (24, 16))
    vdi = pvdi.generate(volume, camera, (24, 16), transfer_function=table)
    vdi.save(path / "a.vdi")
    vdi.save(path / "a.exr")
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


@pytest.mark.parametrize(
    ("verb", "share"), [("generate by names", 0.5), ("render", 0.0), ("view", 1.0)]
)
def test_ctrl_c_at_a_use_of_the_device(verb, share, here, driver, capsys, default_runtime):
    """SIGINT before the first, a middle, and the last use of the device."""
    pytest.importorskip("pyvista")
    arguments = ON_A_DEVICE[verb].split()
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
    status = cli.main(ON_A_DEVICE["view"].split())
    driver.work()
    err = capsys.readouterr().err
    assert status == 1
    assert err.startswith("pyvista-vdi: error: ")
    assert "the driver says DEVICE_NOT_AVAILABLE" in err
    assert err.count("\n") == 1
    assert files_in(here) == before


def lose(*_, **__):
    signal.raise_signal(signal.SIGINT)
    pytest.fail("the interrupt was lost")


@pytest.mark.parametrize("verb", ON_THE_HOST)
def test_ctrl_c_in_the_middle_of_a_verb(verb, here, capsys, monkeypatch):
    arguments, function = ON_THE_HOST[verb]
    before, called = files_in(here), []
    monkeypatch.setattr(f"pyvista_vdi.{function}", lambda *_, **__: (called.append(1), lose())[1])
    status = cli.main(arguments.split())
    assert called
    check_interrupted(capsys, status)
    assert files_in(here) == before
