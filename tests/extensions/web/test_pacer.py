"""What keeps a page's frame rate, with a device and a clock of its own: nothing here takes time."""

import pytest

#: What a Pacer asks of WebGL; each wait takes as long as ``cost`` says, of the rows that are drawn.
DEVICE = """async (frames) => {
  const { Pacer } = await import("./pacer.js");
  let now = 0, rows = 0;
  const bands = [], real = performance.now;
  const gl = {
    SIGNALED: 1, scissor(x, y, width, height) { rows = height; }, isContextLost: () => false,
    clientWaitSync() { now += 1000 * cost(rows); bands.push(rows); return this.SIGNALED; },
  };
  for (const name of ["bindFramebuffer", "enable", "disable", "clearColor", "clear", "fenceSync",
    "flush", "deleteSync"]) gl[name] = () => {};
  let cost;
  const drawn = [], pacer = new Pacer(gl);
  performance.now = () => now;
  try {
    for (const [width, height, compiling, perRow] of frames) {
      let compiled = compiling;
      cost = (high) => { const took = compiled + perRow * high; compiled = 0; return took; };
      bands.length = 0;
      await pacer.inBands({}, width, height, () => {});
      drawn.push({ bands: [...bands], next: pacer.sizeFor(1280, 720) });
    }
  } finally {
    performance.now = real;
  }
  return drawn;
}"""


@pytest.fixture
def draw(open_page):
    """Draw frames of (width, height, seconds before the first row, seconds of a row)."""
    page = open_page()
    return lambda *frames: page.evaluate(DEVICE, list(frames))


def test_a_compiler_s_time_is_no_frame_s(draw):
    """The first frame, of few pixels, waited for one: the full frame is in few bands all the same,
    and the movement after it has all pixels.
    """
    few, full = draw((320, 180, 1.0, 1e-6), (1280, 720, 0.0, 4e-6))
    assert few["bands"] == [180]
    assert sum(full["bands"]) == 720
    assert len(full["bands"]) <= 6  # from one row on, four times as many each time
    assert full["next"] == [1280, 720]


def test_bands_are_as_high_as_a_movement_may_wait_for(draw):
    """50 ms, whatever the frame before took: here 5 ms and then 0.5 ms for a row."""
    _, slow, fast = draw((320, 180, 0, 0.005), (320, 180, 0, 0.005), (320, 180, 0, 0.0005))
    assert slow["bands"] == [10] * 18
    assert fast["bands"][:2] == [10, 40]  # no more than four times as high as the one before
    assert max(fast["bands"]) <= 100
    assert sum(fast["bands"]) == 180


def test_a_device_that_has_become_slower_is_given_less_at_once(draw):
    _, full = draw((1280, 720, 0, 1e-5), (1280, 720, 0, 0.02))
    assert full["bands"][0] == 720  # nothing said that it had
    _, _, full = draw((320, 180, 0, 5e-4), (320, 180, 0, 5e-3), (320, 180, 0, 5e-3))
    assert max(full["bands"]) <= 18  # the mean of both
    assert full["bands"][-2] == 10
