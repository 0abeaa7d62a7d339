"""Classified volumes on a device: upload, bricks, light, volume rendering."""
