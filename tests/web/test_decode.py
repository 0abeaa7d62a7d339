"""The viewer reads files: every array as Python has it, and damaged ones refused by a sentence."""

from __future__ import annotations

import base64
import json
import zipfile
import zlib
from io import BytesIO

import numpy as np
import pytest
from browsers import PAGE, SITE, Page
from rewriting import described, rewritten
from strategies import random_vdi

from pyvista_vdi import io
from pyvista_vdi.model.coarser import coarser

#: Decodes files in the page: their arrays as base64, or the sentence.
SCRIPT = """
import { decodeVDI } from "./decode.js";
import { load } from "./loader.js";
const raw = (array) => textOf(new Uint8Array(array.buffer, array.byteOffset, array.byteLength));
window.decoded = async (bytes) => {
  try {
    const vdi = await decodeVDI(bytes);
    return Object.fromEntries(Object.entries(vdi).map(
      ([name, value]) => [name, ArrayBuffer.isView(value) ? raw(value) : value]));
  } catch (error) {
    return `${error.name}: ${error.message}`;
  }
};
window.decodeVDI = decodeVDI;
window.loadVDI = load;
"""


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


def decoded(page, data):
    text = base64.b64encode(data).decode()
    return page.evaluate("(text) => decoded(bytesOf(text))", text)


def vdi_bytes(vdi, tmp_path, **options):
    return vdi.save(tmp_path / "a.vdi", **options).read_bytes()


def large_vdi():
    """More supersegments than a chunk, in lists that chunks end within."""
    small = random_vdi(np.random.default_rng(8), max_window=(5, 4))
    n, per_list = 150 * 150, 7
    rng = np.random.default_rng(5)
    faces = np.sort(rng.random((n, 2 * per_list), dtype=np.float32), axis=1)
    faces += np.arange(2 * per_list, dtype=np.float32) * 1e-3 + 1
    front, back = faces.reshape(-1, 2).T
    return type(small)(
        small.camera, (150, 150), np.arange(n + 1) * per_list, front, back,
        rng.random((n * per_list, 3)), rng.exponential(size=n * per_list), small.bounds,
    )  # fmt: skip


@pytest.mark.every(6)
@pytest.mark.parametrize("codec", ["lz4", "zstd", "deflate", "none"])
@pytest.mark.parametrize("precision", ["exact", "16-byte", "8-byte"])
def test_arrays_are_python_s(codec, precision, page, tmp_path):
    vdis = [large_vdi(), *(random_vdi(np.random.default_rng(seed)) for seed in range(4))]
    for vdi in vdis:
        packed = vdi.with_precision(precision)
        got = decoded(page, vdi_bytes(packed, tmp_path, compression=codec))
        assert isinstance(got, dict), got
        assert tuple(got["windowSize"]) == packed.window_size
        assert got["camera"] == json.loads(json.dumps(packed.camera.to_dict()))
        assert (got["depthOrigin"], tuple(got["bounds"])) == (packed.depth_origin, packed.bounds)
        wanted = {"offsets": packed.offsets.astype("<u4")}
        if precision == "8-byte":
            assert (got["precision"], got["depthStep"]) == ("8-byte", packed.packing.step)
            wanted |= {"words": packed.packing.words, "origin": packed.packing.origins}
            wanted["stride"] = packed.packing.strides
        else:
            assert got["precision"] == "exact"
            wanted |= {"front": packed.front, "back": packed.back, "color": packed.color}
            wanted["opticalDepth"] = packed.optical_depth
        for name, array in wanted.items():
            found = np.frombuffer(base64.b64decode(got[name]), array.dtype)
            np.testing.assert_array_equal(found, array.reshape(-1), err_msg=name)


