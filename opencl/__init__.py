"""Kernel sources of pyvista_vdi: OpenCL C 1.2 text, no Python.

``#include "folder/file.cl"`` takes a path relative to this folder and is expanded by
:mod:`pyvista_vdi.device.sources`, once per file and with ``#line`` marks.

Map of the files
----------------
Shared functions:

``lib/lanes.cl``, ``lib/transpose.cl``
    What formulas are written of: numbers of one ray, or of sixteen, and their transposition.
``lib/rays.cl``
    Affine forms along the ray of a pixel, clipping to planes, pixels in blocks of 4 x 4.
``lib/directions.cl``
    Lengths and products of vectors in space.
``lib/double_float.cl``
    Sums, products and quotients of numbers of two floats.
``volume/sampling.cl``
    Samples of a uniform grid, nearest or trilinear, of scalars or RGBA.
``lib/classification.cl``
    Transfer function and extinction.
``lib/opacity.cl``
    Opacity of an optical depth, for one number or for vectors.
``volume/shading.cl``
    Lights, and gradient opacity: what the steps need of the scalar's gradient.
``volume/samples.cl``
    Steps that were sampled before they are composited.
``volume/medium.cl``
    Colour and optical depth around a sample.
``volume/occlusion.cl``
    Ambient occlusion at a sample.
``volume/blanking.cl``
    Blank points and cells of a volume.
``volume/rays_of_view.cl``, ``volume/march.cl``
    The steps along a ray of a volume: generation and direct volume rendering share them.
``volume/cropped_march.cl``, ``volume/projection.cl``
    What cropping keeps of a ray, and blend modes beside compositing.
``lib/list_space.cl``
    V_O's list space: coordinates of a ray in it, and its depth coordinate.
``lib/cropping.cl``
    The parts of a ray that cropping keeps.
``raycasting/frame.cl``
    The scalars that every kernel takes which draws a frame of a VDI.
``raycasting/supersegments.cl``
    How a list's supersegments are read: as they were made, or packed.
``raycasting/first_supersegment.cl``
    Which supersegment of a list a ray meets first (paper, Algorithm 1).
``raycasting/ray.cl``, ``raycasting/stepping.cl``, ``raycasting/walk.cl``
    A ray in list space; how it steps from list to list, and past what is empty; its walk.
``raycasting/stacks.cl``
    Stacks of cells of the occupancy grid, and which slab of one is ahead.
``multi_vdi/pool.cl``
    Where segments of rays through several VDIs are kept.
``cpu16/pixels.cl``, ``cpu16/rays.cl``, ``cpu16/lists.cl``, ``cpu16/walk.cl``, ``cpu16/pool.cl``
    The same of sixteen rays in vectors, on CPUs.
``lib/compositing.cl``
    Compositing front to back, with or without carrying what is rounded off.

Entry points:

``lib/probe.cl``
    ``probe``: the kernel that a device must run correctly before it is used.
``generation/march_lists.cl``, ``generation/shorten_lists.cl``, ``generation/pack_lists.cl``
    ``march_lists``, ``shorten_lists``, ``pack_lists``: volume to lists of supersegments, by the
    runs of ``generation/runs.cl`` in ``generation/records.cl``.
``generation/homogeneity.cl``
    ``cut_lists``, where homogeneity is asked for in place of least error.
``generation/offsets.cl``
    ``sum_lengths``, ``list_offsets``: where each list begins in a VDI's arrays.
``volume/bricks.cl``
    ``want_bricks``, ``sample_steps``: samples of a volume that is on the device brick by brick.
``large/optical_depths.cl``, ``large/runs.cl``
    ``optical_depths``, ``copy_runs``, ``append_runs``: of a volume in blocks, how much light enters
    each block, and the runs of its blocks to those of whole rays.
``series/decode.cl``
    ``decode_lists``: a step of a series from the arrays of its frame.
``raycasting/prepare.cl``, ``raycasting/prepare_packed.cl``
    ``prepare_lists``, ``prepare_packed``: a VDI's arrays to what the raycaster reads.
``raycasting/raycast.cl``, ``raycasting/first_hits.cl``
    ``raycast``, ``first_hits``: VDI to image from any view (paper, section 3), or to the depth of
    the first hit.
``cpu16/raycast.cl``, ``cpu16/packets.cl``, ``cpu16/aligned_view.cl``
    ``raycast_blocks``, ``raycast_packets``, ``raycast_aligned_view``: VDI to image on a CPU, by
    blocks of 4 x 4 rays; by rays along epipolar lines, far from V_O; at V_O.
``raycasting/clear.cl``
    ``clear_image``, ``clear_hits``: nothing where no rays are cast.
``multi_vdi/segments.cl``, ``cpu16/segments.cl``
    ``segments``, ``segments_of_blocks``: what rays cross of one of several VDIs.
``multi_vdi/merge.cl``, ``cpu16/merge.cl``
    ``merge``, ``merge_blocks``: that of several VDIs, to one image.
``multi_vdi/cells.cl``
    ``alone_ends``, ``take_cells``: where only one of several VDIs is met.
``raycasting/preview.cl``
    ``preview``: VDI to image by a given number of samples per ray (paper, section 5).
``volume/render_volume.cl``, ``volume/project.cl``
    ``render_volume``, ``project``: direct volume rendering, the baseline, and other blend modes.
``cpu16/generation_march.cl``, ``cpu16/generation_shorten.cl``,
``cpu16/generation_optical_depths.cl``, ``cpu16/volume_render.cl``, ``cpu16/volume_project.cl``
    The same kernels for sixteen rays in vectors, on CPUs, by ``cpu16/generation_records.cl`` and
    ``cpu16/volume_picture.cl``.
``raycasting/occupancy.cl``
    ``count_supersegments``, ``count_packed``, ``occupied_slabs``: the occupancy grid of a VDI
    (paper, section 4).
``volume/macrocells.cl``
    ``macrocell_ranges``, ``macrocell_visibility``: macrocells of a volume that are transparent.
``volume/scalar_media.cl``
    ``scalar_media``: the medium of each scalar of a volume of integers.
``volume/ambient_occlusion.cl``
    ``step_opacities``, ``ambient_transmittances``: ambient occlusion on a coarse grid.
"""
