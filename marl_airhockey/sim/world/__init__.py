"""Worlds: control steps of B worlds, from actions to rewards and observations."""
