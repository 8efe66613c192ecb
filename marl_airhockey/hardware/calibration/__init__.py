"""Calibration, which writes a rig's file with a camera, printed tags and an arm."""
