"""Worlds: one control step of B of them, from actions to rewards."""
