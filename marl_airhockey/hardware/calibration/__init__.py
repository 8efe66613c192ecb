"""Calibration: makes a rig's file from a camera, printed tags and an arm."""
