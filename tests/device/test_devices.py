"""Finding OpenCL drivers, probing devices, and choosing one."""

from __future__ import annotations

from dataclasses import replace

import pytest
from fresh_python import run_python

from pyvista_vdi import device as ocl
from pyvista_vdi.device import choice, devices
from pyvista_vdi.errors import InvalidArgumentError, NoDeviceError


def fake(platform: str, name: str, kind: str, index: tuple[int, int], **more) -> ocl.DeviceInfo:
    names = {"name": name, "platform": platform, "version": "OpenCL 3.0"}
    sizes = {"compute_units": 4, "global_memory": 2**33, "max_allocation": 2**31}
    state = {"driver": "1", "kind": kind, "usable": True, "reason": ""}
    place = {"platform_index": index[0], "device_index": index[1]}
    return ocl.DeviceInfo(**{**names, **sizes, **state, **place, **more})


POCL = fake(
    "Portable Computing Language", "pthread-Intel(R) Xeon(R)", "CPU", (0, 0), version="3.0 PoCL"
)
INTEL = fake("Intel(R) OpenCL", "Intel(R) Xeon(R)", "CPU", (1, 0))
IGPU = fake("Intel(R) OpenCL Graphics", "Iris", "GPU", (2, 0), unified_memory=True)
NV_A = fake("NVIDIA CUDA", "H200", "GPU", (3, 0), compute_units=132)
NV_B = fake("NVIDIA CUDA", "T4", "GPU", (3, 1), compute_units=40)
FPGA = fake("Intel(R) FPGA Emulation", "Emulator", "accelerator", (4, 0), compute_units=99)
ALL = [POCL, INTEL, IGPU, NV_A, NV_B, FPGA]


def test_preference_is_gpu_then_intel_cpu_then_other_cpu_then_accelerator():
    order = [info.name for info in sorted(ALL, key=devices.preference)]
    assert order == ["H200", "T4", "Iris", "Intel(R) Xeon(R)", POCL.name, "Emulator"]


@pytest.mark.parametrize(
    ("selector", "name"),
    [
        ("0:0", POCL.name),
        (" 3:1 ", "T4"),
        ("t4", "T4"),
        ("NVIDIA CUDA / H200", "H200"),
        ("pocl", POCL.name),  # only the version says so
        ("fpga", "Emulator"),
        ("Intel(R) Xeon(R)", INTEL.name),  # the exact name beats PoCL's, which contains it
    ],
)
def test_selector_means_one_device(selector, name):
    assert devices.select(ALL, selector, "device=").name == name


def test_environment_names_the_device(runtime, monkeypatch):
    monkeypatch.delenv("PYVISTA_VDI_DEVICE", raising=False)
    usable = [info for info in ocl.list_devices() if info.usable]
    best = min(usable, key=devices.preference)
    marked = f"* [{best.platform_index}:{best.device_index}] {best.full_name}"
    assert marked in ocl.describe_devices()
    monkeypatch.setenv("PYVISTA_VDI_DEVICE", runtime.info.selector)
    assert ocl.get_runtime() is runtime
    assert f"Default: {runtime.info.full_name}, because" in ocl.describe_devices()
    monkeypatch.setenv("PYVISTA_VDI_DEVICE", "no such thing")
    with pytest.raises(NoDeviceError, match=r"PYVISTA_VDI_DEVICE='no such thing'.*there is"):
        ocl.get_runtime()
    assert "No default: PYVISTA_VDI_DEVICE='no such thing'" in ocl.describe_devices()


def test_every_form_of_device_gives_the_same_runtime(runtime):
    for form in (runtime, runtime.info, runtime.info.selector, runtime.info.full_name):
        assert ocl.get_runtime(form) is runtime
    with pytest.raises(InvalidArgumentError, match="device=3 of type int"):
        ocl.get_runtime(3)
    with pytest.raises(NoDeviceError, match="no such OpenCL device"):
        ocl.get_runtime(replace(runtime.info, device_index=9))
    with pytest.raises(NoDeviceError, match="there is no such OpenCL device") as caught:
        ocl.get_runtime("quantum")
    assert runtime.info.full_name in str(caught.value)


@pytest.mark.parametrize("where", ["", "probe values", "probe total"])
def test_probe_notices_wrong_numbers(runtime, monkeypatch, where):
    download = type(runtime).download

    def wrong(self, buffer):
        values = download(self, buffer)
        if buffer.name == where:
            values[:1] += 1
        return values

    # Of the class: taken back on the runtime, a method would stay there as an attribute
    monkeypatch.setattr(type(runtime), "download", wrong)
    assert bool(choice.run_probe(runtime)) == bool(where)


def test_no_device_says_what_was_found_and_the_remedy(tmp_path):
    done = run_python(
        "from pyvista_vdi.errors import NoDeviceError\n"
        "from pyvista_vdi.device import get_runtime, list_devices, describe_devices\n"
        "assert list_devices() == []\n"
        "print(describe_devices())\n"
        "try:\n    get_runtime()\nexcept NoDeviceError as exc:\n    print('caught', exc)\n",
        OCL_ICD_VENDORS=str(tmp_path),
    )
    assert done.returncode == 0, done.stderr
    described, message = done.stdout.split("caught ")
    for text in (described, message):
        assert "no usable OpenCL device" in text
        assert 'pip install "pyvista-vdi[cpu]"' in text
        assert "unset OCL_ICD_VENDORS" in text
