"""Files with bytes or members changed, as damaged and hostile ones are."""

from __future__ import annotations

import json
import zipfile
import zlib
from io import BytesIO

import numpy as np

from pyvista_vdi.io.vdi_file.layout import INDEX_DTYPE


def rewritten(data, edit, arrays=None, **options):
    """Return an archive with members changed; its checksums fit, where arrays have one chunk.

    ``arrays``: those of the index; by default all that there are, where each has one chunk.
    """
    with zipfile.ZipFile(BytesIO(data)) as archive:
        members = {info.filename: archive.read(info) for info in archive.infolist()}
    found = [name for name in members if name not in ("vdi.json", "coarse.vdi", "chunks")]
    edit(members)
    one_chunk = len(members.get("chunks", b"")) == INDEX_DTYPE.itemsize * len(found)
    if arrays or (arrays is None and one_chunk):
        contents = [members.get(name, b"") for name in arrays or found]
        rows = [(len(content), zlib.crc32(content)) for content in contents]
        members["chunks"] = np.array(rows, INDEX_DTYPE).tobytes()
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, content in members.items():
            archive.writestr(zipfile.ZipInfo(name), content, **options)
    return stream.getvalue()


def described(data, **changes):
    """Return an archive with entries of its description changed."""

    def edit(members):
        members["vdi.json"] = json.dumps({**json.loads(members["vdi.json"]), **changes}).encode()

    return rewritten(data, edit)


def check_changed_bytes(path, read, refusals, places):
    """A byte changed at any of some places is refused, or what is read is as it was.

    Formats have fields that say nothing of the content, such as times: a fifth may be harmless.
    """
    whole, original, refused = path.read_bytes(), read(path), 0
    for place in places:
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0x55]) + whole[place + 1 :])
        try:
            found = read(path)
        except refusals:
            refused += 1
        else:
            assert found.equals(original), place
    assert refused > 0.8 * len(places)


def declaring(data, n=None, window=None):
    """Return an archive that declares more than it holds, consistently: the data give it away."""
    with zipfile.ZipFile(BytesIO(data)) as archive:
        description = json.loads(archive.read("vdi.json"))
    n = description["n_supersegments"] if n is None else n
    window = window or description["window_size"]
    for name, array in description["arrays"].items():
        array["shape"][0] = window[0] * window[1] if name == "counts" else n
    changes = {"n_supersegments": n, "window_size": window, "arrays": description["arrays"]}
    return described(data, **changes)
