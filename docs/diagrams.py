"""Draw the diagrams of these pages: SVG text, the same bytes in every run.

    python docs/diagrams.py

Look at every one of them afterwards. ``tests/packaging/test_documentation.py`` compares the
committed files with the ones that this script draws.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from xml.sax.saxutils import escape

TARGET = Path(__file__).resolve().parent / "images"

Point = tuple[float, float]

INK, FAINT, ACCENT = "#222222", "#999999", "#b3261e"
FILLS = {"blue": "#4c78a8", "green": "#59a14f", "orange": "#f28e2b", "violet": "#9c6ade"}


class Drawing:
    """A white sheet of SVG elements, in pixels from its upper left corner."""

    def __init__(self, width: int, height: int, title: str) -> None:
        head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}"'
            f' width="{width}" height="{height}" font-family="DejaVu Sans, Verdana, sans-serif"'
            f' font-size="13" fill="{INK}">'
        )
        self.parts = [
            head,
            f"<title>{escape(title)}</title>",
            f'<rect width="{width}" height="{height}" rx="6" fill="#ffffff"/>',
        ]

    def text(
        self,
        at: Point,
        content: str,
        *,
        anchor: str = "middle",
        size: float = 13,
        color: str = INK,
        weight: str = "normal",
        family: str = "",
    ) -> None:
        """Write one line; ``at`` is on its base line."""
        font = f' font-family="{family}"' if family else ""
        self.parts.append(
            f'<text x="{at[0]:.1f}" y="{at[1]:.1f}" text-anchor="{anchor}" font-size="{size:g}"'
            f' fill="{color}" font-weight="{weight}"{font}>{_typeset(escape(content))}</text>'
        )

    def line(
        self,
        points: Sequence[Point],
        *,
        color: str = INK,
        width: float = 1.2,
        arrow: bool = False,
    ) -> None:
        """Draw a polyline, with an arrow's head at its end if wanted."""
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        self.parts.append(
            f'<polyline points="{path}" fill="none" stroke="{color}" stroke-width="{width:g}"/>'
        )
        if arrow:
            (x0, y0), (x1, y1) = points[-2:]
            length = math.hypot(x1 - x0, y1 - y0)
            dx, dy = 10 * (x1 - x0) / length, 10 * (y1 - y0) / length
            sides = [(x1 - dx - dy / 2, y1 - dy + dx / 2), (x1 - dx + dy / 2, y1 - dy - dx / 2)]
            self.area([(x1, y1), *sides], color, edge=color)

    def area(
        self,
        points: Iterable[Point],
        fill: str,
        *,
        opacity: float = 1.0,
        edge: str = INK,
        width: float = 0.8,
    ) -> None:
        """Fill a polygon."""
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        self.parts.append(
            f'<polygon points="{path}" fill="{fill}" fill-opacity="{opacity:g}"'
            f' stroke="{edge}" stroke-width="{width:g}"/>'
        )

    def box(
        self, x: float, y: float, width: float, height: float, *, fill: str = "#f3f6fa"
    ) -> None:
        """Draw a rectangle with round corners."""
        self.parts.append(
            f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" rx="6"'
            f' fill="{fill}" stroke="{INK}" stroke-width="1"/>'
        )

    def dot(self, at: Point, *, color: str = ACCENT, radius: float = 3.2) -> None:
        """Draw a small disc."""
        self.parts.append(
            f'<circle cx="{at[0]:.1f}" cy="{at[1]:.1f}" r="{radius:g}" fill="{color}"/>'
        )

    def svg(self) -> str:
        """Return the file's text."""
        return "\n".join([*self.parts, "</svg>"]) + "\n"


def _typeset(text: str) -> str:
    """Set V_O and its like in italics, with the index below the line."""
    term = (
        r'<tspan font-style="italic">\1<tspan dy="3" font-size="75%">\2</tspan></tspan>'
        '<tspan dy="-3">\u200b</tspan>'  # back on the line, by a character of no width
    )
    return re.sub(r"\b([VN])_([ONS])\b", term, text)


def rectangle(x0: float, y0: float, x1: float, y1: float) -> list[Point]:
    """Return the four corners."""
    return [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]


# -- list space ------------------------------------------------------------------------------------

