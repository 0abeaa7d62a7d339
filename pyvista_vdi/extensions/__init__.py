"""What is built on the core: each folder can be deleted, and the core goes on.

Each package here has a record of what it adds, ``EXTENSION``: see :mod:`pyvista_vdi.registry`.
"""
