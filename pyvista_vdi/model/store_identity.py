"""What tells the files of an array from others of the same name, in another process or later.

Who does not find a chunk of zarr reads zeros, or whatever fills it: so other processes show first
that they have the same files. Only metadata and samples are read for it.
"""

import dataclasses
import functools
import hashlib
import itertools
import json
import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pyvista_vdi.errors import InvalidVolumeError

#: Metadata of an array, of zarr's formats 3 and 2.
ARRAY_FILES = ("zarr.json", ".zarray")
#: Bytes of a sample; samples of a chunk's file and of a file that holds everything; chunks' files.
_SAMPLE, _OF_CHUNK, _OF_FILE, _CHUNKS = 4096, 2, 32, 8
#: Chunks that are known by name not to be there; of more, it is not known which they are.
_MOST_ABSENT = 1000


def local_files(array: Any) -> tuple[str, Path] | None:
    """Return an array's library and its file, or its folder, if it is in any here."""
    library = type(array).__module__.partition(".")[0]
    if library == "h5py":
        return library, Path(array.file.filename)
    # A local store has its folder as `root` in zarr 3, and as `path` in zarr 2 and by fsspec
    store = getattr(array, "store", None)
    root = getattr(store, "root", None) or getattr(store, "path", None)
    if library != "zarr" or root is None or not Path(str(root)).is_dir():
        return None
    return library, Path(str(root)) / array.path


def by_absolute_path(array: Any) -> Any:
    """Return an array of zarr whose folder has a relative path as one that has an absolute path."""
    found = local_files(array)
    if found is None or found[0] == "h5py" or found[1].is_absolute():
        return array
    import zarr

    return zarr.open_array(os.path.abspath(found[1]), mode="r")  # noqa: PTH100 - no links


def identity_of(array: Any, index: Sequence[int | slice] | None = None) -> "StoreIdentity | None":
    """Return what tells an array's files from others, if it is in files here.

    ``array``: others have none. ``index``: what is taken of it: its time and its channel.
    """
    found = local_files(array)
    if found is None:
        return None
    library, path = found
    if library == "h5py":
        return StoreIdentity(str(path), (("", _digest(path, "")),))
    try:
        (metadata,) = [name for name in ARRAY_FILES if (path / name).is_file()][:1]
        chunks = _Chunks.of(path / metadata, index)
    except (OSError, ValueError, KeyError, TypeError):
        return None
    if chunks is None:
        return None
    names = [metadata, *(chunks.file(at) for at in chunks.spread(_CHUNKS))]
    samples = tuple((name, _digest(path / name, name)) for name in names)
    return StoreIdentity(str(path), samples, chunks, chunks.absent(path))


@dataclass(frozen=True)
class StoreIdentity:
    """What tells an array's files from others.

    ``path``: the array's file or its folder. ``samples``: names of some files in it, and digests of
    samples of them; ``None`` where there is none. ``chunks``: how files of chunks are called, if
    there are any. ``absent``: chunks that have no file; ``None`` where these are not known.
    """

    path: str
    samples: tuple[tuple[str, str | None], ...]
    chunks: "_Chunks | None" = None
    absent: frozenset[str] | None = None

    def absolute(self) -> "StoreIdentity":
        """Return the same, by an absolute path."""
        return dataclasses.replace(self, path=os.path.abspath(self.path))  # noqa: PTH100 - no links

    def check(self) -> None:
        """Raise InvalidVolumeError if this process does not find these files."""
        for name, digest in self.samples:
            file = Path(self.path) / name if name else Path(self.path)
            try:
                found = _digest(file, name)
            except OSError as error:
                raise InvalidVolumeError(
                    f"{file} cannot be read there: {error.strerror}; give the process that reads "
                    "it the right to, or another path that all processes can read"
                ) from error
            if found is None and digest is not None:
                raise InvalidVolumeError(
                    f"{file} is not found there: mount or copy all of {self.path} to the same "
                    "path, or open it by an absolute path that all processes have"
                )
            if found != digest:
                raise InvalidVolumeError(
                    f"{file} is another file there than here: what is at {self.path} must be the "
                    "same for all processes, and stay as it is while it is read"
                )

    def check_chunks(self, box: Sequence[slice]) -> None:
        """Raise InvalidVolumeError if a chunk of some points (z, y, x) has lost its file."""
        if self.chunks is None or self.absent is None:
            return
        for at in self.chunks.of_box(box):
            name = self.chunks.file(at)
            if name not in self.absent and not (Path(self.path) / name).is_file():
                raise InvalidVolumeError(
                    f"{self.path}/{name}, a chunk's file, is not found there: mount or copy all of "
                    f"{self.path} to the same path"
                )