#: Tangent of half V_O's angle, and the view depths of the bounds.
TANGENT, NEAR, FAR = 0.5, 1.0, 3.0
#: For each list from u = -1 on: view depths of front and back, colour, opacity.
LISTS: Sequence[Sequence[tuple[float, float, str, float]]] = (
    ((1.5, 2.1, "blue", 0.35),),
    ((1.25, 1.6, "green", 0.5), (1.6, 2.3, "blue", 0.35)),
    ((1.15, 1.45, "green", 0.6), (1.45, 1.75, "orange", 0.75), (2.2, 2.6, "blue", 0.4)),
    ((1.2, 1.5, "green", 0.5), (1.5, 1.9, "orange", 0.75), (2.1, 2.7, "blue", 0.4)),
    ((1.35, 1.7, "green", 0.5), (1.95, 2.75, "violet", 0.5)),
    ((1.8, 2.5, "violet", 0.35),),
)
#: The list that is marked, and the ray of V_N: X = RAY_0 + RAY_SLOPE Z.
MARKED = 3
RAY_0, RAY_SLOPE = -0.7875, 0.6875


def draw_list_space() -> str:
    """Draw V_O's frustum in the world, and the same lists as boxes in list space."""
    sheet = Drawing(900, 430, "Lists and supersegments in the world and in list space")

    def world(depth: float, x: float) -> Point:
        return 62 + depth * 112, 222 - x * 112

    def listed(depth: float, u: float) -> Point:
        share = (-1 / depth + 1 / NEAR) / (1 / NEAR - 1 / FAR)
        return 540 + share * 300, 222 - u * 140

    count = len(LISTS)
    for i, supersegments in enumerate(LISTS):
        u0, u1 = 2 * i / count - 1, 2 * (i + 1) / count - 1
        for front, back, color, opacity in supersegments:
            corners = [(front, u0), (back, u0), (back, u1), (front, u1)]
            sheet.area(
                [world(z, u * TANGENT * z) for z, u in corners], FILLS[color], opacity=opacity
            )
            sheet.area([listed(z, u) for z, u in corners], FILLS[color], opacity=opacity)
    for i in range(count + 1):
        u = 2 * i / count - 1
        style = INK if i in (MARKED, MARKED + 1) else FAINT
        width = 1.8 if i in (MARKED, MARKED + 1) else 0.8
        sheet.line([world(0, 0), world(FAR, u * TANGENT * FAR)], color=style, width=width)
        sheet.line([listed(NEAR, u), listed(FAR, u)], color=style, width=width)
    for depth in (NEAR, FAR):
        sheet.line(
            [world(depth, -TANGENT * depth), world(depth, TANGENT * depth)], color=FAINT, width=0.8
        )
        sheet.line([listed(depth, -1), listed(depth, 1)], color=FAINT, width=0.8)

    def ray(depth: float) -> float:
        return RAY_0 + RAY_SLOPE * depth

    sheet.line(
        [world(0.5, ray(0.5)), world(FAR + 0.1, ray(FAR + 0.1))], color=ACCENT, width=2, arrow=True
    )
    ends = [listed(z, ray(z) / (TANGENT * z)) for z in (NEAR, FAR)]
    sheet.line(ends, color=ACCENT, width=2, arrow=True)
    for i in range(1, count):
        u = 2 * i / count - 1
        depth = RAY_0 / (TANGENT * u - RAY_SLOPE)
        if NEAR < depth < FAR:
            sheet.dot(world(depth, ray(depth)))
            sheet.dot(listed(depth, u))

    sheet.dot(world(0, 0), color=INK, radius=4)
    sheet.text((8, world(0, 0)[1] - 16), "eye of V_O", anchor="start", size=12)
    sheet.dot(world(0.5, ray(0.5)), radius=4)
    sheet.text(
        (world(0.5, ray(0.5))[0] - 4, world(0.5, ray(0.5))[1] + 20),
        "eye of V_N",
        size=12,
        color=ACCENT,
    )
    sheet.text((225, 30), "World", size=15, weight="bold")
    sheet.text((225, 48), "lists and supersegments are frustums", size=12)
    sheet.text((690, 30), "List space of V_O", size=15, weight="bold")
    sheet.text((690, 48), "they are boxes, and the ray stays straight", size=12)
    mark = (2 * MARKED + 1) / count - 1
    end = world(FAR, mark * TANGENT * FAR)
    sheet.text((end[0] + 8, end[1] + 4), "list of a pixel", anchor="start", size=12)
    end = listed(FAR, mark)
    sheet.text((end[0] + 6, end[1] + 4), "list", anchor="start", size=12)
    sheet.line([(62, 408), (398, 408)], arrow=True)
    sheet.text((230, 424), "view depth Z", size=12)
    sheet.line([(540, 390), (840, 390)], arrow=True)
    sheet.text((690, 408), "depth coordinate −1/Z", size=12)
    sheet.line([(518, 362), (518, 82)], arrow=True)
    sheet.text((512, 76), "u = X / (Z tₓ)", size=12)
    sheet.text((510, 366), "−1", anchor="end", size=11)
    sheet.text((510, 92), "1", anchor="end", size=11)
    return sheet.svg()


