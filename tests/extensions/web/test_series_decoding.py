"""The viewer reads ``.vdis`` files: every step as Python has it, and damaged ones by a sentence."""

import base64

import numpy as np
import pytest
from browsers import assert_decoded, in_base64
from stepped_vdis import stepped_vdi
from stored_frames import frames_of

import pyvista_vdi as pvdi
from pyvista_vdi.errors import VDIFileError
from pyvista_vdi.extensions.series.reader import StepsReader
from pyvista_vdi.extensions.series.series import VDISeries

SCRIPT = """
import { beginsAsSeries, findFrames, headOf, indexPlace, indexedFrames } from "./frames.js";
import { StepDecoder } from "./steps.js";
import { unzstd } from "./zstd.js";
window.stepsOf = async (bytes, order) => {
  const { begin, codec } = headOf(bytes);
  const place = indexPlace(bytes.subarray(-16), bytes.length);
  const indexed = place < 0 ? null : indexedFrames(bytes.subarray(place), begin, place);
  const found = [];
  findFrames(bytes, found, begin, true);
  const frames = indexed ?? found;
  const decoder = new StepDecoder(), steps = [];
  for (const i of order ?? frames.keys()) {
    const chain = [];
    for (let frame = frames[i]; frame; frame = frames.find(({ number }) => number === frame.by)) {
      const { place, size } = frame;
      chain.push({ ...frame, content: bytes.subarray(place, place + size), needed: true });
    }
    steps.push(await told(decoder.decode(codec, chain)));
  }
  return { steps, closed: indexed !== null, times: frames.map(({ time }) => time),
    same: !indexed || JSON.stringify(indexed) === JSON.stringify(found) };
};
Object.assign(window, { beginsAsSeries, unzstd });
"""


@pytest.fixture
def page(open_page):
    return open_page(script=SCRIPT)


def steps_of(page, data, order=None):
    text = in_base64(bytes(data))
    return page.evaluate("([text, order]) => stepsOf(bytesOf(text), order)", [text, order])


def assert_the_same(got, vdi):
    assert_decoded(got, vdi)
    assert (got["metadata"], got["level"]) == (vdi.metadata, "full")


def mixed_series():
    """Steps that are seen by other cameras, through other windows, and steps without lists."""
    near, far = (stepped_vdi(step=k) for k in (0, 5))
    empty = pvdi.VDI(
        near.camera, near.window_size, np.zeros(len(near.offsets), int), [], [],
        np.empty((0, 3)), [], near.bounds, metadata=near.metadata,
    )  # fmt: skip
    small = stepped_vdi(size=(7, 5), metadata={"a": [1.5, None, "é"]})
    moved = stepped_vdi(step=1)
    moved.metadata = {**moved.metadata, "field": "b"}
    return [near, near, moved, moved, empty, empty, far, small, small, stepped_vdi(seed=3)]


