"""A VDI in a page in the installed Chromium: its first pictures, and frames against OpenCL's.

Frames are compared by the clock, in turns, where Chromium draws by SwiftShader: its raycast over
that of our OpenCL raycaster on the same cores, from the same VDI and view.
"""

from __future__ import annotations

import base64
import shutil
import statistics
import sys
import tempfile
import time
from importlib import resources
from pathlib import Path
from typing import Any

from common import add_size, add_vdi_cache, add_volumes, at_hand, new_parser, save, vdi_of
from playwright.sync_api import sync_playwright

import pyvista_vdi as pvdi
from pyvista_vdi.measure.report import table

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from browsers import FLAGS, NAMES, SITE

#: Degrees from V_O.
ANGLES = (5.0, 30.0)

#: Heard before the page's own scripts run: seconds since the navigation.
LISTEN = """
window.times = {};
document.addEventListener("DOMContentLoaded", () => { times.parsed = performance.now() / 1000; });
document.addEventListener("framedrawn", ({ detail: { full, state } }) => {
  times.first ??= performance.now() / 1000;
  if (full && state === "full") times.complete ??= performance.now() / 1000;
}, true);
"""

#: A page with the raycaster alone, for its time: `frame` draws what `show` is given; milliseconds.
RAYCASTER = """<!doctype html><canvas></canvas><script type="module">
import { load } from "./loader.js";
import { Raycaster } from "./raycast.js";
const gl = document.querySelector("canvas").getContext("webgl2", { antialias: false });
const raycaster = new Raycaster(gl);
window.show = async (text) => {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  let whole;
  await load(bytes, { onLevel: (prepared) => { whole = prepared; } });
  raycaster.set(whole);
};
window.frame = (camera, width, height) => {
  gl.canvas.width = width;
  gl.canvas.height = height;
  const began = performance.now();
  raycaster.draw({ camera, width, height });
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  return performance.now() - began;
};
window.begun = true;
</script>"""


def first_pictures(browser: Any, url: str, size: tuple[int, int]) -> dict[str, float]:
    """Open a page; seconds from DOMContentLoaded to the first and to the complete picture."""
    page = browser.new_page(viewport={"width": size[0], "height": size[1]})
    page.add_init_script(LISTEN)
    page.goto(url, wait_until="commit")
    page.wait_for_function("times.complete && times.parsed", timeout=600_000)
    times = page.evaluate("times")
    page.close()
    return {name: times[name] - times["parsed"] for name in ("first", "complete")}


def raycaster_page(browser: Any) -> Any:
    """Return a page with the raycaster."""
    viewer = resources.files("pyvista_vdi.web") / "viewer"
    page = browser.new_page()

    def answer(route: Any) -> None:
        name = route.request.url.rpartition("/")[2]
        if name:
            route.fulfill(body=(viewer / name).read_text(), content_type="text/javascript")
        else:
            route.fulfill(body=RAYCASTER, content_type="text/html")

    page.route(SITE + "**", answer)
    page.goto(SITE)
    page.wait_for_function("window.begun")
    return page


def frames(page: Any, vdi: Any, options: Any) -> list[dict[str, Any]]:
    """Return seconds of a frame of both raycasters, by angle: medians of turns."""
    with tempfile.TemporaryDirectory() as folder:
        file = vdi.save(Path(folder) / "x.vdi", compression="deflate")
        page.evaluate("show", base64.b64encode(file.read_bytes()).decode())
    size, found = options.size, []
    for angle in ANGLES:
        view = vdi.camera.azimuth(angle)
        state = view.to_dict()
        camera = {k: state[k] for k in ("position", "focal_point", "view_up", "view_angle")}
        theirs, ours = [], []
        for _ in range(options.repeats + 1):
            theirs.append(page.evaluate("(of) => frame(...of)", [camera, *size]) / 1000)
            began = time.perf_counter()
            pvdi.render(vdi, view, size, device=options.device)
            ours.append(time.perf_counter() - began)
        page_s, opencl_s = statistics.median(theirs[1:]), statistics.median(ours[1:])
        found.append({"angle": angle, "page_s": page_s, "opencl_s": opencl_s})
    return found


def main() -> None:
    """Measure, print and write."""
    parser = new_parser(__doc__, repeats=5, repeated="pages opened, and frames")
    add_size(parser, (640, 360))
    add_volumes(parser, ["brain", "bonsai", "rayleigh_taylor", "tooth"])
    add_vdi_cache(parser)
    parser.set_defaults(tf="soft", max_supersegments=20)
    options = parser.parse_args()
    executable = next(filter(None, map(shutil.which, NAMES)), None)
    results: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        for name in at_hand(options.volumes):
            vdi = vdi_of(name, options)
            results[name] = {}
            for precision in ("8-byte", "exact"):
                kept = vdi.with_precision(precision)
                path = kept.save(Path(folder) / f"{name}.html", precision=precision)
                opened = []
                for _ in range(options.repeats if precision == "8-byte" else 0):
                    browser = playwright.chromium.launch(
                        executable_path=executable, args=list(FLAGS)
                    )
                    opened.append(first_pictures(browser, path.as_uri(), options.size))
                    browser.close()
                browser = playwright.chromium.launch(executable_path=executable, args=list(FLAGS))
                results[name][precision] = {
                    "bytes": path.stat().st_size,
                    "opened": opened,
                    "frames": frames(raycaster_page(browser), kept, options),
                }
                browser.close()
            report(name, results[name])
    ratios = [
        frame["page_s"] / frame["opencl_s"]
        for of_volume in results.values()
        for kept in of_volume.values()
        for frame in kept["frames"]
    ]
    print(f"page over OpenCL, median of all: {statistics.median(ratios):.1f}")
    save({"size": options.size, "volumes": results}, options.out / "page.json")


def report(name: str, found: dict[str, Any]) -> None:
    """Print what was found for a volume."""
    opened = found["8-byte"]["opened"]
    first, complete = (
        statistics.median(times[which] for times in opened) for which in ("first", "complete")
    )
    print(
        f"{name}: page of {found['8-byte']['bytes'] / 2**20:.1f} MiB; from DOMContentLoaded to the "
        f"first picture {first:.2f} s, to the complete one {complete:.2f} s (medians)"
    )
    rows = [
        [precision, f"{f['angle']:g}", f"{f['page_s'] / f['opencl_s']:.1f}"]
        for precision, kept in found.items()
        for f in kept["frames"]
    ]
    print("\n".join(table(["form", "degrees", "page / OpenCL"], rows)), flush=True)


if __name__ == "__main__":
    main()
