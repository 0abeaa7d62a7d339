"""How series and sets are stored: a folder, or one ZIP, of numbered .vdi files and one JSON."""

from __future__ import annotations

import io
import os
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import IO, Any, NoReturn

from pyvista_vdi._version import __version__
from pyvista_vdi.errors import VDIFileError
from pyvista_vdi.io.files import opened
from pyvista_vdi.io.progress import Pieces, Progress
from pyvista_vdi.io.vdi_file import reader, writer
from pyvista_vdi.io.vdi_file.chunks import CODECS, check_level
from pyvista_vdi.io.vdi_file.description import from_json, to_json
from pyvista_vdi.io.vdi_file.reader import FileInfo
from pyvista_vdi.model.checks import one_of
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.packing import check_precision
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.whole_file import as_path, check_writable, whole_file, with_suffix

#: Version of the JSON.
VERSION = 1
#: What the files of an earlier format begin with: steps by differences, and sets of them.
_EARLIER = (b"\x89VDIS\r\n\x1a", b"\x89VDIV\r\n\x1a")


@dataclass(frozen=True)
class Kind:
    """What distinguishes a stored series from a stored set."""

    name: str
    suffix: str
    head: str  # name of the JSON
    listed: str  # its entry that has one item for each VDI
    kept: int  # VDIs that are kept of those that were read: the last ones

    @property
    def format(self) -> str:
        """What the JSON calls the format."""
        return f"pyvista-vdi-{self.name}"


SERIES = Kind("series", ".vdis", "series.json", "times", 4)
SET = Kind("set", ".vdiset", "set.json", "views", 8)


@dataclass(frozen=True)
class StoredInfo(FileInfo):
    """What a series or a set says about itself; the first VDI's, but for path and bytes.

    ``times``: of the steps; empty for a set. ``vdi_bytes``: size of each VDI's file.
    """

    times: tuple[float, ...] = ()
    vdi_bytes: tuple[int, ...] = ()


@dataclass(frozen=True)
class Encoding:
    """How the .vdi files are written: see :meth:`VDI.save`."""

    precision: str | None = "8-byte"  # None: as they are
    compression: str = "zstd"
    level: int | None = None

    def __post_init__(self) -> None:
        if self.precision is not None:
            check_precision(self.precision)
        one_of(self.compression, "compression", (*CODECS, "none"))
        check_level(self.level)

    def __call__(self, vdi: VDI | DeferredVDI) -> bytes:
        """Return a VDI's file."""
        vdi = vdi if self.precision is None else vdi.with_precision(self.precision)
        lists, about = (vdi.lists, vdi.about) if isinstance(vdi, DeferredVDI) else (vdi, None)
        stream = io.BytesIO()
        writer.write_to(stream, lists, self.compression, self.level, coarse=False, deferred=about)
        return stream.getvalue()


