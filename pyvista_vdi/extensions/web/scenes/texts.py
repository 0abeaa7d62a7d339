"""One text as the viewer's annotations.js takes it."""

from __future__ import annotations

from typing import Any

import numpy as np

from pyvista_vdi.vtk_pipeline.vtk import vtkTextMapper

HORIZONTAL = ("left", "center", "right")  # vtkTextProperty's justifications
VERTICAL = ("bottom", "middle", "top")


def described_text(
    text: str, place: Any, look: Any, renderer: Any, size: float | None = None, **changes: Any
) -> dict[str, Any]:
    """Describe a text; ``place`` in pixels from the lower left corner."""
    width, height = renderer.GetSize()
    described: dict[str, Any] = {
        "kind": "text",
        "text": text,
        "place": [place[0] / width, place[1] / height],
        "size": look.GetFontSize() if size is None else size,
        "color": [*look.GetColor(), look.GetOpacity()],
        "family": look.GetFontFamilyAsString(),
        "bold": bool(look.GetBold()),
        "italic": bool(look.GetItalic()),
        "shadow": list(look.GetShadowOffset()) if look.GetShadow() else None,
        "angle": look.GetOrientation(),
        "spacing": look.GetLineSpacing(),
        "across": HORIZONTAL[look.GetJustification()],
        "along": VERTICAL[look.GetVerticalJustification()],
    }
    if look.GetBackgroundOpacity() > 0:
        described["background"] = [*look.GetBackgroundColor(), look.GetBackgroundOpacity()]
    if look.GetFrame():
        described["frame"] = [*look.GetFrameColor(), look.GetFrameWidth()]
    return {**described, **changes}


def size_of(text: str, look: Any, renderer: Any) -> Any:
    """Return the width and height of a text, pixels."""
    mapper, held = mapper_of(text, look), [0, 0]
    mapper.GetSize(renderer, held)
    return np.array(held, dtype=float)


def constrained(texts: list[str], look: Any, room: Any, renderer: Any) -> int:
    """Return the largest font by which all texts have room."""
    width, height = map(int, room)
    mappers = [mapper_of(text, look) for text in texts]
    return max(1, min(m.SetConstrainedFontSize(renderer, width, height) for m in mappers))


def mapper_of(text: str, look: Any) -> Any:
    """Return what measures a text."""
    mapper = vtkTextMapper()
    mapper.SetInput(text)
    mapper.GetTextProperty().ShallowCopy(look)
    return mapper