# -- one list --------------------------------------------------------------------------------------

#: Depths along the list left before, and along the list entered, as shares of the axis.
BEFORE = ((0.06, 0.20, "blue", 0.4), (0.20, 0.34, "green", 0.5), (0.40, 0.60, "orange", 0.7))
ENTERED = (
    (0.08, 0.22, "blue", 0.35),
    (0.22, 0.37, "green", 0.5),
    (0.37, 0.55, "orange", 0.75),
    (0.55, 0.72, "violet", 0.6),
    (0.82, 0.94, "blue", 0.3),
)
ENTRY, EXIT = 0.60, 0.78


def draw_list() -> str:
    """Draw two lists with a ray that goes from one to the other, and the supersegments of one."""
    sheet = Drawing(900, 500, "A list, its supersegments, and the search for the first one met")
    left, width = 150.0, 640.0

    def at(share: float) -> float:
        return left + share * width

    def lay(
        supersegments: Iterable[tuple[float, float, str, float]], top: float, name: str
    ) -> None:
        for index, (front, back, color, opacity) in enumerate(supersegments):
            corners = rectangle(at(front), top, at(back), top + 46)
            sheet.area(corners, FILLS[color], opacity=opacity)
            sheet.text((at(front) + 10, top + 40), f"{index}", size=12)
        sheet.area(rectangle(at(0), top, at(1), top + 46), "none", edge=FAINT)
        sheet.text((left - 10, top + 28), name, anchor="end")

    sheet.text(
        (450, 28), "The search: on from the index of the list before", size=15, weight="bold"
    )
    lay(BEFORE, 50, "list before")
    lay(ENTERED, 96, "list entered")
    slope = (EXIT - ENTRY) / 46
    start = (at(ENTRY - slope * 46), 50.0)
    sheet.line([start, (at(EXIT), 142)], color=ACCENT, width=2, arrow=True)
    sheet.dot((at(ENTRY), 96))
    sheet.text((at(ENTRY) + 8, 90), "entry", anchor="start", size=12, color=ACCENT)
    sheet.text((at(EXIT) + 4, 156), "exit", anchor="start", size=12, color=ACCENT)

    rows = (
        (
            "1",
            2,
            "guess: the last index of the list before, 2. Its back lies before the entry",
        ),
        (
            "2",
            3,
            "its neighbour, 3. Its back lies behind the entry, its front before the exit: a hit",
        ),
        (
            "3",
            4,
            "after the hit the next index, 4. Its front lies behind the exit: on to the next list",
        ),
    )
    for row, (step, index, meaning) in enumerate(rows):
        y = 184 + 22 * row
        sheet.text((left, y), step, anchor="start", weight="bold")
        sheet.text((left + 20, y), meaning, anchor="start")
        front, back = ENTERED[index][:2]
        sheet.text(((at(front) + at(back)) / 2, 136), f"step {step}", size=12, color=ACCENT)
    sheet.text(
        (left, 250), "After four wrong guesses the rest of the list is halved.", anchor="start"
    )

    sheet.text((450, 296), "A list: faces, colour and opacity", size=15, weight="bold")
    base, high = 440.0, 110.0
    sheet.line([(at(0), base), (at(1) + 22, base)], arrow=True)
    sheet.text((at(1) + 26, base + 5), "Z", anchor="start")
    for front, back, color, opacity in ENTERED:
        corners = rectangle(at(front), base - high * opacity, at(back), base)
        sheet.area(corners, FILLS[color], opacity=0.75)
        label = f"α {opacity:g}"
        sheet.text(((at(front) + at(back)) / 2, base - high * opacity - 6), label, size=12)
    for share, name, shift in ((0.37, "front", -4), (0.55, "back", 4)):
        sheet.line([(at(share), base), (at(share), base + 12)], color=ACCENT, width=1.6)
        anchor = "end" if shift < 0 else "start"
        sheet.text(
            (at(share) + shift, base + 22), f"{name} of 2", anchor=anchor, size=12, color=ACCENT
        )
    sheet.line([(at(0.72), base + 8), (at(0.82), base + 8)], color=FAINT)
    sheet.text((at(0.77), base + 24), "gap", size=12)
    sheet.text((left - 10, base - 60), "opacity", anchor="end")
    sheet.text((left - 10, base - 42), "1 − exp(−τ)", anchor="end", size=12)
    sheet.text(
        (450, 486),
        "A supersegment has one colour and one extinction, σ = τ / L. Gaps are stored nowhere.",
        size=12,
    )
    return sheet.svg()


