"""Blank octants: the reference's picture, however rays are followed and bricks are held."""

from __future__ import annotations

import numpy as np
import pytest
import reference
from drawing import generate_vdi, raycast_volume
from march_ways import VIEWS, WINDOW, both_ways, transfer_for, volume_of

from pyvista_vdi import InvalidVolumeError, Volume, render_volume
from pyvista_vdi.errors import UnsupportedError
from pyvista_vdi.model.chunked import ChunkedArray


def blanked(dtype, n=None):
    """The volume, or a corner of it, a third of whose octants are blank."""
    part = volume_of(dtype).array[:n, :n, :n]
    octants = np.random.default_rng(4).integers(0, 256, (2, *part.shape), np.uint8)
    return Volume(part, blanked=octants[0] & octants[1])


@pytest.mark.parametrize("dtype", ["uint8", "float32"])
@pytest.mark.parametrize("interpolation", ["nearest", "linear"])
def test_the_device_leaves_out_what_the_reference_does(runtime, dtype, interpolation):
    volume = blanked(dtype, 16)
    function = transfer_for(volume, interpolation)
    camera = VIEWS["all of it"](volume)
    scene = (volume, camera, (10, 8), function)
    expected = reference.volume_image(*scene)
    drawn = raycast_volume(*scene, early_termination=False, device=runtime)
    # As without blank octants: some 80 samples
    np.testing.assert_allclose(drawn, expected, rtol=0, atol=2e-4)
    whole = reference.volume_image(Volume(volume.array), *scene[1:])
    assert np.abs(whole - expected).max() > 0.1


@pytest.mark.parametrize("interpolation", ["nearest", "linear"])
@pytest.mark.parametrize("kernel", ["render_volume", "project", "march_lists"])
def test_blocks_of_rays_give_the_same_bits(monkeypatch, runtime, kernel, interpolation):
    volume = blanked("uint8")
    scene = (volume, VIEWS["all of it"](volume), WINDOW)
    function = transfer_for(volume, interpolation)

    def make():
        if kernel == "march_lists":
            return generate_vdi(*scene, function, device=runtime).optical_depth
        blending = {"blending": "maximum"} if kernel == "project" else {}
        return render_volume(*scene, transfer_function=function, device=runtime, **blending)

    found, expected, _ = both_ways(monkeypatch, runtime, kernel, make)
    assert found.tobytes() == expected.tobytes()
    blank, volume.blanked = volume.blanked, None
    assert make().tobytes() != found.tobytes()
    volume.blanked = blank


def test_bricks_give_the_same_bits(runtime):
    field = np.tile(volume_of("float32").array, (2, 3, 3))
    volume = Volume(field, blanked=np.arange(field.size, dtype=np.uint8).reshape(field.shape))
    scene = (volume, VIEWS["all of it"](volume), (20, 13), transfer_for(volume))
    whole, limited = (
        raycast_volume(*scene, device=runtime, memory_limit=limit)
        for limit in (None, volume.blanked.nbytes + 2**21)
    )
    np.testing.assert_array_equal(limited, whole)


def test_what_cannot_have_blank_octants_says_so():
    shape = (4, 5, 6)
    with pytest.raises(InvalidVolumeError, match=r"uint8 of shape \(4, 5, 6\).*got bool"):
        Volume(np.zeros(shape), blanked=np.zeros(shape, bool))
    chunked = ChunkedArray(np.zeros(shape))
    with pytest.raises(UnsupportedError, match="load it"):
        Volume(chunked, blanked=np.zeros(shape, np.uint8))
