"""A classified VDI is drawn from its values: the bits are those of arrays that nobody makes."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from strategies import kept_values, random_vdi

import pyvista_vdi as pvdi
from pyvista_vdi import TransferFunction
from pyvista_vdi.raycasting.classified_values import classify_on_device
from pyvista_vdi.raycasting.prepared import PreparedVDI, prepared_vdi

COLORS = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]


def kept(seed, precision="exact"):
    lists = random_vdi(np.random.default_rng(seed), max_supersegments=5)
    mean, spread, share = lists.color.T
    return kept_values(lists, mean, spread / 8, share).with_precision(precision)


@pytest.mark.parametrize("opacities", [[0.1, 0.8, 0.3], [0, 0, 0, 0.9]])
@pytest.mark.parametrize("precision", ["exact", "8-byte"])
def test_pictures_and_grids_are_those_of_the_arrays(runtime, precision, opacities):
    colors = np.resize(COLORS, (len(opacities), 3))
    look = TransferFunction(colors, opacities, (100, 300))
    for seed in range(2):
        vdi = classify_on_device(kept(seed, precision), look, runtime)
        drawn = prepared_vdi(runtime, vdi)
        picture = pvdi.render(vdi, vdi.camera, device=runtime)
        assert vdi.nbytes == 0  # nobody has asked for arrays
        arrays = pickle.loads(pickle.dumps(vdi))
        assert (arrays.nbytes > 0, arrays.front.flags.writeable) == (True, False)
        made = PreparedVDI(runtime, arrays)
        for name in ("masks", "counts"):
            wanted, got = (runtime.download(getattr(p.occupancy, name)) for p in (made, drawn))
            assert np.array_equal(got, wanted)
        assert np.array_equal(picture, pvdi.render(arrays, vdi.camera, device=runtime))
