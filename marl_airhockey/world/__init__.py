"""One control step of B worlds, from actions to rewards."""
