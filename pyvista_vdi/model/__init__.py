"""What a scene is made of: cameras, volumes, looks, VDIs and how they are measured; no device."""
