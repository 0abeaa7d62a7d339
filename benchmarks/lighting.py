"""Shaded VDIs from turned views: the light baked in, lit anew from normals, or made anew.

The light is PyVista's light kit, which follows the camera; the judge is VTK's GPU mapper, which
lights every sample of every frame. Writes ``lighting_LOOK_WxH.json`` and ``.md``.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from typing import Any

import numpy as np
from common import (  # beside this file
    add_looks,
    add_redo,
    add_size,
    add_volumes,
    at_hand,
    new_parser,
    results_file,
    save,
    subject_of,
)
from numpy.typing import NDArray
from tqdm import tqdm
from vtkmodules.vtkRenderingCore import vtkLightKit

from pyvista_vdi.api import render, render_volume
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.measure.report import table, write_text
from pyvista_vdi.measure.vtk_baselines import VTKBaseline
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.lighting import Light, Lights, Shading
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.plotting.classify import Looks
from pyvista_vdi.quality.when_anew import REGENERATE_BELOW
from pyvista_vdi.reference.generate import medium_at
from pyvista_vdi.reference.shading import lit_colors

Array = NDArray[Any]

VOLUMES = ("brain", "rayleigh_taylor", "tooth", "bonsai", "iguana_head")
ANGLES = (0.0, 5.0, 15.0, 30.0, 60.0, 90.0)

#: ``add_volume``'s defaults, and those with VTK's own highlight.
SHADINGS = {"matt": Shading(0.0, 1.0, 0.0, 1.0), "shiny": Shading(0.0, 1.0, 0.3, 15.0)}

#: Samples within a supersegment that its normal is the mean of, and supersegments at a time.
SAMPLES, CHUNK = 6, 100_000

LEGEND = """\
SSIM, and PSNR in dB, to VTK's GPU mapper, which lights each frame anew. Baked: the VDI of V_O as it
is. Axis: its colours lit anew from one axis for each supersegment, in 2 bytes; the light then over
the light at V_O multiplies them. Normal: lit from the mean colour and the mean normal with its
length, in 4 bytes. Ideal: each sample lit by the turned view's lights, then merged into V_O's
lists, which no normal can beat (without highlights, whose eye would be V_O's). Made anew: a VDI of
the view itself. Unlit: an unshaded VDI to an unshaded volume in VTK, what the lists lose by
themselves. Auto: what `regenerate="auto"` shows on screen."""

WAYS = ("baked", "axis", "normal", "ideal", "made anew", "unlit")


def main() -> int:
    """Measure, and write what was found."""
    parser = new_parser(__doc__)
    add_size(parser, (480, 270))
    add_volumes(parser, VOLUMES)
    add_looks(parser, interpolation=None, max_supersegments=None, tf="steep")
    add_redo(parser)
    parser.add_argument("--pictures", action="store_true", help="write them beside the results")
    parser.set_defaults(interpolation="linear")
    options = parser.parse_args()
    target = results_file(f"lighting_{options.tf}", options)
    results: dict[str, Any] = {"window_size": list(options.size), "look": options.tf, "rows": []}
    if target.exists() and not options.redo:
        results = json.loads(target.read_text())
    done = {(row["volume"], row["shading"]) for row in results["rows"]}
    cases = [
        (name, kind)
        for name in at_hand(options.volumes)
        for kind in SHADINGS
        if (kind == "matt" or name == VOLUMES[0]) and (name, kind) not in done
    ]
    for name, kind in tqdm(cases, unit="case"):
        results["rows"] += measured(name, kind, options)
        save(results, target)
        write_text(target.with_suffix(".md"), "\n".join([*described(results), ""]))
    return 0


def measured(name: str, kind: str, options: argparse.Namespace) -> list[dict[str, Any]]:
    """Return a row for each angle."""
    volume, classified, view = subject_of(name, options, options.tf)
    shaded = classified.replace(shading=SHADINGS[kind])
    step = min(volume.spacing) / 2
    vtk = {
        lit: VTKBaseline(volume, prop(volume, options.tf, kind, lit), options.size, "gpu", step)
        for lit in (True, False)
    }
    vtkLightKit().AddLightsToRenderer(vtk[True].renderer)
    lights = Lights.from_any(vtk[True].renderer)
    vdi = generate_vdi(volume, view, options.size, shaded, lights=lights)
    plain = generate_vdi(volume, view, options.size, classified)
    relit = Relit(volume, classified, vdi, SHADINGS[kind], lights)
    rows = []
    for angle in ANGLES:
        turned = view.azimuth(angle)
        judge, unlit = vtk[True].image(turned), vtk[False].image(turned)
        own = render_volume(volume, turned, options.size, transfer_function=shaded, lights=lights)
        vdis = {
            "baked": vdi,
            "axis": relit.by_axis(turned),
            "normal": relit.by_normal(turned),
            "made anew": generate_vdi(volume, turned, options.size, shaded, lights=lights),
        }
        if kind == "matt":
            fixed = in_scene(lights, turned)
            vdis["ideal"] = generate_vdi(volume, view, options.size, shaded, lights=fixed)
        pictures = {way: render(each, turned) for way, each in vdis.items()}
        found = {way: compared(picture, judge) for way, picture in pictures.items()}
        found["unlit"] = compared(render(plain, turned), unlit)
        to_own = compare_images(pictures["baked"], own).ssim
        row = {"volume": name, "shading": kind, "angle": angle, "to_own": to_own, **found}
        rows.append(row)
        if options.pictures:
            keep(options, f"{name}_{kind}_{angle:g}", {**pictures, "vtk": judge})
    for each in vtk.values():
        each.close()
    return rows


class Relit:
    """What a VDI's supersegments would keep besides, found again in the volume, and its use.

    Each has samples of equal distance along its list's centre ray, weighted by what V_O sees of
    them, as the colours of merged samples are.
    """

    def __init__(
        self,
        volume: Volume,
        classified: TransferFunction,
        vdi: VDI,
        shading: Shading,
        lights: Lights,
    ) -> None:
        self.vdi, self.volume, self.shading, self.lights = vdi, volume, shading, lights
        count = vdi.n_supersegments
        self.albedo, self.mean = np.zeros((count, 3)), np.zeros((count, 3))
        self.axis, self.middle = np.zeros((count, 3)), np.zeros((count, 3))
        list_of = np.repeat(np.arange(vdi.counts.size), vdi.counts.ravel())
        for begin in range(0, count, CHUNK):
            part = slice(begin, begin + CHUNK)
            self._look(part, list_of[part], classified)
        self.axis = octahedral(self.axis, 8)
        size = np.linalg.norm(self.mean, axis=1, keepdims=True)
        self.mean = octahedral(self.mean, 12) * np.round(size * 255) / 255

    def _look(self, part: slice, list_of: Array, classified: TransferFunction) -> None:
        vdi, volume = self.vdi, self.volume
        front, back = (a[part].astype(np.float64) for a in (vdi.front, vdi.back))
        place = (np.arange(SAMPLES) + 0.5) / SAMPLES
        depth = vdi.depth_origin + front[:, None] + place * (back - front)[:, None]
        width, height = vdi.window_size
        half = np.array(vdi.camera.half_extent(vdi.window_size))
        pixel = np.stack([list_of % width, list_of // width], axis=1)
        across = ((pixel + 0.5) / (width, height) * 2 - 1) * half
        in_view = np.ones((*depth.shape, 4))
        in_view[..., :2] = across[:, None] * depth[..., None]
        in_view[..., 2] = depth
        to_index = np.linalg.inv(vdi.camera.model_to_view @ volume.index_to_model)
        index = (in_view.reshape(-1, 4) @ to_index.T)[:, :3]
        step = min(volume.spacing) / 2
        color, tau = medium_at(volume, classified, index, np.full(len(index), step))
        scale = vdi.optical_depth[part, None] / SAMPLES  # of the mean, as its tau says
        tau = tau.reshape(depth.shape)
        tau = tau / np.maximum(tau.mean(axis=1, keepdims=True), 1e-30) * scale
        seen = -np.expm1(-tau) * np.exp(-(np.cumsum(tau, axis=1) - tau))
        weight = seen / np.maximum(seen.sum(axis=1, keepdims=True), 1e-30)
        normal = unit(differences(volume, index) @ np.linalg.inv(volume.index_to_model[:3, :3]))
        normal = normal.reshape(*depth.shape, 3)
        self.albedo[part] = np.einsum("ns,nsc->nc", weight, color.reshape(*depth.shape, 3))
        self.mean[part] = np.einsum("ns,nsc->nc", weight, normal)
        tensor = np.einsum("ns,nsa,nsb->nab", weight, normal, normal)
        self.axis[part] = np.linalg.eigh(tensor)[1][..., 2]
        self.middle[part] = index.reshape(*depth.shape, 3).mean(axis=1)

    def by_axis(self, camera: Camera) -> VDI:
        """Return the VDI with its colours times the light of a view over that of V_O."""
        diffuse, specular = self._light(self.vdi.camera, self.axis)
        now, shine = self._light(camera, self.axis)
        color = self.vdi.color.astype(np.float64)
        lost = np.minimum(specular, color)
        ratio = now / np.maximum(diffuse, 0.05)
        return self._with((color - lost) * ratio + shine)

    def by_normal(self, camera: Camera) -> VDI:
        """Return the VDI with its mean colours lit from the mean normals of a view."""
        diffuse, specular = self._light(camera, self.mean)
        size = np.linalg.norm(self.mean, axis=1, keepdims=True)
        return self._with(self.albedo * diffuse * size + specular * size)

    def _light(self, camera: Camera, normal: Array) -> tuple[Array, Array]:
        """Return what white reflects, and the highlights."""
        to_world = (camera.model_transform @ self.volume.index_to_model)[:3, :3]
        along = normal @ to_world  # differences that have this normal
        parts = []
        for grey in (0.5, 0.0):  # of 1 it might be clamped
            color = np.full((len(normal), 3), grey)
            parts.append(
                lit_colors(
                    self.volume, camera, self.shading, self.lights, self.middle, along, color
                )
            )
        return 2 * (parts[0] - parts[1]), parts[1]

    def _with(self, color: Array) -> VDI:
        vdi = self.vdi
        return VDI(
            vdi.camera,
            vdi.window_size,
            vdi.offsets,
            vdi.front,
            vdi.back,
            np.clip(color, 0, 1),
            vdi.optical_depth,
            vdi.bounds,
            depth_origin=vdi.depth_origin,
        )


def differences(volume: Volume, index: Array) -> Array:
    """Return trilinear differences of the scalar, voxel ahead less voxel behind, (n, 3)."""
    from scipy.ndimage import map_coordinates

    array, places = volume.array, index[:, ::-1].T
    out = np.empty((len(index), 3))
    for axis in range(3):
        shift = np.zeros((3, 1))
        shift[2 - axis] = 1
        ahead, behind = (
            map_coordinates(array, places + sign * shift, np.float32, order=1, mode="nearest")
            for sign in (1, -1)
        )
        out[:, axis] = ahead - behind
    return out


def unit(vectors: Array) -> Array:
    """Return unit vectors, and zeros where they are."""
    size = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, size, out=np.zeros_like(vectors), where=size > 0)


def octahedral(vectors: Array, bits: int) -> Array:
    """Return directions as two numbers of so many bits on an octahedron keep them."""
    scaled = vectors / np.maximum(np.abs(vectors).sum(axis=1, keepdims=True), 1e-30)
    x, y, z = scaled.T
    behind = z < 0
    u = np.where(behind, (1 - np.abs(y)) * np.where(x < 0, -1, 1), x)
    v = np.where(behind, (1 - np.abs(x)) * np.where(y < 0, -1, 1), y)
    top = 2 ** (bits - 1) - 1
    u, v = np.round(u * top) / top, np.round(v * top) / top
    z = 1 - np.abs(u) - np.abs(v)
    x = np.where(z < 0, (1 - np.abs(v)) * np.where(u < 0, -1, 1), u)
    y = np.where(z < 0, (1 - np.abs(u)) * np.where(v < 0, -1, 1), v)
    found = unit(np.stack([x, y, z], axis=1))
    return np.where(np.abs(vectors).sum(axis=1, keepdims=True) > 0, found, 0.0)


def prop(volume: Volume, look: str, kind: str, lit: bool) -> Any:
    """Return VTK's volume property."""
    distance = volume.default_unit_distance
    looks = Looks(
        interpolation="linear", opacity_unit_distance=distance, **TRANSFER_FUNCTIONS[look]
    )
    made = looks.volume_property(looks.lookup_table(volume.array), rgba=volume.rgba)
    shading = SHADINGS[kind]
    made.shade = lit
    made.ambient, made.diffuse = shading.ambient, shading.diffuse
    made.specular, made.specular_power = shading.specular, shading.specular_power
    return made


def in_scene(lights: Lights, camera: Camera) -> Lights:
    """Return directional lights that stay where a view has them."""
    fixed = []
    for light in lights.lights:
        _, travel = light.in_world(camera)
        colors = {"diffuse": light.diffuse, "specular": light.specular, "ambient": light.ambient}
        fixed.append(Light("scene", tuple(-travel), **colors, intensity=light.intensity))
    return Lights(tuple(fixed), lights.two_sided)


def compared(picture: Array, judge: Array) -> list[float]:
    """Return SSIM and PSNR."""
    found = compare_images(np.clip(picture[..., :3], 0, 1), judge)
    return [found.ssim, found.psnr]


def keep(options: argparse.Namespace, name: str, pictures: Mapping[str, Array]) -> None:
    """Write pictures in a row."""
    from PIL import Image

    row = np.concatenate([np.clip(each[..., :3], 0, 1) for each in pictures.values()], axis=1)
    Image.fromarray((row * 255).astype(np.uint8)).save(options.out / f"lighting_{name}.png")


def described(results: Mapping[str, Any]) -> list[str]:
    """Return the rows as Markdown."""
    width, height = results["window_size"]
    heads = ["volume", "shading", "angle", *WAYS, "auto"]
    rows = []
    for row in results["rows"]:
        cells = [row["volume"], row["shading"], f"{row['angle']:g}°"]
        for way in WAYS:
            cells.append(f"{row[way][0]:.3f}, {row[way][1]:.1f}" if way in row else "")
        anew = row["to_own"] < REGENERATE_BELOW
        rows.append([*cells, "made anew" if anew else "baked"])
    return [
        f"{width} x {height}, {results['look']}, linear, N_S 20, PyVista's light kit.",
        LEGEND,
        "",
        *table(heads, rows),
    ]


if __name__ == "__main__":
    sys.exit(main())
