"""The page that a server sends: a viewer, its controls, and the connection to the server."""

from __future__ import annotations

from pyvista_vdi.web.bundle import viewer_script

_PAGE = """\
<!DOCTYPE html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>VDI</title>
<style>
html, body {{ margin: 0; height: 100%; background: #202020; color: #d0d0d0; }}
body {{ display: flex; flex-direction: column; font: 14px sans-serif; }}
vdi-viewer {{ flex: 1; min-height: 0; }}
form {{ display: flex; flex-wrap: wrap; gap: 4px 16px; padding: 6px 10px; align-items: center; }}
label {{ display: flex; gap: 6px; align-items: center; }}
input[type="number"] {{ width: 6em; }}
/* As large whatever it says: the viewer's size is the view that is asked for. */
output {{ margin-left: auto; width: 14em; height: 1.5em; overflow: auto; text-align: right; }}
</style>
<body>
<vdi-viewer id="viewer"></vdi-viewer>
<form><span id="controls" style="display: contents"></span><output id="status"></output></form>
<script type="module" nonce="{nonce}">
{script}
const byId = (id) => document.getElementById(id);
window.remote = connectPage(byId("viewer"), byId("controls"), byId("status"));
</script>
</body>
</html>
"""


def served_page(nonce: str) -> str:
    """Return the page; its script carries the nonce of the page's content security policy."""
    return _PAGE.format(nonce=nonce, script=viewer_script(remote=True, module=True))
