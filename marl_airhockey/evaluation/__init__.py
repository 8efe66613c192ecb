"""Evaluation of drivers: episodes, games, leagues, speed and statistics."""
