"""Deep images of ours that oiiotool changed: right, or refused for the true reason.

Its files are recorded (``tests/support/deep_programs.py``); where it is installed they are made
anew and must hold the same samples.
"""

from __future__ import annotations

import shutil
import sys
import warnings

import numpy as np
import pytest
from deep_images import MATRICES, change, matrices_of, read_deep, write_deep
from deep_programs import COMMANDS, RECORDED, SIZE, VIEW, make, operate, pair

import pyvista_vdi as pvdi
from pyvista_vdi import cli
from pyvista_vdi.errors import MissingDependencyError, VDIFileError, VDIWarning
from pyvista_vdi.extensions.deep_exr.layout import OtherFormError
from pyvista_vdi.extensions.deep_exr.linear_light import to_display, to_linear

A, B = pair()

#: Half the spacing of float32 at 1: what one rounding costs, relative to the value.
ROUNDING = 2.0**-24


def recorded(name):
    return RECORDED / f"oiiotool_{name}.exr"


def read(name, warning=None, **options):
    """Read a recorded file, with exactly the warning that is expected."""
    with warnings.catch_warnings(record=True) as given:
        warnings.simplefilter("always")
        vdi = pvdi.read(recorded(name), **options)
    assert [str(w.message) for w in given if warning is None or warning not in str(w.message)] == []
    assert len(given) == (warning is not None)
    assert all(w.category is VDIWarning for w in given)
    return vdi


def depths(vdi):
    """Absolute view depths of fronts and backs."""
    return np.stack([vdi.front, vdi.back]).astype(float) + vdi.depth_origin


def alphas(vdi):
    return -np.expm1(-vdi.optical_depth.astype(float))


def near_depths(vdi, expected, lost=ROUNDING):
    return np.allclose(depths(vdi), expected, rtol=2 * lost, atol=1e-7)


@pytest.mark.parametrize(
    "name",
    [n if n == "merged" else pytest.param(n, marks=pytest.mark.slow) for n in sorted(COMMANDS)],
)
def test_oiiotool_makes_what_is_recorded(name, tmp_path):
    program = shutil.which("oiiotool")
    if program is None:
        pytest.skip("oiiotool is not installed")
    try:
        old = read_deep(recorded(name))
    except (OtherFormError, VDIFileError):  # of tiles, parts and flat images the header says
        old = None
    made = make(name, tmp_path, program)
    if old is None:
        assert abs(made.stat().st_size - recorded(name).stat().st_size) < 100  # time and version
        return
    new = read_deep(made)
    assert (new.data_window, new.display_window) == (old.data_window, old.display_window)
    assert np.array_equal(new.counts, old.counts)
    assert new.channel_types == old.channel_types
    for channel, array in old.channels.items():
        assert np.allclose(new.channels[channel], array, rtol=1e-5, atol=1e-7), channel


@pytest.mark.parametrize("name", ["rewritten", "run_lengths", "upwards", "no_matrices"])
def test_rewritten_files_give_back_every_bit(name):
    """Though oiiotool made floats of the corrections, k / (2**32 - 1)."""
    assert read_deep(recorded(name)).channels["bits.back"].dtype == "f4"
    vdi = read(name)
    assert vdi.equals(A)
    assert vdi.metadata == A.metadata


def test_tiles_and_larger_display_windows_change_no_bit():
    assert read("canvas").equals(A)
    pytest.importorskip("OpenEXR")
    assert read("tiled").equals(A)


def test_of_several_deep_parts_the_first_is_read_and_the_others_are_named():
    pytest.importorskip("OpenEXR")
    assert read("parts", "has 2 deep parts, of which the first is read").equals(A)


