"""The page that a server sends: a viewer, its controls, and the connection to the server."""

from __future__ import annotations

import secrets

from pyvista_vdi.extensions.web.bundle import viewer_script

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
form {{ position: relative; display: flex; flex-wrap: wrap; gap: 4px 16px; padding: 6px 10px;
  align-items: center; min-height: 1.5em; }}
label {{ display: flex; gap: 6px; align-items: center; }}
input[type="number"] {{ width: 6em; }}
@media (pointer: coarse) {{ input, select {{ min-height: 36px; }} }}
input:invalid {{ outline: 2px solid #ff6060; }}
/* Over the picture, as high as its text: the viewer's size, which is the view that is asked for,
   depends on nothing that is said. */
output {{ position: absolute; right: 0; bottom: 100%; max-width: 100%; box-sizing: border-box;
  padding: 4px 10px; background: #000c; text-align: right; overflow-wrap: anywhere;
  pointer-events: none; }}
output:empty {{ padding: 0; }}
main {{ display: contents; }}
h1 {{ position: absolute; width: 1px; height: 1px; margin: 0; overflow: hidden; }}
</style>
<body>
<main>
<h1>A volume, to be turned</h1>
<vdi-viewer id="viewer" hash></vdi-viewer>
<form><span id="controls" style="display: contents"></span><output id="status"></output></form>
</main>
<script type="module" nonce="{nonce}">
{script}
const byId = (id) => document.getElementById(id);
window.remote = connectPage(byId("viewer"), byId("controls"), byId("status"));
</script>
</body>
</html>
"""


def served_page(host: str) -> tuple[str, dict[str, str]]:
    """Return the page as a server of that name sends it, and its headers.

    Its script carries the nonce of the page's content security policy.
    """
    nonce = secrets.token_urlsafe(16)
    headers = {
        "Cache-Control": "no-store",
        "Referrer-Policy": "no-referrer",
        "X-Content-Type-Options": "nosniff",
        "X-Frame-Options": "SAMEORIGIN",
        "Content-Security-Policy": (
            f"default-src 'none'; script-src 'nonce-{nonce}' blob:; worker-src blob:; "
            f"style-src 'unsafe-inline'; img-src data: blob:; "
            f"connect-src 'self' ws://{host} wss://{host}; base-uri 'none'; form-action 'none'"
        ),
    }
    return _PAGE.format(nonce=nonce, script=viewer_script(remote=True, module=True)), headers