def test_the_coarse_level_comes_before_the_rest_is_there(page, tmp_path):
    """The source gives nothing more until the coarse level has come."""
    vdi = random_vdi(np.random.default_rng(1))
    data = vdi_bytes(vdi, tmp_path, compression="deflate", precision="8-byte")
    cut = data.index(b"PK\3\4", data.index(b"PK\5\6"))  # the member behind the coarse level
    levels = page.evaluate(
        """async ([text, cut]) => {
          const bytes = bytesOf(text), levels = [], rest = Promise.withResolvers();
          async function* pieces() {
            yield bytes.slice(0, cut - 10);
            yield textOf(bytes.subarray(cut - 10, cut + 11)).slice(0, 26);
            await rest.promise;
            yield textOf(bytes.subarray(cut - 10, cut + 11)).slice(26);
            yield textOf(bytes.subarray(cut + 11));
          }
          await loadVDI(pieces(), { onLevel: (prepared) => {
            levels.push([prepared.level, prepared.n, prepared.windowSize, prepared.pictureSize]);
            rest.resolve();
          } });
          return levels;
        }""",
        [base64.b64encode(data).decode(), cut],
    )
    small, window = coarser(vdi), list(vdi.window_size)
    assert levels == [
        ["coarse", small.n_supersegments, list(small.window_size), window],
        ["full", vdi.n_supersegments, window, window],
    ]


def test_every_truncation_is_noticed(page, tmp_path):
    """But for the archive's directory behind the last member, which nothing is read from."""
    vdi = random_vdi(np.random.default_rng(1), max_window=(6, 5))
    for codec in ("deflate", "lz4"):
        data = vdi_bytes(vdi, tmp_path, compression=codec, precision="8-byte")
        end = zipfile.ZipFile(BytesIO(data)).start_dir
        cuts = [*range(0, end, 41), end - 1, end]
        answers = page.evaluate(
            """async ([text, cuts]) => {
              const bytes = bytesOf(text), answers = [];
              for (const cut of cuts) answers.push(await decoded(bytes.slice(0, cut)));
              return answers.map(String);
            }""",
            [base64.b64encode(data).decode(), cuts],
        )
        for cut, answer in zip(cuts, answers, strict=True):
            assert answer.startswith("VDIFileError: the VDI file is "), (cut, answer)
            assert "truncated" in answer, (cut, answer)


@pytest.mark.parametrize("codec", ["deflate", "lz4", "zstd", "none"])
def test_every_changed_byte_is_noticed_or_harmless(codec, page, tmp_path):
    vdi = random_vdi(np.random.default_rng(2), max_window=(6, 5))
    data = vdi_bytes(vdi, tmp_path, compression=codec, precision="8-byte")
    outcome = page.evaluate(
        """async ([text, step]) => {
          const bytes = bytesOf(text), whole = JSON.stringify(await decoded(bytes));
          const outcome = { refused: 0, same: 0, other: [] };
          for (let k = 0; k < bytes.length; k += step) {
            const changed = bytes.slice();
            changed[k] ^= 0x55;
            const answer = await decoded(changed);
            if (typeof answer === "string" && answer.startsWith("VDIFileError")) ++outcome.refused;
            else if (JSON.stringify(answer) === whole) ++outcome.same;
            else outcome.other.push([k, answer]);
          }
          return outcome;
        }""",
        [base64.b64encode(data).decode(), max(1, len(data) // 400)],
    )
    assert outcome["other"] == []
    # The coarse level, the directory and the headers' times and attributes are not read here
    assert outcome["refused"] > 0.4 * (outcome["refused"] + outcome["same"])


def test_hostile_headers(page, tmp_path):
    vdi = random_vdi(np.random.default_rng(2), max_window=(6, 5)).with_precision("8-byte")
    data = vdi_bytes(vdi, tmp_path, compression="none")
    camera = vdi.camera.to_dict()
    hostile = {
        "more than": [{"n_supersegments": n} for n in (10**9, -1, 1.5, "5", None, 2**60)],
        "window_size": [{"window_size": w} for w in ([65536, 65536], [0, 1], [1], None, [1e9, 1])],
        "camera": [
            {"camera": {**camera, **change}}
            for change in (
                {"view_angle": 180},
                {"position": camera["focal_point"]},
                {"position": [None, 0, 0]},
                {"model_transform": [[1]]},
                {"parallel_scale": "x"},
            )
        ],
        "others": [
            {"version": 5}, {"version": "4"}, {"codec": "deflate"}, {"codec": "lzma"},
            {"codec": ["none"]}, {"precision": "half"}, {"depth_step": 0.3}, {"depth_step": -1},
            {"bounds": [1, 0, 0, 1, 0, 1]}, {"bounds": "x"}, {"arrays": None}, {"arrays": {}},
            {"metadata": None}, {"chunk_rows": 1}, {"format": "x"}, {"depth_origin": None},
        ],
    }  # fmt: skip
    for kind, changes in hostile.items():
        for change in changes:
            answer = decoded(page, described(data, **change))
            assert isinstance(answer, str), (kind, change)
            assert answer.startswith("VDIFileError: "), (kind, change, answer)


def test_streams_that_lie_about_their_size(page, tmp_path):
    """A stream that goes on is broken off; one that ends early is noticed."""
    vdi = random_vdi(np.random.default_rng(2), max_window=(6, 5)).with_precision("8-byte")
    data = vdi_bytes(vdi, tmp_path, compression="deflate")
    names = ("counts", "origin", "stride", "front", "back", "color", "optical_depth")
    for more in (b"", b"\0" * 10**7):

        def edit(members, more=more):
            raw = zlib.decompress(members["back"])
            members["back"] = zlib.compress(raw + more if more else raw[:-1])

        assert "does not decompress to the" in decoded(page, rewritten(data, edit, names))


def test_noise_is_no_lz4(page, tmp_path):
    """Frames of Blosc whose streams are noise end as a sentence, within their bounds."""
    vdi = random_vdi(np.random.default_rng(4))
    data = vdi_bytes(vdi, tmp_path, compression="lz4", precision="exact")
    names = ("counts", "front", "back", "color", "optical_depth")
    rng = np.random.default_rng(3)
    for begin in (16, 24, 40):

        def edit(members, begin=begin):
            color = bytearray(members["color"])
            color[begin:] = rng.bytes(len(color) - begin)
            members["color"] = bytes(color)

        answer = decoded(page, rewritten(data, edit, names))
        assert "VDIFileError: the VDI file is damaged" in str(answer)


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", "it is empty"),
        (b"<!doctype html><p>Not found, but with status 200</p>", "this is no VDI file: it begins"),
        (b"PK\3\4" + b"\0" * 100, "VDI"),
    ],
)
def test_foreign_files(content, why, page):
    answer = page.evaluate(
        """async (text) => loadVDI(bytesOf(text), { onLevel() {} }).then(
             () => "taken", (error) => error.message)""",
        base64.b64encode(content).decode(),
    )
    assert why in answer


