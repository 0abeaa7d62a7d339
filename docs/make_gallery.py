"""Make the gallery's pictures: run every example off-screen and a small comparison.

    python docs/make_gallery.py

Each picture is scaled down and reduced to 256 colours, to be committed. Look at every one of them
afterwards: an example says at its head what one should see.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

DOCS = Path(__file__).resolve().parent
TARGET = DOCS / "images"

#: Largest width of a picture, pixels, and of a file, bytes.
WIDTH = 480
SHEET_WIDTH = 1280
LARGEST_FILE = 100 * 1024

#: Examples whose pictures hold text, which must stay readable.
WIDE = ("tradeoff",)

COMPARISON = ("brain", "steep", "320x180")


def main() -> None:
    """Make them all."""
    TARGET.mkdir(exist_ok=True)
    environment = {**os.environ, "PYVISTA_OFF_SCREEN": "true"}
    if not os.environ.get("DISPLAY"):
        environment.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for example in sorted((DOCS.parent / "examples").glob("*.py")):
            if example.stem == "interactive":
                run(environment, str(example), str(TARGET / "interactive.gif"))
                continue
            picture = folder / f"{example.stem}.png"
            run(environment, str(example), str(picture))
            width = SHEET_WIDTH if example.stem in WIDE else WIDTH
            keep(picture, TARGET / picture.name, width)
        volume, look, size = COMPARISON
        options = ("--example", volume, "--tf", look, "--size", size, "--repeats", "1")
        run(environment, "-m", "pyvista_vdi", "compare", *options, "--out", name)
        keep(folder / f"{volume}-{look}.png", TARGET / "compare.png", SHEET_WIDTH)


def run(environment: dict[str, str], *arguments: str) -> None:
    """Run Python with these arguments."""
    subprocess.run([sys.executable, *arguments], check=True, env=environment)


def keep(source: Path, target: Path, width: int) -> None:
    """Scale a picture down and store it with a palette."""
    picture = Image.open(source).convert("RGB")
    if picture.width > width:
        height = round(picture.height * width / picture.width)
        picture = picture.resize((width, height), Image.Resampling.LANCZOS)
    picture.quantize(256, dither=Image.Dither.FLOYDSTEINBERG).save(target, optimize=True)
    if target.stat().st_size > LARGEST_FILE:
        sys.exit(f"{target} has {target.stat().st_size} bytes, more than {LARGEST_FILE}")


if __name__ == "__main__":
    main()
