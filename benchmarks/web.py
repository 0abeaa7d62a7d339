"""A minute of turning and zooming over a slow line: served VDIs against server-side JPEG images.

Both go over a line of so many Mbit/s and so much latency (a round trip). VDIs: a real server, a
client that says the views of the path in real time and notes when each VDI has come, through a
proxy that is as slow as the line (tests/support/slow_line.py). What is on the screen at a moment is
the volume's picture of that view, where it rests and that has come, else the VDI that is there,
seen from the view of that moment; drawing is the page's own and costs the
line nothing: how soon a frame follows its view is timed in a real Chromium, where there is one
(software WebGL), over lines of several latencies. Images: in simulated time and in their favour.
The server renders in no time whatever it last heard of the view, at most so many a second and as
soon as the line is free; qualities are those of trame's remote view, 60 in motion and 98 at rest.
What is on the screen is the last image that has come. Both are held against the volume's picture
from the view of the moment.
"""

from __future__ import annotations

import asyncio
import io
import shutil
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from common import add_size, add_volumes, at_hand, new_parser, save
from numpy.typing import NDArray
from PIL import Image

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from browsers import FLAGS, LONG, NAMES
from slow_line import SlowLine
from web_client import WebClient

import pyvista_vdi as pvdi
from pyvista_vdi import web
from pyvista_vdi.measure.report import table
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS, filling_camera

#: The minute: until which second, turned so far (degrees), opening angle then. Twice the same is
#: a rest.
PATH = (
    (0, 0, 30),
    (1, 0, 30),
    (7, 60, 30),
    (9, 60, 30),
    (12, 60, 14),
    (14, 60, 14),
    (19, 85, 14),
    (21, 85, 14),
    (23, 85, 30),
    (24, 85, 30),
    (32, 200, 30),
    (34, 200, 30),
    (37, 200, 10),
    (40, 200, 10),
    (45, 190, 10),
    (47, 190, 10),
    (51, 240, 26),
    (53, 240, 26),
    (58, 360, 30),
    (60, 360, 30),
)

#: Qualities of JPEG images in motion and at rest: trame's VtkRemoteView.
QUALITIES = (60, 98)


#: Milliseconds from a change of the page's camera to the frame that shows it, forty times.
TURN = """async () => {
  const times = [];
  for (let k = 0; k < 40; ++k) {
    const { position: [x, y, z], ...rest } = viewer.camera;
    const drawn = new Promise((resolve) => {
      viewer.addEventListener("framedrawn", resolve, { once: true });
    });
    const began = performance.now();
    viewer.camera = { ...rest, position: [x * 0.999 + y * 0.01, y, z] };
    await drawn;
    times.push(performance.now() - began);
  }
  return times;
}"""


class Path60:
    """The views of the minute, or of its first seconds."""

    def __init__(self, camera: Camera) -> None:
        self.camera = camera

    def at(self, second: float) -> Camera:
        """Return the view of a moment."""
        times, turned, angle = np.array(PATH, float).T
        azimuth = float(np.interp(second, times, turned))
        return self.camera.azimuth(azimuth).replace(
            view_angle=float(np.interp(second, times, angle))
        )

    def rests(self, second: float) -> bool:
        """Whether the view stays as it is for a moment."""
        return self.at(second) == self.at(second + 0.04)


async def served(
    server: web.Server, path: Path60, size: tuple[int, int], seconds: float, options: Any
) -> dict[str, Any]:
    """Go along the path as a page does; return what came when."""
    one_way = options.latency / 2000
    line = SlowLine(server.port, rate=options.rate * 1e6 / 8, latency=one_way)
    came: list[tuple[float, str, bytes, float]] = []
    pictures: list[tuple[float, int, bytes]] = []
    wishes: list[tuple[float, Camera]] = []
    delays = []
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
                        came.append((now, level, b"".join(client.parts), asked))
                        if level == "coarse":
                            delays.append(now - asked)

            hearing = asyncio.ensure_future(hear())
            said = None
            while (now := time.perf_counter() - began) < seconds:
                view, moving = path.at(now), not path.rests(now)
                if (view, moving) != said:
                    await client.look_from(view, size, moving=moving)
                    wishes.append((now, view))
                    said = view, moving
                await asyncio.sleep(0.05)
            hearing.cancel()
            down = line.down
    return {
        "came": came,
        "pictures": pictures,
        "wishes": wishes,
        "bytes": down,
        "delays": delays,
    }


