"""Offline reinforcement learning from recordings, with one file for each algorithm."""
