"""How series and sets are stored: a folder, or one ZIP, of numbered .vdi files and one JSON."""

from __future__ import annotations

import io
import os
import weakref
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import IO, Any, NoReturn

from pyvista_vdi._version import __version__
from pyvista_vdi.errors import InvalidArgumentError, VDIFileError
from pyvista_vdi.extensions.series import EXTENSION
from pyvista_vdi.io.files import format_named, opened
from pyvista_vdi.io.progress import Pieces, Progress
from pyvista_vdi.io.vdi_file import reader, writer
from pyvista_vdi.io.vdi_file.chunks import CODECS, check_level
from pyvista_vdi.io.vdi_file.layout import from_json, to_json
from pyvista_vdi.io.vdi_file.reader import FileInfo
from pyvista_vdi.model.checks import one_of
from pyvista_vdi.model.classification import IN_PLACE, Look
from pyvista_vdi.model.whole_file import as_path, check_writable, whole_file, with_suffix
from pyvista_vdi.registry import FileFormat

#: Version of the JSON.
VERSION = 1
#: VDIs that are kept of those that were read: the last ones.
_KEPT = 6
#: Name of a VDI's file, by its number.
VDI_NAME = "{:06}.vdi"
SERIES = EXTENSION.formats[0]


class Called(Sequence[Any]):
    """What a function makes of each item of a sequence, when it is asked for.

    ``kept``: how many are kept of those that were asked for last. It is pickled as what it is
    made from.
    """

    def __init__(self, function: Callable[[Any], Any], items: Sequence[Any], kept: int = 0) -> None:
        self._given: tuple[Any, ...] = function, items, kept
        self._length = len(items)
        self._made = lru_cache(kept)(lambda i: function(items[i]))

    def __reduce__(self) -> Any:
        return type(self), self._given

    def __len__(self) -> int:
        return self._length

    def __getitem__(self, index: Any) -> Any:
        return self._made(range(self._length)[index])


class Archive(Called):
    """The VDIs of a folder, a ZIP or a page: each is read when it is asked for, from any thread.

    It is pickled as its path and format. ``about`` is what the JSON says.
    """

    def __init__(self, path: str | os.PathLike[str], kind: FileFormat) -> None:
        self.path, self._kind = as_path(path).absolute(), kind
        self._root: Any = self.path if self.path.is_dir() else zipfile.Path(self._opened())
        content = self._content(kind.head)
        try:
            self.about: dict[str, Any] = from_json(content)
            form, version = self.about["format"], self.about["version"]
            count = len(self.about["times" if kind == SERIES else "views"])
        except (KeyError, TypeError, ValueError, RecursionError) as error:
            self.refuse(f"its {kind.head} is incomplete ({error!r})")
        if (form, version) != (f"pyvista-vdi-{kind.holds}", VERSION):
            raise VDIFileError(
                f"{path} is of the format {form!r}, version {version!r}; pyvista-vdi {__version__} "
                f"reads 'pyvista-vdi-{kind.holds}', version {VERSION}: upgrade by pip install -U "
                "pyvista-vdi"
            )
        super().__init__(self._file, range(count), _KEPT)
        self._given = self.path, kind

    def info(self) -> FileInfo:
        """Return what is known of the first VDI without its arrays, and the bytes of all."""
        files = self.path.iterdir() if self.path.is_dir() else [self.path]
        n_bytes = sum(file.stat().st_size for file in files)
        return replace(self._file(0, reader.read_info), path=self.path, file_bytes=n_bytes)

    def refuse(self, why: str) -> NoReturn:
        """Raise the error of what is damaged."""
        raise VDIFileError(
            f"{self.path} is damaged: {why}; copy it from its source again, or make it anew"
        )

    def _opened(self) -> zipfile.ZipFile:
        """Return the file as an archive, or say what it is instead of one."""
        stream = opened(self.path)
        weakref.finalize(self, stream.close)
        try:
            archive = zipfile.ZipFile(stream)
        except reader.ARCHIVE_ERRORS as error:
            self.refuse(f"it is truncated, or no {self._kind.holds} of VDIs ({error})")
        # The directory at the end of a file that was cut off is that of a .vdi file within
        if not archive.infolist() or archive.infolist()[0].header_offset:
            self.refuse("it is truncated")
        if any(member.compress_type != zipfile.ZIP_STORED for member in archive.infolist()):
            self.refuse("its files are compressed once more: zip them by zip -0")
        return archive

    def _content(self, name: str) -> bytes:
        """Return the bytes of one of the files."""
        try:
            return (self._root / name).read_bytes()  # type: ignore[no-any-return]
        except (KeyError, FileNotFoundError):
            self.refuse(f"it has no {name}")
        except reader.ARCHIVE_ERRORS as error:
            self.refuse(f"its {name} cannot be read ({error})")

    def _file(self, i: int, read: Any = reader.read) -> Any:
        """Return what a function of the reader of ``.vdi`` files makes of one of the VDIs."""
        name = VDI_NAME.format(i)
        return read(self.path / name, stream=io.BytesIO(self._content(name)))


def head_bytes(kind: FileFormat, about: Mapping[str, Any]) -> bytes:
    """Return the JSON."""
    head = {"format": f"pyvista-vdi-{kind.holds}", "version": VERSION}
    return to_json({**head, "written_by": f"pyvista-vdi {__version__}", **about}).encode()


def save(vdis: Any, path: str | os.PathLike[str], **options: Any) -> Path:
    """Write a series or a set as one file, or as a page: see :meth:`VDICollection.save`."""
    if look := ", ".join(name for name in options if name in (*Look.declared, *IN_PLACE)):
        raise InvalidArgumentError(
            f"save() takes no look, got {look}: give it to classified(), where values are kept, "
            "and save what that returns"
        )
    found, kind = format_named(path), vdis.kind
    if found is not None and found.page:
        return found.load().write(vdis, path, **options)  # type: ignore[no-any-return]
    target = check_writable(with_suffix(as_path(path), (kind.suffix,), f"a {kind.holds}"))
    if target.exists() and not zipfile.is_zipfile(target):
        raise VDIFileError(f"{target} holds something else: choose another name, or remove it")
    if options.get("precision") is None:
        options["precision"] = vdis[0].precision if kind == SERIES else "8-byte"
    with whole_file(target) as out:
        write_to(out, vdis, **options)
    return target


def write_to(
    stream: IO[bytes],
    vdis: Any,
    *,
    precision: str,
    progress: Progress | None = None,
    compression: str = "zstd",
    level: int | None = None,
) -> int:
    """Write a series or a set to a stream; return the bytes of the JSON and the first VDI."""
    one_of(compression, "compression", (*CODECS, "none"))
    check_level(level)
    done, first = Pieces(progress, len(vdis)), 0
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(writer.stored(vdis.kind.head), head_bytes(vdis.kind, vdis.about))
        for i in range(len(vdis)):
            vdi, file = vdis[i].with_precision(precision), io.BytesIO()
            writer.write_to(file, vdi, compression, level, coarse=False)
            archive.writestr(writer.stored(VDI_NAME.format(i)), file.getvalue())
            first = first or stream.tell()
            done()
    return first
