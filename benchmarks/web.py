"""VDIs over a slow line beside server-side JPEG images; a VDI's page in a browser.

Served: a real server and a client that says the views of a minute's path in real time, through a
proxy that is as slow as the line. What is on the screen at a moment is the volume's picture of that
view, where it has come, else the VDI that is there, seen from the view of that moment. Images are
in simulated time and in their favour: the server renders in no time, and their qualities are those
of trame's remote view. Both are held against the volume's picture of the moment. Pages of one file
are opened in Chromium, which draws by SwiftShader.
"""

from __future__ import annotations

import asyncio
import io
import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from shared import SUPPORT, benches, execute, parser_of  # beside this file

sys.path.insert(0, str(SUPPORT))
from browsers import FLAGS, NAMES, WITHOUT_WINDOWS
from slow_line import SlowLine
from web_client import WebClient

import pyvista_vdi as pvdi
from pyvista_vdi.extensions import web
from pyvista_vdi.measure.harness import Bench, Case
from pyvista_vdi.measure.results import Results, table
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS

#: The minute: until which second, turned so far (degrees), opening angle then. Twice the same is
#: a rest.
PATH = """
0 0 30, 1 0 30, 7 60 30, 9 60 30, 12 60 14, 14 60 14, 19 85 14, 21 85 14, 23 85 30, 24 85 30,
32 200 30, 34 200 30, 37 200 10, 40 200 10, 45 190 10, 47 190 10, 51 240 26, 53 240 26, 58 360 30,
60 360 30
"""
STEPS = np.array([[float(value) for value in step.split()] for step in PATH.split(",")])

#: Qualities of JPEG images in motion and at rest, and most images a second.
QUALITIES, FPS = (60, 98), 20.0

#: Seconds between moments that are compared.
EVERY = 0.5

#: Heard before the page's own scripts run: seconds since the navigation.
LISTEN = """
window.times = {};
document.addEventListener("DOMContentLoaded", () => { times.parsed = performance.now() / 1000; });
document.addEventListener("framedrawn", ({ detail: { full, state } }) => {
  times.first ??= performance.now() / 1000;
  if (full && state === "full") times.complete ??= performance.now() / 1000;
}, true);
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and write what was found."""
    volumes = ("brain", "bonsai", "rayleigh_taylor", "tooth")
    parser = parser_of(__doc__, volumes=volumes, repeats=3)
    parser.add_argument("--seconds", type=float, help="of the minute (24; whole: 60)")
    parser.add_argument("--rate", type=float, default=20.0, help="of the line, Mbit/s (20)")
    parser.add_argument("--latency", type=float, default=100.0, help="round trip, ms (100)")
    options = parser.parse_args(arguments)
    options.seconds = options.seconds or (60.0 if options.whole else 24.0)
    size = tuple(options.size)
    kinds = {"served": served, "page": in_browser}
    with benches(options) as bench_of:
        cases = [Case(name, "soft", size, what=kind) for kind in kinds for name in options.volumes]
        execute(
            "web",
            options,
            cases,
            lambda case: kinds[str(case.what)](bench_of(case.volume, case.look), options),
            report,
            count=4,
            key=lambda case: case.what,
            rooms=("generation", "raycasting", "volume", "extensions/web"),
        )
    return 0


def view_at(camera: Camera, second: float) -> Camera:
    """Return the view of a moment of the path."""
    turned, angle = (float(np.interp(second, STEPS[:, 0], STEPS[:, k])) for k in (1, 2))
    return camera.azimuth(turned).replace(view_angle=angle)


def rests(camera: Camera, second: float) -> bool:
    """Whether the view stays as it is for a moment."""
    return view_at(camera, second) == view_at(camera, second + 0.04)