# -- the data's way --------------------------------------------------------------------------------

#: Title, lines and room of each stage.
Stages = Sequence[tuple[str, Sequence[str], str]]

MONO = "DejaVu Sans Mono, Menlo, monospace"


def draw_data_way() -> str:
    """Draw the way from volume to picture, with the rooms of the package."""
    sheet = Drawing(940, 520, "The way of the data from volume to picture")

    def stage(x: float, y: float, wide: float, title: str, lines: Sequence[str], room: str) -> None:
        sheet.box(x, y, wide, 106)
        sheet.text((x + wide / 2, y + 22), title, size=14, weight="bold")
        for row, line in enumerate(lines):
            sheet.text((x + wide / 2, y + 43 + 17 * row), line, size=11.5)
        sheet.text((x + wide / 2, y + 97), room, size=11.5, color=ACCENT, family=MONO)

    sheet.text((24, 30), "Making a VDI, once", anchor="start", size=15, weight="bold")
    top, wide, step = 44.0, 152.0, 185.0
    making: Stages = (
        (
            "volume",
            ("scalars, classified", "by the transfer function", "(bricks, light)"),
            "volume/",
        ),
        ("march", ("a ray for each pixel", "of V_O; steps are", "recorded as runs"), "generation/"),
        ("merge", ("neighbouring runs,", "by least error, down", "to N_S of them"), "generation/"),
        (
            "pack",
            ("lists one behind", "the other; the offsets", "are their running sum"),
            "generation/",
        ),
        ("VDI", ("offsets, front, back,", "colour, optical depth;", "files: io/"), "model/"),
    )
    for index, (title, lines, room) in enumerate(making):
        x = 24 + index * step
        stage(x, top, wide, title, lines, room)
        if index:
            sheet.line([(x - step + wide, top + 53), (x - 2, top + 53)], width=1.6, arrow=True)

    sheet.text((24, 204), "Drawing it, in every frame", anchor="start", size=15, weight="bold")
    top = 218.0
    drawing: Stages = (
        ("picture", ("premultiplied RGBA,", "float32, top row first"), "model/"),
        (
            "strategy",
            ("aligned view, blocks,", "packets, rays one by", "one, or a preview"),
            "raycasting/",
        ),
        (
            "ray in list space",
            ("V_N's rays in V_O's", "coordinates, where", "lists are boxes"),
            "device/",
        ),
        (
            "upload",
            ("layout for rays and", "the occupancy grid;", "once per device"),
            "raycasting/",
        ),
    )
    for index, (title, lines, room) in enumerate(drawing):
        x = 24 + index * step
        stage(x, top, wide, title, lines, room)
        if index:
            sheet.line([(x - 2, top + 53), (x - step + wide + 2, top + 53)], width=1.6, arrow=True)
    corner = 24 + 4 * step + wide / 2
    sheet.line(
        [(corner, 152), (corner, top + 53), (24 + 3 * step + wide + 2, top + 53)],
        width=1.6,
        arrow=True,
    )
    sheet.text((corner - 8, 186), "or several,", anchor="end", size=11.5)
    sheet.text((corner - 8, 202), "merged by depth", anchor="end", size=11.5)

    sheet.text((24, 364), "Around it", anchor="start", size=15, weight="bold")
    around = (
        (
            "vtk_pipeline/ plotting/ paraview/ cli/",
            "hand in volume, view and options, and show the picture",
        ),
        (
            "quality/",
            "chooses settings and pixels, estimates errors, makes new VDIs behind the frames",
        ),
        ("reference/", "the same in float64: it defines the correct VDI and the correct picture"),
        ("measure/", "compares with VTK, measures the paper's tables and the tradeoffs"),
        (
            "device/",
            "the OpenCL runtime under all of it: memory, programs, order of work, forms of rays",
        ),
    )
    for row, (rooms, meaning) in enumerate(around):
        y = 390 + 24 * row
        sheet.text((24, y), rooms, anchor="start", size=11.5, color=ACCENT, family=MONO)
        sheet.text((330, y), meaning, anchor="start", size=12)
    return sheet.svg()


def draw() -> dict[str, str]:
    """Return the text of each diagram by its file's name."""
    return {
        "list_space.svg": draw_list_space(),
        "list.svg": draw_list(),
        "data_way.svg": draw_data_way(),
    }


if __name__ == "__main__":
    for name, text in draw().items():
        (TARGET / name).write_text(text, encoding="utf-8", newline="\n")
