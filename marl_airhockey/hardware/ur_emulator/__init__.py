"""Emulated controller of a UR5e, with the network protocols of the real one."""
