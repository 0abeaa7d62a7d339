"""Run README's blocks that name extras, each in an environment with exactly these.

python readme_blocks.py README.md WHEEL FOLDER
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import urllib.request
import venv
from pathlib import Path


def run(*command: str | Path) -> None:
    """Run a command, which must succeed."""
    print("--", *command, flush=True)
    subprocess.run(command, check=True)


def serve(command: str) -> None:
    """Run README's server until its page has come."""
    served = subprocess.Popen(command.split(), stdout=subprocess.PIPE, text=True)
    urls = (re.search(r"http://\S+", line) for line in served.stdout)
    url = next(filter(None, urls))[0]
    with urllib.request.urlopen(url) as page:
        assert b"vdi-viewer" in page.read(), url
    served.terminate()  # what runs in the background ignores Ctrl-C
    served.wait()


def main(readme: Path, wheel: Path, folder: Path) -> None:
    """Run all of them, the Python as programs."""
    path = os.environ["PATH"]
    found = re.findall(r"^```(python|text)\n(.*?)^```$", readme.read_text("utf-8"), re.M | re.S)
    for number, (kind, block) in enumerate(found):
        extras = re.search(r'pip install "\.\[([\w,-]+)\]"', block)
        if extras is None:
            assert kind == "text", f"this block names no extras:\n{block}"
            continue
        environment, place = folder / extras[1], folder / str(number)
        os.environ["PATH"] = f"{environment}/bin:{path}"
        if not environment.exists():
            venv.create(environment, with_pip=True)
            run("pip", "install", "--quiet", f"pyvista-vdi[{extras[1]}] @ {wheel.as_uri()}")
        place.mkdir()
        os.chdir(place)
        if kind == "python":
            run("python", "-c", block)
        elif command := re.search(r"pyvista-vdi serve .*", block):
            serve(command[0])


if __name__ == "__main__":
    main(*(Path(each).resolve() for each in sys.argv[1:]))
