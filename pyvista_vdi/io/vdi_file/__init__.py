"""The file format ``.vdi``: layout, chunks, checksums."""