def test_corrections_too_large_for_floats_fall_back(tmp_path):
    """Where front is tiny and the origin large, the correction has all 32 bits."""
    front = np.array([0x0DA24261], np.uint32).view(np.float32)  # 1e-30; no bit of it is 0 by chance
    arrays = ([0, 1], front, [2.0], np.ones((1, 3)), [1])
    vdi = pvdi.VDI(VIEW, (1, 1), *arrays, A.bounds, depth_origin=5.0)
    path = vdi.save(tmp_path / "a.exr")
    channels = read_deep(path).channels
    assert channels["bits.front"][0] > 2**24
    bits = {n: a / (2.0**32 - 1) for n, a in channels.items() if n.startswith("bits.")}
    change(path, **{name: array.astype(np.float32) for name, array in bits.items()})
    with pytest.warns(VDIWarning, match=r"wrote it \(bits.front\): its standard channels"):
        back = pvdi.read(path)
    assert near_depths(back, [[5.0], [7.0]])
    assert (back.bounds, back.metadata) == (vdi.bounds, vdi.metadata)


def check_shows_both(vdi, view, vdis, size, most):
    """Hold pictures of a merged VDI against those of its two in one scene."""
    truth = pvdi.render(vdis, view, size)
    assert np.abs(pvdi.render(vdi, view, size) - truth).max() < most
    assert truth.max() > 0.3  # something is there


#: A is rounded to float32 when it is written and again when a sample is split. At tau = 12 that
#: moves tau by 2**-24 exp(12) = .0097 each time; over a part x of its length that is
#: .0097 x exp(-12 x) of the opacity, at most .0097 / 12 e = 3e-4. Elsewhere it is far less.
ROUNDED_TWICE = 6e-4


@pytest.mark.parametrize(
    ("name", "warning"),
    [("merged", r"wrote it (the number of samples): its"), ("merged_standard", None)],
)
def test_merged_files_show_both(name, warning, default_runtime):
    vdi = read(name, warning)
    low, high = np.minimum(A.bounds, B.bounds)[::2], np.maximum(A.bounds, B.bounds)[1::2]
    assert np.allclose(vdi.bounds[::2], low, atol=1e-5)  # float32 depths
    assert np.allclose(vdi.bounds[1::2], high, atol=1e-5)
    assert vdi.metadata == {"read_from": f"oiiotool_{name}.exr"}
    for angle in (0, 15, -40, 90):
        most = ROUNDED_TWICE if angle else 1e-5
        check_shows_both(vdi, VIEW.azimuth(angle), [A, B], (80, 60), most)
    right = pvdi.render(B, VIEW, SIZE)[..., 3] > 0  # what the first file's box cut away
    assert (pvdi.render(vdi, VIEW, SIZE)[..., 3] > 0)[right].all()


def test_a_merged_file_flattened_by_oiiotool_is_the_picture(tmp_path, default_runtime):
    openexr = pytest.importorskip("OpenEXR")
    flat = openexr.File(str(recorded("merged_flat"))).channels()["RGBA"].pixels
    vdi = read("merged", "the number of samples")
    assert np.abs(pvdi.render(vdi, VIEW, SIZE) - flat).max() < 1e-5
    assert np.abs(pvdi.render([A, B], VIEW, SIZE) - flat).max() < 1e-5
    with pytest.warns(VDIWarning, match="the number of samples"):
        assert cli.main(["render", str(recorded("merged")), "-o", str(tmp_path / "a.png")]) == 0
    assert (tmp_path / "a.png").stat().st_size > 0


def test_samples_that_were_only_gathered(tmp_path, default_runtime):
    """As Nuke's DeepMerge leaves them: unsorted and overlapping."""
    images = [read_deep(vdi.save(tmp_path / "a.exr", exact=False)) for vdi in (B, A)]
    counts = sum(image.counts for image in images)
    pixel = [np.repeat(np.arange(counts.size), image.counts.ravel()) for image in images]
    order = np.argsort(np.concatenate(pixel), kind="stable")
    channels = {
        name: np.concatenate([image.channels[name] for image in images])[order]
        for name in images[0].channels
    }
    matrices = {name: images[0].attributes[name].T for name in MATRICES}
    vdi = pvdi.read(write_deep(tmp_path / "gathered.exr", counts, channels, matrices))
    assert vdi.n_supersegments > A.n_supersegments + B.n_supersegments  # taken apart at every face
    for angle, most in ((0, 1e-5), (25, ROUNDED_TWICE)):
        check_shows_both(vdi, VIEW.azimuth(angle), [A, B], (80, 60), most)


