"""Nouns: table, seats, scene, state, physics, random numbers, limits."""
