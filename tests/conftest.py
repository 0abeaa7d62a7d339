"""Fixtures of the whole suite: a runtime on each OpenCL device to test, hypothesis profiles.

Environment
-----------
PYVISTA_VDI_TEST_DEVICES
    Comma separated parts of "platform / device": tests that need a device run on those that
    contain one; "all": on every usable one. By default on the one that users get.
PYVISTA_VDI_TEST_AS_GPU
    "1": devices pass for GPUs, and clang checks each program for one (tests/support/as_gpu.py).
PYVISTA_VDI_REQUIRE_DEVICE
    "1": having no usable device is a failure, as in CI; otherwise such tests are skipped.
PYVISTA_VDI_REQUIRE_INSTALLED
    "1": the package must be an installed copy, not the sources of a checkout, as in CI.
HYPOTHESIS_PROFILE
    "default" or "ci"; "ci" where the variable CI is set.
"""

from __future__ import annotations

import functools
import locale
import os
import re
import signal
import sysconfig
from collections.abc import Iterator
from pathlib import Path

import as_gpu
import numpy as np
import pytest
from hypothesis import settings
from kernel_calls import Caller

import pyvista_vdi
from pyvista_vdi import registry
from pyvista_vdi.device import DeviceInfo, Runtime, get_runtime, list_devices
from pyvista_vdi.errors import MissingDependencyError, NoDeviceError

# Compiling a kernel inside the first example takes seconds, so no example has a deadline.
settings.register_profile("default", deadline=None, print_blob=True)
settings.register_profile("ci", deadline=None, print_blob=True, derandomize=True)
settings.load_profile(
    os.environ.get("HYPOTHESIS_PROFILE") or ("ci" if os.environ.get("CI") else "default")
)


@pytest.fixture(autouse=True)
def same_locale() -> Iterator[None]:
    """Keep the process's locale: writers of VTK 9.4 and SimpleITK leave it in "C"."""
    before = locale.setlocale(locale.LC_ALL)
    yield
    locale.setlocale(locale.LC_ALL, before)


def pytest_configure() -> None:
    """Let Ctrl-C interrupt where a shell has commands in the background ignore it.

    Before drivers are loaded: their compilers put back what they found.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if os.environ.get("PYVISTA_VDI_TEST_AS_GPU") == "1":
        as_gpu.pretend()


def pytest_sessionstart() -> None:
    """Refuse to test the sources where an installed copy is asked for."""
    place, site = Path(pyvista_vdi.__file__), Path(sysconfig.get_path("purelib"))
    installed = place.resolve().is_relative_to(site.resolve())
    if os.environ.get("PYVISTA_VDI_REQUIRE_INSTALLED") == "1" and not installed:
        raise pytest.UsageError(
            f"PYVISTA_VDI_REQUIRE_INSTALLED=1, but the tests would import {place}, "
            f"which is not in {site}"
        )


def usable_test_devices() -> tuple[list[DeviceInfo], str]:
    """The devices to test on, and why there are none."""
    try:
        infos = list_devices()
    except MissingDependencyError as exc:
        return [], str(exc)
    usable = [info for info in infos if info.usable]
    wanted = os.environ.get("PYVISTA_VDI_TEST_DEVICES", "")
    parts = [part.strip().lower() for part in wanted.split(",") if part.strip()]
    if not parts:
        try:
            chosen = [get_runtime().info]
        except NoDeviceError as exc:
            return [], str(exc)
    elif parts == ["all"]:
        chosen = usable
    else:
        chosen = [info for info in usable if any(p in info.full_name.lower() for p in parts)]
    reasons = "; ".join(
        f"{info.full_name}: {info.reason or 'left out by PYVISTA_VDI_TEST_DEVICES'}"
        for info in infos
    )
    return chosen, f"no usable OpenCL device to test on ({reasons or 'no driver lists one'})"


def device_id(info: DeviceInfo) -> str:
    """Short name of a device's platform, for test ids."""
    known = {"portable computing language": "pocl", "intel(r) opencl": "intel"}
    platform = info.platform.lower()
    short = known.get(platform) or re.sub(r"\W+", "-", platform).strip("-")
    return short if info.device_index == 0 else f"{short}-{info.device_index}"


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run tests that take ``runtime`` once on each device to test."""
    if "runtime" not in metafunc.fixturenames:
        return
    infos, _ = usable_test_devices()
    ids = [device_id(info) for info in infos]
    metafunc.parametrize(
        "runtime", infos or [None], ids=ids or ["no-device"], indirect=True, scope="session"
    )


#: Folders, and files, that ``-m fast`` leaves out: their tests are long, or start processes.
LONG = {
    *("drop_in", "extremes", "faults", "fuzz", "measure", "packaging", "plotting", "vtk_pipeline"),
    *("insitu", "large", "paraview", "series", "sets", "web", "test_process", "test_background"),
}


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what runs on each device to test, what is fast, and what nightly alone runs."""
    seen = set()
    for item in items:
        needed = {name for mark in item.iter_markers("extension") for name in mark.args}
        if not needed <= {*registry.extensions()}:
            item.add_marker(pytest.mark.skip(f"needs the extension {', '.join(sorted(needed))}"))
        if any(map(item.get_closest_marker, ("slow", "paraview"))):
            continue
        if "runtime" in getattr(item, "fixturenames", ()):
            item.add_marker("device")
        if item.function not in seen and LONG.isdisjoint((item.path.parent.name, item.path.stem)):
            item.add_marker("fast")  # one case of each test
        seen.add(item.function)


