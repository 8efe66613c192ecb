"""Rollouts: the loop over control steps, and the resulting episodes."""
