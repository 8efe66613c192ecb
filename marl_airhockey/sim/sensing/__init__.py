"""Simulated sensing: states with latency, noise and occlusion, and their history."""
