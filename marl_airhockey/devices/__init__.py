"""Devices: cameras, what sees in their pictures, and robots."""
