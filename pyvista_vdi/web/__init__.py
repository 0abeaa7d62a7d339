"""VDIs in a web page: the viewer's JavaScript, and what brings it there with a VDI."""
