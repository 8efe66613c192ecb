"""Table: the backend of a real table, with a camera above and an arm at its home."""