def picture_at(found: dict[str, Any], path: Path60, second: float) -> NDArray[np.uint8] | None:
    """Return the volume's picture that lies over the VDI at a moment, if one does."""
    said = [k for k, (when, _) in enumerate(found["wishes"], 1) if when <= second]
    if not said or found["wishes"][said[-1] - 1][1] != path.at(second):
        return None
    for when, of, file in found["pictures"]:
        if of == said[-1] and when <= second:
            rgba = np.asarray(Image.open(io.BytesIO(file)).convert("RGBA")) / 255.0
            return np.rint(rgba[..., :3] * rgba[..., 3:] * 255).astype(np.uint8)
    return None


def images(
    draw: Any, path: Path60, seconds: float, options: Any
) -> tuple[list[tuple[float, NDArray[np.uint8]]], int, list[float]]:
    """Return when each image is on the screen, the bytes of all, and the waits of each motion."""
    one_way, rate = options.latency / 2000, options.rate * 1e6 / 8
    shown, total, now, last, waits = [], 0, one_way, None, []
    while now < seconds:
        heard = now - one_way
        view, still = path.at(heard), path.rests(heard)
        if (view, still) != last:
            last = view, still
            stream = io.BytesIO()
            Image.fromarray(_bytes(draw(view))).save(stream, "JPEG", quality=QUALITIES[still])
            sent = now + len(stream.getvalue()) / rate
            shown.append((sent + one_way, np.asarray(Image.open(stream))))
            waits.append(sent + one_way - heard)
            total += len(stream.getvalue())
            now = max(sent, now + 1 / options.fps)
        else:
            now += 1 / options.fps
    return shown, total, waits


def motion_to_picture(server: web.Server, size: tuple[int, int], options: Any) -> list[Any]:
    """Time frames of a page in Chromium from the camera's change on, over lines of three latencies.

    Returns
    -------
    list of [float, float]
        Latency (round trip, ms) and the median time (ms); empty where there is no Chromium.
    """
    executable = next(filter(None, map(shutil.which, NAMES)), None)
    if executable is None:
        return []
    return asyncio.run(_frames(server, size, options, executable))


async def _frames(
    server: web.Server, size: tuple[int, int], options: Any, executable: str
) -> list[Any]:
    from playwright.async_api import async_playwright

    found = []
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(executable_path=executable, args=list(FLAGS))
        for latency in (0.0, options.latency, 4 * options.latency):
            line = SlowLine(server.port, rate=options.rate * 1e6 / 8, latency=latency / 2000)
            async with line:
                page = await browser.new_page(viewport={"width": size[0], "height": size[1]})
                page.set_default_timeout(LONG)
                await page.goto(server.url.replace(f":{server.port}", f":{line.port}"))
                while not await page.evaluate("window.remote?.received.full === 1"):
                    await asyncio.sleep(0.05)
                times = await page.evaluate(TURN)
                found.append([latency, float(np.median(times))])
                await page.close()
        await browser.close()
    return found