def test_without_workers_the_page_decodes(open_page, tmp_path):
    """Where a policy forbids workers."""
    vdi = random_vdi(np.random.default_rng(1))
    script = "window.Worker = class { constructor() { throw new Error('forbidden'); } };" + SCRIPT
    page = open_page(script=script)
    text = base64.b64encode(vdi_bytes(vdi, tmp_path, compression="deflate")).decode()
    levels = page.evaluate(
        """async (text) => {
          const levels = [];
          await loadVDI(bytesOf(text), { onLevel: ({ level, n }) => levels.push([level, n]) });
          return levels;
        }""",
        text,
    )
    assert levels == [["coarse", coarser(vdi).n_supersegments], ["full", vdi.n_supersegments]]


def test_a_load_can_be_ended(page, tmp_path):
    """And the worker that was decoding is gone: the next load has one that answers it alone."""
    vdi = random_vdi(np.random.default_rng(1))
    text = base64.b64encode(vdi_bytes(vdi, tmp_path, compression="deflate")).decode()
    reason, levels = page.evaluate(
        """async (text) => {
          const bytes = bytesOf(text), stop = new AbortController(), levels = [];
          async function* pieces() {
            yield bytes.slice(0, 100);
            stop.abort(new Error("enough"));
            yield bytes.slice(100);
          }
          const onLevel = ({ level }) => levels.push(level);
          const reason = await loadVDI(pieces(), { onLevel, signal: stop.signal }).then(
            () => "loaded", (error) => error.message);
          await loadVDI(bytes, { onLevel });
          return [reason, levels];
        }""",
        text,
    )
    assert (reason, levels) == ("enough", ["coarse", "full"])


def test_what_is_not_there_is_a_sentence(open_page):
    page = open_page(attributes='src="missing.vdi"', expected="404")
    page.wait_for("viewer.status.state === 'error'")
    assert "missing.vdi cannot be read: 404" in page.evaluate("viewer.status.message")


def test_python_reads_what_was_written(tmp_path):
    """What the tests above are compared with is what files hold."""
    vdi = large_vdi()
    assert io.read(vdi.save(tmp_path / "a.vdi", compression="deflate")).equals(vdi)
