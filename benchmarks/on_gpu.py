"""A GPU that is lent for minutes: one question a run, each answered by a table in half a minute.

Questions are ``calls`` (which calls take the host's time, and how long do kernels take?),
``plotter`` (of what does a plotter's frame consist?) and ``sharing`` (may OpenCL write OpenGL's
textures, by EGL?). Before them ``pytest -m device`` says whether all kernels compile and agree, and
``trees.py --switch`` what another text of them would bring.
"""

from __future__ import annotations

import argparse
import ctypes
import statistics
import time
from collections.abc import Callable, Iterator
from operator import attrgetter
from typing import Any

from shared import benches, milliseconds, table  # beside this file

from pyvista_vdi.cli.declare import size as parse_size
from pyvista_vdi.device import get_runtime
from pyvista_vdi.measure.bench import take_turns

#: Methods of a runtime that may copy, or wait for the device.
METHODS = ("upload", "write", "fill", "buffer", "result", "download", "finish")


def calls(options: argparse.Namespace) -> Iterator[tuple[Any, ...]]:
    """Say what the host's time goes to in frames and in a generate call, and the kernels' own."""
    import pyopencl as cl

    queue, enqueue, told = cl.CommandQueue, cl.enqueue_nd_range_kernel, []
    profiling = cl.command_queue_properties.PROFILING_ENABLE
    cl.CommandQueue = lambda *of: queue(*of, properties=profiling)

    def timed(name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def step(*given: Any, **named: Any) -> Any:
            began = time.perf_counter()
            found = call(*given, **named)
            kernel = f"launch {given[1].function_name}" if name == "launch" else name
            event = found if name == "launch" else None
            told.append((kernel, time.perf_counter() - began, event))
            return found

        return step

    cl.enqueue_nd_range_kernel = timed("launch", enqueue)
    runtime = get_runtime(options.device)
    for name in METHODS:
        setattr(runtime, name, timed(name, getattr(runtime, name)))
    bench = benches(options)(options.volume, "soft")
    vdi, near, far = bench.generate(), bench.view.azimuth(5), bench.view.azimuth(30)
    works: dict[str, Callable[[], Any]] = {
        "frame, 5 degrees": lambda: bench.draw(vdi, near),
        "frame, 30 degrees": lambda: bench.draw(vdi, far),
        "volume": lambda: bench.raycast(far),
        "generate call": bench.generate,
        "generate call, its arrays": lambda: attrgetter("front", "color")(bench.generate()),
    }
    yield "what", "call (what it calls is in it)", "times", "ms of the host", "ms of the device"
    for what, work in works.items():
        work()
        told.clear()
        times = take_turns({what: work}, options.repeats, warm_up=False)[what]
        runtime.finish()
        yield what, "all", 1, milliseconds(statistics.median(times)), None
        for name in dict.fromkeys(name for name, *_ in told):
            taken = [seconds for each, seconds, _ in told if each == name]
            events = [event for each, _, event in told if each == name and event is not None]
            device = sum(e.profile.end - e.profile.start for e in events) * 1e-9 / options.repeats
            host, count = sum(taken) / options.repeats, len(taken) / options.repeats
            yield "", name, f"{count:g}", milliseconds(host), milliseconds(device or None)


def plotter(options: argparse.Namespace) -> Iterator[tuple[Any, ...]]:
    """Time frames of a plotter with parts left out."""
    import pyvista as pv

    from pyvista_vdi import examples
    from pyvista_vdi.vtk_pipeline.drawing.screen import Textures

    show = Textures.show

    def kept(textures: Any, window: Any, mapper: Any, image: Any, *, smooth: bool) -> int:
        return show(textures, window, mapper, textures._uploaded, smooth=smooth)

    yield "frame", "ms"
    for what in ("empty", "kept picture", "turned", "no upload", "no headlight", "opaque mesh"):
        plot = pv.Plotter(off_screen=True, window_size=options.size)
        plot.disable_anti_aliasing()
        found: list[float] = []
        if what != "empty":
            image = examples.load_data(options.volume)
            plot.add_vdi(image, cmap="bone", draw="vdi", device=options.device)
        if what == "no headlight":
            plot.remove_all_lights()
            plot.add_light(pv.Light(position=(1, 2, 3), light_type="scene light"))
        if what == "opaque mesh":
            plot.add_mesh(pv.Sphere(radius=image.length / 8, center=image.center))
        plot.show(auto_close=False)

        for turn in range(3 + options.repeats):
            if turn == 3 and what == "no upload":
                Textures.show = kept
            if what != "kept picture":
                plot.camera.azimuth += 0.5
            began = time.perf_counter()
            plot.render()
            plot.render_window.WaitForCompletion()
            found.append(time.perf_counter() - began)
        Textures.show = show
        yield what, milliseconds(statistics.median(found[3:]))
        plot.close()


def sharing(options: argparse.Namespace) -> Iterator[tuple[Any, ...]]:
    """Ask the driver for a context that shares what VTK's EGL window has."""
    import pyopencl as cl
    import pyvista as pv

    plot = pv.Plotter(off_screen=True, window_size=(64, 64))
    plot.show(auto_close=False)
    plot.render_window.MakeCurrent()
    egl, library = ctypes.CDLL("libEGL.so.1"), ctypes.CDLL("libOpenCL.so.1")
    for function in (egl.eglGetCurrentContext, egl.eglGetCurrentDisplay, library.clCreateContext):
        function.restype = ctypes.c_void_p
    context, display = egl.eglGetCurrentContext(), egl.eglGetCurrentDisplay()
    yield "device", "EGL context", "cl_khr_gl_sharing", "clCreateContext"
    for platform in cl.get_platforms():
        for device in platform.get_devices():
            # CL_GL_CONTEXT_KHR, CL_EGL_DISPLAY_KHR, CL_CONTEXT_PLATFORM
            keys = (0x2008, context or 0, 0x2009, display or 0, 0x1084, platform.int_ptr, 0)
            properties, status = (ctypes.c_ssize_t * 7)(*keys), ctypes.c_int()
            of = (ctypes.c_void_p * 1)(device.int_ptr)
            library.clCreateContext(properties, 1, of, None, None, ctypes.byref(status))
            shares = "yes" if "cl_khr_gl_sharing" in device.extensions else "no"
            answer = f"error {status.value}" if status.value else "yes"
            yield device.name, "yes" if context else "no", shares, answer
    plot.close()


def main() -> None:
    """Answer one question."""
    questions = {each.__name__: each for each in (calls, plotter, sharing)}
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("question", choices=questions)
    parser.add_argument("--volume", default="brain", help="an example's name")
    parser.add_argument("--size", type=parse_size, default=(1280, 720), metavar="WxH")
    parser.add_argument("--device", help="OpenCL device, see: pyvista-vdi devices")
    parser.add_argument("--repeats", type=int, default=15, help="timed turns")
    options = parser.parse_args()
    heads, *rows = questions[options.question](options)
    print("\n".join(table(heads, rows)))


if __name__ == "__main__":
    main()
