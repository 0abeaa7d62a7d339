"""The files that an array is read from: that they stay, and that other processes have the same."""

import hashlib
import os
from pathlib import Path
from typing import Any

from pyvista_vdi.errors import InvalidVolumeError

#: Metadata of a group or an array of zarr: a folder that has one belongs to a store.
ZARR_FILES = ("zarr.json", ".zgroup", ".zarray", ".zattrs")
#: Files, by their absolute paths, and digests of pieces of them.
Digests = tuple[tuple[str, str], ...]


def local_files(array: Any) -> Path | None:
    """Return an array's file, or its folder, if it is in any here."""
    library = type(array).__module__.partition(".")[0]
    if library == "h5py":
        return Path(array.file.filename).absolute()
    # A local store has its folder as `root` in zarr 3, and as `path` in zarr 2 and by fsspec
    store = getattr(array, "store", None)
    root = Path(str(getattr(store, "root", None) or getattr(store, "path", None)))
    return root / array.path if library == "zarr" and root.is_dir() else None


def by_absolute_path(array: Any) -> Any:
    """Return an array of zarr whose folder has a relative path as one that has an absolute path."""
    path = local_files(array)
    if path is None or path.is_absolute():
        return array
    import zarr

    return zarr.open_array(os.path.abspath(path), mode="r")  # noqa: PTH100 - no links


def state_of(array: Any, path: Path) -> Any:
    """Return what stays as long as an array that was opened may be read."""
    if path.is_dir():
        return [file.read_bytes() for name in ZARR_FILES if (file := path / name).is_file()]
    if not getattr(array, "id", None) or not path.is_file():
        return None
    if array.file.mode != "r":
        array.file.flush()  # what this process has written is in the file then
        return True
    at = path.stat()
    return at.st_dev, at.st_ino, at.st_size, at.st_mtime_ns


def digests_of(array: Any) -> Digests:
    """Return what tells an array's files from others: its metadata and a chunk, if it has any."""
    if (path := local_files(array)) is None:
        return ()
    files = [path]
    if path.is_dir():
        files = [path / name for name in ZARR_FILES if (path / name).is_file()]
        others = (Path(at, f) for at, _, names in os.walk(path) for f in sorted(names))
        files += [next((file for file in others if file not in files), files[0])]
    return tuple((os.path.abspath(file), _digest(file)) for file in files)  # noqa: PTH100


def check_digests(digests: Digests) -> None:
    """Raise InvalidVolumeError if this process has other files: zarr reads what is absent as 0."""
    for file, digest in digests:
        try:
            wrong = "" if _digest(Path(file)) == digest else "is another file there than here"
        except OSError as error:
            wrong = f"cannot be read there ({error.strerror})"
        if wrong:
            raise InvalidVolumeError(
                f"{file} {wrong}: copy the whole store to the same path for all, and leave it as is"
            )


def _digest(file: Path) -> str:
    with file.open("rb") as stream:
        size = stream.seek(0, os.SEEK_END)
        pieces = [max(size - 4096, 0) * k // 31 for k in range(32)]
        read = [stream.read(4096) for at in pieces if stream.seek(at) == at]
    return hashlib.sha256(b"%d" % size + b"".join(read)).hexdigest()
