"""Environments in the APIs of PettingZoo, Gymnasium and stable-baselines3."""
