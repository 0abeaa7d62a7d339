"""``docs/drop_in.md`` is what the cases make of it."""

import pytest
from drop_in.make_page import kinds, page
from drop_in.stage import PAGE, least_ssims

pytestmark = pytest.mark.skipif(not PAGE.is_file(), reason="needs the pages of a checkout")


def test_the_page_is_up_to_date():
    assert PAGE.read_text(encoding="utf-8") == page(least_ssims()), (
        "run python tests/drop_in/make_page.py"
    )


def test_there_are_enough_cases():
    cases = [case for kind in kinds().values() for case in kind.cases]
    assert len(cases) >= 300
    assert sum(case.quick for case in cases) >= 30
    assert not [case.name for case in cases if case.quick and case.defect]
