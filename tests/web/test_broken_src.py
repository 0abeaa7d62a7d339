"""Broken files behind ``src``: the element says a sentence, and shows the next one."""

from __future__ import annotations

import re
import zipfile

import numpy as np
import pytest
from rewriting import described
from strategies import random_vdi

#: Show one file after the other in the same element: what it says, or what is then seen.
SHOW = """async (names) => {
  const said = [];
  for (const name of names) {
    let heard = null;
    const hear = ({ detail }) => { heard = detail.message; };
    viewer.addEventListener("error", hear);
    viewer.setAttribute("src", name);
    const outcome = await Promise.race([
      viewer.ready.then(() => "shown", (error) => error.message),
      new Promise((resolve) => setTimeout(resolve, 60_000, "nothing within a minute")),
    ]);
    viewer.removeEventListener("error", hear);
    if (outcome === "shown") {
      const { data } = await viewer.screenshot({ width: 64, height: 36 });
      said.push({ shown: textOf(new Uint8Array(data.buffer)), level: viewer.status.level, heard });
    } else {
      said.push({ outcome, heard, state: viewer.status.state,
        alert: viewer.shadowRoot.querySelector("p").textContent });
    }
  }
  return said;
}"""


def broken(data, number):
    """Files that were cut, and files in which a byte is another, evenly over all of one."""
    rng = np.random.default_rng(number)
    for k in range(number):
        yield data[: k * len(data) // number]
        changed = bytearray(data)
        # Near the beginning as often as anywhere: there are the headers
        at = int(len(data) * rng.random() ** (3 if k % 2 else 1))
        changed[at] ^= 1 << int(rng.integers(8))
        yield bytes(changed)


def test_what_is_no_address_is_a_sentence(open_page):
    page = open_page((64, 36), attributes='src="http://["')
    page.wait_for("viewer.status.state === 'error'")
    assert "http://[ cannot be read" in page.evaluate("viewer.status.message")


def hostile(data):
    """Headers that promise too much, or nothing that can be."""
    for change in (
        {"n_supersegments": 10**9},
        {"n_supersegments": -1},
        {"window_size": [65536, 65536]},
        {"camera": None},
        {"bounds": [1, 0, 0, 1, 0, 1]},
        {"version": 99},
        {"arrays": {}},
    ):
        yield described(data, **change)


@pytest.mark.parametrize("number", [8, pytest.param(150, marks=pytest.mark.slow)])
def test_broken_files_are_a_sentence_and_nothing_else(number, open_page, tmp_path):
    vdi = random_vdi(np.random.default_rng(3), max_window=(12, 9))
    good = vdi.save(tmp_path / "a.vdi", compression="deflate", precision="8-byte").read_bytes()
    members = zipfile.ZipFile(tmp_path / "a.vdi").start_dir
    bad = [*broken(good, number), *hostile(good), b"", b"<!doctype html>"]
    names = [f"{k}.vdi" for k in range(len(bad))]
    files = {"good.vdi": good, **dict(zip(names, bad, strict=True))}
    page = open_page((64, 36), files=files, attributes='src="good.vdi"')
    page.evaluate("viewer.ready.then(() => true)")
    whole, *said, again = page.evaluate(SHOW, ["good.vdi", *names, "good.vdi"])
    assert whole["level"] == "full"
    assert again == whole  # whatever came between
    refused = 0
    for content, answer in zip(bad, said, strict=True):
        if "shown" in answer:
            # A byte that no array depends on, or nothing but the directory behind all members
            assert len(content) >= members
            assert answer == whole
            continue
        refused += 1
        assert answer["state"] == "error"
        assert answer["outcome"] == answer["heard"] == answer["alert"]
        assert re.search(r"VDI", answer["heard"]), answer
        assert not re.search(r"undefined|NaN|is not a function", answer["heard"]), answer
    assert refused > len(bad) / 2
