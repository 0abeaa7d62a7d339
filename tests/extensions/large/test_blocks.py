"""A volume in blocks: cuts, halos, the order in which V_O sees them, and the VDI of one piece."""

from __future__ import annotations

import numpy as np
import pytest
from drawing import generate_in_blocks, generate_vdi, request
from runtimes import fresh_runtime
from support.march_ways import VIEWS, WINDOW, ray_depths, transfer_for, volume_of

import pyvista_vdi as pvdi
from pyvista_vdi import Shading, TransferFunction, Volume
from pyvista_vdi.errors import Cancelled, DeviceMemoryError, UnsupportedError
from pyvista_vdi.extensions.large.blocks import Blocks, cuts_of, with_halo
from pyvista_vdi.generation.deferred import generate_deferred, unclassified
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.model.options import Deferral
from pyvista_vdi.model.vdi import lengths_of
from pyvista_vdi.quality.targets import turned


def blocks_of(volume, chunks, function=None, block_bytes=1):
    cuts = cuts_of(volume.array.shape, chunks, volume.array.dtype.itemsize, block_bytes)
    return Blocks.of(volume, cuts, function or transfer_for(volume))


@pytest.mark.parametrize("shading", [None, Shading()], ids=["", "shaded"])
@pytest.mark.parametrize("chunks", [(4, 5, 6), (8, 19, 7)])
def test_neighbours_give_the_halo(shading, chunks):
    values = np.random.default_rng(1).integers(0, 255, (13, 19, 17), np.uint8)
    volume = Volume(values)
    blocks = blocks_of(volume, chunks, transfer_for(volume, shading=shading))
    assert (blocks.before, blocks.after) == ((1, 3) if shading else (0, 1))
    faces = {block: blocks.faces(values[blocks.own(block)]) for block in blocks}
    for block in blocks:
        around = blocks.neighbours(block).items()
        parts = {offset: faces[other][offset] for offset, other in around}
        found = with_halo(values[blocks.own(block)], parts)
        box = tuple(
            slice(max(part.start - blocks.before, 0), part.stop + blocks.after)
            for part in blocks.own(block)
        )
        np.testing.assert_array_equal(found, values[box], str(block))
        first = blocks.part(block, blocks.before, (0, 1)).first
        assert first == tuple(part.start for part in reversed(box))


def both_ways(volume, camera, function, chunks=(16, 16, 16), **options):
    """Return the VDI of one piece, and that of blocks."""
    whole = generate_vdi(volume, camera, WINDOW, function, **options)
    return whole, generate_in_blocks(volume, camera, WINDOW, function, chunks=chunks, **options)


def check_ray_depths(found, whole):
    """Optical depths add up whatever is merged: a step that is lost or taken twice shows.

    float32 sums of up to 200 steps, in another order: 200 x 2^-24, and as much for the reference.
    """
    np.testing.assert_allclose(ray_depths(found), ray_depths(whole), rtol=2.4e-5, atol=1e-7)


@pytest.mark.parametrize(
    ("view", "cuts"), [("all of it", (16, 16, 16)), ("from inside", (20, 41, 13))]
)
def test_every_step_belongs_to_one_block(runtime, view, cuts):
    volume = volume_of("uint8", (1, 1.3, 0.8))
    camera = VIEWS[view](volume)
    options = {"max_supersegments": 12, "device": runtime.info.selector}
    whole, found = both_ways(volume, camera, transfer_for(volume, "linear"), cuts, **options)
    assert whole.n_supersegments > 500
    assert found.metadata["blocks"] != [1, 1, 1]
    assert np.diff(found.offsets.astype(np.int64)).max() <= 12
    check_ray_depths(found, whole)


BY_GRADIENT = {"gradient_opacities": np.linspace(0, 1, 8), "gradient_range": (0.0, 40.0)}


@pytest.mark.parametrize(
    ("dtype", "interpolation", "options"),
    [("float32", "linear", BY_GRADIENT), ("uint8", "nearest", {"shading": Shading()})],
)
def test_pictures_are_those_of_one_piece(runtime, dtype, interpolation, options):
    """At V_O to the rounding of float32; elsewhere lists are merged a little otherwise at faces.

    Noise in lists that are several voxels wide is the worst case: less is changed than by marching
    with steps that are two hundredths shorter.
    """
    volume = volume_of(dtype)
    camera = VIEWS["all of it"](volume)
    function = transfer_for(volume, interpolation, **options)
    device = runtime.info.selector
    whole, found = both_ways(volume, camera, function, device=device)
    other = generate_vdi(volume, camera, WINDOW, function, device=device, sample_distance=0.49)
    for degrees in (0, 5, 30):
        view = turned(camera, volume.bounds, degrees)
        expected, drawn, by_other = (
            pvdi.render(vdi, view, device=device) for vdi in (whole, found, other)
        )
        compared = compare_images(expected, drawn)
        assert compared.ssim >= compare_images(expected, by_other).ssim, (degrees, compared)
        if degrees == 0:
            assert np.abs(expected - drawn).max() <= 1 / 255


