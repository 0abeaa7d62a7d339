"""Series of VDIs: one scene at several times, in memory and in ``.vdis`` files."""