class Archive(Sequence[Any]):
    """The VDIs of a folder, a ZIP or a page: each is read when it is asked for, from any thread.

    It is pickled as its path and kind. ``about`` is what the JSON says.
    """

    def __init__(self, path: str | os.PathLike[str], kind: Kind) -> None:
        self.path, self._kind = as_path(path), kind
        self._zip = None if self.path.is_dir() else self._opened()
        try:
            self.about: dict[str, Any] = from_json(self._content(kind.head))
            form, version = self.about["format"], self.about["version"]
            self._length = len(self.about[kind.listed])
        except (KeyError, TypeError, ValueError, RecursionError) as error:
            self.refuse(f"its {kind.head} is no JSON, or incomplete ({error!r})")
        if (form, version) != (kind.format, VERSION):
            raise VDIFileError(
                f"{path} is of the format {form!r}, version {version!r}; this is pyvista-vdi "
                f"{__version__}, which reads {kind.format!r}, version {VERSION}: upgrade by "
                "pip install -U pyvista-vdi"
            )
        self._read = lru_cache(kind.kept)(self._read_now)

    def __reduce__(self) -> Any:
        return type(self), (self.path, self._kind)

    def __len__(self) -> int:
        return self._length

    def __getitem__(self, index: Any) -> Any:
        return self._read(range(len(self))[index])

    def info(self) -> StoredInfo:
        """Return what is known without the arrays."""
        if not len(self):
            raise VDIFileError(f"{self.path} has no finished VDI: none has been written yet")
        first = reader.read_info(self.path / name_of(0), stream=self._stream(0))
        sizes = tuple(self._size(name_of(i)) for i in range(len(self)))
        total = sum(sizes) if self._zip is None else self.path.stat().st_size
        about = {**vars(first), "path": self.path, "file_bytes": total, "vdi_bytes": sizes}
        return StoredInfo(**about, times=tuple(self.about.get("times", ())))

    def refuse(self, why: str) -> NoReturn:
        """Raise the error of what is damaged."""
        raise VDIFileError(
            f"{self.path} is damaged: {why}; copy it from its source again, or make it anew"
        )

    def _opened(self) -> zipfile.ZipFile:
        """Return the file as an archive, or say what it is instead of one."""
        try:
            stream = opened(self.path)
        except (OSError, ValueError) as error:
            raise VDIFileError(
                f"{self.path} cannot be read: {getattr(error, 'strerror', None) or error}"
            ) from error
        try:
            begin = stream.read(8)
            if begin in _EARLIER:
                raise VDIFileError(_earlier(self.path))
            if not begin.startswith(b"PK"):
                raise VDIFileError(
                    f"{self.path} is no {self._kind.name} of VDIs: it begins with {begin!r}"
                )
            archive = zipfile.ZipFile(stream)
            # The directory at the end of a file that was cut off is that of a .vdi file within
            if not archive.infolist() or archive.infolist()[0].header_offset:
                raise zipfile.BadZipFile("its directory is missing")
        except VDIFileError:
            stream.close()
            raise
        except reader.ARCHIVE_ERRORS as error:
            stream.close()
            self.refuse(f"it is truncated, or no whole ZIP ({error})")
        return archive

    def _content(self, name: str) -> bytes:
        """Return the bytes of one of the files."""
        try:
            if self._zip is None:
                return (self.path / name).read_bytes()
            member = self._zip.getinfo(name)
            if member.compress_type != zipfile.ZIP_STORED:
                self.refuse(f"its {name} is compressed once more: zip it by zip -0")
            return self._zip.read(member)
        except (KeyError, FileNotFoundError):
            self.refuse(f"it has no {name}")
        except reader.ARCHIVE_ERRORS as error:
            self.refuse(f"its {name} cannot be read ({error})")

    def _size(self, name: str) -> int:
        try:
            if self._zip is None:
                return (self.path / name).stat().st_size
            return self._zip.getinfo(name).file_size
        except (KeyError, OSError):
            self.refuse(f"it has no {name}")

    def _stream(self, i: int) -> Any:
        return None if self._zip is None else io.BytesIO(self._content(name_of(i)))

    def _read_now(self, i: int) -> Any:
        return reader.read(self.path / name_of(i), stream=self._stream(i))


def _earlier(path: Path) -> str:
    """Return what is said of a file of the earlier format."""
    return (
        f"{path} is of an earlier format (VDIs by their differences), which is not read any more: "
        "make it anew, or have the version that wrote it write .vdi files (pyvista-vdi convert), "
        "and join these by 'pyvista-vdi series'"
    )


def name_of(i: int) -> str:
    """Return the name of a VDI's file by its number."""
    return f"{i:06}.vdi"


def head_bytes(kind: Kind, about: Mapping[str, Any]) -> bytes:
    """Return the JSON."""
    head = {"format": kind.format, "version": VERSION, "written_by": f"pyvista-vdi {__version__}"}
    return to_json({**head, **about}).encode()


def write(
    path: str | os.PathLike[str],
    kind: Kind,
    about: Mapping[str, Any],
    vdis: Sequence[Any],
    encoding: Encoding,
    progress: Progress | None = None,
) -> Path:
    """Write one file, which appears whole or not at all; it replaces what was there."""
    target = check_writable(with_suffix(as_path(path), (kind.suffix,), f"a {kind.name}"))
    if target.exists():
        with target.open("rb") as stream:
            if stream.read(8) in _EARLIER:
                raise VDIFileError(f"{_earlier(target)}; choose another name for this one")
    with whole_file(target) as out:
        write_to(out, kind, about, vdis, encoding, progress)
    return target


def write_to(
    stream: IO[bytes],
    kind: Kind,
    about: Mapping[str, Any],
    vdis: Sequence[Any],
    encoding: Encoding,
    progress: Progress | None = None,
) -> int:
    """Write one file to a stream; return how many bytes hold the JSON and the first VDI."""
    done, first = Pieces(progress, len(vdis)), 0
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(writer.stored(kind.head), head_bytes(kind, about))
        for i in range(len(vdis)):
            archive.writestr(writer.stored(name_of(i)), encoding(vdis[i]))
            first = first or stream.tell()
            done()
    return first
