"""Sensing: what is known of a state, with its delay, noise, occlusion and history."""
