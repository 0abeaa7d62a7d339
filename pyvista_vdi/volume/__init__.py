"""Classified volumes on a device: upload, bricks, light, ambient occlusion, volume rendering."""
