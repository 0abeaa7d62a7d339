"""What the tests of this room share."""

from browsers import chromium, open_page

__all__ = ["chromium", "open_page"]