@dataclass(frozen=True)
class _Chunks:
    """How zarr calls the files of an array's chunks, or of its shards."""

    counts: tuple[int, ...]
    lengths: tuple[int, ...]
    before: str
    separator: str
    taken: tuple[int | None, ...]  # the place along time and channel; None along z, y and x

    @classmethod
    def of(cls, metadata: Path, index: Sequence[int | slice] | None) -> "_Chunks | None":
        """Read the metadata of an array; ``None`` where its files are called in other ways."""
        said = json.loads(metadata.read_text(encoding="utf-8"))
        if said["zarr_format"] == 2:
            lengths, before, separator = said["chunks"], "", said.get("dimension_separator", ".")
        elif said["chunk_grid"]["name"] == "regular":
            lengths = said["chunk_grid"]["configuration"]["chunk_shape"]
            named = said["chunk_key_encoding"]
            default = named["name"] == "default"
            separator = named.get("configuration", {}).get("separator", "/" if default else ".")
            before = f"c{separator}" if default else ""
        else:
            return None
        shape = said["shape"]
        counts = tuple(-(-n // length) for n, length in zip(shape, lengths, strict=True))
        taken = tuple(k if isinstance(k, int) else None for k in index or (None,) * len(shape))
        return cls(counts, tuple(lengths), before, separator, taken)

    def file(self, at: Sequence[int]) -> str:
        """Return the name of a chunk's file in the array's folder."""
        return self.before + self.separator.join(map(str, at))

    def spread(self, most: int) -> list[tuple[int, ...]]:
        """Return some chunks, spread over what is taken of the array."""
        counts = [n for n, k in zip(self.counts, self.taken, strict=True) if k is None]
        total = math.prod(counts)
        picked = np.unique(np.linspace(0, total - 1, min(most, total)).astype(np.int64))
        return [self._at([int(k) for k in np.unravel_index(i, counts)]) for i in picked]

    def of_box(self, box: Sequence[slice]) -> Iterator[tuple[int, ...]]:
        """Yield the chunks of some points (z, y, x) of what is taken of the array."""
        kept = [n for n, k in zip(self.lengths, self.taken, strict=True) if k is None]
        axes = [range(p.start // n, -(-p.stop // n)) for p, n in zip(box, kept, strict=True)]
        return map(self._at, itertools.product(*axes))

    def absent(self, folder: Path) -> frozenset[str] | None:
        """Return the chunks of what is taken of the array that have no file, if they are few."""
        sizes = zip(self.counts, self.lengths, self.taken, strict=True)
        whole = [slice(0, n * length) for n, length, k in sizes if k is None]
        there = {
            f"{root}/{name}"[len(str(folder)) + 1 :].replace(os.sep, "/")
            for root, _, names in os.walk(folder)
            for name in names
        }
        files = (self.file(at) for at in self.of_box(whole))
        missing = list(itertools.islice((f for f in files if f not in there), _MOST_ABSENT + 1))
        return frozenset(missing) if len(missing) <= _MOST_ABSENT else None

    def _at(self, kept: Sequence[int]) -> tuple[int, ...]:
        """Return a chunk's place among all, by its place along z, y and x."""
        along = iter(kept)
        return tuple(
            next(along) if k is None else k // length
            for k, length in zip(self.taken, self.lengths, strict=True)
        )


def _digest(file: Path, name: str) -> str | None:
    """Return a digest of metadata, all of it, or of samples of a file; ``None`` if it is absent."""
    if name in ARRAY_FILES:
        try:
            return hashlib.sha256(file.read_bytes()).hexdigest()
        except (FileNotFoundError, NotADirectoryError):
            return None
    # Find a digest of a file's length and of some pieces of it; None if it is not there
    pieces = _OF_CHUNK if name else _OF_FILE
    try:
        with file.open("rb") as stream:
            size = stream.seek(0, os.SEEK_END)
            digest = hashlib.sha256(str(size).encode())
            for k in range(pieces):
                stream.seek(max(size - _SAMPLE, 0) * k // (pieces - 1))
                digest.update(stream.read(_SAMPLE))
    except (FileNotFoundError, NotADirectoryError):
        return None
    return digest.hexdigest()


@functools.lru_cache(maxsize=64)
def check_once(identity: StoreIdentity, run: str) -> None:
    """Check in this process, once for a run."""
    identity.check()
