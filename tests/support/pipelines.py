"""One pipeline drawn by VTK's GPU mapper, and by VDISource, VDIMapper and VDIActor."""

from __future__ import annotations

import numpy as np

import pyvista_vdi as pvdi
from pyvista_vdi import compare_images
from pyvista_vdi.vtk_pipeline.vtk import (
    VTKPythonAlgorithmBase,
    numpy_to_vtk,
    vtk_to_numpy,
    vtkColorTransferFunction,
    vtkDataObject,
    vtkImageData,
    vtkOpenGLGPUVolumeRayCastMapper,
    vtkPiecewiseFunction,
    vtkRenderer,
    vtkRenderWindow,
    vtkStreamingDemandDrivenPipeline,
    vtkVolume,
    vtkVolumeProperty,
    vtkWindowToImageFilter,
)

LEAST_SSIM = 0.98
WINDOW = (120, 90)


def values(seed=0, n=13):
    """Values of a soft ball and a wave, 0 to 255, (n, n, n): no symmetry."""
    rng = np.random.default_rng(seed)
    z, y, x = np.mgrid[-1 : 1 : n * 1j, -1 : 1 : n * 1j, -1 : 1 : n * 1j]
    a, b, c = rng.uniform(-0.3, 0.3, 3)
    ball = np.clip(1.2 - np.sqrt((x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2), 0, 1)
    wave = 1 + 0.3 * np.sin(rng.uniform(1, 3) * x + rng.uniform(1, 3) * y)
    return (190 * ball * wave).astype(np.float32)


def image_of(array):
    """An image with these values at its points, [z, y, x]."""
    image = vtkImageData()
    image.SetDimensions(array.shape[::-1])
    scalars = numpy_to_vtk(np.ascontiguousarray(array).ravel(), deep=True)
    scalars.SetName("v")
    image.GetPointData().SetScalars(scalars)
    return image


def array_of(image):
    """The values of an image, to be written in place."""
    return vtk_to_numpy(image.GetPointData().GetScalars())


class Maker(VTKPythonAlgorithmBase):
    """A source that gives ``image``: each time that array, whatever was written into it.

    ``does`` says how it fails: "return 0", "raise", "nothing" (an image without points) or
    "no scalars". ``times`` are steps, the image's values being scaled by the time.
    """

    def __init__(self, image, times=()):
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkImageData")
        self.image, self.times, self.does = image, times, ""

    def RequestInformation(self, request, inputs, outputs):
        information, pipeline = outputs.GetInformationObject(0), vtkStreamingDemandDrivenPipeline
        information.Set(pipeline.WHOLE_EXTENT(), self.image.GetExtent(), 6)
        information.Set(vtkImageData.SPACING(), self.image.GetSpacing(), 3)
        information.Set(vtkImageData.ORIGIN(), self.image.GetOrigin(), 3)
        kind = self.image.GetPointData().GetScalars().GetDataType()
        vtkDataObject.SetPointDataActiveScalarInfo(information, kind, 1)
        if self.times:
            information.Set(pipeline.TIME_STEPS(), self.times, len(self.times))
            information.Set(pipeline.TIME_RANGE(), (self.times[0], self.times[-1]), 2)
        return 1

    def RequestData(self, request, inputs, outputs):
        if self.does == "raise":
            raise ValueError("told to fail")
        if self.does == "return 0":
            return 0
        output = vtkImageData.GetData(outputs)
        if self.does == "nothing":
            return 1
        if self.does == "no scalars":
            output.CopyStructure(self.image)
            return 1
        output.ShallowCopy(self.image)
        key = vtkStreamingDemandDrivenPipeline.UPDATE_TIME_STEP()
        information = outputs.GetInformationObject(0)
        if self.times and information.Has(key):
            scaled = array_of(self.image) * information.Get(key)
            output.GetPointData().SetScalars(numpy_to_vtk(scaled, deep=True))
        return 1

    def do(self, what):
        """Fail that way from now on, or no longer."""
        self.does = what
        self.Modified()


def property_of(*opacity, color=0.0, unit=2.0):
    """A volume property with these nodes of opacity, over 0 to 255."""
    prop = vtkVolumeProperty()
    colors, opacities = vtkColorTransferFunction(), vtkPiecewiseFunction()
    for at, r, g, b in ((0, color, 0.3, 0.9), (120, 0.3, 0.9, color), (255, 1.0, 0.5, 0.2)):
        colors.AddRGBPoint(at, r, g, b)
    for at, share in opacity or ((0, 0), (255, 0.6)):
        opacities.AddPoint(at, share)
    prop.SetColor(colors)
    prop.SetScalarOpacity(opacities)
    prop.SetScalarOpacityUnitDistance(unit)
    prop.SetInterpolationTypeToLinear()
    return prop


class Scene:
    """A window with one volume; ``way`` is "vtk", how a VDIMapper draws, or "watched".

    Attributes
    ----------
    first : vtkAlgorithm
        What takes the volume: VTK's mapper, or the VDISource.
    """

    def __init__(self, way, prop=None):
        self.way, self.renderer, self.window = way, vtkRenderer(), vtkRenderWindow()
        self.property = prop or property_of()
        if way == "vtk":
            # By its OpenGL class, whose module is what gives VTK's windows their OpenGL
            self.first = self.mapper = vtkOpenGLGPUVolumeRayCastMapper()
            self.mapper.SetAutoAdjustSampleDistances(0)
            self.mapper.SetSampleDistance(0.2)
            self.actor = vtkVolume()
        else:
            self.first, self.mapper, self.actor = (
                pvdi.VDISource(),
                pvdi.VDIMapper(),
                pvdi.VDIActor(),
            )
            self.first.SetSampleDistance(0.2)
            self.first.SetMaxSupersegments(100)
            if way == "watched":  # as if somebody looked at the window
                self.mapper.SetInteractiveOffScreen(True)
                self.mapper.SetTargetFrameRate(0)
            else:
                self.mapper.SetDraw(way)
            self.mapper.SetInputConnection(self.first.GetOutputPort())
        self.set_property(self.property)
        self.actor.SetMapper(self.mapper)
        self.window.SetOffScreenRendering(1)
        self.window.SetMultiSamples(0)
        self.window.SetSize(WINDOW)
        self.window.AddRenderer(self.renderer)
        self.renderer.SetBackground(0.1, 0.1, 0.2)
        self.renderer.AddVolume(self.actor)

    def set_property(self, prop):
        """Have the volume look another way."""
        self.property = prop
        (self.actor.SetProperty if self.way == "vtk" else self.first.SetVolumeProperty)(prop)

    def set_input(self, what):
        """Draw what an algorithm makes, an image, or nothing."""
        if what is None or hasattr(what, "GetOutputPort"):
            self.first.SetInputConnection(None if what is None else what.GetOutputPort())
        else:
            self.first.SetInputDataObject(what)

    def turn(self, azimuth, elevation=0.0):
        """Turn the view."""
        camera = self.renderer.GetActiveCamera()
        camera.Azimuth(azimuth)
        camera.Elevation(elevation)
        camera.OrthogonalizeViewUp()
        self.renderer.ResetCameraClippingRange()

    def reset(self):
        """Look at the whole volume, askew."""
        camera = self.renderer.GetActiveCamera()
        camera.SetPosition(1.0, 0.6, 2.0)
        camera.SetFocalPoint(0, 0, 0)
        camera.SetViewUp(0, 1, 0)
        self.renderer.ResetCamera()

    def picture(self):
        """Draw a frame, float (H, W, 3), 0 to 1."""
        self.window.Render()
        grab = vtkWindowToImageFilter()
        grab.SetInput(self.window)
        grab.ReadFrontBufferOff()
        grab.ShouldRerenderOff()
        grab.Update()
        width, height, _ = grab.GetOutput().GetDimensions()
        pixels = vtk_to_numpy(grab.GetOutput().GetPointData().GetScalars())
        return pixels.reshape(height, width, -1)[::-1, :, :3] / 255

    def close(self):
        """Let go of the window, and end what goes on behind the frames."""
        if self.way != "vtk":
            self.mapper.SetInputConnection(None)
        self.window.Finalize()


def assert_same(ours, judge, what):
    """Draw both, and have pictures and bounds agree; return VTK's picture."""
    np.testing.assert_allclose(ours.actor.GetBounds(), judge.actor.GetBounds(), err_msg=what)
    own, wanted = ours.picture(), judge.picture()
    ssim = compare_images(own, wanted).ssim
    assert ssim >= LEAST_SSIM, f"SSIM {ssim:.4f} after: {what}"
    np.testing.assert_allclose(ours.actor.GetBounds(), judge.actor.GetBounds(), err_msg=what)
    return wanted


def is_blank(picture):
    """Whether a picture shows the background alone."""
    return bool(np.ptp(picture.reshape(-1, 3), axis=0).max() < 0.02)
