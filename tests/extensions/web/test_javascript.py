"""What of the viewer needs no browser, by Node where that is installed."""

import os
import shutil
import subprocess
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from in_node import in_node

HERE = Path(__file__).parent / "javascript"
VIEWER = resources.files("pyvista_vdi.extensions.web") / "viewer"


def test_units():
    node = shutil.which("node")
    if node is None:
        pytest.skip("needs node in the path, 20 or newer")
    done = subprocess.run(
        [node, "--test"],
        cwd=HERE,
        env={**os.environ, "PYVISTA_VDI_VIEWER": str(VIEWER)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


#: What is done by which button, with which keys, and how far.
DRAGS = {
    "rotate": ("Left", {}, (37, -21)),
    "pan": ("Left", {"shift": 1}, (-30, 14)),
    "spin": ("Left", {"control": 1}, (25, 9)),
    "dolly": ("Right", {}, (3, 17)),
}


@pytest.mark.gl
@pytest.mark.parametrize("parallel", [False, True])
def test_drags_are_those_of_vtks_trackball_camera(parallel):
    """By VTK's own style, with its own events, in a window of the same size."""
    plotter = pv.Plotter(off_screen=True, window_size=(300, 200))
    plotter.enable_trackball_style()
    plotter.show(auto_close=False)
    interactor, camera = plotter.iren.interactor, plotter.camera
    interactor.EnableRenderOff()
    interactor.GetInteractorStyle().SetAutoAdjustCameraClippingRange(0)
    camera.SetPosition(1, 2, 5)
    camera.SetFocalPoint(0.5, 0.1, 0)
    camera.SetViewUp(0.1, 1, 0.2)
    camera.SetViewAngle(33)
    camera.SetParallelScale(1.5)
    camera.SetParallelProjection(parallel)
    camera.OrthogonalizeViewUp()
    lens = "ParallelScale" if parallel else "ViewAngle"
    names = {"position": "Position", "focal_point": "FocalPoint", "view_up": "ViewUp"}
    names["parallel_scale" if parallel else "view_angle"] = lens

    def state():
        return {name: getattr(camera, f"Get{theirs}")() for name, theirs in names.items()}

    given, expected = [], []
    for what, (button, keys, (dx, dy)) in DRAGS.items():
        at, before = (140, 120), state()
        to = (at[0] + dx, at[1] + dy)
        given.append([what, before, at, to, [300, 200]])
        for event, place in (("ButtonPress", at), ("MouseMove", to), ("ButtonRelease", to)):
            interactor.SetEventInformation(*place, keys.get("control", 0), keys.get("shift", 0))
            interactor.InvokeEvent(f"{'' if event == 'MouseMove' else button}{event}Event")
        expected.append(state())
        assert any(not np.allclose(expected[-1][k], before[k], atol=1e-3) for k in before), what
    plotter.close()
    script = """async (...drags) => {
      const { dragged } = await from("interaction.js");
      return drags.map((drag) => dragged(...drag));
    }"""
    for after, wanted, what in zip(in_node(script, *given), expected, DRAGS, strict=True):
        for name, value in wanted.items():
            # VTK goes through the focal point's depth in the window, in float64
            np.testing.assert_allclose(after[name], value, atol=1e-6, err_msg=what)
