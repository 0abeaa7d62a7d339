"""Hold folders to their ceilings of lines, and pages to theirs of words (``size.toml``).

It fails where a ceiling is exceeded, or where a file of code belongs to no row; ``--lower`` writes
what stands in place of every ceiling that is higher. A line counts as its length over 100, rounded
up, an empty one as 1. Beside them stand statements: Python's own, and semicolons elsewhere.
"""

# ruff: noqa: T201
from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
TABLE = Path(__file__).with_name("size.toml")
CODE = (".py", ".cl", ".js", ".pyi", ".ts", ".xml", ".sh")

#: A row: patterns of paths and their ceiling. ``*`` stays in its folder, ``**`` does not.
ROW = re.compile(r'^"([^"]+)" = (\d+)', re.MULTILINE)


def names() -> list[str]:
    """Return the files that git tracks or would; in a copy without git, all but what is built."""
    if (ROOT / ".git").exists():
        command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
        told = subprocess.check_output(command, cwd=ROOT, text=True)
        return [name for name in told.splitlines() if (ROOT / name).is_file()]
    built = re.compile(r"(^|/)(_?build|node_modules|__pycache__|\.nox|[^/]*\.egg-info)/")
    found = (path.relative_to(ROOT).as_posix() for path in ROOT.rglob("*") if path.is_file())
    return [name for name in found if not built.search(name)]


def row_of(name: str, rows: list[str]) -> str | None:
    """Return the row with the longest pattern that leads to a file."""
    found = {0: None}
    for pattern, row in ((pattern, each) for each in rows for pattern in each.split()):
        if re.fullmatch(re.escape(pattern).replace(r"\*\*", ".*").replace(r"\*", "[^/]*"), name):
            found[len(pattern)] = row
    return found[max(found)]


def statements(name: str, text: str) -> int:
    """Return how many statements a source has."""
    if not name.endswith((".py", ".pyi")):
        return text.count(";")
    return sum(isinstance(node, ast.stmt) for node in ast.walk(ast.parse(text)))


def main() -> int:
    """Run the check; return its exit status."""
    table = TABLE.read_text(encoding="utf-8")
    ceilings = {row: int(most) for row, most in ROW.findall(table)}
    of_pages = [row for row in ceilings if ".md" in row]
    of_code = [row for row in ceilings if ".md" not in row]
    sizes, done, wrong = dict.fromkeys(ceilings, 0), dict.fromkeys(ceilings, 0), []
    for name in names():
        text = (ROOT / name).read_bytes().decode(errors="replace")
        script = "." not in Path(name).name and text.startswith("#!")
        if name.endswith(".md") and (row := row_of(name, of_pages)):
            sizes[row] += len(text.split())
        elif (name.endswith(CODE) or script) and (row := row_of(name, of_code)):
            sizes[row] += sum(max(1, -(-len(line) // 100)) for line in text.splitlines())
            done[row] += statements(name, text)
        elif name.endswith(CODE) or script:
            wrong.append(f"{name} belongs to no row of tools/size.toml")
    for row, most in ceilings.items():
        print(f"{sizes[row]:7} of {most:6}, {done[row] or '-':>6} statements  {row}")
        wrong += [f"{row}: {sizes[row]} is more than {most}"] if sizes[row] > most else []
    print(f"{sum(sizes[row] for row in of_code):7} lines", *wrong, sep="\n")
    if "--lower" in sys.argv[1:]:
        lower = ROW.sub(lambda m: f'"{m[1]}" = {min(int(m[2]), sizes[m[1]])}', table)
        TABLE.write_text(lower, encoding="utf-8")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