def test_what_is_visible_only_between_two_blocks_is_seen():
    """Neither 0 nor 200 shows; half way between them, in the cell between two blocks, 100 does."""
    values = np.zeros((16, 16, 16), np.uint8)
    values[:, :, 8:] = 200
    volume = Volume(values)
    opacities = np.zeros(256)
    opacities[80:120] = 0.8
    function = TransferFunction(np.ones((256, 3)), opacities, (0, 255), interpolation="linear")
    camera = VIEWS["all of it"](volume)
    whole, found = both_ways(volume, camera, function, (8, 8, 8))
    assert whole.n_supersegments > 50
    np.testing.assert_allclose(ray_depths(found), ray_depths(whole), rtol=1e-5)


@pytest.mark.parametrize(
    ("interpolation", "behind", "expected"),
    [("nearest", 100, 1), ("linear", 200, 4)],
)
def test_runs_are_joined_at_faces_where_they_are_alike(interpolation, behind, expected):
    """Blocks meet at z = 8. The medium changes before it, or by two steps of half a cell at it."""
    values = np.full((16, 16, 16), 100, np.uint8)
    values[9 if interpolation == "linear" else 8 :] = behind
    volume = Volume(values)
    table = np.linspace([1, 0, 0], [0, 1, 1], 256)
    function = TransferFunction(table, np.full(256, 0.2), (0, 255), interpolation=interpolation)
    camera = VIEWS["along an axis"](volume).replace(
        position=(7.5, 7.5, 60), focal_point=(7.5, 7.5, 7.5), parallel_scale=6
    )
    options = {"sample_distance": 0.5, "max_supersegments": 20}
    whole, vdi = both_ways(volume, camera, function, (8, 16, 16), **options)
    assert vdi.metadata["blocks"] == [2, 1, 1]
    found, of_whole = (np.diff(each.offsets.astype(int)) for each in (vdi, whole))
    assert (of_whole > 0).sum() > 500
    np.testing.assert_array_equal(of_whole[of_whole > 0], expected)
    np.testing.assert_array_equal(found, of_whole)


def test_occlusion_is_refused():
    volume = volume_of("uint8")
    arguments = (volume, VIEWS["all of it"](volume), transfer_for(volume, "linear"))
    with pytest.raises(UnsupportedError, match="needs the volume in one piece"):
        both_ways(*arguments, (12, 10, 9), ambient_occlusion=6.0)


@pytest.mark.parametrize("limit", [700_000, 1_600_000])
def test_no_more_memory_is_taken_than_allowed(runtime, limit):
    values = np.random.default_rng(1).integers(0, 255, (96, 96, 96)).astype(np.float32)
    volume = Volume(values)
    arguments = (volume, VIEWS["all of it"](volume), WINDOW, transfer_for(volume, "linear"))
    own = fresh_runtime(runtime)
    options = {"chunks": (24, 24, 24), "memory_limit": limit, "max_supersegments": 5}
    if limit < 1_000_000:
        with pytest.raises(DeviceMemoryError, match="rows of .* memory_limit is .* smaller chunks"):
            generate_in_blocks(*arguments, device=own, **options)
    else:
        generate_in_blocks(*arguments, device=own, **options)
        assert own.peak_allocated <= limit


def test_it_is_given_up_when_it_is_asked_to():
    volume = volume_of("uint8")
    told = []

    def progress(fraction):
        told.append(fraction)
        return fraction < 0.5

    with pytest.raises(Cancelled):
        generate_in_blocks(
            *(volume, VIEWS["all of it"](volume), WINDOW, transfer_for(volume)),
            chunks=(16, 16, 16),
            progress=progress,
        )
    assert told == sorted(told)
    assert 0.5 <= told[-1] < 0.9


@pytest.mark.parametrize("budget", [400, 5])
def test_blocks_keep_the_values_of_one_piece(budget, default_runtime):
    """Whatever is at their borders: per list, the length, and the sums of values and squares."""
    volume = volume_of("uint8")
    asked = request(
        *(volume, VIEWS["all of it"](volume), WINDOW, unclassified("linear")),
        max_supersegments=budget,
        device=default_runtime,
    )
    kept = Deferral("deferred", (20, 200))
    whole = generate_deferred(asked, kept)

    def make(made):
        view = made.volume, made.camera, WINDOW, made.transfer_function, made.options
        return generate_in_blocks(*view, chunks=(20, 14, 27), device=default_runtime)

    found = generate_deferred(asked, kept, make)
    assert found.metadata["blocks"] == [3, 3, 2]

    def sums(vdi):
        length, mean = lengths_of(vdi) * vdi.share, vdi.mean.astype(float)
        ends = vdi.offsets.astype(int)
        of_rows = (length, length * mean, length * (mean**2 + vdi.spread.astype(float) ** 2))
        return [np.diff(np.append(0, np.cumsum(each))[ends]) for each in of_rows]

    # Of up to 200 steps and float32 values; a spread below 5e-4 is written as none
    for one, other in zip(sums(found), sums(whole), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-4, atol=1e-3)
    assert found.n_supersegments == pytest.approx(whole.n_supersegments, rel=0.05)
