"""``docs/drop_in.md`` is what the cases make of it."""

import pytest
from drop_in.make_page import page
from drop_in.stage import PAGE


@pytest.mark.skipif(not PAGE.is_file(), reason="needs the pages of a checkout")
def test_the_page_is_up_to_date():
    assert PAGE.read_text(encoding="utf-8") == page(), "run python tests/drop_in/make_page.py"
