"""Write ``docs/drop_in.md``: draws the cases of all kinds, or of those that are named.

``python tests/drop_in/make_page.py [arguments data ... | on-screen]``
"""

import importlib
import json
import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
if __name__ == "__main__":
    sys.path[:0] = [str(TESTS), str(TESTS / "support")]

from drop_in.stage import LARGEST_BLOCK, LEAST_SSIM, PAGE, least_ssims, outcome  # noqa: E402

NAMES = ("arguments", "data", "neighbours", "views", "changes")

HEAD = """# In place of add_volume

<!-- made by tests/drop_in/make_page.py -->

Each case below is a short script, drawn once with `add_volume` (VTK's mapper at steps of half a
voxel) and once with `add_vdi`. It **works** if the pictures' SSIM is at least {least} and no block
of 8 x 8 pixels differs by more than {block:g} of 255; where `add_volume` is wrong, the picture is
compared with one that is right, which the case names. What a VDI cannot do is **refused** by an
error or a warning that names it. The scripts are `tests/drop_in/`; all run every night, {quick} of
them with every change, and these every night in windows on a (virtual) screen, too.

| kind | cases | work | refused | `add_volume` refuses, too | open | least SSIM |
|---|---|---|---|---|---|---|
"""


def kinds():
    """Return the kinds of cases by the names of their modules."""
    return {name: importlib.import_module(f"drop_in.test_{name}").kind for name in NAMES}


def works(case):
    """Whether a case shows a picture."""
    return not (case.refused or case.both_refuse or case.defect)


def page(least):
    """Return the page, with the least SSIM of each kind by its title."""
    every = kinds().values()
    cases = [case for kind in every for case in kind.cases]
    quick = sum(case.quick for case in cases)
    out = [HEAD.format(least=LEAST_SSIM, block=LARGEST_BLOCK, quick=quick)]
    for title, of in [*((k.title, k.cases) for k in every), ("**all**", cases)]:
        ssim = least[title] if title in least else min(least.values())
        counts = [
            len(of),
            sum(map(works, of)),
            sum(bool(c.refused and not c.defect) for c in of),
            sum(c.both_refuse and not c.defect for c in of),
            sum(bool(c.defect) for c in of),
        ]
        out.append(f"| {title} | {' | '.join(map(str, counts))} | {ssim:.3f} |\n")
    out.append("\n## Refused, and why\n\n| case | reason |\n|---|---|\n")
    out += [f"| {_cell(c.name)} | {c.refused[1]} |\n" for c in cases if c.refused]
    out.append(
        "\n## Right where add_volume is not\n\n| case | `add_volume`; compared with |\n|---|---|\n"
    )
    out += [f"| {_cell(c.name)} | {c.note} |\n" for c in cases if c.note and works(c)]
    if any(c.defect for c in cases):
        out.append("\n## Open\n\n| case | what is known |\n|---|---|\n")
        out += [f"| {_cell(c.name)} | {c.defect} |\n" for c in cases if c.defect]
    out.append("\n## All cases\n")
    for kind in every:
        names = "; ".join(_cell(c.name) for c in kind.cases)
        out.append(f"\n**{kind.title}**: {names}.\n")
    return "".join(out)


def _cell(text):
    return "`" + text + "`" if "=" in text or "_" in text else text


def differences_on_screen():
    """Draw the quick cases in windows on the screen that DISPLAY names; return what is wrong."""
    quick = [case for kind in kinds().values() for case in kind.cases if case.quick]
    found = {case.name: outcome(case, off_screen=False).wrong for case in quick}
    return {"cases": len(found), "wrong": {name: wrong for name, wrong in found.items() if wrong}}


def main():
    """Draw, and write the page; or print what is wrong on a screen."""
    if "on-screen" in sys.argv:
        print(json.dumps(differences_on_screen()))
        return
    chosen = [each for each in sys.argv[1:] if each in NAMES]
    least = least_ssims() if PAGE.is_file() else {}
    for name, kind in kinds().items():
        if name not in (chosen or NAMES):
            continue
        figures = []
        for case in kind.cases:
            found = outcome(case)
            if bool(found.wrong) != bool(case.defect):
                print(f"{name}: {case.name}: {found.wrong or 'open, but it works'}", flush=True)
            if not found.wrong and found.ssim is not None:
                figures.append(found.ssim)
        least[kind.title] = min(figures)
    PAGE.write_text(page(least), encoding="utf-8")


if __name__ == "__main__":
    main()