def no_device(reason: str) -> None:
    """Fail where a device is required, as in CI; skip elsewhere."""
    if os.environ.get("PYVISTA_VDI_REQUIRE_DEVICE") == "1":
        pytest.fail(f"PYVISTA_VDI_REQUIRE_DEVICE=1: {reason}", pytrace=False)
    pytest.skip(reason)


@pytest.fixture(scope="session")
def runtime(request: pytest.FixtureRequest) -> Runtime:
    """A runtime on one of the devices to test; tests that take it run on each."""
    if request.param is None:
        no_device(usable_test_devices()[1])
    return get_runtime(request.param)


@pytest.fixture
def call(runtime, request):
    """What launches the kernels of the ``.cl`` files beside a test, on each device."""
    return Caller(runtime, request.path.parent)


@pytest.fixture(scope="session")
def default_runtime() -> Runtime:
    """The runtime that a user gets without naming a device."""
    try:
        return get_runtime()
    except (NoDeviceError, MissingDependencyError) as exc:
        no_device(str(exc))
        raise  # not reached: no_device ends the test


@pytest.fixture(scope="session", autouse=True)
def _outside_the_checkout(tmp_path_factory):
    """Work in a folder of its own: from a checkout, a new Python would import the sources there."""
    before = Path.cwd()
    os.chdir(tmp_path_factory.mktemp("work"))
    yield
    os.chdir(before)


#: Buffers that hold what the engine returns: images, and the arrays of a VDI.
OUTPUTS = {"image", "front depths", "back depths", "supersegment colours", "optical depths"}


@pytest.fixture(scope="session", autouse=True)
def _every_output_is_finite():
    """No test may see a NaN or an infinity in an image or a VDI without failing.

    All of them leave a device by two methods. Nothing that the package accepts leads to one.
    """
    download, download_later = Runtime.download, Runtime.download_later

    def check(buffer, values):
        if buffer.name in OUTPUTS and not np.isfinite(values).all():
            places = np.argwhere(~np.isfinite(values))
            raise NotFiniteError(
                f"{len(places)} of {values.size} values of {buffer.name!r} are not finite, "
                f"the first at {tuple(places[0].tolist())}"
            )

    @functools.wraps(download)
    def checked(self, buffer, *args, **kwargs):
        values = download(self, buffer, *args, **kwargs)
        check(buffer, values)
        return values

    @functools.wraps(download_later)
    def checked_later(self, buffer, out, **kwargs):
        wait = download_later(self, buffer, out, **kwargs)
        if buffer.name in OUTPUTS:
            wait()  # not everybody waits by it
            check(buffer, out)
        return wait

    Runtime.download, Runtime.download_later = checked, checked_later
    yield
    Runtime.download, Runtime.download_later = download, download_later


class NotFiniteError(AssertionError):
    """An image or a VDI held a NaN or an infinity."""
