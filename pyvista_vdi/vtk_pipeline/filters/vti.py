"""VDIs in VTK's own image files, ``.vti``: the canonical form, written and read by VTK."""

from __future__ import annotations

import math
import os
import re
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any

from pyvista_vdi.errors import InvalidVDIError, VDIFileError
from pyvista_vdi.io.vdi_file.reader import FileInfo
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.whole_file import whole_file
from pyvista_vdi.vtk_pipeline import vtk
from pyvista_vdi.vtk_pipeline.filters.convert import (
    DESCRIPTION,
    FORM_VERSION,
    vdi_from_image,
    vdi_to_image,
)

#: Names of VTK's compressors, as its writer's methods have them.
_COMPRESSORS = {"lz4": "LZ4", "zlib": "ZLib", "lzma": "LZMA", "none": "None"}

#: Most values that one byte of a file can stand for: LZMA's best, of bytes.
_MAX_RATIO = 1 << 13


def write(
    vdi: VDI, path: str | os.PathLike[str], *, compression: str = "lz4", level: int = 1
) -> Path:
    """Write a VDI's canonical form to a ``.vti`` file, exactly: see :func:`pyvista_vdi.io.write`.

    ``compression`` is VTK's compressor, lz4, zlib, lzma or none, and ``level`` its effort, 1 to 9.
    """
    try:
        image = vdi_to_image(vdi)
    except InvalidVDIError as error:
        raise VDIFileError(str(error)) from error
    writer = vtk.vtkXMLImageDataWriter()
    writer.SetInputData(image)
    getattr(writer, f"SetCompressorTypeTo{_COMPRESSORS[compression]}")()
    if compression != "none":
        writer.SetCompressionLevel(level)
    writer.SetDataModeToAppended()
    writer.EncodeAppendedDataOff()
    writer.WriteToOutputStringOn()  # VTK does not say why a disk does not take a file
    target = Path(os.path.realpath(path))
    with whole_file(target) as stream:
        with vtk.caught_messages() as messages:
            written = writer.Write() and not writer.GetErrorCode()
        if not written:
            raise VDIFileError(f"{target} could not be written: {_first_line(messages)}")
        stream.write(writer.GetOutputString())
    return target


def read(path: str | os.PathLike[str]) -> VDI | DeferredVDI:
    """Read a VDI from a ``.vti`` file that holds its canonical form."""
    image = _image(path)
    try:
        return vdi_from_image(image)
    except InvalidVDIError as error:
        raise VDIFileError(f"{path}: {error}") from error


def read_info(path: str | os.PathLike[str]) -> FileInfo:
    """Read what a ``.vti`` file says about its VDI; VTK reads the arrays, too."""
    vdi = read(path)
    file = Path(path)
    return FileInfo(
        path=file,
        format_version=FORM_VERSION,
        written_by="VTK",
        camera=vdi.camera,
        window_size=vdi.window_size,
        n_supersegments=vdi.n_supersegments,
        bounds=vdi.bounds,
        depth_origin=vdi.depth_origin,
        metadata=vdi.metadata,
        codec=_codec(file),
        file_bytes=file.stat().st_size,
        memory_bytes=vdi.nbytes,
        deferred=vdi.about if isinstance(vdi, DeferredVDI) else None,
    )


def holds_vdi(path: str | os.PathLike[str]) -> bool:
    """Whether a ``.vti`` file's header names the arrays of a VDI; False where there is no file."""
    wanted = re.compile(rb'<AppendedData|<Array type="String" Name="%b"' % DESCRIPTION.encode())
    try:
        # Not read: it may be a volume of any size
        with Path(path).open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as content:
            found = wanted.search(content)
            return found is not None and found[0] != b"<AppendedData"
    except (OSError, ValueError):  # an empty one cannot be mapped
        return False


def _image(path: Any) -> Any:
    try:
        file = Path(path)
        # At once: VTK opens a file several times, and another may have its name by then
        content = file.read_bytes()
    except (OSError, TypeError, ValueError) as error:
        raise VDIFileError(
            f"{path} cannot be read: {getattr(error, 'strerror', None) or error}"
        ) from error
    # Refuse what is no VTK image, or declares more than its bytes could hold: VTK believes it
    head = content.partition(b"<AppendedData")[0]
    if not re.search(rb"<VTKFile[^>]*type=[\"']ImageData[\"']", head):
        raise VDIFileError(f"{file} is not a VTK image file (.vti): it has no such header")
    declared = [int(n) for n in re.findall(rb"NumberOfTuples=[\"']\s*(\d{1,20})", head)]
    for extent in re.findall(rb"Extent=[\"']([^\"']*)[\"']", head):
        ends = [int(n) for n in re.findall(rb"-?\d{1,20}", extent)]
        sizes = [last - first + 1 for first, last in zip(ends[::2], ends[1::2], strict=False)]
        declared.append(math.prod(max(size, 0) for size in sizes))
    if max(declared, default=0) > len(content) * _MAX_RATIO:
        raise VDIFileError(
            f"{file} is damaged: {len(content)} bytes cannot hold the {max(declared)} values that "
            "they declare"
        )
    reader = vtk.vtkXMLImageDataReader()
    reader.ReadFromInputStringOn()
    reader.SetInputString(content)
    with vtk.caught_messages() as messages:
        reader.Update()
    if messages.GetOutput() or reader.GetErrorCode():
        raise VDIFileError(f"{file} is damaged: {_first_line(messages)}")
    return reader.GetOutput()


def _codec(file: Path) -> str:
    """Return the compressor that the file's first line names."""
    with file.open("rb") as stream:
        head = stream.read(1024)
    for name, vtks in _COMPRESSORS.items():
        if f"vtk{vtks}DataCompressor".encode() in head:
            return name
    return "none"


def _first_line(messages: Any) -> str:
    """Return the gist of VTK's first message: without its place in VTK's source."""
    lines = [line.strip() for line in messages.GetOutput().splitlines() if line.strip()]
    told = [line.partition("): ")[2] for line in lines if "): " in line]
    return next(iter(told or lines), "VTK does not say why")