def test_volumes_merged_by_oiiotool(tmp_path, default_runtime):
    """Two volumes that overlap, with all their supersegments."""
    program, openexr = shutil.which("oiiotool"), pytest.importorskip("OpenEXR")
    if program is None:
        pytest.skip("oiiotool is not installed")
    ramp, vdis = np.linspace(0, 1, 256), []
    view = pvdi.Camera((-0.5, -4, 1), (-0.5, 0, 0.2), (0, 0, 1))
    for letter, origin, color in (
        ("a", (-1.2, -0.5, -0.5), ramp),
        ("b", (-0.9, -0.3, 0), 1 - ramp),
    ):
        r = np.linalg.norm(np.mgrid[:16, :16, :16] / 7.5 - 1, axis=0)
        volume = pvdi.Volume(np.clip(1 - r, 0, 1), spacing=(1 / 15,) * 3, origin=origin)
        looks = pvdi.TransferFunction(
            np.stack([color, ramp, 1 - color], axis=1), 0.3 * ramp, (0, 1), unit_distance=1 / 15
        )
        vdis.append(pvdi.generate(volume, view, (64, 48), transfer_function=looks))
        vdis[-1].save(tmp_path / f"{letter}.exr")
    merged = operate("a.exr b.exr --deepmerge", tmp_path, program, "m.exr")
    flat = operate("m.exr --flatten --ch R,G,B,A -d float", tmp_path, program, "flat.exr")
    with pytest.warns(VDIWarning, match="the number of samples"):
        vdi = pvdi.read(merged)
    pixels = openexr.File(str(flat)).channels()["RGBA"].pixels
    assert np.abs(pvdi.render(vdis, view, (64, 48)) - pixels).max() < 1e-5
    for angle in (0, 20, 90):
        # Boxes of lists are wider than those of volumes, by less than a list, where both are thin
        check_shows_both(vdi, view.azimuth(angle), vdis, (64, 48), 1e-4)


def test_half_floats():
    vdi = read("half", "wrote it (A, B, G, R, Z, ZBack): its")
    assert near_depths(vdi, depths(A), lost=2.0**-11)
    assert np.allclose(alphas(vdi), alphas(A), rtol=2.0**-11, atol=0)
    assert np.allclose(vdi.color, A.color, atol=2.0**-9)
    assert vdi.bounds != A.bounds  # they hold the samples as they are now


def test_cropped_files_keep_their_pixels():
    vdi = read("cropped", "wrote it (the number of samples): its")
    expected = np.zeros_like(A.counts)
    expected[1:4, 1:4] = A.counts[1:4, 1:4]  # 4 rows from the top's third one on; lists 1 to 4
    assert np.array_equal(vdi.counts, expected)
    assert vdi.camera == A.camera
    kept = np.concatenate([np.r_[A.list_at(x, y)] for y in range(1, 4) for x in range(1, 4)])
    assert near_depths(vdi, depths(A)[:, kept])
    assert np.allclose(vdi.color, A.color[kept], atol=1e-6)


@pytest.mark.parametrize("name", ["faded", "faded_standard"])
def test_faded_files_are_thinner(name):
    vdi = read(name, None if "standard" in name else "wrote it (A, B, G, R): its")
    assert np.allclose(alphas(vdi), alphas(A) / 2, rtol=1e-6)
    assert np.allclose(vdi.color, A.color, atol=1e-6)
    assert vdi.bounds == A.bounds
    assert vdi.metadata == {"read_from": f"oiiotool_{name}.exr"}


def test_colours_that_were_changed():
    darkened = read("darkened", "wrote it (B, G, R): its")
    assert np.allclose(darkened.color, A.color / 2, atol=1e-6)
    swapped = read("swapped", "wrote it (B, R): its")
    assert np.allclose(swapped.color, A.color[:, ::-1], atol=1e-6)
    # tau is as it was, and says more than A does
    for vdi in (darkened, swapped):
        assert vdi.optical_depth.tobytes() == A.optical_depth.tobytes()


def test_depths_that_were_changed_have_other_bounds():
    vdi = read("deeper")
    assert near_depths(vdi, depths(A) + 2)
    assert vdi.bounds[4] == pytest.approx(VIEW.position[2] - (depths(A).max() + 2), abs=0.1)
    assert vdi.bounds != A.bounds


