"""Volumes of any size: read and marched in blocks, whose lists are merged behind each other."""
