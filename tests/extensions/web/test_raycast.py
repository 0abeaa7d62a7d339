"""The viewer's raycaster (WebGL 2) against the float64 oracle's range, and the kernels' pictures.

Pictures are read as float32. Against the oracle every channel lies within 2e-4, a twentieth of
1/255, of the range over the ray moved by rounding (tests/support/oracle.py). The kernels' 2e-5 are
not enough: GLSL promises no fused products, and its quotients may be off by 2.5 units in the last
place. 6.4e-5 were seen by SwiftShader, of a thin supersegment.
Against the kernels 99.9 % of pixels are within 2/255 and none is beyond 24/255.
"""

import numpy as np
import pytest
import strategies
from browsers import COUNTING, array_of, file_of, in_base64
from oracle import explain

import pyvista_vdi as pvdi
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI

#: See above.
TOLERANCE = 2e-4

PRECISIONS = ("exact", "8-byte")

SCRIPT = """
import { decodeVDI } from "./decode.js";
import { prepare } from "./prepare.js";
import { Raycaster } from "./raycast.js";

const gl = window.gl = document.createElement("canvas").getContext("webgl2");
gl.getExtension("EXT_color_buffer_float");
const raycaster = window.raycaster = new Raycaster(gl);

window.give = async (text) => raycaster.set(prepare(await decodeVDI(bytesOf(text))));

function texture(format, width, height) {
  const made = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, made);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
  gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
  return made;
}

window.picture = (camera, width, height, clippingPlanes, depth) => {
  const target = texture(gl.RGBA32F, width, height);
  let depthTexture = null;
  if (depth) {
    depthTexture = texture(gl.R32F, width, height);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, height, gl.RED, gl.FLOAT,
      new Float32Array(bytesOf(depth).buffer));
  }
  const framebuffer = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, target, 0);
  raycaster.draw({ camera, width, height, clippingPlanes, depthTexture });
  const seen = new Float32Array(4 * width * height);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.FLOAT, seen);
  gl.deleteFramebuffer(framebuffer);
  [target, depthTexture].filter(Boolean).forEach((made) => gl.deleteTexture(made));
  if (gl.getError()) throw new Error("WebGL complains");
  return textOf(new Uint8Array(seen.buffer));
};
"""


class Raycaster:
    """The page's raycaster."""

    def __init__(self, page):
        self.page = page

    def give(self, vdi):
        self.page.evaluate("(text) => give(text)", in_base64(file_of(vdi)))

    def draw(self, camera, size, *, clipping_planes=(), opaque_depth=None):
        """Premultiplied RGBA, float32 (H, W, 4), top row first."""
        planes = [
            {"origin": [float(x) for x in plane[:3]], "normal": [float(x) for x in plane[3:]]}
            for plane in clipping_planes
        ]
        depth = None if opaque_depth is None else in_base64(opaque_depth[::-1].tobytes())
        text = self.page.evaluate(
            "(given) => picture(...given)", [camera.to_dict(), *size, planes, depth]
        )
        return array_of(text, np.float32).reshape(size[1], size[0], 4)[::-1]


@pytest.fixture
def raycaster(open_page):
    """One that tests share."""
    return Raycaster(open_page(script=SCRIPT))


def check(raycaster, vdi, camera, size, name, **ends):
    raycaster.give(vdi)
    image = raycaster.draw(camera, size, **ends)
    result = explain(vdi, camera, size, image, name=name, tolerance=TOLERANCE, **ends)
    assert not result.failures, "\n".join(result.failures)
    return result


def random_case(seed, kind):
    rng = np.random.default_rng(seed)
    vdi = strategies.random_vdi(rng)
    return rng, vdi, *strategies.random_view(rng, vdi, kind)


IN_NUMBERS = pytest.param(range(3, 40), id="in numbers", marks=pytest.mark.slow)


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("cases", [pytest.param(range(3), id="some"), IN_NUMBERS])
def test_every_pixel_is_within_the_range_of_the_moved_ray(cases, precision, raycaster):
    moved = pixels = drawn = 0
    for number, kind in enumerate(strategies.VIEWS):
        for case in cases:
            _, vdi, camera, size = random_case([case, number], kind)
            name = f"seed {[case, number]}, view {kind!r}, {precision}"
            result = check(raycaster, vdi.with_precision(precision), camera, size, name)
            drawn += result.drawn
            if kind != "half":  # where every ray runs along borders
                moved += result.moved
                pixels += result.pixels
    assert drawn > pixels / 10
    assert moved <= 0.005 * pixels