def test_without_our_channels_or_our_attribute():
    plain = read("plain", "(tau, bits.red, bits.green, bits.blue, bits.front, bits.back): its")
    assert (plain.bounds, plain.metadata, plain.camera) == (A.bounds, A.metadata, A.camera)
    assert near_depths(plain, depths(A))
    vdi = read("no_record")
    assert vdi.metadata == {"read_from": "oiiotool_no_record.exr"}
    assert near_depths(vdi, depths(A))
    assert np.allclose(vdi.bounds, A.bounds, atol=1e-5)
    assert vdi.optical_depth.tobytes() == A.optical_depth.tobytes()


def test_another_view_in_the_header_counts(tmp_path):
    """A program that knows of matrices, and not of our attribute, moved the camera."""
    path = A.save(tmp_path / "a.exr")
    moved = VIEW.replace(position=(3.5, -0.25, 4), focal_point=(3.5, 0, -1))
    change(path, **matrices_of(moved, SIZE))
    with pytest.warns(VDIWarning, match=r"wrote it \(its matrices\): its"):
        vdi = pvdi.read(path)
    assert np.allclose(vdi.camera.position, moved.position, atol=1e-5)
    assert np.allclose(np.subtract(vdi.bounds, A.bounds)[:2], 3, atol=1e-4)


@pytest.mark.parametrize("channel", ["A", "R", "Z", "ZBack", "tau", "bits.red", "bits.back"])
def test_a_channel_that_was_changed_by_one_bit_is_noticed(channel, tmp_path):
    path = A.save(tmp_path / "a.exr")
    array = read_deep(path).channels[channel].copy()
    array.view(np.uint32)[7] += 1
    change(path, **{channel: array})
    said = rf"was changed after pyvista-vdi wrote it \({channel}\): its standard channels"
    with pytest.warns(VDIWarning, match=said):
        vdi = pvdi.read(path)
    assert near_depths(vdi, depths(A))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("cut", "was cut or resized after .* its display window is 4 x 3, .* of 8 x 6 lists; give"),
        ("resized", "was cut or resized after .* display window is 16 x 12, .* of 8 x 6 lists"),
        ("moved", r"was moved .* data window begins at \(2, 1\), its display window at \(0, 0\)"),
        ("no_back", "60 samples without a thickness"),
        ("renamed", r"has left\.A.*take those of its layer left: oiiotool in\.exr --ch A=left\.A,"),
        ("flat", "a flat image"),
    ],
)
def test_what_is_refused_says_why(name, message):
    with pytest.raises(VDIFileError, match=message):
        pvdi.read(recorded(name))


def test_the_remedies_help(tmp_path):
    resized = read("resized", camera=VIEW)
    assert resized.window_size == (16, 12)
    assert np.array_equal(resized.counts[::2, ::2], A.counts)
    assert read("cut", camera=VIEW).window_size == (4, 3)
    assert read("no_back", thickness=0.1).n_supersegments == A.n_supersegments
    program = shutil.which("oiiotool")
    if program is not None:
        shutil.copyfile(recorded("renamed"), tmp_path / "in.exr")
        names = "A=left.A,B=left.B,G=left.G,R=left.R,Z=left.Z,ZBack=left.ZBack"
        vdi = pvdi.read(operate(f"in.exr --ch {names}", tmp_path, program, "out.exr"))
        assert near_depths(vdi, depths(A))


def test_depths_in_half_floats_and_colours_in_whole_numbers(tmp_path):
    path = A.save(tmp_path / "a.exr", exact=False)
    channels = read_deep(path).channels
    change(path, **{n: (channels[n] + 4000).astype(np.float16) for n in ("Z", "ZBack")})
    with pytest.raises(VDIFileError, match="depths are half floats, too coarse .* Z as float"):
        pvdi.read(path)
    A.save(path, exact=False)
    change(path, G=np.ones(A.n_supersegments, np.uint32))
    with pytest.raises(VDIFileError, match="its channel G is of type uint32, and must be float32"):
        pvdi.read(path)