def served(bench: Bench, options: Any) -> dict[str, Any]:
    """Return bytes, and SSIM moment by moment, of VDIs and of images."""
    looks = {**TRANSFER_FUNCTIONS["soft"], "device": bench.runtime}
    with web.serve(bench.volume, port=0, wait=False, announce=None, **looks) as server:
        # What is compiled and uploaded once is no part of the minute
        asyncio.run(heard(server, bench, 3.0, options))
        came, pictures, said, n_bytes = asyncio.run(heard(server, bench, options.seconds, options))
    shown, image_bytes, waits = images(bench, options)
    moments = []
    with tempfile.TemporaryDirectory() as folder:
        for second in np.arange(2.25, options.seconds, EVERY).tolist():
            vdi = latest(came, second)
            image = latest(shown, second)
            if vdi is None or image is None:
                continue
            view = view_at(bench.view, second)
            (file := Path(folder) / "a.vdi").write_bytes(vdi[2])
            here = picture_at(pictures, said, view, second)
            drawn = bench.draw(pvdi.read(file), view)
            pair = [
                ssim(shows, bench.raycast(view))
                for shows in (drawn if here is None else here, image[1])
            ]
            moments.append([second, rests(bench.view, second), *pair])
    delays = [entry[3] for entry in came if entry[1] == "coarse"]
    return {
        "bytes": [n_bytes, image_bytes],
        "levels": [entry[1] for entry in came],
        "delay": statistics.median(delays) if delays else None,
        "wait": statistics.median(waits),
        "moments": moments,
    }


async def heard(server: web.Server, bench: Bench, seconds: float, options: Any) -> tuple[Any, ...]:
    """Go along the path as a page does; return VDIs and pictures that came, and what was said."""
    one_way = options.latency / 2000
    line = SlowLine(server.port, rate=options.rate * 1e6 / 8, latency=one_way)
    came: list[tuple[float, str, bytes, float]] = []
    pictures: list[tuple[float, int, bytes]] = []
    said: list[tuple[float, Camera, bool]] = []
    with tempfile.TemporaryDirectory() as folder:
        async with line, WebClient(server, Path(folder), port=line.port) as client:
            began = time.perf_counter()

            async def hear() -> None:
                asked = 0.0
                while True:
                    found = await client.receive()
                    now = time.perf_counter() - began
                    if isinstance(found, int):
                        return
                    if isinstance(found, tuple):
                        pictures.append((now, found[0]["said"], found[1]))
                    elif isinstance(found, dict) and found.get("doing") == "vdi":
                        asked = now - 2 * one_way
                    elif isinstance(found, bytes) and client.is_whole:
                        level = client.head["level"]
                        came.append((now, level, b"".join(client.parts), now - asked))

            hearing = asyncio.ensure_future(hear())
            while (now := time.perf_counter() - began) < seconds:
                wish = view_at(bench.view, now), not rests(bench.view, now)
                if not said or wish != said[-1][1:]:
                    await client.look_from(wish[0], bench.size, moving=wish[1])
                    said.append((now, *wish))
                await asyncio.sleep(0.05)
            hearing.cancel()
            return came, pictures, said, line.down


def picture_at(pictures: Any, said: Any, view: Camera, second: float) -> Any:
    """Return the volume's picture that lies over the VDI at a moment, if one does."""
    before = [k for k, wish in enumerate(said, 1) if wish[0] <= second]
    if before and said[before[-1] - 1][1] == view:
        for when, of, file in pictures:
            if of == before[-1] and when <= second:
                rgba = np.asarray(Image.open(io.BytesIO(file)).convert("RGBA")) / 255.0
                return rgba[..., :3] * rgba[..., 3:]
    return None


