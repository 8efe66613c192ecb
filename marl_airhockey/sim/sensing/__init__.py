"""Sensing: sensed states with delay, noise and occlusion, and their history."""
