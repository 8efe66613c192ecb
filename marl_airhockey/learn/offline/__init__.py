"""Learning from recordings alone, each algorithm in one file."""
