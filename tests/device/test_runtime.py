"""The OpenCL runtime: kernel sources, programs, launches, queues, profiling."""

from __future__ import annotations

import numpy as np
import pytest
from runtimes import fresh_runtime

from pyvista_vdi.device import devices, programs
from pyvista_vdi.errors import KernelBuildError


@pytest.fixture
def texts(monkeypatch):
    """Kernel files in memory in place of the package's; what is expanded once is kept."""
    files: dict[str, str] = {}

    def read(path: str) -> str:
        return files[path]

    monkeypatch.setattr(programs, "read_resource", read)
    return files


SCALE = """\
#include "lib/probe.cl"
__kernel void scale(__global float *x, const float factor, const uint n)
{
    const uint i = get_global_id(0);
    if (i < n)
        x[i] = x[i] * factor + ADD;
}
__kernel void spread(__global const float *x, __global float *y, const float4 v, __local float *t)
{
    t[get_local_id(0)] = x ? x[get_global_id(0)] : v.w;
    barrier(CLK_LOCAL_MEM_FENCE);
    y[get_global_id(0)] = t[get_local_size(0) - 1 - get_local_id(0)];
}
"""


@pytest.fixture
def scale_file(tmp_path):
    path = tmp_path / "with a space" / "scale.cl"
    path.parent.mkdir()
    path.write_text(SCALE)
    return path


def test_build_error_names_file_and_line(runtime, texts, monkeypatch, tmp_path):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    texts["common/good.cl"] = "int good(int a);\n" * 7
    wrong = "".join(f"    missing_it{n}();\n" for n in range(40))
    texts["vdi/bad.cl"] = f'#include "common/good.cl"\n\n__kernel void bad()\n{{\n{wrong}}}\n'
    with pytest.raises(KernelBuildError) as caught:
        runtime.kernel("vdi/bad.cl", "bad", {"N": 3})
    error = caught.value
    assert "vdi/bad.cl:5" in error.log
    assert "missing_it0" in str(error)
    assert "missing_it39" in str(error)
    assert runtime.info.name in str(error)
    assert "-DN=3" in error.options
    assert '#line 2 "vdi/bad.cl"' in error.source
    assert error.__cause__ is not None
    assert not list(tmp_path.glob("*.cl"))
    # Where the device can, divisions are rounded correctly; and nothing is relaxed
    cl = devices.opencl()
    device = devices.handles[runtime.info.selector]
    offered = device.single_fp_config & cl.device_fp_config.CORRECTLY_ROUNDED_DIVIDE_SQRT
    assert ("-cl-fp32-correctly-rounded-divide-sqrt" in error.options) == bool(offered)
    assert "relaxed" not in error.options
    assert "unsafe" not in error.options


def test_programs_are_built_once_per_source_and_defines(runtime, scale_file, monkeypatch):
    built = []
    build = programs.build
    monkeypatch.setattr(programs, "build", lambda *a: built.append(a[4]) or build(*a))
    first = runtime.kernel(scale_file, "scale", {"ADD": 0.25})
    assert runtime.kernel(scale_file, "scale", {"ADD": 0.25}) is first
    assert runtime.kernel(scale_file, "scale", {"ADD": 0.5}) is not first
    runtime.kernel(scale_file, "spread", {"ADD": 0.5})
    assert len(built) == 2
    scale_file.write_text(SCALE + "\n// edited\n")
    assert runtime.kernel(scale_file, "scale", {"ADD": 0.25}) is not first


def test_a_launch_takes_every_kind_of_argument_of_its_own(runtime, scale_file):
    """Also signs of 0, arrays changed in place, buffers in the place of those that have gone."""
    vector = np.array([1, 2, 3, 4], np.float32)
    with runtime.upload(np.arange(8, dtype=np.float32)) as x, runtime.buffer(x.shape) as y:
        launch = runtime.bind(scale_file, "spread", {"ADD": 0}, x=x, y=y, v=vector, t=4)
        launch(8, 4)
        np.testing.assert_array_equal(runtime.download(y), [3, 2, 1, 0, 7, 6, 5, 4])
        launch.set(x=None)
        for last in (4.0, 0.0, -0.0, np.nan, 7.0):
            vector[3] = last
            launch((8,), (4,), v=vector)
            assert runtime.download(y).tobytes() == np.full(8, last, np.float32).tobytes()
        launch(8, 4, x=x)
        np.testing.assert_array_equal(runtime.download(y), [3, 2, 1, 0, 7, 6, 5, 4])
    launch = runtime.bind(scale_file, "scale", {"ADD": 0}, factor=2, n=3)
    for value in range(1, 6):
        with runtime.buffer((3,)) as x:
            runtime.fill(x, np.float32(value))
            launch(3, 1, x=x)
            assert np.all(runtime.download(x) == value * 2)


@pytest.fixture
def new_kernel(tmp_path):
    """A file that no cache knows."""
    path = tmp_path / "new.cl"
    path.write_text(f"// {tmp_path}\n__kernel void twice(__global float *x) {{ *x *= 2; }}")
    return path


def test_compiled_programs_are_kept_where_they_can_be(
    runtime, new_kernel, tmp_path, monkeypatch, caplog
):
    monkeypatch.setattr(programs, "user_cache", lambda: tmp_path)
    caplog.set_level("DEBUG", "pyvista_vdi.device.programs")
    if runtime.info.platform == "Portable Computing Language":
        pytest.skip("PoCL keeps compiled programs itself")

    def compiled():
        caplog.clear()
        fresh_runtime(runtime).kernel(new_kernel, "twice", {})
        return caplog.text.count("compiling kernels: ")

    assert compiled() == 1
    (kept,) = (tmp_path / "programs").iterdir()
    assert compiled() == 0
    kept.unlink()
    kept.mkdir()  # which cannot be replaced by a file
    assert compiled() == 1
    assert list((tmp_path / "programs").iterdir()) == [kept]
    kept.rmdir()
    monkeypatch.setenv("PYOPENCL_NO_CACHE", "1")
    assert [compiled(), compiled()] == [1, 1]
