"""Devices: cameras, vision and robots."""
