"""Make the pictures of README, *Presets*, *Recipes* and the tutorials, small enough to commit.

    python docs/make_pictures.py [NAME ...]

Look at every one of them afterwards.
"""

from __future__ import annotations

import contextlib
import re
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np
import pyvista as pv
from PIL import Image

import pyvista_vdi as pvdi
from pyvista_vdi import examples

TARGET = Path(__file__).resolve().parent / "images"


def main(names: list[str]) -> None:
    """Make those whose names begin so, or all."""
    for name in pvdi.presets:
        if not names or any(f"preset-{name}".startswith(each) for each in names):
            keep(preset(name), f"preset-{name}")
    for page in ("recipes", *(path.stem for path in TARGET.parent.glob("tutorial_*.md"))):
        if not names or page in names:
            of_page(page)
    if not names or "recipes" in names:
        shown = [Image.open(TARGET / f"recipe-{name}.png") for name in ("clipped", "field", "mri")]
        keep(np.concatenate([np.asarray(each.convert("RGB")) for each in shown], axis=1), "front")


def of_page(name: str) -> None:
    """Run the blocks of a page, and keep the pictures that they write."""
    text = (TARGET.parent / f"{name}.md").read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        names: dict[str, object] = {}
        for block in re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
            exec(block, names)
        for file in Path(folder).glob("*.png"):
            keep(np.asarray(Image.open(file).convert("RGB")), file.stem)
        for file in Path(folder).glob("*.gif"):
            shutil.copy(file, TARGET)


def preset(name: str) -> np.ndarray:
    """Return a picture of what a preset shows."""
    volume, step = scan(name)
    plotter = pv.Plotter(off_screen=True, window_size=(320, 240))
    plotter.background_color = "black"
    look = {**pvdi.presets[name], "interpolation": "linear"}
    plotter.add_vdi(volume, **look, show_scalar_bar=False)
    plotter.camera_position = [np.add(volume.center, step), volume.center, (0, 0, 1)]
    return np.asarray(plotter.screenshot(return_img=True))


def scan(name: str) -> tuple[pv.ImageData, tuple[float, float, float]]:
    """Return a volume for a preset, and where the eye stands from its centre."""
    if name.startswith("mri"):
        return examples.load_brain(), (-150, 270, 130)
    # Both have 8 bits that nobody calibrated. The head's peaks of fat and muscle, 60 and 66, are
    # taken for -64 and 32 HU; the vessels' brightest voxels for 510 HU
    vessels = name == "ct-angiography"
    volume = examples.load_data("aneurism" if vessels else "visible_female_head")
    factor, shift = (2, 0) if vessels else (16, -1024)
    volume["hounsfield"] = volume.active_scalars.astype(np.int16) * factor + shift
    volume.set_active_scalars("hounsfield")
    return volume, (-260, -310, 125) if vessels else (-250, -460, 62)


def keep(picture: np.ndarray, name: str, colors: int = 128) -> None:
    """Store a picture with a palette."""
    file = TARGET / f"{name}.png"
    Image.fromarray(picture).quantize(colors).save(file, optimize=True)


if __name__ == "__main__":
    main(sys.argv[1:])
