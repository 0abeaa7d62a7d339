"""The viewer reads files: every array as Python has it, and damaged ones refused by a sentence."""

import zipfile
from io import BytesIO

import numpy as np
import pytest
from browsers import assert_decoded, file_of, in_base64
from in_node import in_node
from rewriting import described
from strategies import random_vdi

from pyvista_vdi.io.vdi_file.writer import coarser

DECODED = """async (...texts) => {
  const { decodeVDI } = await from("decode.js");
  return Promise.all(texts.map((text) => told(decodeVDI(bytesOf(text)))));
}"""


def decoded(*files):
    return in_node(DECODED, *map(in_base64, files))


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
def test_arrays_are_python_s(precision):
    vdis = large_vdi(), *(random_vdi(np.random.default_rng(seed)) for seed in range(4))
    kept = [vdi.with_precision(precision) for vdi in vdis]
    for got, vdi in zip(decoded(*map(file_of, kept)), kept, strict=True):
        assert_decoded(got, vdi)


def test_the_coarse_level_comes_before_the_rest_is_there():
    """Bytes and base64 text that ends anywhere; before it an empty VDI of the same view."""
    vdi = random(1, (24, 18))
    data, small = file_of(vdi), coarser(vdi)
    cut = data.index(b"PK\3\4", data.index(b"PK\5\6"))  # the member behind the coarse level
    early, all_of_it = in_node(
        """async (text, cut) => {
          const { LevelDecoder } = await from("decode.js");
          const bytes = bytesOf(text), levels = [], rest = textOf(bytes.subarray(cut - 10));
          const decoder = new LevelDecoder(({ level, offsets, windowSize }) =>
            levels.push([level, offsets.at(-1), windowSize]));
          await decoder.push(bytes.slice(0, cut - 10));
          await decoder.push(rest.slice(0, 26));
          const early = levels.length;
          await decoder.push(rest.slice(26));
          await decoder.end();
          return [early, levels];
        }""",
        in_base64(data),
        cut,
    )
    assert early == 2
    assert all_of_it == [
        ["begun", 0, [1, 1]],
        ["coarse", small.n_supersegments, list(small.window_size)],
        ["full", vdi.n_supersegments, list(vdi.window_size)],
    ]


def test_every_truncation_is_noticed():
    """But for the archive's directory behind the last member, which nothing is read from."""
    data = file_of(random(1))
    end = zipfile.ZipFile(BytesIO(data)).start_dir
    cuts = [*range(0, end, 41), end - 1, end]
    for cut, answer in zip(cuts, decoded(*(data[:cut] for cut in cuts)), strict=True):
        assert answer.startswith("VDIFileError: the VDI file is "), (cut, answer)
        assert "truncated" in answer, (cut, answer)


def test_every_changed_byte_is_noticed_or_harmless():
    data = file_of(random(2))
    refused, same, other = in_node(
        """async (text, step) => {
          const { decodeVDI } = await from("decode.js");
          const bytes = bytesOf(text), whole = JSON.stringify(await told(decodeVDI(bytes)));
          const outcome = [0, 0, []];
          for (let k = 0; k < bytes.length; k += step) {
            const changed = bytes.slice();
            changed[k] ^= 0x55;
            const answer = await told(decodeVDI(changed));
            if (typeof answer === "string" && answer.startsWith("VDIFileError")) ++outcome[0];
            else if (JSON.stringify(answer) === whole) ++outcome[1];
            else outcome[2].push([k, answer]);
          }
          return outcome;
        }""",
        in_base64(data),
        max(1, len(data) // 400),
    )
    assert other == []
    # The coarse level, the directory and the headers' times and attributes are not read here
    assert refused > 0.4 * (refused + same)


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
NO_CAMERAS = ({"view_angle": 180}, {"position": [None, 0, 0]}, {"model_transform": [[1]]})


def test_hostile_headers_and_other_compressions():
    vdi = random(2)
    data, camera = file_of(vdi), vdi.camera.to_dict()
    changes = [{name: value} for name, values in HOSTILE.items() for value in values]
    for wrong in (*NO_CAMERAS, {"position": camera["focal_point"]}):
        changes.append({"camera": {**camera, **wrong}})
    answers = decoded(*(described(data, **change) for change in changes))
    for change, answer in zip(changes, answers, strict=True):
        assert isinstance(answer, str), change
        assert answer.startswith("VDIFileError: "), (change, answer)
    codecs = "lz4", "zstd", "none"
    for codec, answer in zip(codecs, decoded(*(file_of(vdi, c) for c in codecs)), strict=True):
        assert f"is compressed with {codec}, and pages read deflate alone" in answer
        assert "pyvista-vdi convert" in answer
