"""Steps decoded by the kernel and by NumPy: the same to the last bit, for good numbers and bad."""

from __future__ import annotations

import numpy as np
import pytest
from stepped_vdis import frames_of, packed_steps, stepped_vdi

import pyvista_vdi as pvdi
from pyvista_vdi.errors import Cancelled, DeviceMemoryError, VDIFileError
from pyvista_vdi.extensions.series import layout, on_device, reader
from pyvista_vdi.extensions.series.series import VDISeries

pytestmark = pytest.mark.device

CASES = {
    "samples": {},
    "no samples": {"metadata": {}},
    "other colours": {"palette": False},
    "all the same": {"still": 1.0},
    "nothing the same": {"still": 0.0},
    "partly the same": {"partly": True},
    "partly, no samples": {"partly": True, "metadata": {}},
    "one list": {"size": (1, 1)},
    "many lists": {"size": (49, 33)},
}


@pytest.fixture
def made(monkeypatch, default_runtime):
    """Counts the steps that the kernel has decoded, and those that it has given back."""
    counts = {True: 0, False: 0}
    decoded_on = on_device.decoded_on

    def counted(*numbers):
        step = decoded_on(*numbers)
        counts[step is not None] += 1
        return step

    monkeypatch.setattr(reader, "decoded_on", counted)
    return counts


def numpy_alone(patch):
    patch.setattr(reader, "runtime_for_decoding", lambda: None)


@pytest.mark.every(5)
@pytest.mark.parametrize("tolerance", [0.0, 0.03])
@pytest.mark.parametrize("case", CASES)
def test_kernel_and_numpy_give_the_same_bits(case, tolerance, made, monkeypatch, tmp_path):
    steps = packed_steps(6, **CASES[case])
    path = VDISeries.of(steps).save(tmp_path / "a.vdis", tolerance=tolerance, key_every=8)
    with monkeypatch.context() as patch:
        numpy_alone(patch)
        by_numpy = [(vdi.offsets, vdi.packing, vdi) for vdi in pvdi.read(path)]
    assert not made[True]
    for (offsets, packing, vdi), read in zip(by_numpy, pvdi.read(path), strict=True):
        np.testing.assert_array_equal(read.offsets, offsets)
        for name in ("origins", "strides", "words"):
            np.testing.assert_array_equal(getattr(read.packing, name), getattr(packing, name))
        assert read.packing.step == packing.step
        assert read.equals(vdi)
        assert read.packing.nbytes + read.offsets.nbytes < read.nbytes  # unpacked by now
    if layout.LISTS in {header.kind for _, header in frames_of(path)}:
        assert made[True]
    assert not made[False]


def test_without_the_arrays_in_one_memory(made, tmp_path, monkeypatch):
    path = VDISeries.of(packed_steps(3)).save(tmp_path / "a.vdis")
    whole = list(pvdi.read(path))
    read_arrays = layout.read_arrays
    monkeypatch.setattr(layout, "read_arrays", lambda *what: dict(read_arrays(*what)))
    assert all(a.equals(b) for a, b in zip(pvdi.read(path), whole, strict=True))
    assert made[True] == 6


@pytest.mark.every(3)
@pytest.mark.parametrize("seed", range(16))
def test_numbers_that_contradict_each_other_are_refused_alike(seed, made, tmp_path, monkeypatch):
    """A frame's numbers are changed, its checksums are not looked at."""
    random = np.random.default_rng(seed)
    steps = packed_steps(3, size=(12, 7), partly=seed % 2 > 0)
    path = VDISeries.of(steps).save(tmp_path / "a.vdis")
    read_arrays = layout.read_arrays

    def changed(data, codec):
        arrays = dict(read_arrays(data, codec))
        again = np.random.default_rng([seed, len(data)])
        names = sorted(name for name, array in arrays.items() if array.size)
        name = names[again.integers(len(names))]
        array = arrays[name] = arrays[name].copy()
        place = again.integers(array.size)
        if name == "extinctions":
            array[place] = again.choice([0.0, 1e-3, 1e30])
        else:
            array[place] = again.integers(0, np.iinfo(array.dtype).max, endpoint=True)
        if again.random() < 0.2:
            arrays[name] = array[:-1]
        return arrays

    def outcome(i):
        try:
            vdi = pvdi.read(path)[i]
        except VDIFileError as error:
            return str(error)
        return vdi.packing.words.tobytes(), vdi.packing.origins.tobytes(), vdi.offsets.tobytes()

    monkeypatch.setattr(layout, "read_arrays", changed)
    i = int(random.integers(3))
    found = outcome(i)
    numpy_alone(monkeypatch)
    assert outcome(i) == found


def test_more_is_said_to_be_kept_than_is(made, tmp_path, monkeypatch):
    steps = packed_steps(2, partly=True)
    path = VDISeries.of(steps).save(tmp_path / "a.vdis")
    read_arrays = layout.read_arrays
    refused = []
    for place in range(1, 40):

        def changed(data, codec, place=place):
            arrays = dict(read_arrays(data, codec))
            if "kept_there" in arrays:
                bits = np.unpackbits(arrays["kept_there"])
                bits[np.flatnonzero(bits == 0)[-place]] = 1
                arrays["kept_there"] = np.packbits(bits)
            return arrays

        monkeypatch.setattr(layout, "read_arrays", changed)
        try:
            assert pvdi.read(path)[1].equals(steps[1])  # a bit that fills up the last byte
        except VDIFileError as error:
            refused.append(str(error))
    assert len(refused) >= 32
    assert all("what is kept" in message for message in refused)
    assert made[False] == len(refused)


def test_a_device_without_memory_costs_no_step_and_cancelling_is_no_damage(
    default_runtime, monkeypatch, tmp_path
):
    steps = packed_steps(3)
    path = VDISeries.of(steps).save(tmp_path / "a.vdis")
    failing = {"error": DeviceMemoryError("none left")}

    def fails(*_):
        raise failing["error"]

    monkeypatch.setattr(reader, "decoded_on", fails)
    assert all(a.equals(b) for a, b in zip(pvdi.read(path), steps, strict=True))
    failing["error"] = Cancelled("by the player")
    with pytest.raises(Cancelled):
        pvdi.read(path)[0]


def test_a_packed_vdi_is_unpacked_when_it_is_asked_for(tmp_path, default_runtime):
    vdi = stepped_vdi().with_precision("8-byte")
    read = pvdi.read(VDISeries.of([vdi]).save(tmp_path / "a.vdis"))[0]
    if "front" in vars(read):
        pytest.skip("this frame is a whole file")
    packed = read.nbytes
    assert packed == read.offsets.nbytes + read.packing.nbytes
    picture = pvdi.render(read, vdi.camera.azimuth(3), (40, 30))
    assert read.nbytes == packed, "drawing has unpacked it"
    np.testing.assert_array_equal(picture, pvdi.render(vdi, vdi.camera.azimuth(3), (40, 30)))
    assert not read.front.flags.writeable
    assert read.equals(vdi)
    assert read.nbytes == vdi.nbytes
    with pytest.raises(AttributeError, match="depths"):
        _ = read.depths
