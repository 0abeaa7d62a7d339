"""Run the quick cases in windows on the screen that DISPLAY names, and print what is wrong."""

import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS), str(TESTS / "support")]

from drop_in.make_page import kinds  # noqa: E402
from drop_in.stage import outcome  # noqa: E402

if __name__ == "__main__":
    count = 0
    for kind in kinds().values():
        for case in kind.cases:
            if case.quick:
                wrong = outcome(case, off_screen=False).wrong
                count += 1
                if wrong:
                    print(f"{case.name}: {wrong}", flush=True)
    print(f"{count} cases", flush=True)
