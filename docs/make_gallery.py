"""Make the gallery's pictures: run its scripts, and a small comparison.

    python docs/make_gallery.py [NAME ...]

With names, those scripts of ``docs/gallery`` alone. Look at every one of them afterwards.
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

#: Largest width of the comparison, pixels, and of its file, bytes.
SHEET_WIDTH = 1280
LARGEST_FILE = 100 * 1024

#: Those of the scripts of docs/gallery, which are JPEG.
LARGEST_PHOTO = 150 * 1024

COMPARISON = ("brain", "--cmap viridis --opacity sigmoid_10", "320x180")


def main(names: list[str]) -> None:
    """Make those of the names, or all."""
    environment = {**os.environ, "PYVISTA_OFF_SCREEN": "true"}
    if not os.environ.get("DISPLAY"):
        environment.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for script in sorted((DOCS / "gallery").glob("*.py")):
            if not names or script.stem in names:
                run({**environment, "MPLBACKEND": "agg"}, str(script), folder=folder)
                keep_photo(folder / f"{script.stem}.png", TARGET / f"gallery-{script.stem}.jpg")
        if names:
            return
        volume, look, size = COMPARISON
        options = ("--example", volume, *look.split(), "--size", size, "--repeats", "1")
        run(environment, "-m", "pyvista_vdi", "compare", *options, "--out", name)
        keep(folder / f"{volume}.png", TARGET / "compare.png", SHEET_WIDTH)


def run(environment: dict[str, str], *arguments: str, folder: Path | None = None) -> None:
    """Run Python with these arguments, in a folder."""
    subprocess.run([sys.executable, *arguments], check=True, env=environment, cwd=folder)


def keep_photo(source: Path, target: Path) -> None:
    """Store a picture as JPEG."""
    Image.open(source).convert("RGB").save(target, quality=85, optimize=True)
    require_small(target, LARGEST_PHOTO)


def keep(source: Path, target: Path, width: int) -> None:
    """Scale a picture down and store it with a palette."""
    picture = Image.open(source).convert("RGB")
    if picture.width > width:
        height = round(picture.height * width / picture.width)
        picture = picture.resize((width, height), Image.Resampling.LANCZOS)
    picture.quantize(256, dither=Image.Dither.FLOYDSTEINBERG).save(target, optimize=True)
    require_small(target, LARGEST_FILE)


def require_small(file: Path, most: int) -> None:
    """End the program if a file is too large to be committed."""
    if file.stat().st_size > most:
        sys.exit(f"{file} has {file.stat().st_size} bytes, more than {most}")


if __name__ == "__main__":
    main(sys.argv[1:])
