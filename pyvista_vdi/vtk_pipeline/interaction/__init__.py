"""What goes on between frames: motion, estimates, regeneration, status."""
