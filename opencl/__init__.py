"""Kernel sources of pyvista_vdi: OpenCL C 1.2 text, no Python.

``#include "folder/file.cl"`` takes a path relative to this folder and is expanded by
:mod:`pyvista_vdi.opencl_runtime.sources`, once per file and with ``#line`` marks.

Map of the files
----------------
Shared functions:

``common/rays.cl``
    Affine forms along the ray of a pixel, clipping to planes, pixels in blocks of 4 x 4.
``common/pairs.cl``
    Sums, products and quotients of numbers of two floats.
``common/volume_sampling.cl``
    Samples of a uniform grid, nearest or trilinear, of scalars or RGBA.
``common/classification.cl``
    Transfer function and extinction.
``common/opacity.cl``
    Opacity of an optical depth, for one number or for vectors.
``common/shading.cl``
    Lights, and gradient opacity: what the steps need of the scalar's gradient.
``common/samples.cl``
    Steps that were sampled before they are composited.
``common/occlusion.cl``
    Ambient occlusion at a sample.
``common/empty_blocks.cl``
    Size of the blocks by which marches skip what is transparent.
``common/march.cl``
    The steps along a ray of a volume: generation and direct volume rendering share them.
``common/list_space.cl``
    V_O's list space: coordinates of a ray in it, and its depth coordinate.
``common/cropping.cl``
    The parts of a ray that cropping keeps.
``common/list_ray.cl``
    The ray of a pixel in list space, clipped; model lengths along it.
``common/lists.cl``
    Which supersegment of a list a ray meets first (paper, Algorithm 1).
``common/over.cl``
    Compositing front to back, with or without carrying what is rounded off.
``common/supersegments.cl``
    How a list's supersegments are read: as they were made, or packed.
``common/occupancy.cl``
    Tiles and slabs of the occupancy grid.
``common/packet.cl``, ``common/packet_light.cl``, ``common/slabs_ahead.cl``
    Sixteen rays in vectors: where they are, what they see, and which slabs are ahead of them.
``common/quads.cl``, ``common/packet_cropping.cl``
    Vectors of theirs transposed, and the parts of them that cropping keeps.
``common/segments.cl``, ``common/segment_rows.cl``
    What rays cross of several VDIs, as segments in a pool; sixteen of them at a time.

Entry points:

``common/probe.cl``
    ``probe``: the kernel that a device must run correctly before it is used.
``vdi/generate.cl``, with ``vdi/runs.cl``
    ``march_lists``, ``shorten_lists``, ``pack_lists``: volume to lists of supersegments; with
    ``vdi/criteria.cl`` also ``cut_lists``, where another criterion than least error is asked for.
``vdi/march_blocks.cl``, ``vdi/shorten_blocks.cl``, with ``vdi/run_blocks.cl``
    ``march_blocks``, ``shorten_blocks``: ``march_lists`` and ``shorten_lists`` on a CPU, in vectors
    that are written out.
``vdi/offsets.cl``
    ``sum_lengths``, ``list_offsets``: where each list begins in a VDI's arrays.
``vdi/bricks.cl``
    ``want_bricks``, ``sample_steps``: samples of a volume that is on the device brick by brick.
``vdi/prepare.cl``
    ``prepare_lists``: a VDI's arrays to what the raycaster reads.
``vdi/raycast.cl``
    ``raycast``: VDI to image from any view (paper, section 3), to the depth of the first hit, or to
    what is merged with other VDIs; ``clear_image``: nothing where no rays are cast.
``vdi/raycast_blocks.cl``, ``vdi/raycast_packets.cl``
    ``raycast_blocks``, ``raycast_packets``: VDI to image on a CPU, in vectors that are written out:
    of 4 x 4 pixels near V_O, along epipolar lines far from it.
``vdi/merge.cl``, ``vdi/merge_blocks.cl``
    ``merge``, ``merge_blocks``: what rays cross of several VDIs, to one image; on a CPU in vectors.
``vdi/joint_cells.cl``
    ``alone_ends``, ``take_cells``: where only one of several VDIs is met.
``vdi/preview.cl``
    ``preview``: VDI to image by a given number of samples per ray (paper, section 5).
``vdi/render_volume.cl``
    ``render_volume``: direct volume rendering, the baseline.
``grid/occupancy.cl``
    ``count_supersegments``, ``occupied_slabs``: the occupancy grid of a VDI (paper, section 4).
``grid/volume_blocks.cl``
    ``block_ranges``, ``block_visibility``: blocks of a volume that are transparent.
``grid/ambient_occlusion.cl``
    ``step_opacities``, ``ambient_transmittances``: ambient occlusion on a coarse grid.
"""
