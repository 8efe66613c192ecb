"""Rollouts: the loop over control steps, and the episodes that come of it."""
