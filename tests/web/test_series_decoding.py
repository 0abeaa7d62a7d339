"""The viewer reads ``.vdis`` files: every step as Python has it, and damaged ones by a sentence."""

from __future__ import annotations

import base64
import json

import numpy as np
import pytest
from browsers import PAGE, SITE, Page
from stepped_vdis import stepped_vdi

import pyvista_vdi as pvdi
from pyvista_vdi.errors import VDIFileError
from pyvista_vdi.series.reader import StepsReader
from pyvista_vdi.series.series import VDISeries

#: Decodes steps of a file in the page: their arrays as base64, or sentences.
SCRIPT = """
import { beginsAsSeries, findFrames, headOf, indexPlace, indexedFrames } from "./frames.js";
import { StepDecoder } from "./steps.js";
import { unzstd } from "./zstd.js";
const raw = (array) => textOf(new Uint8Array(array.buffer, array.byteOffset, array.byteLength));
const framesOf = (bytes, begin) => {
  const place = indexPlace(bytes.subarray(-16), bytes.length);
  const indexed = place < 0 ? null : indexedFrames(bytes.subarray(place), begin, place);
  const found = [];
  findFrames(bytes, found, begin, true);
  return { indexed, found };
};
window.stepsOf = async (bytes, order) => {
  const { begin, codec } = headOf(bytes);
  const { indexed, found } = framesOf(bytes, begin);
  const frames = indexed ?? found;
  const decoder = new StepDecoder(), steps = [];
  for (const i of order ?? frames.keys()) {
    const chain = [];
    for (let frame = frames[i]; frame; frame = frames.find(({ number }) => number === frame.by)) {
      const { place, size } = frame;
      chain.push({ ...frame, content: bytes.subarray(place, place + size), needed: true });
    }
    try {
      steps.push(Object.fromEntries(Object.entries(await decoder.decode(codec, chain)).map(
        ([name, value]) => [name, ArrayBuffer.isView(value) ? raw(value) : value])));
    } catch (error) {
      steps.push(`${error.name}: ${error.message}`);
    }
  }
  return { steps, kinds: frames.map(({ kind }) => kind), closed: indexed !== null,
    times: frames.map(({ time }) => time),
    same: !indexed || JSON.stringify(indexed) === JSON.stringify(found) };
};
Object.assign(window, { beginsAsSeries, unzstd });
"""

EIGHT_BYTES = {
    "words": lambda vdi: vdi.packing.words,
    "origin": lambda vdi: vdi.packing.origins,
    "stride": lambda vdi: vdi.packing.strides,
}
EXACT = {
    "front": lambda vdi: vdi.front,
    "back": lambda vdi: vdi.back,
    "color": lambda vdi: vdi.color,
    "opticalDepth": lambda vdi: vdi.optical_depth,
}


@pytest.fixture(scope="module")
def page(chromium):
    """One page for all tests: it keeps nothing of a file."""
    context = chromium.new_context()
    content = PAGE.format(attributes="", script=SCRIPT, width=160, height=90)
    page = Page(context.new_page(), {"page.html": content}, None)
    page.page.goto(SITE + "page.html")
    page.wait_for("window.begun")
    yield page
    context.close()
    assert not page.complaints


def steps_of(page, data, order=None):
    text = base64.b64encode(data).decode()
    return page.evaluate("([text, order]) => stepsOf(bytesOf(text), order)", [text, order])


def assert_the_same(got, vdi):
    assert isinstance(got, dict), got
    assert tuple(got["windowSize"]) == vdi.window_size
    assert got["camera"] == json.loads(json.dumps(vdi.camera.to_dict()))
    assert (got["depthOrigin"], tuple(got["bounds"])) == (vdi.depth_origin, vdi.bounds)
    assert (got["metadata"], got["level"]) == (vdi.metadata, "full")
    eight = vdi.precision == "8-byte"
    if eight:
        assert (got["precision"], got["depthStep"]) == ("8-byte", vdi.packing.step)
    wanted = {name: of(vdi) for name, of in (EIGHT_BYTES if eight else EXACT).items()}
    wanted["offsets"] = vdi.offsets.astype("<u4")
    for name, array in wanted.items():
        found = np.frombuffer(base64.b64decode(got[name]), array.dtype)
        np.testing.assert_array_equal(found, array.reshape(-1), err_msg=name)


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


