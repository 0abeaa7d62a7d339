"""A VDI in a page in the installed Chromium: its first pictures, and frames against OpenCL's.

Frames are compared by CPU time where Chromium draws by SwiftShader: that of its graphics process
over that of our OpenCL raycaster on the same cores, from the same VDI and view.
"""

from __future__ import annotations

import shutil
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import psutil
from common import add_size, add_vdi_cache, add_volumes, at_hand, new_parser, save, vdi_of
from playwright.sync_api import sync_playwright

import pyvista_vdi as pvdi
from pyvista_vdi.measure.report import table

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from browsers import FLAGS, NAMES

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

#: Draws frames of a view and waits for each.
FRAMES = """async ([camera, width, height, frames]) => {
  const viewer = document.querySelector("vdi-viewer");
  viewer.camera = camera;
  await viewer.ready;
  for (let k = 0; k < frames; ++k) await viewer.screenshot({ width, height });
}"""


def first_pictures(browser: Any, url: str, size: tuple[int, int]) -> dict[str, float]:
    """Open a page; seconds from DOMContentLoaded to the first and to the complete picture."""
    page = browser.new_page(viewport={"width": size[0], "height": size[1]})
    page.add_init_script(LISTEN)
    page.goto(url, wait_until="commit")
    page.wait_for_function("times.complete && times.parsed", timeout=600_000)
    times = page.evaluate("times")
    page.close()
    return {name: times[name] - times["parsed"] for name in ("first", "complete")}


def graphics() -> psutil.Process:
    """Return the process of this one's browser that draws."""
    for process in psutil.Process().children(recursive=True):
        if "--type=gpu-process" in process.cmdline():
            return process
    sys.exit("Chromium has no graphics process")


def frames(browser: Any, url: str, vdi: Any, options: Any) -> list[dict[str, Any]]:
    """Return CPU seconds of a frame of both raycasters, by angle."""
    size = options.size
    page = browser.new_page(viewport={"width": size[0], "height": size[1]})
    page.goto(url, wait_until="commit")
    page.wait_for_function("document.querySelector('vdi-viewer')?.ready")
    process, found = graphics(), []
    for angle in ANGLES:
        view = vdi.camera.azimuth(angle)
        state = view.to_dict()
        keys = ("position", "focal_point", "view_up", "view_angle")
        camera = {key: state[key] for key in keys}
        page.evaluate(FRAMES, [camera, *size, 1])
        pvdi.render(vdi, view, size, device=options.device)
        ours, theirs = [], []
        for _ in range(options.repeats):
            before = sum(process.cpu_times()[:2])
            page.evaluate(FRAMES, [camera, *size, 4])
            theirs.append((sum(process.cpu_times()[:2]) - before) / 4)
            before = time.process_time()
            for _ in range(4):
                pvdi.render(vdi, view, size, device=options.device)
            ours.append((time.process_time() - before) / 4)
        page_s, opencl_s = statistics.median(theirs), statistics.median(ours)
        found.append({"angle": angle, "page_s": page_s, "opencl_s": opencl_s})
    page.close()
    return found


def main() -> None:
    """Measure, print and write."""
    parser = new_parser(__doc__, repeats=5, repeated="pages opened, and rounds of four frames")
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
                    "frames": frames(browser, path.as_uri(), kept, options),
                }
                browser.close()
            report(name, results[name])
    ratios = [
        frame["page_s"] / frame["opencl_s"]
        for of_volume in results.values()
        for kept in of_volume.values()
        for frame in kept["frames"]
    ]
    print(f"page over OpenCL, CPU time, median of all: {statistics.median(ratios):.1f}")
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
