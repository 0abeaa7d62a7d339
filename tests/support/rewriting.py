"""A .vdi file with members changed, as a hostile one is."""

from __future__ import annotations

import json
import zipfile
import zlib
from io import BytesIO

import numpy as np

from pyvista_vdi.io.vdi_file.layout import INDEX_DTYPE


def rewritten(data, edit, arrays=None):
    """Return an archive with members changed; its checksums fit, where arrays have one chunk."""
    with zipfile.ZipFile(BytesIO(data)) as archive:
        members = {info.filename: archive.read(info) for info in archive.infolist()}
    edit(members)
    if arrays:
        rows = [(len(members[name]), zlib.crc32(members[name])) for name in arrays]
        members["chunks"] = np.array(rows, INDEX_DTYPE).tobytes()
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, content in members.items():
            archive.writestr(zipfile.ZipInfo(name), content)
    return stream.getvalue()


def described(data, **changes):
    def edit(members):
        members["vdi.json"] = json.dumps({**json.loads(members["vdi.json"]), **changes}).encode()

    return rewritten(data, edit)
