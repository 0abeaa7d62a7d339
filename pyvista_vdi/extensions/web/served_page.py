"""The page that a server sends: a viewer, its controls, and the connection to the server."""

from __future__ import annotations

import secrets

from pyvista_vdi.extensions.web.bundle import viewer_script
from pyvista_vdi.extensions.web.page import html_page

#: What is said stands over the picture, as high as its text: the viewer's size, which is the view
#: that is asked for, depends on none of it.
_STYLE = """\
body { display: flex; flex-direction: column; color: #d0d0d0; font: 14px sans-serif; }
vdi-viewer { flex: 1; min-height: 0; }
form { position: relative; display: flex; flex-wrap: wrap; gap: 4px 16px; padding: 6px 10px;
  align-items: center; min-height: 1.5em; }
label { display: flex; gap: 6px; align-items: center; }
input[type="number"] { width: 6em; }
@media (pointer: coarse) { input, select { min-height: 36px; } }
input:invalid { outline: 2px solid #ff6060; }
output { position: absolute; right: 0; bottom: 100%; max-width: 100%; box-sizing: border-box;
  padding: 4px 10px; background: #000c; text-align: right; overflow-wrap: anywhere;
  pointer-events: none; }
output:empty { padding: 0; }
"""

_BODY = """\
<vdi-viewer id="viewer" hash></vdi-viewer>
<form><span id="controls" style="display: contents"></span><output id="status"></output></form>
<script type="module" nonce="%s">
%s
const byId = (id) => document.getElementById(id);
window.remote = connectPage(byId("viewer"), byId("controls"), byId("status"));
</script>
"""


def served_page(host: str) -> str:
    """Return the page as a server of that name sends it; only its own script runs in it."""
    nonce = secrets.token_urlsafe(16)
    policy = (
        f"default-src 'none'; script-src 'nonce-{nonce}' blob:; worker-src blob:; "
        "style-src 'unsafe-inline'; img-src data: blob:; "
        f"connect-src 'self' ws://{host} wss://{host}; base-uri 'none'; form-action 'none'"
    )
    body = _BODY % (nonce, viewer_script("remote.js", module=True))
    return html_page("A volume, to be turned", body, "#202020", policy, _STYLE)
