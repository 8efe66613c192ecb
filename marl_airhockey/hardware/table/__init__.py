"""Backend of a real table, with a camera above it and an arm at its home side."""
