"""Write ``docs/drop_in.md`` of the cases of all kinds: ``python tests/drop_in/make_page.py``."""

import importlib
import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
if __name__ == "__main__":
    sys.path[:0] = [str(TESTS), str(TESTS / "support")]

from drop_in.stage import LARGEST_BLOCK, LEAST_SSIM, PAGE  # noqa: E402

NAMES = ("arguments", "data", "neighbours", "views", "changes")

HEAD = """# In place of add_volume

<!-- made by tests/drop_in/make_page.py -->

Each of {count} cases is a short script, drawn once with `add_volume` (VTK's mapper at steps of
half a voxel) and once with `add_vdi`. It **works** if the pictures' SSIM is at least {least} and no
block of 8 x 8 pixels differs by more than {block:g} of 255; where `add_volume` is wrong, the
picture is compared with one that is right, which the case names. What a VDI cannot do is
**refused** by an error or a warning that names it. The scripts are `tests/drop_in/`; all run every
night, {quick} of them with every change.

| kind | cases | work | refused | `add_volume` refuses, too |
|---|---|---|---|---|
"""


def kinds():
    """Return the kinds of cases by the names of their modules."""
    return {name: importlib.import_module(f"drop_in.test_{name}").kind for name in NAMES}


def page():
    """Return the page."""
    every = kinds().values()
    cases = [case for kind in every for case in kind.cases]
    quick = sum(case.quick for case in cases)
    out = [HEAD.format(count=len(cases), least=LEAST_SSIM, block=LARGEST_BLOCK, quick=quick)]
    for title, of in [*((k.title, k.cases) for k in every), ("**all**", cases)]:
        refused, both = sum(bool(c.refused) for c in of), sum(c.both_refuse for c in of)
        out.append(f"| {title} | {len(of)} | {len(of) - refused - both} | {refused} | {both} |\n")
    out.append("\n## Refused, and why\n\n| case | reason |\n|---|---|\n")
    out += [f"| {_cell(c.name)} | {c.refused[1]} |\n" for c in cases if c.refused]
    out.append(
        "\n## Right where add_volume is not\n\n| case | `add_volume`; compared with |\n|---|---|\n"
    )
    out += [f"| {_cell(c.name)} | {c.note} |\n" for c in cases if c.note and not c.refused]
    out.append("\n## All cases\n")
    for kind in every:
        names = "; ".join(_cell(c.name) for c in kind.cases)
        out.append(f"\n**{kind.title}**: {names}.\n")
    return "".join(out)


def _cell(text):
    return "`" + text + "`" if "=" in text or "_" in text else text


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
