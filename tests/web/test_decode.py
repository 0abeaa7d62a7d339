"""The viewer reads files: every array as Python has it, and damaged ones refused by a sentence."""

from __future__ import annotations

import json
import zipfile
import zlib
from io import BytesIO

import numpy as np
import pytest
from browsers import WITHOUT_WORKERS, array_of, in_base64
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
window.loadVDI = load;
"""

EIGHT_BYTES = {"compression": "deflate", "precision": "8-byte"}
DIRECT = ("counts", "front", "back", "color", "optical_depth")
PACKED = ("counts", "origin", "stride", *DIRECT[1:])


@pytest.fixture
def page(open_page):
    return open_page(script=SCRIPT)


def decoded(page, data):
    return page.evaluate("(text) => decoded(bytesOf(text))", in_base64(data))


@pytest.fixture
def written(tmp_path):
    """The bytes of a VDI's file, of a random one by its seed."""

    def written(vdi, max_window=(6, 5), **options):
        if isinstance(vdi, int):
            vdi = random_vdi(np.random.default_rng(vdi), max_window=max_window)
        return vdi.save(tmp_path / "a.vdi", **options).read_bytes()

    return written


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
def test_arrays_are_python_s(codec, precision, page, written):
    for vdi in (large_vdi(), *(random_vdi(np.random.default_rng(seed)) for seed in range(4))):
        packed = vdi.with_precision(precision)
        got = decoded(page, written(packed, compression=codec))
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
            found = array_of(got[name], array.dtype)
            np.testing.assert_array_equal(found, array.reshape(-1), err_msg=name)


def test_python_reads_what_was_written(tmp_path):
    """What the test above compares with is what files hold."""
    vdi = large_vdi()
    assert io.read(vdi.save(tmp_path / "a.vdi", compression="deflate")).equals(vdi)


def levels_of(vdi):
    small, window = coarser(vdi), list(vdi.window_size)
    return [
        ["coarse", small.n_supersegments, list(small.window_size), window],
        ["full", vdi.n_supersegments, window, window],
    ]


TOLD = "({ level, n, windowSize, pictureSize }) => [level, n, windowSize, pictureSize]"


def test_the_coarse_level_comes_before_the_rest_is_there(page, written):
    """The source gives nothing more until the coarse level has come."""
    vdi = random_vdi(np.random.default_rng(1))
    data = written(vdi, **EIGHT_BYTES)
    cut = data.index(b"PK\3\4", data.index(b"PK\5\6"))  # the member behind the coarse level
    levels = page.evaluate(
        f"""async ([text, cut]) => {{
          const bytes = bytesOf(text), levels = [], rest = Promise.withResolvers();
          async function* pieces() {{
            yield bytes.slice(0, cut - 10);
            yield textOf(bytes.subarray(cut - 10, cut + 11)).slice(0, 26);
            await rest.promise;
            yield textOf(bytes.subarray(cut - 10, cut + 11)).slice(26);
            yield textOf(bytes.subarray(cut + 11));
          }}
          await loadVDI(pieces(), {{ onLevel: (prepared) => {{
            levels.push(({TOLD})(prepared));
            rest.resolve();
          }} }});
          return levels;
        }}""",
        [in_base64(data), cut],
    )
    assert levels == levels_of(vdi)


def test_without_workers_the_page_decodes(open_page, written):
    """Where a policy forbids workers."""
    vdi = random_vdi(np.random.default_rng(1))
    levels = open_page(script=SCRIPT, before=WITHOUT_WORKERS).evaluate(
        f"""async (text) => {{
          const levels = [];
          await loadVDI(bytesOf(text), {{ onLevel: (it) => levels.push(({TOLD})(it)) }});
          return levels;
        }}""",
        in_base64(written(vdi, compression="deflate")),
    )
    assert levels == levels_of(vdi)


