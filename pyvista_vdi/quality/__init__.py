"""Accuracy against speed: the dial, estimates of the view error, frame rates, regeneration."""