def images(bench: Bench, options: Any) -> tuple[list[Any], int, list[float]]:
    """Return when each image is on the screen, the bytes of all, and the waits."""
    one_way, rate = options.latency / 2000, options.rate * 1e6 / 8
    shown, total, now, last, waits = [], 0, one_way, None, []
    while now < options.seconds:
        of = now - one_way
        wish = view_at(bench.view, of), rests(bench.view, of)
        if wish == last:
            now += 1 / FPS
            continue
        last, stream = wish, io.BytesIO()
        levels = np.rint(np.clip(bench.raycast(wish[0])[..., :3], 0, 1) * 255).astype(np.uint8)
        Image.fromarray(levels).save(stream, "JPEG", quality=QUALITIES[wish[1]])
        sent = now + len(stream.getvalue()) / rate
        shown.append((sent + one_way, np.asarray(Image.open(stream)) / 255))
        waits.append(sent + one_way - of)
        total += len(stream.getvalue())
        now = max(sent, now + 1 / FPS)
    return shown, total, waits


def ssim(shown: NDArray[Any], truth: NDArray[Any]) -> float:
    """Return the SSIM of two pictures over black."""
    opaque = [
        np.dstack([p[..., :3], np.ones(p.shape[:2])]).astype(np.float32) for p in (shown, truth)
    ]
    return float(pvdi.compare_images(*opaque).ssim)


def latest(shown: list[Any], second: float) -> Any:
    """Return what came last until a moment."""
    return next((entry for entry in reversed(shown) if entry[0] <= second), None)


def in_browser(bench: Bench, options: Any) -> dict[str, Any]:
    """Return a page's bytes, and the seconds to its first and to its complete picture."""
    from playwright.sync_api import sync_playwright

    vdi = bench.generate().with_precision("8-byte")
    chromium = next(filter(None, map(shutil.which, (WITHOUT_WINDOWS, *NAMES))), None)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        path = vdi.save(Path(folder) / "a.html", precision="8-byte")
        opened = []
        for _ in range(options.repeats):
            browser = playwright.chromium.launch(executable_path=chromium, args=list(FLAGS))
            opened.append(first_pictures(browser, path.as_uri(), bench.size))
            browser.close()
        first, complete = (statistics.median(times) for times in zip(*opened, strict=True))
        return {"bytes": path.stat().st_size, "first": first, "complete": complete}


def first_pictures(browser: Any, url: str, size: tuple[int, int]) -> tuple[float, float]:
    """Open a page; seconds from DOMContentLoaded to the first and to the complete picture."""
    page = browser.new_page(viewport={"width": size[0], "height": size[1]})
    page.add_init_script(LISTEN)
    page.goto(url, wait_until="commit")
    page.wait_for_function("times.complete && times.parsed", timeout=600_000)
    times = page.evaluate("times")
    return times["first"] - times["parsed"], times["complete"] - times["parsed"]


def report(results: Results, every: list[Case]) -> Iterator[str]:
    """Yield the tables."""
    plan, rows = results.plan, []
    yield f"{plan['seconds']:g} s of the path, {plan['rate']:g} Mbit/s, {plan['latency']:g} ms;"
    yield "SSIM: mean, and the worst twentieth."
    yield ""
    for row in results.rows(what="served"):
        for k, name in enumerate(("served VDIs", "JPEG images")) if "refused" not in row else ():
            cells = [row["case"]["volume"], name, f"{row['bytes'][k] / 2**20:.1f}"]
            for still in (False, True):
                of = [moment[2 + k] for moment in row["moments"] if moment[1] == still]
                cells += [f"{np.mean(of):.3f}, {np.quantile(of, 0.05):.3f}" if of else "-"]
            delay = (row["delay"], row["wait"])[k]
            rows.append([*cells, "-" if delay is None else f"{delay:.2f}"])
    heads = ["MiB", "SSIM in motion", "at rest", "s from asking to the screen"]
    yield from table(("volume", "", *heads), rows)
    yield ""
    rows = [
        [
            row["case"]["volume"],
            f"{row['bytes'] / 2**20:.1f}",
            f"{row['first']:.2f}",
            f"{row['complete']:.2f}",
        ]
        for row in results.rows(what="page")
        if "refused" not in row
    ]
    yield from table(("volume", "MiB of a page", "first picture, s", "complete, s"), rows)


if __name__ == "__main__":
    sys.exit(main())