def test_every_truncation_is_noticed(page, written):
    """But for the archive's directory behind the last member, which nothing is read from."""
    for codec in ("deflate", "lz4"):
        data = written(1, compression=codec, precision="8-byte")
        end = zipfile.ZipFile(BytesIO(data)).start_dir
        cuts = [*range(0, end, 41), end - 1, end]
        answers = page.evaluate(
            """async ([text, cuts]) => {
              const bytes = bytesOf(text), answers = [];
              for (const cut of cuts) answers.push(await decoded(bytes.slice(0, cut)));
              return answers.map(String);
            }""",
            [in_base64(data), cuts],
        )
        for cut, answer in zip(cuts, answers, strict=True):
            assert answer.startswith("VDIFileError: the VDI file is "), (cut, answer)
            assert "truncated" in answer, (cut, answer)


@pytest.mark.parametrize("codec", ["deflate", "lz4", "zstd", "none"])
def test_every_changed_byte_is_noticed_or_harmless(codec, page, written):
    data = written(2, compression=codec, precision="8-byte")
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
        [in_base64(data), max(1, len(data) // 400)],
    )
    assert outcome["other"] == []
    # The coarse level, the directory and the headers' times and attributes are not read here
    assert outcome["refused"] > 0.4 * (outcome["refused"] + outcome["same"])


HOSTILE = {
    "n_supersegments": (10**9, -1, 1.5, "5", None, 2**60),
    "window_size": ([65536, 65536], [0, 1], [1], None, [1e9, 1]),
    "version": (5, "4"),
    "codec": ("deflate", "lzma", ["none"]),
    "precision": ("half",),
    "depth_step": (0.3, -1),
    "bounds": ([1, 0, 0, 1, 0, 1], "x"),
    "arrays": (None, {}),
    "metadata": (None,),
    "chunk_rows": (1,),
    "format": ("x",),
    "depth_origin": (None,),
}
NO_CAMERAS = (
    {"view_angle": 180},
    {"position": [None, 0, 0]},
    {"model_transform": [[1]]},
    {"parallel_scale": "x"},
)


def test_hostile_headers(page, written):
    vdi = random_vdi(np.random.default_rng(2), max_window=(6, 5)).with_precision("8-byte")
    data, camera = written(vdi, compression="none"), vdi.camera.to_dict()
    changes = [{name: value} for name, values in HOSTILE.items() for value in values]
    for wrong in (*NO_CAMERAS, {"position": camera["focal_point"]}):
        changes.append({"camera": {**camera, **wrong}})
    for change in changes:
        answer = decoded(page, described(data, **change))
        assert isinstance(answer, str), change
        assert answer.startswith("VDIFileError: "), (change, answer)


@pytest.mark.parametrize("more", [b"", b"\0" * 10**7], ids=["too short", "too long"])
def test_streams_that_lie_about_their_size(more, page, written):
    """A stream that goes on is broken off; one that ends early is noticed."""

    def edit(members):
        raw = zlib.decompress(members["back"])
        members["back"] = zlib.compress(raw + more if more else raw[:-1])

    answer = decoded(page, rewritten(written(2, **EIGHT_BYTES), edit, PACKED))
    assert "does not decompress to the" in answer


@pytest.mark.parametrize("begin", [16, 24, 40])
def test_noise_is_no_lz4(begin, page, written):
    """Frames of Blosc whose streams are noise end as a sentence, within their bounds."""

    def edit(members):
        color = bytearray(members["color"])
        color[begin:] = np.random.default_rng(3).bytes(len(color) - begin)
        members["color"] = bytes(color)

    vdi = random_vdi(np.random.default_rng(4))
    answer = decoded(page, rewritten(written(vdi, compression="lz4"), edit, DIRECT))
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
        in_base64(content),
    )
    assert why in answer


def test_a_load_can_be_ended(page, written):
    """And the worker that was decoding is gone: the next load has one that answers it alone."""
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
        in_base64(written(random_vdi(np.random.default_rng(1)), compression="deflate")),
    )
    assert (reason, levels) == ("enough", ["coarse", "full"])