def test_files_of_version_1_are_read():
    vdi = pvdi.read(RECORDED / "version_1.exr")
    assert vdi.metadata == {"name": "version 1"}
    assert vdi.front.tolist() == np.array([0.3, 1.7, 2.1, 0.1, 9], "f4").tolist()
    assert vdi.optical_depth.tolist() == np.array([0.5, 3, 20, 1e-3, 0.7], "f4").tolist()
    assert vdi.color.ravel().tolist() == np.linspace(0, 1, 15).astype("f4").tolist()
    plain = pvdi.read(RECORDED / "version_1_standard.exr")
    assert np.allclose(plain.front + plain.depth_origin, vdi.front + vdi.depth_origin)
    assert plain.metadata == {"read_from": "version_1_standard.exr"}  # nothing vouches for it


def test_srgbs_curve():
    """IEC 61966-2-1, in float64 with NumPy's power."""
    light = np.concatenate([np.linspace(0, 1.3, 20001), [0.0031308, 0.0031309]])
    shown = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    assert np.abs(to_display(light) - shown).max() < 2.0**-49  # some roundings of values below 1.2
    within = light <= 1
    # The standard's two parts do not quite meet, 3e-8 apart at the knee
    assert np.abs(to_linear(shown[within]) - light[within]).max() < 4e-9


def test_linear_files_give_back_every_bit(tmp_path):
    path = A.save(tmp_path / "a.exr", linear=True)
    assert pvdi.read(path).equals(A)
    image = read_deep(path)
    light = image.channels["R"] / image.channels["A"].astype(float)
    color = A.color[:, 0].astype(float)
    assert np.allclose(light, ((color + 0.055) / 1.055) ** 2.4, atol=1e-6) or color.min() < 0.04045
    assert "lin_rec709_scene" in str(image.attributes["colorInteropID"])
    assert b"chromaticities" in path.read_bytes()
    # Corrections are as small as in display-referred files
    assert max(image.channels[f"bits.{n}"].max() for n in ("red", "green", "blue")) < 64


def test_linear_standard_channels(tmp_path):
    path = A.save(tmp_path / "a.exr", exact=False, linear=True)
    assert np.abs(pvdi.read(path).color - A.color).max() < 1e-6
    raw = pvdi.read(path, linear=False)
    assert np.allclose(to_display(raw.color), A.color, atol=1e-6)
    plain = B.save(tmp_path / "b.exr", exact=False)
    assert np.allclose(pvdi.read(plain, linear=True).color, to_display(B.color), atol=1e-6)


def test_linear_files_that_were_merged():
    """Colours of one place are averaged as light; elsewhere they are the VDIs' own."""
    vdi = read("linear_merged", "the number of samples")
    alone = np.concatenate([np.r_[A.list_at(x, y)] for y in range(1, 5) for x in range(3)])
    found = np.concatenate([np.r_[vdi.list_at(x, y)] for y in range(1, 5) for x in range(3)])
    assert np.abs(vdi.color[found] - A.color[alone]).max() < 1e-6


def test_linear_in_the_command_line(tmp_path, capsys):
    first = A.save(tmp_path / "a.vdi")
    there, back = tmp_path / "b.exr", tmp_path / "c.vdi"
    assert cli.main(["convert", str(first), "-o", str(there), "--linear"]) == 0
    channels = read_deep(there).channels
    assert np.allclose(channels["G"], to_linear(A.color[:, 1]) * alphas(A), rtol=1e-6, atol=1e-7)
    assert cli.main(["convert", str(there), "-o", str(back)]) == 0
    assert pvdi.read(back).equals(A)
    capsys.readouterr()
    theirs = A.save(tmp_path / "d.exr", exact=False)
    assert cli.main(["convert", str(theirs), "-o", str(back), "--from-linear"]) == 0
    assert np.allclose(pvdi.read(back).color, to_display(A.color), atol=1e-6)
    capsys.readouterr()
    assert cli.main(["convert", str(first), "-o", str(back), "--linear"]) == 1
    assert "--linear is for .exr, not " in capsys.readouterr().err


def test_without_openexr_other_forms_say_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    with pytest.raises(MissingDependencyError, match="is stored in tiles"):
        pvdi.read(recorded("tiled"))
