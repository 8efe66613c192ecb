"""Images, windows and videos of worlds."""
