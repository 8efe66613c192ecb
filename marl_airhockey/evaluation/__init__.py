"""Evaluation: episodes, games, leagues, speed, statistics."""