def _bytes(rgba: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return a picture over black as bytes."""
    return np.rint(np.clip(rgba[..., :3], 0, 1) * 255).astype(np.uint8)


def _ssim(shown: NDArray[np.uint8], truth: NDArray[np.uint8]) -> float:
    opaque = [
        np.concatenate([p / 255, np.ones((*p.shape[:2], 1))], axis=2).astype(np.float32)
        for p in (shown, truth)
    ]
    return float(pvdi.compare_images(*opaque).ssim)


def _at(shown: list[Any], second: float) -> Any:
    before = [entry for entry in shown if entry[0] <= second]
    return before[-1] if before else None


def main() -> None:
    """Measure and write."""
    parser = new_parser(__doc__)
    add_size(parser, (640, 360))
    add_volumes(parser, ["brain"])
    parser.add_argument("--seconds", type=float, default=60.0, help="of the minute")
    parser.add_argument("--rate", type=float, default=20.0, help="of the line, Mbit/s (20)")
    parser.add_argument("--latency", type=float, default=100.0, help="round trip, ms (100)")
    parser.add_argument("--fps", type=float, default=20.0, help="most images a second (20)")
    parser.add_argument("--every", type=float, default=0.5, help="seconds between moments (0.5)")
    options = parser.parse_args()
    size, results = options.size, []
    for name in at_hand(options.volumes):
        volume = pvdi.examples.load_data(name, as_volume=True)
        look = TRANSFER_FUNCTIONS["soft"]
        path = Path60(filling_camera(volume.bounds, size))

        def draw(view: Camera, volume: Any = volume, look: Any = look) -> NDArray[np.float32]:
            return pvdi.render_volume(volume, view, size, device=options.device, **look)

        with web.serve(
            volume, port=0, wait=False, announce=None, device=options.device, **look
        ) as server:
            # What is compiled and uploaded once is no part of the minute
            asyncio.run(served(server, path, size, 3.0, options))
            by_vdi = asyncio.run(served(server, path, size, options.seconds, options))
            frames = motion_to_picture(server, size, options)
        by_image, image_bytes, waits = images(draw, path, options.seconds, options)
        with tempfile.TemporaryDirectory() as folder:
            vdis = []
            for k, (second, _, file, _) in enumerate(by_vdi["came"]):
                (target := Path(folder) / f"{k}.vdi").write_bytes(file)
                vdis.append((second, target))
            # What a coarse one shows of the view that it was asked for, and of that when it comes
            coarse = []
            for (second, level, _, asked), (_, target) in zip(by_vdi["came"], vdis, strict=True):
                if level == "coarse":
                    vdi = pvdi.read(target)
                    views = path.at(asked), path.at(second)
                    pictures = (pvdi.render(vdi, v, size, device=options.device) for v in views)
                    pairs = zip(pictures, views, strict=True)
                    coarse.append([_ssim(_bytes(p), _bytes(draw(v))) for p, v in pairs])
            moments = []
            for second in np.arange(2.25, options.seconds, options.every):
                view = path.at(second)
                truth = _bytes(draw(view))
                vdi, image = _at(vdis, second), _at(by_image, second)
                if vdi is None or image is None:
                    continue
                shown = picture_at(by_vdi, path, second)
                if shown is None:
                    vdi = pvdi.read(vdi[1])
                    shown = _bytes(pvdi.render(vdi, view, size, device=options.device))
                pair = _ssim(shown, truth), _ssim(image[1], truth)
                moments.append((float(second), path.rests(second), *pair))
        results.append(
            {
                "volume": name,
                "bytes": [by_vdi["bytes"], image_bytes],
                "bytes_of_pictures": sum(len(file) for *_, file in by_vdi["pictures"]),
                "bytes_of_levels": {
                    level: sum(len(file) for _, of, file, _ in by_vdi["came"] if of == level)
                    for level in ("coarse", "full")
                },
                "vdis": [level for _, level, _, _ in by_vdi["came"]],
                "delays": by_vdi["delays"],
                "coarse": coarse,
                "frames": frames,
                "waits": waits,
                "moments": moments,
            }
        )
        report(results[-1])
    given = {n: getattr(options, n) for n in ("size", "seconds", "rate", "latency", "fps")}
    save({"options": given, "results": results}, options.out / "web.json")


def report(result: dict[str, Any]) -> None:
    """Print what was found for a volume."""
    print(
        f"{result['volume']}: {len(result['vdis'])} VDIs, "
        f"{result['vdis'].count('full')} of them full, {result['bytes_of_levels']} bytes, pictures "
        f"{result['bytes_of_pictures']} bytes"
    )
    if result["coarse"]:  # pictures of a small window are full at once
        asked, then = np.transpose(result["coarse"])
        print(
            f"coarse ones on the screen after {np.median(result['delays']):.2f} s (median), "
            f"{max(result['delays']):.2f} s (worst), SSIM of the view asked for "
            f"{np.median(asked):.3f} (median), {asked.min():.3f} (worst), of the view then "
            f"{np.median(then):.3f}, {then.min():.3f}"
        )
    for latency, time_ms in result["frames"]:
        print(
            f"motion to picture in Chromium, {latency:g} ms of latency: {time_ms:.0f} ms (median)"
        )
    print(f"motion to picture of JPEG images: {1e3 * np.median(result['waits']):.0f} ms (median)")
    rows = []
    for k, name in enumerate(("served VDIs", "JPEG images")):
        ssim = {rest: [m[2 + k] for m in result["moments"] if m[1] == rest] for rest in (0, 1)}
        rows.append(
            [
                name,
                f"{result['bytes'][k] / 2**20:.1f} MiB",
                *(f"{np.mean(s):.3f}" if s else "-" for s in (ssim[0], ssim[1])),
                *(f"{np.quantile(s, 0.05):.3f}" if s else "-" for s in (ssim[0], ssim[1])),
            ]
        )
    ratio = result["bytes"][0] / result["bytes"][1]
    better = np.mean([m[2] >= m[3] for m in result["moments"]])
    heads = ["", "bytes", "SSIM in motion", "at rest", "5 % worst in motion", "at rest"]
    print("\n".join(table(heads, rows)))
    print(f"bytes of VDIs over images: {ratio:.2f}; VDIs better at {better:.0%} of the moments")


if __name__ == "__main__":
    main()
