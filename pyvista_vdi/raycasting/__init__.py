"""From VDIs to pictures, depths and picks, from any view."""