def steps(number, *, every=1, **how):
    return [stepped_vdi(step=k // every, **how) for k in range(number)]


SERIES = {
    "a dozen steps": (steps(12, every=2), {}),
    "lz4": (steps(5), {"compression": "lz4"}),
    "deflate": (steps(5), {"compression": "deflate"}),
    "none": (steps(5), {"compression": "none"}),
    "a tolerance": (steps(5), {"tolerance": 0.02}),
    "without samples": (steps(6, metadata={}), {}),
    "other colours": (steps(4, metadata={}, palette=False), {"tolerance": 0.01}),
    "whole files": (steps(4, every=2), {"precision": "exact"}),
    "what changes between steps": (mixed_series(), {}),
}


@pytest.mark.every(3)
@pytest.mark.parametrize("name", SERIES)
def test_steps_are_python_s(name, page, tmp_path):
    vdis, options = SERIES[name]
    path = tmp_path / "a.vdis"
    times = np.arange(len(vdis)) * 0.25
    VDISeries.of(vdis, times).save(path, **{"precision": "8-byte", **options})
    order = np.random.default_rng(1).permutation(len(vdis)).tolist()
    got = steps_of(page, path.read_bytes(), order)
    series = pvdi.read(path)
    assert (got["times"], got["closed"], got["same"]) == (list(series.times), True, True)
    for step, i in zip(got["steps"], order, strict=True):
        assert_the_same(step, series[i])


def test_the_series_above_have_all_kinds_of_steps(tmp_path):
    kinds, path = set(), tmp_path / "a.vdis"
    for name in ("a dozen steps", "whole files"):
        vdis, options = SERIES[name]
        VDISeries.of(vdis).save(path, **{"precision": "8-byte", **options})
        kinds |= {(header.kind, header.by < 0) for _, header in frames_of(path.read_bytes())}
    assert kinds == {(0, True), (1, True), (1, False), (2, False)}


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    path = tmp_path_factory.mktemp("series") / "a.vdis"
    return VDISeries.of(steps(5, size=(9, 6))).save(path)


def test_a_file_that_is_cut_off_has_its_finished_steps(saved, page):
    data, reader = saved.read_bytes(), StepsReader(saved)
    ends = [place + header.n_bytes for place, header in frames_of(data)]
    for cut in (ends[0], ends[2] - 1, ends[2] + 7, ends[-1], len(data) - 1):
        got = steps_of(page, data[:cut])
        assert not got["closed"]
        assert len(got["steps"]) == sum(end <= cut for end in ends)
        for step, vdi in zip(got["steps"], reader, strict=False):
            assert_the_same(step, vdi)


def test_changed_bytes_are_refused_where_python_refuses_them(saved, page, tmp_path):
    """Every byte matters that a step is made of; what else is changed is noticed by both."""
    data, path = saved.read_bytes(), tmp_path / "changed.vdis"
    whole = list(pvdi.read(saved))
    refused = 0
    for k in np.random.default_rng(2).integers(0, len(data), 12).tolist():
        changed = bytearray(data)
        changed[k] ^= 0x41
        path.write_bytes(changed)
        try:
            reader = StepsReader(path)
        except VDIFileError:
            with pytest.raises(Exception, match="VDIFileError"):
                steps_of(page, changed)
            refused += 1
            continue
        got = steps_of(page, changed)
        assert got["times"] == list(reader.times), k
        for i, step in enumerate(got["steps"]):
            try:
                reader[i]
            except VDIFileError:
                said = f"VDIFileError: step {i} of the series is damaged: "
                assert step.startswith(said), (k, step)
                refused += 1
            else:
                assert_the_same(step, whole[i])
    assert refused > 5


def test_a_frame_whose_header_is_damaged_is_stepped_over(saved, page):
    data = bytearray(saved.read_bytes()[:-10])  # no index
    place, _ = frames_of(data)[1]
    data[place - 31] ^= 1
    got = steps_of(page, data)
    assert got["times"] == [0, 2, 3, 4]
    assert [isinstance(step, dict) for step in got["steps"]].count(True) >= 1


def test_what_a_series_begins_with(saved, page):
    data = saved.read_bytes()
    text = in_base64(data)
    assert page.evaluate("(text) => beginsAsSeries(text)", "\n " + text[:40])
    assert page.evaluate("(text) => beginsAsSeries(bytesOf(text))", text[:4])
    assert not page.evaluate("beginsAsSeries('UEsDBA==') || beginsAsSeries(new Uint8Array())")
    for content, why in (
        (data[:8] + b"\x09" + data[9:], "format version 9"),
        (b"PK\3\4" + data, "no series"),
    ):
        with pytest.raises(Exception, match=why):
            steps_of(page, content)


def test_zstd_decodes_what_compressors_write_and_refuses_the_rest(page):
    """Frames of three levels: raw and repeated blocks, Huffman's streams, repeated offsets."""
    from numcodecs import zstd

    rng = np.random.default_rng(4)
    contents = [
        b"", b"x", bytes(400_000), rng.bytes(150_000), np.arange(60_000, dtype="<u4").tobytes(),
        rng.geometric(0.2, 200_000).astype("u1").tobytes(),
        rng.geometric(0.3, 900).astype("u1").tobytes(),
        b"abcdefgh" * 9 + rng.integers(0, 3, 5000).astype("u1").tobytes() + SCRIPT.encode() * 9,
    ]  # fmt: skip
    cases = [(content, level) for content in contents for level in (1, 9)]
    answers = page.evaluate(
        """(frames) => frames.map(([text, length]) => {
          const out = new Uint8Array(length), bytes = bytesOf(text), cut = new Uint8Array(length);
          const good = unzstd(bytes, out);
          const longer = new Uint8Array(length + 1);
          const refused = !unzstd(bytes.subarray(0, -1), cut) && !unzstd(bytes, longer);
          for (let k = 1; k < 40; ++k) { // whatever becomes of them, nothing is thrown
            const changed = bytes.slice();
            changed[(k * 7919) % bytes.length] ^= 1 << (k & 7);
            unzstd(changed, cut);
          }
          return [good, refused, textOf(out)];
        })""",
        [[in_base64(zstd.compress(content, level)), len(content)] for content, level in cases],
    )
    for (good, refused, text), (content, _) in zip(answers, cases, strict=True):
        assert good
        assert refused
        assert base64.b64decode(text) == content
