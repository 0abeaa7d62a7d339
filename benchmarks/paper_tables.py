"""The paper's tables, measured: ``pyvista-vdi benchmark``, with its results in ``results/``.

All options are the verb's: ``python benchmarks/paper_tables.py --profile full --resume``.
"""

from __future__ import annotations

import sys
from pathlib import Path

from pyvista_vdi.cli import main

RESULTS = Path(__file__).parent / "results" / "paper_tables.json"

if __name__ == "__main__":
    sys.exit(main(["benchmark", "--out", str(RESULTS), *sys.argv[1:]]))
