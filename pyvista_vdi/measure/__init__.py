"""Measurements that a user can repeat: comparisons, benchmarks and trade-offs against VTK."""
