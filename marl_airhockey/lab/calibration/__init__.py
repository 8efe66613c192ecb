"""Calibration: from a camera, printed tags and an arm to a rig's file."""