SERIES = {
    "a dozen steps": ([stepped_vdi(step=k // 2) for k in range(12)], {}),
    "lz4": ([stepped_vdi(step=k) for k in range(5)], {"compression": "lz4"}),
    "deflate": ([stepped_vdi(step=k) for k in range(5)], {"compression": "deflate"}),
    "none": ([stepped_vdi(step=k) for k in range(5)], {"compression": "none"}),
    "a tolerance": ([stepped_vdi(step=k) for k in range(5)], {"tolerance": 0.02}),
    "without samples": ([stepped_vdi(step=k, metadata={}) for k in range(6)], {}),
    "other colours": (
        [stepped_vdi(step=k, metadata={}, palette=False) for k in range(4)],
        {"tolerance": 0.01},
    ),
    "whole files": ([stepped_vdi(step=k // 2) for k in range(4)], {"precision": "exact"}),
    "16 bytes": ([stepped_vdi(step=k // 2) for k in range(3)], {"precision": "16-byte"}),
    "what changes between steps": (mixed_series(), {}),
}


@pytest.mark.every(3)
@pytest.mark.parametrize("name", SERIES)
def test_steps_are_python_s(name, page, tmp_path):
    vdis, options = SERIES[name]
    options = {"precision": "8-byte"} | options
    path = tmp_path / "a.vdis"
    VDISeries.of(vdis, np.arange(len(vdis)) * 0.25).save(path, **options)
    order = np.random.default_rng(1).permutation(len(vdis)).tolist()
    got = steps_of(page, path.read_bytes(), order)
    series = pvdi.read(path)
    assert (got["times"], got["closed"], got["same"]) == (list(series.times), True, True)
    for step, i in zip(got["steps"], order, strict=True):
        assert_the_same(step, series[i])


def test_the_series_above_have_all_kinds_of_steps(tmp_path):
    kinds = set()
    for name in ("a dozen steps", "whole files"):
        vdis, options = SERIES[name]
        path = tmp_path / f"{len(vdis)}.vdis"
        VDISeries.of(vdis).save(path, **{"precision": "8-byte"} | options)
        kinds |= {(header.kind, header.by < 0) for _, header in StepsReader(path)._frames}
    assert kinds == {(0, True), (1, True), (1, False), (2, False)}


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    path = tmp_path_factory.mktemp("series") / "a.vdis"
    VDISeries.of([stepped_vdi(step=k, size=(9, 6)) for k in range(5)]).save(path)
    return path


def test_a_file_that_is_cut_off_has_its_finished_steps(saved, page, tmp_path):
    data = saved.read_bytes()
    reader = StepsReader(saved)
    ends = [place + 40 + header.n_bytes for place, header in reader._frames]
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
                steps_of(page, bytes(changed))
            refused += 1
            continue
        got = steps_of(page, bytes(changed))
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
    (place, _), *_ = StepsReader(saved)._frames[1:]
    data[place + 9] ^= 1
    got = steps_of(page, bytes(data))
    assert got["times"] == [0, 2, 3, 4]
    assert [isinstance(step, dict) for step in got["steps"]].count(True) >= 1


def test_what_a_series_begins_with(saved, page):
    data = saved.read_bytes()
    text = base64.b64encode(data).decode()
    assert page.evaluate("(text) => beginsAsSeries(text)", "\n " + text[:40])
    assert page.evaluate("(text) => beginsAsSeries(bytesOf(text))", text[:4])
    assert not page.evaluate("beginsAsSeries('UEsDBA==') || beginsAsSeries(new Uint8Array())")
    newer = bytearray(data)
    newer[8] = 9
    with pytest.raises(Exception, match="format version 9"):
        steps_of(page, bytes(newer))
    with pytest.raises(Exception, match="no series"):
        steps_of(page, b"PK\3\4" + data)


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
    frames = [
        (base64.b64encode(zstd.compress(content, level)).decode(), len(content), content)
        for content in contents
        for level in (1, 9)
    ]
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
        [[text, length] for text, length, _ in frames],
    )
    for (good, refused, text), (_, _, content) in zip(answers, frames, strict=True):
        assert good
        assert refused
        assert base64.b64decode(text) == content