@pytest.mark.parametrize(
    "cases", [range(6), pytest.param(range(6, 60), id="in numbers", marks=pytest.mark.slow)]
)
def test_rays_end_at_opaque_depth_and_clipping_planes(cases, raycaster):
    for case in cases:
        kind = ("around", "parallel", "near", "inside")[case % 4]
        rng, vdi, camera, size = random_case([case, 100], kind)
        near, far = strategies.view_depths(camera, vdi.bounds)
        depth = rng.uniform(near, far, size=size[::-1]).astype(np.float32)
        depth[rng.random(depth.shape) < 0.3] = np.inf
        corners = strategies.world_corners(vdi.bounds, camera.model_transform)
        points = rng.uniform(corners.min(axis=0), corners.max(axis=0), size=(2, 3))
        planes = np.hstack([points, rng.normal(size=(2, 3))])[: case % 3]
        ends = {"opaque_depth": depth, "clipping_planes": planes}
        check(raycaster, vdi, camera, size, f"seed {case}, view {kind!r}", **ends)


def test_a_vdi_of_one_list_and_one_of_none(raycaster):
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0))
    bounds = (-1, 1, -1, 1, -1, 1)
    one = VDI(camera, (1, 1), [0, 1], [4.5], [5.5], [[0.2, 0.5, 0.9]], [0.7], bounds)
    none = VDI(camera, (3, 2), [0] * 7, [], [], [], [], bounds)
    for precision in PRECISIONS:
        raycaster.give(none.with_precision(precision))
        assert not raycaster.draw(camera, (6, 4)).any()
        for turned in (camera, camera.azimuth(70), camera.azimuth(180)):
            check(raycaster, one.with_precision(precision), turned, (5, 4), "one list")


def layers(lists, most):
    """Long lists of thin layers in three clusters, in some stacks: slabs and stacks are empty."""
    rng = np.random.default_rng(7)
    parts = []
    for k in range(lists[0] * lists[1]):
        filled = (k % lists[0]) // 20 % 2 == 0 and k // lists[0] // 17 % 2 == 0
        count = rng.integers(1, most) if filled else 0
        cells = np.sort(rng.permutation(300)[:count])  # of 1e-3 each, in three clusters
        fronts = 0.3 + cells * 1e-3 + cells // 100 * 0.6
        parts.append(np.stack([fronts, fronts + 8e-4], axis=1))
    front, back = np.concatenate(parts).T
    offsets = np.concatenate([[0], np.cumsum([len(part) for part in parts])])
    n = len(front)
    return VDI(
        Camera((0, -6, 1), (0, 0, 0), (0, 0, 1), view_angle=20), lists, offsets, front, back,
        rng.random((n, 3)), 10 ** rng.uniform(-3, -1, size=n), (-1, 1, -1, 1, -1, 1),
        depth_origin=5.0,
    )  # fmt: skip


def test_long_lists_and_empty_space_between_them(raycaster):
    """Searches that halve, and stacks of slabs that are passed by.

    The layers are so thin that float32 has 1 / 1600 of their thickness for a depth: pictures are
    compared with the kernels', which are good to that, too.
    """
    vdi = layers((90, 60), 300)
    assert np.diff(vdi.offsets).max() > 200
    size = (48, 36)
    for precision, turn in (("exact", 200), ("8-byte", 90)):
        kept, camera = vdi.with_precision(precision), vdi.camera.azimuth(turn)
        raycaster.give(kept)
        wanted = pvdi.render(kept, camera, size)
        error = np.abs(raycaster.draw(camera, size) - wanted).max(axis=-1)
        assert np.mean(wanted[..., 3] > 0.1) > 0.02
        assert np.mean(error <= 2 / 255) >= 0.999, (precision, error.max())


def test_a_vdi_is_swapped_whole_and_nothing_is_left_behind(open_page):
    page = open_page(script=SCRIPT, before=COUNTING)
    raycaster, counts = Raycaster(page), []
    before = page.evaluate("alive.Texture")
    first, second = (random_case([k, 0], "around")[1] for k in range(2))
    for vdi in (first, second.with_precision("8-byte"), first):
        raycaster.give(vdi)
        counts.append(page.evaluate("alive.Texture") - before)
        raycaster.draw(vdi.camera, (3, 2))
    assert counts == [4, 3, 4]  # an exact VDI's faces and media are textures of their own
    assert page.evaluate("alive.Program") == 2
    with pytest.raises(Exception, match="MAX_TEXTURE_SIZE is .* fewer lists"):
        page.evaluate("raycaster.set({ ...raycaster.vdi, windowSize: [1e6, 1] })")
    page.evaluate("() => raycaster.dispose()")
    assert page.evaluate("alive.Texture") == before
