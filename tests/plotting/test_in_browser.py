"""Off-screen windows that a browser watches: a real trame server, and a real notebook's kernel."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

SUPPORT = Path(__file__).parents[1] / "support"
CASES = (
    "follows_the_view",
    "warns_where_the_browser_draws",
    "warns_of_an_export_and_of_a_local_view",
)


def needs(*modules):
    """Skip by name where a package is missing."""
    missing = [name for name in modules if importlib.util.find_spec(name) is None]
    return pytest.mark.skipif(
        bool(missing),
        reason=f"needs {', '.join(missing)}: pip install 'pyvista-vdi[browser]'",
    )


pytestmark = [
    pytest.mark.gl,
    needs("trame_pyvista", "trame_vuetify", "aiohttp", "msgpack"),
]


@pytest.mark.parametrize("case", CASES)
def test_in_a_browser(case):
    done = subprocess.run(
        [sys.executable, str(SUPPORT / "plugin_in_browser.py"), case],
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.stdout.strip().splitlines()[-1:] == ["all well"], done.stdout + done.stderr


CELLS = (
    f"""
import sys
sys.path.insert(0, {str(SUPPORT)!r})
import plugin_in_browser as browsers
from trame_pyvista.widgets import get_server
plotter, actor, volume = browsers.scene(regenerate_below=0.9999)
browsers.FrameRateController.choose = lambda controller, full: 1
plotter.show(jupyter_backend="server")
""",
    """
server = get_server(browsers.pv.global_theme.trame.jupyter_server_name)
async with browsers.browsing(plotter, server) as browser:
    await browsers.turned_by_hand(plotter, actor, volume, browser)
    await browsers.changed(plotter, actor, volume, browser)
print("all well")
""",
)


@needs("nbclient", "nbformat", "ipykernel", "nest_asyncio2")
def test_in_a_notebook():
    """The kernel of a notebook in server mode follows what is done in its output."""
    nbclient = pytest.importorskip("nbclient")
    nbformat = pytest.importorskip("nbformat")
    cells = [nbformat.v4.new_code_cell(cell) for cell in CELLS]
    book = nbformat.v4.new_notebook(cells=cells)
    nbclient.NotebookClient(book, timeout=500, kernel_name="python3").execute()
    text = [output.get("text", "") for output in book.cells[-1].outputs]
    assert "".join(text).strip().splitlines()[-1:] == ["all well"], book.cells[-1].outputs
