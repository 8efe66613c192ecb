"""Basic types: table, seats, scene, state, physics, random numbers and limits."""
