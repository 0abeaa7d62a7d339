"""Scenes of VTK and PyVista as pages: VDIs among meshes, lines, points and texts."""
