"""VDIs as OpenEXR deep images."""
