"""Sets of VDIs: one scene from many sides, in memory and in ``.vdiset`` files."""
