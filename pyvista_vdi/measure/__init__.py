"""Measurements that a user can repeat: comparisons with VTK and trade-offs."""
