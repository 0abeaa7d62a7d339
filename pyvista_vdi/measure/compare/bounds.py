"""What the standard cases must reach: the bounds of the project, and whether a report keeps them.

A bound applies to the standard cases (:mod:`pyvista_vdi.model.standard_cases`) with 20
supersegments in 1280 x 720; at other sizes it promises nothing.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from pyvista_vdi.measure.compare.measure import Report
from pyvista_vdi.model.metrics import Comparison

#: From V_O at the VDI's own size, against our volume raycaster at the same step.
SSIM_AT_GENERATING_VIEW = 0.999
WORST_PIXEL_AT_GENERATING_VIEW = 2.0  # in 1/255

#: SSIM from new views, by degrees from V_O and by standard transfer function.
SSIM_FROM_NEW_VIEWS: Mapping[tuple[float, str], float] = {
    (5.0, "soft"): 0.985,
    (5.0, "steep"): 0.985,
    (5.0, "nearly-opaque"): 0.975,
    (30.0, "soft"): 0.97,
    (30.0, "steep"): 0.97,
    (30.0, "nearly-opaque"): 0.95,
}

#: The same for a volume of two values that is solid everywhere, with every transfer function: its
#: rays cross more faces than a list has supersegments.
BINARY_SOLID = ("berea",)
SSIM_OF_BINARY_SOLID: Mapping[float, float] = {5.0: 0.94, 30.0: 0.85}

#: How far mean brightness from a new view may be from the raycaster's, as a share of it.
BRIGHTNESS_TOLERANCE = 0.02

#: Steps to a voxel at which two raycasters with samples at different places agree. Nearest
#: sampling of a volume with hard edges needs them: `aneurism` comes to 36.5 dB of VTK's GPU mapper
#: at 2, to 41.6 at 4 and to 47.3 at 8, and each is as far from itself at half the steps.
CONVERGED_STEPS = 8

#: Our raycaster against VTK's GPU mapper with the soft transfer function.
SSIM_TO_VTK = 0.99
PSNR_TO_VTK = 38.0  # dB

#: With the others it may be this many times as far from VTK's GPU mapper as VTK's own two mappers
#: are from each other; distances are 1 - SSIM and the root of the mean square.
FACTOR_OF_VTK = 1.5

#: Generation time over that of the full raycast at the same step.
GENERATION_RATIO = 1.5

#: Frame time at 5 degrees over that of the faster of VTK's mappers at steps of one voxel, for
#: volumes of at least this many voxels that are no binary solid.
FRAME_RATIO = 0.8
FRAME_RATIO_ANGLE = 5.0
FRAME_RATIO_VOXELS = 256**3


@dataclass(frozen=True)
class Check:
    """One figure beside its bound.

    ``sense`` says how the value must stand to the bound.
    """

    name: str
    value: float
    sense: Literal[">=", "<=", "<"]
    bound: float

    @property
    def passed(self) -> bool:
        """Whether the bound is kept; a value that is not a number does not keep it."""
        return {">=": operator.ge, "<=": operator.le, "<": operator.lt}[self.sense](
            self.value, self.bound
        )

    def __str__(self) -> str:
        verdict = "reached" if self.passed else "MISSED"
        return f"{self.name}: {self.value:.6g} {self.sense} {self.bound:.6g} {verdict}"


def judge_vdi(report: Report, volume: str, transfer_function: str) -> list[Check]:
    """Hold the VDI's pictures, against our volume raycaster's, to the bounds of a standard case.

    The case is named by keys of :data:`pyvista_vdi.examples.VOLUMES` and
    :data:`pyvista_vdi.model.standard_cases.TRANSFER_FUNCTIONS`. Returns the bounds that apply to
    what was measured; other angles have none.
    """
    checks = []
    for result in report.angles:
        found, at = result.vdi_to_raycaster, f"{result.angle:g} degrees"
        if result.angle == 0:
            worst = WORST_PIXEL_AT_GENERATING_VIEW
            checks.append(Check("SSIM at V_O", found.ssim, ">=", SSIM_AT_GENERATING_VIEW))
            checks.append(Check("worst pixel at V_O", found.worst_pixel, "<=", worst))
            continue
        bound = SSIM_FROM_NEW_VIEWS.get((result.angle, transfer_function))
        if volume in BINARY_SOLID:
            bound = SSIM_OF_BINARY_SOLID.get(result.angle)
        if bound is not None:
            away = abs(found.mean_brightness_ratio - 1)
            checks.append(Check(f"SSIM at {at}", found.ssim, ">=", bound))
            checks.append(Check(f"brightness error at {at}", away, "<=", BRIGHTNESS_TOLERANCE))
    return checks


def judge_vtk(report: Report, transfer_function: str) -> list[Check]:
    """Hold our volume raycaster to its bounds against VTK's GPU mapper, at every angle measured.

    They are meant for converged steps: :data:`CONVERGED_STEPS` a voxel where half a voxel is not
    enough. Arguments and result as of :func:`judge_vdi`; none without VTK.
    """
    checks = []
    for result in report.angles:
        ours, theirs = result.raycaster_to_gpu, result.fixed_point_to_gpu
        if ours is None or theirs is None:
            continue
        at = f"to VTK at {result.angle:g} degrees"
        if transfer_function == "soft":
            checks.append(Check(f"SSIM {at}", ours.ssim, ">=", SSIM_TO_VTK))
            checks.append(Check(f"PSNR {at}", ours.psnr, ">=", PSNR_TO_VTK))
            continue
        limit = FACTOR_OF_VTK * (1 - theirs.ssim)
        checks.append(Check(f"1 - SSIM {at}", 1 - ours.ssim, "<=", limit))
        limit = FACTOR_OF_VTK * _root_mean_square(theirs)
        checks.append(Check(f"RMS {at}", _root_mean_square(ours), "<=", limit))
    return checks


def judge_times(report: Report, volume: str) -> list[Check]:
    """Hold a report's times to the bounds; arguments and result as of :func:`judge_vdi`."""
    checks = []
    if report.generation_ratio is not None:
        bound = GENERATION_RATIO
        checks.append(Check("generation / raycast", report.generation_ratio, "<=", bound))
    if math.prod(report.case["dimensions"]) < FRAME_RATIO_VOXELS or volume in BINARY_SOLID:
        return checks
    for result in report.angles:
        if result.angle == FRAME_RATIO_ANGLE and result.ratio_to_vtk is not None:
            checks.append(Check("frame / VTK at 5 degrees", result.ratio_to_vtk, "<", FRAME_RATIO))
    return checks


def _root_mean_square(found: Comparison) -> float:
    return float(10 ** (-found.psnr / 20))
