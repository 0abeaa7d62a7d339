"""Sources, readers, writers and filters of VTK pipelines."""
