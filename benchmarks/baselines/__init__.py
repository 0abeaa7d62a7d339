"""A renderer that the paper compares itself with, as an honest test renderer.

docs/decisions/baselines.md says which.
"""
