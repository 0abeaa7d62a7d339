"""The viewer reads files: every array as Python has it, and damaged ones refused by a sentence."""

import zipfile
import zlib
from io import BytesIO

import numpy as np
import pytest
from browsers import WITHOUT_WORKERS, assert_decoded, file_of, in_base64
from rewriting import described, rewritten
from strategies import random_vdi

from pyvista_vdi.io.vdi_file.coarse import coarser

SCRIPT = """
import { decodeVDI } from "./decode.js";
import { load } from "./loader.js";
window.decoded = (bytes) => told(decodeVDI(bytes));
window.loadVDI = load;
"""

PACKED = ("counts", "origin", "stride", "front", "back", "color", "optical_depth")


@pytest.fixture
def page(open_page):
    return open_page(script=SCRIPT)


def decoded(page, data):
    return page.evaluate("(text) => decoded(bytesOf(text))", in_base64(data))


def random(seed, max_window=(6, 5)):
    """A VDI of 8 bytes a supersegment."""
    vdi = random_vdi(np.random.default_rng(seed), max_window=max_window)
    return vdi.with_precision("8-byte")


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


@pytest.mark.parametrize("precision", ["exact", "8-byte"])
def test_arrays_are_python_s(precision, page):
    for vdi in (large_vdi(), *(random_vdi(np.random.default_rng(seed)) for seed in range(4))):
        packed = vdi.with_precision(precision)
        assert_decoded(decoded(page, file_of(packed)), packed)


@pytest.mark.parametrize("codec", ["lz4", "zstd", "none"])
def test_other_compressions_are_refused_with_the_remedy(codec, page):
    answer = decoded(page, file_of(random(1), codec))
    assert f"is compressed with {codec}, and pages read deflate alone" in answer
    assert "pyvista-vdi convert" in answer


def levels_of(vdi):
    small, window = coarser(vdi), list(vdi.window_size)
    return [
        ["coarse", small.n_supersegments, list(small.window_size), window],
        ["full", vdi.n_supersegments, window, window],
    ]


TOLD = "({ level, n, windowSize, pictureSize }) => [level, n, windowSize, pictureSize]"


def test_the_coarse_level_comes_before_the_rest_is_there(page):
    """The source gives nothing more until the coarse level has come."""
    vdi = random(1, (24, 18))
    data = file_of(vdi)
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


def test_without_workers_the_page_decodes(open_page):
    """Where a policy forbids workers."""
    vdi = random(1, (24, 18))
    levels = open_page(script=SCRIPT, before=WITHOUT_WORKERS).evaluate(
        f"""async (text) => {{
          const levels = [];
          await loadVDI(bytesOf(text), {{ onLevel: (it) => levels.push(({TOLD})(it)) }});
          return levels;
        }}""",
        in_base64(file_of(vdi)),
    )
    assert levels == levels_of(vdi)


def test_every_truncation_is_noticed(page):
    """But for the archive's directory behind the last member, which nothing is read from."""
    data = file_of(random(1))
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


def test_every_changed_byte_is_noticed_or_harmless(page):
    data = file_of(random(2))
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
    "codec": ("lzma", ["none"]),
    "precision": ("half", "16-byte"),
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


def test_hostile_headers(page):
    vdi = random(2)
    data, camera = file_of(vdi), vdi.camera.to_dict()
    changes = [{name: value} for name, values in HOSTILE.items() for value in values]
    for wrong in (*NO_CAMERAS, {"position": camera["focal_point"]}):
        changes.append({"camera": {**camera, **wrong}})
    for change in changes:
        answer = decoded(page, described(data, **change))
        assert isinstance(answer, str), change
        assert answer.startswith("VDIFileError: "), (change, answer)


@pytest.mark.parametrize("more", [b"", b"\0" * 10**7], ids=["too short", "too long"])
def test_streams_that_lie_about_their_size(more, page):
    """A stream that goes on is broken off; one that ends early is noticed."""

    def edit(members):
        raw = zlib.decompress(members["back"])
        members["back"] = zlib.compress(raw + more if more else raw[:-1])

    answer = decoded(page, rewritten(file_of(random(2)), edit, PACKED))
    assert "does not decompress to the" in answer


def test_a_load_can_be_ended(page):
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
        in_base64(file_of(random(1, (24, 18)))),
    )
    assert (reason, levels) == ("enough", ["coarse", "full"])
